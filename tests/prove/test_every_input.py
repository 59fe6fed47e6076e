"""Every one of the 2^32 pairs of positions of a fixed-point table, and every argument of the Gaussians."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import pytest
from emitted import GOLDEN, emitted
from gyrotc.emit import emitted_tables
from gyrotc.model import Model, load_model
from gyrotc.verify.exhaustive import visit_all
from test_primitives import F32_GAUSS_ERROR, _run

BUILD = Path(__file__).resolve().parents[2] / "build"


def _wide_envelope() -> Model:
    """The golden network over ±5 C/min, so that every position of the slope can be reached."""
    model = load_model(GOLDEN)
    envelope = model.envelope.model_copy(update={"slope_c_per_min": (-5.0, 5.0)})
    return model.model_copy(update={"envelope": envelope, "coverage": None})


@pytest.mark.parametrize(
    ("name", "model", "inputs"), [("wide", _wide_envelope(), 2**32), ("golden", None, None)]
)
def test_every_input_agrees_and_keeps_the_bound(
    name: str, model: Model | None, inputs: int | None, tmp_path: Path
) -> None:
    folder = emitted(tmp_path, model)
    model = load_model(folder / "model.json")
    table = emitted_tables(folder / "c", model)["q31"]
    start = time.monotonic()

    def progress(text: str) -> None:
        if sys.stderr.isatty():
            print(f"\r{name}: {text}", end="", file=sys.stderr, flush=True)

    visited = visit_all(folder / "c", model, table, progress=progress)
    taken = time.monotonic() - start
    BUILD.mkdir(exist_ok=True)
    result = {
        "inputs": visited.inputs,
        "mismatches": visited.mismatches,
        "worst_dph": visited.worst_dph,
        "arithmetic_dph": visited.arithmetic_dph,
        "mean_dph": visited.mean_dph,
        "bound_dph": table.error_bound_dph,
        "sum_abs_weights_dph": model.sum_abs_weights_dph,
        "centers": table.n_centers,
        "wall_s": round(taken, 1),
    }
    (BUILD / f"prove-{name}.json").write_text(json.dumps(result, indent=1) + "\n")
    print(f"{name}: {result}")
    assert visited.mismatches == 0, visited.first
    assert visited.inputs == (inputs or visited.inputs) > 2**31
    assert visited.worst_dph <= table.error_bound_dph
    arithmetic = sum(v for k, v in table.bound_parts_dph.items() if k != "rounded inputs")
    assert visited.arithmetic_dph <= arithmetic


def test_every_argument_of_the_float32_gaussian(tmp_path: Path) -> None:
    visited, wrong, worst = _run("primitives_f32", tmp_path)["gauss"]
    assert (int(visited), wrong) == (0x45800000, "0")
    assert float(worst) <= F32_GAUSS_ERROR
