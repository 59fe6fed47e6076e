"""A library that reads a file of others can do nothing but read that file, within limits, and hand back rows."""

from __future__ import annotations

import importlib
import importlib.util
import os
import socket
from contextlib import closing
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from gyrotc.common.errors import InputError
from gyrotc.recordings import parser_process
from gyrotc.recordings.importers import job as import_job
from gyrotc.recordings.importers.map_file import Map
from gyrotc.recordings.parser_process import Parser, landlock_version, open_confined
from gyrotc.recordings.reading import ParquetFile
from gyrotc.recordings.tables import LoggerFile
from logger_binaries import BINARY_CASES
from logger_files import Case, truth

MOVED = "memory_gib=0.25 parser_s=1"


def opened(reader: str, path: Path) -> LoggerFile:
    return open_confined(Parser("readers_that_misbehave", reader, "numpy"), path)


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GYROTC_MAX", MOVED)
    (tmp_path / "secret").write_text("years of work", encoding="ascii")
    path = tmp_path / "log.bin"
    path.write_text("rows", encoding="ascii")
    return path


@pytest.mark.parametrize(
    ("reader", "message"),
    [
        ("raises", "is damaged (ZeroDivisionError: in a library)"),
        ("crashes", "its reader ends by SIGABRT"),
        ("never_ends", "its reader takes more than 1 s of processor time"),
        ("takes_all_memory", "takes more than 0.25 GiB of memory"),
        ("declares_too_much", "1e+15 rows; expected at most 100000000"),
        ("has_many_columns", "1000 columns; expected at most 256"),
    ],
)
def test_what_a_reader_does_wrong_is_one_message_about_the_file(reader: str, message: str, file: Path) -> None:
    with pytest.raises(InputError) as caught:
        opened(reader, file)
    assert message in str(caught.value) and str(caught.value).startswith("log.bin")
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(landlock_version() == 0, reason="this kernel has no Landlock")
@pytest.mark.parametrize(
    "reader",
    [
        "reads_another",
        "lists_the_folder",
        "writes_beside",
        "writes_into_it",
        "removes_it",
        "starts_a_program",
    ],
)
def test_a_reader_reaches_no_file_but_its_own(reader: str, file: Path) -> None:
    with pytest.raises(InputError, match="PermissionError"):
        opened(reader, file)
    assert file.read_text(encoding="ascii") == "rows" and {p.name for p in file.parent.iterdir()} == {
        "log.bin",
        "secret",
    }


def test_nothing_is_written_without_landlock_either(file: Path) -> None:
    """By the limit of a file's size: a file may be made, and holds nothing."""
    with pytest.raises(InputError):
        opened("writes_beside", file)
    made = file.parent / "made"
    assert not made.exists() or made.stat().st_size == 0


@pytest.mark.skipif(landlock_version() < 4, reason="Landlock of this kernel knows no network")
def test_a_reader_reaches_no_port(file: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        file.write_text(str(server.getsockname()[1]), encoding="ascii")
        with pytest.raises(InputError, match="PermissionError"):
            opened("calls_home", file)


@pytest.mark.skipif(landlock_version() < 6, reason="Landlock of this kernel knows no signals")
def test_a_reader_reaches_no_process(file: Path) -> None:
    file.write_text(str(os.getpid()), encoding="ascii")
    with pytest.raises(InputError, match="PermissionError"):
        opened("kills_others", file)


def test_a_file_is_read_and_its_process_gone_afterwards(file: Path) -> None:
    found = opened("reads_the_file", file)
    assert found.facts == {"read": "rows"}
    with closing(found):
        chunks = list(found.tables[0].chunks(["x"]))
        assert [len(chunk) for chunk in chunks] == [10] and chunks[0].columns["x"][9] == 9.0
        number = found.tables[0].worker._pid  # type: ignore[attr-defined]
        os.kill(number, 0)
    with pytest.raises(ProcessLookupError):
        os.kill(number, 0)


@pytest.mark.parametrize("case", BINARY_CASES, ids=lambda c: c.id)
def test_a_process_hands_back_what_the_library_reads(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Tables, columns and every value, as the same code gives them in this process."""
    if case.needs and importlib.util.find_spec(case.needs) is None:
        pytest.skip(f"{case.needs} is not installed")
    path = tmp_path / case.file
    case.write(path, truth())
    parsers: list[Parser] = []

    def confined(parser: Parser, path: Path) -> LoggerFile:
        parsers.append(parser)
        return open_confined(parser, path)

    monkeypatch.setattr(import_job, "open_confined", confined)
    with closing(import_job.open_logger_file(path, Map())) as there:
        module = importlib.import_module(parsers[0].module, "gyrotc.recordings")
        with closing(getattr(module, parsers[0].function)(path)) as here:
            assert (there.format, there.facts, there.since_power_on) == (
                here.format,
                here.facts,
                here.since_power_on,
            )
            for one, other in zip(there.tables, here.tables, strict=True):
                assert one.columns == other.columns
                assert (one.name, one.rate_hz, one.started) == (other.name, other.rate_hz, other.started)
                names = [column.name for column in one.columns]
                for got, expected in zip(one.chunks(names), other.chunks(names), strict=True):
                    assert (got.first, got.done) == (expected.first, expected.done)
                    for name in names:
                        np.testing.assert_array_equal(got.columns[name], expected.columns[name], strict=True)


def _recording(folder: Path) -> Path:
    columns = {name: np.arange(600.0) for name in ("time_s", "temperature_c", "rate_dph")}
    pq.write_table(pa.table(columns), folder / "run.parquet")
    return folder / "run.parquet"


def test_a_parquet_recording_is_read_in_a_process_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before: pyarrow read it in the job."""

    def never(*_: object, **__: object) -> None:
        raise AssertionError("read in this process")

    path = _recording(tmp_path)
    monkeypatch.setattr(pq, "ParquetFile", never)
    file = ParquetFile("sub/run.parquet", path)
    assert file.names == ("time_s", "temperature_c", "rate_dph")
    assert file.read(["rate_dph"])["rate_dph"].tolist() == list(range(600))
    path.write_bytes(path.read_bytes()[:-300] + bytes(300))
    with pytest.raises(InputError, match=r"^sub/run.parquet: cannot be read as Parquet"):
        ParquetFile("sub/run.parquet", path)


@pytest.mark.parametrize("rows", [599, 601])
def test_rows_that_were_not_stated_are_refused(rows: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = ParquetFile("run.parquet", _recording(tmp_path))
    monkeypatch.setattr(file, "_rows", rows)
    with pytest.raises(InputError, match="states"):
        file.read(file.names)


def test_a_server_that_was_ended_is_one_message_and_started_again(file: Path) -> None:
    """Before: the broken pipe to it counted as a closed standard output."""
    opened("reads_the_file", file).close()
    server = parser_process._server(os.getpid())
    server._process.kill()
    server._process.wait()
    with pytest.raises(InputError, match="its reader cannot be started"):
        opened("reads_the_file", file)
    opened("reads_the_file", file).close()
