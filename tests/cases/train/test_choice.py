"""The one decision of training, on either side of its doubt. The doubt is that of docs/training.md, section 2."""

from __future__ import annotations

import numpy as np
import pytest
from drawn import examples
from gyrotc.train import choose, expected_square
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

Floats = NDArray[np.float64]
PIECES = (2, 3, 6, 20)


def gains(mean: float, doubts: float, n: int) -> Floats:
    """Gains in log RMS over pieces with this mean, which is so many of its doubts.

    With the scatter s over n pieces the squared doubt is ((n - 1) s^2 + mean^2 + 0.015^2)/(n (n - 1)).
    """
    shape = np.linspace(-1.0, 1.0, n) ** 3
    shape -= shape.mean()
    squares = (mean / doubts) ** 2 * n * (n - 1) - mean**2 - 0.015**2
    assert squares >= 0.0, "no scatter is small enough"
    return np.asarray(mean + shape / np.sqrt(np.sum(shape**2)) * np.sqrt(squares))


def squares(*gains_over_first: Floats) -> Floats:
    """Mean squares of candidates with gains over the first one, shape (pieces, candidates)."""
    first = np.zeros(len(gains_over_first[0]))
    return np.exp(-2.0 * np.stack([first, *gains_over_first], axis=1))


@pytest.mark.parametrize("n", PIECES)
@pytest.mark.parametrize(("doubts", "chosen"), [(1.02, "rich"), (0.98, "simple")])
def test_a_richer_candidate_is_taken_if_its_gain_exceeds_its_doubt(n: int, doubts: float, chosen: str) -> None:
    found = choose(["simple", "rich"], squares(gains(0.2, doubts, n)))
    assert found.chosen == chosen


@pytest.mark.parametrize("n", PIECES)
def test_pieces_that_agree_to_the_last_digit_leave_a_doubt_that_shrinks_with_their_number(n: int) -> None:
    """Without scatter the gain must exceed 1.5 % with two pieces, 0.7 % with three, 0.08 % with twenty."""
    least = 0.015 / np.sqrt(n * (n - 1) - 1)
    assert choose(["simple", "rich"], squares(np.full(n, 1.02 * least))).chosen == "rich"
    assert choose(["simple", "rich"], squares(np.full(n, 0.98 * least))).chosen == "simple"


def test_one_piece_decides_nothing() -> None:
    assert choose(["simple", "rich"], squares(np.array([3.0]))).chosen == "simple"
    assert choose(["simple", "rich"], np.zeros((0, 2))).chosen == "simple"


def test_of_candidates_that_are_alike_the_simplest_is_taken() -> None:
    middle = gains(0.5, 5.0, 6)
    assert choose(["simple", "middle", "rich"], squares(middle, middle + 0.001)).chosen == "middle"
    assert choose(["simple", "middle", "rich"], squares(middle, middle + 0.1)).chosen == "rich"


def test_a_candidate_that_scatters_does_not_shield_the_simplest_from_another() -> None:
    """The best one may be doubtful; the simplest is beaten all the same if another surely is better."""
    middle, rich = gains(0.2, 3.0, 6), gains(0.21, 0.5, 6)
    assert choose(["simple", "middle", "rich"], squares(middle, rich)).chosen == "middle"


@pytest.mark.parametrize("n", [3, 30, 300])
def test_less_than_the_noise_is_not_expected_of_new_means(n: int) -> None:
    """Means without noise of their own: what is expected grows with what is left, from the noise to what is left."""
    expected = [expected_square(np.full(n, left), 1.0) for left in (0.0, 0.5, 0.9, 1.0, 1.1, 2.0, 5.0)]
    assert expected[0] > 1.0
    assert np.all(np.diff(expected) > 0.0)
    assert expected[-1] == pytest.approx(25.0, rel=1e-9)


@pytest.mark.parametrize("noise", [0.0, 1e-170, 1e-80, 1e-3])
@pytest.mark.parametrize("left", [0.0, 1.0])
def test_noise_that_is_nothing_changes_nothing(left: float, noise: float) -> None:
    assert expected_square(np.full(4, left), noise) == pytest.approx(left**2, abs=2.0 * noise**2)


@pytest.mark.parametrize(("lucky", "chosen"), [(0.2, "rich"), (2.5, "simple")])
def test_one_lucky_fold_does_not_outvote_the_others(lucky: float, chosen: str) -> None:
    """The simple candidate leaves half of what the rich one does on a fold: below the noise, and above it."""
    left = np.array([[1.6, 1.2], [1.5, 1.2], [1.6, 1.2], [1.5, 1.2], [lucky, 2.0 * lucky]])
    made = np.array([[expected_square(np.full(4, x), 1.0) for x in fold] for fold in left])
    assert choose(["simple", "rich"], made).chosen == chosen
    assert choose(["simple", "rich"], left**2).chosen == "simple"


def test_a_candidate_that_could_not_be_fitted_or_is_refused_is_not_taken() -> None:
    made = squares(gains(0.2, 3.0, 6), gains(0.6, 3.0, 6))
    found = choose(["simple", "middle", "rich"], made)
    assert found.chosen == "rich"
    assert found.without(["rich"]).chosen == "middle"
    made[2, 2] = np.nan
    assert choose(["simple", "middle", "rich"], made).chosen == "middle"


@examples(100)
@given(
    losses=st.lists(st.floats(-3.0, 3.0), min_size=8, max_size=8),
    scale=st.floats(1e-3, 1e3),
    order=st.permutations(range(4)),
)
def test_the_choice_depends_neither_on_the_unit_nor_on_the_order_of_pieces(
    losses: list[float], scale: float, order: list[int]
) -> None:
    made = np.exp(np.array(losses).reshape(4, 2))
    names = ["simple", "rich"]
    gain, doubt = choose(names, made).gain("rich", "simple")
    others = choose(names, scale**2 * made[order]).gain("rich", "simple")
    assert others == pytest.approx((gain, doubt), abs=1e-9)
