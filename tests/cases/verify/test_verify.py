"""`gyrotc verify`: passes what is right, fails on every spoilt bit, compares every file and every line of a log."""

from __future__ import annotations

import json
import random
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Command
from emitted import GOLDEN, board_folder, emitted, entries, flip, recorded, spoil
from gyrotc.common import CheckFailed, InputError
from gyrotc.jobs import axes_in, joint_texts, verify_axes
from gyrotc.model import load_model
from gyrotc.tables import emit, expected_answers
from gyrotc.verify import Target, all_targets, compared_words, compile_c, read_output, run_program, verify
from gyrotc.verify import job as package
from jobs import job_of

FAST = "host-gcc-O0"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return emitted(tmp_path_factory.mktemp("whole"))


@pytest.fixture
def copy(whole: Path, tmp_path: Path) -> Path:
    """A copy that a test may spoil."""
    return Path(shutil.copytree(whole, tmp_path / "copy"))


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


def test_a_flipped_bit_of_the_image_fails(copy: Path) -> None:
    path = copy / "c" / "gtc_rlg_0042.bin"
    data = bytearray(path.read_bytes())
    data[40] ^= 16
    path.write_bytes(data)
    result = verify(copy, targets=[FAST], trust_code=True).content()
    assert result["failed"] == 1
    assert {e["file"]: e["mismatches"] for e in result["emitted"]}[path.name] == 1


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
    for numeric in ("f32", "q31"):
        head = rf"(int gtc_{numeric}_bias\([^;{{]*\{{\n)"
        spoil(copy / "c" / f"gtc_{numeric}.c", head, r"extern void exit(int);\n\1    exit(0);\n")
    for entry in entries(copy, FAST).values():
        assert entry["status"] == "fail" and "did not run to its end" in entry["error"]


def test_code_that_does_not_compile_is_no_pass(copy: Path) -> None:
    for numeric in ("f32", "q31"):
        spoil(copy / "c" / f"gtc_{numeric}.c", r"\bGTC_E_LAYOUT;", "GTC_E_LAYOUT + nonsense;")
    for entry in entries(copy, FAST).values():
        assert entry["status"] == "fail" and "nonsense" in entry["error"]


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


def test_recordings_are_streamed_to_every_target_that_reads(copy: Path, tmp_path: Path) -> None:
    """Host, emulated board, the other byte order; a wrong constant of the front end is seen in the rows."""
    names = [FAST, "cortex-m4f", "s390x"]
    dataset = recorded(tmp_path / "recordings")
    for entry in verify(copy, targets=names, dataset=dataset).content()["targets"]:
        assert entry["status"] == "pass"
        assert entry["replayed"] == {"runs": 2, "rows": 1714, "mismatches": 0, "first_mismatches": []}
    for numeric in ("f32", "q31"):
        spoil(copy / "c" / f"gtc_{numeric}.c", r"#define GUARD_AGREE 4U", "#define GUARD_AGREE 5U")
    for entry in verify(copy, targets=[FAST], dataset=dataset, trust_code=True).content()["targets"]:
        assert entry["status"] == "fail" and entry["mismatches"] > 0


def test_exit_status_of_the_command(copy: Path, gyrotc: Command) -> None:
    assert gyrotc("verify", copy, "--target", FAST).returncode == 0
    unknown = gyrotc("verify", copy, "--target", "pdp-11")
    assert unknown.returncode == 2 and "cortex-m4f" in unknown.stderr
    bare = gyrotc("verify", copy.parent)
    assert bare.returncode == 2
    flip(copy / "c" / "gtc_rlg_0042.c", r"B\(0x([0-9a-f]{8})UL\)")
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
    assert named == ["not installed: s390x: apt-get install gcc-s390x-linux-gnu libc6-dev-s390x-cross qemu-user"], (
        "one line, no rows of the table"
    )


# ---- the board test's own output ----


def _board_output(folder: Path, *defines: str) -> str:
    target = all_targets()[FAST]
    work = folder / "work"
    work.mkdir(exist_ok=True)
    c = folder / "c"
    board_test = board_folder(work, load_model(folder / "model.json")) / "board_test.c"
    sources = [board_test, c / "gtc_f32.c", c / "gtc_q31.c", c / "gtc_rlg_0042.c"]
    compile_c(target, sources, work / "board", include=c, defines=defines)
    return run_program(target, work / "board").stdout.decode("ascii")


def test_log_of_a_board_is_checked_and_kept(copy: Path, gyrotc: Command) -> None:
    log = copy.parent / "bench.log"
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
    # ... and drops it with the code, which it says.
    spoil(copy / "c" / "main.c", "return 1;", "return 3;")
    found = verify(copy, targets=[FAST]).content()
    assert {e["name"] for e in found["targets"]} == {FAST} and found["outdated_boards"] == ["bench 7, iar 9"]
    assert verify(copy, log=log).content()["outdated_boards"] == [], "the board has run again"
    assert "bench 7, iar 9: ran another model or other code" in gyrotc("verify", copy, "--target", FAST).stdout


def test_a_damaged_earlier_result_is_not_dropped_without_a_word(copy: Path) -> None:
    """It may hold what a board printed, which nobody can make again from the folder."""
    (copy / "verify.json").write_text('{"schema": "gyrotc.verify/1", "targets": ')
    with pytest.raises(InputError, match=r"verify\.json"):
        verify(copy, targets=[FAST])


@pytest.mark.parametrize("crc", [False, True], ids=["all", "crc"])
def test_log_with_one_wrong_digit_fails(copy: Path, gyrotc: Command, crc: bool) -> None:
    lines = _board_output(copy, f"BOARD_CRC={int(crc)}").splitlines()
    k = 40 if crc else 4000
    lines[k] = lines[k][:-1] + ("0" if lines[k][-1] != "0" else "1")
    log = copy.parent / "bench.log"
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
    log = copy.parent / "bench.log"
    for name, content in cases.items():
        log.write_text(content)
        with pytest.raises((CheckFailed, InputError), match=r"bench\.log"):
            pytest.fail(f"{name}: {verify(copy, log=log)}")
    with pytest.raises(InputError, match=r"absent\.log"):
        verify(copy, log=copy / "absent.log")


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


Spoil = Callable[[Path], object]


def _wrong(folder: Path, **options: object) -> dict[str, str]:
    """Files that are not as they should be, with the verdict; the in-memory part alone."""
    result = verify(folder, compiled=False, **options).content()  # type: ignore[arg-type]
    wrong = {e["file"]: e["verdict"] for e in result["emitted"] if e["status"] == "fail"}
    assert result["failed"] == len(wrong)
    return wrong


def _hex_with_another_weight(c: Path) -> None:
    """A weight changed in the Intel HEX image; checksum of its record and CRC-32 of the image mended."""
    import struct
    import zlib

    path = c / "gtc_rlg_0042.hex"
    lines = path.read_text().split()
    data = bytearray(b"".join(bytes.fromhex(line[9:-2]) for line in lines[:-1]))
    data[len(data) // 2] ^= 1
    data[-4:] = struct.pack("<I", zlib.crc32(bytes(data[4:-4])))
    for k, line in enumerate(lines[:-1]):
        body = bytes.fromhex(line[1:9]) + bytes(data[16 * k : 16 * k + 16])
        lines[k] = ":" + (body + bytes([-sum(body) & 255])).hex().upper()
    path.write_text("\n".join(lines) + "\n")


def _at_start(function: str, statement: str) -> Spoil:
    """A statement put at the start of a function of the runtime."""
    head = rf"(int gtc_f32_{function}\([^;{{]*\{{\n)"
    return lambda c: spoil(c / "gtc_f32.c", head, rf"\1    {statement}\n")


def _id_in_header(c: Path) -> None:
    flip(c / "gtc_rlg_0042.h", r"_ID 0x([0-9a-f]{8})UL")


TAMPERED: dict[str, tuple[str, Spoil]] = {
    "weight in HEX": ("gtc_rlg_0042.hex", _hex_with_another_weight),
    "HEX removed": ("gtc_rlg_0042.hex", lambda c: (c / "gtc_rlg_0042.hex").unlink()),
    "id in header": ("gtc_rlg_0042.h", _id_in_header),
    "envelope in comment": ("gtc_rlg_0042.h", lambda c: spoil(c / "gtc_rlg_0042.h", "68.01 C", "98.01 C")),
    "block in comment": ("gtc_rlg_0042.h", lambda c: spoil(c / "gtc_rlg_0042.h", "Block:       10", "Block: 20")),
    "bound in comment": ("gtc_rlg_0042.h", lambda c: spoil(c / "gtc_rlg_0042.h", r"<= 1\.\d+e-0", "<= 1.00e-1")),
    "serial in table": ("gtc_rlg_0042.c", lambda c: spoil(c / "gtc_rlg_0042.c", "0x32343030UL", "0x33343030UL")),
    "open accepts anything": ("gtc_f32.c", _at_start("open", "return GTC_OK;")),
    "blind check": ("gtc_f32.c", _at_start("check", "return GTC_OK;")),
    "restore takes foreign states": ("gtc_f32.c", _at_start("restore", "return GTC_OK;")),
    "angle loses its remainder": (
        "gtc_q31.c",
        lambda c: spoil(c / "gtc_q31.c", r"(int gtc_q31_angle\([^;{]*\{\n)", r"\1    return GTC_OK;\n"),
    ),
    "manual of the runtime": ("gtc.h", lambda c: spoil(c / "gtc.h", "GTC_CLAMPED", "GTC_CLAMPED ")),
    "options in the record": (
        "emission.json",
        lambda c: spoil(c / "emission.json", '"zero_at_c": null', '"zero_at_c": 20.0'),
    ),
    "record removed": ("emission.json", lambda c: (c / "emission.json").unlink()),
    "a symbolic link": (
        "main.c",
        lambda c: (shutil.move(c / "main.c", c.parent / "m.c"), (c / "main.c").symlink_to("../m.c")),
    ),
    "a header that hides the compiler's": ("stdint.h", lambda c: (c / "stdint.h").write_text("")),
}  # fmt: skip


@pytest.mark.parametrize("name", TAMPERED)
def test_a_tampered_file_is_named(name: str, copy: Path) -> None:
    file, tamper = TAMPERED[name]
    tamper(copy / "c")
    assert file in _wrong(copy)


def test_what_was_emitted_passes_with_any_options(tmp_path: Path) -> None:
    model = load_model(GOLDEN)
    for numerics in (None, ["f32"], ["q31", "f32"]):
        for zero_at in (None, 20.0, -0.1):
            emit(model, tmp_path, numerics=numerics, zero_at=zero_at)
            assert _wrong(tmp_path) == {}


def test_any_flipped_byte_of_any_file_is_seen(copy: Path) -> None:
    """Also one dropped and one added byte, in comments as in images."""
    seed = random.SystemRandom().randrange(2**32)
    print(f"seed {seed}")
    draw = random.Random(seed)
    files = sorted(path for path in (copy / "c").iterdir() if path.name != "main.c")  # the user's to edit
    for file in files * 5:
        right = file.read_bytes()
        at = draw.randrange(len(right))
        change = draw.choice((b"", right[at : at + 1] * 2, bytes([right[at] ^ draw.randrange(1, 256)])))
        file.write_bytes(right[:at] + change + right[at + 1 :])
        assert file.name in _wrong(copy), (file.name, at, change)
        file.write_bytes(right)
    assert _wrong(copy) == {}


def test_the_first_place_that_differs_is_shown_with_both_texts(copy: Path, gyrotc: Command) -> None:
    spoil(copy / "c" / "gtc_rlg_0042.h", "Serial:      RLG-0042", "Serial:      RLG-0043")
    (copy / "c" / "notes.txt").write_text("mine")
    done = gyrotc("verify", copy, "--target", "host-gcc-O2")
    assert done.returncode == 1
    assert "line 3" in done.stdout and "RLG-0043" in done.stdout and "RLG-0042" in done.stdout
    assert "notes.txt: foreign" in done.stdout and "11 of 14 files" not in done.stdout
    result = json.loads((copy / "verify.json").read_text())
    entry = next(e for e in result["emitted"] if e["file"] == "gtc_rlg_0042.h")
    assert (entry["verdict"], entry["line"], entry["mismatches"]) == ("differs", 3, 1)
    # Code that gyrotc did not write is not run ...
    assert all("not compiled" in e["error"] for e in result["targets"])
    # ... unless the user says so.
    result = verify(copy, targets=["host-gcc-O2"], trust_code=True).content()
    assert {e["status"] for e in result["targets"]} == {"pass"} and result["failed"] == 2


def test_the_example_may_be_edited_and_not_be_missing(copy: Path, gyrotc: Command) -> None:
    spoil(copy / "c" / "main.c", "return 1;", "return 3;")
    assert _wrong(copy) == {}
    done = gyrotc("verify", copy, "--target", "host-gcc-O2")
    assert done.returncode == 0 and "main.c: edited" in done.stdout
    (copy / "c" / "main.c").unlink()
    assert _wrong(copy) == {"main.c": "missing"}


def test_a_result_of_all_axes_is_judged_with_its_joint_folder(tmp_path: Path) -> None:
    unit, model = tmp_path / "unit", load_model(GOLDEN)
    models = {axis: model.model_copy(update={"axis": axis}) for axis in "xy"}
    sources = {}
    for axis, one in models.items():
        c = emitted(unit / axis, one) / "c"
        sources[axis] = {p.name: p.read_bytes() for p in c.iterdir()}
    (unit / "c").mkdir()
    for name, data in joint_texts(models, sources).items():
        (unit / "c" / name).write_bytes(data)
    assert axes_in(unit) == ("x", "y") and axes_in(unit / "x") == ()
    results = {axis: verify(unit / axis, compiled=False) for axis in "xy"}
    assert verify_axes(unit, results).failed == 0
    for file in sorted(path for path in (unit / "c").iterdir() if path.name != "main.c"):  # is the user's to edit
        right = file.read_bytes()
        file.write_bytes(right[:-1] + b" ")
        result = verify_axes(unit, results).content()
        assert [e["file"] for e in result["emitted"] if e["status"] == "fail"] == [file.name]
        file.write_bytes(right)
    (unit / "x" / "c" / "gtc.h").unlink()
    assert verify_axes(unit, {axis: verify(unit / axis, compiled=False) for axis in "xy"}).failed > 0


def test_options_stand_in_the_record_and_not_in_a_comment(copy: Path) -> None:
    emit(load_model(GOLDEN), copy, zero_at=20.0)
    header = copy / "c" / "gtc_rlg_0042.h"
    header.write_text(re.sub(r" --zero-at \S+", "", header.read_text()))
    assert _wrong(copy) == {"gtc_rlg_0042.h": "differs"}


@pytest.fixture(scope="module")
def run(whole: Path) -> list[str]:
    """What a board prints that is right: two arithmetics, each with its cost."""
    job = job_of(whole)
    lines = []
    for numeric, rows in job.expected.items():
        lines += ["board bench", f"begin {job.model.id} {numeric} all {job.model.hash[:8]} {20000:08x}"]
        lines += [f"{status:08x} {bits:08x}" for status, bits in rows.tolist()]
        lines += [f"end {len(rows):08x}", *(f"cost {what}" + " 00000010" * 6 for what in ("map", "step"))]
    return [*lines, "done"]


def _spoilt(line: str) -> str:
    return line[:-1] + ("0" if line[-1] != "0" else "1")


def _result(folder: Path, tmp_path: Path, lines: list[str]) -> dict:
    log = tmp_path / "bench.log"
    log.write_text("\r\n".join(lines) + "\r\n")
    return verify(folder, log=log).content()


def _at(run: list[str], start: str, numeric: str) -> int:
    """Where the line of a part stands."""
    begin = next(k for k, line in enumerate(run) if line.startswith("begin ") and f" {numeric} " in line)
    return next(k for k in range(begin, len(run)) if run[k].startswith(start))


def test_chatter_before_and_after_is_allowed_and_counted(whole: Path, run: list[str], tmp_path: Path) -> None:
    lines = ["U-Boot 2026.01", "board support 3", "", *run, "$ reboot", "end of log", "done", "board off"]
    result = _result(whole, tmp_path, lines)
    assert result["failed"] == 0 and result["passed"] == 2
    assert result["log"]["lines"] == len(lines) and result["log"]["outside"] == 6
    assert [part["line"] for part in result["log"]["parts"]] == [5, 4 + _at(run, "begin", "q31")]
    assert {e["name"] for e in result["targets"]} == {"bench"} and result["log"]["absent"] == []


@pytest.mark.parametrize("order", ["good first", "bad first"])
def test_a_bad_run_beside_a_good_one_fails(order: str, whole: Path, run: list[str], tmp_path: Path) -> None:
    bad = list(run)
    k = _at(run, "end", "f32") - 7
    bad[k] = _spoilt(bad[k])
    lines = [*run, "login:", *bad] if order == "good first" else [*bad, *run]
    result = _result(whole, tmp_path, lines)
    entries = {e["numeric"]: e for e in result["targets"]}
    assert (entries["f32"]["status"], entries["f32"]["mismatches"], entries["f32"]["parts"]) == ("fail", 1, 2)
    assert "part at line" in entries["f32"]["first_mismatches"][0]
    assert entries["q31"]["status"] == "pass" and result["failed"] == 1
    assert [p["mismatches"] for p in result["log"]["parts"]].count(1) == 1


DAMAGE = {
    "begin": lambda line: line.replace("begin", "bexin"),
    "begin's arithmetic": lambda line: line.replace(" all ", " al "),
    "begin's model": lambda line: line[:-17] + "x" + line[-16:],
    "begin's count": _spoilt,
    "end": lambda line: line.replace("end", "and"),
    "end's count": _spoilt,
    "end's digits": lambda line: line[:-1] + "z",
    "cost": lambda line: line.replace("cost", "c0st"),
    "cost's digits": lambda line: line[:-1],
}


@pytest.mark.parametrize("numeric", ["f32", "q31"])
@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_line_is_named(damage: str, numeric: str, whole: Path, run: list[str], tmp_path: Path) -> None:
    k = _at(run, damage.partition("'")[0], numeric)
    lines = list(run)
    lines[k] = DAMAGE[damage](lines[k])
    assert lines[k] != run[k]
    with pytest.raises(CheckFailed, match=r"bench\.log: .*line \d+") as caught:
        pytest.fail(f"{_result(whole, tmp_path, lines)}")
    near = [str(n) for n in (k, k + 1, k + 2)] + [str(_at(run, "begin", n) + 1) for n in ("f32", "q31")]
    ends = [str(_at(run, "end", n) + 1) for n in ("f32", "q31")]
    boards = [str(_at(run, "begin", n)) for n in ("f32", "q31")]
    assert any(f"line {number}" in str(caught.value) for number in near + ends + boards), caught.value


def test_any_line_lost_torn_or_put_in_is_seen(whole: Path, run: list[str], tmp_path: Path) -> None:
    """All lines of a run count: without one, with half of one, with one more between them it is no pass."""
    seed = random.SystemRandom().randrange(2**32)
    print(f"seed {seed}")
    draw = random.Random(seed)
    for what in ("lost", "torn", "put in", "twice"):
        for k in [*draw.sample(range(2, len(run)), 3), len(run) - 1]:
            if run[k].startswith("board ") or (what in ("put in", "twice") and run[k] == "done"):
                continue
            new = {
                "lost": [],
                "torn": [run[k][: len(run[k]) // 2]],
                "put in": ["temperature alarm", run[k]],
                "twice": [run[k], run[k]],
            }[what]
            if what == "lost" and run[k].startswith("cost "):
                continue  # costs are optional
            try:
                result = _result(whole, tmp_path, run[:k] + new + run[k + 1 :])
            except CheckFailed:
                continue
            assert result["failed"], (what, k, run[k])


def test_a_log_that_is_cut_off_after_a_part_is_refused(whole: Path, run: list[str], tmp_path: Path) -> None:
    with pytest.raises(CheckFailed, match="before `done`"):
        pytest.fail(f"{_result(whole, tmp_path, run[: _at(run, 'begin', 'q31') - 1])}")


def test_a_count_of_random_vectors_that_does_not_fit_is_refused_before_it_is_made(
    whole: Path, run: list[str], tmp_path: Path
) -> None:
    k = _at(run, "begin", "f32")
    lines = list(run)
    lines[k] = lines[k][:-8] + "f0004e20"  # four thousand million: memory for all of them was taken
    with pytest.raises(CheckFailed, match="random vectors"):
        pytest.fail(f"{_result(whole, tmp_path, lines)}")


def test_one_arithmetic_alone_is_said(run: list[str], tmp_path: Path, gyrotc: Command) -> None:
    copy = emitted(tmp_path / "copy")
    log = tmp_path / "bench.log"
    log.write_text("\n".join(["boot", *run[: _at(run, "begin", "q31") - 1], "done", ""]))
    done = gyrotc("verify", copy, "--log", log)
    assert done.returncode == 0
    assert "did not test q31" in done.stdout and "outside: line 1: boot" in done.stdout
