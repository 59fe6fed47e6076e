"""Rows that two runs hold: a test run with training data is refused, rows of two runs of one role count once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..common.errors import InputError
from .description import FILE, MIN_ROWS, Problems, exclude_line
from .fingerprints import windows_in_common
from .reading import Reader, Recording
from .records import Exclusion, Run, SharedRows

_PART = 2**20  # rows that are compared at once
_MOST = 20  # stretches of two runs that are reported
_TOLERANCE = 2.0**-22  # relative; rows are compared as float32


@dataclass(frozen=True, slots=True)
class _Span:
    """Time (s), temperature and rate of a run's file as they were recorded, NaN outside the run.

    Two of them are in memory at once, so values are what they are compared as.
    """

    time_s: FloatArray
    values: tuple[NDArray[np.float32], ...]


def shared_rows(runs: Sequence[Run], recordings: Mapping[str, Recording], problems: Problems) -> tuple[SharedRows, ...]:
    """Return rows that runs of one role have in common, or that a run has twice.

    Rows that a training run and a test run have in common are a problem, with the exclusion that solves it.
    """
    found: list[SharedRows] = []
    prints = [recordings[run.file].fingerprints.within(run) for run in runs]
    for (j, i), windows in windows_in_common(prints).items():
        for shared in _stretches(runs[j], runs[i], windows):
            if runs[i].role == runs[j].role:
                found.append(shared)
            else:
                of_exam = shared if runs[j].role == "exam" else _reversed_roles(shared)
                problems.add(_refused(of_exam), *of_exam.marks)
    return tuple(found)


def counted_once(runs: Mapping[int, Run], shared: Sequence[SharedRows]) -> dict[int, Run]:
    """Return the runs without the rows that another run has; a run of which too little would remain is left out."""
    kept = {}
    for number, run in runs.items():
        twice = [one for one in shared if one.file == run.file]
        gaps = tuple(Exclusion(*one.span_s, f"also in {one.other_file}") for one in twice)
        without = replace(run, exclude=(*run.exclude, *gaps)) if gaps else run
        if not gaps or np.count_nonzero(without.in_span(_span(run).time_s)) >= MIN_ROWS:
            kept[number] = without
    return kept


def _reversed_roles(shared: SharedRows) -> SharedRows:
    return replace(
        shared,
        file=shared.other_file,
        rows=shared.other_rows,
        span_s=shared.other_span_s,
        other_file=shared.file,
        other_rows=shared.rows,
        other_span_s=shared.span_s,
    )


def _refused(shared: SharedRows) -> InputError:
    """Return the refusal of a test run that holds training data."""
    line = exclude_line([shared.span_s], f"also in {shared.other_file}")
    return InputError(
        f"{shared.file}, rows {shared.rows[0]} to {shared.rows[1]}",
        f"{shared.rows[1] - shared.rows[0] + 1} rows of a test run that are also rows {shared.other_rows[0]} to "
        f"{shared.other_rows[1]} of {shared.other_file}, which is trained on",
        f"rows that training has not seen: {line} in the [[run]] of the test run in {FILE}, or one role for both",
    )


def _stretches(one: Run, other: Run, windows: NDArray[np.int64]) -> Iterator[SharedRows]:
    """Yield stretches in common, each extended as far as the rows are the same."""
    first, second = _span(one), _span(other)
    for _ in range(_MOST):
        if len(windows) == 0:
            return
        a, b, rows = windows[0].tolist()
        before = _alike(first, second, a, b, -1)
        after = max(_alike(first, second, a, b, 1), rows)
        inside = (windows[:, 0] < a + after) & (windows[:, 1] - windows[:, 0] == b - a)
        windows = windows[~inside]
        yield SharedRows(
            file=one.file,
            rows=(a - before + 1, a + after),
            span_s=_times(first.time_s, a - before, a + after, one.row_period_s),
            other_file=other.file,
            other_rows=(b - before + 1, b + after),
            other_span_s=_times(second.time_s, b - before, b + after, other.row_period_s),
        )


def _span(run: Run) -> _Span:
    reader = run.reader
    rows = replace(reader, earth=None, applied=None)() if isinstance(reader, Reader) else run.rows()
    inside = run.in_span(rows.time_s)
    values = [rows.temperature_c.astype(np.float32), rows.rate_dph.astype(np.float32)]
    for of_run in values:
        of_run[~inside] = np.nan
    return _Span(rows.time_s, tuple(values))


def _times(time_s: FloatArray, first: int, end: int, period_s: float) -> tuple[float, float]:
    """Return the times from the first row to the row that follows the last."""
    end = min(end, len(time_s))
    return float(time_s[first]), float(time_s[end] if end < len(time_s) else time_s[-1] + period_s)


def _alike(one: _Span, other: _Span, a: int, b: int, step: int) -> int:
    """Number of rows that are the same from rows a and b on (step 1), or before them (step -1)."""
    n = min(len(one.time_s) - a, len(other.time_s) - b) if step > 0 else min(a, b)
    for start in range(0, n, _PART):
        count = min(_PART, n - start)
        same = np.ones(count, dtype=bool)
        for x, y in zip(one.values, other.values, strict=True):
            u = x[a + start : a + start + count] if step > 0 else x[a - start - count : a - start][::-1]
            v = y[b + start : b + start + count] if step > 0 else y[b - start - count : b - start][::-1]
            same &= np.abs(u - v) <= _TOLERANCE * np.abs(u)
        if not same.all():
            return start + int(np.argmin(same))
    return n
