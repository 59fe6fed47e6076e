"""Findings that follow from recordings alone: facts of their runs, rows that count twice, a reversed sign.

A finding has an id that stays stable, a text, and the numbers behind it. It never stops a job. It follows from figures
alone: no name of a file, folder or serial plays a part.

Each finding says what to do next. Findings follow from figures alone, as all of `findings`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..common.metrics import LEAST_SPAN_C, median
from ..recordings.description import exclude_line
from ..recordings.plausibility import earth_rate_warning
from ..recordings.records import Dataset, Mark, Rows, Run, SharedRows
from .facts import RunFacts
from .thermometers import stuck_stretches

Finding = dict[str, Any]

_GROSS_OUTLIER = 100.0  # times the noise of a row: no noise of a gyro, whatever its tails
_PLACE_C, _PLACE_C_PER_MIN = 1.0, 0.25  # what counts as the same temperature and rate of it
_COMMON_PLACES = 5  # fewer do not make a median
_CONTRADICTION = 5.0  # times the scatter of a minute within such a place
_LEAST_FREEDOM = 10  # degrees of freedom: with fewer a scatter is known to no better than a quarter


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


def jump_findings(facts: Sequence[RunFacts]) -> Iterator[Finding]:
    """Changes of temperature from one row to the next that no thermal mass can make."""
    jumps = [(f.file, jump) for f in facts for jump in f.jumps]
    if jumps:
        file, first = jumps[0]
        yield finding(
            "jump_in_temperature",
            f"Temperature jumps as no thermal mass can ({len(jumps)} places), first in {file} at "
            f"{first.time_s:.6g} s from {first.from_c:.6g} to {first.to_c:.6g} C.",
            jumps=[
                {"file": name, "time_s": j.time_s, "from_c": j.from_c, "to_c": j.to_c} for name, j in jumps
            ],
        )


def counter_findings(facts: Sequence[RunFacts]) -> Iterator[Finding]:
    """Counts of pulses that step by the whole range of a counter: it passed its end, and nobody added that."""
    for f in facts:
        if f.wrapped is not None:
            time_s, bits, places = f.wrapped
            yield finding(
                "counter_wrapped",
                f"Pulses in {_run(f)} step by 2^{bits}, the range of a counter of {bits} bits ({places} places), first "
                f"at {time_s:.10g} s: it passed its end, or negative counts were stored without their sign.",
                file=f.file,
                from_s=f.from_s,
                time_s=time_s,
                bits=bits,
                places=places,
            )


def held_findings(facts: Sequence[RunFacts]) -> Iterator[Finding]:
    """Rates that are held for several rows: there are fewer than rows, and their noise is not what it seems."""
    for f in facts:
        if f.held_rows > 1:
            yield finding(
                "rate_held",
                f"{_run(f)} holds each rate for {f.held_rows} rows: the gyro answers every "
                f"{f.held_rows * f.row_period_s:.4g} s, the rows come every {f.row_period_s:.4g} s. Record at the "
                "gyro's own rhythm, or keep every row of it once.",
                file=f.file,
                from_s=f.from_s,
                held_rows=f.held_rows,
                row_period_s=f.row_period_s,
            )


def outlier_findings(facts: Sequence[RunFacts]) -> Iterator[Finding]:
    """Rows that no noise explains."""
    for f in facts:
        if f.outlier is not None and abs(f.outlier.departure_dph) > _GROSS_OUTLIER * f.noise_dph:
            yield finding(
                "rate_outliers",
                f"{f.outliers} rows of {_run(f)} depart from those around them, most at {f.outlier.time_s:.10g} s: "
                f"{f.outlier.rate_dph:.4g} deg/h, where a row's noise is {f.noise_dph:.2g} deg/h.",
                file=f.file,
                from_s=f.from_s,
                rows=f.outliers,
                time_s=f.outlier.time_s,
                rate_dph=f.outlier.rate_dph,
                noise_dph=f.noise_dph,
            )


def contradiction_findings(facts: Sequence[RunFacts]) -> Iterator[Finding]:
    """Training runs that show another rate where others were at the same temperature and rate of it.

    A map gives one answer there; what it then fits is a mean of both, which neither run shows.
    """
    runs = [f for f in facts if f.role == "train" and len(f.rates_dph)]
    if len(runs) < 2:
        return
    run = np.concatenate([np.full(len(f.rates_dph), k) for k, f in enumerate(runs)])
    rate = np.concatenate([f.rates_dph for f in runs])
    at = np.concatenate(
        [
            np.column_stack([f.temperatures_c / _PLACE_C, f.slopes_c_per_min / _PLACE_C_PER_MIN]).round()
            for f in runs
        ]
    )
    keys, group = np.unique(np.column_stack([at, run]), axis=0, return_inverse=True)
    group = group.reshape(-1)
    count = np.bincount(group)
    mean = np.bincount(group, rate) / count
    freedom = len(rate) - len(keys)
    if freedom < _LEAST_FREEDOM:
        return
    scatter = float(np.sqrt(np.sum((rate - mean[group]) ** 2) / freedom))
    yield from _contradictions(runs, keys, mean, scatter)


def _contradictions(
    runs: Sequence[RunFacts], keys: NDArray[np.float64], mean: NDArray[np.float64], scatter: float
) -> Iterator[Finding]:
    """One finding for each run that departs from the run, or the middle of the runs, that was in the same places.

    Args:
        keys: Place (two columns) and number of the run, shape (n, 3).
        mean: Mean rate there, deg/h, shape (n,).
        scatter: By how much means over a minute scatter within a place, deg/h.
    """
    _, place = np.unique(keys[:, :2], axis=0, return_inverse=True)
    order = np.argsort(place.reshape(-1), kind="stable")
    departures: dict[int, list[float]] = {}
    for members in np.split(order, np.flatnonzero(np.diff(place.reshape(-1)[order])) + 1):
        if len(members) < 2:
            continue
        other_one = [float(mean[m]) for m in members[::-1]]  # of two
        others = [median(mean[members])] * len(members) if len(members) > 2 else other_one
        for m, other in zip(members, others, strict=True):
            departures.setdefault(int(keys[m, 2]), []).append(float(mean[m]) - other)
    for k, values in departures.items():
        difference = float(np.median(np.abs(values)))
        if len(values) >= _COMMON_PLACES and difference > _CONTRADICTION * scatter:
            yield finding(
                "runs_contradict",
                f"{_run(runs[k])} contradicts the other training runs: at the same temperature and its rate, it "
                f"shows {difference:.4g} deg/h more or less ({len(values)} places; minutes of a run scatter by "
                f"{scatter:.2g}). "
                "A map can follow only one of them.",
                file=runs[k].file,
                from_s=runs[k].from_s,
                difference_dph=difference,
                scatter_dph=scatter,
                places=len(values),
            )


def _run(f: RunFacts) -> str:
    return f.file if f.from_s is None else f"{f.file} from {f.from_s:.6g} s"


def earth_rate_findings(dataset: Dataset, facts: Sequence[RunFacts]) -> Iterator[Finding]:
    """A mean rate that could be Earth's rate, and no word whether that is still in the data."""
    if not facts:
        return
    mean = float(np.average([f.mean_dph for f in facts], weights=[f.rows for f in facts]))
    warning = earth_rate_warning(dataset.earth_rate, mean)
    if warning:
        yield finding("earth_rate_not_stated", warning, mean_dph=mean)


def finding(name: str, text: str, **evidence: Any) -> Finding:
    """A finding as results hold it."""
    return {"id": name, "text": text, "evidence": evidence}


_LEAST_RUNS = 3  # of two runs nobody knows which one is reversed
_LEAST_PLACES = 8  # of eight places a correlation of 0.9 is chance in 0.2 % of cases
_ALIKE = 0.9  # correlation of a run's mean curve over temperature with that of the others
_STUCK_ROWS = 60  # that differ from the one before: fewer do not show the steps of a rate
_FEWEST_VALUES = 10  # a channel of fewer values says nothing


_COARSE_ROWS = 2**17  # rows that the resolution is recognised from
_REPEATS = 0.6  # share of rows that repeat the one before: the noise is below a third of a step
_ONE_STEP = 1.5  # a reading that moves by less at a time moves by one step of its resolution


def shared_rows_findings(dataset: Dataset) -> Iterator[Finding]:
    """Rows that several training runs, or several exams, hold, or one run twice: they count twice."""
    for shared in dataset.shared:
        rows = shared.rows[1] - shared.rows[0] + 1
        same = (
            "are also"
            if shared.likeness is None
            else f"have the noise (correlation {shared.likeness:.2f}) of"
        )
        text = (
            f"Rows {shared.rows[0]} to {shared.rows[1]} of {shared.file} {same} rows {shared.other_rows[0]} to "
            f"{shared.other_rows[1]} of {_other(shared)}: these {rows} rows would count twice, so the former are left "
            f"out. To state it: {exclude_line([shared.span_s], f'also in {shared.other_file}')}"
        )
        yield {"id": "shared_rows", "text": text, "evidence": asdict(shared)}


def shared_axes_findings(dataset: Dataset) -> Iterator[Finding]:
    """Axes of a recording that hold the same noise."""
    for shared in dataset.shared_axes:
        one, other = shared.axes
        text = (
            f"Axes {one} and {other} of {shared.file} hold the same noise (correlation {shared.likeness:.2f}): one of "
            "them is a copy of the other."
        )
        yield {"id": "shared_axes", "text": text, "evidence": asdict(shared)}


def _other(shared: SharedRows) -> str:
    return "the same file" if shared.other_file == shared.file else shared.other_file


def sign_findings(facts: Sequence[RunFacts]) -> Iterator[Finding]:
    """Runs whose mean rate over temperature is the others' with its sign reversed, where all the others agree."""
    runs = [f for f in facts if len(f.rates_dph)]
    if len(runs) < _LEAST_RUNS:
        return
    curves = [_curve(f) for f in runs]
    for k, f in enumerate(runs):
        others = [c for j, c in enumerate(curves) if j != k]
        if any(_correlation(curves[k], other) >= -_ALIKE for other in others):
            continue
        mine = [_correlation(curves[k], other) for other in others]
        among = [_correlation(a, b) for i, a in enumerate(others) for b in others[i + 1 :]]
        if min(among) > _ALIKE:
            yield {
                "id": "sign_reversed",
                "text": (
                    f"{f.file} has its sign reversed against the other runs: its mean rate over temperature is "
                    f"theirs mirrored (correlation {max(mine):.3f} or less; theirs with one another "
                    f"{min(among):.3f} or more). Look at mounting and wiring; where it is only the sign, write "
                    f"the rates of this file with the other sign, or leave the run out."
                ),
                "evidence": {"file": f.file, "from_s": f.from_s, "correlation": max(mine)},
            }


def _curve(f: RunFacts) -> dict[int, float]:
    """Mean rate at each degree, deg/h."""
    place = np.round(f.temperatures_c / _PLACE_C).astype(np.int64)
    order = np.argsort(place, kind="stable")
    starts = np.flatnonzero(np.diff(place[order], prepend=place[order[0]] - 1))
    rates = np.split(f.rates_dph[order], starts[1:])
    return {
        p: float(np.add.reduce(of) / len(of))
        for p, of in zip(place[order[starts]].tolist(), rates, strict=True)
    }


def _correlation(one: dict[int, float], other: dict[int, float]) -> float:
    """Correlation of two curves over the temperatures that both have; 0 for too few."""
    common = sorted(one.keys() & other.keys())
    if len(common) < _LEAST_PLACES:
        return 0.0
    a, b = np.array([one[p] for p in common]), np.array([other[p] for p in common])
    if np.ptp(a) == 0.0 or np.ptp(b) == 0.0:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])


def copied_channel_findings(run: Run, rows: Rows) -> Iterator[Finding]:
    """Channels that hold the very values of another column: a logger's wiring, or a column written twice."""
    columns = {"temperature": rows.temperature_c, "rate": rows.rate_dph} | {
        f"channel {name}": values for name, values in rows.channels.items()
    }
    names = list(columns)
    for k, name in enumerate(names):
        for other in names[:k]:
            same = np.array_equal(columns[name], columns[other], equal_nan=True)
            if same and len(np.unique(columns[name][:: max(1, len(rows) // 1000)])) >= _FEWEST_VALUES:
                yield {
                    "id": "channel_copy",
                    "text": (
                        f"{name} of {run.file} is a copy of the {other}, row by row: it tells nothing of its own. "
                        f"Record the sensor that was meant, or take the column out."
                    ),
                    "evidence": {"file": run.file, "from_s": run.from_s, "column": name, "copy_of": other},
                }


def stuck_temperature_findings(run: Run, rows: Rows) -> Iterator[Finding]:
    """The longest stretch in which the thermometer was stuck."""
    inside = run.in_span(rows.time_s)
    temperature, time = rows.temperature_c, rows.time_s
    if not inside.all():
        temperature, time = temperature[inside], time[inside]
    stretches = stuck_stretches(time, temperature, run.row_period_s)
    if not stretches:
        return
    start, length = max(stretches, key=lambda stretch: stretch[1])
    first, last = float(time[start]), float(time[start + length - 1])
    line = exclude_line([(first, last + run.row_period_s)], "thermometer stuck")
    yield {
        "id": "stuck_temperature",
        "text": (
            f"the temperature stays at {temperature[start]:.6g} C from {first:.10g} to {last:.10g} s "
            f"({length} rows), where it otherwise changes from row to row: the thermometer was stuck. Look at its "
            f"wiring; to leave the stretch out: {line}"
        ),
        "evidence": {
            "file": run.file,
            "from_s": run.from_s,
            "span_s": [first, last],
            "rows": int(length),
        },
        "marks": (Mark(run.file, _rows_of(inside, start, length), (first, last + run.row_period_s)),),
    }


def _rows_of(inside: NDArray[np.bool_], first: int, count: int) -> tuple[int, int]:
    """First and last row of the file, from 1, of a stretch of the rows inside the run."""
    at = np.flatnonzero(inside)
    return int(at[first]) + 1, int(at[first + count - 1]) + 1


def coarse_rate_findings(run: Run, rows: Rows) -> Iterator[Finding]:
    """Rates whose steps are far above the noise: what lies between two steps cannot be learnt by averaging.

    Counted pulses carry what is left over into the next row, and pass.
    """
    if run.pulse_weight_arcsec is not None:
        return
    rate = rows.rate_dph[run.in_span(rows.time_s)][:_COARSE_ROWS]
    rate = rate[np.isfinite(rate)]
    move = np.abs(np.diff(rate))
    moved = move[move > 0.0]
    if len(moved) < _STUCK_ROWS or len(moved) > (1.0 - _REPEATS) * len(move):
        return
    levels = np.unique(rate)
    step = float(np.median(np.diff(levels)))
    if float(np.median(moved)) > _ONE_STEP * step:
        return
    yield {
        "id": "coarse_rate",
        "text": (
            f"the rate comes in steps of {step:.4g} deg/h, far above its noise: {1.0 - len(moved) / len(move):.0%} of "
            f"the rows repeat the one before, and means can be off by up to {0.5 * step:.2g} deg/h, which no averaging "
            f"mends"
        ),
        "evidence": {"file": run.file, "from_s": run.from_s},
        "marks": (),
    }
