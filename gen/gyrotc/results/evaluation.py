"""`evaluate.json`, `compare.json` and `changes.json`: figures of a correction, of methods, and their changes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from ..common.inputs import AverageLength
from ..common.metrics import Averages, jackknife_blocks, lagged_products, statistics_of
from ..common.statistics import coverage_factor
from .base import TABLE_BYTES, Amount, Count, Figure, Finding, Numeric, Part, Positive, UnitResult
from .release import VERDICTS, HeldLimits, Verdict
from .rows import RowsCount


class Published(Part):
    """Figures of Ding et al. 2014, Table 1."""

    before_rms_dph: float = Field(description="RMS before compensation, deg/h")
    after_rms_dph: float = Field(description="RMS after compensation, deg/h")
    improvement_about_zero: float = Field(description="RMS before over RMS after")


class Group(Part):
    """Figures of one method in one environment."""

    environment: str = Field(description="environment, as the data set states it")
    samples: Count = Field(description="number of means over `average_s`")
    before_rms_dph: Figure = Field(description="RMS before compensation, deg/h")
    before_std_dph: Figure = Field(description="standard deviation before compensation, deg/h")
    after_rms_dph: Figure = Field(description="RMS after compensation, deg/h")
    after_std_dph: Figure = Field(description="standard deviation after compensation, deg/h")
    improvement: Figure = Field(description="RMS with a constant over RMS after compensation")
    improvement_about_zero: Figure = Field(description="RMS before over RMS after compensation")
    published: Published | None = Field(
        default=None, description="figures of the paper; null if the environment is none of the paper"
    )


class Method(Part):
    """Figures of one training method in all environments."""

    id: str = Field(description="name of the method, as `method` of `[fit]` takes it")
    groups: tuple[Group, ...] = Field(description="figures of each environment")
    exam_rms_dph: Figure = Field(description="RMS after compensation over all environments, deg/h")
    exam_std_dph: Figure = Field(description="standard deviation after compensation over all environments, deg/h")
    before_rms_dph: Figure = Field(description="RMS before compensation over all environments, deg/h")
    improvement: Figure = Field(description="RMS with a constant over RMS after compensation")
    improvement_about_zero: Figure = Field(description="RMS before over RMS after compensation")
    centers: Count = Field(description="number of centers of all networks")
    parameter_bytes: Count = Field(description="parameters of the map as 32-bit words, bytes")
    sum_abs_weights_dph: float = Field(description="largest sum of absolute weights of a network, deg/h")
    noise_floor_dph: Figure = Field(description="noise floor that the method estimates, deg/h")
    train_s: float = Field(description="processor time of training, s")
    published_train_s: tuple[float, float] | None = Field(
        default=None, description="shortest and longest training time of the paper, s; null if it states none"
    )


class Comparison(UnitResult):
    """Every training method on one data set (`gyrotc compare`)."""

    schema_: Annotated[Literal["gyrotc.compare/1"], Field(alias="schema")] = "gyrotc.compare/1"
    block_s: float = Field(description="length of a block, s")
    average_s: float = Field(description="averaging time of all RMS figures, s")
    seed: int = Field(description="seed from which everything random is drawn")
    judged_on: Literal["exam", "left_out"] = Field(
        description="data of the figures: `exam` for test runs, `left_out` for folds of the training runs"
    )
    noise_floor_dph: Figure = Field(description="estimated noise floor of means over `average_s`, deg/h")
    noise_floor_source: Literal["estimated"] = Field(description="source of the noise floor")
    methods: tuple[Method, ...] = Field(description="methods in the order in which they were tried")


class Statistics(Part):
    """Figures of means over `average_s`; null if there is none."""

    mean_dph: Figure = Field(description="mean, deg/h")
    std_dph: Figure = Field(description="standard deviation (of the population), deg/h")
    rms_dph: Figure = Field(description="RMS, deg/h")
    max_abs_dph: Figure = Field(description="largest magnitude, deg/h")


class RunStatistics(Statistics):
    """Figures of one run, with those over longer times; null if the run is too short."""

    rms_30min_dph: Figure = Field(description="RMS of means over 30 minutes, deg/h")
    angle_1h_arcsec: Figure = Field(description="RMS of the angle error over one hour, arcsec")
    first_10min_rms_dph: Figure = Field(description="RMS of the first 10 minutes, deg/h")


def ratio_of(numerator: float | None, denominator: float | None) -> float | None:
    """Return the ratio of two figures; None where one is not known or the second is 0."""
    return numerator / denominator if numerator is not None and denominator else None


class LastingError(Part):
    """Square of what remains for half an hour after compensation: an error of the correction does, noise does not."""

    mean_square_dph2: float = Field(
        description="mean product of two means of a run that are neighbours or up to half an hour apart, (deg/h)²; "
        "negative by chance if no error lasts"
    )
    standard_dph2: float = Field(
        ge=0.0,
        description="standard uncertainty of `mean_square_dph2`, (deg/h)², from a jackknife over blocks of the runs; "
        "at least that of white noise",
    )
    freedom: Positive = Field(description="degrees of freedom of `standard_dph2`")

    @classmethod
    def of(cls, runs: Sequence[Averages]) -> LastingError | None:
        """Return what lasts in some runs; None if none of them has means at two times."""
        steps = np.concatenate([np.diff(run.time_s) for run in runs]) if runs else np.zeros(0)
        if not steps.any():
            return None
        blocks = jackknife_blocks(runs, float(np.median(steps[steps > 0.0])))
        sums = np.array([lagged_products(block) for block in blocks])
        products, pairs = sums[sums[:, 1] > 0.0].T
        least = float(np.mean(np.concatenate([run.after_dph for run in runs]) ** 2)) / math.sqrt(pairs.sum())
        remaining = pairs.sum() - pairs
        without = (products.sum() - products)[remaining > 0] / remaining[remaining > 0]
        scatter = math.sqrt((len(without) - 1) * float(np.var(without))) if len(without) > 1 else 0.0
        return cls(
            mean_square_dph2=float(products.sum() / pairs.sum()),
            standard_dph2=max(scatter, least),
            freedom=float(max(len(without) - 1, 1)),
        )


class Pooled(Part):
    """Figures over several runs, every sample with the same weight."""

    before: Statistics = Field(description="before compensation")
    constant: Statistics = Field(
        description="after subtraction of a constant: of that which the table falls back to, in `training.json` of the "
        "mean of these samples"
    )
    after: Statistics = Field(description="after compensation")
    improvement: Figure = Field(
        description="RMS with a constant over RMS after compensation: the gain of the map, whatever constant is in the "
        "rate"
    )
    improvement_about_zero: Figure = Field(
        description="RMS before over RMS after compensation: it grows with any constant in the rate"
    )
    samples: Count = Field(description="number of means over `average_s`")
    lasting: LastingError | None = Field(
        default=None, description="error after compensation that lasts; null if no run has two means"
    )

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
            lasting=LastingError.of(runs),
        )


class EvaluatedRun(Part):
    """One run before and after compensation."""

    file: str = Field(description="name of the file in `dataset.toml`")
    role: Literal["train", "exam"] = Field(description="role of the run")
    environment: str | None = Field(description="environment, as the data set states it; null if not stated")
    from_s: Figure = Field(
        default=None, description="start of the run in its file, s; null means the start of the file"
    )
    to_s: Figure = Field(default=None, description="end of the run in its file, s; null means the end of the file")
    samples: Count = Field(description="number of means over `average_s`")
    before: Statistics = Field(description="before compensation")
    constant: RunStatistics = Field(description="after subtraction of `constant_dph` of the result")
    after: RunStatistics = Field(description="after compensation")
    rows: RowsCount | None = Field(
        default=None, description="rows used and left out; null if the result is of an older gyrotc"
    )
    usable: Statistics | None = Field(
        default=None,
        description="after compensation, of the rows that may be used alone; null if no row is left out for what it "
        "shows",
    )


class FigureUncertainty(Part):
    """Uncertainty of a figure from recordings of this length."""

    standard: Amount = Field(description="standard uncertainty, in the unit of the figure")
    freedom: Figure = Field(description="degrees of freedom; null means infinite")
    method: str = Field(description="derivation of the uncertainty, in words")

    @property
    def expanded(self) -> float:
        """Expanded uncertainty U for 95.45 %."""
        return coverage_factor(self.freedom) * self.standard


class ModelSizes(Part):
    """Method and sizes of the evaluated model."""

    method: str = Field(description="training method")
    centers: Count = Field(description="number of centers of all networks")
    table_bytes: Count = Field(description=TABLE_BYTES)
    rom_bytes: Count | None = Field(
        description="read-only memory of all linked code and constants, bytes; null if nothing was compiled"
    )
    ram_bytes: Count | None = Field(description="memory of the caller's state, bytes; null if nothing was compiled")
    stack_bytes: Count | None = Field(
        default=None,
        description="deepest stack of `check`, `init`, `sample` and `bias`, bytes, without helpers of the compiler's"
        " library; null if it was not measured",
    )
    sizes_on: str | None = Field(description="target of these sizes; null if nothing was compiled")
    sum_abs_weights_dph: float = Field(description="largest sum of absolute weights of a network, deg/h")


class Requirement(Part):
    """A property that recordings must have before a limit can be passed on them."""

    id: str = Field(description="stable name: `exam_covers_envelope`, `rows` or `power_ons`")
    verdict: Verdict = Field(description="best verdict that it allows: `PASS` if the recordings meet it")
    text: str = Field(description="state of the recordings and need of a PASS, in words")
    next: str = Field(default="", description="recording to make; empty if the recordings meet it")

    @property
    def met(self) -> bool:
        """Test whether the recordings meet it."""
        return self.verdict == "PASS"


RMS_OVER_FLOOR = 1.3  # chosen: structure of 0.8 noise floors beside the noise, sqrt(1.3^2 - 1)
"""RMS over noise floor above which a result always says that structure is left."""


class ResidualTest(Part):
    """Residual of the judged runs, compared with white noise of the same runs."""

    autocorrelation: Figure = Field(
        description="mean autocorrelation of means over `average_s` over the first `lags` lags; null if the runs are "
        "too short"
    )
    autocorrelation_limit: Figure = Field(description="limit for white noise: four standard deviations above its mean")
    lags: Count = Field(description="number of lags")
    rms_over_floor: Amount = Field(description="ratio of RMS to noise floor over the rows that may be used")
    rms_over_floor_band: tuple[Amount, Amount] = Field(
        description="range for white noise: four standard deviations either side, the floor estimated from as many "
        "means; at most 1.3"
    )

    @property
    def reasons(self) -> tuple[str, ...]:
        """Statistics by which the residual is more than white noise, in words."""
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

PARTS = {"exam": "test runs", "left_out": "spans left out of training in turn", "train": "the training runs themselves"}
"""Data that a model may be judged by, in words."""


class Evaluation(UnitResult):
    """Figures of the compiled code on recordings (`gyrotc evaluate`)."""

    schema_: Annotated[Literal["gyrotc.evaluate/1"], Field(alias="schema")] = "gyrotc.evaluate/1"
    numeric: Numeric = Field(description="arithmetic that was run")
    block_s: float = Field(description="length of a block, s")
    average_s: AverageLength = Field(description="averaging time of all RMS figures, s")
    noise_floor_dph: Amount | None = Field(
        description="noise floor of means over `average_s`, deg/h; null if not known"
    )
    noise_floor_source: str | None = Field(description="source of the noise floor: `simulated` or `estimated`")
    constant_dph: float = Field(
        description="weighted mean of the training bias, which the table falls back to without a temperature: the "
        "constant that the map is compared with, deg/h"
    )
    mismatches: Count | None = Field(description="steps that differ from the reference; null if not compared")
    requirements: tuple[Requirement, ...] = Field(description="properties of the recordings that a PASS needs")
    runs: tuple[EvaluatedRun, ...] = Field(description="all runs")
    train: Pooled | None = Field(description="figures over all training runs; null if there are none")
    exam: Pooled | None = Field(description="figures over all test runs; null if there are none")
    findings: tuple[Finding, ...] = Field(description="findings, the gravest first")
    model: ModelSizes = Field(description="method and sizes of the model")
    left_out: Pooled | None = Field(
        default=None,
        description="figures over spans left out of training in turn; null if there are test runs, if the method was "
        "named, or if the model was not made from these recordings",
    )

    generalises: bool | None = Field(
        default=None, description="true if the correction holds on history that it has not seen; null if not known"
    )
    rows_left_out: Count | None = Field(
        default=None,
        description="rows of training runs that were left out because of what they show; null if not known",
    )
    sigma_rms_dph: Amount | None = Field(
        default=None,
        description="RMS of the 1 sigma that the table states, over the rows of the test runs, else of the training "
        "runs, that are corrected without a status bit, deg/h; null if the table states none",
    )
    uncertainty: dict[str, FigureUncertainty] | None = Field(
        default=None,
        description="uncertainty of the figures that the model is judged by, by the names of limits; figures that the "
        "recordings are too short for are absent",
    )

    residual: ResidualTest | None = Field(
        default=None,
        description="residual of the runs that the model is judged by; null without an RMS or a noise floor",
    )
    usable: Statistics | None = Field(
        default=None,
        description="figures after compensation over the usable rows of all test runs, else of all training runs; null "
        "if no row is left out because of what it shows",
    )

    def judged(self) -> tuple[Literal["exam", "left_out", "train"], Pooled] | None:
        """Return the data that the model is judged by: test runs, else spans left out, else the training runs."""
        if self.exam:
            return "exam", self.exam
        if self.left_out:
            return "left_out", self.left_out
        return ("train", self.train) if self.train else None

    @property
    def gravest_lack(self) -> Requirement | None:
        """Requirement that the recordings miss by the worst verdict; None if they meet all."""
        lacking = [one for one in self.requirements if not one.met]
        return max(lacking, key=lambda one: VERDICTS.index(one.verdict), default=None)

    @property
    def structure_left(self) -> bool:
        """True if the residual is more than noise, by its test or by a finding; then `gyrotc diagnose` is next."""
        return bool(self.residual and self.residual.reasons) or any(f.id in _OF_STRUCTURE for f in self.findings)

    @property
    def residual_words(self) -> str:
        """Reasons why `gyrotc diagnose` is next, in words; empty if it is not."""
        reasons = self.residual.reasons if self.residual else ()
        named = [f.id.replace("_", " ") for f in self.findings if f.id in _OF_STRUCTURE]
        return "; ".join((*reasons, *named))


class FigureChange(Part):
    """A figure of both results."""

    before: int | Figure = Field(description="figure of the earlier result")
    after: int | Figure = Field(description="figure of this result")


class TextChange(Part):
    """A text of both results."""

    before: str | None = Field(description="text of the earlier result")
    after: str | None = Field(description="text of this result")


class RangeChange(Part):
    """A range of both results, lowest and highest."""

    before: tuple[float, float] = Field(description="range of the earlier result")
    after: tuple[float, float] = Field(description="range of this result")


class Envelopes(Part):
    """Calibrated ranges."""

    temperature_c: RangeChange = Field(description="calibrated temperatures, C")
    slope_c_per_min: RangeChange = Field(description="calibrated dT/dt, C/min")

    @classmethod
    def of(cls, **ranges: tuple[tuple[float, float], tuple[float, float]]) -> Envelopes:
        """Make one from pairs of an earlier and a later range."""
        return cls(**{name: RangeChange(before=a, after=b) for name, (a, b) in ranges.items()})


class NameChanges(Part):
    """Names that came and went."""

    new: tuple[str, ...] = Field(description="names that are in this result alone")
    gone: tuple[str, ...] = Field(description="names that are in the earlier result alone")


class FileChanges(NameChanges):
    """Files that came, went, or have other bytes."""

    other_bytes: tuple[str, ...] = Field(description="files of both results with different SHA-256")


class At(Part):
    """A place on the map."""

    temperature_c: float = Field(description="temperature, C")
    slope_c_per_min: float = Field(description="dT/dt, C/min")


class MapDifference(Part):
    """Difference of two maps over their common envelope."""

    rms_dph: float = Field(description="RMS difference, deg/h")
    mean_dph: float = Field(description="mean difference, deg/h")
    max_abs_dph: float = Field(description="largest difference, deg/h")
    at: At = Field(description="place of the largest difference")
    rms_over_floor: Figure = Field(description="`rms_dph` over the noise floor; null if the floor is not known")
    expanded_uncertainty_dph: Amount | None = Field(
        default=None,
        description="expanded uncertainty (k = 2) of `rms_dph`: twice the RMS by which the map of an unchanged gyro "
        "moves. With `--prior` it comes from the noise of the new recordings and the sigma of the earlier map, else "
        "from the uncertainties of both maps. Null if not known",
    )
    significant: bool | None = Field(
        default=None, description="true if `rms_dph` is above its expanded uncertainty; null if that is not known"
    )


class AsFound(Part):
    """The state of the unit as found: the earlier correction on the new recordings."""

    judged_on: Literal["exam", "train"] = Field(
        description="runs of the new data set that the earlier correction is judged on"
    )
    figures: Pooled = Field(description="figures of these runs; `after` is with the earlier correction")
    limits: HeldLimits | None = Field(description="limits compared with these figures; null without limits")


class Calibration(Part):
    """One of the calibrations of a unit, the earliest first."""

    date: str | None = Field(
        description="date of the calibration: `calibrated_on` of `[meta]`, else the start of the last recording"
    )
    model_hash: str = Field(description="hash of the model")
    as_found_rms_dph: Figure = Field(description="RMS of the earlier correction on the recordings, deg/h")
    as_left_rms_dph: Figure = Field(description="RMS of the new correction on the recordings, deg/h")
    moved_rms_dph: Figure = Field(description="RMS change of the map since the calibration before, deg/h")
    moved_mean_dph: Figure = Field(description="mean change of the map over the common envelope, deg/h")
    expanded_uncertainty_dph: Figure = Field(description="expanded uncertainty (k = 2) of `moved_rms_dph`, deg/h")
    significant: bool | None = Field(
        description="true if the map moved by more than its expanded uncertainty; null if not known"
    )


class Changes(UnitResult):
    """Changes since an earlier result (`gyrotc build --previous`)."""

    schema_: Annotated[Literal["gyrotc.changes/1"], Field(alias="schema")] = "gyrotc.changes/1"
    same_model: bool = Field(description="true if both models have the same hash")
    model_hash: TextChange = Field(description="hashes of the models")
    recordings: FileChanges = Field(description="recordings that the models were fitted to")
    map: MapDifference | None = Field(description="difference of the maps; null if the envelopes do not overlap")
    envelope: Envelopes = Field(description="calibrated ranges")
    figures: dict[str, FigureChange | str] = Field(
        description="figures of both results; `judged_on` names the data of those from recordings, which are present "
        "if both results were judged on the same kind of data"
    )
    findings: NameChanges = Field(description="changes of the ids of findings")
    versions: dict[str, TextChange] = Field(description="programs with another version")
    files: FileChanges = Field(description="changes of the emitted files")
    as_found: AsFound | None = Field(
        default=None,
        description="state of the unit as found; null if `as_found_missing` says why, or if written by an older gyrotc",
    )
    as_found_missing: str = Field(default="", description="reason why there is no state as found")
    history: tuple[Calibration, ...] = Field(
        default=(), description="known calibrations by the chain of `--previous`, this one last"
    )

    @property
    def named(self) -> tuple[tuple[str, NameChanges], ...]:
        """Changes of recordings, findings and files, with what they are."""
        return ("recordings", self.recordings), ("findings", self.findings), ("files", self.files)
