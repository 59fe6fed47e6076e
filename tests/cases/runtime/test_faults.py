"""A slice of `make bench ONLY=faults`: in both arithmetics, whatever fails, sigma is true and the status says so."""

from __future__ import annotations

import numpy as np
import pytest
from gyrotc.results import Numeric
from gyrotc.tables import NUMERICS

from bench.faults import CLASSES, FIRST_SEED, outcomes

_RMS = 2.0  # of error / sigma of one gyro; all 54 of the campaign together stay below 1.5
_SWAPPED = "channel and thermometer swapped"  # both go on for a moment: a block passes before they are refused
_BLOCK_S = 10.0


@pytest.mark.parametrize("numeric", NUMERICS)
def test_sigma_and_status_are_true_in_every_fault(numeric: Numeric) -> None:
    for name, found in zip(CLASSES, outcomes(FIRST_SEED, numeric), strict=True):
        rms = float(np.sqrt(np.mean(found.ratio**2)))
        print(f"{name}: RMS {rms:.2f}, worst {np.abs(found.ratio).max():.1f}, silent {found.silent_s:g} s")
        assert rms <= _RMS, name
        assert found.silent_s <= (_BLOCK_S if name == _SWAPPED else 0.0), name
