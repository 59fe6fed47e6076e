"""Results of many gyros: `fleet.json`, the `entry.json` of each, and `lot.json`, their common map."""

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
"""Findings that bar a release: the recordings are not this gyro's, or it is not calibrated by them."""


class FleetUnit(Part):
    """One gyro; figures are absent where no table was made, and null where they were not measured."""

    name: str = Field(description="name of the gyro's folder in the fleet")
    dataset: str | None = Field(
        default=None, description="data set of the gyro; absent if the fleet was stopped before it"
    )
    axis: Axis = Field(description="axis of the gyro; null if the recordings have one axis")
    status: Literal["done", "failed", "unfinished"] = Field(
        description="`done`: the table was made and passed every check; `failed`: it did not, or was not made; "
        "`unfinished`: the fleet was stopped before this gyro"
    )
    reason: str | None = Field(default=None, description="reason why the gyro is not done; null if it is")
    serial: str | None = Field(default=None, description="gyro serial")
    judged_on: Literal["exam", "left_out", "train"] | None = Field(
        default=None,
        description="data of the figures: `exam` for test runs, `left_out` for folds of the training runs, `train` for "
        "training runs; null if nothing was measured",
    )
    constant_rms_dph: Figure = Field(default=None, description="RMS with a constant as correction, deg/h")
    after_rms_dph: Figure = Field(default=None, description="RMS after compensation, deg/h")
    improvement: Figure = Field(default=None, description="`constant_rms_dph` over `after_rms_dph`")
    after_mean_dph: Figure = Field(default=None, description="mean after compensation, deg/h")
    rms_over_floor: Figure = Field(default=None, description="`after_rms_dph` over the noise floor")
    noise_floor_dph: Figure = Field(default=None, description="noise floor that the RMS is compared with, deg/h")
    bias_dph: Figure = Field(default=None, description="weighted mean of the training bias, deg/h")
    centers: Count | None = Field(default=None, description="number of centers of all networks")
    table_bytes: Count | None = Field(default=None, description=TABLE_BYTES)
    sum_abs_weights_dph: Figure = Field(default=None, description="largest sum of absolute weights of a network, deg/h")
    error_bound_dph: Figure = Field(default=None, description="proven error bound of the tables for any input, deg/h")
    findings: tuple[str, ...] = Field(
        default=(),
        description="ids of findings; `copy_of_other`, `axes_exchanged`, `sign_reversed`, `scale`, `gain_changed` and "
        "`warm_up` may also come from the comparison with the fleet",
    )
    model_hash: str | None = Field(default=None, description="hash of the model")
    verdict: Verdict | None = Field(
        default=None,
        description="worst verdict of all limits and of what the recordings allow, `FAIL` if another check failed; "
        "null without limits if none failed",
    )
    limits_met: Count | None = Field(default=None, description="number of limits that are met; null without limits")
    limits_held: Count | None = Field(default=None, description="number of all limits; null without limits")
    expanded_uncertainty_dph: Figure = Field(default=None, description="U of `after_rms_dph` (95.45 %), deg/h")
    date: str | None = Field(default=None, description="`calibrated_on` of the data set, else the day of its last run")
    rows_left_out: Count | None = Field(
        default=None,
        description="rows of training runs that were left out because of what they show; null if not known",
    )
    moved_to: str | None = Field(
        default=None,
        description="folder that an earlier result was moved to, because somebody had changed it; null if none was",
    )
    copy_of: tuple[str, ...] = Field(default=(), description="gyros of other serials with the same rows")
    outlier_reason: str | None = Field(
        default=None, description="reason why the gyro is an outlier, in words; null if it is none"
    )
    released: str | None = Field(
        default=None,
        description="reason why the gyro is released although a finding bars it (`[release]` of the manifest); null if "
        "none is recorded",
    )

    @property
    def barred(self) -> tuple[str, ...]:
        """Findings that bar the release of the gyro; none if a release is recorded."""
        return () if self.released else tuple(sorted(BARRING & {*self.findings}))


class LikelyStep(Part):
    """The most significant step change in the residual of a run."""

    time_s: float = Field(description="time of the step on the file's clock, s")
    size_dph: float = Field(description="difference of the means after and before the step, deg/h")
    score: Amount = Field(description="size of the step in its standard deviations for white noise")


class ComparedRun(Part):
    """Facts about one run that gyros are compared by."""

    file: str = Field(description="name of the file in `dataset.toml`")
    mean_c: float = Field(description="mean temperature, C")
    noise_dph: Amount = Field(description="noise of a mean over the averaging time, 1 sigma, deg/h")
    step: LikelyStep = Field(description="most significant step change, however small")
    warm_up_dph: float = Field(
        default=0.0,
        description="amplitude of the part of the residual that decays from the start of the run with a time constant "
        "of 15 minutes, deg/h; 0 if the run is shorter than an hour",
    )
    profile_c: tuple[float, ...] = Field(default=(), description="temperatures every 10 minutes, C")


class ResidualSeries(Part):
    """Residual of a run, for its picture."""

    file: str = Field(description="name of the file in `dataset.toml`")
    time_s: tuple[float, ...] = Field(description="times on the file's clock, s")
    rate_dph: tuple[float, ...] = Field(description="rate after compensation, deg/h")


class Facts(Part):
    """Facts that a gyro is compared with others by."""

    curve: tuple[Figure, ...] = Field(
        description="mean bias in bins of 5 C from -90 C to 200 C, deg/h; null in a bin with fewer than 3 means"
    )
    runs: tuple[ComparedRun, ...] = Field(description="all runs that have means")
    series: ResidualSeries | None = Field(
        description="residual of one run: of one much noisier than the others, else of the one with the clearest step; "
        "null without means"
    )
    own: tuple[Finding, ...] = Field(
        default=(), description="events and outlying runs of the gyro; empty if the residual is no more than noise"
    )


class FleetEntry(FleetUnit):
    """One gyro as in `fleet.json`, with the facts that it is compared by and the key of its inputs."""

    facts: Facts | None = Field(default=None, description="facts that the gyro is compared by; null without them")
    sketch: Annotated[str, Field(pattern="^([0-9a-f]{16})*$")] = Field(
        default="", description="hashes of some rows, 16 digits each, chosen by their value: copies share them"
    )
    runtime_options: dict[str, Count] | None = Field(
        default=None, description="options of the runtime that the table needs, by name; null without a table"
    )
    key: Sha256 | None = Field(default=None, description="SHA-256 over recordings, options, limits and program")
    _kept: bool = PrivateAttr(default=False)

    @property
    def kept(self) -> bool:
        """True if the entry is of an earlier call; it is not written."""
        return self._kept

    def as_kept(self) -> FleetEntry:
        """Return a copy that is marked as of an earlier call."""
        found = self.model_copy()
        found._kept = True
        return found

    def unit(self) -> FleetUnit:
        """Return the part of the entry that `fleet.json` has."""
        known = self.model_fields_set & set(FleetUnit.model_fields)
        return FleetUnit(**{name: getattr(self, name) for name in FleetUnit.model_fields if name in known})


class Spread(Part):
    """A figure over the fleet."""

    median: float = Field(description="median of the gyros that have the figure")
    least: float = Field(description="smallest of the gyros that have the figure")
    largest: float = Field(description="largest of the gyros that have the figure")


class FleetOutlier(Part):
    """A figure of a gyro that is an outlier among those of its axis."""

    name: str = Field(description="name of the gyro")
    figure: str = Field(description="name of the figure, a field of `FleetUnit`")
    value: float = Field(description="figure of this gyro")
    median: float = Field(description="median of the gyros of its axis")
    sigmas: float = Field(description="distance from the median in robust standard deviations")


class Reason(Part):
    """The likeliest reason why a gyro is an outlier among those of its axis."""

    name: str = Field(description="name of the gyro")
    id: str = Field(
        description="`copy_of_other`, `axes_exchanged`, `thermometer_late`, `thermometer_offset`, `sign_reversed`, "
        "`scale`, `warm_up`, `outliers`, `step`, `noise`, an event of its own runs (`own` of its facts), or "
        "`bias_outlier` if nothing known explains it"
    )
    text: str = Field(description="the reason in words")
    file: str | None = Field(default=None, description="file of the run that shows it; null if it is in all")
    time_s: float | None = Field(default=None, description="time on the clock of that file, s; null if it has none")


class Copy(Part):
    """Two gyros of different serials that have the same rows: the recordings are of one of them."""

    name: str = Field(description="name of a gyro")
    serial: str = Field(description="serial of this gyro")
    other: str = Field(description="name of the other gyro")
    other_serial: str = Field(description="serial of the other gyro")
    share: Share = Field(description="approximate share of common rows among the rows of the gyro with fewer rows")

    @property
    def words(self) -> str:
        """The share of common rows in words."""
        return f"about {self.share:.0%} of its rows in common"


class FleetSummary(Result):
    """Summary of many gyros (`gyrotc fleet`)."""

    schema_: Annotated[Literal["gyrotc.fleet/1"], Field(alias="schema")] = "gyrotc.fleet/1"
    serial: None = Field(description="null, since a fleet is of no single gyro")
    axis: None = Field(description="null, since a fleet is of no single axis")
    units: Count = Field(description="number of gyros")
    done: Count = Field(description="number of gyros that are `done`")
    failed: Count = Field(description="number of gyros that are `failed`")
    unfinished: Count = Field(description="number of gyros that are `unfinished`")
    figures: dict[str, Spread | None] = Field(
        description="spread of each figure over the fleet, by its name; null if no gyro has it"
    )
    outliers: tuple[FleetOutlier, ...] = Field(description="figures that are outliers, the farthest first")
    reasons: tuple[Reason, ...] = Field(
        description="likeliest reason of each gyro that is an outlier, in the order of the manifest"
    )
    copies: tuple[Copy, ...] = Field(
        description="pairs of gyros of different serials with the same rows, in the order of the manifest"
    )
    serials: tuple[FleetUnit, ...] = Field(description="all gyros, in the order of the manifest")


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

    units: Count = Field(description="number of units")
    mean: Figures = Field(description="coefficients of the mean map of the units, in units of the lot")
    covariance: tuple[Figures, ...] = Field(
        description="covariance of the coefficients of the mean map: lower triangle, row by row"
    )


class LotUnit(Part):
    """A unit that the lot was learnt from, or that was excluded as an outlier."""

    serial: str = Field(description="gyro serial")
    model_hash: str = Field(description="hash of the model of the unit")
    cluster: int | None = Field(description="number of the cluster of the unit, from 0; null if the unit was excluded")
    p_value: Share = Field(description="probability that a unit of the lot, learnt without this one, is as far from it")


class CrossValidation(Part):
    """Prediction of units from the lot alone, by leaving units out."""

    folds: Count = Field(description="number of parts of the units, each left out in turn")
    spread_scale: Positive = Field(description="factor that the covariances had to be multiplied by")
    left_rms_dph: Amount = Field(description="RMS of a unit's map about the mean of its cluster, deg/h")
    constant_rms_dph: Amount = Field(description="RMS of a unit's map about its own mean, deg/h")


class AtRest(Part):
    """First cluster of the lot at constant temperature, for readers and pictures."""

    temperature_c: Figures = Field(description="temperatures, C")
    mean_dph: Figures = Field(description="mean map, deg/h")
    spread_dph: Figures = Field(description="standard deviation of a new unit about the mean map, deg/h")


class Lot(Result):
    """The map that units of one type share (`gyrotc lot`)."""

    schema_: Annotated[Literal["gyrotc.lot/1"], Field(alias="schema")] = "gyrotc.lot/1"
    axis: Axis = Field(description="axis of the gyros; null if their recordings have one axis")
    units: tuple[LotUnit, ...] = Field(description="fully calibrated units, in the order of their folders")
    text: str = Field(description="summary in words: share of the common map, clusters, outliers, units left out")
    temperature_c: tuple[PlottedCelsius, PlottedCelsius] = Field(description="envelope of the lot in T, C")
    slope_c_per_min: tuple[Rate, Rate] = Field(description="envelope of the lot in dT/dt, C/min")
    occupancy: tuple[Figures, ...] = Field(
        description="share of the units' time in each bin of the envelope: one row for each dT/dt, T ascending in it"
    )
    center_dph: float = Field(description="bias at which all coefficients are 0, deg/h")
    unit_dph: Positive = Field(description="unit of the coefficients, deg/h")
    functions: LotFunctions = Field(description="functions that maps are written in: docs/lot.md")
    clusters: Annotated[tuple[LotCluster, ...], Field(min_length=1)] = Field(
        description="clusters of the units; one if no more were found"
    )
    directions: tuple[Figures, ...] = Field(
        description="directions in which units differ: coefficients of one standard deviation"
    )
    rest: LotProcess = Field(description="process of the part of each unit that is in no direction")
    of_mean: LotProcess = Field(description="process of the mean maps")
    noise_dph: Positive = Field(description="median noise of means over `mean_s`, deg/h")
    mean_s: Positive = Field(description="averaging time of the means, s")
    between_dph: Amount = Field(description="turn-on repeatability, 1 sigma of the constant, RMS over the units, deg/h")
    cross_validation: CrossValidation = Field(description="prediction of units that were left out")
    at_rest: AtRest = Field(description="first cluster at constant temperature")
    checksum: str = Field(description="SHA-256 of the canonical form without this field")


class UnitCurve(Part):
    """Map at constant temperature before and after the runs of the unit: prior and posterior."""

    temperature_c: Figures = Field(description="temperatures, C")
    prior_dph: Figures = Field(description="map of the lot, or of the earlier model after ageing, deg/h")
    prior_sigma_dph: Figures = Field(description="1 sigma of that map, deg/h")
    posterior_dph: Figures = Field(description="map of the prior and the runs together, deg/h")
    posterior_sigma_dph: Figures = Field(description="1 sigma of both together, deg/h")


class LotUse(Part):
    """Use of a lot in the calibration of a unit."""

    checksum: str = Field(description="checksum of `lot.json`")
    units: Count = Field(description="number of units that the lot was learnt from")
    member: bool = Field(description="true if this serial is one of them, so that the lot has seen it before")
    cluster: int = Field(description="number of the cluster that fits best, from 0")
    p_value: Share = Field(description="probability that a unit of the lot is as far from it as these runs are")
    accepted: bool = Field(description="true if the lot was used: `p_value` is at least `false_alarm`")
    false_alarm: Share = Field(description="share of the lot's own units that the test refuses")
    text: str = Field(description="use of the lot in words")
    own_share: Figure = Field(
        description="share of the variance of the map by the lot alone that the unit's runs have removed, mean over "
        "the envelope; null if the lot was not used"
    )
    prior_sigma_dph: Amount = Field(description="RMS of 1 sigma of the map by the lot alone, deg/h")
    sigma_dph: Amount = Field(description="RMS of 1 sigma of the map by lot and runs together, deg/h")
    curve: UnitCurve | None = Field(description="curves of the picture; null if the lot was not used")


class KnownMap(Part):
    """Posterior of a unit's map when its table was made: mean and covariance of its coefficients."""

    temperature_c: tuple[PlottedCelsius, PlottedCelsius] = Field(description="envelope in T, C")
    slope_c_per_min: tuple[Rate, Rate] = Field(description="envelope in dT/dt, C/min")
    center_dph: float = Field(description="bias at which all coefficients are 0, deg/h")
    unit_dph: Positive = Field(description="unit of the coefficients, deg/h")
    functions: LotFunctions = Field(description="functions that the map is written in: docs/lot.md")
    mean: Figures = Field(description="coefficients of the map")
    root: tuple[Figures, ...] = Field(
        description="square root of the covariance of the coefficients: lower triangle, row by row"
    )
    rest: LotProcess = Field(description="smooth process of the map")
    asked_temperature_c: Figures = Field(description="temperatures at which corrections are needed, C")
    asked_slope_c_per_min: Figures = Field(description="dT/dt at each of these temperatures, C/min")
    asked_share: Figures = Field(description="share of time at each of these temperatures and dT/dt")
    own: tuple[Amount, ...] = Field(
        description="1 sigma of the first coefficients from power-on to power-on; empty if it is not known"
    )
    own_freedom: Count | None = Field(description="degrees of freedom of `own`; null means infinite")
