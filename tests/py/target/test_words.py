"""The limits of a table's words: the same in the runtime, in the generator and in docs/FORMAT.md."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gyrotc.common.errors import CheckFailed
from gyrotc.tables.quantise import _limits, outside, quantise
from gyrotc.target.table import ARRAYS, Table
from libc_build import ROOT, runtime
from models import bank_with_channels, random_model, random_terms

LAYOUT, SELF_TEST = -2, -3
SCALARS = (
    "slope_blocks",
    "lead_blocks",
    "calibrated",
    "block_us",
    "bias_frac_bits",
    "fallback",
    "rezero",
)
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
    names = [
        n for n in ("networks", "centers", "guards", "guards", "terms", "sigma") if getattr(table, n).size
    ]
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
        assert runtime().check(table) == 0
        for _ in range(500):
            spoiled = _spoiled(rng, table)
            reason, status = outside(spoiled), runtime().check(spoiled)
            assert (status == LAYOUT) == (reason is not None), (reason, status, spoiled)
            assert status in (0, LAYOUT, SELF_TEST)
            refused, taken = refused + (reason is not None), taken + (reason is None)
    assert min(refused, taken) > 100


@pytest.mark.filterwarnings("ignore:.*encountered in:RuntimeWarning")
@pytest.mark.parametrize("numeric", ["f32", "q31"])
def test_a_model_whose_table_the_runtime_would_refuse_is_not_emitted(numeric: str) -> None:
    model = random_model(4)
    narrow = (model.scale.temperature_c[0], 1e-300)
    scale = model.scale.model_copy(update={"temperature_c": narrow})
    with pytest.raises(CheckFailed):
        quantise(model.model_copy(update={"scale": scale}), numeric)


def test_every_range_stands_in_the_documentation() -> None:
    text = (Path(ROOT) / "docs" / "FORMAT.md").read_text(encoding="utf-8")
    for f32, q31 in zip(_flat("f32"), _flat("q31"), strict=True):
        row = f"| {f32[0]} | {_range(*f32[1:])} | {_range(*q31[1:])} |"
        assert f32[0] == q31[0]
        assert f32[0] == "what a term does not use" or row in text, row


def _flat(numeric: str) -> list[tuple[str, float, float]]:
    return [row for part in _limits(numeric) for row in part]


def _range(least: float, most: float) -> str:
    return f"{least:.10g}" if least == most else f"{least:.10g} ... {most:.10g}"
