"""`evaluate.json`, `compare.json` and `changes.json`: a correction, methods, and differences to an earlier result."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from ..common.inputs import AverageLength
from ..common.metrics import Averages, statistics_of
from ..common.statistics import coverage_factor
from .base import TABLE_BYTES, Amount, Count, Figure, Finding, Numeric, Part, UnitResult
from .release import HeldLimits, Verdict
from .rows import RowsCount


class Published(Part):
    """Figures of Ding et al. 2014, Table 1."""

    before_rms_dph: float = Field(description="deg/h")
    after_rms_dph: float = Field(description="deg/h")
    improvement_about_zero: float = Field(description="RMS before over RMS after")


class Group(Part):
    """What one method makes of one environment."""

    environment: str = Field(description="free text of the data set")
    samples: Count = Field(description="means over `average_s`")
    before_rms_dph: Figure = Field(description="deg/h")
    before_std_dph: Figure = Field(description="about the mean, deg/h")
    after_rms_dph: Figure = Field(description="deg/h")
    after_std_dph: Figure = Field(description="about the mean, deg/h")
    improvement: Figure = Field(description="RMS that a constant leaves over RMS after")
    improvement_about_zero: Figure = Field(description="RMS before over RMS after")
    published: Published | None = Field(
        default=None, description="the paper's figures, where the recordings are of its environments"
    )


class Method(Part):
    """What one training method makes of all environments."""

    id: str = Field(description="as `method` of `[fit]` takes it")
    groups: tuple[Group, ...] = Field(description="environment by environment")
    exam_rms_dph: Figure = Field(description="RMS over all environments, deg/h")
    exam_std_dph: Figure = Field(description="about the mean, deg/h")
    before_rms_dph: Figure = Field(description="deg/h")
    improvement: Figure = Field(description="RMS that a constant leaves over RMS after")
    improvement_about_zero: Figure = Field(description="RMS before over RMS after")
    centers: Count = Field(description="centers of the networks")
    parameter_bytes: Count = Field(description="parameters of its map as 32-bit words, bytes")
    sum_abs_weights_dph: float = Field(description="sum of the absolute weights, deg/h")
    noise_floor_dph: Figure = Field(description="as this method estimates it, deg/h")
    train_s: float = Field(description="processor time of training, s")
    published_train_s: tuple[float, float] | None = Field(default=None, description="least and most of the paper, s")


class Comparison(UnitResult):
    """Every training method on one data set (`gyrotc compare`)."""

    schema_: Annotated[Literal["gyrotc.compare/1"], Field(alias="schema")] = "gyrotc.compare/1"
    block_s: float = Field(description="length of a block, s")
    average_s: float = Field(description="averaging of all RMS figures, s")
    seed: int = Field(description="of everything that is drawn")
    judged_on: Literal["exam", "left_out"] = Field(description="exam runs, or what was left out in turn")
    noise_floor_dph: Figure = Field(description="estimated, of means over `average_s`, deg/h")
    noise_floor_source: Literal["estimated"] = Field(description="where the noise floor comes from")
    methods: tuple[Method, ...] = Field(description="in the order in which they were tried")


class Statistics(Part):
    """Figures of means over `average_s`; null where there is no sample."""

    mean_dph: Figure = Field(description="deg/h")
    std_dph: Figure = Field(description="about the mean, ddof 0, deg/h")
    rms_dph: Figure = Field(description="deg/h")
    max_abs_dph: Figure = Field(description="largest magnitude, deg/h")


class RunStatistics(Statistics):
    """The same of one run, and what the residual does over longer times; null where the run is too short."""

    rms_30min_dph: Figure = Field(description="RMS of means over 30 minutes, deg/h")
    angle_1h_arcsec: Figure = Field(description="RMS of the angle that one hour adds up to, arcsec")
    first_10min_rms_dph: Figure = Field(description="RMS of the first 10 minutes, deg/h")


def ratio_of(numerator: float | None, denominator: float | None) -> float | None:
    """Return the ratio of two figures; None where one is not known or the second is 0."""
    return numerator / denominator if numerator is not None and denominator else None


class Pooled(Part):
    """Several runs, every sample with the same weight."""

    before: Statistics = Field(description="before compensation")
    constant: Statistics = Field(description="after subtraction of a constant, see `constant_dph` of the result")
    after: Statistics = Field(description="after compensation")
    improvement: Figure = Field(
        description="RMS that a constant leaves over RMS after compensation: what the map gains, whatever constant is "
        "in the rate"
    )
    improvement_about_zero: Figure = Field(
        description="RMS before over RMS after compensation: it grows with any constant in the rate"
    )
    samples: Count = Field(description="means over `average_s`")

    @classmethod
    def of(cls, runs: Sequence[Averages], constant_dph: float | None = None) -> Pooled:
        """Return figures over all samples of several runs.

        Args:
            constant_dph: The constant that the correction is compared with; None: the mean of these samples.
        """
        before = np.concatenate([r.before_dph for r in runs]) if runs else np.zeros(0)
        after = np.concatenate([r.after_dph for r in runs]) if runs else np.zeros(0)
        if constant_dph is None:
            constant_dph = float(before.mean()) if before.size else 0.0
        was, flat, remains = (Statistics(**statistics_of(x)) for x in (before, before - constant_dph, after))
        return cls(
            before=was,
            constant=flat,
            after=remains,
            improvement=ratio_of(flat.rms_dph, remains.rms_dph),
            improvement_about_zero=ratio_of(was.rms_dph, remains.rms_dph),
            samples=int(after.size),
        )


class EvaluatedRun(Part):
    """One run before and after compensation."""

    file: str = Field(description="as in `dataset.toml`")
    role: Literal["train", "exam"] = Field(description="of the run")
    environment: str | None = Field(description="free text of the data set")
    from_s: Figure = Field(default=None, description="start of the span, s; only of spans")
    to_s: Figure = Field(default=None, description="end of the span, s; only of spans")
    samples: Count = Field(description="means over `average_s`")
    before: Statistics = Field(description="before compensation")
    constant: RunStatistics = Field(description="after subtraction of `constant_dph` of the result")
    after: RunStatistics = Field(description="after compensation")
    rows: RowsCount | None = Field(default=None, description="rows, used and left out; null: an older result")
    usable: Statistics | None = Field(
        default=None,
        description="after compensation, of the rows that may be used alone; null if no row is left out for what it "
        "shows",
    )


class FigureUncertainty(Part):
    """How well a figure is known from recordings of this length."""

    standard: Amount = Field(description="1 sigma, in the unit of the figure")
    freedom: Figure = Field(description="degrees of freedom; null: many")
    method: str = Field(description="what it rests on")

    @property
    def expanded(self) -> float:
        """Expanded uncertainty U of 95.45 %."""
        return coverage_factor(self.freedom) * self.standard


class ModelSizes(Part):
    """What was evaluated, and its sizes on a target."""

    method: str = Field(description="training method")
    centers: Count = Field(description="of all networks")
    table_bytes: Count = Field(description=TABLE_BYTES)
    rom_bytes: Count | None = Field(description="everything linked; null where nothing was compiled")
    ram_bytes: Count | None = Field(description="the caller's state; null where nothing was compiled")
    sizes_on: str | None = Field(description="target of these sizes")
    sum_abs_weights_dph: float = Field(description="largest sum of absolute weights of a network, deg/h")


class Requirement(Part):
    """Something that recordings must have before a limit can be passed on them."""

    id: str = Field(description="its stable name: `exam_covers_envelope`, `rows` or `power_ons`")
    verdict: Verdict = Field(description="best verdict that it allows: `PASS` where the recordings have it")
    text: str = Field(description="what the recordings have, and what a PASS needs")
    next: str = Field(default="", description="what to record; empty where the recordings have it")

    @property
    def met(self) -> bool:
        """Test whether the recordings have it."""
        return self.verdict == "PASS"


RMS_OVER_FLOOR = 1.3  # chosen: structure of 0.8 noise floors beside the noise, sqrt(1.3^2 - 1)
"""RMS over noise floor above which a result always says that structure is left."""


class ResidualTest(Part):
    """What remains of the judged runs, held against white noise of the same runs."""

    autocorrelation: Figure = Field(
        description="mean over the first `lags` lags of means over `average_s`; null: the runs are too short"
    )
    autocorrelation_limit: Figure = Field(description="four standard deviations above what white noise has")
    lags: Count = Field(description="number of lags")
    rms_over_floor: Amount = Field(description="RMS over the noise floor, of the rows that may be used")
    rms_over_floor_band: tuple[Amount, Amount] = Field(
        description="four standard deviations on either side of what white noise has, the floor estimated from as many "
        "means; at most 1.3"
    )

    @property
    def reasons(self) -> tuple[str, ...]:
        """In which of the two the residual is more than white noise, in words."""
        both = (
            ("autocorrelation", self.autocorrelation, self.autocorrelation_limit),
            ("RMS over the noise floor", self.rms_over_floor, self.rms_over_floor_band[1]),
        )
        return tuple(
            f"{name} {found:.2f}, white noise up to {most:.2f}"
            for name, found, most in both
            if found is not None and most is not None and found > most
        )


_OF_STRUCTURE = frozenset({"fails_on_unseen_span", "does_not_generalise"})

PARTS = {"exam": "exam runs", "left_out": "spans left out of training in turn", "train": "the training runs themselves"}
"""What a model may be judged by, in words."""


class Evaluation(UnitResult):
    """What the compiled code makes of recordings (`gyrotc evaluate`)."""

    schema_: Annotated[Literal["gyrotc.evaluate/1"], Field(alias="schema")] = "gyrotc.evaluate/1"
    numeric: Numeric = Field(description="arithmetic that was run")
    block_s: float = Field(description="length of a block, s")
    average_s: AverageLength = Field(description="averaging of all RMS figures, s")
    noise_floor_dph: Amount | None = Field(description="of means over `average_s`, deg/h")
    noise_floor_source: str | None = Field(description="`simulated`, or `estimated`")
    constant_dph: float = Field(
        description="weighted mean of the training bias, which the table falls back to without a temperature: the "
        "constant that the map is compared with, deg/h"
    )
    mismatches: Count | None = Field(description="steps that differ from the reference; null: not compared")
    requirements: tuple[Requirement, ...] = Field(
        description="what a PASS needs of the recordings, and whether they have it"
    )
    runs: tuple[EvaluatedRun, ...] = Field(description="every run")
    train: Pooled | None = Field(description="all training runs; null where there are none")
    exam: Pooled | None = Field(description="all exam runs; null where there are none")
    findings: tuple[Finding, ...] = Field(description="what a person should know, the gravest first")
    model: ModelSizes = Field(description="what was evaluated")
    left_out: Pooled | None = Field(default=None, description="without exam runs: spans left out of training in turn")

    generalises: bool | None = Field(
        default=None, description="whether the correction held on history that it had not seen; null: not known"
    )
    rows_left_out: Count | None = Field(
        default=None, description="rows of training runs that were left out for what they show; null: not known"
    )
    sigma_rms_dph: Amount | None = Field(
        default=None,
        description="RMS of the 1 sigma that the table states, over the rows that the model is judged by and where the "
        "correction is neither held nor clamped, deg/h; null where the table states none",
    )
    uncertainty: dict[str, FigureUncertainty] | None = Field(
        default=None,
        description="of the figures that the model is judged by, by the names of limits; without those that the "
        "recordings are too short for",
    )

    residual: ResidualTest | None = Field(
        default=None, description="of the runs that the model is judged by; null without an RMS or a noise floor"
    )
    usable: Statistics | None = Field(
        default=None,
        description="of all exam runs, else of all training runs, after compensation, of the rows that may be used "
        "alone; null if no row is left out for what it shows",
    )

    def judged(self) -> tuple[Literal["exam", "left_out", "train"], Pooled] | None:
        """What the model is judged by: exam runs, else spans left out, else the training runs themselves."""
        if self.exam:
            return "exam", self.exam
        if self.left_out:
            return "left_out", self.left_out
        return ("train", self.train) if self.train else None

    @property
    def structure_left(self) -> bool:
        """Whether the residual holds more than noise, by its test or by a finding: `gyrotc diagnose` is next."""
        return bool(self.residual and self.residual.reasons) or any(f.id in _OF_STRUCTURE for f in self.findings)

    @property
    def residual_words(self) -> str:
        """Why `gyrotc diagnose` is next; empty where it is not."""
        reasons = self.residual.reasons if self.residual else ()
        named = [f.id.replace("_", " ") for f in self.findings if f.id in _OF_STRUCTURE]
        return "; ".join((*reasons, *named))


class FigureChange(Part):
    """A figure of both results."""

    before: int | Figure = Field(description="of the earlier result")
    after: int | Figure = Field(description="of this one")


class TextChange(Part):
    """A text of both results."""

    before: str | None = Field(description="of the earlier result")
    after: str | None = Field(description="of this one")


class RangeChange(Part):
    """A range of both results, lowest and highest."""

    before: tuple[float, float] = Field(description="of the earlier result")
    after: tuple[float, float] = Field(description="of this one")


class Envelopes(Part):
    """Calibrated ranges."""

    temperature_c: RangeChange = Field(description="C")
    slope_c_per_min: RangeChange = Field(description="C/min")

    @classmethod
    def of(cls, **ranges: tuple[tuple[float, float], tuple[float, float]]) -> Envelopes:
        """From pairs of an earlier and a later range."""
        return cls(**{name: RangeChange(before=a, after=b) for name, (a, b) in ranges.items()})


class NameChanges(Part):
    """Names that came and went."""

    new: tuple[str, ...] = Field(description="only in this result")
    gone: tuple[str, ...] = Field(description="only in the earlier one")


class FileChanges(NameChanges):
    """Files that came, went, or have other bytes."""

    other_bytes: tuple[str, ...] = Field(description="in both, with another SHA-256")


class At(Part):
    """A place on the map."""

    temperature_c: float = Field(description="C")
    slope_c_per_min: float = Field(description="C/min")


class MapDifference(Part):
    """How far the maps differ where both were calibrated."""

    rms_dph: float = Field(description="deg/h")
    mean_dph: float = Field(description="deg/h")
    max_abs_dph: float = Field(description="deg/h")
    at: At = Field(description="where they differ most")
    rms_over_floor: Figure = Field(description="`rms_dph` over the noise floor; null where that is not known")
    expanded_uncertainty_dph: Amount | None = Field(
        default=None,
        description="U (k = 2) of `rms_dph`: twice the RMS by which the map moves although the gyro has not changed. "
        "With `--prior` by the noise of the new recordings and the earlier map's sigma; else by the uncertainties of "
        "both maps (`uncertainty_dph`; without it those of the means of what remains). Null where that is not known",
    )
    significant: bool | None = Field(
        default=None, description="whether `rms_dph` is more than that; null where it is not known"
    )


class AsFound(Part):
    """The earlier correction on the new recordings: how the unit was when it came back."""

    judged_on: Literal["exam", "train"] = Field(
        description="runs of the new data set that it was judged on; it has seen none of them"
    )
    figures: Pooled = Field(description="of these runs, `after` with the earlier correction")
    limits: HeldLimits | None = Field(description="the same limits; null where there were none")


class Calibration(Part):
    """One of the calibrations of a unit, the earliest first."""

    date: str | None = Field(description="`calibrated_on` of `[meta]`, else the start of the last recording")
    model_hash: str = Field(description="of its model")
    as_found_rms_dph: Figure = Field(description="of the correction before it on its recordings, deg/h")
    as_left_rms_dph: Figure = Field(description="of its own, deg/h")
    moved_rms_dph: Figure = Field(description="how far the map moved since the one before, deg/h")
    moved_mean_dph: Figure = Field(description="its mean over the common envelope, deg/h")
    expanded_uncertainty_dph: Figure = Field(description="U (k = 2) of `moved_rms_dph`")
    significant: bool | None = Field(description="whether it moved by more than that")


class Changes(UnitResult):
    """What is different from an earlier result (`gyrotc build --previous`)."""

    schema_: Annotated[Literal["gyrotc.changes/1"], Field(alias="schema")] = "gyrotc.changes/1"
    same_model: bool = Field(description="whether the models have one hash")
    model_hash: TextChange = Field(description="hashes of the models")
    recordings: FileChanges = Field(description="recordings that the models were fitted to")
    map: MapDifference | None = Field(description="null where the envelopes have nothing in common")
    envelope: Envelopes = Field(description="calibrated ranges")
    figures: dict[str, FigureChange | str] = Field(
        description="figures of both results; `judged_on` says on what those of recordings were measured, which are "
        "there where both results were judged on the same kind"
    )
    findings: NameChanges = Field(description="ids of findings")
    versions: dict[str, TextChange] = Field(description="programs whose version is another")
    files: FileChanges = Field(description="emitted files")
    as_found: AsFound | None = Field(
        default=None, description="null where `as_found_missing` says why, or of an older gyrotc"
    )
    as_found_missing: str = Field(default="", description="why there is no state as found")
    history: tuple[Calibration, ...] = Field(
        default=(), description="all calibrations that are known by their chain of `--previous`, this one last"
    )

    @property
    def named(self) -> tuple[tuple[str, NameChanges], ...]:
        """What came, went or has other bytes, by what it is."""
        return ("recordings", self.recordings), ("findings", self.findings), ("files", self.files)
