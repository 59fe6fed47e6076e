"""Rounding of one Gaussian term in both arithmetics, proved by Gappa from the statements that the target does."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent / "gappa"


def _gappa(text: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["gappa"], input=text, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("name", ["gauss_f32", "gauss_q31"])
def test_bound_is_proved(name: str) -> None:
    done = _gappa((HERE / f"{name}.gappa").read_text())
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("name", "bound", "too_small"),
    [
        ("gauss_f32", "[-0x1.a8p-23, 0x1.a8p-23]", "[-0x1.0p-24, 0x1.0p-24]"),
        ("gauss_q31", "[-2.478, 0]", "[-1.9, 0]"),
    ],
)
def test_a_bound_too_small_is_not_proved(name: str, bound: str, too_small: str) -> None:
    text = (HERE / f"{name}.gappa").read_text()
    assert bound in text
    assert _gappa(text.replace(bound, too_small)).returncode != 0
