"""A small gyro: runs of about an hour over 20 to 50 C, whose bias follows the temperature; written in any form."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from recordings import Columns, toml, write_csv

ROWS = 360
HEAD = 'schema = 1\nserial = "RLG-1"\nearth_rate = "removed"'


def small_gyro(runs: int = 3, *, seed: int = 0, rows: int = ROWS) -> dict[str, Columns]:
    """Return runs by file name: ramps between two temperatures of their own, white noise of 1e-3 deg/h a row."""
    made = {}
    for k in range(runs):
        rng = np.random.default_rng([seed, k])
        low, high = 20.0 + rng.uniform(0.0, 3.0), 50.0 - rng.uniform(0.0, 3.0)
        phase = 2.0 * np.arange(rows) / rows
        temperature = np.round(low + (high - low) * (1.0 - np.abs(phase - 1.0)) + rng.normal(0.0, 0.01, rows), 4)
        bias = 0.01 * np.sin(temperature / 20.0)
        made[f"run-{k}.csv"] = {
            "time_s": 10.0 * np.arange(rows),
            "temperature_c": temperature,
            "rate_dph": np.round(bias + rng.normal(0.0, 1e-3, rows), 6),
        }
    return made


def write_gyro(folder: Path, runs: Mapping[str, Columns], *lines: str, head: str = HEAD, tail: str = "") -> Path:
    """Write runs as CSV with a description; `lines` are the lines of each [[run]] behind its file."""
    for name, columns in runs.items():
        write_csv(folder / name, columns)
    described = [f'file = "{name}"\n{line}' for name, line in zip(runs, lines or [""] * len(runs), strict=True)]
    (folder / "dataset.toml").write_text(toml(*described, head=head, tail=tail), "utf-8")
    return folder
