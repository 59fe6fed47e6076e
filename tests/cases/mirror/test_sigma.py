"""The uncertainty of a correction: the compiled code answers what the reference computes, bit for bit."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from conftest import ROOT
from gyrotc.common import CheckFailed
from gyrotc.mirror import E_ABSENT, replay
from gyrotc.tables import NUMERICS, quantise
from libc_build import Runtime, runtime
from libc_device import variant
from models import random_model, random_uncertainty

sys.path.insert(0, str(ROOT))


@pytest.fixture(scope="module")
def build() -> Runtime:
    return runtime("gcc", ("-O2",))


@pytest.mark.parametrize("numeric", NUMERICS)
@pytest.mark.parametrize("rows", [0, 3])
def test_a_history_without_a_reading_has_the_sigma_of_before_the_first(numeric: str, rows: int) -> None:
    """Whatever terms there are: those of channels have nothing to show then, either."""
    for seed in range(1, 40, 2):
        model = variant(seed)
        model = model.model_copy(update={"uncertainty_dph": random_uncertainty(seed, len(model.terms))})
        try:
            table = quantise(model, numeric)
        except CheckFailed:  # a model that this arithmetic cannot hold
            continue
        channels = table.encode_inputs(np.full((rows, table.n_channels), np.nan))
        found = replay(table, channels, missed=np.zeros(rows, dtype=np.int64), samples_per_block=4)
        assert found.sigma is not None and np.unique(found.sigma).size == min(rows, 1)
        assert not found.begun.any() and not found.bits.any()


@pytest.mark.parametrize("numeric", NUMERICS)
def test_a_table_without_uncertainties_says_so(build: Runtime, numeric: str) -> None:
    table = quantise(random_model(5), numeric)
    status, _ = build.snapshots(table, table.encode_inputs(np.full((20, 1), 20.0)), np.zeros(20), 2)
    assert set(status[:, 1]) == {E_ABSENT}
