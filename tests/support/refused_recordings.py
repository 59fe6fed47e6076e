"""Recordings and descriptions that are refused, and edits that mend them; also read by `make bench ONLY=oracle`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from recordings import (
    HEAD,
    ROWS,
    RUN,
    columns,
    columns_of_pulses,
    described,
    description,
    toml,
    with_bytes,
    with_columns,
    with_text,
    write_csv,
    write_parquet,
)


@dataclass(frozen=True)
class Refused:
    """How to make a folder that is refused, and what the message must hold: file, line or field, what is expected."""

    make: Callable[[Path], object]
    message: tuple[str, ...]
    folder: str = "RLG-1"


def line(number: int, text: str) -> Callable[[Path], None]:
    """Line `number` (the header is line 1) replaced."""
    return with_text(lambda lines: [*lines[: number - 1], text, *lines[number:]])


def parquet(table: Callable[[], pa.Table]) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        folder.mkdir()
        pq.write_table(table(), folder / "a.parquet", row_group_size=50)

    return make


def _damaged_parquet(folder: Path) -> None:
    write_parquet(folder / "a.parquet")
    data = bytearray((folder / "a.parquet").read_bytes())
    data[200:600] = bytes(400)
    (folder / "a.parquet").write_bytes(data)


def _with_nan(values: NDArray[np.float64], at: int, value: float) -> NDArray[np.float64]:
    changed = values.copy()
    changed[at] = value
    return changed


def _cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def _only_toml(folder: Path, text: str) -> None:
    folder.mkdir()
    (folder / "dataset.toml").write_text(text, "utf-8")


REFUSED: dict[str, Refused] = {
    "missing folder": Refused(lambda folder: None, ("does not exist", "a folder of recordings")),
    "folder is a file": Refused(lambda folder: folder.write_text("x"), ("is no folder",)),
    "empty folder": Refused(lambda folder: folder.mkdir(), ("no recordings", "*.csv or *.parquet")),
    "folder name no serial": Refused(
        lambda folder: write_csv(folder / "a.csv"), ("'my gyro!'", "dataset.toml"), "my gyro!"
    ),
    # files
    "empty file": Refused(with_bytes(lambda data: b""), ("a.csv", "is empty")),
    "header only": Refused(with_text(lambda lines: lines[:1]), ("a.csv", "0 rows", "at least 10")),
    "too few rows": Refused(with_text(lambda lines: lines[:5]), ("a.csv", "4 rows", "at least 10")),
    "no header": Refused(with_text(lambda lines: lines[1:]), ("a.csv, line 1", "no header")),
    "binary": Refused(with_bytes(lambda data: bytes(range(256)) * 40), ("a.csv", "binary")),
    "UTF-16": Refused(with_bytes(lambda data: data.decode().encode("utf-16")), ("a.csv", "UTF-16", "UTF-8")),
    "no UTF-8": Refused(
        with_bytes(lambda data: data.replace(b"temperature_c", b"temperature_\xb0c")),
        ("a.csv, line 1", "UTF-8"),
    ),
    "missing column": Refused(
        with_columns(lambda c: {k: v for k, v in c.items() if k != "temperature_c"}),
        ("a.csv, line 1", "no column temperature_c among time_s, rate_dph"),
    ),
    "missing rate": Refused(
        with_columns(lambda c: {k: v for k, v in c.items() if k != "rate_dph"}),
        ("a.csv, line 1", "no column rate_dph", "pulses", "rate_x_dph"),
    ),
    "duplicate column": Refused(
        with_text(lambda lines: [f"{text},{text.split(',')[1]}" for text in lines]),
        ("a.csv, line 1, column temperature_c", "2 times"),
    ),
    "column without name": Refused(
        with_text(lambda lines: [lines[0] + ",", *(text + ",1" for text in lines[1:])]),
        ("a.csv, line 1, column 4", "no name"),
    ),
    "text column": Refused(
        with_text(lambda lines: [lines[0] + ",note", *(text + ",ok" for text in lines[1:])]),
        ("a.csv, line 2, column note", "'ok' (and 119 more lines)", "a number"),
    ),
    "text cell": Refused(line(7, "50.0,20.1,abc"), ("a.csv, line 7, column rate_dph", "'abc'", "number")),
    "NaN time": Refused(line(7, "nan,20.1,20.0"), ("a.csv, line 7, column time_s", "nan", "finite")),
    "infinite cell": Refused(line(7, "50.0,20.1,-inf"), ("a.csv, line 7, column rate_dph", "inf", "finite")),
    "overflowing cell": Refused(line(7, "50.0,20.1,1e400"), ("a.csv, line 7, column rate_dph", "finite")),
    "empty cell": Refused(line(7, "50.0,,20.0"), ("a.csv, line 7, column temperature_c", "an empty cell")),
    "short row": Refused(line(7, "50.0,20.1"), ("a.csv, line 7", "2 cells", "3 as in the header")),
    "long row": Refused(line(7, "50.0,20.1,20.0,1"), ("a.csv, line 7", "4 cells", "3 as in the header")),
    "NUL byte": Refused(line(7, "50.0,20.1,20\x00.0"), ("a.csv, line 7", "NUL byte")),
    "repeated time": Refused(
        line(7, "40.0,20.1,20.0"), ("a.csv, line 7, column time_s", "repeated: 40 s after 40 s", "increase")
    ),
    "backward time": Refused(
        line(7, "30.0,20.1,20.0"), ("a.csv, line 7, column time_s", "going back: 30 s after 40 s", "increase")
    ),
    "kelvin": Refused(
        with_columns(lambda c: c | {"temperature_c": c["temperature_c"] + 273.15}),
        ("a.csv, line 2, column temperature_c", "(and 119 more lines)", "-90 ... 200 C", "kelvin?"),
    ),
    "too cold": Refused(line(7, "50.0,-95,20.0"), ("a.csv, line 7, column temperature_c", "-95", "-90")),
    "implausible rate": Refused(line(7, "50.0,20.1,8e6"), ("a.csv, line 7, column rate_dph", "8000000", "7.5e+06")),
    "semicolons": Refused(
        with_text(lambda lines: [text.replace(",", ";").replace(".", ",") for text in lines]),
        ("a.csv, line 1", "semicolons", "commas", "points"),
    ),
    "tabs": Refused(with_text(lambda lines: [text.replace(",", "\t") for text in lines]), ("a.csv", "tabs")),
    "decimal commas": Refused(
        with_text(lambda lines: [lines[0], *(text.replace(".", ",") for text in lines[1:])]),
        ("a.csv, line 2", "6 cells", "3 as in the header"),
    ),
    "rate and pulses": Refused(
        with_columns(lambda c: c | {"pulses": np.ones(ROWS)}), ("a.csv, line 1", "both rate_dph and pulses")
    ),
    "rate and axes": Refused(
        with_columns(lambda c: c | {"rate_x_dph": np.ones(ROWS)}), ("both rate_dph and rate_x_dph",)
    ),
    "pulses without weight": Refused(
        with_columns(lambda c: columns_of_pulses()),
        ("a.csv, column pulses", "no weight", "pulse_weight_arcsec"),
    ),
    "half pulses": Refused(
        lambda folder: (
            write_csv(folder / "a.csv", columns_of_pulses() | {"pulses": np.full(ROWS, 0.5)}),
            (folder / "dataset.toml").write_text(toml('file = "a.csv"', head=HEAD + "\npulse_weight_arcsec = 1.0")),
        ),
        ("a.csv, line 2, column pulses", "0.5 (and 119 more lines)", "whole counts"),
    ),
    "pulses too heavy": Refused(
        lambda folder: (
            write_csv(folder / "a.csv", columns_of_pulses()),
            (folder / "dataset.toml").write_text(toml('file = "a.csv"', head=HEAD + "\npulse_weight_arcsec = 1e6")),
        ),
        ("a.csv, line 3, column pulses", "-7.5e+06 ... 7.5e+06 deg/h"),
    ),
    # Parquet
    "no Parquet": Refused(with_bytes(lambda data: data, "a.parquet"), ("a.parquet", "Parquet")),
    "short Parquet": Refused(
        lambda folder: (write_parquet(folder / "a.parquet"), _cut(folder / "a.parquet")),
        ("a.parquet", "Parquet"),
    ),
    "damaged Parquet": Refused(_damaged_parquet, ("a.parquet", "damaged")),
    "text in Parquet": Refused(
        parquet(lambda: pa.table(columns() | {"note": ["ok"] * ROWS})), ("a.parquet, column note", "string")
    ),
    "NaN time in Parquet": Refused(
        parquet(lambda: pa.table(columns() | {"time_s": _with_nan(columns()["time_s"], 60, np.nan)})),
        ("a.parquet, row 61, column time_s", "nan", "finite"),
    ),
    "nothing but NaN": Refused(
        parquet(lambda: pa.table(columns() | {"rate_dph": np.full(ROWS, np.nan)})),
        ("a.parquet", "0 rows with a temperature and a rate", "at least 10"),
    ),
    # dataset.toml
    "broken TOML": Refused(description(head='schema = 1\nserial = "RLG'), ("dataset.toml", "no TOML", "line 2")),
    "missing schema": Refused(description(head='serial = "A"'), ("dataset.toml, field schema", "missing")),
    "unknown schema": Refused(description(head='schema = 2\nserial = "A"'), ("dataset.toml, field schema", "2", "1")),
    "missing serial": Refused(description(head="schema = 1"), ("dataset.toml, field serial", "missing")),
    "serial as path": Refused(
        description(head='schema = 1\nserial = "../RLG"'), ("dataset.toml, field serial", "'../RLG'")
    ),
    "serial of dots": Refused(description(head='schema = 1\nserial = ".."'), ("field serial", "'..'")),
    "serial as code": Refused(
        description(head='schema = 1\nserial = "*/ x; /*"'), ("dataset.toml, field serial", "'*/ x; /*'")
    ),
    "serial too long": Refused(
        description(head=f'schema = 1\nserial = "{"R" * 65}"'), ("dataset.toml, field serial", "1 to 64")
    ),
    "serial no text": Refused(description(head="schema = 1\nserial = 42"), ("field serial", "42", "a text")),
    "unknown key": Refused(description(head=HEAD + "\nserail = 1"), ("dataset.toml, field serail", "not known")),
    "unknown key of a run": Refused(
        description(RUN + '\nrol = "train"'), ("dataset.toml, run 1 (run-01.csv), field rol", "not known")
    ),
    "unknown role": Refused(
        description(RUN + '\nrole = "test"'),
        ("dataset.toml, run 1 (run-01.csv), field role", "'test'", "'train' or 'exam'"),
    ),
    "unknown earth rate": Refused(
        description(head=HEAD + '\nearth_rate = "yes"'),
        ("field earth_rate", "'yes'", "'removed'", "'compute'"),
    ),
    "no runs": Refused(lambda folder: _only_toml(folder, HEAD), ("dataset.toml, field run", "missing")),
    "empty list of runs": Refused(
        lambda folder: _only_toml(folder, HEAD + "\nrun = []"),
        ("dataset.toml, field run", "is empty", "at least one [[run]]"),
    ),
    "no training run": Refused(description(RUN + '\nrole = "exam"'), ("dataset.toml", "no run has the role train")),
    "file missing": Refused(description('file = "run-02.csv"'), ("run-02.csv", "does not exist")),
    "file is a folder": Refused(
        lambda folder: (described(folder, 'file = "b.csv"'), (folder / "b.csv").mkdir()),
        ("b.csv", "is a folder"),
    ),
    "file outside": Refused(
        description('file = "../run-01.csv"'),
        ("dataset.toml, run 1 (../run-01.csv), field file", "inside the folder"),
    ),
    "absolute file": Refused(description('file = "/tmp/run-01.csv"'), ("field file", "inside the folder")),
    "unknown kind of file": Refused(description('file = "run-01.xls"'), (".csv or .parquet",)),
    "same file twice": Refused(description(RUN, RUN), ("dataset.toml, run 2 (run-01.csv)", "overlaps that of run 1")),
    "same file in two spellings": Refused(
        description(RUN, 'file = "./run-01.csv"'),
        ("dataset.toml, run 2 (run-01.csv)", "overlaps that of run 1"),
    ),
    "same span twice": Refused(
        description(*[RUN + "\nfrom_s = 0.0\nto_s = 500.0"] * 2), ("run 2 (run-01.csv)", "overlaps")
    ),
    "overlapping spans": Refused(
        description(RUN + "\nto_s = 500.0", RUN + "\nfrom_s = 499.0"), ("run 2 (run-01.csv)", "overlaps")
    ),
    "span the wrong way": Refused(
        description(RUN + "\nfrom_s = 500.0\nto_s = 400.0"),
        ("field from_s", "500 s", "less than to_s, 400 s"),
    ),
    "span without rows": Refused(
        description(RUN + "\nfrom_s = 5000.0"), ("run 1 (run-01.csv)", "a span without rows", "0 ... 1190 s")
    ),
    "all excluded": Refused(
        description(RUN + '\nexclude = [{from_s = -1.0, to_s = 2e3, reason = "all"}]'),
        ("a span without rows",),
    ),
    "exclusion the wrong way": Refused(
        description(RUN + '\nexclude = [{from_s = 9.0, to_s = 2.0, reason = "x"}]'),
        ("field exclude.0.from_s",),
    ),
    "exclusion without end": Refused(
        description(RUN + "\nexclude = [{from_s = 9.0}]"), ("field exclude.0.to_s", "missing")
    ),
    "started no date": Refused(
        description(RUN + '\nstarted = "yesterday"'), ("field started", "'yesterday'", "2026-03-01T08:00:00Z")
    ),
    "started in the future": Refused(
        description(RUN + "\nstarted = 2096-03-01T08:00:00Z"), ("field started", "2096", "not after today")
    ),
    "power-on no time": Refused(
        description(RUN + '\npower_on_s = "often"'), ("field power_on_s", "'often'", 'seconds or "unknown"')
    ),
    "infinite span": Refused(description(RUN + "\nto_s = inf"), ("field to_s", "inf", "finite")),
    "column named wrong": Refused(
        description(head=HEAD, tail='[columns]\nrate = "omega"'), ("run-01.csv", "no column omega", "omega")
    ),
    "negative noise": Refused(
        description(head=HEAD, tail="[noise]\narw_deg_per_sqrt_h = -1.0"), ("field noise.arw_deg_per_sqrt_h",)
    ),
    "pulse weight zero": Refused(description(head=HEAD + "\npulse_weight_arcsec = 0.0"), ("pulse_weight_arcsec",)),
    "temperature late by days": Refused(
        description(head=HEAD + "\ntemperature_late_s = 86400.0"), ("temperature_late_s", "3600")
    ),
    "compute without latitude": Refused(
        description(RUN + "\naxis_azimuth_deg = 0.0\naxis_elevation_deg = 0.0", head=HEAD + '\nearth_rate = "compute"'),
        ("field latitude_deg", "missing"),
    ),
    "compute without axis": Refused(
        description(head=HEAD + '\nearth_rate = "compute"\nlatitude_deg = 48.0'),
        ("run 1 (run-01.csv), field axis_azimuth_deg", "missing"),
    ),
    "applied without model": Refused(
        description(head=HEAD + f'\napplied_table = "{"a" * 64}"'), ("field applied_table", 'applied_model = "FILE"')
    ),
    "applied no hash": Refused(description(head=HEAD + '\napplied_table = "yes"'), ("field applied_table",)),
}

# An edit of dataset.toml for which the message asks: text and what takes its place; all of the file if the text is "".
EDITS: dict[str, tuple[str, str]] = {
    "folder name no serial": ("", toml('file = "a.csv"')),
    "kelvin": ("", toml('file = "a.csv"', tail='[units]\ntemperature = "K"')),
    "pulses without weight": ("", toml('file = "a.csv"', head=HEAD + "\npulse_weight_arcsec = 1.0")),
    "pulses too heavy": ("1e6", "1.0"),
    "missing schema": ("serial", "schema = 1\nserial"),
    "unknown schema": ("schema = 2", "schema = 1"),
    "missing serial": ("schema = 1", "schema = 1\nserial = 'RLG-1'"),
    "serial as path": ("../RLG", "RLG"),
    "serial no text": ("42", '"42"'),
    "unknown key": ("serail = 1\n", ""),
    "unknown role": ('"test"', '"train"'),
    "unknown earth rate": ('"yes"', '"removed"'),
    "no training run": ('"exam"', '"train"'),
    "file missing": ("run-02", "run-01"),
    "file outside": ("../run-01", "run-01"),
    "overlapping spans": ("from_s = 499.0", "from_s = 500.0"),
    "span the wrong way": ("to_s = 400.0", "to_s = 600.0"),
    "span without rows": ("from_s = 5000.0", "from_s = 0.0"),
    "exclusion without end": ("from_s = 9.0}", "from_s = 9.0, to_s = 20.0, reason = 'door'}"),
    "started no date": ("yesterday", "2026-03-01T08:00:00Z"),
    "started in the future": ("2096", "2026"),
    "power-on no time": ("often", "unknown"),
    "column named wrong": ("omega", "rate_dph"),
    "pulse weight zero": ("pulse_weight_arcsec = 0.0\n", ""),
    "compute without latitude": ("serial", "latitude_deg = 48.0\nserial"),
    "compute without axis": (RUN, RUN + "\naxis_azimuth_deg = 90.0\naxis_elevation_deg = 0.0"),
}
