"""Traces of a replay (docs/FORMAT.md, section 4): rows of a run, or means of several, with their corrections."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..common.texts import file_stem
from ..recordings.records import Run
from ..store.files import create

_COLUMNS = ("time_s", "temperature_c", "rate_dph", "bias_dph", "compensated_dph", "status")


def trace_name(run: Run, all_runs: Sequence[Run]) -> str:
    """Name of a run's trace: the file's stem, its start where runs share a file, its folders where stems collide."""
    stem = Path(run.file).stem
    if any(Path(r.file).stem == stem and r.file != run.file for r in all_runs):
        stem = run.file.replace("/", "_")
    shared = sum(r.file == run.file for r in all_runs) > 1
    return file_stem(stem) + (f"@{run.from_s or 0.0:g}" if shared else "") + ".csv"


@contextmanager
def trace_at(path: Path, each: int) -> Iterator[Callable[[Sequence[FloatArray], NDArray[np.int32]], None]]:
    """A trace of means of every `each` rows of a span, which is written as its rows come; there when the block ends."""
    path.parent.mkdir(parents=True, exist_ok=True)
    options = pacsv.WriteOptions(include_header=False, quoting_style="none")
    part = path.with_name(f".{path.name}.part")
    waiting: list[NDArray[Any]] = []

    def write(columns: Sequence[NDArray[Any]]) -> None:
        if not columns[0].size:
            return
        time, temperature, rate, bias = _means(list(columns[:4]), each)
        bits = np.bitwise_or.reduceat(columns[4], np.arange(0, columns[4].size, each))
        written = [_arrow(values) for values in (time, temperature, rate, bias, rate - bias, bits)]
        pacsv.write_csv(pa.Table.from_arrays(written, _COLUMNS), stream, options)

    def take(columns: Sequence[FloatArray], status: NDArray[np.int32]) -> None:
        nonlocal waiting
        new: list[NDArray[Any]] = [*columns, status]
        whole = [np.concatenate(pair) for pair in zip(waiting, new, strict=True)] if waiting else new
        end = whole[0].size // each * each
        write([values[:end] for values in whole])
        waiting = [values[end:] for values in whole]

    with create(part) as stream:
        stream.write((",".join(_COLUMNS) + "\n").encode("ascii"))
        yield take
        if waiting:
            write(waiting)
    part.replace(path)


def _arrow(values: NDArray[Any]) -> pa.Array:
    """Numbers as Arrow has them; `pa.array` would load pandas where that is installed."""
    buffer = pa.py_buffer(np.ascontiguousarray(values))
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), [None, buffer])


def _means(columns: list[FloatArray], each: int) -> list[FloatArray]:
    """Means of every `each` rows of columns, of which the third counts most: rows in which it is NaN do not."""
    if each == 1:
        return columns
    starts = np.arange(0, columns[0].size, each)
    known = np.isfinite(columns[2])
    used = known | np.repeat(np.add.reduceat(known, starts, dtype=np.int64) == 0, each)[: known.size]
    count = np.add.reduceat(used, starts, dtype=np.int64)
    return [np.add.reduceat(np.where(used, values, 0.0), starts) / count for values in columns]
