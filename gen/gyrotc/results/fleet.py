"""Many units: `fleet.json`, the `entry.json` of each gyro; `lot.json`, what they share."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, PrivateAttr

from .base import TABLE_BYTES, Amount, Axis, Count, Figure, Finding, Part, Positive, Result, Share
from .release import Verdict

Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


BARRING = frozenset(
    {
        "sign_reversed",
        "axes_exchanged",
        "copy_of_other",
        "not_of_its_lot",
        "does_not_generalise",
        "shared_axes",
        "scale",
        "gain_changed",
        "unit_changed",
        "warm_up",
    }
)
"""Findings that say that the recordings are not this gyro's, or that it is not calibrated: no release by itself."""


class FleetUnit(Part):
    """One gyro; figures are absent where no table was made, and null where they were not measured."""

    name: str = Field(description="of its folder in the fleet")
    dataset: str | None = Field(
        default=None, description="its recordings; absent where the fleet was stopped before it"
    )
    axis: Axis = Field(description="null where the recordings have one axis")
    status: Literal["done", "failed", "unfinished"] = Field(
        description="`done`: its table was made and passed every check; `unfinished`: the fleet was stopped before it"
    )
    reason: str | None = Field(default=None, description="why it is not done")
    serial: str | None = Field(default=None, description="gyro serial")
    judged_on: Literal["exam", "left_out", "train"] | None = Field(
        default=None, description="runs that the figures are of"
    )
    constant_rms_dph: Figure = Field(default=None, description="RMS that a constant leaves, deg/h")
    after_rms_dph: Figure = Field(default=None, description="RMS after compensation, deg/h")
    improvement: Figure = Field(default=None, description="`constant_rms_dph` over `after_rms_dph`")
    after_mean_dph: Figure = Field(default=None, description="mean after compensation, deg/h")
    rms_over_floor: Figure = Field(default=None, description="`after_rms_dph` over the noise floor")
    noise_floor_dph: Figure = Field(default=None, description="noise floor of the model, deg/h")
    bias_dph: Figure = Field(default=None, description="mean bias of the training samples, deg/h")
    centers: Count | None = Field(default=None, description="of all networks")
    table_bytes: Count | None = Field(default=None, description=TABLE_BYTES)
    sum_abs_weights_dph: Figure = Field(default=None, description="largest sum of a network's weights, deg/h")
    error_bound_dph: Figure = Field(default=None, description="of the tables for any input, deg/h")
    findings: tuple[str, ...] = Field(
        default=(),
        description="ids of findings; `copy_of_other`, `axes_exchanged`, `sign_reversed`, `scale`, `gain_changed` and "
        "`warm_up` are also those of the comparison with the fleet",
    )
    model_hash: str | None = Field(default=None, description="hash of the model")
    verdict: Verdict | None = Field(
        default=None,
        description="the worst of all limits and of what the recordings allow, `FAIL` where another check failed; null "
        "without limits",
    )
    limits_met: Count | None = Field(default=None, description="limits that are met; null without limits")
    limits_held: Count | None = Field(default=None, description="limits in all; null without limits")
    expanded_uncertainty_dph: Figure = Field(default=None, description="U of `after_rms_dph` (95.45 %), deg/h")
    date: str | None = Field(default=None, description="`calibrated_on` of the data set, else the day of its last run")
    rows_left_out: Count | None = Field(
        default=None, description="rows of training that were left out for what they show"
    )
    moved_to: str | None = Field(
        default=None, description="folder of an earlier result of the gyro that somebody had changed"
    )
    copy_of: tuple[str, ...] = Field(default=(), description="gyros of other serials with the same rows")
    outlier_reason: str | None = Field(default=None, description="why it is an outlier, as in `reasons` of the fleet")

    released: str | None = Field(
        default=None,
        description="why it is released although a finding bars it (`[release]` of the manifest); null: it is not",
    )

    @property
    def barred(self) -> tuple[str, ...]:
        """Findings for which no lot takes it; none where a release is recorded."""
        return () if self.released else tuple(sorted(BARRING & {*self.findings}))


class LikelyStep(Part):
    """The likeliest step in what compensation leaves of a run."""

    time_s: float = Field(description="on the file's clock, s")
    size_dph: float = Field(description="how far the mean moves, deg/h")
    score: Amount = Field(description="in standard deviations of the move for white noise")


class ComparedRun(Part):
    """Facts about one run."""

    file: str = Field(description="as in `dataset.toml`")
    mean_c: float = Field(description="mean temperature, C")
    noise_dph: Amount = Field(description="noise of a mean, deg/h")
    step: LikelyStep = Field(description="its likeliest step, however small")
    warm_up_dph: float = Field(
        default=0.0, description="part of what remains that fades with 15 minutes from the start, deg/h"
    )
    profile_c: tuple[float, ...] = Field(default=(), description="temperature every 10 minutes, C")


class ResidualSeries(Part):
    """What compensation leaves of a run, for its picture."""

    file: str = Field(description="as in `dataset.toml`")
    time_s: tuple[float, ...] = Field(description="on the file's clock, s")
    rate_dph: tuple[float, ...] = Field(description="after compensation, deg/h")


class Facts(Part):
    """What a gyro is compared with others by."""

    curve: tuple[Figure, ...] = Field(
        description="mean bias in cells of 5 C from -90 C to 200 C, deg/h; null where there are few means"
    )
    runs: tuple[ComparedRun, ...] = Field(description="every run")
    series: ResidualSeries | None = Field(description="of the run whose step is the clearest")
    own: tuple[Finding, ...] = Field(default=(), description="events of its runs; sought where more than noise is left")


class FleetEntry(FleetUnit):
    """One gyro as in `fleet.json`, and what it was made of and is compared by."""

    facts: Facts | None = Field(default=None, description="what it is compared with others by")
    sketch: Annotated[str, Field(pattern="^([0-9a-f]{16})*$")] = Field(
        default="", description="the 16-digit hashes of some rows, chosen by their value: copies share them"
    )
    runtime_options: dict[str, Count] | None = Field(
        default=None, description="options of the runtime that its table needs, by name; null without a table"
    )
    key: Sha256 | None = Field(default=None, description="SHA-256 over recordings, options, limits and program")
    _kept: bool = PrivateAttr(default=False)

    @property
    def kept(self) -> bool:
        """Whether it is of an earlier call; not written."""
        return self._kept

    def as_kept(self) -> FleetEntry:
        """The same, of an earlier call."""
        found = self.model_copy()
        found._kept = True
        return found

    def unit(self) -> FleetUnit:
        """What a summary says of it."""
        known = self.model_fields_set & set(FleetUnit.model_fields)
        return FleetUnit(**{name: getattr(self, name) for name in FleetUnit.model_fields if name in known})


class Spread(Part):
    """A figure over the fleet."""

    median: float = Field(description="of the gyros that have it")
    least: float = Field(description="of the gyros that have it")
    largest: float = Field(description="of the gyros that have it")


class FleetOutlier(Part):
    """A figure of a gyro that is an outlier among those of its axis."""

    name: str = Field(description="of the gyro")
    figure: str = Field(description="name of the figure, a field of `FleetUnit`")
    value: float = Field(description="of this gyro")
    median: float = Field(description="of the gyros of its axis")
    sigmas: float = Field(description="distance in robust standard deviations")


class Reason(Part):
    """The likeliest reason why a gyro is an outlier among those of its axis."""

    name: str = Field(description="of the gyro")
    id: str = Field(
        description="`copy_of_other`, `axes_exchanged`, `thermometer_late`, `thermometer_offset`, `sign_reversed`, "
        "`scale`, `warm_up`, `outliers`, `step`, `noise`, an event of its own runs (`own` of its facts), or "
        "`bias_outlier` where nothing known explains it"
    )
    text: str = Field(description="the reason in words")
    file: str | None = Field(default=None, description="run in which it shows; null: in all")
    time_s: float | None = Field(default=None, description="on the clock of that file, s; null: all the time")


class Copy(Part):
    """Two gyros of different serials that have the same rows: the recordings are of one of them."""

    name: str = Field(description="of a gyro")
    serial: str = Field(description="its serial")
    other: str = Field(description="name of the other")
    other_serial: str = Field(description="the other's serial")
    share: Share = Field(description="of the rows of the one with fewer, about")

    @property
    def words(self) -> str:
        """What both have in common."""
        return f"about {self.share:.0%} of its rows in common"


class FleetSummary(Result):
    """Many gyros (`gyrotc fleet`)."""

    schema_: Annotated[Literal["gyrotc.fleet/1"], Field(alias="schema")] = "gyrotc.fleet/1"
    serial: None = Field(description="a fleet is of no single gyro")
    axis: None = Field(description="and of no single axis")
    units: Count = Field(description="gyros")
    done: Count = Field(description="gyros that are `done`")
    failed: Count = Field(description="gyros that `failed`")
    unfinished: Count = Field(description="gyros that are `unfinished`")
    figures: dict[str, Spread | None] = Field(
        description="figures over the fleet by their names; null where no gyro has it"
    )
    outliers: tuple[FleetOutlier, ...] = Field(description="figures that are outliers, the farthest first")
    reasons: tuple[Reason, ...] = Field(description="gyros that are outliers, in the order of the manifest")
    copies: tuple[Copy, ...] = Field(
        description="pairs of gyros of different serials with the same rows, in the order of the manifest"
    )
    serials: tuple[FleetUnit, ...] = Field(description="every gyro, in the order of the manifest")


PlottedCelsius = Annotated[float, Field(ge=-400.0, le=800.0)]
Rate = Annotated[float, Field(ge=-2000.0, le=2000.0)]
Figures = tuple[float, ...]


class LotFunctions(Part):
    """The functions that maps are written in: docs/lot.md."""

    center_c: PlottedCelsius = Field(description="center of T, C: x = (T - center)/half range")
    half_range_c: Positive = Field(description="half range of T, C")
    half_range_c_per_min: Positive = Field(description="half range of dT/dt, C/min: y = (dT/dt)/half range")
    slope_unit: Positive = Field(description="y at which the function of the slope is 1")
    reach_t: Positive = Field(description="half length of the domain of the sines of x")
    reach_r: Positive = Field(description="half length of the domain of the sines of y")
    kept: tuple[Annotated[int, Field(ge=0, le=92)], ...] = Field(
        description="numbers of the functions in use, of 93, ascending"
    )


class LotProcess(Part):
    """A smooth process: standard deviations in units of the coefficients, scales in half ranges."""

    constant: Positive = Field(description="standard deviation of the constant")
    line: Positive = Field(description="standard deviation of the line in T")
    curve: Positive = Field(description="standard deviation of the quadratic and of the cubic function of T")
    slope: Positive = Field(description="standard deviation of the slope in dT/dt")
    smooth: Positive = Field(description="standard deviation of the smooth part over T")
    smooth_scale: Positive = Field(description="scale in T of the smooth part")
    coupled: Positive = Field(description="standard deviation of the part that couples T and dT/dt")
    coupled_scale_t: Positive = Field(description="scale in T of the coupled part")
    coupled_scale_r: Positive = Field(description="scale in dT/dt of the coupled part")


class LotCluster(Part):
    """Units that resemble each other."""

    units: Count = Field(description="how many")
    mean: Figures = Field(description="coefficients of their mean map, in units of the lot")
    covariance: tuple[Figures, ...] = Field(description="how well it is known: lower triangle, row by row")


class LotUnit(Part):
    """A unit that the lot was learnt from, or that was excluded."""

    serial: str = Field(description="gyro serial")
    model_hash: str = Field(description="hash of its model")
    cluster: int | None = Field(description="number of its cluster, from 0; null: it was excluded")
    p_value: Share = Field(description="probability that a unit of the lot without it lies as far from it")


class CrossValidation(Part):
    """What the lot says of units that it has not seen, nothing of them being known."""

    folds: Count = Field(description="parts of the units, each left out in turn")
    spread_scale: Positive = Field(description="by what the covariances had to be multiplied")
    left_rms_dph: Amount = Field(description="RMS of a unit's map about the mean of its cluster, deg/h")
    constant_rms_dph: Amount = Field(description="RMS of a unit's map about its own mean, deg/h")


class AtRest(Part):
    """The lot to be read: its first cluster where temperature stands still."""

    temperature_c: Figures = Field(description="C")
    mean_dph: Figures = Field(description="mean map, deg/h")
    spread_dph: Figures = Field(description="standard deviation of a new unit about it, deg/h")


class Lot(Result):
    """What units of one type share (`gyrotc lot`)."""

    schema_: Annotated[Literal["gyrotc.lot/1"], Field(alias="schema")] = "gyrotc.lot/1"
    axis: Axis = Field(description="of the gyros; null where their recordings have one axis")
    units: tuple[LotUnit, ...] = Field(description="fully calibrated units, in the order of their folders")
    text: str = Field(description="in words: how much is shared, clusters, outliers, and how many units were left out")
    temperature_c: tuple[PlottedCelsius, PlottedCelsius] = Field(description="envelope of the lot, C")
    slope_c_per_min: tuple[Rate, Rate] = Field(description="the same of dT/dt, C/min")
    occupancy: tuple[Figures, ...] = Field(
        description="where units were: share of time in cells of the envelope, a row for each of dT/dt, T ascending"
    )
    center_dph: float = Field(description="0 of the coefficients, deg/h")
    unit_dph: Positive = Field(description="1 of the coefficients, deg/h")
    functions: LotFunctions = Field(description="what maps are written in")
    clusters: Annotated[tuple[LotCluster, ...], Field(min_length=1)] = Field(
        description="one, where no more were found"
    )
    directions: tuple[Figures, ...] = Field(description="in which units differ: coefficients of one standard deviation")
    rest: LotProcess = Field(description="what is each unit's own besides")
    of_mean: LotProcess = Field(description="smoothness of the mean maps")
    noise_dph: Positive = Field(description="median noise of means over `mean_s`, deg/h")
    mean_s: Positive = Field(description="length of these means, s")
    between_dph: Amount = Field(description="of the constant from power-on to power-on: RMS over the units, deg/h")
    cross_validation: CrossValidation = Field(description="over units")
    at_rest: AtRest = Field(description="to be read")
    checksum: str = Field(description="SHA-256 of the canonical form without this field")


class UnitCurve(Part):
    """Prior, recordings and posterior where temperature stands still."""

    temperature_c: Figures = Field(description="C")
    prior_dph: Figures = Field(description="what the lot says, deg/h")
    prior_sigma_dph: Figures = Field(description="1 sigma of it, deg/h")
    posterior_dph: Figures = Field(description="what lot and runs say together, deg/h")
    posterior_sigma_dph: Figures = Field(description="1 sigma of it, deg/h")


class LotUse(Part):
    """What a lot did for a unit."""

    checksum: str = Field(description="of `lot.json`")
    units: Count = Field(description="units that the lot was learnt from")
    member: bool = Field(description="whether this serial is one of them: then the lot has seen it before")
    cluster: int = Field(description="number of the cluster that fits best, from 0")
    p_value: Share = Field(description="probability that a unit of the lot lies as far from it as these runs do")
    accepted: bool = Field(description="whether the lot was used: p_value is at least `false_alarm`")
    false_alarm: Share = Field(description="share of the lot's own units that the test refuses")
    text: str = Field(description="in words: what came from the lot and what from the unit's own runs")
    own_share: Figure = Field(
        description="of the variance that the lot leaves, mean over the envelope: what the unit's runs have removed"
    )
    prior_sigma_dph: Amount = Field(description="1 sigma by the lot alone, RMS over where units are, deg/h")
    sigma_dph: Amount = Field(description="1 sigma of lot and runs together, the same, deg/h")
    curve: UnitCurve | None = Field(description="for the picture; null: the lot was not used")


class KnownMap(Part):
    """What was known of a unit's map when its table was made: mean and covariance of its coefficients."""

    temperature_c: tuple[PlottedCelsius, PlottedCelsius] = Field(description="envelope, C")
    slope_c_per_min: tuple[Rate, Rate] = Field(description="the same of dT/dt, C/min")
    center_dph: float = Field(description="0 of the coefficients, deg/h")
    unit_dph: Positive = Field(description="1 of the coefficients, deg/h")
    functions: LotFunctions = Field(description="what maps are written in: docs/lot.md")
    mean: Figures = Field(description="coefficients of the map")
    root: tuple[Figures, ...] = Field(
        description="square root of the covariance of the coefficients: lower triangle, row by row"
    )
    rest: LotProcess = Field(description="smooth process of the map")
    asked_temperature_c: Figures = Field(description="where corrections are asked for, C")
    asked_slope_c_per_min: Figures = Field(description="the same, C/min")
    asked_share: Figures = Field(description="the same, share of time")
    own: tuple[Amount, ...] = Field(
        description="1 sigma of the first coefficients from power-on to power-on; empty if it is not known"
    )
    own_freedom: Count | None = Field(description="degrees of freedom of `own`; null means infinite")
