"""Recordings as they are (`check`, `import`), as simulated (`truth.json`) and as a plan has them (`plan.json`)."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from .base import Amount, Axis, Count, Figure, Finding, MarkedRows, Numbered, Part, Positive, Result, Share, UnitResult


class Problem(Part):
    """What `fit` refuses."""

    where: str = Field(description="file, line and column")
    found: str = Field(description="what stands there")
    expected: str = Field(description="what should stand there; empty where `found` says it all")
    rows: tuple[MarkedRows, ...] = Field(description="rows that it is about")


class CheckedRun(Part):
    """Facts about a run."""

    axis: str | None = Field(description="axis that was read")
    file: str = Field(description="as in `dataset.toml`")
    from_s: Figure = Field(description="start of the span, s; null for the whole file")
    role: str = Field(description="`train` or `exam`")
    environment: str | None = Field(description="free text of the data set")
    rows: Count = Field(description="rows in the span")
    first_s: float = Field(description="time of the first row, s")
    last_s: float = Field(description="time of the last row, s")
    row_period_s: float = Field(description="median, s")
    gaps: Count = Field(description="places where rows are missing")
    missing_rows: Count = Field(description="rows that are missing there")
    temperature_c: tuple[float, float] = Field(description="lowest and highest, C")
    mean_dph: Figure = Field(description="mean rate, deg/h")
    noise_dph: Figure = Field(description="noise of a row, deg/h")
    hold_share: Figure = Field(description="share of the time at which the temperature is held")
    earth_rate_dph: Figure = Field(description="rate of the Earth that was taken off, deg/h")
    earth_rate_sigma_dph: Figure = Field(description="its uncertainty, deg/h")


class Checked(Result):
    """Problems and warnings of recordings."""

    schema_: Annotated[Literal["gyrotc.check/1"], Field(alias="schema")] = "gyrotc.check/1"
    serial: str | None = Field(description="null where it could not be read")
    axis: str | None = Field(description="as asked for: `x`, `y`, `z`, `all`, or null")
    problems: tuple[Problem, ...] = Field(description="what `fit` refuses")
    warnings: tuple[Finding, ...] = Field(description="what it takes, and a person should look at")
    not_testable: tuple[Finding, ...] = Field(
        default=(), description="what these recordings cannot tell, by the `id` of the finding that stays open"
    )
    runs: tuple[CheckedRun, ...] = Field(description="every run that could be read")


class OriginalFile(Part):
    """The logger's file that a run was made of, as `[source]` of `dataset.toml` names it."""

    file: str = Field(description="its name")
    sha256: str = Field(description="of its contents")
    bytes: Count = Field(description="its size, bytes")
    imported_by: str = Field(description="gyrotc with its version")
    map: str = Field(description="file of the map that read it")
    run: str = Field(description="file of the run")


class ImportedFile(Part):
    """A run that was written."""

    file: str = Field(description="as in `dataset.toml`")
    read: Count = Field(description="rows of the file: those in `rows` and those in `left_out`")
    above: Count = Field(description="lines of text above the first row: names, units, and what else is written there")
    rows: Count = Field(description="rows that were taken")
    left_out: dict[str, Count] = Field(description="rows that were not, by the reason")
    trusted: tuple[str, ...] = Field(
        description="what values look like that contradicts their unit, but was taken (`--trust-units`)"
    )
    source: OriginalFile = Field(description="the original")


class ImportedFiles(Result):
    """What was made of a logger's files."""

    schema_: Annotated[Literal["gyrotc.import/1"], Field(alias="schema")] = "gyrotc.import/1"
    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null: an import is of all axes")
    map: dict[str, Any] = Field(description="the map that was kept; its keys: docs/import.md, section 5")
    runs: tuple[ImportedFile, ...] = Field(description="every run, in the order of the files")
    findings: tuple[Finding, ...] = Field(default=(), description="what a person should look at, as `check` writes it")


class TrueRun(Part):
    """What was simulated in one run."""

    file: str = Field(description="as in `dataset.toml`")
    noise: str = Field(description="file of its noise, mean of every step, deg/h, by its path in the folder")
    noise_step_s: Annotated[float, Field(ge=1e-6, le=1e6)] = Field(description="length of a step, s")
    bias_dph: tuple[float, float] = Field(description="lowest and highest true bias, deg/h")
    states: dict[str, str] | None = Field(
        default=None,
        description="of a gyro with further thermometers, differences of nodes or a laser: files of its true states by "
        "name (temperatures of the nodes, C; losses and gain, 1e-6; stroke, half wavelengths), mean of every step",
    )


class TrueLot(Part):
    """Where a gyro of a simulated lot stands in it."""

    units: int = Field(description="gyros in the lot")
    family: Share = Field(description="correlation of each parameter between two units of one cluster")
    clusters: int = Field(description="groups with a center of their own")
    cluster: int = Field(description="number of the group, from 0; of a foreign unit that of none: -1")
    unrelated: bool = Field(description="whether it shares nothing with the lot but the scenario")
    scores: dict[str, float] = Field(description="every parameter that was drawn, in standard deviations")


class SimulatedTruth(Numbered):
    """What a simulated data set really is; only `evaluate` and tests open it."""

    schema_: Annotated[Literal["gyrotc.truth/1"], Field(alias="schema")] = "gyrotc.truth/1"
    scenario: str = Field(description="name or file of the scenario")
    seed: int = Field(description="of everything that was drawn")
    noise: dict[str, Any] = Field(description="levels of the noise, as in the scenario")
    map: dict[str, Any] = Field(description="the bias of the gyro over temperature and its rate, as it was drawn")
    causes: tuple[dict[str, Any], ...] = Field(description="`id`, `channel` and parameters of each cause")
    plan: dict[str, Any] = Field(
        description="gyro, chamber, sensor and what is recorded of the scenario: thermometers, laser, channels"
    )
    runs: tuple[TrueRun, ...] = Field(description="every run")
    lot: TrueLot | None = Field(default=None, description="of a gyro of a lot")


class ChamberStep(Part):
    """A ramp and the hold after it."""

    to_c: float = Field(description="set point, C")
    c_per_min: Amount = Field(description="rate of the ramp to it, C/min")
    hold_min: Amount = Field(description="hold there, min")


class LotProgramme(Part):
    """A chamber programme and what it promises."""

    start_c: float = Field(description="where it starts, power coming on with it, C")
    steps: tuple[ChamberStep, ...] = Field(description="in their order")
    hours: Amount = Field(description="length, h")
    sigma_dph: Amount = Field(description="promised: 1 sigma of the map, RMS over where units are, deg/h")
    rms_over_floor: Amount = Field(description="the same as RMS over the noise floor of means over 100 s")
    reached: bool = Field(description="whether that is what was required; else it is what a day reaches")


class LotPlan(Result):
    """The shortest programme with a lot, and without."""

    schema_: Annotated[Literal["gyrotc.lot-plan/1"], Field(alias="schema")] = "gyrotc.lot-plan/1"
    lot: str = Field(description="checksum of the lot")
    scenario: str = Field(description="whose chamber and instrument are assumed")
    accuracy_dph: Amount = Field(description="required, deg/h")
    before_dph: Amount = Field(description="1 sigma by the lot alone, before any run, deg/h")
    with_lot: LotProgramme = Field(description="with the lot")
    without: LotProgramme = Field(description="for a unit of which nothing is known but that its map is smooth")


class ProposedRun(Part):
    """A run, what it is expected to bring, and what it costs."""

    programme: LotProgramme = Field(description="what the chamber does, and 1 sigma of the map after it")
    removed_share: Share = Field(description="of the map's variance, mean over where corrections are asked for")
    price: Amount = Field(description="of the run, with what one run costs before it begins")


class NextRun(UnitResult):
    """Which run to record next for a unit (`gyrotc plan --unit`)."""

    schema_: Annotated[Literal["gyrotc.next-run/1"], Field(alias="schema")] = "gyrotc.next-run/1"
    model_hash: str = Field(description="of the unit's model")
    scenario: str = Field(description="whose chamber and instrument are assumed")
    before_dph: Amount = Field(description="1 sigma of the map as it is known now, deg/h")
    price_per_hour: Positive = Field(description="of the chamber, in any currency")
    price_per_run: Amount = Field(description="of mounting, settling and powering once, in the same")
    proposals: tuple[ProposedRun, ...] = Field(
        description="each longer than the one before it and beginning like it; the last is the longest that is allowed"
    )
    best: int = Field(ge=0, description="number of the one that removes most variance for its price, from 0")


class AssumedNoise(Part):
    """Noise that was assumed."""

    arw_deg_per_sqrt_h: float = Field(description="angle random walk, deg/√h")
    bias_instability_dph: float = Field(description="deg/h")
    rate_random_walk_dph_per_sqrt_h: float = Field(description="deg/h/√h")
    quantum_arcsec: float = Field(description="arcsec")


class Temperature(Part):
    """Temperature of a run, for a picture."""

    time_h: tuple[float, ...] = Field(description="h")
    value_c: tuple[float, ...] = Field(description="C")


class PlannedRun(Part):
    """One run of the profile."""

    profile: str = Field(description="its name")
    hours: float = Field(description="h")
    temperature: Temperature = Field(description="at the sensor")


class DetectionLimit(Part):
    """Smallest size of a cause that is found in 95 % of cases."""

    value: Figure = Field(description="null: never")
    unit: str = Field(description="of `value`")
    parameter: str | None = Field(description="that the limit depends on; null: none")
    over: tuple[tuple[float, Figure], ...] = Field(description="pairs of parameter and limit")


class PlanLimit(Part):
    """From which size on the profile will show a cause."""

    id: str = Field(description="of the catalogue of causes")
    family: str = Field(description="of the cause")
    detection_limit: DetectionLimit = Field(description="what these runs will find")


class Separability(Part):
    """From which size on a cause is recognised from the others."""

    id: str = Field(description="the cause that is there")
    parameter: str | None = Field(description="name of its parameter; null: none")
    value: Figure = Field(description="of its parameter")
    d: dict[str, float] = Field(description="size, in standard deviations, from which each other cause is ruled out")


class Hard(Part):
    """Two causes that are hard to separate."""

    pair: tuple[str, str] = Field(description="ids")
    d: float = Field(description="size from which they are separated")
    add: str = Field(description="what would part them")


class Accuracy(Part):
    """Predicted accuracy after some of the runs."""

    hours: float = Field(description="chamber hours until then")
    runs: Count = Field(description="number of runs until then")
    map_error_dph: float = Field(description="error of the map over the whole programme, deg/h")
    rms_dph: float = Field(description="RMS of means over 100 s, deg/h")
    rms_over_floor: float = Field(description="over the noise floor")


class Shortest(Part):
    """The shortest profile that reaches what is required."""

    required: dict[str, float] = Field(description="detection limits by cause")
    runs: tuple[str, ...] | None = Field(description="its runs; null: not reached by any number of them")
    hours: Figure = Field(description="h")
    reached: dict[str, Figure] = Field(description="detection limits by cause")


class TriedRun(Part):
    """What a further run would tell about the pair."""

    profile: str = Field(description="its name")
    hours: float = Field(description="h")
    d: float = Field(description="size from which the pair is separated with it")


class Additions(Part):
    """Further runs, ranked by how they part two causes."""

    pair: tuple[str, str] = Field(description="ids")
    runs: tuple[TriedRun, ...] = Field(description="the first is the profile as it is")


class ThermometerPlace(Part):
    """A node of the gyro as a place for a further thermometer (`--add-thermometer`)."""

    node: str = Field(description="name of the node")
    there: bool = Field(description="whether a thermometer is there")
    difference_c: float = Field(description="RMS of its temperature less the sensor's, about the mean, C")
    unseen_c: float = Field(description="RMS of what map and thermometers that are there do not hold of it, C")
    limit_dph_per_c: Figure = Field(
        description="amplitude of a part of the bias that follows it from which these runs show it; null: never"
    )


class Plan(Result):
    """What a profile will be able to tell, before it is run (`gyrotc plan`)."""

    schema_: Annotated[Literal["gyrotc.plan/1"], Field(alias="schema")] = "gyrotc.plan/1"
    serial: None = Field(description="a plan is of no gyro")
    axis: None = Field(description="of no axis")
    scenario: str = Field(description="name of the profile")
    hours: float = Field(description="chamber hours")
    noise: AssumedNoise = Field(description="that was assumed")
    bias_range_dph: tuple[float, float] = Field(description="lowest and highest bias of the simulated gyro, deg/h")
    runs: tuple[PlannedRun, ...] = Field(description="of the profile")
    limits: tuple[PlanLimit, ...] = Field(description="what will be found")
    not_testable: dict[str, str] = Field(description="causes that cannot be tested, with the reason")
    separability: tuple[Separability, ...] = Field(description="what can be distinguished from what")
    hard_to_separate: tuple[Hard, ...] = Field(description="the hardest first")
    accuracy: tuple[Accuracy, ...] = Field(description="after each run")
    shortest: Shortest | None = Field(description="where limits were required")
    additions: Additions | None = Field(description="where a pair was given")
    thermometers: tuple[ThermometerPlace, ...] | None = Field(
        default=None, description="places for a further thermometer, the most telling first; those that have one last"
    )
