"""Every target, every arithmetic, in every bit; a missing tool fails."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from emitted import emitted
from gyrotc.model import Model, load_model
from gyrotc.toolchain import all_targets
from gyrotc.verify import verify
from metered import metered
from models import random_model

BUILD = Path(__file__).resolve().parents[2] / "build"


def _wide_model() -> Model:
    """64 centers on a lattice over the envelope, anisotropic widths, weights of both signs."""
    model = random_model(64)
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    centers = [(t0 + (t1 - t0) * i / 7, r0 + (r1 - r0) * j / 7) for i in range(8) for j in range(8)]
    network = model.networks[0].model_copy(
        update={
            "centers": tuple(centers),
            "widths": tuple((0.3 + 0.02 * (k % 9), 0.4 + 0.03 * (k % 7)) for k in range(64)),
            "weights": tuple(0.01 * (-1) ** k / (1 + k % 5) for k in range(64)),
        }
    )
    return model.model_copy(update={"networks": (network,)})


MODELS = {"golden": None, "wide": _wide_model()}


@pytest.mark.parametrize("name", MODELS)
def test_every_target_agrees_in_every_bit(name: str, tmp_path: Path) -> None:
    folder = emitted(tmp_path, MODELS[name])
    result = verify(folder, targets=["all"])
    _keep(name, result)
    assert [e["package"] for e in result["targets"] if e["status"] == "missing"] == []
    wrong = [e for e in result["targets"] if e["status"] != "pass" or e["mismatches"]]
    assert wrong == [] and result["failed"] == 0
    assert all(e["vectors"] >= 20000 for e in result["targets"])
    assert len({e["name"] for e in result["targets"]}) >= 12
    assert all(e["ram_bytes"] == 0 for e in result["targets"])
    assert {e["name"] for e in result["targets"] if e["numeric"] == "q31"} == set(all_targets())


def _keep(name: str, result: dict[str, Any]) -> None:
    """The table of results, for docs/results.md and for whoever reads the log."""
    BUILD.mkdir(exist_ok=True)
    (BUILD / f"targets-{name}.json").write_text(json.dumps(result, indent=1))
    for e in result["targets"]:
        cost = e.get("instructions") or e.get("cycles") or {}
        print(
            f"{name:7s} {e['name']:15s} {e['numeric']} {e['status']:4s} {e.get('vectors')} vectors "
            f"{e.get('mismatches')} differ, call {cost.get('mean', '-')} (max {cost.get('max', '-')}), "
            f"code {e.get('code_bytes')}, stack {e.get('stack_bytes', '-')}"
        )


@pytest.mark.parametrize("name", [n for n, t in all_targets().items() if t.counts])
def test_meter_counts_instructions_cycles_and_stack(name: str, tmp_path: Path) -> None:
    """See meter.c: 2001 instructions (AVR: 4001 cycles, of which the counter sees every eighth), 40 bytes."""
    counts, stack = metered(name, tmp_path)
    if all_targets()[name].counts == "cycles":
        assert counts == pytest.approx(4001, abs=8)
    else:
        assert counts == pytest.approx(2001, abs=0.3)
    assert stack == 40


def test_instruction_counts_repeat_exactly(tmp_path: Path) -> None:
    folder = emitted(tmp_path, load_model(Path(__file__).parents[2] / "examples" / "minimal" / "model.json"))
    names = ["cortex-m0", "cortex-m3", "cortex-m4f", "cortex-m7", "rv32imac"]
    first, second = (verify(folder, targets=names)["targets"] for _ in range(2))
    assert [e["instructions"] for e in first] == [e["instructions"] for e in second]
