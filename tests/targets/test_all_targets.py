"""Every target, every arithmetic, in every bit; a missing tool fails."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from emitted import GOLDEN, emitted, recorded
from gyrotc.model import Model, load_model
from gyrotc.verify import all_targets, verify
from metered import metered
from models import bank_with_channels, random_model, with_memories
from results import Results

_KEPT = (
    "name", "numeric", "status", "compiler", "flags", "vectors", "mismatches", "instructions", "cycles",
    "step_instructions", "step_cycles", "stack_bytes", "step_stack_bytes", "code_bytes", "table_bytes",
    "ram_bytes", "replayed", "functions", "read_only_bytes",
)  # fmt: skip


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


MODELS = {
    "golden": lambda: load_model(GOLDEN),
    "wide": _wide_model,
    "terms": lambda: with_memories(load_model(GOLDEN)),
    "bank": lambda: bank_with_channels(load_model(GOLDEN)),
}


@pytest.mark.parametrize("name", MODELS)
def test_every_target_agrees_in_every_bit(name: str, tmp_path: Path, results: Results) -> None:
    model = MODELS[name]()
    folder = emitted(tmp_path / "model", model)
    result = verify(folder, targets=["all"], dataset=recorded(tmp_path / "recordings")).content()
    missing = {(e["name"], e["package"]) for e in result["targets"] if e["status"] == "missing"}
    assert not missing, f"install these packages: {' '.join(sorted({p for _, p in missing}))}"
    wrong = [e for e in result["targets"] if e["status"] != "pass" or e["mismatches"]]
    assert wrong == [] and result["failed"] == 0
    assert all(e["vectors"] >= 20000 for e in result["targets"])
    assert len({e["name"] for e in result["targets"]}) >= 12
    assert all(e["ram_bytes"] == 0 for e in result["targets"])
    assert all(e["read_only_bytes"] > 500 for e in result["targets"]), "tables are constants on every target"
    streamed = [e["replayed"] for e in result["targets"] if all_targets()[e["name"]].reads_input]
    assert all((r["rows"], r["mismatches"]) == (1714, 0) for r in streamed), streamed
    assert {e["name"] for e in result["targets"] if e["numeric"] == "q31"} == set(all_targets())
    results.add("models", _record(name, model, result))


def _record(name: str, model: Model, result: dict[str, Any]) -> dict[str, Any]:
    return {
        "name": name,
        "networks": len(model.networks),
        "centers": sum(len(n.weights) for n in model.networks),
        "terms": [t.id for t in model.terms],
        "passed": result["passed"],
        "failed": result["failed"],
        "targets": [{key: e[key] for key in _KEPT if key in e} for e in result["targets"]],
    }


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
    folder = emitted(tmp_path)
    names = ["cortex-m0", "cortex-m3", "cortex-m4f", "cortex-m7", "rv32imac"]
    first, second = (verify(folder, targets=names).content()["targets"] for _ in range(2))
    assert [e["instructions"] for e in first] == [e["instructions"] for e in second]
