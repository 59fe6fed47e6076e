"""Recordings for tests: small ones in every accepted form, and one for each thing that must be refused."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from gyrotc.quality import Change, judge
from gyrotc.recordings import load
from numpy.typing import NDArray

Columns = dict[str, NDArray[np.float64]]
ROWS = 120
PERIOD_S = 10.0


def columns(n: int = ROWS, *, seed: int = 1) -> Columns:
    """Time, temperature and rate of a plain ramp up and down."""
    rng = np.random.default_rng(seed)
    phase = np.arange(n) / n
    temperature = 20.0 + 30.0 * (1.0 - np.abs(2.0 * phase - 1.0))
    return {
        "time_s": PERIOD_S * np.arange(n),
        "temperature_c": np.round(temperature + rng.normal(0.0, 0.01, n), 4),
        "rate_dph": np.round(20.0 + 0.0001 * temperature + rng.normal(0.0, 0.001, n), 6),
    }


def columns_of_pulses() -> Columns:
    """Whole counts instead of a rate."""
    table = columns()
    return {k: v for k, v in table.items() if k != "rate_dph"} | {"pulses": np.round(10 * table["rate_dph"])}


def csv_text(table: Mapping[str, NDArray[np.float64]], form: str = "{!r}") -> str:
    """CSV with a header, every number in the given form."""
    lines = [",".join(table)]
    lines += [",".join(form.format(float(v)) for v in row) for row in zip(*table.values(), strict=True)]
    return "\n".join(lines) + "\n"


def write_csv(path: Path, table: Mapping[str, NDArray[np.float64]] | None = None) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(csv_text(columns() if table is None else table), "utf-8")


def write_parquet(path: Path, table: Mapping[str, NDArray[np.float64]] | None = None) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.table(dict(columns() if table is None else table)), path, row_group_size=50)


def toml(*runs: str, head: str = 'schema = 1\nserial = "RLG-0042"\nearth_rate = "removed"', tail: str = "") -> str:
    """A description; each run is the lines of one [[run]]."""
    return "\n".join([head, *(f"[[run]]\n{run}" for run in runs), tail, ""])


def changes_in(folder: Path, *runs: Mapping[str, NDArray[np.float64]]) -> list[Change]:
    """The changes that the judgement of some runs finds, by run in order of time; `run` numbers them as given."""
    for k, columns_of_run in enumerate(runs):
        write_csv(folder / f"{k}.csv", columns_of_run)
    text = toml(*(f'file = "{k}.csv"\npower_on_s = "unknown"' for k in range(len(runs))))
    (folder / "dataset.toml").write_text(text, "utf-8")
    return [change for judgement in judge(load(folder)).runs for change in judgement.changes]


def described(folder: Path, *runs: str, **parts: str) -> None:
    """A folder with `run-01.csv` and a description (default: that run alone)."""
    write_csv(folder / "run-01.csv")
    (folder / "dataset.toml").write_text(toml(*(runs or ('file = "run-01.csv"',)), **parts), "utf-8")


def state(folder: Path, line: str) -> Path:
    """Put a line at the head of a description, which is made where there is none; returns the folder."""
    path = folder / "dataset.toml"
    if not path.exists():
        files = sorted(file.name for file in folder.iterdir())
        head = f'schema = 1\nserial = "{folder.name}"'
        path.write_text(toml(*(f'file = "{name}"\npower_on_s = "unknown"' for name in files), head=head), "utf-8")
    path.write_text(path.read_text("utf-8").replace("schema = 1\n", f"schema = 1\n{line}\n", 1), "utf-8")
    return folder


def state_fit(folder: Path, **options: object) -> Path:
    """State `[fit]` in a description, in place of an earlier one at its end; returns the folder."""
    path = folder / "dataset.toml"
    text = path.read_text("utf-8").partition("\n[fit]\n")[0].rstrip("\n")
    lines = (f"{name} = {json.dumps(value)}" for name, value in options.items())
    path.write_text("\n".join([text, "", "[fit]", *lines, ""]), "utf-8")
    return folder


def with_text(change: Callable[[list[str]], Sequence[str]]) -> Callable[[Path], None]:
    """Makes `RLG-1/a.csv` with its lines changed (lines[0] is the header)."""

    def make(folder: Path) -> None:
        folder.mkdir()
        lines = csv_text(columns()).splitlines()
        (folder / "a.csv").write_text("\n".join(change(lines)) + "\n", "utf-8")

    return make


def with_bytes(change: Callable[[bytes], bytes], name: str = "a.csv") -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        folder.mkdir()
        (folder / name).write_bytes(change(csv_text(columns()).encode()))

    return make


def with_columns(change: Callable[[Columns], Mapping[str, NDArray[np.float64]]]) -> Callable[[Path], None]:
    return lambda folder: write_csv(folder / "a.csv", change(columns()))


def description(*runs: str, **parts: str) -> Callable[[Path], None]:
    return lambda folder: described(folder, *runs, **parts)


RUN = 'file = "run-01.csv"'
HEAD = 'schema = 1\nserial = "RLG-0042"'


def _bom(folder: Path) -> None:
    write_csv(folder / "a.csv")
    data = (folder / "a.csv").read_bytes()
    (folder / "a.csv").write_bytes(b"\xef\xbb\xbf" + data.replace(b"\n", b"\r\n"))


def _unfinished(folder: Path) -> None:
    write_csv(folder / "a.csv")
    with (folder / "a.csv").open("a") as file:
        file.write("1200.0,20.0")


ACCEPTED: dict[str, Callable[[Path], object]] = {
    "no dataset.toml": lambda folder: write_csv(folder / "a.csv"),
    "dataset.toml": description(),
    "byte order mark, CRLF": _bom,
    "spaces and quotes": with_text(lambda lines: [", ".join(f'"{c}"' for c in t.split(",")) for t in lines]),
    "any column order": with_columns(lambda c: dict(reversed(c.items()))),
    "further numeric columns": with_columns(lambda c: c | {"supply_v": np.linspace(5.0, 5.1, ROWS)}),
    "scientific notation": lambda folder: (
        folder.mkdir(),
        (folder / "a.csv").write_text(csv_text(columns(), "{:+.9E}")),
    ),
    "no final newline": with_bytes(lambda data: data.rstrip(b"\n")),
    "empty lines": with_text(lambda lines: [*lines[:9], "", *lines[9:], ""]),
    "one constant temperature": with_columns(lambda c: c | {"temperature_c": np.full(ROWS, 25.0)}),
    "whole numbers": with_text(lambda lines: [lines[0], *(f"{k},{20 + k // 9},{k % 7}" for k in range(ROWS))]),
    "time that starts late": with_columns(lambda c: c | {"time_s": c["time_s"] + 86400.0}),
    "time before zero": with_columns(lambda c: c | {"time_s": c["time_s"] - 3600.0}),
    "uneven rows": with_columns(lambda c: c | {"time_s": c["time_s"] + np.r_[np.zeros(60), np.full(60, 77.0)]}),
    "Parquet": lambda folder: write_parquet(folder / "a.parquet"),
    "unfinished last line": _unfinished,
    "several runs": description(
        RUN + '\nto_s = 600.0\nenvironment = "ramp up"\nstarted = 2026-03-01T08:00:00Z\npower_on_s = -3600.0',
        RUN + '\nfrom_s = 600.0\nrole = "exam"\nstarted = "2026-03-01T09:30:00+01:00"\npower_on_s = "unknown"'
        '\nexclude = [{from_s = 700.0, to_s = 720.0, reason = "door opened"}]',
        head=HEAD + '\ndescription = "two spans"\nearth_rate = "none"\napplied_table = "none"',
        tail='[meta]\noperator = "A. B."\ncalibrated_on = 2026-03-01\n[noise]\narw_deg_per_sqrt_h = 0.0001',
    ),
    "named columns": lambda folder: (
        write_csv(folder / "a.csv", dict(zip(("t", "T", "w"), columns().values(), strict=True))),
        (folder / "dataset.toml").write_text(
            toml('file = "a.csv"', tail='[columns]\ntime = "t"\ntemperature = "T"\nrate = "w"')
        ),
    ),
    "pulses": lambda folder: (
        write_csv(
            folder / "a.csv",
            columns_of_pulses(),
        ),
        (folder / "dataset.toml").write_text(toml('file = "a.csv"', head=HEAD + "\npulse_weight_arcsec = 1.0")),
    ),
    "computed earth rate": description(
        RUN + "\naxis_azimuth_deg = 90.0\naxis_elevation_deg = 0",
        head=HEAD + '\nearth_rate = "compute"\nlatitude_deg = 48.1',
    ),
    "a channel that not every run has": lambda folder: (
        write_csv(folder / "a.csv", columns() | {"supply_v": np.linspace(5.0, 5.1, ROWS)}),
        write_csv(folder / "b.csv", columns(seed=2)),
    ),
}
