"""A thermometer that lags is named nothing, and a record that is late keeps its name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from gyrotc.diagnose import Records, Search, attribute, build_bank, needed_lead_s, open_search, search_of
from gyrotc.mirror import delayed, first_order
from numpy.typing import NDArray
from small_campaign import BLOCK_S, LEVEL_DPH, small_records

Array = NDArray[np.float64]
LAG_S, SEED = 300.0, 20261128


def shown_by(sensor: Callable[[Array, Array], Array], size: float) -> tuple[Records, Search]:
    """A small campaign whose rate is a bent function of the true temperature, and what a sensor shows of that."""
    print("seed", SEED)
    rng, runs = np.random.default_rng(SEED), []
    for run in small_records().runs:
        true_c = run.history.temperature_c
        rate = size * LEVEL_DPH * (np.exp(-(((true_c - 20.0) / 12.0) ** 2)) + 0.5 * np.sin(true_c / 9.0))
        rate = rate + LEVEL_DPH * np.sqrt(BLOCK_S / run.row_s) * rng.standard_normal(true_c.size)
        shown_c = sensor(run.history.time_s, true_c)
        runs.append(replace(run, history=replace(run.history, temperature_c=shown_c), rate_dph=rate))
    records = Records(tuple(runs), BLOCK_S)
    return records, open_search(records, build_bank(records, 0), records.target())


def test_the_map_goes_ahead_of_a_sensor_that_lags_and_nothing_is_named() -> None:
    records, plain = shown_by(lambda time_s, true_c: first_order(LAG_S, time_s, true_c), 20.0)
    assert needed_lead_s(plain) == pytest.approx(LAG_S, rel=0.3)
    assert attribute(plain).detected, "few functions of the temperature that is shown and of its rate do not do"
    found = attribute(search_of(records))
    assert not found.causes


def test_a_record_that_is_late_is_no_sensor_that_lags() -> None:
    records, plain = shown_by(lambda time_s, true_c: delayed(LAG_S, time_s, true_c), 20.0)
    assert needed_lead_s(plain) == 0.0
    [cause] = attribute(search_of(records)).causes
    assert cause.candidate.id == "time_misalignment"
    assert cause.parameters["shift_s"].value == pytest.approx(LAG_S, abs=20.0)


def test_a_map_that_does_is_left_where_it_is() -> None:
    _, plain = shown_by(lambda time_s, true_c: true_c, 20.0)
    assert needed_lead_s(plain) == 0.0
