"""Rounding: one Gaussian term in both arithmetics (Gappa), the shifts of fixed point; the authority (Z3).

All prove the statements that the target does, for every argument.
"""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from results import Results

HERE = Path(__file__).resolve().parent
CLAIMS = {
    "gauss_f32": (
        "float32: a term departs by less than 1.66 · 2^-23 of itself, weighted by 1.1 · 2^-22",
        "Gappa",
    ),
    "gauss_q31": ("fixed point: a term is cut off by less than 2.478 · 2^-29", "Gappa"),
}


def _gappa(text: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["gappa"], input=text, capture_output=True, text=True, check=False)


def _z3(text: str) -> list[str]:
    done = subprocess.run(["z3", "-in"], input=text, capture_output=True, text=True, check=False)
    return done.stdout.split()


@pytest.mark.tool("gappa")
@pytest.mark.parametrize("name", CLAIMS)
def test_bound_is_proved(name: str, results: Results) -> None:
    done = _gappa((HERE / "gappa" / f"{name}.gappa").read_text())
    assert done.returncode == 0, done.stderr
    claim, tool = CLAIMS[name]
    results.add("rounding", {"claim": claim, "tool": tool, "proved": "for all arguments"})


@pytest.mark.tool("gappa")
@pytest.mark.parametrize(
    ("name", "bound", "too_small"),
    [
        ("gauss_f32", "[-0x1.a8p-23, 0x1.a8p-23]", "[-0x1.0p-24, 0x1.0p-24]"),
        ("gauss_q31", "[-2.478, 0]", "[-1.9, 0]"),
    ],
)
def test_a_bound_too_small_is_not_proved(name: str, bound: str, too_small: str) -> None:
    text = (HERE / "gappa" / f"{name}.gappa").read_text()
    assert bound in text
    assert _gappa(text.replace(bound, too_small)).returncode != 0


@pytest.mark.tool("z3")
def test_the_shifts_round_down_for_every_word(results: Results) -> None:
    assert _z3((HERE / "smt" / "rounding_shift.smt2").read_text()) == ["unsat", "unsat"]
    claim = "fixed point: the shifts of 64-bit sums are floor(x / 2^n), every x, n = 0 ... 62"
    results.add("rounding", {"claim": claim, "tool": "Z3", "proved": "for all arguments"})


@pytest.mark.tool("z3")
@pytest.mark.parametrize(
    ("statement", "wrong", "which"),
    [
        ("(bvsub (bvneg #x0000000000000001) whole)", "(bvneg whole)", 0),  # towards zero
        ("(bvlshr x #x000000000000001d)", "(bvlshr (bvadd x #x0000000010000000) #x000000000000001d)", 1),
    ],
)
def test_another_rounding_is_not_proved(statement: str, wrong: str, which: int) -> None:
    text = (HERE / "smt" / "rounding_shift.smt2").read_text()
    assert text.count(statement) == 1
    assert _z3(text.replace(statement, wrong))[which] == "sat"


@pytest.mark.tool("z3")
def test_every_correction_lies_within_the_authority(results: Results) -> None:
    assert _z3((HERE / "smt" / "authority.smt2").read_text()) == ["unsat", "unsat"]
    claim = "a correction lies within the table's authority, of any state (not a number, too) and any table"
    results.add("rounding", {"claim": claim, "tool": "Z3", "proved": "for all arguments"})


@pytest.mark.tool("z3")
@pytest.mark.parametrize(
    ("statement", "wrong", "which"),
    [
        # comparisons that are false for what is no number let it pass
        ("(and (fp.geq x low) (fp.leq x high))", "(not (or (fp.lt x low) (fp.gt x high)))", 0),
        ("(bvsge y (wide least))", "(bvuge y (wide least))", 1),
    ],
)
def test_another_bound_is_not_proved(statement: str, wrong: str, which: int) -> None:
    text = (HERE / "smt" / "authority.smt2").read_text()
    assert text.count(statement) == 1
    assert _z3(text.replace(statement, wrong))[which] == "sat"
