"""Error of a fixed-point Gaussian against the size of its lookup table: the figures of docs/numerics.md."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from gyrotc.target.q31 import GAUSS_ERROR, exp2_table

ROOT = Path(__file__).resolve().parents[3]
_U = 2.0**-24  # unit of the argument
_E = 2.0**-29  # unit of the result


def _square_error(n: int) -> float:
    """Largest relative error of the best square ((t - h)² + g) c for 2^-t, 0 <= t < 1/n."""
    nodes = (1.0 + np.cos(np.pi * (2.0 * np.arange(3) + 1.0) / 6.0)) / (2.0 * n)
    square = np.polyfit(nodes, 2.0**-nodes, 2)
    t = np.linspace(0.0, 1.0 / n, 20001)
    return float(np.max(np.abs(np.polyval(square, t) * 2.0**t - 1.0)))


def _whole_error(n: int) -> float:
    """The same with the argument and the result cut off, the offset of both shared out to both sides."""
    nodes = (1.0 + np.cos(np.pi * (2.0 * np.arange(3) + 1.0) / 6.0)) / (2.0 * n)
    square = np.polyfit(nodes, 2.0**-nodes, 2)
    u = np.arange(0, 2**24 // n, 7, dtype=np.float64) * _U
    low, high = [], []
    for k in (0, 1, n // 2):
        value = np.polyval(square, u) * 2.0 ** (-k / n)
        exact, later = 2.0 ** -(u + k / n), 2.0 ** -(u + k / n + _U)
        low.append(float(np.min(value - _E - exact)))
        high.append(float(np.max(value - later)))
    return (max(high) - min(low)) / 2.0


def _rows() -> dict[int, tuple[int, float, float]]:
    text = (ROOT / "docs" / "numerics.md").read_text("utf-8")
    rows = re.findall(r"^\| (\d+) \| (\d+) \| (\S+) \| (\S+) \|$", text, re.MULTILINE)
    return {int(n): (int(b), float(square), float(whole)) for n, b, square, whole in rows}


def test_the_table_of_sizes_is_there() -> None:
    assert list(_rows()) == [16, 32, 64, 128, 256]


@pytest.mark.parametrize("n", [16, 32, 64, 128, 256])
def test_error_of_a_size_is_what_is_written(n: int) -> None:
    size, square, whole = _rows()[n]
    assert size == 4 * n
    assert _square_error(n) == pytest.approx(square, rel=0.03)
    assert _square_error(n) == pytest.approx((np.log(2.0) / n) ** 3 / 192.0, rel=0.02)
    assert _whole_error(n) == pytest.approx(whole, rel=0.04)


def test_the_size_that_was_taken() -> None:
    """Within 5 % of the proved error of the arithmetic with all its roundings."""
    assert len(exp2_table()) == 64
    assert 0.95 * GAUSS_ERROR < _whole_error(64) <= GAUSS_ERROR
