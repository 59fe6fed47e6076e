"""The runtime's primitives over their arguments, against formulas that share no text with the runtime."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from emitted import spoil
from gyrotc.mirror import GAUSS_ERROR

ROOT = Path(__file__).resolve().parents[2]


#: Largest departure of the float32 Gaussian from the exact one that docs/numerics.md allows.
F32_GAUSS_ERROR = 1.9e-7


#: Of the two Gaussians of a curve, of the weights: that, and what (x - center) gain and its square lose. Fixed point
#: also rounds its sum down by a unit in a weight of 2^30.
CURVE_ERROR = GAUSS_ERROR + 0.715 * 2.0**-28 + 2.0**-30


F32_CURVE_ERROR = F32_GAUSS_ERROR + (3.5 * 0.736 + 2.0) * 2.0**-24


def printed_by(name: str, work: Path, *arguments: str, libc: Path = ROOT / "libc", half: int = 0) -> dict[str, list]:
    """Words of each line that a program prints, by its first word."""
    program = work / name
    parts = ("gtc_q31.c", "gtc_f32.c")
    sources = [ROOT / "tests" / "prove" / f"{name}.c", *(libc / part for part in parts)]
    flags = ["-std=gnu99", "-O3", "-march=native", "-ffp-contract=off", f"-DGTC_HALF_MULTIPLY={half}"]
    include = [f"-I{ROOT / 'include'}", f"-I{libc}"]
    subprocess.run(["gcc", *flags, *include, *map(str, sources), "-lm", "-o", str(program)], check=True)
    done = subprocess.run([str(program), *arguments], check=True, capture_output=True, text=True)
    return {line.split()[0]: line.split()[1:] for line in done.stdout.splitlines()}


@pytest.mark.parametrize("half", [0, 1], ids=["long multiply", "16-bit halves"])
def test_fixed_point_primitives_over_all_arguments(half: int, tmp_path: Path) -> None:
    found = printed_by("primitives_q31", tmp_path, half=half)
    assert {name: words[1] for name, words in found.items()} == dict.fromkeys(
        ("gauss", "shifts", "products", "positions", "quotients"), "0"
    )
    assert int(found["gauss"][0]) == 2**29
    assert 0.98 * GAUSS_ERROR < float(found["gauss"][2]) * 2.0**-29 <= GAUSS_ERROR


def test_float32_gaussian_over_every_seventh_argument(tmp_path: Path) -> None:
    """`make prove` takes every one."""
    visited, wrong, worst = printed_by("primitives_f32", tmp_path, "7")["gauss"]
    assert int(visited) > 1.6e8 and wrong == "0"
    assert float(worst) <= F32_GAUSS_ERROR


@pytest.mark.parametrize(("name", "bound"), [("primitives_q31", CURVE_ERROR), ("primitives_f32", F32_CURVE_ERROR)])
def test_the_gaussians_of_a_channel_over_every_97th_reading(name: str, bound: float, tmp_path: Path) -> None:
    """`make prove` takes every one."""
    visited, wrong, worst = printed_by(name, tmp_path, "curve", "97")["curve"]
    assert int(visited) > 1.3e8 and wrong == "0"
    assert float(worst) <= bound


def test_a_curve_with_one_wrong_bit_is_seen(tmp_path: Path) -> None:
    libc = Path(shutil.copytree(ROOT / "libc", tmp_path / "libc"))
    spoil(libc / "gtc_num_q31.h", r"\(whole << 20\)", "(whole << 19)")
    spoil(libc / "gtc_num_f32.h", r"u = x - bell\[0\]\.value;", "u = x + bell[0].value;")
    for name in ("primitives_q31", "primitives_f32"):
        assert int(printed_by(name, tmp_path, "curve", "997", libc=libc)["curve"][1]) > 0


@pytest.mark.parametrize(
    ("program", "file", "pattern", "replacement"),
    [
        ("primitives_q31", "gtc_num_q31.h", "0x3DD4FFA7UL", "0x3DD4FFA6UL"),
        ("primitives_q31", "gtc_num_q31.h", r"#define Q31_H 1557473452U", "#define Q31_H 1557473460U"),
        ("primitives_f32", "gtc_num_f32.h", "0x3876ABCFUL", "0x3876ABCEUL"),
        ("primitives_f32", "gtc_num_f32.h", r"0x1\.71549ep\+6", "0x1.7154a0p+6"),
    ],
)
def test_one_wrong_bit_is_seen(program: str, file: str, pattern: str, replacement: str, tmp_path: Path) -> None:
    libc = Path(shutil.copytree(ROOT / "libc", tmp_path / "libc"))
    spoil(libc / file, pattern, replacement)
    found = printed_by(program, tmp_path, "61", libc=libc)
    assert int(found["gauss"][1]) > 0


def test_the_formulas_share_no_text_with_the_runtime() -> None:
    """Only the name of the function under test and the limits of its argument come from libc/."""
    for name in ("primitives_q31", "primitives_f32"):
        text = (ROOT / "tests" / "prove" / f"{name}.c").read_text()
        assert not re.search(r"exp2_table|F32_[HG]\b|Q31_[HG]\b", text)
