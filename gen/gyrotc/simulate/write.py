"""Writes simulated runs in chunks and `dataset.toml`, into a folder that appears complete or not at all."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from numpy.typing import NDArray

from ..errors import InputError
from ..texts import toml_key, toml_value
from .recording import Chunk
from .truth import FILE as TRUTH_FILE

__all__ = ["Format", "RunFile", "complete_folder", "dataset_toml"]

Format = Literal["csv", "parquet"]
_RATE_DECIMALS = 9
_DECIMALS = 6


class _Writer(Protocol):
    def write_table(self, table: pa.Table) -> None: ...
    def close(self) -> None: ...


@contextmanager
def complete_folder(out: Path) -> Iterator[Path]:
    """A temporary folder beside `out` that takes its name at the end; after an error `out` is as before.

    Raises:
        InputError: `out` holds something that `simulate` did not make.
    """
    if out.exists() and not (out.is_dir() and ((out / TRUTH_FILE).is_file() or not any(out.iterdir()))):
        raise InputError(
            str(out), "exists and is no simulated data set", "a new folder, or one to make again"
        )
    out.parent.mkdir(parents=True, exist_ok=True)
    fresh = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    fresh.chmod(0o755)
    try:
        yield fresh
        if out.exists():
            shutil.rmtree(out)
        fresh.rename(out)
    except BaseException:
        shutil.rmtree(fresh, ignore_errors=True)
        raise


class RunFile:
    """One run on disk, written chunk by chunk.

    Rates are stamped with the start of their row. Pulses are counts since the last row, stamped with the end
    of theirs; a first row starts the clock.
    """

    def __init__(
        self,
        path: Path,
        format: Format,
        *,
        row_s: float,
        pulse_weight_arcsec: float | None,
        channels: Sequence[str] = (),
    ) -> None:
        self._row_s = row_s
        self._weight = pulse_weight_arcsec
        self._started = False
        value = ("rate_dph", pa.float64()) if pulse_weight_arcsec is None else ("pulses", pa.int64())
        floats = [(name, pa.float64()) for name in channels]
        self._schema = pa.schema([("time_s", pa.float64()), ("temperature_c", pa.float64()), value, *floats])
        self._writer: _Writer
        if format == "csv":
            path.write_text(",".join(self._schema.names) + "\n", "utf-8")
            self._sink = path.open("ab")
            plain = pyarrow.csv.WriteOptions(include_header=False, quoting_style="none")
            self._writer = pyarrow.csv.CSVWriter(self._sink, self._schema, write_options=plain)
        else:
            self._sink = path.open("wb")
            self._writer = pyarrow.parquet.ParquetWriter(self._sink, self._schema, use_dictionary=False)

    def write(self, chunk: Chunk) -> None:
        """Appends rows."""
        columns = [chunk.temperature_c, *chunk.channels.values()]
        rounded = [np.round(column, _DECIMALS) for column in columns]
        time_s: NDArray[Any] = chunk.time_s
        value: NDArray[Any]
        if self._weight is None:
            value = np.round(np.diff(chunk.edge_arcsec) / self._row_s, _RATE_DECIMALS)
        else:
            value = np.diff(np.floor(chunk.edge_arcsec / self._weight).astype(np.int64))
            time_s = time_s + self._row_s
            if not self._started:
                time_s, value = np.append(0.0, time_s), np.append(0, value)
                rounded = [np.append(column[0], column) for column in rounded]
        self._started = True
        arrays = [np.round(time_s, _DECIMALS), rounded[0], value, *rounded[1:]]
        self._writer.write_table(pa.Table.from_arrays(arrays, schema=self._schema))

    def __enter__(self) -> RunFile:
        return self

    def __exit__(self, *error: object) -> None:
        self._writer.close()
        self._sink.close()


def dataset_toml(head: dict[str, Any], tables: dict[str, dict[str, Any]], runs: list[dict[str, Any]]) -> str:
    """`dataset.toml` as text: keys of the head, tables of plain values, then the runs."""
    lines = [*_pairs(head)]
    for name, table in tables.items():
        lines += ["", f"[{toml_key(name)}]", *_pairs(table)]
    for run in runs:
        lines += ["", "[[run]]", *_pairs(run)]
    return "\n".join(lines) + "\n"


def _pairs(table: dict[str, Any]) -> list[str]:
    return [f"{toml_key(key)} = {toml_value(value)}" for key, value in table.items()]
