"""`gyrotc verify`: is what lies here what gyrotc made from this model? Every file is compared byte for byte."""

from __future__ import annotations

import json
import random
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import Command
from emitted import GOLDEN, emitted, flip, spoil
from gyrotc.common.errors import InputError
from gyrotc.jobs.axes import axes_in, joint_texts, verify_axes
from gyrotc.model import load_model
from gyrotc.tables.emit import emit
from gyrotc.verify.job import verify

Spoil = Callable[[Path], object]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return emitted(tmp_path_factory.mktemp("whole"))


@pytest.fixture
def copy(whole: Path, tmp_path: Path) -> Path:
    """A copy that a test may spoil."""
    return Path(shutil.copytree(whole, tmp_path / "copy"))


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
    return lambda c: spoil(c / "gtc.c", head, rf"\1    {statement}\n")


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
    "main": ("main.c", lambda c: spoil(c / "main.c", "return 1;", "return 0;")),
    "vectors made fewer": ("vectors_rlg_0042.h", lambda c: spoil(c / "vectors_rlg_0042.h", "20000UL", "2UL")),
    "open accepts anything": ("gtc.c", _at_start("open", "return GTC_OK;")),
    "blind check": ("gtc.c", _at_start("check", "return GTC_OK;")),
    "restore takes foreign states": ("gtc.c", _at_start("restore", "return GTC_OK;")),
    "angle loses its remainder": (
        "gtc.c",
        lambda c: spoil(c / "gtc.c", r"(int gtc_q31_angle\([^;{]*\{\n)", r"\1    return GTC_OK;\n"),
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
    model.save(tmp_path / "model.json")
    for numerics in (None, ["f32"], ["q31", "f32"]):
        for zero_at in (None, 20.0, -0.1):
            emit(model, tmp_path, numerics=numerics, zero_at=zero_at)
            assert _wrong(tmp_path) == {}


def test_any_flipped_byte_of_any_file_is_seen(copy: Path) -> None:
    """Also one dropped and one added byte, in comments as in images."""
    seed = random.SystemRandom().randrange(2**32)
    print(f"seed {seed}")
    draw = random.Random(seed)
    files = sorted((copy / "c").iterdir())
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


def test_main_may_be_edited_when_it_is_said_and_nothing_else(copy: Path, gyrotc: Command) -> None:
    spoil(copy / "c" / "main.c", "return 1;", "return 3;")
    assert _wrong(copy) == {"main.c": "differs"}
    assert _wrong(copy, edited=["main.c"]) == {}
    done = gyrotc("verify", copy, "--target", "host-gcc-O2", "--allow-edited", "main.c")
    assert done.returncode == 0 and "main.c: edited" in done.stdout
    (copy / "c" / "main.c").unlink()
    assert _wrong(copy, edited=["main.c"]) == {"main.c": "missing"}
    with pytest.raises(InputError, match=r"main\.c"):
        verify(copy, compiled=False, edited=["gtc.c"])


@pytest.mark.slow
def test_a_result_of_all_axes_is_judged_with_its_joint_folder(tmp_path: Path, gyrotc: Command) -> None:
    unit, model = tmp_path / "unit", load_model(GOLDEN)
    models = {axis: model.model_copy(update={"axis": axis}) for axis in "xy"}
    sources = {}
    for axis, one in models.items():
        c = emitted(unit / axis, one) / "c"
        sources[axis] = {p.name: p.read_bytes() for p in c.iterdir()}
    (unit / "c").mkdir()
    for name, data in joint_texts(models, sources, "f32").items():
        (unit / "c" / name).write_bytes(data)
    assert axes_in(unit) == ("x", "y") and axes_in(unit / "x") == ()
    assert gyrotc("verify", unit, "--target", "host-gcc-O2").returncode == 0
    assert json.loads((unit / "verify.json").read_text())["failed"] == 0
    results = {axis: verify(unit / axis, compiled=False) for axis in "xy"}
    for file in sorted((unit / "c").iterdir()):
        right = file.read_bytes()
        file.write_bytes(right[:-1] + b" ")
        result = verify_axes(unit, results).content()
        assert [e["file"] for e in result["emitted"] if e["status"] == "fail"] == [file.name]
        file.write_bytes(right)
    (unit / "x" / "c" / "gtc.h").unlink()
    assert gyrotc("verify", unit, "--target", "host-gcc-O2").returncode == 1


def test_options_stand_in_the_record_and_not_in_a_comment(copy: Path) -> None:
    emit(load_model(GOLDEN), copy, zero_at=20.0)
    header = copy / "c" / "gtc_rlg_0042.h"
    header.write_text(re.sub(r" --zero-at \S+", "", header.read_text()))
    assert _wrong(copy) == {"gtc_rlg_0042.h": "differs"}
