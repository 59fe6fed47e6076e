"""The reference gives the same bits as the compiled runtime: maps, histories, self-test."""

from __future__ import annotations

import ctypes
from dataclasses import replace

import numpy as np
import pytest
from conftest import quick_and_slow
from gyrotc.tables.quantise import NUMERICS, quantise
from gyrotc.target.history import replay
from gyrotc.target.maps import evaluate_map
from gyrotc.target.q31 import GAUSS_ERROR, exp2
from gyrotc.target.status import HELD
from gyrotc.target.table import f32_words
from libc_build import runtime
from models import bank_of, random_channels, random_history, random_model, random_terms

COUNTED = '-DGTC_CONFIG_HEADER="libc_counted.h"'
BUILDS = [
    ("gcc", ("-O2",)),
    ("clang", ("-O3",)),
    ("gcc", ("-O0", COUNTED)),
    ("gcc", ("-O2", COUNTED, "-DGTC_HALF_MULTIPLY=1")),
]


@pytest.mark.parametrize("numeric", NUMERICS)
@pytest.mark.parametrize("build", BUILDS, ids=str)
@pytest.mark.parametrize("seed", quick_and_slow(range(6), range(6, 12)))
def test_maps_agree_bit_for_bit(numeric: str, build: tuple[str, tuple[str, ...]], seed: int) -> None:
    model = random_model(seed)
    table = quantise(model, numeric)
    rng = np.random.default_rng(seed)
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    low, high = np.array([t0, r0 / 6.0]), np.array([t1, r1 / 6.0])
    inside = rng.uniform(1.2 * low - 0.2 * high, 1.2 * high - 0.2 * low, (3000, 2))
    inputs = np.concatenate([table.encode_inputs(inside), rng.integers(0, 2**32, (3000, 2), dtype=np.uint32)])
    status, bits = evaluate_map(table, inputs)
    c = runtime(*build)
    got_status, got_bits = c.maps(table, inputs)
    np.testing.assert_array_equal(status, got_status)
    np.testing.assert_array_equal(bits, got_bits)
    assert c.out_of_range() == 0


@pytest.mark.parametrize("numeric", NUMERICS)
@pytest.mark.parametrize("seed", quick_and_slow(range(16), range(16, 40)))
def test_histories_with_faults_agree_bit_for_bit(numeric: str, seed: int) -> None:
    model = random_model(seed)
    table = quantise(model, numeric)
    samples_per_block = int(np.random.default_rng(seed).choice([1, 2, 3, 7, 10, 50]))
    x, missed = random_history(model, seed, 1500, samples_per_block)
    channels = table.encode_inputs(x[:, None])
    want = replay(table, channels, missed=missed, samples_per_block=samples_per_block)
    c = runtime("gcc", ("-O2", COUNTED))
    status, bits = c.steps(table, channels, missed, samples_per_block)
    np.testing.assert_array_equal(want.missed_status, status[:, 0])
    np.testing.assert_array_equal(want.sample_status, status[:, 1])
    np.testing.assert_array_equal(want.status, status[:, 2])
    np.testing.assert_array_equal(want.bits, bits)
    assert c.out_of_range() == 0


@pytest.mark.parametrize("numeric", NUMERICS)
@pytest.mark.parametrize("seed", quick_and_slow(range(16), range(16, 40)))
def test_terms_agree_bit_for_bit(numeric: str, seed: int) -> None:
    model = random_model(seed, terms=random_terms(seed))
    table = quantise(model, numeric)
    samples_per_block = int(np.random.default_rng(seed).choice([1, 2, 7, 50]))
    x, missed = random_history(model, seed, 1500, samples_per_block)
    missed[700] = 10**6
    channels = table.encode_inputs(np.column_stack([x, random_channels(model, seed, 1500)]))
    want = replay(table, channels, missed=missed, samples_per_block=samples_per_block)
    c = runtime("gcc", ("-O2", COUNTED))
    assert c.check(table) == 0
    status, bits = c.steps(table, channels, missed, samples_per_block)
    np.testing.assert_array_equal(want.sample_status, status[:, 1])
    np.testing.assert_array_equal(want.status, status[:, 2])
    np.testing.assert_array_equal(want.bits, bits)
    assert c.out_of_range() == 0


@pytest.mark.parametrize("numeric", NUMERICS)
@pytest.mark.parametrize("seed", range(10))
def test_banks_agree_bit_for_bit_and_keep_to_their_bound(numeric: str, seed: int) -> None:
    model = bank_of(random_model(seed))
    table = quantise(model, numeric)
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    points = np.random.default_rng(seed).uniform([t0, r0 / 6.0], [t1, r1 / 6.0], (4000, 2))
    inputs = table.encode_inputs(points)
    status, bits = evaluate_map(table, inputs)
    got_status, got_bits = runtime().maps(table, inputs)
    np.testing.assert_array_equal(status, got_status)
    np.testing.assert_array_equal(bits, got_bits)
    t, slope = table.decode_inputs(inputs).T
    worst = np.max(np.abs(table.decode_bias(bits) - model.map_dph(t, 6.0 * slope)))
    assert worst <= table.error_bound_dph


def test_every_status_bit_was_seen_in_the_histories() -> None:
    seen = 0
    for seed in range(12):
        model = random_model(seed)
        table = quantise(model, "f32")
        x, missed = random_history(model, seed, 800, 4)
        steps = replay(table, table.encode_inputs(x[:, None]), missed=missed, samples_per_block=4)
        seen |= int(np.bitwise_or.reduce(steps.sample_status))
    assert seen == 1 | 2 | 4 | 8 | 16


@pytest.mark.parametrize("numeric", NUMERICS)
@pytest.mark.parametrize("seed", range(6))
def test_before_the_first_correction_the_bias_is_nothing_and_told(numeric: str, seed: int) -> None:
    """`evaluate` scores no such row: a gyro of 16,000 deg/h had 349 deg/h of two rows without a correction."""
    model = random_model(seed)
    table = quantise(model, numeric)
    x, missed = random_history(model, seed, 400, 4)
    found = replay(table, table.encode_inputs(x[:, None]), missed=missed, samples_per_block=4)
    waiting = ~found.begun
    assert found.begun[-1] and (waiting[0] or model.agree_s == 0.0), "one reading alone is not believed"
    assert np.all(np.diff(found.begun.astype(int)) >= 0), "once begun it goes on"
    assert np.all(found.bits[waiting] == 0) and np.all(found.status[waiting] == HELD)


@pytest.mark.parametrize("numeric", NUMERICS)
@pytest.mark.parametrize("seed", range(6))
def test_self_test_passes(numeric: str, seed: int) -> None:
    assert runtime().check(quantise(random_model(seed), numeric)) == 0


def test_self_test_finds_a_changed_weight_by_its_checksum_and_a_changed_probe_by_its_answer() -> None:
    table = quantise(random_model(3), "f32")
    c = runtime()
    struct, keep = c.struct(table)
    check = c.function("f32", "check")
    keep[1][4] ^= 1
    assert check(ctypes.byref(struct)) == -4
    keep[1][4] ^= 1
    assert check(ctypes.byref(struct)) == 0
    probes = table.probes.copy()
    probes[2] ^= 1
    assert c.check(replace(table, probes=probes)) == -3


def test_self_test_finds_fused_multiply_add() -> None:
    fused = runtime("gcc", ("-O2", "-ffp-contract=fast", "-mfma"))
    assert fused.check(quantise(random_model(0), "f32")) == -3


@pytest.mark.slow
def test_the_fixed_point_gaussian_is_within_its_bound_for_every_argument() -> None:
    """All u below 1 (2^24 of them), then a stretch of each further octave, at both ends of what truncates to u."""
    octaves = [np.arange(k << 24, (k << 24) + (1 << 24 if k == 0 else 1 << 16)) for k in range(32)]
    for u in octaves:
        e = exp2(u.astype(np.uint64)).astype(np.float64) * 2.0**-29
        for end in (u, u + 1):
            worst = float(np.max(np.abs(e - np.exp2(-end / 2.0**24))))
            assert worst < GAUSS_ERROR


def test_a_negative_zero_does_not_reach_a_table() -> None:
    assert f32_words([-0.0]).tolist() == [0]
