"""The reference gives the bits of the compiled runtime; limits of words and status bits are the same in both."""

from __future__ import annotations

import ctypes
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gyrotc.common import CheckFailed
from gyrotc.mirror import (
    ARRAYS,
    HELD,
    Course,
    Table,
    TermOutcome,
    evaluate_map,
    f32_words,
    recursions_of_table,
    replay,
)
from gyrotc.mirror import table as layout
from gyrotc.model import Term
from gyrotc.tables import NUMERICS, outside, quantise
from libc_build import runtime
from models import bank_of, bank_with_channels, random_history, random_model, random_terms

COUNTED = '-DGTC_CONFIG_HEADER="libc_counted.h"'
BUILDS = [
    ("gcc", ("-O2",)),
    ("clang", ("-O3",)),
    ("gcc", ("-O0", COUNTED)),
    ("gcc", ("-O2", COUNTED, "-DGTC_HALF_MULTIPLY=1")),
]


@pytest.mark.parametrize("numeric", NUMERICS)
@pytest.mark.parametrize("build", BUILDS, ids=str)
@pytest.mark.parametrize("seed", range(6))
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
def test_a_play_of_one_strength_is_what_it_was(numeric: str) -> None:
    """Two words of its record, and nothing in a table that has no play over T; at the reference there is no growth."""
    one = {"width_c": 2.0, "amplitude_dph_per_c": 1e-3}
    over_t = {**one, "amplitude_dph_per_c_per_c": 2e-5, "reference_c": 12.0}
    plain, grown = (
        quantise(random_model(1, terms=(Term(id="hysteresis", parameters=p),)), numeric) for p in (one, over_t)
    )
    records = plain.records("terms")[0], grown.records("terms")[0]
    assert not records[0][4:].any() and np.array_equal(records[0][:4], records[1][:4]), "width and amplitude"
    at = np.array([12.0, 20.0, 12.0, 4.0, 12.0])
    x, unit = (
        (at.astype(np.float32), 1.0)
        if numeric == "f32"
        else ((at * 65536.0).astype(np.int64), 2.0**-plain.bias_frac_bits)
    )
    added = []
    for table in (plain, grown):
        outcome = TermOutcome(x, np.zeros_like(x), np.zeros_like(x), np.zeros(5, dtype=np.int32))
        recursions_of_table(table)[0].apply(Course(x, np.arange(5) > 0, np.arange(5)), None, outcome)
        added.append(outcome.added * unit)
    assert added[1][[2, 4]] == pytest.approx(added[0][[2, 4]], abs=2e-6), "at the reference"
    assert added[1][1] == pytest.approx(added[0][1] * (1e-3 + 8.0 * 2e-5) / 1e-3, rel=1e-4, abs=2e-6)
    assert added[1][3] == pytest.approx(added[0][3] * (1e-3 - 8.0 * 2e-5) / 1e-3, rel=1e-4, abs=2e-6)


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
def test_before_the_first_correction_the_bias_is_nothing_and_reported(numeric: str, seed: int) -> None:
    """`evaluate` scores no such row: a gyro of 16,000 deg/h had 349 deg/h of two rows without a correction."""
    model = random_model(seed)
    table = quantise(model, numeric)
    x, missed = random_history(model, seed, 400, 4)
    found = replay(table, table.encode_inputs(x[:, None]), missed=missed, samples_per_block=4)
    waiting = ~found.begun
    assert found.begun[-1] and (waiting[0] or model.agree_s == 0.0), "one reading alone is not accepted"
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


def test_a_negative_zero_does_not_reach_a_table() -> None:
    assert f32_words([-0.0]).tolist() == [0]


LAYOUT, SELF_TEST = -2, -3
SCALARS = ("slope_blocks", "lead_blocks", "calibrated", "block_us", "bias_frac_bits", "fallback", "rezero")
EDGES = [0, 1, 2, 0xFFFF, 0x10000, 0x3FFFFFFF, 0x40000000, 0x7FFFFFFF, 0x80000000, 0x80000001, 0xFFFFFFFF]
EDGES += [0x7F800000, 0x7FC00000, 0x4E6E6B28, 0x42C80000, 0x3F800000, 0xBF800000, 0x4AE4E1C0]


def _models() -> list:
    plain = random_model(4)
    return [plain, random_model(7, terms=random_terms(3)), bank_with_channels(plain)]


def _word(rng: np.random.Generator, old: int) -> int:
    ways = [int(rng.integers(2**32)), int(rng.choice(EDGES)), old ^ (1 << int(rng.integers(32)))]
    ways.append(old + int(rng.integers(-3, 4)))
    return int(rng.choice(np.array(ways, dtype=np.int64))) & 0xFFFFFFFF


def _spoiled(rng: np.random.Generator, table: Table) -> Table:
    """The table with one word changed; kinds of terms stay, because a linked table comes with their code."""
    at = int(rng.integers(14))
    if at < 2:
        name = str(rng.choice(SCALARS))
        return replace(table, **{name: _word(rng, getattr(table, name))})
    if at < 7:
        name = ("scale", "envelope", "envelope", "authority", "effect")[at - 2]
        words = list(getattr(table, name))
        k = int(rng.integers(len(words)))
        words[k] = _word(rng, words[k])
        return replace(table, **{name: tuple(words)})
    names = [n for n in ("networks", "centers", "guards", "guards", "terms", "sigma") if getattr(table, n).size]
    name = str(rng.choice(names))
    array = getattr(table, name).copy()
    k = int(rng.integers(array.size))
    if name != "terms" or k % ARRAYS["terms"] != 0:
        array[k] = _word(rng, int(array[k]))
    return replace(table, **{name: array})


@pytest.mark.parametrize("numeric", ["f32", "q31"])
def test_generator_and_runtime_refuse_the_same_tables(numeric: str) -> None:
    seed = int(np.random.SeedSequence().entropy % 2**32)
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    refused = taken = 0
    for model in _models():
        table = quantise(model, numeric)
        assert outside(table) is None
        assert runtime().check_words(table) == 0
        for _ in range(500):
            spoiled = _spoiled(rng, table)
            reason, status = outside(spoiled), runtime().check_words(spoiled)
            assert (status == LAYOUT) == (reason is not None), (reason, status, spoiled)
            assert status in (0, LAYOUT)
            refused, taken = refused + (reason is not None), taken + (reason is None)
    assert min(refused, taken) > 100


@pytest.mark.parametrize("numeric", ["f32", "q31"])
def test_both_refuse_a_table_of_more_than_16384_words(numeric: str) -> None:
    table = quantise(random_model(4), numeric)
    for n_probes, refused in ((3500, False), (4096, True)):
        large = replace(table, probes=np.zeros(4 * n_probes, np.uint32))
        assert (outside(large) is not None) == refused
        assert runtime().check_words(large) == (LAYOUT if refused else 0)


@pytest.mark.filterwarnings("ignore:.*encountered in:RuntimeWarning")
@pytest.mark.parametrize("numeric", ["f32", "q31"])
def test_a_model_whose_table_the_runtime_would_refuse_is_not_emitted(numeric: str) -> None:
    model = random_model(4)
    narrow = (model.scale.temperature_c[0], 1e-300)
    scale = model.scale.model_copy(update={"temperature_c": narrow})
    with pytest.raises(CheckFailed):
        quantise(model.model_copy(update={"scale": scale}), numeric)


HEADER = Path(__file__).resolve().parents[3] / "include" / "gtc.h"


def test_the_bits_of_python_are_those_of_the_header() -> None:
    statuses = HEADER.read_text("utf-8").split("#define GTC_OK", 1)[1].split("#define GTC_TEMP_MISSING", 1)[0]
    found = re.findall(r"#define GTC_(\w+) \(?(-?\d+)\)?", "#define GTC_OK" + statuses)
    known = {
        name: value for name, value in vars(layout).items() if name.isupper() and name[0] != "_" and type(value) is int
    }
    others = {"LAYOUT", "MAGIC", "MISSING_Q31", "SERIAL_WORDS"}
    assert {name: int(value) for name, value in found} == {n: v for n, v in known.items() if n not in others}
