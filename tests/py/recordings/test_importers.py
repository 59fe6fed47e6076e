"""Files as loggers write them become data sets by one command; what is not declared is refused, never guessed."""

from __future__ import annotations

import importlib.util
from datetime import datetime, timezone
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pyarrow as pa
import pytest
from conftest import run_gyrotc
from gyrotc.recordings.importers.stamps import Stamps
from gyrotc.recordings.load import load
from logger_binaries import BINARY_CASES
from logger_files import CSV_CASES, START, Case, truth
from logger_strangers import STRANGERS, milliseconds
from logger_table import PAGE, cases, filled


def run(*arguments: str | Path) -> tuple[int, str, str]:
    """Exit status, stdout and stderr of the command as a user types it."""
    done = run_gyrotc(*arguments)
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize("case", [*CSV_CASES, *STRANGERS, *BINARY_CASES], ids=lambda c: c.id)
def test_a_file_comes_in_by_one_command(case: Case, tmp_path: Path) -> None:
    if case.needs and importlib.util.find_spec(case.needs) is None:
        pytest.skip(f"{case.needs} is not installed")
    seen = truth()
    case.write(tmp_path / case.file, seen)
    out = tmp_path / "RLG-1"
    status, told, error = run("import", tmp_path / case.file, "--out", out, *case.options)
    assert status == 0, error + told
    for k, axis in enumerate("xyz") if case.axes else [(0, None)]:
        rows = (dataset := load(out, axis=axis)).runs[0].rows()
        assert len(rows) == case.rows
        kept = np.isin(np.round(seen.time_s, 6), np.round(rows.time_s - case.starts_at, 3))
        assert kept.sum() == case.rows
        np.testing.assert_allclose(rows.time_s - case.starts_at, seen.time_s[kept], atol=case.time_tolerance)
        np.testing.assert_allclose(
            rows.temperature_c, seen.temperature_c[kept], atol=case.temperature_tolerance
        )
        np.testing.assert_allclose(rows.rate_dph, seen.rate_dph[kept, k], atol=case.tolerance)
        assert (dataset.runs[0].started == START) == case.started


def test_the_table_in_the_manual_is_that_of_the_tests() -> None:
    """Made again by `python tests/py/logger_table.py`."""
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
    status, _, error = run("import", tmp_path / "a.csv", "--out", tmp_path / "R")
    assert status == 2
    assert "no column that a rate is told from" in error
    stated = ("import", tmp_path / "a.csv", "--out", tmp_path / "R", "--csv", "thousands=.")
    status, _, error = run(*stated)
    assert status == 0, error
    assert load(tmp_path / "R").runs[0].rows().rate_dph[0] == 1200.0


@pytest.mark.parametrize("case", STRANGERS, ids=lambda c: c.id)
def test_the_kept_map_reads_the_next_file(case: Case, tmp_path: Path) -> None:
    """Without any option, and to the same rows."""
    case.write(tmp_path / case.file, truth())
    assert run("import", tmp_path / case.file, "--out", tmp_path / "A", *case.options)[0] == 0
    again = ("import", tmp_path / case.file, "--map", tmp_path / "A" / "map.toml", "--out", tmp_path / "B")
    status, _, error = run(*again)
    assert status == 0, error
    [one], [two] = (sorted((tmp_path / name).glob("*.parquet")) for name in "AB")
    assert one.read_bytes() == two.read_bytes()


def test_milliseconds_beside_a_stamp_are_read(tmp_path: Path) -> None:
    milliseconds(tmp_path / "gl.csv", truth())
    command = ("import", tmp_path / "gl.csv", "--out", tmp_path / "R", "--trust-units")
    status, told, error = run(*command)
    assert status == 0, error
    assert "Date&Time + ms" in told
    np.testing.assert_allclose(load(tmp_path / "R").runs[0].rows().time_s, truth().time_s / 20.0, atol=1e-9)
