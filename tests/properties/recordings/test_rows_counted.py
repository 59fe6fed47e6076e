"""No row of a logger's file is lost in silence: each is kept, left out under a named reason, or the file is refused."""

from __future__ import annotations

import gzip
import re
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from conftest import Command, run_gyrotc
from drawn import examples
from gyrotc.common import InputError
from gyrotc.recordings.importers import ImportOptions, Map, import_files
from gyrotc.results import Checked, ImportedFile, ImportedFiles, read_result
from hypothesis import given
from hypothesis import strategies as st
from logger_binaries import BINARY_CASES
from logger_files import Case, truth

NAMES = "time_s,temperature_c,rate_dph"
Row = Callable[[int], str]


def three(k: int) -> str:
    return f"{10 * k},{20.0 + 30.0 * abs(np.sin(k / 200)):.6f},{10.0 + 0.01 * np.sin(k * k):.6f}"


def four(k: int) -> str:
    return f"{three(k)},{5 + k % 2}.5"


def five(k: int) -> str:
    return f"{four(k)},1.0"


def worded(k: int) -> str:
    return f"{three(k)},OK"


def worded_five(k: int) -> str:
    return f"{three(k)},OK,5.1"


def tagged(k: int) -> str:
    return f"IMU,{three(k)}"


def tagged_five(k: int) -> str:
    return f"IMU,{four(k)}"


def swapped(k: int) -> str:
    time, temperature, rate = three(k).split(",")
    return f"{time},{rate},{temperature}"


def stamped(k: int) -> str:
    """Stamps of a form that is not known."""
    return f"Sun Mar 1 {k // 360:02d}:{k // 6 % 60:02d}:{k % 6}0 2026,{three(k).partition(',')[2]}"


def stamped_four(k: int) -> str:
    return f"{stamped(k)},5"


def quoted(row: str) -> str:
    return ",".join(f'"{cell}"' for cell in row.split(","))


def german(row: str) -> str:
    return row.replace(",", ";").replace(".", ",")


def blanks(row: str) -> str:
    return row.replace(",", "  ")


def rows(row: Row, first: int, last: int) -> list[str]:
    return [row(k) for k in range(first, last)]


def two_parts(
    row: Row,
    other: Row,
    *,
    names: str = NAMES,
    again: str = "",
    at: int = 200,
    end: int = 400,
    above: Sequence[str] = (),
) -> list[str]:
    return [
        *above,
        *[names] * bool(names),
        *rows(row, 0, at),
        *[again] * bool(again),
        *rows(other, at, end),
    ]


SUPPLY = f"{NAMES},supply_v"
PREAMBLE = ("Serial: RLG-9", "Range: 400, 500", "Start: 2026-03-01 08:00:00")


@dataclass(frozen=True)
class Change:
    """A file whose layout changes: text, the line that is named, and names for a second part that has none."""

    text: bytes
    line: int
    names: str = ""
    options: tuple[str, ...] = ()
    kept: tuple[int, int] = (200, 200)


def change(
    lines: Sequence[str],
    line: int,
    names: str = "",
    *options: str,
    end: str = "\n",
    **more: tuple[int, int],
) -> Change:
    return Change((end.join(lines) + end).encode(), line, names, options, **more)


LONG = (12_000, 200)
CHANGES = {
    "a column more": change(two_parts(three, four), 202, SUPPLY),
    "a column less": change(two_parts(four, three, names=SUPPLY), 202, NAMES),
    "names again, wider": change(two_parts(three, four, again=SUPPLY), 203),
    "names again, narrower": change(two_parts(four, three, names=SUPPLY, again=NAMES), 203),
    "names again, of the same width": change(two_parts(three, swapped, again="time_s,rate_dph,temperature_c"), 202),
    "names again after 20 rows": change(two_parts(three, four, again=SUPPLY, at=20), 23, kept=(20, 380)),
    "wider at the end": change(two_parts(three, four, at=380), 382, SUPPLY, kept=(380, 20)),
    "wider for the last 60 of many": change(
        two_parts(three, four, at=12_000, end=12_060), 12_002, SUPPLY, kept=(12_000, 60)
    ),
    "a column more after the head": change(two_parts(three, four, at=12_000, end=12_200), 12_002, SUPPLY, kept=LONG),
    "names again after the head": change(
        two_parts(three, four, again=SUPPLY, at=12_000, end=12_200), 12_002, kept=LONG
    ),
    "quotes around cells": change([quoted(line) for line in two_parts(three, four, again=SUPPLY)], 203),
    "semicolons and decimal commas": change([german(line) for line in two_parts(three, four, again=SUPPLY)], 203),
    "blanks between cells": change([blanks(line) for line in two_parts(three, four, again=SUPPLY)], 203),
    "another delimiter": change(
        [
            *two_parts(three, three, end=200),
            german(NAMES),
            *[r.replace(",", ";") for r in rows(three, 200, 400)],
        ],
        203,
    ),
    "words in the rows": change(
        two_parts(worded, worded_five, names=f"{NAMES},status"),
        202,
        f"{NAMES},status,supply_v",
    ),
    "words in the rows, names again": change(
        two_parts(
            worded,
            worded_five,
            names=f"{NAMES},status",
            again=f"{NAMES},status,supply_v",
        ),
        203,
    ),
    "rows that begin with a word": change(
        two_parts(tagged, tagged_five, names=f"tag,{NAMES}", again=f"tag,{SUPPLY}"), 203
    ),
    "comments between the rows": change(
        [
            NAMES,
            *rows(three, 0, 100),
            "# paused",
            *rows(three, 100, 200),
            "# supply",
            SUPPLY,
            *rows(four, 200, 400),
        ],
        205,
    ),
    "facts above the names": change(two_parts(three, four, above=PREAMBLE, again=SUPPLY), 206),
    "lines that end with CR and LF": change(two_parts(three, four, again=SUPPLY), 203, end="\r\n"),
    "stamps of an unknown form": change(
        two_parts(stamped, stamped_four, names="stamp,temperature_c,rate_dph"),
        202,
        "stamp,temperature_c,rate_dph,supply_v",
        "--set",
        "time.rate_hz=0.1",
    ),
}


def commands(message: str) -> list[str]:
    return re.findall(r"`([^`]+)`", message)


def imported(run: Command, path: Path, *options: str) -> ImportedFile:
    out = path.parent / f"{path.name}-out"
    done = run(
        "import",
        path,
        "--out",
        out,
        "--serial",
        "RLG-1",
        "--json",
        f"{out}.json",
        *options,
    )
    assert done.returncode == 0, done.stderr
    return read_result(Path(f"{out}.json"), ImportedFiles).runs[0]


@pytest.mark.parametrize("case", CHANGES)
def test_a_file_of_two_layouts_is_refused_with_the_commands_that_part_it(
    case: str, tmp_path: Path, gyrotc: Command
) -> None:
    """The commands are executed, and both parts come in with every row."""
    one = CHANGES[case]
    (tmp_path / "a log.csv").write_bytes(one.text)
    done = gyrotc("import", tmp_path / "a log.csv", "--out", tmp_path / "R", *one.options)
    assert done.returncode == 2, done.stdout
    assert f"a log.csv, line {one.line}" in done.stderr
    assert not (tmp_path / "R").exists()
    remedies = commands(done.stderr)
    assert len(remedies) == 2, done.stderr
    for command in remedies:
        subprocess.run(["sh", "-c", command], cwd=tmp_path, check=True)
    parts = [tmp_path / "a log.csv.1.csv", tmp_path / "a log.csv.2.csv"]
    assert ("needs a line of names" in done.stderr) == bool(one.names)
    if one.names:
        parts[1].write_text(f"{one.names}\n{parts[1].read_text()}")
    assert tuple(imported(gyrotc, part, *one.options).rows for part in parts) == one.kept


@pytest.mark.parametrize("edge", ["first", "middle", "last"])
def test_a_line_that_is_cut_is_refused_with_the_command_that_takes_it_out(
    edge: str, tmp_path: Path, gyrotc: Command
) -> None:
    lines = [NAMES, *rows(three, 0, 100)]
    at = {"first": 1, "middle": 50, "last": 100}[edge]
    lines[at] = lines[at].rpartition(",")[0]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    done = gyrotc("import", tmp_path / "a.csv", "--out", tmp_path / "R")
    assert done.returncode == 2
    assert f"a.csv, line {at + 1}: 2 cells" in done.stderr
    (command,) = commands(done.stderr)
    subprocess.run(["sh", "-c", command], cwd=tmp_path, check=True)
    assert imported(gyrotc, tmp_path / "a.csv.csv").rows == 99


OPTIONS = {
    "a word in the first rows": (
        [NAMES, "0,20.1,ERR", "10,20.2,ERR", *rows(three, 2, 400)],
        2,
        398,
        {"no number": 2},
    ),
    "a line of words at the end": (
        [NAMES, *rows(three, 0, 400), "Total rows: 400"],
        402,
        400,
        {},
    ),
}


@pytest.mark.parametrize("case", OPTIONS)
def test_the_option_that_a_refusal_names_goes_on(case: str, tmp_path: Path, gyrotc: Command) -> None:
    lines, line, kept, left = OPTIONS[case]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    done = gyrotc("import", tmp_path / "a.csv", "--out", tmp_path / "R")
    assert done.returncode == 2
    assert f"a.csv, line {line}" in done.stderr
    (option,) = re.findall(r'--set (csv\.\w+="[^"]+")', done.stderr)
    found = imported(gyrotc, tmp_path / "a.csv", "--set", option.replace('"', ""))
    assert found.rows == kept
    assert {reason[:9]: count for reason, count in found.left_out.items()} == left


QUOTES = {50: '"', 90: '"'}
COUNTED = {
    "rows behind a mark of comments": (
        [
            NAMES,
            *rows(three, 0, 100),
            "# paused",
            *["#" + row for row in rows(three, 100, 110)],
            *rows(three, 110, 210),
        ],
        {"behind a mark of comments": 10},
    ),
    "a quote that stays open": (
        [
            f"{NAMES},note",
            *[f"{three(k)},{QUOTES.get(k, '')}ok" for k in range(200)],
        ],
        {},
    ),
    "names that come again": (
        [NAMES, *rows(three, 0, 100), NAMES, *rows(three, 100, 200)],
        {"repeated header lines": 1},
    ),
    "a row that comes twice": (
        [NAMES, *rows(three, 0, 100), *rows(three, 99, 200)],
        {"copies of the row before": 1},
    ),
    "a row without a rate": (
        [NAMES, *rows(three, 0, 100), "1000,20,", *rows(three, 101, 201)],
        {"no number in rate_dph": 1},
    ),
    "facts above": ([*PREAMBLE, NAMES, *rows(three, 0, 200)], {}),
}


@pytest.mark.parametrize("case", COUNTED)
def test_what_is_left_out_is_counted(case: str, tmp_path: Path, gyrotc: Command) -> None:
    lines, left = COUNTED[case]
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    found = imported(gyrotc, tmp_path / "a.csv")
    assert found.rows == 200
    assert found.left_out == left
    assert found.above + found.read == sum(not line.startswith("# ") for line in lines)


def test_rows_above_names_that_were_stated_are_counted(tmp_path: Path, gyrotc: Command) -> None:
    (tmp_path / "a.csv").write_text("\n".join([*PREAMBLE, *two_parts(three, four, again=SUPPLY)]) + "\n")
    found = imported(gyrotc, tmp_path / "a.csv", "--set", "csv.header_line=205")
    assert found.rows == 200
    assert found.left_out == {"above the stated line of names": 200}


def test_a_packed_file_is_counted_too(tmp_path: Path, gyrotc: Command) -> None:
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress("\n".join([NAMES, *rows(three, 0, 50), NAMES]).encode()))
    found = imported(gyrotc, tmp_path / "a.csv.gz")
    assert (found.rows, found.read, found.left_out) == (
        50,
        51,
        {"repeated header lines": 1},
    )


def workbook(path: Path, *sheets: Sequence[str]) -> None:
    import openpyxl

    book = openpyxl.Workbook()
    book.remove(book.active)
    for lines in sheets:
        sheet = book.create_sheet()
        for line in lines:
            sheet.append([float(c) if re.fullmatch(r"[0-9.]+", c) else c for c in line.split(",")])
    book.save(path)


def test_rows_of_a_sheet_are_counted(tmp_path: Path, gyrotc: Command) -> None:
    workbook(
        tmp_path / "a.xlsx",
        [NAMES, *rows(three, 0, 30), NAMES, *rows(three, 30, 60)],
        ["notes"],
    )
    found = imported(gyrotc, tmp_path / "a.xlsx")
    assert (found.rows, found.read, found.left_out) == (
        60,
        61,
        {"repeated header lines": 1},
    )


def test_a_sheet_of_two_layouts_is_refused_with_what_to_do(tmp_path: Path, gyrotc: Command) -> None:
    workbook(tmp_path / "a.xlsx", two_parts(three, four, again=SUPPLY))
    done = gyrotc("import", tmp_path / "a.xlsx", "--out", tmp_path / "R")
    assert done.returncode == 2
    assert "line 202" in done.stderr and "moved to a sheet of their own" in done.stderr
    workbook(
        tmp_path / "b.xlsx",
        [NAMES, *rows(three, 0, 200)],
        [SUPPLY, *rows(four, 200, 400)],
    )
    assert imported(gyrotc, tmp_path / "b.xlsx", "--set", "table=Sheet").rows == 200
    assert imported(gyrotc, tmp_path / "b.xlsx", "--set", "table=Sheet1").rows == 200


DIGITS = "1" * 200_000 + "x"


@pytest.mark.parametrize("command", ["import", "check"])
def test_a_cell_of_many_digits_is_refused_at_once(command: str, tmp_path: Path, gyrotc: Command) -> None:
    """A pattern that backtracks over it would not end."""
    text = "\n".join([NAMES, *rows(three, 0, 20), f"200,20.1,{DIGITS}", *rows(three, 21, 40)]) + "\n"
    (tmp_path / "D").mkdir()
    (tmp_path / "D" / "a.csv").write_text(text)
    (tmp_path / "D" / "dataset.toml").write_text('schema = 1\nserial = "R"\n[[run]]\nfile = "a.csv"\n')
    given = {
        "import": ("import", tmp_path / "D" / "a.csv", "--out", tmp_path / "R"),
        "check": ("check", tmp_path / "D"),
    }
    done = gyrotc(*given[command])
    assert done.returncode == 2
    assert "line 22" in done.stdout + done.stderr


DAMAGES: dict[str, Callable[[list[str], int], None]] = {
    "cell less": lambda lines, k: lines.__setitem__(k, lines[k].rpartition(",")[0]),
    "cell more": lambda lines, k: lines.__setitem__(k, f"{lines[k]},7.5"),
    "cells more from here": lambda lines, k: lines.__setitem__(slice(k, None), [f"{line},7.5" for line in lines[k:]]),
    "names and cells more from here": lambda lines, k: lines.__setitem__(
        slice(k, None), [SUPPLY, *(f"{line},7.5" for line in lines[k:])]
    ),
    "cells less from here": lambda lines, k: lines.__setitem__(
        slice(k, None), [line.rpartition(",")[0] for line in lines[k:]]
    ),
    "semicolons from here": lambda lines, k: lines.__setitem__(
        slice(k, None), [line.replace(",", ";") for line in lines[k:]]
    ),
    "word": lambda lines, k: lines.__setitem__(k, f"{lines[k].rpartition(',')[0]},ERR"),
    "words": lambda lines, k: lines.insert(k, "ERR,ERR,ERR"),
    "other names": lambda lines, k: lines.insert(k, "time_s,rate_dph,temperature_c"),
    "quote": lambda lines, k: lines.__setitem__(k, lines[k].replace(",", ',"', 1)),
    "text": lambda lines, k: lines.insert(k, "Logger restarted: 3, 4"),
}
HARMLESS: dict[str, Callable[[list[str], int], None]] = {
    "blank line": lambda lines, k: lines.insert(k, ""),
    "comment": lambda lines, k: lines.insert(k, "# a remark"),
    "names": lambda lines, k: lines.insert(k, NAMES),
    "row behind a mark": lambda lines, k: lines.__setitem__(k, f"#{lines[k]}"),
    "empty cell": lambda lines, k: lines.__setitem__(k, f"{lines[k].rpartition(',')[0]},"),
    "row twice": lambda lines, k: lines.insert(k, lines[k]),
}
at_rows = st.integers(0, 59)
ends = st.sampled_from(["\n", "\r\n"])


def damaged(steps: Sequence[tuple[str, int]]) -> list[str]:
    body = rows(three, 0, 60)
    for name, k in steps:
        (DAMAGES | HARMLESS)[name](body, min(k, len(body) - 1))
    return body


def import_text(text: str) -> tuple[dict[str, int], dict[str, int], set[float]] | None:
    """Counts, reasons, and times that were kept; None where the file is refused."""
    with tempfile.TemporaryDirectory() as folder:
        path, out = Path(folder) / "a.csv", Path(folder) / "R"
        path.write_bytes(text.encode())
        try:
            done = import_files([path], out, Map(), ImportOptions(trust_units=True))
        except InputError:
            return None
        assert done is not None
        (run,) = done.result().runs
        times = pq.read_table(out / run.file)["time_s"].to_pylist()
        return (
            {"above": run.above, "read": run.read, "rows": run.rows},
            run.left_out,
            set(times),
        )


@given(
    steps=st.lists(st.tuples(st.sampled_from(sorted(DAMAGES | HARMLESS)), at_rows), max_size=3),
    end=ends,
)
@examples(150)
def test_every_line_of_a_damaged_file_is_counted_or_the_file_is_refused(steps: list[tuple[str, int]], end: str) -> None:
    body = damaged(steps)
    found = import_text(end.join([NAMES, *body]) + end)
    if found is not None:
        counts, left_out, times = found
        lines = [line for line in [NAMES, *body] if line and not line.startswith("#")]
        assert counts["above"] + counts["read"] == len(lines) + left_out.get("behind a mark of comments", 0)
        assert counts["read"] == counts["rows"] + sum(left_out.values())
        assert times >= {float(row.split(",")[0]) for row in set(body) & set(rows(three, 0, 60))}


@given(
    steps=st.lists(st.tuples(st.sampled_from(sorted(HARMLESS)), at_rows), max_size=5, unique_by=lambda step: step[1]),
    end=ends,
)
@examples(60)
def test_what_loggers_do_is_read(steps: list[tuple[str, int]], end: str) -> None:
    """From the last row on upwards, so that every step meets a row as it was."""
    downwards = sorted(steps, key=lambda step: -step[1])
    assert import_text(end.join([NAMES, *damaged(downwards)]) + end) is not None


def test_the_count_is_printed(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("\n".join([*PREAMBLE, NAMES, *rows(three, 0, 60), NAMES]) + "\n")
    done = run_gyrotc("import", tmp_path / "a.csv", "--out", tmp_path / "R")
    assert "61 read, 1 left out: repeated header lines; lines of text above them: 4" in done.stdout


BODIES: dict[str, bytes] = {}


def body_of(case: Case, folder: Path) -> bytes:
    """The bytes of a whole file, which is written once."""
    if case.id not in BODIES:
        case.write(folder / case.file, truth())
        BODIES[case.id] = (folder / case.file).read_bytes()
    return BODIES[case.id]


IN_PROCESS = [case for case in BINARY_CASES if case.file.endswith((".parquet", ".tdms"))]
IN_CHILDREN = [case for case in BINARY_CASES if case not in IN_PROCESS and not case.options]


def damaged_bytes(data: bytes, kind: str, at: float, mask: int) -> bytes:
    k = int(at * (len(data) - 1))
    return {
        "bit": data[:k] + bytes([data[k] ^ (1 << mask % 8)]) + data[k + 1 :],
        "end": data[: max(k, 1)],
        "zeros": data[:k] + bytes(min(mask, len(data) - k)) + data[k + mask :],
        "twice": data[:k] + data[max(k - mask, 0) :],
    }[kind]


def import_damaged(case: Case, kind: str, at: float, mask: int) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = folder / f"damaged-{case.file}"
        path.write_bytes(damaged_bytes(body_of(case, folder), kind, at, mask))
        try:
            done = import_files([path], folder / "R", Map(), ImportOptions(serial="R", trust_units=True))
        except InputError as error:
            assert error.where and error.found and error.expected
            return
        assert done is not None
        (run,) = done.result().runs
        assert run.read == run.rows + sum(run.left_out.values())
        assert pq.read_metadata(folder / "R" / run.file).num_rows == run.rows


damages = {
    "kind": st.sampled_from(["bit", "end", "zeros", "twice"]),
    "at": st.floats(0.0, 1.0),
    "mask": st.integers(1, 400),
}


@given(case=st.sampled_from(IN_PROCESS), **damages)
@examples(200)
def test_a_damaged_file_is_counted_or_refused(case: Case, kind: str, at: float, mask: int) -> None:
    import_damaged(case, kind, at, mask)


@given(case=st.sampled_from(IN_CHILDREN), **damages)
@examples(8)
def test_a_damaged_file_of_a_child_is_counted_or_refused(case: Case, kind: str, at: float, mask: int) -> None:
    import_damaged(case, kind, at, mask)


@pytest.mark.parametrize("lost", [100, 1000])
def test_a_tdms_file_that_ends_early_is_said_to(lost: int, tmp_path: Path, gyrotc: Command) -> None:
    """The library reads what is there of the last segment, and only logs that it states more."""
    case = next(case for case in BINARY_CASES if case.file == "wave.tdms")
    (tmp_path / "cut.tdms").write_bytes(body_of(case, tmp_path)[:-lost])
    done = gyrotc("import", tmp_path / "cut.tdms", "--out", tmp_path / "R")
    assert (done.returncode == 2) or "the file ends within its last segment" in done.stdout
    assert "WARNING" not in done.stderr


def test_the_count_of_check_closes(tmp_path: Path, gyrotc: Command) -> None:
    """Cells that are NaN, rows whose temperature would come behind the end, and an excluded span."""
    body = [row.split(",") for row in rows(three, 0, 300)]
    for k in (5, 6, 50):
        body[k][1] = "nan"
    body[80][2] = "nan"
    (tmp_path / "D").mkdir()
    (tmp_path / "D" / "a.csv").write_text("\n".join([NAMES, *(",".join(row) for row in body)]) + "\n")
    (tmp_path / "D" / "dataset.toml").write_text(
        'schema = 1\nserial = "R"\nearth_rate = "removed"\ntemperature_late_s = 100.0\n'
        '[[run]]\nfile = "a.csv"\nexclude = [{from_s = 1000.0, to_s = 1050.0}]\n'
    )
    assert gyrotc("check", tmp_path / "D", "--json", tmp_path / "check.json").returncode == 0
    (run,) = read_result(tmp_path / "check.json", Checked).runs
    assert run.rows.read == 300
    assert run.rows.kept + sum(run.rows.left_out.values()) == 300
    assert run.rows.left_out == {
        "excluded": 5,
        "no rate": 1,
        "no temperature": 3,
        "no temperature temperature_late_s later": 10,
    }
