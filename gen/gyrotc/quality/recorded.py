"""What a look at the recordings themselves tells, before any model: rows that count twice, a sign against the others.

Each finding says what to do next. Findings follow from figures alone, as all of `findings`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..recordings.records import Dataset, Mark, Rows, Run, SharedRows
from .facts import RunFacts

__all__ = [
    "coarse_rate_findings",
    "copied_channel_findings",
    "exclude_line",
    "shared_rows_findings",
    "sign_findings",
    "stuck_temperature_findings",
]

Finding = dict[str, Any]

_LEAST_RUNS = 3  # of two runs nobody knows which one is reversed
_PLACE_C = 1.0  # what counts as the same temperature, as in `findings`
_LEAST_PLACES = 8  # of eight places a correlation of 0.9 is chance in 0.2 % of cases
_ALIKE = 0.9  # correlation of a run's mean curve over temperature with that of the others
_STUCK_S, _STUCK_ROWS = (
    60.0,
    60,
)  # where half of the rows differ from the one before, 60 alike come once in 2^60
_FEWEST_VALUES = 10  # a channel of fewer values says nothing


_COARSE_ROWS = 2**17  # rows that the resolution is told from
_REPEATS = 0.6  # share of rows that repeat the one before: the noise is below a third of a step
_ONE_STEP = 1.5  # a reading that moves by less at a time moves by one step of its resolution


def exclude_line(from_s: float, to_s: float, reason: str) -> str:
    """A line for the run's entry in dataset.toml, ready to paste."""
    return f'exclude = [{{from_s = {from_s!r}, to_s = {to_s!r}, reason = "{reason}"}}]'


def shared_rows_findings(dataset: Dataset) -> Iterator[Finding]:
    """Rows that several training runs, or several exams, hold, or one run twice: they count twice."""
    for shared in dataset.shared:
        rows = shared.rows[1] - shared.rows[0] + 1
        text = (
            f"Rows {shared.rows[0]} to {shared.rows[1]} of {shared.file} are also rows {shared.other_rows[0]} to "
            f"{shared.other_rows[1]} of {_other(shared)}: {rows} rows count twice. Keep one of them; to leave the "
            f"former out: {exclude_line(*shared.span_s, f'also in {shared.other_file}')}"
        )
        yield {"id": "shared_rows", "text": text, "evidence": asdict(shared)}


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
                    f"theirs turned over (correlation {max(mine):.3f} or less; theirs with one another "
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
    """The longest stretch of one identical temperature, where most other rows differ from the one before."""
    inside = run.in_span(rows.time_s)
    temperature, time = rows.temperature_c[inside], rows.time_s[inside]
    starts = np.flatnonzero(np.r_[True, temperature[1:] != temperature[:-1]])
    length = np.diff(np.r_[starts, len(temperature)])
    k = int(np.argmax(length))
    others = len(temperature) - int(length[k])
    if length[k] * run.row_period_s <= _STUCK_S or length[k] < _STUCK_ROWS or len(starts) - 1 <= 0.5 * others:
        return
    if others < _STUCK_ROWS:
        return
    first, last = float(time[starts[k]]), float(time[starts[k] + length[k] - 1])
    line = exclude_line(first, last + run.row_period_s, "thermometer stuck")
    yield {
        "id": "stuck_temperature",
        "text": (
            f"the temperature stays at {temperature[starts[k]]:.6g} C from {first:.10g} to {last:.10g} s "
            f"({length[k]} rows), where it otherwise changes from row to row: the thermometer was stuck. Look at its "
            f"wiring; to leave the stretch out: {line}"
        ),
        "evidence": {
            "file": run.file,
            "from_s": run.from_s,
            "span_s": [first, last],
            "rows": int(length[k]),
        },
        "marks": (Mark(run.file, _rows_of(inside, starts[k], length[k]), (first, last + run.row_period_s)),),
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
