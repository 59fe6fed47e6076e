"""When the first correction comes, with readings missing."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from gyrotc.mirror import FALLBACK, HELD, Table
from gyrotc.tables import NUMERICS, quantise
from libc_build import runtime
from models import random_model

BLOCK_S = 10.0
AGREE_S = 1.0
HOLD_BLOCKS = 30


@lru_cache
def steady_table(numeric: str) -> Table:
    """A table with the guard of a product: 1 C and 30 C/min, agreement for 1 s, held for 300 s."""
    model = random_model(
        3,
        agree_s=AGREE_S,
        hold_blocks=HOLD_BLOCKS,
        stuck_s=0.0,
        max_step_c=1.0,
        max_rate_c_per_min=30.0,
        guards={},
    )
    assert model.block_s == BLOCK_S
    return quantise(model, numeric)


def first_correction_s(
    numeric: str,
    missed: np.ndarray,
    period_s: float,
    *,
    as_nan: bool,
    c_per_min: float = 0.0,
) -> tuple[float, float]:
    """Time of the first correction of the compiled runtime after power-up, and the latest that it may come at, s.

    Args:
        numeric: Arithmetic.
        missed: Periods without a reading before each reading.
        period_s: Length of a period.
        as_nan: Each of them is a call that hands over a missing reading; else it is no call, but time that passes.
        c_per_min: The temperature moves at this rate.
    """
    table = steady_table(numeric)
    at = np.cumsum(missed + 1) - 1
    noise = np.random.default_rng(7).normal(0.0, 0.01, len(at))
    temperature = 20.0 + c_per_min / 60.0 * period_s * (at + 1) + noise
    if as_nan:
        with_missing = np.full(int(at[-1]) + 1, np.nan)
        with_missing[at] = temperature
        temperature, missed = with_missing, np.zeros(with_missing.size, dtype=np.int64)
    channels = table.encode_inputs(temperature[:, None])
    status, _ = runtime().steps(table, channels, missed, round(BLOCK_S / period_s))
    time_s = period_s * (at + 1)
    in_time = np.flatnonzero((status[:, 1] & (HELD | FALLBACK)) == 0)
    first_s = period_s * float(np.cumsum(missed + 1)[in_time[0]]) if in_time.size else np.inf
    latest = max(2, int(np.searchsorted(time_s, time_s[0] + AGREE_S - 1e-9)))
    return first_s, float(time_s[latest])


@pytest.mark.parametrize("numeric", NUMERICS)
@pytest.mark.parametrize("loss", [0.0, 0.05, 0.1, 0.2, 0.4, 0.6])
@pytest.mark.parametrize("period_s", [0.01, 0.1, 1.0])
def test_the_first_correction_comes_in_time_whatever_is_lost_at_random(
    numeric: str, loss: float, period_s: float
) -> None:
    for draw in range(20):
        missed = np.random.default_rng(draw).geometric(1.0 - loss, 400) - 1
        first_s, latest_s = first_correction_s(numeric, missed, period_s, as_nan=bool(draw % 2))
        third_s = period_s * float((missed[:3] + 1).sum())
        assert first_s == pytest.approx(latest_s)
        assert first_s <= max(2.0 * AGREE_S, third_s) + 1e-9


@pytest.mark.parametrize("numeric", NUMERICS)
@pytest.mark.parametrize("as_nan", [False, True], ids=["calls", "polls"])
@pytest.mark.parametrize("c_per_min", [0.0, 2.0, -4.0])
def test_the_first_correction_comes_in_time_with_one_reading_in_so_many_polls(
    numeric: str, as_nan: bool, c_per_min: float
) -> None:
    """With every distance of two readings up to the time for which a correction is held."""
    hold_s = HOLD_BLOCKS * BLOCK_S
    for period_s, every in (
        (0.01, (2, 3, 50, 99, 100, 101, 1000)),
        (0.5, (2, 7, 20, 61, 599, 600)),
        (10.0, range(1, 31)),
    ):
        for k in every:
            assert k * period_s <= hold_s
            missed = np.full(max(4, int(2.0 / (k * period_s)) + 2), k - 1)
            first_s, latest_s = first_correction_s(numeric, missed, period_s, as_nan=as_nan, c_per_min=c_per_min)
            assert first_s == pytest.approx(latest_s), (k, period_s)
            assert first_s <= max(2.0 * AGREE_S, 3 * k * period_s) + 1e-9
