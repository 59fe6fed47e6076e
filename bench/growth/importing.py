"""A long CSV file through `gyrotc import`, pandas, polars and pyarrow.

Each turns the same file (time in ms, temperature in K, rate in deg/s) into a Parquet file of s, C and deg/h, in a
process of its own; CPU time, elapsed time and peak memory are those of that process.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
from numpy.typing import NDArray

from ..campaigns import say

_ROWS_AT_ONCE = 2**20
_PEERS = {
    "pandas": (
        "import sys, pandas as pd\n"
        "t = pd.read_csv(sys.argv[1])\n"
        "o = pd.DataFrame({'time_s': t['time_ms'] / 1e3, 'temperature_c': t['temp_K'] - 273.15,\n"
        "                  'rate_dph': t['rate_dps'] * 3600})\n"
        "o.to_parquet(sys.argv[2])\n"
    ),
    "polars": (
        "import sys, polars as pl\n"
        "t = pl.read_csv(sys.argv[1])\n"
        "o = t.select((pl.col('time_ms') / 1e3).alias('time_s'), (pl.col('temp_K') - 273.15).alias('temperature_c'),\n"
        "             (pl.col('rate_dps') * 3600).alias('rate_dph'))\n"
        "o.write_parquet(sys.argv[2])\n"
    ),
    "polars, streaming": (
        "import sys, polars as pl\n"
        "t = pl.scan_csv(sys.argv[1])\n"
        "o = t.select((pl.col('time_ms') / 1e3).alias('time_s'), (pl.col('temp_K') - 273.15).alias('temperature_c'),\n"
        "             (pl.col('rate_dps') * 3600).alias('rate_dph'))\n"
        "o.sink_parquet(sys.argv[2])\n"
    ),
    "pyarrow": (
        "import sys, pyarrow as pa, pyarrow.csv as c, pyarrow.compute as pc, pyarrow.parquet as q\n"
        "t = c.read_csv(sys.argv[1])\n"
        "o = pa.table({'time_s': pc.divide(t['time_ms'], 1e3), 'temperature_c': pc.subtract(t['temp_K'], 273.15),\n"
        "              'rate_dph': pc.multiply(t['rate_dps'], 3600.0)})\n"
        "q.write_table(o, sys.argv[2])\n"
    ),
}


def importing(megabytes: float) -> dict[str, Any]:
    """Return times and memory of every reader of one file."""
    with tempfile.TemporaryDirectory(prefix="gyrotc-import-") as work:
        path = Path(work) / "log.csv"
        rows = _write(path, megabytes * 1e6)
        size = path.stat().st_size
        load = os.getloadavg()[0]
        program = str(Path(sys.executable).with_name("gyrotc"))
        commands = {"gyrotc import": [program, "import", str(path), "--out", f"{work}/gyrotc"]}
        for name, text in _PEERS.items():
            commands[name] = [sys.executable, "-c", text, str(path), f"{work}/{name}.parquet"]
        readers = {}
        for name, command in commands.items():
            say(f"import by {name}")
            readers[name] = _measured(command)
    packages = ("gyrotc", "pandas", "polars", "pyarrow")
    return {
        "bytes": size,
        "rows": rows,
        "load": load,
        "versions": {name: version(name) for name in packages},
        "readers": readers,
    }


def _write(path: Path, size: float) -> int:
    """A file of about that size; the number of its rows."""
    rng = np.random.default_rng(1)
    rows = 0
    plain = pyarrow.csv.WriteOptions(include_header=False)
    with path.open("wb") as sink:
        sink.write(b"time_ms,temp_K,rate_dps\n")
        while sink.tell() < size:
            pyarrow.csv.write_csv(_rows(rng, rows), sink, plain)
            rows += _ROWS_AT_ONCE
    return rows


def _rows(rng: np.random.Generator, first: int) -> pa.Table:
    """Rows of 1 ms: a temperature that goes up and down in hours, a gyro of 10 deg/h."""
    time_ms: NDArray[np.int64] = first + np.arange(_ROWS_AT_ONCE)
    temperature = 293.15 + 30.0 * np.sin(time_ms / 7.2e6)
    rate = (10.0 + rng.normal(0.0, 30.0, _ROWS_AT_ONCE)) / 3600.0
    columns = {"time_ms": time_ms, "temp_K": np.round(temperature, 4), "rate_dps": np.round(rate, 9)}
    return pa.table(columns)


def _measured(command: list[str]) -> dict[str, Any]:
    """Elapsed and CPU seconds and peak memory of a process, by a child that starts nothing else."""
    begun = time.monotonic()
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    _, status, used = os.wait4(child.pid, 0)
    elapsed = time.monotonic() - begun
    if status != 0:
        lines = (child.stderr.read() if child.stderr else b"").decode("utf-8", "replace").strip().splitlines()
        return {"failed": lines[-1][:200] if lines else f"status {status}"}
    return {"elapsed_s": elapsed, "cpu_s": used.ru_utime + used.ru_stime, "peak_mib": used.ru_maxrss / 1024.0}
