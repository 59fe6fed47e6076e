"""Model selection near each of its thresholds: one case on either side, so that no statistic can be left out.

The scores are made by hand with the stated mean and Student's t; scipy's t test is the truth.
"""

from __future__ import annotations

import numpy as np
import pytest
from gyrotc.train import CANDIDATES, CandidateScores, Fold
from numpy.typing import NDArray
from scipy import stats

Floats = NDArray[np.float64]
FOLDS = 8
LEAST_GAIN, LARGE_GAIN = 0.02, 0.10
NOISE = 1e-9
"""Far below every RMS here, so that a gain in score is the logarithm of the ratio of two RMS."""


def gains(mean: float, t: float, n: int = FOLDS) -> Floats:
    """Gains in score over folds with this mean and this t against 0."""
    shape = np.linspace(-1.0, 1.0, n) ** 3
    shape -= shape.mean()
    made = mean + shape / shape.std(ddof=1) * mean / t * np.sqrt(n)
    assert stats.ttest_1samp(made, 0.0).statistic == pytest.approx(t)
    return np.asarray(made)


def scores(over_constant: dict[str, Floats]) -> CandidateScores:
    """Candidates with gains over the constant; those that are not named are twice as bad as it."""
    n = len(next(iter(over_constant.values())))
    rms = np.stack([np.exp(-over_constant.get(name, np.full(n, -0.7))) for name in CANDIDATES], axis=1)
    rms[:, CANDIDATES.index("constant")] = 1.0
    fold = Fold("run", 0, np.zeros(1, dtype=np.intp), np.zeros(1, dtype=np.intp))
    return CandidateScores([fold] * n, rms, NOISE, NOISE, np.full(n, 50.0), rms)


@pytest.mark.parametrize(
    ("mean", "t", "beaten"),
    [
        (0.11, 1.05, True),
        (0.11, 0.95, False),  # as large, and a coin
        (0.09, 1.5, False),  # as sure, and small
        (0.05, 1.02 * stats.t.isf(0.025, FOLDS - 1), True),
        (0.05, 0.98 * stats.t.isf(0.025, FOLDS - 1), False),
    ],
)
@pytest.mark.parametrize("name", ["cubic", "cubic_slope", "mixed"])
def test_a_constant_stays_unless_it_is_beaten_by_much_or_surely(name: str, mean: float, t: float, beaten: bool) -> None:
    made = scores({name: gains(mean, t)})
    assert made.beats_constant(name) == beaten
    assert made.chosen() == (name if beaten else "constant")


@pytest.mark.parametrize("folds", [3, 8, 20])
@pytest.mark.parametrize(("mean", "factor", "taken"), [(0.05, 1.03, True), (0.05, 0.97, False), (0.015, 1.5, False)])
def test_a_network_must_be_surely_better_than_a_simple_correction(
    mean: float, factor: float, taken: bool, folds: int
) -> None:
    """At 2.5 % one-sided, and by more than 2 % of the RMS."""
    cubic = gains(0.5, 30.0, folds)
    network = cubic + gains(mean, factor * stats.t.isf(0.025, folds - 1), folds)
    assert scores({"cubic": cubic, "mrbf": network}).chosen() == ("mrbf" if taken else "cubic")


@pytest.mark.parametrize(("more", "taken"), [(0.9 * LEAST_GAIN, "cubic"), (1.1 * LEAST_GAIN, "cubic_slope")])
def test_of_simple_corrections_the_simplest_within_two_percent_is_taken(more: float, taken: str) -> None:
    cubic = gains(0.5, 30.0)
    assert scores({"cubic": cubic, "cubic_slope": cubic + more}).chosen() == taken


def test_one_piece_decides_nothing() -> None:
    assert scores({"cubic": np.array([2.0])}).chosen() == "constant"
    assert scores({"cubic": np.array([2.0, 2.0])}).chosen() == "cubic"
