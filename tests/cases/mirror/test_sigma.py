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
from libc_device import history, variant
from models import random_model, random_uncertainty

sys.path.insert(0, str(ROOT))


@pytest.fixture(scope="module")
def build() -> Runtime:
    return runtime("gcc", ("-O2",))


@pytest.mark.parametrize("numeric", NUMERICS)
def test_snapshots_are_those_of_the_reference_in_any_history(build: Runtime, numeric: str) -> None:
    """Random models, uncertainties, terms and faults: every sigma to the bit, with status and age of its moment."""
    seed = int(np.random.default_rng().integers(2**31))
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    seen = 0
    for trial in range(40):
        model = variant(seed + trial)
        model = model.model_copy(update={"uncertainty_dph": random_uncertainty(seed + trial, len(model.terms))})
        try:
            table = quantise(model, numeric)
        except CheckFailed:  # a model that this arithmetic cannot hold
            continue
        samples_per_block = int(rng.choice([1, 2, 3, 7, 10]))
        channels, missed = history(model, table, seed + trial, 800, samples_per_block)
        status, bits = build.snapshots(table, channels, missed, samples_per_block)
        expected = replay(table, channels, missed=missed, samples_per_block=samples_per_block)
        claim = f"seed {seed}, trial {trial}"
        np.testing.assert_array_equal(status[:, 0], expected.sample_status, err_msg=claim)
        np.testing.assert_array_equal(status[:, 1], expected.status, err_msg=claim)
        np.testing.assert_array_equal(status[:, 2], expected.status, err_msg=claim)
        np.testing.assert_array_equal(status[:, 3], expected.age, err_msg=claim)
        np.testing.assert_array_equal(bits[:, 0], expected.bits, err_msg=claim)
        np.testing.assert_array_equal(bits[:, 1], expected.sigma, err_msg=claim)
        seen += len(status)
    assert seen > 20000


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
