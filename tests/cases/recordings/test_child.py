"""Whatever a file of a logger holds, it is read or refused within limits: a child process has them."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import readers_that_misbehave
from conftest import ROOT, Command
from gyrotc.common import InputError
from gyrotc.recordings import LoggerFile, ParquetFile, open_in_child
from gyrotc.recordings.importers import format_of
from logger_binaries import BINARY_CASES
from logger_files import Case, truth

MOVED = "memory_gib=0.25 parser_s=1"


def opened(reader: str, path: Path) -> LoggerFile:
    return open_in_child(getattr(readers_that_misbehave, reader), path)


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


def test_a_file_is_read_part_by_part(file: Path) -> None:
    found = opened("reads_the_file", file)
    assert found.facts == {"read": "rows"}
    with closing(found):
        chunks = list(found.tables[0].chunks(["x"]))
        assert [len(chunk) for chunk in chunks] == [10] and chunks[0].columns["x"][9] == 9.0


@pytest.mark.parametrize("case", BINARY_CASES, ids=lambda c: c.id)
def test_a_child_hands_back_what_the_library_reads(case: Case, tmp_path: Path) -> None:
    """Tables, columns and every value, as the same code gives them in this process."""
    path = tmp_path / case.file
    case.write(path, truth())
    kind = format_of(path, path.read_bytes()[:1024])
    assert kind is not None
    with closing(open_in_child(kind.open, path)) as there, closing(kind.open(path)) as here:
        assert (there.format, there.facts) == (here.format, here.facts)
        for one, other in zip(there.tables, here.tables, strict=True):
            assert one.columns == other.columns
            assert (one.name, one.rate_hz, one.started) == (other.name, other.rate_hz, other.started)
            assert one.place(3) == other.place(3)
            names = [column.name for column in one.columns]
            for got, expected in zip(one.chunks(names), other.chunks(names), strict=True):
                assert (got.first, got.done) == (expected.first, expected.done)
                for name in names:
                    np.testing.assert_array_equal(got.columns[name], expected.columns[name], strict=True)


def test_a_damaged_recording_is_refused_by_its_name(tmp_path: Path) -> None:
    columns = {name: np.arange(600.0) for name in ("time_s", "temperature_c", "rate_dph")}
    path = tmp_path / "run.parquet"
    pq.write_table(pa.table(columns), path)
    file = ParquetFile("sub/run.parquet", path)
    assert file.names == ("time_s", "temperature_c", "rate_dph")
    assert file.read(["rate_dph"])["rate_dph"].tolist() == list(range(600))
    path.write_bytes(path.read_bytes()[:-300] + bytes(300))
    with pytest.raises(InputError, match=r"^sub/run.parquet: cannot be read as Parquet"):
        ParquetFile("sub/run.parquet", path)


def test_a_long_text_that_is_packed_into_few_bytes_is_refused(tmp_path: Path, gyrotc: Command) -> None:
    """400 rows of 16 MB each take 6.4 GB once unpacked."""
    rows = 400
    text = pa.DictionaryArray.from_arrays(pa.array(np.zeros(rows, dtype=np.int32)), pa.array(["x" * 2**24]))
    numbers = {name: np.arange(float(rows)) for name in ("time_s", "temperature_c", "rate_dph")}
    pq.write_table(pa.table(numbers | {"serial": text}), tmp_path / "a.parquet", compression="zstd", store_schema=False)
    assert (tmp_path / "a.parquet").stat().st_size < 2**15
    done = gyrotc("import", tmp_path / "a.parquet", "--out", tmp_path / "R")
    assert done.returncode == 2
    assert "a.parquet, column serial: a text of 16777216 characters" in done.stderr


TESTS = ROOT / "tests" / "support"
SEED = 26
MOST_S, MOST_MIB = 30.0, 4096.0
_CALL = re.compile(r'\b(\w+)\((?:AT_FDCWD, |\d+(?:<[^>]*>)?, )?"([^"]*)"(.*)\) = (-?\d+)')
_CHANGING = {
    "unlink", "unlinkat", "rename", "renameat", "renameat2", "mkdir", "mkdirat", "rmdir", "link", "linkat", "symlink",
    "symlinkat", "truncate", "chmod", "fchmodat", "mknod", "mknodat",
}  # fmt: skip


def _opened(log: Path) -> Iterator[tuple[str, Path, bool]]:
    """Call, path and whether it writes, of each call that did what it should."""
    for line in log.read_text("utf-8", "replace").splitlines():
        call = _CALL.search(line)
        if call and int(call[4]) >= 0 and call[2].startswith("/"):
            name, path, rest = call[1], Path(os.path.normpath(call[2])), call[3]
            if name in ("open", "openat", "openat2", "creat"):
                yield name, path, bool(re.search(r"O_WRONLY|O_RDWR|O_CREAT|O_TRUNC", rest))
            elif name in _CHANGING:
                yield name, path, True


def _foreign(log: Path, folder: Path) -> Iterator[str]:
    """Calls that read or wrote what is neither the input, nor the output, nor Python's own."""
    own = [folder, *(Path(p) for p in ("/dev/null", "/dev/shm", "/tmp", os.environ.get("TMPDIR", "/tmp")))]
    python = [Path(p).resolve() for p in (sys.prefix, sys.base_prefix, sysconfig.get_path("stdlib"), ROOT)]
    system = [Path(p) for p in ("/usr", "/lib", "/lib64", "/etc", "/proc", "/sys", "/dev/urandom", "/dev/null", "/bin")]
    for name, path, writes in _opened(log):
        places = own if writes else [*own, *python, Path(sys.prefix), *system]
        caches = path.suffix in (".pyc",) or "__pycache__" in path.parts
        if not caches and not any(path == place or place in path.parents for place in places):
            yield f"{name} {path}"
        if path.name == "years-of-work" and not writes:
            yield f"{name} {path}"


def test_hostile_files_are_read_or_refused_within_limits(tmp_path: Path) -> None:
    print(f"seed {SEED}")
    count = int(os.environ.get("GYROTC_HOSTILE_FILES", "24"))
    command = [sys.executable, "hostile_files.py", str(tmp_path / "work"), str(count), str(SEED)]
    log = tmp_path / "calls.txt"
    assert shutil.which("strace"), "strace is not installed: tools/setup.sh test installs it"
    command = ["strace", "-f", "-qq", "-e", "trace=%file", "-o", str(log), *command]
    (tmp_path / "work").mkdir()
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join((str(TESTS), str(TESTS.parent))),
        "XDG_CACHE_HOME": str(tmp_path / "work" / "cache"),
    }
    done = subprocess.run(command, cwd=TESTS, env=environment, capture_output=True, text=True, check=False)
    results = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    assert len(results) == count, done.stderr[-2000:]
    print(Counter(one["status"] for one in results), f"slowest {max(one['seconds'] for one in results):.1f} s")
    assert [one for one in results if one["status"] not in (0, 2)] == []
    assert [one for one in results if one["seconds"] > MOST_S] == []
    assert max(one["own_mib"] for one in results) <= MOST_MIB
    calls = sum(1 for _ in _opened(log))
    assert calls > count, "nothing was traced"
    assert sorted(set(_foreign(log, tmp_path))) == []
