"""`gyrotc verify`: passes what is right, and fails on every single spoilt bit."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Command
from emitted import emitted, entries, flip, recorded, spoil
from gyrotc.common.errors import CheckFailed, InputError
from gyrotc.tables.emit import expected_answers
from gyrotc.verify import job as package
from gyrotc.verify.board_log import compared_words, read_output
from gyrotc.verify.job import verify
from gyrotc.verify.toolchain import Target, all_targets, compile_c, run_program

FAST = "host-gcc-O0"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return emitted(tmp_path_factory.mktemp("whole"))


@pytest.fixture
def copy(whole: Path, tmp_path: Path) -> Path:
    """A copy that a test may spoil."""
    return Path(shutil.copytree(whole, tmp_path / "copy"))


@pytest.mark.slow
def test_every_target_of_the_common_tools_agrees_in_every_bit(whole: Path) -> None:
    """Two byte orders, two word lengths, hardware, software and double evaluation of float."""
    names = ["cortex-m0", "cortex-m4f", "s390x", *(n for n in all_targets() if n.startswith("host-"))]
    result = verify(whole, targets=names).content()
    assert result["failed"] == 0 and result["missing"] == 0
    for entry in result["targets"]:
        assert (entry["status"], entry["mismatches"]) == ("pass", 0), entry
        assert entry["vectors"] >= 20000
        assert entry["ram_bytes"] == 0
        assert (
            entry["code_bytes"] > 0
        )  # how many is the compiler's decision: clang 14 at -O3 makes 68,042 on a host
    for name in ("cortex-m0", "cortex-m4f"):
        for entry in (e for e in result["targets"] if e["name"] == name):
            cost = entry["instructions"]
            assert 0 < cost["min"] <= cost["mean"] <= cost["max"]
            assert entry["stack_bytes"] > 0
    assert result["worst_error_dph"]["value"] <= result["error_bound_dph"]


def test_a_flipped_bit_of_the_table_fails(copy: Path) -> None:
    flip(next((copy / "c").glob("gtc_rlg_0042.c")), r"\.crc = 0x([0-9a-f]{8})")
    for entry in entries(copy, FAST).values():
        if entry["numeric"] == "f32":
            assert entry["status"] == "fail" and entry["mismatches"] == 1
            assert entry["first_mismatches"][0].startswith("vector 0: status fffffffc")


def test_a_flipped_bit_of_a_weight_fails(copy: Path) -> None:
    """The last bit of one float32 constant: the checksum and the results show it."""
    path = copy / "c" / "gtc_rlg_0042.c"
    text = path.read_text()
    match = re.search(r"f32_centers\[.*\n(?: */\*.*\n)* *V\((-?[0-9.e+-]+)F\)", text)
    assert match is not None
    value = np.float32(match[1])
    changed = (value.view(np.uint32) ^ np.uint32(1)).view(np.float32)
    path.write_text(text[: match.start(1)] + f"{changed:.9g}" + text[match.end(1) :])
    entry = entries(copy, FAST)[FAST, "f32"]
    assert entry["status"] == "fail" and entry["mismatches"] >= 1


@pytest.mark.slow
def test_a_flipped_bit_of_a_vector_fails(copy: Path) -> None:
    flip(copy / "c" / "vectors_rlg_0042.h", r"VECTORS_SEED 0x([0-9a-f]{8})UL", bit=7)
    for entry in entries(copy, FAST).values():
        assert entry["status"] == "fail" and entry["mismatches"] > 1000


def test_a_flipped_bit_of_the_emitted_answers_fails(copy: Path) -> None:
    flip(copy / "c" / "vectors_rlg_0042.txt", r"\n[0-9a-f]{8} ([0-9a-f]{8})\n", bit=31)
    result = verify(copy, targets=[FAST], trust_code=True).content()
    assert result["failed"] == 1 and result["passed"] >= 1
    assert [e["mismatches"] for e in result["emitted"] if e["status"] == "fail"] == [1]


@pytest.mark.slow
def test_a_flipped_bit_of_the_image_fails(copy: Path) -> None:
    path = copy / "c" / "gtc_rlg_0042.bin"
    data = bytearray(path.read_bytes())
    data[40] ^= 16
    path.write_bytes(data)
    result = verify(copy, targets=[FAST], trust_code=True).content()
    assert result["failed"] == 1
    assert {e["file"]: e["mismatches"] for e in result["emitted"]}[path.name] == 1


@pytest.mark.slow
def test_a_flipped_bit_of_the_reference_fails(whole: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong(*arguments: Any) -> dict[str, np.ndarray]:
        words = {numeric: rows.copy() for numeric, rows in expected_answers(*arguments).items()}
        for rows in words.values():
            rows[12345, 1] ^= 1
        return words

    monkeypatch.setattr(package, "expected_answers", wrong)
    for entry in entries(whole, FAST).values():
        assert entry["mismatches"] == 1
        assert entry["first_mismatches"][0].startswith("vector 12345: ")


def test_a_program_that_stops_half_way_is_no_pass(copy: Path) -> None:
    spoil(
        copy / "c" / "board_test.c", r"static void end\(void\)\n\{", "static void end(void)\n{\n    return;"
    )
    for entry in entries(copy, FAST).values():
        assert entry["status"] == "fail" and "did not run to its end" in entry["error"]


def test_code_that_does_not_compile_is_no_pass(copy: Path) -> None:
    spoil(copy / "c" / "gtc.c", r"\bGTC_E_LAYOUT;", "GTC_E_LAYOUT + nonsense;")
    for entry in entries(copy, FAST).values():
        assert entry["status"] == "fail" and "nonsense" in entry["error"]


@pytest.mark.slow
def test_a_missing_default_target_is_listed_and_a_missing_named_one_fails(
    whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    absent = Target(name="absent", compiler="no-such-compiler", package="some-package", default=True)
    known = {FAST: all_targets()[FAST], "absent": absent}
    monkeypatch.setattr(package, "all_targets", lambda: known)
    for names, failed in (((), 0), (("all",), 0), (("absent",), 1), (("all", "absent"), 1)):
        result = verify(whole, targets=names).content()
        missing = [e for e in result["targets"] if e["status"] == "missing"]
        assert {e["name"] for e in missing} == {"absent"}
        assert {e["package"] for e in missing} == {"some-package"}
        assert result["missing"] == len(missing)
        assert (result["failed"] > 0) == bool(failed)


@pytest.mark.slow
def test_recordings_are_streamed_to_every_target_that_reads(copy: Path, tmp_path: Path) -> None:
    """Host, emulated board, the other byte order; a wrong constant of the front end is seen in the rows."""
    names = [FAST, "cortex-m4f", "s390x"]
    dataset = recorded(tmp_path / "recordings")
    for entry in verify(copy, targets=names, dataset=dataset).content()["targets"]:
        assert entry["status"] == "pass"
        assert entry["replayed"] == {"runs": 2, "rows": 1714, "mismatches": 0, "first_mismatches": []}
    spoil(copy / "c" / "gtc.c", r"#define GUARD_AGREE 4U", "#define GUARD_AGREE 5U", count=0)
    for entry in verify(copy, targets=[FAST], dataset=dataset, trust_code=True).content()["targets"]:
        assert entry["status"] == "fail" and entry["mismatches"] > 0


def test_exit_status_of_the_command(copy: Path, gyrotc: Command) -> None:
    assert gyrotc("verify", copy, "--target", FAST).returncode == 0
    unknown = gyrotc("verify", copy, "--target", "pdp-11")
    assert unknown.returncode == 2 and "cortex-m4f" in unknown.stderr
    bare = gyrotc("verify", copy.parent)
    assert bare.returncode == 2
    flip(copy / "c" / "vectors_rlg_0042.h", r"VECTORS_SEED 0x([0-9a-f]{8})UL")
    spoilt = gyrotc("verify", copy, "--target", FAST)
    assert spoilt.returncode == 1 and "reference" in spoilt.stdout
    assert json.loads((copy / "verify.json").read_text())["failed"] >= 1


def test_named_target_without_its_compiler_exits_1_and_names_the_package(copy: Path) -> None:
    """The command with a PATH on which there is nothing."""
    command = [str(Path(sys.executable).with_name("gyrotc")), "verify", str(copy), "--target", "s390x"]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, env={"PATH": str(copy), "COLUMNS": "200"}
    )
    assert done.returncode == 1
    named = [line for line in done.stdout.splitlines() if "s390x" in line]
    assert named == [
        "not installed: s390x: apt-get install gcc-s390x-linux-gnu libc6-dev-s390x-cross qemu-user"
    ], "one line, no rows of the table"


# ---- the board test's own output ----


def _board_output(folder: Path, *defines: str) -> str:
    target = all_targets()[FAST]
    work = folder / "work"
    work.mkdir(exist_ok=True)
    c = folder / "c"
    sources = [c / "board_test.c", c / "gtc.c", c / "gtc_rlg_0042.c"]
    compile_c(target, sources, work / "board", include=c, defines=defines)
    return run_program(target, work / "board").stdout.decode("ascii")


def test_log_of_a_board_is_checked_and_kept(copy: Path, gyrotc: Command) -> None:
    log = copy / "bench.log"
    text = _board_output(copy, 'BOARD_NAME="bench 7, iar 9"', "BOARD_VECTORS=777")
    log.write_text("login:\r\n" + text.replace("\n", "\r\n") + "\r\n$ ")
    assert gyrotc("verify", copy, "--target", FAST).returncode == 0
    assert gyrotc("verify", copy, "--log", log).returncode == 0
    result = json.loads((copy / "verify.json").read_text())
    boards = [e for e in result["targets"] if e["name"] == "bench 7, iar 9"]
    assert boards and all(e["status"] == "pass" and 777 < e["vectors"] < 10000 for e in boards)
    assert {e["name"] for e in result["targets"]} == {"bench 7, iar 9", FAST}
    # A later run keeps what a board has shown of the same model and code ...
    verify_again = verify(copy, targets=[FAST]).content()
    assert any(e["name"] == "bench 7, iar 9" for e in verify_again["targets"])
    # ... and drops it with the code.
    spoil(copy / "c" / "main.c", "return 1;", "return 3;")
    assert {e["name"] for e in verify(copy, targets=[FAST]).content()["targets"]} == {FAST}


@pytest.mark.parametrize("crc", [False, True], ids=["all", "crc"])
def test_log_with_one_wrong_digit_fails(copy: Path, gyrotc: Command, crc: bool) -> None:
    lines = _board_output(copy, f"BOARD_CRC={int(crc)}").splitlines()
    k = 40 if crc else 4000
    lines[k] = lines[k][:-1] + ("0" if lines[k][-1] != "0" else "1")
    log = copy / "bench.log"
    log.write_text("\n".join(lines) + "\n")
    done = gyrotc("verify", copy, "--log", log)
    assert done.returncode == 1
    entry = json.loads((copy / "verify.json").read_text())["targets"][0]
    assert entry["status"] == "fail"
    assert entry["mismatches"] == (256 if crc else 1)


def test_log_that_is_damaged_cut_off_or_foreign_is_refused(copy: Path) -> None:
    text = _board_output(copy, "BOARD_CRC=1")
    lines = text.splitlines()
    cases = {
        "cut off": "\n".join(lines[:30]),
        "a line lost": "\n".join(lines[:20] + lines[21:]),
        "a digit lost": "\n".join([*lines[:20], lines[20][1:], *lines[21:]]),
        "another model": re.sub(r" crc [0-9a-f]{8}", " crc 01234567", text),
        "empty": "",
    }
    log = copy / "bench.log"
    for name, content in cases.items():
        log.write_text(content)
        with pytest.raises((CheckFailed, InputError), match=r"bench\.log"):
            pytest.fail(f"{name}: {verify(copy, log=log)}")
    with pytest.raises(InputError, match=r"absent\.log"):
        verify(copy, log=copy / "absent.log")


@pytest.mark.slow
def test_groups_of_a_crc_log_are_compared_each(whole: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(whole, tmp_path / "copy"))
    everything = {p.numeric: p for p in read_output(_board_output(folder))}
    groups = {p.numeric: p for p in read_output(_board_output(folder, "BOARD_CRC=1"))}
    for numeric, part in groups.items():
        expected = everything[numeric].words
        assert compared_words(part, expected).mismatches == 0
        wrong = expected.copy()
        wrong[-1, 1] ^= 0x80000000
        wrong[-1, 0] ^= 0x80000000
        assert compared_words(part, wrong).mismatches == len(expected) - 256 * (len(expected) // 256)
        with pytest.raises(CheckFailed, match="instead of"):
            compared_words(part, expected[:-1])


def test_unknown_target_names_the_known_ones(whole: Path) -> None:
    with pytest.raises(InputError, match="cortex-m4f"):
        verify(whole, targets=["z80"])
