"""The section `prove` of docs/results.md, from docs/results/prove.json."""

from __future__ import annotations

from typing import Any

from results import table

__all__ = ["section"]

_EVERY = """## Every input, no run-time error, rounding (`make prove`)

{machine}. What is proved by which tool and what it adds up to: [proof.md](proof.md).

Every pair of positions of a fixed-point table: the emitted C against integers that are not compiled from `libc/`, and
against the model in float64. Worst departure: over all inputs that a pair stands for; arithmetic: without the
rounding of the inputs; both in deg/h.
"""
_PRIMITIVES = """Primitives over their arguments, against formulas written apart:
"""
_EVA = """Frama-C Eva over the emitted C (map, mean, slope, every step function): any input, any state that the
invariant allows; alarms: what could not be shown free of run-time errors.
"""
_ROUNDING = """Rounding of one Gaussian term and of the shifts; a bound or a shift that is wrong is not proved.
"""


def section(result: dict[str, Any]) -> str:
    """The section as text."""
    parts = [
        _EVERY.format(machine=result["machine"]),
        table(
            ["table", "centers ", "inputs ", "mismatches ", "worst departure ", "arithmetic ", "÷ Σ\\|w\\| ",
             "printed bound ", "s "],
            [_visit_row(v) for v in result["every_input"]],
        ),
        _PRIMITIVES,
        table(
            ["primitive", "arguments ", "that differ "],
            [[p["name"], p["arguments"], p["differ"]] for p in result["primitives"]],
        ),
        _EVA,
        table(
            ["part", "arithmetic", "machine", "statements reached ", "alarms ", "checks proved "],
            [[e["part"], e["numeric"], e["machine"], e["reached"], e["alarms"], e["checks"]]
             for e in result["run_time_errors"]],
        ),
        _ROUNDING,
        table(["claim", "tool", "proved"], [[r["claim"], r["tool"], r["proved"]] for r in result["rounding"]]),
    ]  # fmt: skip
    return "\n".join(parts)


def _visit_row(v: dict[str, Any]) -> list[object]:
    return [
        v["name"],
        v["centers"],
        f"{v['inputs']:,}",
        v["mismatches"],
        f"{v['worst_dph']:.3e}",
        f"{v['arithmetic_dph']:.3e}",
        f"{v['arithmetic_dph'] / v['sum_abs_weights_dph']:.2e}",
        f"{v['bound_dph']:.3e}",
        f"{v['wall_s']:.0f}",
    ]
