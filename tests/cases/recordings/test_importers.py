"""Files as loggers write them become data sets by one command; a refusal names the place and the change to make."""

from __future__ import annotations

import gzip
import json
import os
import random
import re
import subprocess
from collections.abc import Callable
from datetime import datetime, timezone
from pathlib import Path
from zoneinfo import ZoneInfo

import h5py
import nptdms
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
import xarray
from conftest import Command, run_gyrotc
from gyrotc.quality import check
from gyrotc.recordings import load, units
from gyrotc.recordings.importers import ImportOptions, Map, Stamps, import_files, load_map
from gyrotc.results import ImportedFiles, read_result
from logger_analysis import ANALYSIS_CASES
from logger_binaries import BINARY_CASES
from logger_files import CSV_CASES, START, Case, truth
from logger_foreign import FOREIGN, milliseconds
from logger_table import PAGE, cases, filled


def run_alone(*arguments: str | Path) -> tuple[int, str, str]:
    """Exit status, stdout and stderr of the command as a user types it."""
    done = run_gyrotc(*arguments)
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize("case", [*CSV_CASES, *FOREIGN, *BINARY_CASES, *ANALYSIS_CASES], ids=lambda c: c.id)
def test_a_file_comes_in_by_one_command(case: Case, tmp_path: Path) -> None:
    seen = truth()
    case.write(tmp_path / case.file, seen)
    out = tmp_path / "RLG-1"
    status, reported, error = run_alone("import", tmp_path / case.file, "--out", out, *case.options)
    assert status == 0, error + reported
    for k, axis in enumerate("xyz") if case.axes else [(0, None)]:
        rows = (dataset := load(out, axis=axis)).runs[0].rows()
        assert len(rows) == case.rows
        kept = np.isin(np.round(seen.time_s, 6), np.round(rows.time_s - case.starts_at, 3))
        assert kept.sum() == case.rows
        np.testing.assert_allclose(rows.time_s - case.starts_at, seen.time_s[kept], atol=case.time_tolerance)
        np.testing.assert_allclose(rows.temperature_c, seen.temperature_c[kept], atol=case.temperature_tolerance)
        np.testing.assert_allclose(rows.rate_dph, seen.rate_dph[kept, k], atol=case.tolerance)
        assert (dataset.runs[0].started == START) == case.started


def test_the_table_in_the_manual_is_that_of_the_tests() -> None:
    """Made again by `python tests/support/logger_table.py`."""
    page = PAGE.read_text("utf-8")
    assert filled(page) == page
    assert len(cases()) >= 30


@pytest.mark.parametrize("chunk", [7, 1000])
def test_the_hour_that_comes_twice_when_summer_time_ends(chunk: int) -> None:
    """Local stamps of Berlin over the end of summer time, in pieces of any length, are those of UTC again."""
    utc = np.arange("2026-10-24T23:00", "2026-10-25T03:00", 60, dtype="datetime64[s]")
    berlin = ZoneInfo("Europe/Berlin")
    instants = [datetime.fromtimestamp(int(s), timezone.utc).astimezone(berlin) for s in utc.astype(np.int64)]
    texts = [f"{one:%Y-%m-%d %H:%M:%S}" for one in instants]
    assert texts.count("2026-10-25 02:30:00") == 2
    stamps = Stamps("%Y-%m-%d %H:%M:%S", "Europe/Berlin")
    parsed = [stamps.parse(pa.array(texts[k : k + chunk]))[0] for k in range(0, len(texts), chunk)]
    np.testing.assert_array_equal(np.concatenate(parsed).astype("datetime64[ns]"), utc)


def test_a_point_that_may_part_thousands_or_decimals_is_not_taken(tmp_path: Path) -> None:
    """1.234 is 1234 for one logger and 1.234 for another; where nothing tells, the column is no column of numbers."""
    lines = [f"{k},5;{20 + k % 2},25;{1 + k % 3}.{200 + k}" for k in range(60)]
    (tmp_path / "a.csv").write_text("Zeit [s];Temp [°C];Rate [°/h]\n" + "\n".join(lines) + "\n", "utf-8")
    status, _, error = run_alone("import", tmp_path / "a.csv", "--out", tmp_path / "R")
    assert status == 2
    assert "no column that gives a rate" in error
    stated = ("import", tmp_path / "a.csv", "--out", tmp_path / "R", "--set", "csv.thousands=.")
    status, _, error = run_alone(*stated)
    assert status == 0, error
    assert load(tmp_path / "R").runs[0].rows().rate_dph[0] == 1200.0


@pytest.mark.parametrize("case", FOREIGN, ids=lambda c: c.id)
def test_the_kept_map_reads_the_next_file(case: Case, tmp_path: Path) -> None:
    """Without any option, and to the same rows."""
    case.write(tmp_path / case.file, truth())
    assert run_alone("import", tmp_path / case.file, "--out", tmp_path / "A", *case.options)[0] == 0
    again = ("import", tmp_path / case.file, "--map", tmp_path / "A" / "map.toml", "--out", tmp_path / "B")
    status, _, error = run_alone(*again)
    assert status == 0, error
    [one], [two] = (sorted((tmp_path / name).glob("*.parquet")) for name in "AB")
    assert one.read_bytes() == two.read_bytes()


def test_milliseconds_beside_a_stamp_are_read(tmp_path: Path) -> None:
    milliseconds(tmp_path / "gl.csv", truth())
    command = ("import", tmp_path / "gl.csv", "--out", tmp_path / "R", "--trust-units")
    status, reported, error = run_alone(*command)
    assert status == 0, error
    assert "Date&Time + ms" in reported
    np.testing.assert_allclose(load(tmp_path / "R").runs[0].rows().time_s, truth().time_s / 20.0, atol=1e-9)


Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(gyrotc: Command) -> Run:
    """The command as a user types it: exit status, stdout, stderr."""

    def one(*arguments: str | Path) -> tuple[int, str, str]:
        done = gyrotc(*arguments)
        return done.returncode, done.stdout, done.stderr

    return one


def lines(head: str, row: Callable[[int, float, float], str], rows: int = 600) -> str:
    """A laser gyro with Earth's rate in it: 0.0005 deg/sqrt(h), 20 to 50 C and back in 100 minutes."""
    rng = np.random.default_rng(3)
    temperature = 20.0 + 30.0 * (1.0 - np.abs(2.0 * np.arange(rows) / rows - 1.0)) + rng.normal(0.0, 0.01, rows)
    rate = 10.0 + rng.normal(0.0, 0.01, rows)
    every = zip(temperature.tolist(), rate.tolist(), strict=True)
    return "\n".join([head, *(row(k, t, r) for k, (t, r) in enumerate(every))]) + "\n"


OWN = "time_s,temperature_c,rate_dph"
PLAIN = "time,temperature,gyro"

REFUSED: dict[str, tuple[str, tuple[str, ...], tuple[str, ...], tuple[str, ...]]] = {
    "no units": (
        lines(PLAIN, lambda k, t, r: f"{10 * k},{t},{r}"),
        (),
        ("no unit of the rate in column 'gyro'", "--rate-unit", "--temperature-unit", "--time-unit"),
        ("--rate-unit", "deg/h", "--temperature-unit", "degC", "--time-unit", "s"),
    ),
    "one unit missing": (
        lines("t_s,temp_c,gyro", lambda k, t, r: f"{10 * k},{t},{r}"),
        (),
        ("no unit of the rate", "--rate-unit"),
        ("--rate-unit", "deg/h"),
    ),
    "deg/s taken for deg/h": (
        lines(OWN, lambda k, t, r: f"{10 * k},{t},{r / 3600}"),
        (),
        ("white noise", "below that of any gyro", '--rate-unit "deg/s"', "--trust-units"),
        ("--rate-unit", "deg/s"),
    ),
    "rad/s taken for deg/h": (
        lines(OWN, lambda k, t, r: f"{10 * k},{t},{np.radians(r / 3600)}"),
        (),
        ("below that of any gyro", "rad/s", "--trust-units"),
        ("--rate-unit", "rad/s"),
    ),
    "minutes taken for seconds": (
        lines(OWN, lambda k, t, r: f"{k / 6},{t},{r}"),
        (),
        ("C/min", "faster than a chamber", '--time-unit "min"'),
        ("--time-unit", "min"),
    ),
    "hours taken for seconds": (
        lines(OWN, lambda k, t, r: f"{k / 360},{t},{r}"),
        (),
        ("faster than a chamber", "C/min"),
        ("--time-unit", "h"),
    ),
    "kelvin taken for C": (
        lines(OWN, lambda k, t, r: f"{10 * k},{t + 273.15},{r}"),
        (),
        ("line 2", "--temperature-unit K"),
        ("--temperature-unit", "K"),
    ),
    "fahrenheit taken for C": (
        lines(OWN, lambda k, t, r: f"{10 * k},{(t + 15) * 1.8 + 32},{r}"),
        (),
        ("fahrenheit", '--temperature-unit "degF"'),
        ("--temperature-unit", "degF"),
    ),
    "a word among numbers": (
        lines(OWN, lambda k, t, r: f"{10 * k},{t},{'OVR' if k == 300 else r}"),
        (),
        ("line 302, column rate_dph", "'OVR'", "--set csv.missing"),
        ("--set", "csv.missing=OVR"),
    ),
    "a line of words": (
        lines(OWN, lambda k, t, r: f"{10 * k},{t},{r}" if k != 300 else "Logger restarted"),
        (),
        ("line 302", "Logger restarted", "--set csv.comment"),
        ("--set", "csv.comment=Logger"),
    ),
    "day or month": (
        lines(
            "time,temp_c,rate_dph", lambda k, t, r: f"03/04/2026 {8 + k // 360:02d}:{k // 6 % 60:02d}:{k % 6}0,{t},{r}"
        ),
        (),
        ("cannot be distinguished", '--set time.format="%d/%m/%Y %H:%M:%S"', '"%m/%d/%Y %H:%M:%S"'),
        ("--set", "time.format=%d/%m/%Y %H:%M:%S"),
    ),
    "stamps too coarse": (
        lines("time,temp_c,rate_dph", lambda k, t, r: f"2026-03-01 08:{k // 100:02d}:{k // 10 % 60:02d},{t},{r}"),
        (),
        ("line 3", "the time of the row before", "--set time.rate_hz"),
        ("--set", "time.rate_hz=0.1"),
    ),
    "two thermometers": (
        lines("time_s,T1 [C],T2 [C],rate_dph", lambda k, t, r: f"{10 * k},{t},{t},{r}"),
        (),
        ("'T1 [C]', 'T2 [C]' could be the temperature", "--column temperature="),
        ("--column", "temperature=T2 [C]"),
    ),
    "no times": (
        lines("temp_c,rate_dph", lambda k, t, r: f"{t},{r}"),
        (),
        ("no column that gives a time", "--set time.rate_hz"),
        ("--set", "time.rate_hz=0.1"),
    ),
    "the hours of deg/hr taken for a time": (
        lines("Excel date,Temp C,Rate deg/hr", lambda k, t, r: f"{46100 + k / 8640:.9f},{t},{r}"),
        (),
        ("no unit of the time in column 'Excel date'", "--time-unit"),
        ("--time-unit", "d"),
    ),
    "no line of names": (
        lines("0,20,10", lambda k, t, r: f"{10 * k + 10},{t},{r}"),
        (),
        ("column 1, column 2, column 3", '--column time="column ..." --time-unit', "--rate-unit"),
        (
            "--column",
            "time=column 1",
            "--time-unit",
            "s",
            "--column",
            "temperature=column 2",
            "--temperature-unit",
            "degC",
            "--column",
            "rate=column 3",
            "--rate-unit",
            "deg/h",
        ),
    ),
    "points between thousands of a whole number": (
        lines(
            "Zeit [ms];T [C];rate [deg/h]",
            lambda k, t, r: f"{10000 * k:,};{t:.4f};{r:.6f}".replace(",", "#").replace(".", ",").replace("#", "."),
        ),
        (),
        ("no column that gives a time", "as Zeit [ms] holds", "--set csv.thousands=."),
        ("--set", "csv.thousands=."),
    ),
    "a unit that is none": (
        lines("time_s,temp_c,gyro", lambda k, t, r: f"{10 * k},{t},{r}"),
        ("--rate-unit", "furlongs"),
        ("--rate-unit", "furlongs", "deg/s"),
        ("--rate-unit", "deg/h"),
    ),
    "a unit of something else": (
        lines("time_s,temp_c,gyro [V]", lambda k, t, r: f"{10 * k},{t},{r}"),
        ("--column", "rate=gyro [V]"),
        ("'V'", "no rate", "--rate-unit"),
        ("--column", "rate=gyro [V]", "--rate-unit", "deg/h"),
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_refusal_names_what_goes_on_and_that_goes_on(case: str, tmp_path: Path, run: Run) -> None:
    text, options, words, mended = REFUSED[case]
    (tmp_path / "log.csv").write_text(text)
    status, out, error = run("import", tmp_path / "log.csv", "--out", tmp_path / "RLG-1", *options)
    assert status == 2, out
    assert all(word in error for word in words), error
    assert not (tmp_path / "RLG-1").exists()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["log.csv"]
    status, out, error = run("import", tmp_path / "log.csv", "--out", tmp_path / "RLG-1", *mended)
    assert status == 0, error
    rows = load(tmp_path / "RLG-1").runs[0].rows()
    assert rows.rate_dph.mean() == pytest.approx(10.0, abs=0.01)
    assert rows.temperature_c.max() == pytest.approx(50.0, abs=15.1)
    assert rows.time_s[-1] - rows.time_s[0] == pytest.approx(5990.0, rel=0.01)


def test_values_that_are_right_as_they_are_come_in_and_it_is_recorded(tmp_path: Path, run: Run) -> None:
    (tmp_path / "log.csv").write_text(REFUSED["deg/s taken for deg/h"][0])
    status, out, error = run(
        "import", tmp_path / "log.csv", "--out", tmp_path / "RLG-1", "--trust-units", "--json", tmp_path / "i.json"
    )
    assert status == 0, error
    assert "units are trusted: rate_dph: white noise" in out
    dataset = load(tmp_path / "RLG-1")
    assert "white noise" in dataset.trusted[0]
    (of_import,) = read_result(tmp_path / "i.json", ImportedFiles).findings
    (of_check,) = (one for one in check(tmp_path / "RLG-1").warnings if one.id == "units_trusted")
    assert (of_import.id, of_import.next) == (of_check.id, of_check.next)
    assert all("units are trusted: " in one.text and "white noise" in one.text for one in (of_import, of_check))


def test_the_kept_map_reads_the_next_file_and_twice_gives_the_same_bytes(tmp_path: Path, run: Run) -> None:
    text = lines("t;T;G", lambda k, t, r: f"{10 * k};{t};{r / 3600}".replace(".", ","))
    stated = ["--column", "rate=G", "--column", "temperature=T", "--rate-unit", "deg/s", "--temperature-unit", "degC"]
    (tmp_path / "one.csv").write_text(text)
    first = run(
        "import", tmp_path / "one.csv", "--out", tmp_path / "A", *stated, "--time-unit", "s", "--serial", "RLG-1"
    )
    assert first[0] == 0, first[2]
    (tmp_path / "one-again.csv").write_text(text)
    kept = tmp_path / "A" / "map.toml"
    second = run("import", tmp_path / "one.csv", "--out", tmp_path / "B", "--map", kept)
    third = run("import", tmp_path / "one-again.csv", "--out", tmp_path / "C", "--map", kept, "--serial", "RLG-2")
    assert second[0] == third[0] == 0, second[2] + third[2]
    for name in ("dataset.toml", "map.toml", "one.parquet"):
        assert (tmp_path / "A" / name).read_bytes() == (tmp_path / "B" / name).read_bytes(), name
    assert load(tmp_path / "C").serial == "RLG-2"
    source = load(tmp_path / "A").sources[0]
    assert source["file"] == "one.csv" and source["bytes"] == len(text)


def test_a_person_on_a_terminal_is_asked_for_a_unit(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(lines(PLAIN, lambda k, t, r: f"{k / 6},{t + 273.15},{r / 3600}"))
    answers = {"rate": "deg/s", "temperature": "K", "time": "min"}
    asked: list[str] = []

    def ask(question: str) -> str:
        asked.append(question)
        return next(unit for kind, unit in answers.items() if f"unit of the {kind}" in question)

    import_files([tmp_path / "log.csv"], tmp_path / "R", Map(), ImportOptions(), ask=ask)
    assert len(asked) == 3 and all("log.csv" in question for question in asked)
    rows = load(tmp_path / "R").runs[0].rows()
    assert rows.rate_dph.mean() == pytest.approx(10.0, abs=0.01)
    assert rows.time_s[-1] == pytest.approx(5990.0)
    kept = load_map(tmp_path / "R" / "map.toml")
    assert kept.units == answers


def test_several_files_become_several_runs(tmp_path: Path, run: Run) -> None:
    for seed, name in enumerate(("a.csv", "b.csv")):  # two runs, not one twice
        noise = np.random.default_rng(seed).normal(0.0, 0.5, 10_000)
        (tmp_path / name).write_text(
            lines(OWN, lambda k, t, r, noise=noise: f"{10 * k},{t},{r + noise[k]}")  # type: ignore[misc]
        )
    result = tmp_path / "import.json"
    status, _, error = run("import", tmp_path / "a.csv", tmp_path / "b.csv", "--out", tmp_path / "R", "--json", result)
    assert status == 0, error
    dataset = load(tmp_path / "R")
    assert [run.file for run in dataset.runs] == ["a.parquet", "b.parquet"]
    assert [source["file"] for source in dataset.sources] == ["a.csv", "b.csv"]
    assert json.loads(result.read_text())["schema"] == "gyrotc.import/1"
    assert dataset.runs[0].power_on_s is None


def test_the_last_file_becomes_the_exam_where_that_is_stated_or_answered(tmp_path: Path, run: Run) -> None:
    files = [tmp_path / name for name in ("a.csv", "b.csv")]
    for seed, file in enumerate(files):
        noise = random.Random(seed)  # another run's: the same noise twice is a copy
        file.write_text(lines(OWN, lambda k, t, r, noise=noise: f"{k},{t},{r + noise.gauss(0.0, 1.0)}"))
    status, out, error = run("import", *files, "--out", tmp_path / "R", "--exam")
    assert status == 0, error
    assert "600 rows of 1 s" in out and "b.parquet is the test run" in out
    assert [one.role for one in load(tmp_path / "R").runs] == ["train", "exam"]
    _, hint, _ = run("import", *files, "--out", tmp_path / "S")
    assert "--exam makes the last run a test run" in hint
    for answer, role in (("y", "exam"), ("", "train")):
        options = ImportOptions(exam=None)
        import_files(files, tmp_path / f"T-{role}", Map(), options, ask=lambda _, said=answer: said)
        assert load(tmp_path / f"T-{role}").runs[1].role == role
    status, _, error = run("import", files[0], "--out", tmp_path / "U", "--exam")
    assert status == 2 and "--exam: with one file" in error


def test_a_packed_file_larger_than_is_allowed_is_refused_while_it_is_unpacked(tmp_path: Path, run: Run) -> None:
    with gzip.open(tmp_path / "log.csv.gz", "wb", compresslevel=9) as file:
        for _ in range(30):
            file.write(bytes(2**20))
    status, _, error = run("--max", "recording_mib=10", "import", tmp_path / "log.csv.gz", "--out", tmp_path / "R")
    assert status == 2 and "recording_mib" in error and not (tmp_path / "R").exists()


def test_a_folder_that_import_did_not_make_is_left_alone(tmp_path: Path, run: Run) -> None:
    (tmp_path / "log.csv").write_text(lines(OWN, lambda k, t, r: f"{10 * k},{t},{r}"))
    (tmp_path / "R").mkdir()
    (tmp_path / "R" / "thesis.tex").write_text("mine")
    status, _, error = run("import", tmp_path / "log.csv", "--out", tmp_path / "R")
    assert status == 2 and "R" in error
    assert [p.name for p in (tmp_path / "R").iterdir()] == ["thesis.tex"]


def test_what_an_import_says_is_a_typed_result(tmp_path: Path, run: Run) -> None:
    (tmp_path / "a.csv").write_text(lines(OWN, lambda k, t, r: f"{10 * k},{t},{r if k != 7 else 'NaN'}"))
    assert run("import", tmp_path / "a.csv", "--out", tmp_path / "R-1", "--json", tmp_path / "i.json")[0] == 0
    said = read_result(tmp_path / "i.json", ImportedFiles)
    (one,) = said.runs
    assert (said.serial, one.rows, one.left_out) == ("R-1", 599, {"no number in rate_dph": 1})
    (finding,) = said.findings
    assert (finding.id, finding.file, finding.text) == (
        "left_out",
        one.file,
        "1 rows are left out: no number in rate_dph",
    )
    assert one.source.file == "a.csv" and one.source.bytes == (tmp_path / "a.csv").stat().st_size


def test_a_dry_run_writes_nothing(tmp_path: Path, run: Run) -> None:
    (tmp_path / "log.csv").write_text(lines(OWN, lambda k, t, r: f"{10 * k},{t},{r}"))
    status, out, _ = run("import", tmp_path / "log.csv", "--out", tmp_path / "R", "--dry-run")
    assert status == 0 and "row 1:" in out and "nothing was written" in out
    assert not (tmp_path / "R").exists()


@pytest.mark.parametrize(
    "head",
    [b"", b"\x89HDF\r\n\x1a\n\0\0", b"MATLAB 5.0 MAT-file\0\0", b"TDSm\0\0\0", b"PAR1\0\0", b"PK\x03\x04",
     bytes(range(256)) * 9, b"CDF\x01\0", b"\x1f\x8b\x08\0", b"PK\x03\x04" + bytes(22) + b"\x03\0\0\0xl/"],
    ids=lambda head: repr(head[:8]),
)  # fmt: skip
def test_a_damaged_file_is_one_message(head: bytes, tmp_path: Path, run: Run) -> None:
    (tmp_path / "log.bin").write_bytes(head)
    status, _, error = run("import", tmp_path / "log.bin", "--out", tmp_path / "R")
    assert status == 2, error
    assert error.splitlines()[-1].startswith("gyrotc: ") and not (tmp_path / "R").exists()


@pytest.mark.parametrize(
    "content",
    [
        b"ULog\x01\x12\x35\x01" + bytes(100),
        b"\xa3\x95\x80\x80\x59FMT\0BBnNZ",
        b"#ROSBAG V2.0\n" + bytes(100),
        b"SQLite format 3\0" + bytes(4000),
        b"MDF     4.10    " + bytes(200),
        b"\x93NUMPY\x01\0v\0" + np.arange(500.0).tobytes(),
        b"ARROW1\0\0" + bytes(200),
        np.arange(500.0).tobytes(),
    ],
    ids=lambda content: repr(content[:8]),
)
def test_a_binary_file_of_another_format_is_refused_with_what_to_do(content: bytes, tmp_path: Path, run: Run) -> None:
    """The program that wrote it exports CSV; docs/import.md names tools for common formats."""
    (tmp_path / "log.bin").write_bytes(content)
    status, _, error = run("import", tmp_path / "log.bin", "--out", tmp_path / "R")
    assert status == 2 and not (tmp_path / "R").exists()
    assert error.startswith("gyrotc: log.bin: binary data of no known format; expected CSV from the program that wrote")


@pytest.mark.parametrize("way", ["external", "virtual"])
def test_values_in_other_files_are_not_read(way: str, tmp_path: Path, run: Run) -> None:
    secret = tmp_path / "secret"
    np.arange(500.0).tofile(secret)
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["rate"] = np.arange(500.0)
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["time_s"], file["temperature_c"] = np.arange(500.0), np.linspace(20.0, 40.0, 500)
        if way == "external":
            file.create_dataset("rate_dph", (500,), "f8", external=[(str(secret), 0, 4000)])
        else:
            layout = h5py.VirtualLayout(shape=(500,), dtype="f8")
            layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "rate", shape=(500,))
            file.create_virtual_dataset("rate_dph", layout)
    status, _, error = run("import", tmp_path / "log.h5", "--out", tmp_path / "R")
    assert status == 2 and "log.h5, rate_dph: has its values in other files" in error, error


def test_links_to_other_files_are_not_followed(tmp_path: Path, run: Run) -> None:
    os.mkfifo(tmp_path / "pipe")  # opened, it would wait for ever
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["time_s"], file["temperature_c"] = np.arange(500.0), np.linspace(20.0, 40.0, 500)
        file["rate_dph"] = np.sin(np.arange(500.0))
        file["far"] = h5py.ExternalLink(str(tmp_path / "pipe"), "/rate")
        file["gone"] = h5py.SoftLink("/nowhere")
    status, _, error = run("import", tmp_path / "log.h5", "--serial", "a", "--out", tmp_path / "R")
    assert status == 0, error


def test_rows_that_a_logger_file_only_declares_are_refused(tmp_path: Path, run: Run) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        for name in ("time_s", "temperature_c", "rate_dph"):
            file.create_dataset(name, (10**15,), "f8", chunks=(1024,))
    status, _, error = run("import", tmp_path / "log.h5", "--out", tmp_path / "R")
    assert status == 2 and "1e+15 rows; expected at most 100000000" in error, error


def test_matlab_variables_larger_than_the_allowed_memory_are_refused_before_they_are_unpacked(
    tmp_path: Path, run: Run
) -> None:
    path = tmp_path / "log.mat"
    scipy.io.savemat(path, {"rate_dph": np.zeros((200_000, 4))}, do_compression=True)
    assert path.stat().st_size < 20_000
    status, _, error = run("--max", "memory_gib=0.01", "import", path, "--out", tmp_path / "R")
    assert status == 2 and "GiB of memory for its variables" in error, error


class _Counted:
    """A pattern that counts the square of the characters it is given: the steps of its search are of that order."""

    def __init__(self, pattern: re.Pattern[str], steps: list[int]) -> None:
        self._pattern, self._steps = pattern, steps

    def match(self, text: str) -> re.Match[str] | None:
        self._steps.append(len(text) ** 2)
        return self._pattern.match(text[:1000])  # so that the test ends where nothing limits the search


def test_a_column_name_of_many_blanks_is_not_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before: the search for a unit took the square of its 100,000 blanks, 55 s."""
    steps: list[int] = []
    for name in ("_BRACKETS", "_AFTER_SIGN", "_WITH_SIGN"):
        monkeypatch.setattr(units, name, _Counted(getattr(units, name), steps))
    units.split_unit.cache_clear()
    assert units.meaning("rate of these blanks [deg/h]", None).unit == "deg/h" and steps, "nothing is counted"
    steps.clear()
    units.meaning("x" + " " * 100_000 + "y", None)
    assert sum(steps) <= 100_000, "more than a step for each character"


@pytest.mark.parametrize(
    ("name", "extra", "head"),
    [
        ("a.tdms", "tdms", b"TDSm"),
        ("a.h5", "hdf5", b"\x89HDF\r\n\x1a\n"),
        ("a.nc", "netcdf", b"CDF\x01"),
        ("a.xlsx", "excel", b"PK\x03\x04" + bytes(22) + b"\x03\0\0\0xl/"),
    ],
)
def test_a_missing_library_is_named_with_the_extra_that_brings_it(
    name: str, extra: str, head: bytes, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    from gyrotc.recordings import tables
    from gyrotc.recordings.importers import job as import_job

    class Importlib:
        """Finds nothing."""

        @staticmethod
        def import_module(module: str) -> None:
            raise ImportError(module)

    (tmp_path / name).write_bytes(head + bytes(2000))
    monkeypatch.setattr(tables, "importlib", Importlib)
    monkeypatch.setattr(import_job, "open_in_child", lambda opener, path: opener(path))
    status, _, error = run("import", tmp_path / name, "--out", tmp_path / "R")
    assert status == 2
    assert error.startswith(f"gyrotc: {name}: ")
    assert f'expected pip install "gyrotc[{extra}]"' in error


GOES_ON = {
    "pulses": (
        "time_s,pulses,temp_c",
        "{k},{k},20.5",
        "--set pulse_weight_arcsec=W",
        ("--set", "pulse_weight_arcsec=2.0"),
    ),
    "increments": (
        "Time (s),DeltaAngle X (rad),Temp (C)",
        "{k},0.0001{k},20.5",
        '--column rate="DeltaAngle X (rad)" --rate-unit "rad / (0.01 s)"',
        ("--column", "rate=DeltaAngle X (rad)", "--rate-unit", "rad / (0.01 s)"),
    ),
}


@pytest.mark.parametrize("case", GOES_ON)
def test_the_option_that_is_named_goes_on(case: str, tmp_path: Path, run: Run) -> None:
    head, row, named, options = GOES_ON[case]
    lines = [head, *(row.format(k=k + 100) for k in range(50))]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n", "utf-8")
    command = ("import", tmp_path / "a.csv", "--out", tmp_path / "R")
    status, _, error = run(*command)
    assert status == 2
    assert named in error
    assert run(*command, *options, "--trust-units")[0] == 0


def test_a_line_that_looks_like_a_row_is_never_offered_as_a_comment(tmp_path: Path, run: Run) -> None:
    """Before: csv.comment="1000" was offered, which leaves out 10000 too."""
    lines = ["time_s,temp_c,rate_dph", *(f"{10 * k},20.5,{k % 7}" + ",x" * (k == 100) for k in range(200))]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n", "utf-8")
    _, _, error = run("import", tmp_path / "a.csv", "--out", tmp_path / "R")
    assert "line 102: 4 cells" in error
    assert "comment=" not in error


def test_units_in_cells_are_taken_out_by_the_command_that_the_refusal_gives(tmp_path: Path, run: Run) -> None:
    text = lines("time,temperature,rate", lambda k, t, r: f"{10 * k}.0 s,{t:.3f} °C,{r:.9f} °/h")
    (tmp_path / "a.csv").write_text(text, "utf-8")
    _, _, error = run("import", tmp_path / "a.csv", "--out", tmp_path / "R")
    sed = error[error.index("sed ") : error.index(" takes the units out")]
    subprocess.run(sed, shell=True, check=True, cwd=tmp_path)
    units = ("--time-unit", "s", "--temperature-unit", "degC", "--rate-unit", "deg/h")
    assert run("import", tmp_path / "a.csv.csv", "--out", tmp_path / "R", *units)[0] == 0
    assert load(tmp_path / "R").runs[0].n_rows == 600


def test_digits_that_may_be_hexadecimal_are_reported(tmp_path: Path, run: Run) -> None:
    text = lines("tick [ms],temp_c,rate_dph", lambda k, t, r: f"{10000 * k:06X}h,{t},{r}")
    (tmp_path / "a.csv").write_text(text)
    _, _, error = run("import", tmp_path / "a.csv", "--out", tmp_path / "R")
    assert "as tick [ms] holds '" in error and "0x before each of its numbers" in error


@pytest.mark.parametrize("rows", [10, 20, 45])
@pytest.mark.parametrize("above", [0, 25])
def test_a_short_file_is_read(rows: int, above: int, tmp_path: Path, run: Run) -> None:
    """Before: a header among the last 60 lines hid that the rows are numbers."""
    lines = [*(f"note {k}" for k in range(above)), "time_s,temp_c,rate_dph"]
    lines += [f"{10 * k},20.{k},{k % 7}.5" for k in range(rows)]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n", "utf-8")
    status, _, error = run("import", tmp_path / "a.csv", "--out", tmp_path / "R")
    assert status == 0, error
    assert load(tmp_path / "R").runs[0].n_rows == rows


def test_commas_between_columns_and_in_decimals_are_reported(tmp_path: Path, run: Run) -> None:
    text = "\n".join(["time_s,temp_c,rate_dph", *(f"{k},0,20,{k},4,{k % 7}" for k in range(60))])
    (tmp_path / "a.csv").write_text(text + "\n", "utf-8")
    status, _, error = run("import", tmp_path / "a.csv", "--out", tmp_path / "R")
    assert status == 2
    assert "line 1: 3 names above rows of 6 cells" in error


def test_minutes_and_seconds_are_not_taken_for_hours_and_minutes(tmp_path: Path, run: Run) -> None:
    """Before: read as hours and minutes, sixty times too slow, in silence."""
    text = "\n".join(["Time,temp_c,rate_dph", *(f"{k // 6:02d}:{k % 6}0,20.{k % 10},{k % 7}" for k in range(120))])
    (tmp_path / "a.csv").write_text(text + "\n", "utf-8")
    status, _, error = run("import", tmp_path / "a.csv", "--out", tmp_path / "R")
    assert status == 2
    assert '--set time.format="%H:%M" or --set time.format="%M:%S"' in error
    assert run("import", tmp_path / "a.csv", "--out", tmp_path / "R", "--set", "time.format=%M:%S")[0] == 0
    assert load(tmp_path / "R").runs[0].row_period_s == 10.0


def test_a_time_that_counts_on_beyond_a_day_is_read(tmp_path: Path, run: Run) -> None:
    rows = (f"{k // 6}:{k % 6}0:00,20.{k % 10},{k % 7}" for k in range(300))
    (tmp_path / "a.csv").write_text("\n".join(["Elapsed,temp_c,rate_dph", *rows]) + "\n", "utf-8")
    status, _, error = run("import", tmp_path / "a.csv", "--out", tmp_path / "R")
    assert status == 0, error
    assert load(tmp_path / "R").runs[0].rows().time_s[-1] == 299 * 600.0


def test_a_column_of_text_that_should_hold_numbers_is_named(tmp_path: Path, run: Run) -> None:
    rows = (f"{10 * k};20,{10 + k % 80};1.{400 + k}" for k in range(100))
    (tmp_path / "a.csv").write_text("\n".join(["time_s;temp_c;rate_dph", *rows]) + "\n", "utf-8")
    command = ("import", tmp_path / "a.csv", "--out", tmp_path / "R")
    status, _, error = run(*command)
    assert status == 2
    assert "temp_c holds '20,29'" in error
    assert run(*command, "--set", "csv.decimal=,", "--set", "csv.thousands=.")[0] == 0
    assert load(tmp_path / "R").runs[0].rows().rate_dph[0] == 1400.0


def printed_of(folder: Path, names: str, values: str) -> str:
    """Return what an import says of a log with more columns; numbers differ from row to row by what replaces `#`."""
    lines = [f"time_s,temperature_c,rate_dph,{names}"]
    lines += [f"{k},20.{k},0.0{k},{values.replace('#', str(k))}" for k in range(100, 300)]
    (folder / "log.csv").write_text("\n".join(lines) + "\n")
    return run_gyrotc("import", folder / "log.csv", "--serial", "A", "--out", folder / "A").stdout


def test_columns_that_an_import_leaves_out_are_named_of_text_as_well(tmp_path: Path) -> None:
    printed = printed_of(tmp_path, "Status,Volts", "OK,5.0#")
    assert "left out: Volts ([channels] of the map" in printed
    assert "left out: Status (no numbers; --set where" in printed


def test_columns_of_one_name_are_named_apart_whatever_the_others_are_called(tmp_path: Path) -> None:
    """The sixth column would be the second "Volts #6"."""
    printed = printed_of(tmp_path, "Volts #6,Volts,Volts", "1.0#,2.0#,3.0#")
    assert "left out: Volts #6, Volts, Volts #7 ([channels] of the map" in printed


def _hdf5(path: Path, columns: dict[str, np.ndarray]) -> None:
    with h5py.File(path, "w") as file:
        for name, values in columns.items():
            file[name] = values
        file["note"] = "of the operator"
        file["gone"] = h5py.SoftLink("/nowhere")


def _mat(path: Path, columns: dict[str, np.ndarray]) -> None:
    more: dict[str, object] = {"note": "of the operator", "gone": np.array(["a", 1.0], dtype=object)}
    scipy.io.savemat(path, columns | more)


def _netcdf(path: Path, columns: dict[str, np.ndarray]) -> None:
    dimensions = {"picture": ("t", "u"), "cube": ("a", "b", "c")}
    shaped = {name: (dimensions.get(name, "t"), values) for name, values in columns.items()}
    more = {"note": ("t", np.array(["x"] * 300)), "gone": ((), 3.0)}
    xarray.Dataset(shaped | more).to_netcdf(path, engine="h5netcdf")


def _tdms(path: Path, columns: dict[str, np.ndarray]) -> None:
    vectors = {name: values for name, values in columns.items() if values.ndim == 1}
    more = {"note": ["of", "the", "operator"], "gone": np.array([1.0]), "picture": ["one"], "cube": np.zeros(0)}
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment([nptdms.ChannelObject("log", name, values) for name, values in (vectors | more).items()])


def _parquet(path: Path, columns: dict[str, np.ndarray]) -> None:
    vectors = {name: pa.array(values) for name, values in columns.items() if values.ndim == 1}
    n = len(vectors["time_s"])
    more = {"note": [[1]] * n, "gone": [True] * n, "picture": [b"x"] * n, "cube": [{"a": 1}] * n}
    pq.write_table(pa.table(vectors | {name: pa.array(values) for name, values in more.items()}), path)


@pytest.mark.parametrize(
    ("file", "write"),
    [("a.h5", _hdf5), ("a.mat", _mat), ("a.nc", _netcdf), ("a.tdms", _tdms), ("a.parquet", _parquet)],
)
def test_whatever_a_file_holds_besides_is_named(
    file: str, write: Callable[[Path, dict[str, np.ndarray]], None], tmp_path: Path, run: Run
) -> None:
    k = np.arange(300.0)
    columns = {"time_s": 10.0 * k, "temperature_c": 20.0 + k / 10.0, "rate_dph": np.sin(k)}
    write(tmp_path / file, columns | {"picture": np.zeros((300, 70)), "cube": np.zeros((3, 4, 5))})
    status, printed, error = run("import", tmp_path / file, "--serial", "A", "--out", tmp_path / "R", "--trust-units")
    assert status == 0, error
    (line,) = (line for line in (printed + error).splitlines() if line.startswith("  left out: "))
    assert all(name in line for name in ("note", "gone", "picture", "cube"))
