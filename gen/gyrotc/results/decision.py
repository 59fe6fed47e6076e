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
