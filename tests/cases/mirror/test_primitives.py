"""The runtime's primitives over all of their arguments, fixed-point Gaussians of every size, guards."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from gyrotc.mirror import CHANNEL_LOST, CLAMPED, GAUSS_ERROR, exp2_table, replay
from gyrotc.model import Guard, Term
from gyrotc.tables import quantise
from gyrotc.train import longest_same_s, stuck_after_s
from libc_build import runtime
from models import random_channels, random_history, random_model, random_terms

ROOT = Path(__file__).resolve().parents[3]


_U = 2.0**-24  # unit of the argument
_E = 2.0**-29  # unit of the result


def _square_error(n: int) -> float:
    """Largest relative error of the best square ((t - h)² + g) c for 2^-t, 0 <= t < 1/n."""
    nodes = (1.0 + np.cos(np.pi * (2.0 * np.arange(3) + 1.0) / 6.0)) / (2.0 * n)
    square = np.polyfit(nodes, 2.0**-nodes, 2)
    t = np.linspace(0.0, 1.0 / n, 20001)
    return float(np.max(np.abs(np.polyval(square, t) * 2.0**t - 1.0)))


def _whole_error(n: int) -> float:
    """The same with the argument and the result cut off, the offset of both shared out to both sides."""
    nodes = (1.0 + np.cos(np.pi * (2.0 * np.arange(3) + 1.0) / 6.0)) / (2.0 * n)
    square = np.polyfit(nodes, 2.0**-nodes, 2)
    u = np.arange(0, 2**24 // n, 7, dtype=np.float64) * _U
    low, high = [], []
    for k in (0, 1, n // 2):
        value = np.polyval(square, u) * 2.0 ** (-k / n)
        exact, later = 2.0 ** -(u + k / n), 2.0 ** -(u + k / n + _U)
        low.append(float(np.min(value - _E - exact)))
        high.append(float(np.max(value - later)))
    return (max(high) - min(low)) / 2.0


def _rows() -> dict[int, tuple[int, float, float]]:
    text = (ROOT / "docs" / "numerics.md").read_text("utf-8")
    rows = re.findall(r"^\| (\d+) \| (\d+) \| (\S+) \| (\S+) \|$", text, re.MULTILINE)
    return {int(n): (int(b), float(square), float(whole)) for n, b, square, whole in rows}


def test_the_table_of_sizes_is_there() -> None:
    assert list(_rows()) == [16, 32, 64, 128, 256]


@pytest.mark.parametrize("n", [16, 32, 64, 128, 256])
def test_error_of_a_size_is_what_is_written(n: int) -> None:
    size, square, whole = _rows()[n]
    assert size == 4 * n
    assert _square_error(n) == pytest.approx(square, rel=0.03)
    assert _square_error(n) == pytest.approx((np.log(2.0) / n) ** 3 / 192.0, rel=0.02)
    assert _whole_error(n) == pytest.approx(whole, rel=0.04)


def test_the_size_that_was_taken() -> None:
    """Within 5 % of the proved error of the arithmetic with all its roundings."""
    assert len(exp2_table()) == 64
    assert 0.95 * GAUSS_ERROR < _whole_error(64) <= GAUSS_ERROR


def test_the_longest_stretch_of_one_reading_is_found() -> None:
    readings = np.array([1.0, 1.0, np.nan, np.nan, np.nan, 2.0, 2.0, 2.0, 3.0])
    assert longest_same_s(readings, 1.0) == 3.0
    assert longest_same_s(readings[:0], 1.0) == 0.0
    assert longest_same_s(readings, 10.0) == float("inf"), "rows of 10 s are no single readings"


def test_a_coarse_sensor_is_never_taken_for_stuck() -> None:
    assert [stuck_after_s(s) for s in (0.01, 10.0, 100.0, 101.0, float("inf"))] == [120.0, 200.0, 2000.0, 0.0, 0.0]


@pytest.mark.parametrize("numeric", ["f32", "q31"])
@pytest.mark.parametrize("reading", [0.0, 4095.0, 1e20, -1e20])
def test_no_reading_of_a_channel_leaves_the_authority(numeric: str, reading: float) -> None:
    """A supply of 0 V gave -0.28 deg/h, a raw 4095 42 deg/h, and 1e20 what it liked, all with status 0."""
    term = Term(id="auxiliary", parameters={"slope_dph_per_unit": 0.01, "reference": 28.0}, channel="supply_v")
    guard = Guard(
        low=27.0, high=29.0, max_step=2.0, max_rate_per_min=0.0, agree_s=1.0, stuck_s=0.0,
        missing_s=300.0, fallback=28.0,
    )  # fmt: skip
    model = random_model(4, terms=(term,), guards={"supply_v": guard})
    table = quantise(model, numeric)
    middle = sum(model.envelope.temperature_c) / 2.0
    channels = np.column_stack([np.full(400, middle), np.full(400, 28.0)])
    channels[200:, 1] = reading
    bits = table.encode_inputs(channels)
    found = replay(table, bits, missed=np.zeros(400, dtype=np.int64), samples_per_block=5)
    bias = table.decode_bias(found.bits)
    low, high = table.decode_bias(table.authority)
    assert np.all((bias >= low) & (bias <= high))
    assert abs(bias[-1] - bias[199]) <= 0.0101
    assert found.status[-1] & (CLAMPED | CHANNEL_LOST)


@pytest.mark.parametrize("numeric", ["f32", "q31"])
@pytest.mark.parametrize("seed", range(6))
def test_however_samples_are_missed_results_are_the_same_bits(numeric: str, seed: int) -> None:
    model = random_model(seed, terms=random_terms(seed))
    table = quantise(model, numeric)
    x, missed = random_history(model, seed, 400, 7)
    missed[150] = 6 * 2520
    channels = table.encode_inputs(np.column_stack([x, random_channels(model, seed, 400)]))
    c = runtime()
    status, bits = c.steps(table, channels, missed, 7)
    gaps = np.flatnonzero(missed)
    every = np.full((int(missed[gaps].sum()), channels.shape[1]), table.encode_inputs(np.nan), dtype=np.uint32)
    parts, at, start = [], 0, 0
    for gap in gaps.tolist():
        parts += [channels[start:gap], every[at : at + missed[gap]]]
        at, start = at + int(missed[gap]), gap
    one_by_one = np.concatenate([*parts, channels[start:]])
    there = np.arange(400) + np.cumsum(missed)
    again, found = c.steps(table, one_by_one, np.zeros(len(one_by_one), dtype=np.int64), 7)
    np.testing.assert_array_equal(found[there], bits)
    np.testing.assert_array_equal(again[there, 1:], status[:, 1:])
