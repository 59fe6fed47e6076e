"""Cubic B-splines against those of `scipy.interpolate`."""

from __future__ import annotations

import numpy as np
from drawn import examples
from gyrotc.common import cubic_splines
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

places = st.lists(st.floats(-60.0, 90.0, width=32), min_size=2, max_size=40).filter(lambda x: max(x) - min(x) > 0.01)


@examples(100)
@given(places=places, every=st.integers(1, 8))
def test_cubic_splines_are_those_of_scipy(places: list[float], every: int) -> None:
    """At knots, between them and where two knots are one; but for rounding."""
    x = np.sort(np.array(places))
    knots = np.append(x[:-1:every], x[-1])
    padded = np.concatenate([[knots[0]] * 3, knots, [knots[-1]] * 3])
    expected = BSpline.design_matrix(x, padded, 3).toarray()
    np.testing.assert_allclose(cubic_splines(x, knots), expected, rtol=0.0, atol=1e-14)
