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


@pytest.mark.parametrize("numeric", NUMERICS)
def test_where_nothing_is_uncertain_sigma_is_that_of_the_rounding(build: Runtime, numeric: str) -> None:
    """Also the root of 0 is the same in both."""
    model, known = random_model(5), random_uncertainty(5)
    nothing = ((0.0,) * known.cells[0],) * known.cells[1]
    amounts = {name: 0.0 for name, value in known.rules.model_dump().items() if isinstance(value, float)}
    rules = known.rules.model_copy(update=amounts | {"correlation_s": 100.0})
    content = known.model_copy(update={"rows": nothing, "uncovered": nothing, "rules": rules})
    table = quantise(model.model_copy(update={"uncertainty_dph": content}), numeric)
    low, high = model.envelope.temperature_c
    channels = table.encode_inputs(np.linspace(low, high, 400)[:, None])
    missed = np.zeros(400, dtype=np.int64)
    expected = replay(table, channels, missed=missed, samples_per_block=2)
    _, bits = build.snapshots(table, channels, missed, 2)
    assert expected.sigma is not None
    np.testing.assert_array_equal(bits[:, 1], expected.sigma)
    assert table.decode_bias(bits[:, 1]).max() <= table.error_bound_dph
