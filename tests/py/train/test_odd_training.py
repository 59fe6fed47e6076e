"""Odd but valid samples: no training ends in a fault, and no map goes beyond the data by more than they spread.

`GYROTC_ODD=2000` trains on so many sets instead of a slice; `GYROTC_ODD_SEED` says where to begin.
"""

from __future__ import annotations

import os

import numpy as np
import pytest
from gyrotc.train.data import TrainingData, average, cleaned
from gyrotc.train.evidence import TrainingFailed
from gyrotc.train.methods import fit
from gyrotc.train.result import Fit, predict
from odd_training import odd_samples

SETS = int(os.environ.get("GYROTC_ODD", "40"))
FIRST = int(os.environ.get("GYROTC_ODD_SEED", "0"))


def beyond(found: Fit, data: TrainingData) -> float:
    """How far the map lies outside the means of the data over the whole envelope, in spans of the means."""
    means = average(cleaned(data), 100.0).bias_dph
    low, high = float(means.min()), float(means.max())
    s = found.scaling
    grid = np.meshgrid(np.linspace(*s.temperature_c, 41), np.linspace(*s.slope_c_per_min, 21))
    bias = predict(found, *grid)
    assert np.all(np.isfinite(bias))
    outside = float(np.maximum(low - bias, bias - high).max())
    return outside / max(high - low, 1e-6 * max(abs(low), abs(high)), 1e-300)


@pytest.mark.parametrize("seed", range(FIRST, FIRST + SETS))
def test_the_ladder_survives_odd_samples_and_keeps_to_them(seed: int) -> None:
    data = odd_samples(seed)
    found = fit(data, method="auto")
    assert beyond(found, data) < 1.02, f"seed {seed}: {found.method}"
    assert not found.candidates or [row["id"] for row in found.candidates if row["chosen"]] == [found.method]


@pytest.mark.parametrize("seed", range(FIRST, FIRST + SETS // 2))
def test_a_map_asked_for_by_name_comes_or_says_why_not(seed: int) -> None:
    data = odd_samples(seed)
    try:
        found = fit(data, method="mrbf")
    except TrainingFailed as failure:
        assert "evidence model" in str(failure)
        return
    reported = {finding["id"] for finding in found.findings}
    assert beyond(found, data) < 1.02 or "map_beyond_data" in reported, f"seed {seed}"
