"""Results that a release rests on: emitted tables, verification, limits and uncertainty budget."""

from __future__ import annotations

from datetime import date
from typing import Annotated, Literal, get_args

from pydantic import Field

from .base import TABLE_BYTES, Amount, Axis, Count, Figure, Part, Positive, Result, UnitResult


class Instrument(Part):
    """An instrument of the calibration, from `[[meta.instrument]]` or the limits file."""

    name: str = Field(description="name of the instrument with its serial number")
    certificate: str = Field(
        default="", description="number of the instrument's calibration certificate; empty if none is stated"
    )
    quantity: Literal["temperature", "rate", "other"] = Field(
        default="other",
        description="quantity that the instrument measures: temperature of the gyro (C), reference rate (deg/h), or "
        "another one, which does not enter the uncertainty budget",
    )
    expanded_uncertainty: Positive | None = Field(
        default=None, description="expanded uncertainty stated by the certificate, in the unit of the quantity"
    )
    coverage_factor: Annotated[float, Field(ge=1.0, le=10.0)] = Field(
        default=2.0, description="coverage factor k of the expanded uncertainty"
    )
    degrees_of_freedom: Positive | None = Field(
        default=None, description="degrees of freedom of the expanded uncertainty; null means infinite"
    )


class Contribution(Part):
    """One line of the uncertainty budget."""

    id: Literal["noise", "fit", "unseen", "turn_on", "thermometer", "reference", "arithmetic", "ageing"] = Field(
        description="identifier of the source of uncertainty"
    )
    text: str = Field(description="name of the source, in words")
    type: Literal["A", "B"] = Field(description="evaluation of the uncertainty: A by statistics, B by other means")
    distribution: Literal["normal", "rectangular", "t"] = Field(description="assumed distribution of the input")
    standard_uncertainty: Amount = Field(description="standard uncertainty u of the input, in `unit`")
    unit: str = Field(description="unit of the input")
    sensitivity: Amount = Field(description="sensitivity c: change of the bias per unit of the input, deg/h per `unit`")
    contribution_dph: Amount = Field(description="contribution c·u to the combined uncertainty, deg/h")
    freedom: Figure = Field(description="degrees of freedom of u; null means infinite")
    source: str = Field(description="data or statement that u was derived from")
    certificate: str = Field(default="", description="number of the certificate that states u; empty if none does")


class Budget(UnitResult):
    """Uncertainty budget of the compensated bias (`gyrotc build`)."""

    schema_: Annotated[Literal["gyrotc.budget/1"], Field(alias="schema")] = "gyrotc.budget/1"
    measurand: str = Field(description="definition of the measurand, in words")
    contributions: tuple[Contribution, ...] = Field(description="lines of the budget")
    not_known: tuple[str, ...] = Field(
        description="sources without a stated value; they are not included in the budget"
    )
    combined_dph: Amount = Field(description="combined standard uncertainty (root sum of squares), deg/h")
    freedom: Figure = Field(description="effective degrees of freedom (Welch-Satterthwaite); null means infinite")
    coverage_factor: Positive = Field(description="coverage factor k for 95.45 %")
    expanded_dph: Amount = Field(description="expanded uncertainty U = k times the combined one, deg/h")
    instruments: tuple[Instrument, ...] = Field(description="instruments of the calibration")
    calibrated_on: str | None = Field(
        description="day of the calibration; null if neither `[meta]` nor a recording states it"
    )
    interval_days: Figure = Field(description="time until the next calibration, days; null if not stated")
    valid_until: str | None = Field(
        description="last day on which the calibration is valid; null without date or interval"
    )

    def expired(self, today: date) -> bool:
        """Test whether the last day of the interval has passed."""
        return self.valid_until is not None and self.valid_until < today.isoformat()


Verdict = Literal["PASS", "CONDITIONAL PASS", "NOT TESTABLE", "FAIL"]
"""Statement of conformity, from best to worst.

A conditional pass is within its limit, but closer to it than the guard band, or shown on recordings that a PASS must
not rest on alone. What is not testable may be within its limit: the recordings cannot show it.
"""

VERDICTS: tuple[Verdict, ...] = get_args(Verdict)

NEED_REASON: tuple[Verdict, ...] = ("CONDITIONAL PASS", "NOT TESTABLE", "FAIL")
"""Verdicts of units that are certified only for a stated reason."""

JudgedOn = Literal["exam", "left_out", "train"]
"""Data that a figure was measured on."""

DecisionRule = Literal["guard_band", "guard_band_binary", "simple_acceptance"]
"""Decision rule of ILAC-G8:09/2019, 4.2 (docs/limits.md)."""

Value = bool | int | float | str | tuple[float, ...] | tuple[str, ...] | None
"""A bound or a measured figure; null if it was not measured."""


class Limit(Part):
    """One limit and the figure that was compared with it."""

    limit: str = Field(description="key in the limits file, such as `at_most.rms_dph`")
    measured: Value = Field(description="measured figure or range, or the findings; null if not measured")
    bound: Value = Field(description="bound from the limits file")
    met: bool = Field(
        description="true if the verdict is PASS or CONDITIONAL PASS; false if the figure was not measured"
    )
    verdict: Verdict = Field(description="verdict for this limit")
    standard_uncertainty: Figure = Field(
        default=None, description="standard uncertainty of the figure, in its unit; null if unknown or none"
    )
    degrees_of_freedom: Figure = Field(
        default=None, description="degrees of freedom of the standard uncertainty; null means infinite"
    )
    coverage_factor: Figure = Field(
        default=None, description="coverage factor k for 95.45 %: Student's t, or 2 for many degrees of freedom"
    )
    expanded_uncertainty: Figure = Field(default=None, description="expanded uncertainty U of the figure, in its unit")
    guard_band: Figure = Field(default=None, description="guard band w: U, or 0 with simple acceptance")
    acceptance_limit: Figure = Field(default=None, description="bound less guard band; figures up to it pass")
    false_acceptance: Amount | None = Field(
        default=None,
        description="probability that the true value is beyond the limit although the figure was accepted (specific "
        "risk, normal distribution, no prior); null if it was not accepted or has no uncertainty",
    )
    uncertainty_from: str = Field(default="", description="source of the uncertainty, or the reason why there is none")

    part: JudgedOn | None = Field(
        default=None,
        description="data of the figure: `exam` for test runs, `left_out` for folds of the training runs, `train` for "
        "training runs; null if it was not measured on recordings",
    )
    capped: tuple[str, ...] = Field(
        default=(), description="reasons why the verdict is no PASS although the figure may be within its bound"
    )
    constant: Figure = Field(
        default=None, description="this figure with a constant as correction; null if there is none"
    )
    constant_passes: bool = Field(
        default=False,
        description="true if a constant is within the bound, so that the limit demands nothing of the map",
    )


class HeldLimits(UnitResult):
    """Limits of a product compared with the measured figures (`gyrotc build --limits`)."""

    schema_: Annotated[Literal["gyrotc.limits/1"], Field(alias="schema")] = "gyrotc.limits/1"
    product: str = Field(description="name of the product; empty if the limits file states none")
    sha256: str = Field(description="SHA-256 of the limits file")
    met: bool = Field(
        description="true if all limits are met and the recordings can show it; false if there are no limits"
    )
    limits: tuple[Limit, ...] = Field(description="all limits of the file")
    verdict: Verdict | None = Field(
        default=None,
        description="worst of the verdicts of all limits and of `requirements` of `evaluate.json`; null if there are "
        "no limits",
    )
    capped: tuple[str, ...] = Field(
        default=(), description="reasons why it is no PASS although all figures may be within their bounds"
    )
    decision_rule: DecisionRule = Field(description="decision rule of the limits file")


STATED = (
    "model.json", "training.json", "evaluate.json", "limits.json", "budget.json", "changes.json", "manifest.json",
    "diagnosis/diagnose.json", "verify.json", "c",
)  # fmt: skip
"""Files and folders of an axis that state facts of the unit, by their paths in its folder."""


_RMS_GROWTH = (
    "largest share by which rounding can raise the RMS of a residual at the noise floor; null if no floor is known"
)


class MapOnGrid(UnitResult):
    """The static map at the points of a grid (`gyrotc emit --map`), for programs that know no networks."""

    schema_: Annotated[Literal["gyrotc.map/1"], Field(alias="schema")] = "gyrotc.map/1"
    model_hash: str = Field(description="hash of the model, shifted as its tables are (`emit --zero-at`)")
    units: dict[str, str] = Field(description="unit of each quantity of the map")
    temperature_c: tuple[float, ...] = Field(description="n temperatures, ascending, C")
    slope_c_per_min: tuple[float, ...] = Field(
        description="m rates of temperature, ascending, C/min; 0 is one of them where the envelope contains it"
    )
    bias_dph: tuple[tuple[float, ...], ...] = Field(
        description="n rows of m: bias to be subtracted at each temperature and rate, deg/h"
    )
    linear_rms_dph: Amount = Field(
        description="RMS error of bilinear interpolation of these values in float32 against the map, deg/h"
    )
    linear_largest_dph: Amount = Field(description="largest error of that interpolation, deg/h")
    terms: tuple[str, ...] = Field(description="ids of terms of the model, which no static map contains")


PassOrFail = Literal["pass", "fail"]


class CallCost(Part):
    """Cost of a call, less an empty one."""

    min: int = Field(description="smallest of all calls")
    mean: float = Field(description="mean of all calls")
    max: int = Field(description="largest of all calls")


class FunctionCost(Part):
    """Code and stack of a public function."""

    code_bytes: Count = Field(description="code of the function and of what it calls, bytes")
    stack_bytes: Count = Field(description="stack of the deepest call chain, bytes")
    helpers: tuple[str, ...] = Field(
        description="functions of the compiler's library that it calls; their stack is not counted"
    )


class ReplayedRows(Part):
    """Recordings that were replayed."""

    runs: Count = Field(description="number of runs that were replayed")
    rows: Count = Field(description="number of rows of these runs")
    mismatches: Count = Field(description="rows that differ from the reference in any bit")
    first_mismatches: tuple[str, ...] = Field(description="first rows that differ, with all bits")
    error: str | None = Field(default=None, description="reason why the replay ended early; null if it did not")


class VerifiedTarget(Part):
    """The board test on one target, in one arithmetic."""

    name: str = Field(description="name of the target, or the name that a board prints of itself")
    status: Literal["pass", "fail", "missing"] = Field(
        description="outcome; `missing` if its compiler or emulator is not installed"
    )
    numeric: str = Field(description="arithmetic")
    package: str | None = Field(default=None, description="packages that are missing; null if none is")
    compiler: str | None = Field(default=None, description="name and version of the compiler")
    flags: str | None = Field(default=None, description="options of the compiler")
    log: str | None = Field(default=None, description="file with the output of a board test that ran elsewhere")
    parts: Count | None = Field(default=None, description="board tests of this arithmetic in that file")
    table_bytes: Count | None = Field(default=None, description=TABLE_BYTES)
    vectors: Count | None = Field(default=None, description="results that were compared")
    mismatches: Count | None = Field(default=None, description="results that differ from the reference")
    first_mismatches: tuple[str, ...] = Field(default=(), description="first results that differ, with all bits")
    instructions: CallCost | None = Field(default=None, description="instructions of a call of the map")
    cycles: CallCost | None = Field(default=None, description="cycles of a call of the map")
    ticks: CallCost | None = Field(
        default=None, description="time of a call of the map, in units of the board's counter"
    )
    stack_bytes: Count | None = Field(default=None, description="stack of a call of the map, bytes")
    step_instructions: CallCost | None = Field(default=None, description="instructions of a sample")
    step_cycles: CallCost | None = Field(default=None, description="cycles of a sample")
    step_ticks: CallCost | None = Field(default=None, description="time of a sample, in units of the board's counter")
    step_stack_bytes: Count | None = Field(default=None, description="stack of a sample, bytes")
    code_bytes: Count | None = Field(default=None, description="code of runtime and table that is linked, bytes")
    read_only_bytes: Count | None = Field(
        default=None, description="constants of runtime and table that are linked, bytes"
    )
    ram_bytes: Count | None = Field(default=None, description="writable static data of runtime and table, bytes")
    functions: dict[str, FunctionCost] | None = Field(default=None, description="cost of the public functions, by name")
    error: str | None = Field(default=None, description="reason why there is no result; null if there is one")
    replayed: ReplayedRows | None = Field(default=None, description="replayed recordings; null if none were given")

    @property
    def map_cost(self) -> tuple[str, CallCost] | None:
        """Unit of the counter of the target, and the cost of a call of the map in it; None if not counted."""
        found = {"instructions": self.instructions, "cycles": self.cycles, "ticks": self.ticks}
        return next(((unit, cost) for unit, cost in found.items() if cost), None)


class VerifiedFile(Part):
    """An emitted file, compared with the one that the model gives."""

    file: str = Field(description="name of the file in `c/`")
    verdict: Literal["equal", "differs", "missing", "foreign", "edited"] = Field(
        description="`foreign`: gyrotc does not make it; `edited`: the example differs, as its user may edit it"
    )
    status: PassOrFail = Field(description="`pass` if the file may be used")
    mismatches: Count = Field(
        description="number of lines or words that differ; 1 for a file that is missing, foreign or no regular file"
    )
    line: Count | None = Field(default=None, description="first line that differs, counted from 1")
    word: Count | None = Field(default=None, description="first word of an image that differs, counted from 1")
    found: str | None = Field(default=None, description="content of that line or word in the file")
    expected: str | None = Field(default=None, description="content of that line or word as the model gives it")


class MapError(Part):
    """Departure of the emitted map from the model, in one arithmetic."""

    numeric: str = Field(description="arithmetic")
    status: PassOrFail = Field(description="`pass` if the largest departure is within the bound")
    bound_dph: float = Field(description="proven bound of the departure for any input, deg/h")
    rms_growth: Figure = Field(default=None, description=_RMS_GROWTH)
    worst_dph: float = Field(description="largest departure found, deg/h")
    arithmetic_dph: float | None = Field(
        default=None, description="largest departure in the middle of a cell of inputs, deg/h; with `--exhaustive` only"
    )
    mean_dph: float | None = Field(
        default=None, description="mean departure in the middle of a cell, deg/h; with `--exhaustive` only"
    )
    inputs_visited: Count = Field(description="number of inputs that were tried")
    mismatches: Count | None = Field(
        default=None,
        description="number of inputs that differ from integers computed separately; with `--exhaustive` only",
    )
    first_mismatches: tuple[str, ...] = Field(default=(), description="first inputs that differ, with all bits")


class LogPart(Part):
    """A board test in a log."""

    line: Count = Field(description="line at which it begins")
    numeric: str = Field(description="arithmetic")
    vectors: Count = Field(description="results that were compared")
    mismatches: Count = Field(description="results that differ from the reference")


class ReadLog(Part):
    """A log of board tests; every line of it is accounted for."""

    file: str = Field(description="name of the log")
    lines: Count = Field(description="number of lines")
    parts: tuple[LogPart, ...] = Field(description="board tests in the log")
    absent: tuple[str, ...] = Field(description="arithmetics that the board did not test")
    outside: Count = Field(description="number of lines that belong to no board test")
    first_outside: tuple[str, ...] = Field(description="first lines that belong to no board test")


class EmittedWith(Part):
    """Options of `emit` with which `c/` was made."""

    numeric: tuple[str, ...] | None = Field(description="arithmetics asked for by `--numeric`; null if not given")
    zero_at_c: float | None = Field(description="temperature of `--zero-at`, C; null if not given")


class WorstError(Part):
    """Largest departure of all arithmetics."""

    value: float = Field(description="largest departure, deg/h")
    inputs_visited: Count = Field(description="number of inputs that were tried")


class _Counted(Result):
    """Fields that the verification of one axis and of a unit of several have in common."""

    schema_: Annotated[Literal["gyrotc.verify/1"], Field(alias="schema")] = "gyrotc.verify/1"
    serial: str = Field(description="gyro serial")
    axis: Axis = Field(
        description="axis of the gyro; null if the recordings have one axis, or for several in one folder"
    )
    passed: Count = Field(description="number of targets that passed")
    failed: Count = Field(description="number of targets, files and other checks that failed")
    missing: Count = Field(description="number of targets whose compiler or emulator is not installed")
    emitted: tuple[VerifiedFile, ...] = Field(description="all files that are or should be in `c/`")


class Verification(_Counted):
    """Checks of the emitted code against the model (`gyrotc verify`)."""

    model_hash: str = Field(description="hash of the model")
    c_hash: str = Field(description="SHA-256 over names and contents of the emitted files")
    targets: tuple[VerifiedTarget, ...] = Field(description="all targets that were tried, and boards")
    log: ReadLog | None = Field(
        default=None, description="log of a board test that ran elsewhere; null if none was read"
    )
    outdated_boards: tuple[str, ...] = Field(
        default=(), description="boards whose entries were dropped, because they ran another model or other code"
    )
    options: EmittedWith | None = Field(default=None, description="options of `emit`")
    errors: tuple[MapError, ...] = Field(description="departure of the map, for each arithmetic")
    error_bound_dph: float = Field(description="largest bound of all arithmetics, deg/h")
    worst_error_dph: WorstError = Field(description="largest departure of all arithmetics")

    def instructions_of_sample(self, target: str | None, numeric: str) -> CallCost | None:
        """Return the instructions of a sample on a target, as its emulator counts them; None if not counted."""
        own = (t.step_instructions for t in self.targets if (t.name, t.numeric) == (target, numeric))
        return next(own, None)

    @property
    def not_installed(self) -> tuple[list[str], list[str]]:
        """Targets whose tools are not installed, and the packages that bring them."""
        missing = [entry for entry in self.targets if entry.status == "missing"]
        packages = {word for entry in missing for word in (entry.package or "").split()}
        return list(dict.fromkeys(entry.name for entry in missing)), sorted(packages)


class JointVerification(_Counted):
    """Checks of the emitted code of a folder with several axes."""

    axes: dict[str, Verification] = Field(description="verification of each axis")
