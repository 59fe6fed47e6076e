"""Tables: what the rounding costs is bounded, told and refused; the words are those of layout 1."""

from __future__ import annotations

import re
import zlib
from pathlib import Path

import numpy as np
import pytest
from gyrotc.common.errors import CheckFailed, InputError
from gyrotc.model import Model, load_model
from gyrotc.tables.quantise import NUMERICS, quantise
from gyrotc.target.f32 import gauss
from gyrotc.target.maps import evaluate_map
from gyrotc.target.table import MAGIC, Table
from models import random_model

C_TESTS = Path(__file__).resolve().parents[2] / "c"


def worst_error(model: Model, table: Table, seed: int) -> float:
    """Largest |map - model| over random inputs of the envelope, deg/h."""
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    rng = np.random.default_rng(seed)
    points = rng.uniform([t0, r0 / 6.0], [t1, r1 / 6.0], (20000, 2))
    inputs = table.encode_inputs(points)
    _, bits = evaluate_map(table, inputs)
    t, slope = table.decode_inputs(inputs).T
    return float(np.max(np.abs(table.decode_bias(bits) - model.map_dph(t, 6.0 * slope))))


@pytest.mark.parametrize("numeric", NUMERICS)
@pytest.mark.parametrize("seed", range(12))
def test_the_bound_is_above_the_worst_error_found_and_not_far(numeric: str, seed: int) -> None:
    model = random_model(seed)
    table = quantise(model, numeric)
    worst = worst_error(model, table, seed)
    assert worst <= table.error_bound_dph
    assert table.error_bound_dph < 100.0 * worst
    assert sum(table.bound_parts_dph.values()) == pytest.approx(table.error_bound_dph)


@pytest.mark.parametrize("numeric", NUMERICS)
def test_more_than_a_hundredth_of_the_noise_floor_is_refused_with_the_reason(numeric: str) -> None:
    table = quantise(random_model(1), numeric)
    enough = random_model(1, noise_floor_dph=101.0 * table.error_bound_dph, noise_floor_source="estimated")
    assert quantise(enough, numeric).error_bound_dph == table.error_bound_dph
    poor = random_model(1, noise_floor_dph=99.0 * table.error_bound_dph, noise_floor_source="estimated")
    with pytest.raises(CheckFailed, match="1 % of the noise floor"):
        quantise(poor, numeric)


def test_an_unknown_arithmetic_is_refused() -> None:
    with pytest.raises(InputError, match="f32"):
        quantise(random_model(0), "q15")


@pytest.mark.parametrize("numeric", NUMERICS)
def test_the_words_are_those_of_layout_2(numeric: str) -> None:
    model = random_model(4)
    table = quantise(model, numeric)
    words = table.words
    assert words[0] == MAGIC
    assert words[1] == 2 + 65536 * {"f32": 1, "q31": 2}[numeric]
    assert words[2] == len(words)
    assert words[5] == table.id == zlib.crc32(b"rlg_4")
    assert words[-1] == zlib.crc32(np.array(words[1:-1], dtype="<u4").tobytes())
    assert table.table_bytes == 24 + 20 * model.n_centers


def test_the_same_model_gives_the_same_words() -> None:
    assert quantise(random_model(7), "f32").words == quantise(random_model(7), "f32").words


def test_the_gaussian_is_as_good_as_the_bound_says() -> None:
    u = np.linspace(0.0, 2047.4, 300001).astype(np.float32)
    relative = gauss(u) / np.exp2(-u.astype(np.float64) / 64.0) - 1.0
    assert np.max(np.abs(relative)) < 4.3 * 2.0**-24
    assert gauss(np.array([2048.0, 1e30, np.inf], dtype=np.float32)).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("numeric", NUMERICS)
def test_the_table_of_the_c_tests_is_the_one_that_its_model_gives(numeric: str) -> None:
    table = quantise(load_model(C_TESTS / "model.json"), numeric)
    text = (C_TESTS / "table" / "gtc_test_1.c").read_text(encoding="ascii")
    start = text.index(f"gtc_{numeric}_table_t gtc_test_1_{numeric} =")
    found = re.search(r"\.crc = (0x[0-9a-f]+)UL", text[start:])
    assert found is not None
    assert int(found[1], 16) == table.crc, "run tests/c/make_table.py"
