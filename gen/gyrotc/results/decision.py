"""Add up the statements of conformity of a unit: of its limits, of its axes, of the proof of its code."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from .evaluation import Evaluation
from .release import VERDICTS, HeldLimits, Verdict, Verification


def worst_of(verdicts: Iterable[Verdict | None]) -> Verdict | None:
    """The gravest of several verdicts; None where there is none: nothing was judged."""
    return max((v for v in verdicts if v), key=VERDICTS.index, default=None)


def decision_of(limits: HeldLimits | None, verification: Verification | None, evaluation: Evaluation) -> Verdict | None:
    """Return the verdict of a unit: FAIL where its code failed a check, else that of its limits; None without both."""
    failed = any(failed_checks(verification, evaluation))
    return "FAIL" if failed else limits.verdict if limits else None


def next_step(evaluation: Evaluation, limits: HeldLimits | None, failures: bool, *, diagnosed: bool) -> str:
    """Return what to do next with a unit, one step.

    Code that failed a check comes first, then recordings that are worthless, then an arithmetic whose rounding is above
    the noise. A diagnosis is made of the recordings that are there, so it comes before any advice to record more.

    DATASET stands for the recordings, DIR for the result.

    Args:
        failures: True if a check of its code failed.
        diagnosed: True if it was diagnosed already.
    """
    if failures:
        return (
            "Do not use the table: its code is not the model. Build it again, and report it if the check fails again."
        )
    lacking = evaluation.gravest_lack
    if lacking and lacking.verdict == "NOT TESTABLE":
        return lacking.next
    coarse = [one.next for one in evaluation.findings if one.id == "coarse_arithmetic"]
    if coarse:
        return coarse[0]
    if evaluation.structure_left and not diagnosed:
        return "gyrotc diagnose DATASET: the residual is more than noise, and it names the cause."
    if lacking:
        return lacking.next
    broken = [one for one in limits.limits if one.verdict == "FAIL"] if limits else []
    if any(one.part for one in broken):
        remains = (
            "what the diagnosis does not explain" if evaluation.structure_left else "noise, which no map takes off"
        )
        return f"Reject the unit, or state another limit: what remains is {remains}."
    if broken:
        names = ", ".join(dict.fromkeys(one.limit for one in broken))
        return f"Look at {names} in the limits file: what is not met there does not depend on the recordings."
    advised = [one.next for one in evaluation.findings if one.next]
    if advised:
        return advised[0]
    if limits is None or limits.verdict is None:
        return "State the limits of the product in a file (docs/limits.md), and build again with --limits."
    if limits.verdict != "PASS":
        return "Record more or longer test runs: the figures are within the limits, their uncertainty is not."
    return "Build the files in DIR/c/ into the firmware; gyrotc certificate DIR --out CERT writes the certificate."


def failed_checks(verification: Verification | None, evaluation: Evaluation) -> Iterator[str]:
    """Yield what failed of the proof that the emitted code is the model, in words."""
    if verification:
        for target in verification.targets:
            if target.status == "fail":
                reason = target.error or f"{target.mismatches} of {target.vectors} vectors differ"
                yield f"{target.name}, {target.numeric}: {reason}"
        for file in verification.emitted:
            if file.status == "fail":
                yield f"{file.file}: {file.verdict}"
        for error in verification.errors:
            if error.status == "fail":
                yield (
                    f"{error.numeric}: {error.worst_dph:.3g} deg/h from the model, above the proven bound of "
                    f"{error.bound_dph:.3g}"
                )
    if evaluation.mismatches:
        yield f"{evaluation.mismatches} steps of the recordings differ from the reference"
