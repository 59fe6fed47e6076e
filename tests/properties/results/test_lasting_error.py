"""What lasts after compensation, against its definition."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from drawn import examples
from gyrotc.common import Averages
from gyrotc.results import LastingError
from hypothesis import given
from hypothesis import strategies as st

minutes = st.lists(st.integers(1, 90), min_size=1, max_size=4)
"""Minutes between the means of a run that is too short to be cut."""


@examples(200)
@given(runs=st.lists(minutes, min_size=1, max_size=3), seed=st.integers(0, 2**32 - 1))
def test_it_is_the_mean_product_of_neighbours_and_of_means_up_to_half_an_hour_apart(
    runs: list[list[int]], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    averages, products = [], []
    for steps in runs:
        time_s = 60.0 * np.cumsum([1, *steps])
        after_dph = rng.normal(size=len(time_s))
        averages.append(Averages(time_s, after_dph, after_dph, np.zeros(len(time_s))))
        products += [
            after_dph[i] * after_dph[j]
            for i, j in combinations(range(len(time_s)), 2)
            if j == i + 1 or time_s[j] - time_s[i] <= 1800.0
        ]
    found = LastingError.of(averages)
    assert found is not None and found.mean_square_dph2 == pytest.approx(np.mean(products), abs=1e-12)
