"""Every refusal names a place and what goes on, and what it names is applied here: the command then succeeds."""

from __future__ import annotations

import gzip
import re
import shlex
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta, timezone
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pyarrow.parquet as pq
import pytest
from conftest import Command
from gyrotc.results import ImportedFiles, read_result

ROWS = 300
TIME = 10.0 * np.arange(ROWS)
TEMPERATURE = 20.0 + 30.0 * np.abs(np.sin(np.arange(ROWS) / 200.0))
RATE = 10.0 + 0.01 * np.random.default_rng(1).standard_normal(ROWS)
NAMES = "time_s,temperature_c,rate_dph"
WHEN = "when,temperature_c,rate_dph"
START = datetime(2026, 3, 1, 8, tzinfo=timezone.utc)


def table(names: str, *columns: Sequence[object]) -> bytes:
    rows = [",".join(str(cell) for cell in row) for row in zip(*columns, strict=True)]
    return ("\n".join([names, *rows]) + "\n").encode()


def fixed(values: Sequence[float]) -> list[str]:
    return [f"{value:.4f}" for value in values]


def berlin(start: datetime) -> list[str]:
    """A stamp each minute as a clock on a wall in Berlin shows it."""
    moments = [start.replace(tzinfo=timezone.utc) + timedelta(minutes=k) for k in range(ROWS)]
    return [moment.astimezone(ZoneInfo("Europe/Berlin")).strftime("%Y-%m-%d %H:%M:%S") for moment in moments]


def stamps(form: str) -> list[str]:
    return [(START + timedelta(seconds=10 * k)).strftime(form) for k in range(ROWS)]


T, R = fixed(TEMPERATURE), fixed(RATE)
PLAIN = table(NAMES, fixed(TIME), T, R)
TWICE = [cell for cell in T for _ in range(2)], fixed([rate + 5.0 * k for rate in RATE for k in range(2)])
IDS = [1, 2] * ROWS


def late() -> list[int]:
    """A 16-bit counter of milliseconds, with the last row before its end one place late."""
    ticks = [(60_000 + 1_000 * k) % 65_536 for k in range(ROWS)]
    ticks[5], ticks[6] = ticks[6], ticks[5]
    return ticks


def with_reading(cell: str, k: int = 7) -> bytes:
    return table(NAMES, fixed(TIME), [*T[:k], cell, *T[k + 1 :]], R)


@dataclass(frozen=True)
class Remedy:
    """Files, of which the first is imported; the refusal; the remedy that it names, and the rows that then come in.

    An empty remedy stands for the commands between backquotes, which make the files that are imported then.
    """

    files: Mapping[str, bytes]
    refused: str
    remedy: str
    options: str = ""
    rows: tuple[int, ...] = (ROWS,)


CASES = {
    "sensors with equal times": Remedy(
        {"a.csv": table(f"id,{NAMES}", IDS, np.repeat(TIME, 2), *TWICE)},
        "a.csv, line 3: column id names several devices: '1', '2'",
        "--set where='id == 1'",
    ),
    "sensors with near times": Remedy(
        {"a.csv": table(f"id,{NAMES}", IDS, np.repeat(TIME, 2) + [0.0, 0.5] * ROWS, *TWICE)},
        "a.csv, line 3: column id names several devices",
        "--set where='id == 1'",
    ),
    "sensors told apart by a column of another name": Remedy(
        {"a.csv": table(f"position,{NAMES}", IDS, np.repeat(TIME, 2), *TWICE)},
        "a.csv, line 3: the time of the row before, 0 (0 s), with other values",
        "--set where='position == 1'",
    ),
    "one of two devices after the other": Remedy(
        {"a.csv": table(f"serial,{NAMES}", ["A"] * 100 + ["B"] * 200, fixed(TIME), T, R)},
        "a.csv, line 102: column serial names several devices: 'A', 'B'",
        "--set where='serial == A'",
        rows=(100,),
    ),
    "a column that names no devices": Remedy(
        {"a.csv": table(f"sensor,{NAMES}", ["cold"] * 100 + ["hot"] * 200, fixed(TIME), T, R)},
        "a.csv, line 102: column sensor names several devices",
        "--column device=none",
    ),
    "several rows of one time": Remedy(
        {"a.csv": table(NAMES, [f"{10 * (k // 2)}" for k in range(ROWS)], T, R)},
        "a.csv, line 3: the time of the row before",
        "--set time.leave_out_late=true",
        rows=(ROWS // 2,),
    ),
    "a late sample at the end of a counter": Remedy(
        {"a.csv": table("ticks,temperature_c,rate_dph", late(), T, R)},
        "a.csv, line 8: time goes back: 65000 (65 s) after 464 (66 s)",
        "--set time.leave_out_late=true",
        "--time-unit ms",
        rows=(ROWS - 1,),
    ),
    "the clock starts again": Remedy(
        {"a.csv": table(NAMES, fixed([*TIME[:100], *TIME[:200]]), T, R)},
        "a.csv, line 102: time goes back: 0 (0 s) after 990 (990 s)",
        "",
        rows=(100, 200),
    ),
    "the clock starts again in a packed file": Remedy(
        {"a.csv.gz": gzip.compress(table(NAMES, fixed([*TIME[:100], *TIME[:200]]), T, R))},
        "a.csv.gz, line 102: time goes back",
        "",
        rows=(100, 200),
    ),
    "the newest row first": Remedy(
        {"a.csv": table(NAMES, fixed(TIME[::-1]), T, R)}, "a.csv, line 3: time goes back", "", rows=(ROWS,)
    ),
    "summer time ends": Remedy(
        {"a.csv": table(WHEN, berlin(datetime(2026, 10, 24, 23, 30)), T, R)},
        "a.csv, line 92: time goes back: 2026-10-25 02:00:00 (1800 s)",
        "--set time.zone=Europe/Berlin",
    ),
    "summer time begins": Remedy(
        {"a.csv": table(WHEN, berlin(datetime(2026, 3, 28, 23, 30)), T, R)},
        "a.csv, line 92: 3660 s after the row before: an hour is skipped",
        "--set time.zone=Europe/Berlin",
    ),
    "stamps of digits alone": Remedy(
        {"a.csv": table(NAMES.replace("time_s", "time"), stamps("%Y%m%d%H%M%S"), T, R)},
        "a.csv: no unit of the time in column 'time'",
        '--set time.format="%Y%m%d%H%M%S"',
    ),
    "a number that is no reading": Remedy(
        {"a.csv": with_reading("-127.0000")},
        "a.csv, line 9, column temperature_c: -127 (read as degC)",
        "--set csv.missing=-127",
        rows=(ROWS - 1,),
    ),
    "one reading that would be plausible in Fahrenheit": Remedy(
        {"a.csv": with_reading("251.0")},
        "a.csv, line 9, column temperature_c: 251 (read as degC)",
        "--set csv.missing=251",
        rows=(ROWS - 1,),
    ),
    "NUL bytes between the rows": Remedy(
        {"a.csv": PLAIN[:2000] + 7 * b"\0" + PLAIN[2000:]}, "7 NUL bytes from there on", "", rows=(ROWS,)
    ),
    "packed twice": Remedy({"a.csv.gz": gzip.compress(gzip.compress(PLAIN))}, "a.csv.gz: is packed twice", ""),
    "a register without an offset": Remedy(
        {"a.csv": table("time_s,temp,rate_dph", fixed(TIME), [round(340 * (t - 36.53)) for t in TEMPERATURE], R)},
        "'degC/340' scales counts and states no offset",
        "--temperature-unit 'raw/340 + 36.53 degC'",
        "--temperature-unit degC/340",
    ),
    "no temperature": Remedy(
        {
            "a.csv": table("when,rate_dph", stamps("%Y-%m-%dT%H:%M:%SZ"), R),
            "chamber.csv": table("when,temperature_c", stamps("%Y-%m-%dT%H:%M:%SZ"), T),
        },
        "a.csv: no column that gives a temperature among when, rate_dph",
        "--join FILE --tolerance-s S",
    ),
}  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in which commands are given."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


VALUES = {"FILE": "chamber.csv", "S": "10"}


def imported(gyrotc: Command, folder: Path, file: str, options: Sequence[str]) -> int:
    out, result = folder / f"{file}-out", folder / f"{file}.json"
    done = gyrotc("import", folder / file, "--out", out, "--serial", "R", "--json", result, *options)
    assert done.returncode == 0, done.stderr
    (run,) = read_result(result, ImportedFiles).runs
    assert run.read == run.rows + sum(run.left_out.values())
    return run.rows


@pytest.mark.parametrize("name", CASES)
def test_what_a_refusal_names_goes_on(name: str, folder: Path, gyrotc: Command) -> None:
    case = CASES[name]
    for file, content in case.files.items():
        (folder / file).write_bytes(content)
    first = next(iter(case.files))
    options = shlex.split(case.options)
    done = gyrotc("import", folder / first, "--out", folder / "R", *options)
    assert done.returncode == 2
    assert case.refused in done.stderr
    plain = re.sub("[\"']", "", done.stderr)
    assert all(word.replace('"', "") in plain for word in shlex.split(case.remedy))
    files = [first]
    if case.remedy:
        stated = shlex.split(case.remedy)
        kept = [] if stated[0] in options and stated[0] != "--set" else options
        options = [*kept, *(VALUES.get(word, word) for word in stated)]
    else:
        before = set(folder.iterdir())
        for command in re.findall(r"`([^`]+)`", done.stderr):
            subprocess.run(["sh", "-c", command], cwd=folder, check=True)
        unpacked = {folder / first.removesuffix(".gz")} if f"gunzip -k {first}" in done.stderr else set()
        files = sorted(path.name for path in set(folder.iterdir()) - before - unpacked)
    assert tuple(imported(gyrotc, folder, file, options) for file in files) == case.rows


def test_temperatures_come_from_the_time_of_their_rows(tmp_path: Path, gyrotc: Command) -> None:
    """Waveforms of TDMS that start 300 s apart: each rate has the temperature that was read 300 s later."""
    nptdms = pytest.importorskip("nptdms")
    begin = np.datetime64("2026-03-01T08:00:00")
    facts = {"wf_increment": 10.0, "wf_start_time": begin, "unit_string": "deg/h"}
    warm = {"wf_increment": 10.0, "wf_start_time": begin - np.timedelta64(300, "s"), "unit_string": "degC"}
    with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        writer.write_segment(
            [
                nptdms.ChannelObject("g", "rate", RATE, facts),
                nptdms.ChannelObject("g", "temperature", TEMPERATURE, warm),
            ]
        )
    assert imported(gyrotc, tmp_path, "a.tdms", ()) == ROWS
    found = pq.read_table(tmp_path / "a.tdms-out" / "a.parquet")["temperature_c"].to_numpy()
    assert np.array_equal(found[: ROWS - 30], TEMPERATURE[30:])


def test_a_sparse_temperature_can_be_held(tmp_path: Path, gyrotc: Command) -> None:
    (tmp_path / "a.csv").write_bytes(table(NAMES, fixed(TIME), [t if k % 10 == 0 else "" for k, t in enumerate(T)], R))
    assert imported(gyrotc, tmp_path, "a.csv", ()) == ROWS // 10
    assert "--set hold=true" in (tmp_path / "a.csv.json").read_text()
    assert imported(gyrotc, tmp_path, "a.csv", ["--set", "hold=true"]) == ROWS
    found = pq.read_table(tmp_path / "a.csv-out" / "a.parquet")["temperature_c"].to_numpy()
    assert np.array_equal(found, np.repeat(np.array(T[::10], dtype=float), 10))


def test_a_joined_reading_holds_for_the_stated_time(folder: Path, gyrotc: Command) -> None:
    """The chamber's clock stops for ten minutes: rows without a reading of the last 30 s are left out."""
    (folder / "a.csv").write_bytes(table("when,rate_dph", stamps("%Y-%m-%dT%H:%M:%SZ"), R))
    kept = [k for k in range(ROWS) if not 100 <= k < 160]
    when = stamps("%Y-%m-%dT%H:%M:%SZ")
    (folder / "chamber.csv").write_bytes(table("when,temperature_c", [when[k] for k in kept], [T[k] for k in kept]))
    assert imported(gyrotc, folder, "a.csv", ["--join", "chamber.csv", "--tolerance-s", "30"]) == ROWS - 57
    text = (folder / "a.csv-out" / "map.toml").read_text()
    assert '[[join]]\nfile = "chamber.csv"\ntolerance_s = 30.0' in text
    (run,) = read_result(folder / "a.csv.json", ImportedFiles).runs
    assert [run.source.file, *(one.file for one in run.joined)] == ["a.csv", "chamber.csv"]


def test_clocks_that_cannot_be_compared_are_refused(tmp_path: Path, gyrotc: Command) -> None:
    (tmp_path / "a.csv").write_bytes(table("when,rate_dph", stamps("%Y-%m-%dT%H:%M:%SZ"), R))
    (tmp_path / "chamber.csv").write_bytes(table("time_s,temperature_c", fixed(TIME), T))
    joined = ("--join", tmp_path / "chamber.csv", "--tolerance-s", "30")
    done = gyrotc("import", tmp_path / "a.csv", "--out", tmp_path / "R", *joined)
    assert done.returncode == 2
    assert "chamber.csv: has a counter of time, and the rates have stamps of a known zone" in done.stderr


def test_the_serial_is_that_of_the_device(tmp_path: Path, gyrotc: Command) -> None:
    for name in ("a", "b"):
        (tmp_path / f"{name}.csv").write_bytes(table(f"serial,{NAMES}", [f"G-{name}"] * ROWS, fixed(TIME), T, R))
    assert gyrotc("import", tmp_path / "a.csv", "--out", tmp_path / "R").returncode == 0
    assert 'serial = "G-a"' in (tmp_path / "R" / "dataset.toml").read_text()
    done = gyrotc("import", tmp_path / "a.csv", tmp_path / "b.csv", "--out", tmp_path / "S")
    assert done.returncode == 2
    assert "b.csv: the rows are of 'G-b', those of a.csv of 'G-a'" in done.stderr


def test_a_refusal_quotes_no_more_of_a_file_than_fits_into_a_line(tmp_path: Path, gyrotc: Command) -> None:
    """A name of a gyro, of a column, and a unit that go on for 4,000 letters."""
    long = "x" * 4000
    for name in ("a", "b"):
        devices = [f"{name}{long}"] * ROWS
        (tmp_path / f"{name}.csv").write_bytes(table(f"serial,{NAMES}", devices, fixed(TIME), T, R))
    (tmp_path / "c.csv").write_bytes(table(f"time_s,temperature_c {long},rate_dph", fixed(TIME), T, R))
    for arguments in (
        ("a.csv", "b.csv", "--serial", "R"),
        ("c.csv",),
        ("c.csv", "--column", f"temperature=temperature_c {long}", "--temperature-unit", long),
    ):
        done = gyrotc(
            "import", *(tmp_path / one if one.endswith(".csv") else one for one in arguments), "--out", tmp_path / "R"
        )
        assert done.returncode == 2
        assert "x" * 40 in done.stderr
        assert "x" * 80 not in done.stderr, arguments


def test_a_second_import_removes_no_recording(tmp_path: Path, gyrotc: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for k, name in enumerate(("a.csv", "b.csv")):
        Path(name).write_bytes(table(NAMES, fixed(TIME), T, fixed(RATE + 0.001 * k)))
    assert gyrotc("import", "a.csv", "--out", "R").returncode == 0
    done = gyrotc("import", "b.csv", "--out", "R")
    assert done.returncode == 2
    assert "holds the recordings of a.csv, which this import would remove" in done.stderr
    (command,) = re.findall("`gyrotc ([^`]+)`", done.stderr)
    assert gyrotc(*shlex.split(command)).returncode == 0
    assert sorted(path.name for path in Path("R").glob("*.parquet")) == ["a.parquet", "b.parquet"]


@pytest.mark.parametrize("name", ["a number that is no reading", "the clock starts again", "packed twice"])
def test_a_dry_run_refuses_what_the_import_refuses(name: str, tmp_path: Path, gyrotc: Command) -> None:
    (file, content), *_ = CASES[name].files.items()
    (tmp_path / file).write_bytes(content)
    said = [
        gyrotc("import", tmp_path / file, "--out", tmp_path / "R", *shlex.split(CASES[name].options), *dry).stderr
        for dry in ((), ("--dry-run",))
    ]
    assert CASES[name].refused in said[0]
    assert said[0] == said[1]
    assert not (tmp_path / "R").exists()


@pytest.mark.parametrize("command", ["import", "check"])
def test_nul_bytes_behind_the_last_row_are_said(command: str, tmp_path: Path, gyrotc: Command) -> None:
    (tmp_path / "D").mkdir()
    (tmp_path / "D" / "a.csv").write_bytes(PLAIN + 512 * b"\0")
    done = {
        "import": lambda: gyrotc("import", tmp_path / "D" / "a.csv", "--out", tmp_path / "R"),
        "check": lambda: gyrotc("check", tmp_path / "D"),
    }[command]()
    assert done.returncode == 0
    assert "300 rows" in done.stdout and "512 NUL bytes" in done.stdout


@pytest.mark.parametrize("late", [2990.0, -2985.0])
def test_a_delay_of_the_temperature_beyond_the_recording_is_refused(late: float, folder: Path, gyrotc: Command) -> None:
    data = folder / "D"
    data.mkdir()
    (data / "a.csv").write_bytes(PLAIN)
    text = f'schema = 1\nserial = "R"\nearth_rate = "removed"\ntemperature_late_s = {late}\n[[run]]\nfile = "a.csv"\n'
    (data / "dataset.toml").write_text(text)
    for command in (("check", data), ("build", data, "--out", folder / "R")):
        done = gyrotc(*command)
        assert done.returncode == 2
        assert "field temperature_late_s" in done.stdout + done.stderr
    (data / "dataset.toml").write_text(text.replace(str(late), "20.0"))
    assert gyrotc("check", data).returncode == 0


def test_rates_that_are_all_alike_are_not_diagnosed(folder: Path, gyrotc: Command) -> None:
    (folder / "D").mkdir()
    (folder / "D" / "a.csv").write_bytes(table(NAMES, fixed(TIME), T, ["0.0"] * ROWS))
    done = gyrotc("diagnose", folder / "D", "--out", folder / "R")
    assert done.returncode == 0
    assert "All rates are the same" in done.stdout + done.stderr


def test_a_data_set_of_two_devices_is_refused(folder: Path, gyrotc: Command) -> None:
    """The rows of each come in by what the refusal names."""
    (folder / "D").mkdir()
    near = np.repeat(TIME, 2) + [0.0, 0.5] * ROWS
    (folder / "D" / "a.csv").write_bytes(table(f"id,{NAMES}", IDS, near, *TWICE))
    done = gyrotc("check", folder / "D")
    assert done.returncode == 2
    assert "a.csv, column id: names several devices: 1 in a.csv, 2 in a.csv" in done.stdout
    (option,) = re.findall(r"--set '([^']+)'", done.stdout)
    assert imported(gyrotc, folder / "D", "a.csv", ["--set", option]) == ROWS


def test_a_map_of_one_gyro_does_not_name_another(folder: Path, gyrotc: Command) -> None:
    for name in ("A", "B"):
        (folder / f"{name}.csv").write_bytes(table(f"serial,{NAMES}", [name] * ROWS, fixed(TIME), T, R))
    assert gyrotc("import", folder / "A.csv", "--out", folder / "R").returncode == 0
    known = ("--map", folder / "R" / "map.toml", "--out", folder / "S")
    done = gyrotc("import", folder / "B.csv", *known)
    assert done.returncode == 2
    assert "B.csv: the rows are of 'B', and the map is of 'A'; expected --serial A, or" in done.stderr
    assert gyrotc("import", folder / "B.csv", *known, "--serial", "B").returncode == 0
    assert 'serial = "B"' in (folder / "S" / "dataset.toml").read_text()
