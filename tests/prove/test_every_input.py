"""Every one of the 2^32 pairs of positions of a fixed-point table, and every argument of the Gaussians."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from emitted import GOLDEN, emitted
from gyrotc.common import Progress
from gyrotc.common.progress import silent
from gyrotc.model import Model, load_model
from gyrotc.tables import emitted_tables
from gyrotc.verify import visit_all
from results import Results
from test_primitives import CURVE_ERROR, F32_CURVE_ERROR, F32_GAUSS_ERROR, printed_by


def _golden() -> Model:
    return load_model(GOLDEN)


def _wide_envelope() -> Model:
    """The golden network over ±5 C/min, so that every position of the slope can be reached."""
    model = _golden()
    envelope = model.envelope.model_copy(update={"slope_c_per_min": (-5.0, 5.0)})
    return model.model_copy(update={"envelope": envelope, "coverage": None})


MODELS = {"every position reached": (_wide_envelope, 2**32), "golden": (_golden, None)}


@pytest.fixture
def bar() -> Iterator[Progress]:
    """Yield what shows progress on the terminal, past what captures output; nothing is shown without a terminal."""
    try:
        number = os.open("/dev/tty", os.O_WRONLY)
    except OSError:
        yield silent
        return
    with os.fdopen(number, "w", encoding="utf-8") as terminal:
        yield lambda stage, done, total: print(f"\r{stage}, {done / total:.0%}   ", end="", file=terminal, flush=True)
        print(file=terminal)


@pytest.mark.parametrize("name", MODELS)
def test_every_input_agrees_and_keeps_the_bound(name: str, tmp_path: Path, results: Results, bar: Progress) -> None:
    make, inputs = MODELS[name]
    folder = emitted(tmp_path, make())
    model = load_model(folder / "model.json")
    table = emitted_tables(folder / "c", model)["q31"]
    start, before = time.monotonic(), os.times()
    visited = visit_all(folder / "c", model, table, progress=bar)
    after = os.times()
    results.add(
        "every_input",
        {
            "name": name,
            "centers": table.n_centers,
            "inputs": visited.inputs,
            "mismatches": visited.mismatches,
            "worst_dph": visited.worst_dph,
            "arithmetic_dph": visited.arithmetic_dph,
            "mean_dph": visited.mean_dph,
            "bound_dph": table.error_bound_dph,
            "sum_abs_weights_dph": model.sum_abs_weights_dph,
            "wall_s": round(time.monotonic() - start, 1),
            "cpu_s": round(after.children_user - before.children_user, 1),
        },
    )
    assert visited.mismatches == 0, visited.first
    assert visited.inputs == (inputs or visited.inputs) > 2**31
    assert visited.worst_dph <= table.error_bound_dph
    arithmetic = sum(v for k, v in table.bound_parts_dph.items() if k != "rounded inputs")
    assert visited.arithmetic_dph <= arithmetic


def test_every_argument_of_the_float32_gaussian_and_of_is_missing(tmp_path: Path, results: Results) -> None:
    """The proofs of the step functions take the second for granted (tests/prove/eva/step.c)."""
    found = printed_by("primitives_f32", tmp_path)
    visited, wrong, worst = found["gauss"]
    _add(results, "float32: gauss", visited, wrong, float(worst))
    _add(results, "float32: missing or a number", *found["missing"])
    assert (int(visited), wrong) == (0x45800000, "0")
    assert float(worst) <= F32_GAUSS_ERROR
    assert (int(found["missing"][0]), found["missing"][1]) == (2**32, "0")


@pytest.mark.parametrize("half", [0, 1], ids=["long multiply", "16-bit halves"])
def test_every_argument_of_the_fixed_point_gaussian(half: int, tmp_path: Path, results: Results) -> None:
    """Of the other primitives: every input of some ranges, corners and random arguments."""
    found = printed_by("primitives_q31", tmp_path, half=half)
    kind = f"fixed point, {'16-bit halves' if half else 'long multiply'}"
    for name, (visited, wrong, *worst) in found.items():
        _add(results, f"{kind}: {name}", visited, wrong, *(float(units) * 2.0**-29 for units in worst))
    assert {words[1] for words in found.values()} == {"0"}
    assert int(found["gauss"][0]) == 2**29


@pytest.mark.parametrize("half", [0, 1], ids=["long multiply", "16-bit halves"])
def test_every_reading_of_a_channel_in_fixed_point(half: int, tmp_path: Path, results: Results) -> None:
    """The two Gaussians of a curve, for three records with the ends of their ranges among them."""
    visited, wrong, worst = printed_by("primitives_q31", tmp_path, "curve", "1", half=half)["curve"]
    kind = f"fixed point, {'16-bit halves' if half else 'long multiply'}"
    _add(results, f"{kind}: curve", visited, wrong, float(worst))
    assert (int(visited), wrong) == (3 * (2**32 - 1), "0")
    assert float(worst) <= CURVE_ERROR


def test_every_reading_of_a_channel_in_float32(tmp_path: Path, results: Results) -> None:
    """NaN and infinity among them: the sum is a number all the same."""
    visited, wrong, worst = printed_by("primitives_f32", tmp_path, "curve", "1")["curve"]
    _add(results, "float32: curve", visited, wrong, float(worst))
    assert (int(visited), wrong) == (3 * 2**32, "0")
    assert float(worst) <= F32_CURVE_ERROR


def _add(results: Results, name: str, visited: str, wrong: str, worst: float | None = None) -> None:
    record = {"name": name, "arguments": int(visited), "differ": int(wrong), "worst_error": worst}
    results.add("primitives", record)
