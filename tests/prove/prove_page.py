"""The section `prove` of docs/results.md."""

from __future__ import annotations

from typing import Any

from results import table

_EVERY = """## Every input, no run-time error, rounding (`make prove`)

{machine}. What is proved by which tool and what it adds up to: [proof.md](proof.md).

Every pair of positions of a fixed-point table: the emitted C against integers that are not compiled from `libc/`, and
against the model in float64, in deg/h. Worst departure: over all inputs that a pair stands for; arithmetic: without
the rounding of the inputs (most of it is the rounding of the parameters).
"""
_PRIMITIVES = """Primitives over their arguments, against independent formulas. The error of a Gaussian times Σ|w| is
what the arithmetic adds to the surface that the rounded parameters make:
"""
_EVA = """Frama-C Eva over the emitted C (map, mean, slope, every step function, every term): any input, any state that
the invariant allows. Alarms: what it could not show free of run-time errors; [proof.md](proof.md) has the argument.
"""
_BUDGET = """Error budget of the golden model (proof.md, section 3): blocks of 1000 samples that spread by 0.1 C, at
80 C and 0.4 C a block; found: in random histories of any steepness, blocks of 1 to 1000 samples.
"""
_ROUNDING = """Rounding of one Gaussian term and of the shifts; a bound or a shift that is wrong is not proved.
"""


def section(result: dict[str, Any]) -> str:
    """The section as text."""
    parts = [
        _EVERY.format(machine=result["machine"]),
        table(
            ["table", "centers ", "inputs ", "mismatches ", "worst departure ", "arithmetic ",
             "printed bound ", "s ", "CPU s "],
            [_visit_row(v) for v in result["every_input"]],
        ),
        _PRIMITIVES,
        table(
            ["primitive", "arguments ", "that differ ", "error from exp(-x) "],
            [
                [p["name"], p["arguments"], p["differ"], f"{p['worst_error']:.2e}" if p["worst_error"] else "-"]
                for p in result["primitives"]
            ],
        ),
        _EVA,
        table(
            ["part", "arithmetic", "machine", "statements reached ", "alarms ", "checks proved "],
            [[e["part"], e["numeric"], e["machine"], e["reached"], e["alarms"], e["checks"]]
             for e in result["run_time_errors"]],
        ),
        _BUDGET,
        table(
            ["arithmetic", "part", "bound, deg/h ", "largest error found, C "],
            [
                [b["numeric"], b["part"], f"{b['bound_dph']:.2e}", f"{b['found_c']:.2e}" if "found_c" in b else "-"]
                for b in result["error_budget"]
            ],
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
        f"{v['bound_dph']:.3e}",
        f"{v['wall_s']:.0f}",
        f"{v['cpu_s']:.0f}",
    ]
