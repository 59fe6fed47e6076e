"""The record of `make targets` and its table on docs/results.md."""

from __future__ import annotations

from typing import Any

from bench.page import Figure, ResultsTable, figures_table
from bench.records import Record

_TEXT = """
{combinations} combinations of architecture, compiler and optimisation; {entries} with each arithmetic counted. Every
result word of the generated C (map, step functions, status) is compared with the reference that is computed from
`model.json`, and recordings are streamed through the step functions. Negative controls are builds with a planted fault.
The self-test (`gtc_<n>_check`) runs on {tables} tables under {builds} sets of flags that may break float32.
"""


def table(record: Record) -> ResultsTable:
    """Return how many targets agree in every bit, and what wrong builds were caught."""
    models, builds = record["models"], [b for b in record["self_test"] if b["differ"] is not None]
    golden = models[0]
    text = _TEXT.format(
        combinations=golden["names"], entries=golden["targets"], tables=record["tables"],
        builds=len(record["self_test"]),
    )  # fmt: skip
    targets = sum(m["targets"] for m in models)
    nav = max(n["differing_lines"] for n in record["nav_loop"])
    controls = record["controls"]
    return figures_table(
        text,
        [
            ("targets × arithmetics × models that pass", Figure(sum(m["passed"] for m in models), at_least=targets)),
            ("result words compared on each, minimum", Figure(min(m["smallest_vectors"] for m in models))),
            ("result words that differ", Figure(sum(m["mismatches"] for m in models), at_most=0)),
            ("rows of replayed recordings that differ", Figure(sum(m["rows_that_differ"] for m in models), at_most=0)),
            (
                f"negative controls caught, of {len(controls)}",
                Figure(sum(c["mismatches"] > 0 for c in controls), at_least=len(controls)),
            ),
            ("tables and builds with a wrong result", Figure(sum(b["differ"] for b in builds))),
            (
                "... of these that pass the self-test",
                Figure(sum(b["differ"] - b["refused"] for b in builds), at_most=0),
            ),
            ("lines of `examples/nav_loop` that differ between board and host", Figure(nav, at_most=0)),
        ],
    )


def quoted(result: dict[str, Any]) -> dict[str, Any]:
    """Return the totals of every model, each target of the golden one, controls and builds."""
    golden = [_quoted_target(t) for t in result["models"][0]["targets"]]
    controls = [{k: c[k] for k in ("control", "name", "numeric", "vectors", "mismatches")} for c in result["controls"]]
    kept = {name: result[name] for name in ("nav_loop", "self_test", "tables")}
    return kept | {"models": [_totals(m) for m in result["models"]], "targets": golden, "controls": controls}


_OF_A_TARGET = (
    "name", "numeric", "status", "compiler", "vectors", "mismatches", "instructions", "cycles", "step_instructions",
    "step_cycles", "code_bytes", "stack_bytes", "step_stack_bytes",
)  # fmt: skip


def _quoted_target(target: dict[str, Any]) -> dict[str, Any]:
    kept = {name: target[name] for name in _OF_A_TARGET if name in target}
    if target["name"] in ("cortex-m0", "cortex-m4f") and "functions" in target:
        kept |= {name: target[name] for name in ("functions", "read_only_bytes")}
    return kept


def _totals(model: dict[str, Any]) -> dict[str, Any]:
    targets = model["targets"]
    replayed = [t["replayed"] for t in targets if "replayed" in t]
    return {name: model[name] for name in ("name", "networks", "centers", "terms", "failed")} | {
        "names": len({t["name"] for t in targets}),
        "targets": len(targets),
        "passed": sum(t["status"] == "pass" for t in targets),
        "smallest_vectors": min(t["vectors"] for t in targets),
        "mismatches": sum(t["mismatches"] for t in targets),
        "rows": sum(r["rows"] for r in replayed),
        "rows_that_differ": sum(r["mismatches"] for r in replayed),
    }
