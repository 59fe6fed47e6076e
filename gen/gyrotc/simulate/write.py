"""Writes a simulated data set: run files in chunks, `dataset.toml`, `truth.json`; the folder appears complete or not at all."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from numpy.typing import NDArray

from ..errors import InputError
from .recording import Chunk
from .truth import FILE as TRUTH_FILE

__all__ = ["Format", "RunFile", "complete_folder", "dataset_toml"]

Format = Literal["csv", "parquet"]
_RATE_DECIMALS = 9
_TEMPERATURE_DECIMALS = 6
_TIME_DECIMALS = 6


class _Writer(Protocol):
    def write_table(self, table: pa.Table) -> None: ...
    def close(self) -> None: ...


@contextmanager
def complete_folder(out: Path) -> Iterator[Path]:
    """A temporary folder beside `out` that takes its name at the end; on an error nothing is left and `out` is as before.

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
    """One run on disk, written chunk by chunk: rates, or pulses (counts since the last row; the first row starts the clock)."""

    def __init__(self, path: Path, format: Format, row_s: float, pulse_weight_arcsec: float | None) -> None:
        self._row_s = row_s
        self._weight = pulse_weight_arcsec
        value = pa.field("rate_dph", pa.float64()) if self._weight is None else pa.field("pulses", pa.int64())
        self._schema = pa.schema([("time_s", pa.float64()), ("temperature_c", pa.float64()), value])
        self._started = False
        self._writer: _Writer
        if format == "csv":
            path.write_text(",".join(self._schema.names) + "\n", "utf-8")
            plain = pyarrow.csv.WriteOptions(include_header=False, quoting_style="none")
            self._sink = path.open("ab")
            self._writer = pyarrow.csv.CSVWriter(self._sink, self._schema, write_options=plain)
        else:
            self._sink = path.open("wb")
            self._writer = pyarrow.parquet.ParquetWriter(self._sink, self._schema, use_dictionary=False)

    def write(self, chunk: Chunk) -> None:
        """Appends rows."""
        time_s = np.round(chunk.time_s, _TIME_DECIMALS)
        temperature = np.round(chunk.temperature_c, _TEMPERATURE_DECIMALS)
        value: NDArray[Any]
        if self._weight is None:
            value = np.round(np.diff(chunk.edge_arcsec) / self._row_s, _RATE_DECIMALS)
        else:
            value = np.diff(np.floor(chunk.edge_arcsec / self._weight).astype(np.int64))
            time_s = np.round(chunk.time_s + self._row_s, _TIME_DECIMALS)
            if not self._started:
                time_s, value = np.append(0.0, time_s), np.append(0, value)
                temperature = np.append(temperature[0], temperature)
        self._started = True
        self._writer.write_table(pa.Table.from_arrays([time_s, temperature, value], schema=self._schema))

    def close(self) -> None:
        """Ends the file."""
        self._writer.close()
        self._sink.close()


def dataset_toml(head: dict[str, Any], tables: dict[str, dict[str, Any]], runs: list[dict[str, Any]]) -> str:
    """`dataset.toml` as text: keys of the head, tables of plain values, then the runs."""
    lines = [*_pairs(head)]
    for name, table in tables.items():
        lines += ["", f"[{name}]", *_pairs(table)]
    for run in runs:
        lines += ["", "[[run]]", *_pairs(run)]
    return "\n".join(lines) + "\n"


def _pairs(table: dict[str, Any]) -> list[str]:
    return [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in table.items()]
