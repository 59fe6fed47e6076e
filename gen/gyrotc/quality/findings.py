"""Findings that a run's rows, or the facts of all runs, show by themselves, each with what to do next.

Findings follow from figures alone: no name of a file, folder or serial plays a part. They never stop a job.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import PART, BoolArray, FloatArray, masked, parts_of
from ..common.metrics import LEAST_SPAN_C, MAD_TO_SIGMA, median, median_of_parts
from ..common.missing import missing_rows
from ..recordings.description import exclude_line
from ..recordings.plausibility import earth_rate_warning
from ..recordings.records import Dataset, EarthRate, Mark, Rows, Run
from ..results.base import ADVICE, Estimate, Finding, MarkedRows, Size

ValueWithLimits = tuple[float, float, float]
"""A figure and its 95 % limits."""

_LINES = 20  # stretches that a line holds: more are a fault of the recording

_COARSE_STEP_C = 0.25  # at 1 C/min a slope over 100 s then rests on fewer than seven steps
_LATE_S = 3.0e8  # ten years: a time since some epoch, not since power-on
_SMALL_DPH = 1e-5  # below the noise of any gyro; deg/s or rad/s taken for deg/h
_MOVED_ROWS = 60  # that differ from the one before: fewer do not show the steps of a rate
_FEWEST_VALUES = 10  # a channel of fewer values says nothing
_COARSE_ROWS = 2**17  # rows that the resolution is recognised from
_REPEATS = 0.6  # share of rows that repeat the one before: the noise is below a third of a step
_ONE_STEP = 1.5  # a reading that moves by less at a time moves by one step of its resolution


class _OfFile(Protocol):
    """A run or its facts."""

    @property
    def file(self) -> str: ...
    @property
    def from_s(self) -> float | None: ...


def finding(
    id: str,
    text: str,
    run: _OfFile | str | None = None,
    *,
    marks: Sequence[Mark] = (),
    time_s: ValueWithLimits | None = None,
    size: tuple[ValueWithLimits, str] | None = None,
    leave_out: Sequence[tuple[float, float]] = (),
    whole_run: bool = False,
    advice: str | None = None,
    **evidence: Any,
) -> Finding:
    """A finding as results hold it; what does not apply is absent.

    Args:
        run: What it is about: a run, its facts, or a file; None: the data set or the model.
        size: With its unit.
        leave_out: Times to leave out, s; the first ones stand in the line to paste.
        advice: What to do next; None: what is usual for this id.
    """
    file, from_s = (run, None) if run is None or isinstance(run, str) else (run.file, run.from_s)
    given: dict[str, Any] = {} if from_s is None else {"from_s": from_s}
    if time_s is not None:
        given["time_s"] = Estimate.of(time_s)
    if size is not None:
        given["size"] = Size.of(size[0], unit=size[1])
    if leave_out:
        given["leave_out_s"] = tuple(leave_out)
    if whole_run:
        given["whole_run"] = True
    return Finding(
        id=id,
        where=(file or "data set") + ("" if from_s is None else f" from {from_s:.6g} s"),
        text=text,
        next=ADVICE.get(id, "") if advice is None else advice,
        file=file,
        exclude=exclude_line(leave_out[:_LINES], id) if leave_out else None,
        rows=tuple(MarkedRows(file=m.file, rows=m.rows, span_s=m.span_s) for m in marks[:_LINES]),
        evidence=evidence,
        **given,
    )


def temperature_findings(facts: Sequence[RunFacts]) -> Iterator[Finding]:
    """Nothing can be learnt about temperature where it hardly changes over all training runs."""
    runs = [f for f in facts if f.role == "train"]
    if not runs:
        return
    low, high = min(f.temperature_c[0] for f in runs), max(f.temperature_c[1] for f in runs)
    if high - low < LEAST_SPAN_C:
        yield finding(
            "no_temperature_information",
            f"Temperature spans {high - low:.3g} C in training: nothing can be learnt about temperature, "
            "and the model is a constant.",
            span_c=high - low,
            required_c=LEAST_SPAN_C,
        )


def counter_findings(f: RunFacts) -> Iterator[Finding]:
    """Counts of pulses that step by the whole range of a counter: it passed its end, and nobody added that."""
    if f.wrapped is not None:
        time_s, bits, places = f.wrapped
        yield finding(
            "counter_wrapped",
            f"Pulses in {f.file} step by 2^{bits}, the range of a counter of {bits} bits ({places} places), first at "
            f"{time_s:.10g} s: it passed its end, or negative counts were stored without their sign.",
            f,
            marks=(Mark(f.file, None, (time_s - f.row_period_s, time_s)),),
            time_s=(time_s,) * 3,
            bits=bits,
            places=places,
        )


def held_findings(f: RunFacts) -> Iterator[Finding]:
    """Rates that are held for several rows: there are fewer than rows, and their noise is not what it seems."""
    if f.held_rows > 1:
        yield finding(
            "rate_held",
            f"{f.file} holds each rate for {f.held_rows} rows: the gyro answers every "
            f"{f.held_rows * f.row_period_s:.4g} s, the rows come every {f.row_period_s:.4g} s.",
            f,
            held_rows=f.held_rows,
            row_period_s=f.row_period_s,
        )


def constant_findings(f: RunFacts) -> Iterator[Finding]:
    """Yield columns of one value, coarse temperatures, tiny rates, a clock that began long ago."""
    for column in f.constant:
        yield finding("constant_channel", f"{column} holds one value in all {f.rows} rows", f)
    step = f.temperature_step_c
    if step >= _COARSE_STEP_C:
        what = "whole degrees" if step % 1.0 == 0.0 else f"steps of {step:.3g} C"
        text = f"temperature comes in {what}: its rate is the difference of two such steps"
        yield finding("coarse_temperature", text, f)
    if 0.0 < f.largest_dph < _SMALL_DPH:
        text = f"no rate exceeds {f.largest_dph:.3g} deg/h; are they in deg/s or rad/s?"
        yield finding("small_rates", text, f)
    if abs(f.first_s) > _LATE_S:
        text = f"time starts at {f.first_s:.10g} s; it should count from power-on"
        yield finding("time_since_epoch", text, f)


def earth_rate_findings(dataset: Dataset, facts: Sequence[RunFacts]) -> Iterator[Finding]:
    """A mean rate that could be Earth's rate, and no word whether that is still in the data."""
    if not facts:
        return
    mean = float(np.average([f.mean_dph for f in facts], weights=[f.rows for f in facts]))
    warning = earth_rate_warning(dataset.earth_rate, mean)
    if warning:
        yield finding("earth_rate_not_stated", warning, mean_dph=mean)


def shared_rows_findings(dataset: Dataset) -> Iterator[Finding]:
    """Yield rows that several training runs, or several test runs, hold, or one run twice: they count twice."""
    for shared in dataset.shared:
        rows = shared.rows[1] - shared.rows[0] + 1
        other = "the same file" if shared.other_file == shared.file else shared.other_file
        text = (
            f"Rows {shared.rows[0]} to {shared.rows[1]} of {shared.file} are also rows {shared.other_rows[0]} to "
            f"{shared.other_rows[1]} of {other}: these {rows} rows would count twice, so the former are left out. To "
            f"state it: {exclude_line([shared.span_s], f'also in {shared.other_file}')}"
        )
        yield finding("shared_rows", text, shared.file, marks=shared.marks, **asdict(shared))


def shared_axes_findings(dataset: Dataset) -> Iterator[Finding]:
    """Axes of a recording that hold the same values."""
    for shared in dataset.shared_axes:
        one, other = shared.axes
        text = f"Axes {one} and {other} of {shared.file} hold the same values: one of them is a copy of the other."
        yield finding("shared_axes", text, shared.file, **asdict(shared))


def copied_channel_findings(run: Run, rows: Rows) -> Iterator[Finding]:
    """Channels that hold the very values of another column: a logger's wiring, or a column written twice."""
    columns = {"temperature": rows.temperature_c, "rate": rows.rate_dph} | {
        f"channel {name}": values for name, values in rows.channels.items()
    }
    names = list(columns)
    for k, name in enumerate(names):
        for other in names[:k]:
            one, some = columns[name], slice(None, None, max(1, len(rows) // 1000))
            if not np.array_equal(one[some], columns[other][some], equal_nan=True):  # nearly all are told by a few rows
                continue
            same = all(np.array_equal(one[part], columns[other][part], equal_nan=True) for part in parts_of(len(rows)))
            if same and len(np.unique(one[some])) >= _FEWEST_VALUES:
                text = (
                    f"{name} of {run.file} is a copy of the {other}, row by row: it tells nothing of its own. Record "
                    "the sensor that was meant, or take the column out."
                )
                yield finding("channel_copy", text, run, column=name, copy_of=other)


def coarse_rate_findings(run: Run, rows: Rows) -> Iterator[Finding]:
    """Rates whose steps are far above the noise: what lies between two steps cannot be learnt by averaging.

    Counted pulses carry what is left over into the next row, and pass.
    """
    if run.pulse_weight_arcsec is not None:
        return
    rate = masked(rows.rate_dph, run.in_span(rows.time_s))[:_COARSE_ROWS]
    rate = rate[np.isfinite(rate)]
    move = np.abs(np.diff(rate))
    moved = move[move > 0.0]
    if len(moved) < _MOVED_ROWS or len(moved) > (1.0 - _REPEATS) * len(move):
        return
    levels = np.unique(rate)
    step = float(np.median(np.diff(levels)))
    if float(np.median(moved)) > _ONE_STEP * step:
        return
    text = (
        f"the rate comes in steps of {step:.4g} deg/h, far above its noise: {1.0 - len(moved) / len(move):.0%} of the "
        f"rows repeat the one before, and means can be off by up to {0.5 * step:.2g} deg/h, which no averaging mends"
    )
    yield finding("coarse_rate", text, run)


# Fewer rows at an end of the range may be there by chance.
_SATURATED_ROWS = 10
# Rows elsewhere must repeat less often than this share of those at the end, else the rate is coarse or held everywhere.
_SATURATED_RATIO = 0.2

_CELL_S = 60.0  # temperature is averaged over this before its rate is looked at
_CELL_ROWS = 5  # fewer do not average the resolution of a thermometer
_HOLD_C_PER_MIN = 0.1  # slower than this a chamber holds, or settles
# Widths of counters in the processors and FPGAs that read gyros out
_COUNTER_BITS = (8, 12, 16, 18, 20, 24, 32)
_LEAST_HELD = 30  # rates: fewer do not show a rhythm
_HELD = 0.9  # of them held for as long as the others, to a row: their rhythms need not fit
_WRAP_SIGMAS = 7.0  # once in 4e11 normal rows


@dataclass(frozen=True, slots=True)
class RunFacts:
    """Facts about the rows of one run; temperatures in C, rates in deg/h, times in s on the file's clock.

    Attributes:
        file: Its file.
        from_s: Start of its span, None for the whole file.
        role: What it is for.
        environment: Free text of the description.
        sha256: Of the file.
        started: Whether the start of the recording is stated.
        rows: Number of its rows.
        first_s: Time of its first row.
        last_s: Time of its last row.
        row_period_s: Median row period of the file.
        gaps: Number of places at which rows are missing.
        missing_rows: Rows that are missing there.
        temperature_c: Lowest and highest temperature.
        temperature_step_c: Smallest difference between two temperatures that occur; 0 if there is one only.
        slopes_c_per_min: Rates of temperature of cells of a minute (at least five rows).
        temperatures_c: Mean temperatures of these cells, same shape.
        rates_dph: Mean rates of these cells, same shape.
        hold_share: Share of these cells that change by less than 0.1 C/min.
        mean_dph: Mean rate.
        largest_dph: Largest magnitude of a rate.
        noise_dph: Scatter from row to row, robust.
        wrapped: Where a counter of pulses passed its end: time of the first place, bits of the counter, places.
        saturated_rows: Rows that repeat the largest or the smallest rate where others hardly ever repeat; 0: none.
        held_rows: For how many rows each rate is held; 1: every row has its own.
        constant: Columns that hold one value only.
        earth: Earth's rate that was taken off, None where there was nothing to take off.
    """

    file: str
    from_s: float | None
    role: str
    environment: str
    sha256: str
    started: bool
    rows: int
    first_s: float
    last_s: float
    row_period_s: float
    gaps: int
    missing_rows: int
    temperature_c: tuple[float, float]
    temperature_step_c: float
    slopes_c_per_min: FloatArray
    temperatures_c: FloatArray
    rates_dph: FloatArray
    hold_share: float
    mean_dph: float
    largest_dph: float
    noise_dph: float
    wrapped: tuple[float, int, int] | None
    saturated_rows: int
    held_rows: int
    constant: tuple[str, ...]
    earth: EarthRate | None


def run_facts(run: Run, rows: Rows) -> RunFacts:
    """Facts about a run from the rows of its file (as `run.rows()` gives them)."""
    inside = run.in_span(rows.time_s)
    time, temperature = masked(rows.time_s, inside), masked(rows.temperature_c, inside)
    finite = inside & np.isfinite(rows.rate_dph)
    rate = masked(rows.rate_dph, finite)
    gaps, missing = missing_rows(time, run.row_period_s)
    if not inside.all():
        together = np.diff(np.flatnonzero(inside))[gaps] == 1  # what was excluded is no gap
        gaps, missing = gaps[together], missing[together]
    low_c, high_c, resolution = _levels(temperature)
    measured = masked(rows.rate_dph, inside)
    if not np.isfinite(measured).all():
        measured = np.where(np.isfinite(measured), measured, rate.mean() if len(rate) else 0.0)
    cells_t, slopes, cells_rate = _cells(time, temperature, measured, run.row_period_s)
    noise = _robust_sigma(rate) / np.sqrt(2.0)
    return RunFacts(
        file=run.file,
        from_s=run.from_s,
        role=run.role,
        environment=run.environment,
        sha256=run.sha256,
        started=run.started is not None,
        rows=len(time),
        first_s=float(time[0]),
        last_s=float(time[-1]),
        row_period_s=run.row_period_s,
        gaps=len(gaps),
        missing_rows=int(missing.sum()),
        temperature_c=(low_c, high_c),
        temperature_step_c=resolution,
        slopes_c_per_min=slopes,
        temperatures_c=cells_t,
        rates_dph=cells_rate,
        hold_share=float(np.mean(np.abs(slopes) < _HOLD_C_PER_MIN)) if len(slopes) else 1.0,
        mean_dph=float(rate.mean()) if len(rate) else 0.0,
        largest_dph=float(max(rate.max(), -rate.min())) if len(rate) else 0.0,
        noise_dph=float(noise),
        wrapped=_wrapped(rows, finite, run.pulse_weight_arcsec),
        saturated_rows=saturated_rows(rate),
        held_rows=_held(rate),
        constant=_constant(rows, inside, rate),
        earth=run.earth,
    )


def _levels(temperature: FloatArray) -> tuple[float, float, float]:
    """Lowest and highest of the values, and the least difference of two of them; 0 where there is one."""
    values = temperature[np.r_[True, temperature[1:] != temperature[:-1]]]
    values.sort()
    least = np.inf
    for start in range(0, len(values), PART):
        step = np.diff(values[start : start + PART + 1])
        least = min(least, float(step[step > 0.0].min(initial=np.inf)))
    return float(values[0]), float(values[-1]), least if np.isfinite(least) else 0.0


def changes_in(values: FloatArray) -> NDArray[np.int64]:
    """Rows that differ from the one before, and the first row."""
    return np.flatnonzero(np.r_[True, values[1:] != values[:-1]])


def _robust_sigma(values: FloatArray) -> float:
    """Standard deviation about 0 of differences of neighbours from their median magnitude.

    Their RMS where more than half are 0.
    """
    if len(values) < 2:
        return 0.0

    def magnitudes() -> Iterator[FloatArray]:
        return (np.abs(np.diff(values[at : at + PART + 1])) for at in range(0, len(values) - 1, PART))

    sigma = MAD_TO_SIGMA * median_of_parts(magnitudes)
    return sigma if sigma > 0.0 else float(np.sqrt(np.mean(np.diff(values) ** 2)))


def _cells(
    time: FloatArray, temperature: FloatArray, rate: FloatArray, period_s: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean temperature of cells, its rate (C/min) by central differences, mean rate; empty for fewer than three."""
    length = max(_CELL_S, _CELL_ROWS * period_s)
    numbers = (np.floor((time[at : at + PART] - time[0]) / length) for at in range(0, len(time), PART))
    last = np.array([-1.0])
    found = []
    for at, number in enumerate(numbers):
        found.append(at * PART + np.flatnonzero(np.diff(number, prepend=last)))
        last = number[-1:]
    starts = np.concatenate(found)
    count = np.diff(np.r_[starts, len(time)])
    full = count * period_s >= 0.5 * length
    mean_t = (np.add.reduceat(temperature, starts) / count)[full]
    mean_s = (np.add.reduceat(time, starts) / count)[full]
    if len(mean_t) < 3:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    mean_rate = (np.add.reduceat(rate, starts) / count)[full]
    return mean_t, np.gradient(mean_t, mean_s) * 60.0, mean_rate


def _wrapped(rows: Rows, finite: BoolArray, weight_arcsec: float | None) -> tuple[float, int, int] | None:
    """Places where counted pulses step by a whole range of a counter (2^8 ... 2^32) and hardly by anything else."""
    if weight_arcsec is None or len(rows) < 4:
        return None
    counts = np.rint(rows.rate_dph[1:] * np.diff(rows.time_s) / weight_arcsec)
    use, time = finite[1:], rows.time_s[1:]
    step = np.diff(counts[use])
    for bits in _COUNTER_BITS:
        size = 2.0**bits
        if len(step) == 0 or np.abs(step).max() > 1.5 * size:
            continue
        rest = np.abs(step - size * np.rint(step / size))
        wraps = np.flatnonzero((np.abs(step) > 0.5 * size) & (rest < size / 8.0))
        usual = MAD_TO_SIGMA * median(rest)
        wraps = wraps[rest[wraps] <= _WRAP_SIGMAS * usual + 4.0]
        if len(wraps) and usual < size / 32.0:
            return float(time[use][wraps[0] + 1]), bits, len(wraps)
    return None


def longest_stretch(values: FloatArray) -> tuple[int, int]:
    """First row and number of rows of the longest stretch of one value; a missing one is as no other."""
    first = rows = begun = 0
    for start in range(1, len(values) + 1, PART):
        part = values[start : start + PART]
        ends = start + np.flatnonzero(part != values[start - 1 : start - 1 + len(part)])
        if start + PART > len(values):
            ends = np.r_[ends, len(values)]
        lengths = np.diff(ends, prepend=begun)
        k = int(np.argmax(lengths)) if len(lengths) else 0
        if len(lengths) and lengths[k] > rows:
            first, rows = int(ends[k] - lengths[k]), int(lengths[k])
        begun = int(ends[-1]) if len(ends) else begun
    return first, rows


def saturated_rows(rate: FloatArray) -> int:
    """Return how many rows are at an end of the range of the rate because they were cut there.

    Noise makes neighbouring rows differ. Rows beyond the end of a range do not: they repeat it, and no other value.
    """
    found = 0
    for end in (rate.max(initial=-np.inf), rate.min(initial=np.inf)):
        at = rate == end
        rows = int(np.count_nonzero(at))
        if _SATURATED_ROWS <= rows < rate.size - 1:
            repeats = rate[1:] == rate[:-1]
            there = float(np.mean(repeats[at[:-1]]))
            elsewhere = float(np.mean(repeats[~at[:-1]]))
            found += rows if there > _REPEATS and elsewhere < _SATURATED_RATIO * there else 0
    return found


def _held(rate: FloatArray) -> int:
    """Return for how many rows each rate is held by a logger that asks oftener than the gyro answers; 1 if none is.

    A coarse rate repeats, too, but never for one number of rows.
    """
    lengths = np.diff(changes_in(rate[:PART]))
    if len(lengths) < _LEAST_HELD:
        return 1
    usual = int(np.median(lengths))
    return usual if usual > 1 and float(np.mean(np.abs(lengths - usual) <= 1)) > _HELD else 1


def _constant(rows: Rows, inside: BoolArray, rate: FloatArray) -> tuple[str, ...]:
    columns = {"temperature": masked(rows.temperature_c, inside), "rate": rate}
    columns |= {f"channel {name}": masked(values, inside) for name, values in rows.channels.items()}
    return tuple(name for name, values in columns.items() if len(values) and np.ptp(values) == 0.0)
