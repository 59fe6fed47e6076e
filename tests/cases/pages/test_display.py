"""Numbers of pages and terminals have one form, with the digits that their uncertainty leaves."""

from __future__ import annotations

import numpy as np
import pytest
from gyrotc.pages import AxisScale, scale_of, sci, significant, with_uncertainty


@pytest.mark.parametrize(
    "value, text",
    [
        (2764.0, "2764"), (1303.0, "1303"), (220.0, "220"), (0.0123456, "0.0123"), (7e-4, "7.00·10⁻⁴"), (-2.5, "−2.50"),
        (0.0, "0"), (None, "–"), (123456.0, "1.23·10⁵"), (0.5, "0.500"),
    ],
)  # fmt: skip
def test_numbers_have_one_form(value: float | None, text: str) -> None:
    assert sci(value) == text


def test_digits_go_with_the_uncertainty() -> None:
    assert with_uncertainty(0.0512345, 0.00412) == "0.0512 ± 0.0042"
    assert with_uncertainty(-7.212e-4, 2.41e-5) == "(−7.21 ± 0.25)·10⁻⁴"
    assert significant(659687.17, 3) == "6.60·10⁵"


def test_ticks_are_round_and_lie_on_the_axis() -> None:
    rng = np.random.default_rng(3)
    for _ in range(300):
        low = float(rng.normal() * 10.0 ** rng.integers(-6, 6))
        high = low + float(10.0 ** rng.uniform(-6, 6))
        scale = scale_of(np.array([low, high]), (None, None), False, 0.04)
        ticks = scale.ticks(6)
        assert 2 <= len(ticks) <= 8, (low, high, ticks)
        places = scale.place(np.array([at for at, _ in ticks]))
        assert np.all((places >= -1e-6) & (places <= 1 + 1e-6))
        texts = [text for _, text in ticks]
        assert len(set(texts)) == len(texts), (low, high, texts)
        log = scale_of(np.array([abs(low), abs(low) + high - low]), (None, None), True, 0.04)
        assert all(log.low * 0.999 <= at <= log.high * 1.001 for at, _ in log.ticks(6))
    assert AxisScale(0.0, 1.0).ticks(5)[0] == (0.0, "0.0")
