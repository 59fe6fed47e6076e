"""`training.json`, the record of a fit, and `manifest.json`, the record of a build."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from .base import Amount, Count, Figure, Finding, Part, UnitResult
from .evaluation import MapDifference, Pooled
from .fleet import KnownMap, LotUse, UnitCurve
from .rows import RowsUsed


class CheckedCell(Part):
    """Residual of the earlier model in a part of the check run, with its limit."""

    temperature_c: tuple[float, float] = Field(description="lowest and highest temperature of the part, C")
    slope_c_per_min: tuple[float, float] = Field(description="lowest and highest dT/dt of the run there, C/min")
    found_dph: float = Field(description="mean residual of the earlier map, deg/h")
    limit_dph: Amount = Field(
        description="limit of the magnitude of that mean, from the sigma of the earlier model, ageing and the noise of "
        "the run; all parts of an unchanged unit are within theirs in 99 of 100 check runs, deg/h"
    )
    within: bool = Field(description="true if the mean is within its limit")


ChangeKind = Literal["unchanged", "offset", "slope", "full"]


class TriedChange(Part):
    """A hypothesis about the change of the map since the earlier model, with its evidence."""

    kind: ChangeKind = Field(
        description="kind of change: none, an offset, an offset and a slope over T and dT/dt, or another shape"
    )
    log10_odds: float = Field(description="decimal logarithm of its odds against an unchanged map")
    moved_rms_dph: Amount = Field(description="RMS change of the map over the earlier envelope, deg/h")
    expanded_uncertainty_dph: Amount = Field(
        description="expanded uncertainty (k = 2) of that RMS, from noise and the sigma of the earlier model, deg/h"
    )


class MapChange(Part):
    """The change of the map: kind, region and size."""

    kind: Literal["offset", "slope", "rate", "local"] = Field(
        description="kind of change: the same everywhere, in proportion to T, in proportion to dT/dt, or in a region"
    )
    temperature_c: tuple[float, float] = Field(description="temperatures of the change, from and to, C")
    slope_c_per_min: tuple[float, float] = Field(description="dT/dt of the change, from and to, C/min")
    size_dph: float = Field(
        description="size, deg/h: the offset, the difference of both ends of the region, or the value in its middle"
    )
    standard_uncertainty_dph: Amount = Field(description="standard uncertainty of the size, deg/h")
    text: str = Field(description="the change in words")


class EarlierUse(Part):
    """Use of the earlier model of a unit in its recalibration."""

    model_hash: str = Field(description="hash of the earlier model")
    date: str | None = Field(description="date of the earlier calibration; null if it states none")
    ageing_dph: Amount = Field(description="standard deviation of the drift of the bias since then, deg/h")
    ageing_from: str = Field(description="source of that figure")
    chosen: ChangeKind = Field(
        description="change of the map: the kind with the largest odds among the consistent ones of `tried`, or "
        "among all if none is. An unchanged map is consistent if it moves by no more than U with ageing, a changed one "
        "if it moves by more than U"
    )
    tried: tuple[TriedChange, ...] = Field(description="all hypotheses, the chosen one first")
    moved: MapDifference = Field(
        description="movement of the map over the earlier envelope; its U contains the noise of the run and the sigma "
        "of the earlier model, not the ageing"
    )
    accepted: bool = Field(description="true if the table is made from both, false if from the new recordings alone")
    change: MapChange | None = Field(description="change of the map; null if there is none")
    cells: tuple[CheckedCell, ...] = Field(description="parts of the check run, by ascending temperature")
    own_share: Figure = Field(
        description="share of the variance of the earlier map after ageing that the check run has removed, mean over "
        "the region where corrections are needed; null if the earlier model was not used"
    )
    prior_sigma_dph: Amount = Field(description="RMS of 1 sigma of the earlier model after ageing, deg/h")
    sigma_dph: Amount = Field(description="RMS of 1 sigma of both together, deg/h")
    curve: UnitCurve | None = Field(description="curves of the picture; null if the earlier model was not used")
    text: str = Field(description="the use of the earlier model in words")


_Length = Annotated[float, Field(gt=0.0, le=1e12)]


class DeclaredUnits(Part):
    """Units of the recordings."""

    declared: dict[str, str] = Field(description="declared unit of each column")
    trusted: tuple[str, ...] = Field(
        description="columns whose values look like another unit, accepted by `trust_units`"
    )


class SpanLeftOut(Part):
    """A span that was left out of training in turn."""

    file: str = Field(description="name of the file in `dataset.toml`")
    from_s: float = Field(description="start of the span, s")
    to_s: float = Field(description="end of the span, s")
    kind: Literal["branch", "part", "run", "power-on"] = Field(
        description="kind of span: a branch of a cycle, a part of a run without branches, a run, or a whole power-on"
    )
    guard_s: Amount = Field(description="time before and after the span that was kept out of training, too, s")


class AllanPoint(Part):
    """A point of the Allan deviation."""

    tau_s: _Length = Field(description="averaging time, s")
    deviation_dph: Amount = Field(description="Allan deviation, deg/h")
    freedom: _Length = Field(description="approximate number of independent differences")


class NoiseLimits(Part):
    """Upper limits (95 %) of the noise terms that are not resolved; null means resolved, or not known."""

    quantisation_arcsec: Figure = Field(default=None, description="quantisation noise Q, arcsec")
    arw_deg_per_sqrt_h: Figure = Field(default=None, description="angle random walk N, deg/√h")
    bias_instability_dph: Figure = Field(default=None, description="bias instability B, deg/h")
    rate_random_walk_dph_per_sqrt_h: Figure = Field(default=None, description="rate random walk K, deg/h/√h")


class NoiseTerms(Part):
    """Noise after compensation (IEEE Std 647, 952); 0 means not resolved, null that the record is too short."""

    quantisation_arcsec: Figure = Field(description="quantisation noise Q, arcsec")
    arw_deg_per_sqrt_h: Figure = Field(description="angle random walk N, deg/√h")
    bias_instability_dph: Figure = Field(description="bias instability B, deg/h")
    rate_random_walk_dph_per_sqrt_h: Figure = Field(description="rate random walk K, deg/h/√h")
    allan: tuple[AllanPoint, ...] = Field(description="Allan deviation at octaves of the block length")
    below: NoiseLimits = Field(
        default=NoiseLimits(), description="upper limits (95 %) of the terms that are not resolved"
    )


class BiasPlane(Part):
    """A plane through the bias before compensation; null if the input hardly changes."""

    bias_dph_per_c: Figure = Field(description="slope over temperature, deg/h/C")
    bias_dph_per_c_per_min: Figure = Field(description="slope over dT/dt, deg/h/(C/min)")
    residual_rms_dph: Figure = Field(description="RMS residual of the plane, deg/h")


class CandidateModel(Part):
    """A correction that was tried."""

    id: str = Field(description="name of the method")
    left_out_rms_dph: Figure = Field(
        description="RMS that is expected of new means on thermal history left out in turn, so never less than the "
        "noise, all pieces counting alike, deg/h; null if not known"
    )
    loss: float | None = Field(
        default=None,
        description="mean logarithm of the RMS expected on pieces of history left out, less that of the best "
        "candidate; null if not known",
    )
    doubt: Figure = Field(
        default=None, description="standard error of this difference over the pieces; null of the best candidate"
    )
    chosen: bool = Field(description="true of the candidate that is emitted")
    refused: str | None = Field(default=None, description="reason why it must not be used; null if it may")


class ChannelTried(Part):
    """A recorded channel, or a difference of temperature sensors, tried as an input (`channels` of `[fit]`)."""

    name: str = Field(
        description='column of the channel; "a - b" for a difference, the gyro\'s own sensor is "temperature_c"'
    )
    verdict: Literal["taken", "not earned", "collinear", "refused"] = Field(description="decision on the channel")
    reason: str = Field(description="reason of the decision, in words")
    shape: Literal["line", "product", "curve"] | None = Field(
        default=None,
        description="what it adds: a straight line, a line whose slope depends on temperature, a line with two "
        "Gaussians; where taken",
    )
    slope_dph_per_unit: float | None = Field(
        default=None, description="slope of the straight line through what it adds, deg/h per unit; where taken"
    )
    left_out_rms_before_dph: Figure = Field(
        default=None,
        description="RMS expected on history left out with the channels taken before it, deg/h; where taken",
    )
    left_out_rms_after_dph: Figure = Field(
        default=None, description="RMS expected on history left out with this channel added, deg/h; where taken"
    )
    share_of_variance: Figure = Field(
        default=None, description="variance of what it adds over that of the measured bias; where taken"
    )


class MapMeans(Part):
    """Means of the bias over the envelope, gathered from the runs; a lot is learnt from them."""

    temperature_c: tuple[float, ...] = Field(description="temperature of each mean, C")
    slope_c_per_min: tuple[float, ...] = Field(description="dT/dt of each mean, C/min")
    bias_dph: tuple[float, ...] = Field(description="bias of each mean, deg/h")
    count: tuple[float, ...] = Field(description="number of independent means over `mean_s` in each mean")
    sigma_dph: _Length = Field(description="noise of a mean over `mean_s`, 1 sigma, deg/h")
    mean_s: _Length = Field(description="averaging time, s")


class Training(UnitResult):
    """Record of a fit (`gyrotc fit`)."""

    schema_: Annotated[Literal["gyrotc.fit/1"], Field(alias="schema")] = "gyrotc.fit/1"
    units: DeclaredUnits = Field(description="units of the recordings")
    method: str = Field(description="training method")
    seed: int = Field(description="seed from which everything random is drawn")
    samples: Count = Field(description="number of blocks that were trained on")
    block_s: float = Field(description="length of a block, s")
    average_s: float = Field(description="averaging time of all RMS figures, s")
    centers: Count = Field(description="number of centers of all networks")
    parameter_bytes: Count = Field(description="parameters of the map as 32-bit words, bytes")
    sum_abs_weights_dph: float = Field(description="largest sum of absolute weights of a network, deg/h")
    predicted_rms_ratio: Figure = Field(
        description="expected ratio of RMS to noise floor on data of the same history; null if there is no prediction"
    )
    prediction_withheld: str | None = Field(description="reason why there is no prediction; null if there is one")
    noise_floor_dph: Figure = Field(description="estimated noise floor of means over `average_s`, deg/h")
    spans: tuple[SpanLeftOut, ...] = Field(
        description="pieces of history that were left out in turn; empty if the method was named"
    )
    left_out: Pooled | None = Field(
        description="figures on these pieces, each from a fit without it; null if the method was named"
    )
    left_out_spans: tuple[Pooled, ...] = Field(description="these figures for each piece")
    noise: NoiseTerms = Field(description="noise of the compensated training runs")
    sensitivity: BiasPlane = Field(description="plane through the bias before compensation")
    candidates: tuple[CandidateModel, ...] = Field(
        description="candidates that were tried, the simplest first; empty if the method was named"
    )
    reason: str = Field(description="reason of the choice, in words")
    generalises: bool | None = Field(
        description="true if the correction holds on history that it has not seen; null if not tested"
    )
    findings: tuple[Finding, ...] = Field(description="findings of the fit")
    curves: dict[str, Any] = Field(
        description="figures of the method; with `sizes` and `chosen` if it chose a number of centers"
    )
    channels: tuple[ChannelTried, ...] | None = Field(
        default=None,
        description="recorded channels that were tried as inputs; absent if `[fit]` does not ask for `channels`",
    )
    rows: RowsUsed | None = Field(
        default=None, description="rows of the training runs, used and left out; absent for an extended model"
    )
    means: MapMeans | None = Field(
        default=None, description="means of the bias over the envelope; absent for an extended model"
    )
    lot: LotUse | None = Field(default=None, description="use of the lot; null without `--lot`")
    prior: EarlierUse | None = Field(default=None, description="use of the earlier model; null without `--prior`")
    known: KnownMap | None = Field(
        default=None, description="prior for the next recalibration; absent for an extended model"
    )


class Manifest(UnitResult):
    """Record of a build, for its certificate."""

    schema_: Annotated[Literal["gyrotc.manifest/1"], Field(alias="schema")] = "gyrotc.manifest/1"
    model_hash: str = Field(description="hash of the model")
    refused: dict[str, str] = Field(description="arithmetics that were left out, with the reason")
    versions: dict[str, str] = Field(description="versions of the programs that made the build")
    meta: dict[str, Any] = Field(description="`[meta]` of the data set")
    units: DeclaredUnits = Field(description="units of the recordings")
    sources: tuple[Any, ...] = Field(description="`[source]` of recordings that were imported")
    program: str = Field(default="", description="SHA-256 of the program; empty if an older gyrotc did not state it")
    files: dict[str, str] = Field(
        description="SHA-256 of the files that the build wrote before this one, by their paths in the folder; "
        "`SHA256SUMS` has all files as they are now"
    )
    firmware: dict[str, Count] = Field(
        default={}, description="files of `c/` that a firmware is built with, by their names, and their bytes"
    )
