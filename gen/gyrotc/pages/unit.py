"""One axis of one unit as its page tells it: the results that stand in a folder, and words about them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from ..model import Model, load_model
from ..recordings.plausibility import EARTH_RATE_NOT_STATED
from ..results.base import read_optional, read_result
from ..results.decision import decision_of, failed_checks, next_step
from ..results.diagnosed import Diagnosed
from ..results.evaluation import PARTS, Changes, Evaluation
from ..results.release import VERDICTS, Budget, HeldLimits, Limit, Verdict, Verification
from ..results.rows import LeftOutRows
from ..results.training import Manifest, Training
from .display import failure_words, limit_words, plain, with_uncertainty, words

_JUDGED_ON = PARTS | {"exam": "test runs, never seen in training"}
_RULES = {
    "guard_band": "a guard band of w = U; PASS up to the limit less w, CONDITIONAL PASS from there up to the limit, "
    "else FAIL (ILAC-G8:09/2019, non-binary)",
    "guard_band_binary": "a guard band of w = U; PASS up to the limit less w, else FAIL (ILAC-G8:09/2019, binary)",
    "simple_acceptance": "simple acceptance, w = 0 (ILAC-G8:09/2019, binary)",
}
_SHOWN_ELSEWHERE = ("warnings", "environments", "description", "instrument")  # entries of `[meta]`


def unit_in(folder: Path) -> UnitResults:
    """Read the results of a unit from its folder.

    Raises:
        InputError: `model.json` or `evaluate.json` is missing, or a result is broken.
    """
    return UnitResults(
        model=load_model(folder / "model.json"),
        evaluation=read_result(folder / "evaluate.json", Evaluation),
        training=read_optional(folder / "training.json", Training),
        verification=read_optional(folder / "verify.json", Verification),
        manifest=read_optional(folder / "manifest.json", Manifest),
        diagnosis=read_optional(folder / "diagnosis" / "diagnose.json", Diagnosed),
        limits=read_optional(folder / "limits.json", HeldLimits),
        changes=read_optional(folder / "changes.json", Changes),
        budget=read_optional(folder / "budget.json", Budget),
    )


class UnitResults:
    """The results of one axis. What is not there is None."""

    def __init__(
        self,
        model: Model,
        evaluation: Evaluation,
        training: Training | None,
        verification: Verification | None,
        manifest: Manifest | None,
        diagnosis: Diagnosed | None,
        limits: HeldLimits | None,
        changes: Changes | None,
        budget: Budget | None,
    ) -> None:
        self.model, self.evaluation, self.training = model, evaluation, training
        self.verification, self.manifest, self.diagnosis = verification, manifest, diagnosis
        self.limits, self.changes, self.budget = limits, changes, budget
        judged = evaluation.judged()
        self.judged = judged[1] if judged else None
        self.judged_on = _JUDGED_ON[judged[0]] if judged else "nothing"

    @property
    def decision(self) -> Verdict | None:
        """Verdict from the limits and the proof; None without limits if nothing failed."""
        return decision_of(self.limits, self.verification, self.evaluation)

    @property
    def verdict(self) -> str:
        """Verdict as text; empty if there is none."""
        return self.decision or ""

    @property
    def failures(self) -> list[str]:
        """Checks that failed beside the limits, for every page, certificate and terminal."""
        return list(failed_checks(self.verification, self.evaluation))

    @property
    def failed(self) -> tuple[str, ...]:
        """Checks that failed, those of the limits among them; a command that finds some ends with status 1."""
        limits = self.limits.limits if self.limits else ()
        return (*self.failures, *(failure_words(one) for one in limits if not one.met))

    @property
    def held(self) -> list[Limit]:
        """The limits, those that are not met first."""
        limits = self.limits.limits if self.limits else ()
        return sorted(limits, key=lambda one: -VERDICTS.index(one.verdict))

    @property
    def counts(self) -> Counter[str]:
        """Number of limits with each verdict."""
        return Counter(one.verdict for one in self.held)

    def named(self, verdict: str) -> str:
        """The limits of a verdict, in words."""
        return "; ".join(limit_words(one.limit) for one in self.held if one.verdict == verdict)

    @property
    def next_step(self) -> str:
        """Next step with the unit."""
        return next_step(self.evaluation, self.limits, bool(self.failures), diagnosed=self.diagnosis is not None)

    @property
    def achieved(self) -> str:
        """Achievement of the table in a sentence; empty if nothing was measured."""
        judged = self.judged
        if judged is None or judged.after.rms_dph is None:
            return ""
        left = with_uncertainty(judged.after.rms_dph, self.spread("rms_dph"))
        gain = with_uncertainty(judged.improvement, self.spread("improvement"))
        comma = "," if "," in self.judged_on else ""
        return f"On {self.judged_on}{comma} the table leaves {left} deg/h RMS; a constant leaves {gain} times as much."

    @property
    def doubt(self) -> str:
        """Reason why the table is not all that the recordings show; empty if the residual is noise."""
        found = self.evaluation.residual_words
        return (
            f"The table does not explain these recordings: what remains is more than noise ({found})" if found else ""
        )

    @property
    def lacking(self) -> str:
        """The gravest lack of the recordings for a PASS; empty if they lack nothing."""
        lacking = self.evaluation.gravest_lack
        return lacking.text if lacking else ""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings that the model carries into the C code, without the one that a finding repeats."""
        repeated = any(finding.id == "earth_rate_not_stated" for finding in self.evaluation.findings)
        return tuple(w for w in self.model.warnings if not (repeated and w.endswith(EARTH_RATE_NOT_STATED)))

    @property
    def quiet(self) -> bool:
        """Test whether there is nothing that a person should know of the data."""
        return not (self.evaluation.findings or self.warnings)

    @property
    def firmware(self) -> dict[str, int]:
        """Files that a firmware is built with, and their bytes."""
        return self.manifest.firmware if self.manifest else {}

    @property
    def linked(self) -> str:
        """What a program that links table and runtime takes, in words; empty if nothing was compiled."""
        sizes = self.evaluation.model
        if not sizes.rom_bytes:
            return ""
        stack = "stack not measured" if sizes.stack_bytes is None else f"{sizes.stack_bytes} of stack"
        verified = self.verification
        cost = verified.instructions_of_sample(sizes.sizes_on, self.evaluation.numeric) if verified else None
        sample = "not measured" if cost is None else f"{cost.mean:.0f} on average, {cost.max} at most"
        return (
            f"{sizes.rom_bytes} bytes of code and constants, {sizes.ram_bytes} of memory, {stack}; "
            f"instructions for a sample: {sample} ({sizes.sizes_on})"
        )

    @property
    def left_out(self) -> tuple[LeftOutRows, ...]:
        """Stretches of rows that training left out because of what they show."""
        rows = self.training.rows if self.training else None
        return rows.stretches if rows else ()

    @property
    def capped(self) -> tuple[str, ...]:
        """Reasons why it is no PASS although it may be within its bounds, with what to record."""
        return self.limits.capped if self.limits else ()

    @property
    def rule(self) -> str:
        """The decision rule in words."""
        return _RULES[self.limits.decision_rule] if self.limits else ""

    def spread(self, figure: str) -> float | None:
        """Expanded uncertainty of a figure."""
        known = (self.evaluation.uncertainty or {}).get(figure)
        return known.expanded if known else None

    @property
    def over_floor(self) -> float | None:
        """RMS over noise floor."""
        floor, rms = self.evaluation.noise_floor_dph, self.judged.after.rms_dph if self.judged else None
        return rms / floor if floor and rms is not None else None

    @property
    def who(self) -> list[tuple[str, str]]:
        """Who, what and when, of what is known."""
        meta = {k: v for k, v in self.model.meta.items() if k not in _SHOWN_ELSEWHERE}
        product = self.limits.product if self.limits else ""
        date = meta.pop("calibrated_on", None)
        train = sum(run.role == "train" for run in self.evaluation.runs)
        found = [
            ("serial", self.model.serial + (f", axis {self.model.axis}" if self.model.axis else "")),
            ("product", product),
            ("calibrated on", str(date) if date is not None else "not stated"),
            *((words(key), plain(value)) for key, value in meta.items()),
            ("recordings", f"{train} for training, {len(self.evaluation.runs) - train} for the test"),
            ("correction", f"{self.model.method}, model {self.model.hash[:12]}"),
            ("description", str(self.model.meta.get("description", ""))),
            ("made with", f"gyrotc {self.evaluation.gyrotc_version}"),
        ]
        return [(name, value) for name, value in found if value]

    @property
    def other_changes(self) -> list[tuple[str, str, str | None]]:
        """Figures, versions and files that are not as in the earlier result: before and now, or one text."""
        return list(_changes(self.changes)) if self.changes else []


def _changes(changes: Changes) -> Iterator[tuple[str, str, str | None]]:
    for name, figure in changes.figures.items():
        if not isinstance(figure, str) and figure.before != figure.after:
            yield words(name), plain(figure.before), plain(figure.after)
    for name, version in changes.versions.items():
        yield name, version.before or "–", version.after or "–"
    for kind, part in changes.named:
        for what, names in part:
            if names:
                yield f"{kind}, {what.replace('_', ' ')}", ", ".join(names), None
