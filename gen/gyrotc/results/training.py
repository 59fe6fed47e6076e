"""`training.json`: how a model was fitted, what was tried, what was known of the unit; and `manifest.json`."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from .base import Amount, Count, Figure, Finding, Part, UnitResult
from .evaluation import MapDifference, Pooled
from .fleet import KnownMap, LotUse, UnitCurve
from .rows import RowsUsed


class CheckedCell(Part):
    """What the earlier model left of the check run in a part of the envelope, and what it may have left."""

    temperature_c: tuple[float, float] = Field(description="from, to, C")
    slope_c_per_min: tuple[float, float] = Field(description="lowest and highest dT/dt of the run there, C/min")
    found_dph: float = Field(description="mean of what the earlier map left, deg/h")
    limit_dph: Amount = Field(
        description="what it may be, either way: by the earlier model's sigma, ageing and the noise of the run; all "
        "cells of a unit that has not changed lie within theirs in 99 of 100 check runs"
    )
    within: bool = Field(description="whether it is")


ChangeKind = Literal["unchanged", "offset", "slope", "full"]


class TriedChange(Part):
    """What may have become of the map since the earlier model, and what the check run says of it."""

    kind: ChangeKind = Field(
        description="as it was, moved by an offset, by an offset and a slope over T and dT/dt, or changed in its shape"
    )
    log10_odds: float = Field(description="evidence for it against that for the map as it was, power of ten")
    moved_rms_dph: Amount = Field(description="how far the map then moves over the earlier envelope, RMS, deg/h")
    expanded_uncertainty_dph: Amount = Field(
        description="U (k = 2): twice the RMS that noise and the earlier model's sigma give although nothing changed"
    )


class MapChange(Part):
    """The change of the map: what it is, where, and how large."""

    kind: Literal["offset", "slope", "rate", "local"] = Field(
        description="the same everywhere, in proportion to T, in proportion to dT/dt, or in a region"
    )
    temperature_c: tuple[float, float] = Field(description="where, C")
    slope_c_per_min: tuple[float, float] = Field(description="where, C/min")
    size_dph: float = Field(
        description="deg/h: the offset, from one end of the region to the other, or in the middle of the region"
    )
    standard_uncertainty_dph: Amount = Field(description="of it, deg/h")
    text: str = Field(description="in words")


class EarlierUse(Part):
    """What the earlier model of a unit did for its recalibration."""

    model_hash: str = Field(description="of the earlier model")
    date: str | None = Field(description="of the earlier calibration; null: it states none")
    ageing_dph: Amount = Field(description="how far the bias may have moved since, 1 sigma, deg/h")
    ageing_from: str = Field(description="where that comes from")
    chosen: ChangeKind = Field(
        description="what became of the map: the best supported of `tried` of those by which it moves by more than U "
        "where it has changed, and by no more than U and ageing give where not"
    )
    tried: tuple[TriedChange, ...] = Field(description="all that were tried, that which was chosen first")
    moved: MapDifference = Field(
        description="how far the map has moved over the earlier envelope; U holds the noise of the run and the earlier "
        "model's sigma, not the ageing"
    )
    accepted: bool = Field(description="whether the table is made from both; else from the new recordings alone")
    change: MapChange | None = Field(description="what changed; null: nothing")
    cells: tuple[CheckedCell, ...] = Field(description="the check run in parts, T ascending")
    own_share: Figure = Field(
        description="of the variance that the earlier model leaves after ageing, mean over where corrections are "
        "asked for: what the check run has removed"
    )
    prior_sigma_dph: Amount = Field(description="1 sigma of the earlier model after ageing, RMS, deg/h")
    sigma_dph: Amount = Field(description="1 sigma of both together, deg/h")
    curve: UnitCurve | None = Field(description="for the picture; null: the earlier model was not used")
    text: str = Field(description="in words")


_Length = Annotated[float, Field(gt=0.0, le=1e12)]


class DeclaredUnits(Part):
    """Units of the recordings."""

    declared: dict[str, str] = Field(description="unit by column, as declared")
    trusted: tuple[str, ...] = Field(description="what values look like that contradict them, but were taken")


class SpanLeftOut(Part):
    """A span that was left out in turn."""

    file: str = Field(description="as in `dataset.toml`")
    from_s: float = Field(description="its start, s")
    to_s: float = Field(description="its end, s")
    kind: Literal["branch", "part", "run", "power-on"] = Field(
        description="a branch of a cycle, a part of a run without branches, a whole run, or a run of a whole power-on"
    )
    guard_s: Amount = Field(description="what was not trained on at either side of it besides, s")


class AllanPoint(Part):
    """A point of the Allan deviation."""

    tau_s: _Length = Field(description="averaging time, s")
    deviation_dph: Amount = Field(description="deg/h")
    freedom: _Length = Field(description="number of independent differences, about")


class NoiseLimits(Part):
    """What terms of noise that are not resolved are below (95 %); null: resolved, or not known."""

    quantisation_arcsec: Figure = Field(default=None, description="Q, arcsec")
    arw_deg_per_sqrt_h: Figure = Field(default=None, description="angle random walk N, deg/√h")
    bias_instability_dph: Figure = Field(default=None, description="B, deg/h")
    rate_random_walk_dph_per_sqrt_h: Figure = Field(default=None, description="K, deg/h/√h")


class NoiseTerms(Part):
    """Noise that remains after compensation (IEEE Std 647, 952); 0: not resolved, null: the record is too short."""

    quantisation_arcsec: Figure = Field(description="Q, arcsec")
    arw_deg_per_sqrt_h: Figure = Field(description="angle random walk N, deg/√h")
    bias_instability_dph: Figure = Field(description="B, deg/h")
    rate_random_walk_dph_per_sqrt_h: Figure = Field(description="K, deg/h/√h")
    allan: tuple[AllanPoint, ...] = Field(description="at octaves of the block")
    below: NoiseLimits = Field(default=NoiseLimits(), description="what terms that are not resolved are below (95 %)")


class BiasPlane(Part):
    """A plane through the bias before compensation; null where the input hardly changes."""

    bias_dph_per_c: Figure = Field(description="slope in temperature, deg/h/C")
    bias_dph_per_c_per_min: Figure = Field(description="slope in its rate, deg/h/(C/min)")
    residual_rms_dph: Figure = Field(description="what the plane leaves, deg/h")


class CandidateModel(Part):
    """A correction that was tried."""

    id: str = Field(description="method")
    left_out_rms_dph: Figure = Field(
        description="RMS on thermal history left out in turn, all pieces counting alike, deg/h; null if not known"
    )
    loss: float | None = Field(
        default=None,
        description="mean logarithm of the RMS on pieces of history left out, less that of the best candidate; null if "
        "not known",
    )
    doubt: Figure = Field(
        default=None, description="standard error of this difference over the pieces; null of the best candidate"
    )
    chosen: bool = Field(description="true of the candidate that is emitted")
    refused: str | None = Field(default=None, description="why it must not be used; null if it may")


class ChannelTried(Part):
    """A recorded channel, or a difference of thermometers, that was tried as an input (`channels` of `[fit]`)."""

    name: str = Field(description='its column; "a - b": a difference, of "temperature_c" the gyro\'s own')
    verdict: Literal["taken", "not earned", "collinear", "refused"] = Field(description="what became of it")
    reason: str = Field(description="why, in words")
    shape: Literal["line", "product", "curve"] | None = Field(
        default=None,
        description="what it adds: a straight line, a line whose slope depends on temperature, a line with two "
        "Gaussians; where taken",
    )
    slope_dph_per_unit: float | None = Field(
        default=None, description="of the straight line through what it adds, deg/h per unit; where taken"
    )
    left_out_rms_before_dph: Figure = Field(
        default=None, description="RMS on history left out with those taken before it, deg/h; where taken"
    )
    left_out_rms_after_dph: Figure = Field(default=None, description="the same with it, deg/h; where taken")
    share_of_variance: Figure = Field(
        default=None, description="variance of what it adds over that of the measured bias; where taken"
    )


class MapMeans(Part):
    """What the runs say of the map, gathered: what a lot is learnt from."""

    temperature_c: tuple[float, ...] = Field(description="of each mean, C")
    slope_c_per_min: tuple[float, ...] = Field(description="its dT/dt, C/min")
    bias_dph: tuple[float, ...] = Field(description="its bias, deg/h")
    count: tuple[float, ...] = Field(description="how many means of `mean_s` are behind it")
    sigma_dph: _Length = Field(description="noise of one of these, deg/h")
    mean_s: _Length = Field(description="their length, s")


class Training(UnitResult):
    """How a model was fitted (`gyrotc fit`)."""

    schema_: Annotated[Literal["gyrotc.fit/1"], Field(alias="schema")] = "gyrotc.fit/1"
    units: DeclaredUnits = Field(description="of the recordings")
    method: str = Field(description="training method")
    seed: int = Field(description="from which everything random follows")
    samples: Count = Field(description="blocks that were trained on")
    block_s: float = Field(description="length of a block, s")
    average_s: float = Field(description="averaging of all RMS figures, s")
    centers: Count = Field(description="of all networks")
    parameter_bytes: Count = Field(description="parameters of the map as 32-bit words, bytes")
    sum_abs_weights_dph: float = Field(description="largest sum of absolute weights of a network, deg/h")
    predicted_rms_ratio: Figure = Field(
        description="expected RMS over the noise floor on data of the same history; null: no prediction"
    )
    prediction_withheld: str | None = Field(description="why there is none")
    noise_floor_dph: Figure = Field(description="estimated, of means over `average_s`, deg/h")
    spans: tuple[SpanLeftOut, ...] = Field(
        description="pieces of history that were left out in turn; empty of a named method"
    )
    left_out: Pooled | None = Field(
        description="what the correction leaves on them without having seen them; null of a named method"
    )
    left_out_spans: tuple[Pooled, ...] = Field(description="the same of each piece")
    noise: NoiseTerms = Field(description="of the compensated training runs")
    sensitivity: BiasPlane = Field(description="of the bias before compensation")
    candidates: tuple[CandidateModel, ...] = Field(
        description="what was tried, the simplest first; empty of a named method"
    )
    reason: str = Field(description="why this one was chosen, in words")
    generalises: bool | None = Field(
        description="whether it was shown to hold on history that it had not seen; null: not asked"
    )
    findings: tuple[Finding, ...] = Field(description="what a person should know")
    curves: dict[str, Any] = Field(
        description="figures of the method; `sizes` and `chosen` where it chose a number of centers"
    )
    channels: tuple[ChannelTried, ...] | None = Field(
        default=None,
        description="recorded channels that were tried as inputs; absent where `[fit]` does not ask for `channels`",
    )
    rows: RowsUsed | None = Field(
        default=None, description="rows of the training runs, used and left out; absent of an extended model"
    )
    means: MapMeans | None = Field(
        default=None, description="what the runs say of the map; absent of an extended model"
    )
    lot: LotUse | None = Field(default=None, description="with `--lot`: what the lot did for this unit")
    prior: EarlierUse | None = Field(
        default=None, description="with `--prior`: whether the earlier model still holds, and what it did"
    )
    known: KnownMap | None = Field(
        default=None, description="with a lot or an earlier model: what `--prior` of the next recalibration reads"
    )


class Manifest(UnitResult):
    """What a certificate must be able to name of a build."""

    schema_: Annotated[Literal["gyrotc.manifest/1"], Field(alias="schema")] = "gyrotc.manifest/1"
    model_hash: str = Field(description="hash of the model")
    refused: dict[str, str] = Field(description="arithmetics that were left out, with the reason")
    versions: dict[str, str] = Field(description="programs that it was made with")
    meta: dict[str, Any] = Field(description="`[meta]` of the data set")
    units: DeclaredUnits = Field(description="of the recordings")
    sources: tuple[Any, ...] = Field(description="`[source]` of recordings that were imported")
    program: str = Field(default="", description="SHA-256 of the program; empty: of a gyrotc that did not state it")
    files: dict[str, str] = Field(
        description="SHA-256 of the files that the build wrote before this one, by their paths in the folder; "
        "`SHA256SUMS` has all files as they are now"
    )
    firmware: dict[str, Count] = Field(
        default={}, description="files of `c/` that a firmware is built with, by their names, and their bytes"
    )
