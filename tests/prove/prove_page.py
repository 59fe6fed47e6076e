"""The table of `make prove` on docs/results.md."""

from __future__ import annotations

from bench.page import Figure, ResultsTable, figures_table
from bench.records import Record

_TEXT = """
[proof.md](proof.md) explains what each tool proves. Every pair of positions of a fixed-point table is computed by the
generated C, by integers that are not compiled from `libc/`, and by the model in float64. An alarm is a place that
Frama-C Eva could not prove free of run-time errors for every input; [proof.md](proof.md) argues each.
"""


def table(record: Record) -> ResultsTable:
    """Return what was visited, compared and proved."""
    visits, primitives, parts = (record[name] for name in ("every_input", "primitives", "run_time_errors"))
    gauss = max(p["worst_error"] for p in primitives if p["name"].startswith("fixed") and p["worst_error"])
    return figures_table(
        _TEXT,
        [
            ("inputs of a fixed-point table computed", Figure(max(v["inputs"] for v in visits), ",d", at_least=2**32)),
            ("answers that differ from the reference", Figure(sum(v["mismatches"] for v in visits), at_most=0)),
            (
                "largest deviation from the model over the printed bound",
                Figure(max(v["worst_dph"] / v["bound_dph"] for v in visits), ".2f", at_most=1.0),
            ),
            ("arguments of primitives that differ", Figure(sum(p["differ"] for p in primitives), at_most=0)),
            ("error of a Gaussian in fixed point", Figure(gauss, ".2e")),
            ("parts of the C code without an alarm", Figure(sum(not p["alarms"] for p in parts))),
            ("parts with alarms that have an argument", Figure(sum(bool(p["alarms"]) for p in parts))),
            ("claims about rounding that are proved", Figure(len(record["rounding"]))),
        ],
    )
