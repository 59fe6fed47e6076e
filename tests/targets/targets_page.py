"""The section `targets` of docs/results.md."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from results import table

_HEAD = """## Every target, bit for bit (`make targets`)

{combinations} combinations of architecture, compiler and optimisation, {entries} with their arithmetics. Every result
word of the emitted C (map, step functions, statuses) against the reference computed from `model.json`; recordings
streamed through the step functions besides.
"""
_COSTS = """Cost with the golden model ({centers} centers): instructions of a map call, mean (largest); of a call of
`sample`, the largest (it closes a block); bytes of code that a program with both links, of stack below the caller.
Counted in emulators; AVR: cycles. float32 is not offered where the compiler does not keep to its arithmetic.
"""
_FUNCTIONS = """Public functions on {target} ({arithmetic}): bytes of code, of the function with all that it calls (what
several call is linked once); of stack, by its graph of calls, the deepest one counted; both whatever terms a table has,
without those of the compiler's own functions that are named. A program with the self-test, a state and its samples
links {read_only} bytes of constants, the table's among them.
"""
_CONTROLS = """Negative controls: builds that are wrong on purpose. Each ran to its end; that many results differed.
"""
_NAV = """`examples/nav_loop`, firmware in the emulated board against the host: lines that differ, and the angle over
20 minutes.
"""


def section(result: dict[str, Any]) -> str:
    """The section as text."""
    golden = result["models"][0]
    parts = [
        _HEAD.format(combinations=golden["names"], entries=golden["targets"]),
        table(
            ["model", "networks ", "centers ", "terms", "targets × arithmetics ", "vectors each ", "mismatches ",
             "rows replayed ", "rows that differ "],
            [_model_row(m) for m in result["models"]],
        ),
        _COSTS.format(centers=golden["centers"]),
        table(
            ["target", "arithmetic", "compiler", "vectors ", "mismatches ", "map ", "sample ", "code ", "stack ",
             "stack of sample "],
            [_target_row(t) for t in result["targets"]],
        ),
        *_function_tables(result["targets"]),
        _CONTROLS,
        table(
            ["control", "target", "arithmetic", "results ", "mismatches "],
            [_control_row(c) for c in result["controls"]],
        ),
        _NAV,
        table(
            ["arithmetic", "lines ", "differing ", "measured, arcsec ", "compensated, arcsec "],
            [
                [n["numeric"], n["lines"], n["differing_lines"], f"{n['measured_arcsec']:.2f}",
                 f"{n['compensated_arcsec']:.2f}"]
                for n in result["nav_loop"]
            ],
        ),
    ]  # fmt: skip
    return "\n".join(parts)


def _function_tables(targets: Sequence[dict[str, Any]]) -> list[str]:
    parts: list[str] = []
    for t in targets:
        if "functions" in t:
            head = {"target": t["name"], "arithmetic": t["numeric"], "read_only": t["read_only_bytes"]}
            rows = [
                [f"`{name}`", cost["code_bytes"], cost["stack_bytes"], ", ".join(cost["helpers"]) or "-"]
                for name, cost in t["functions"].items()
            ]
            parts += [
                _FUNCTIONS.format(**head),
                table(["function", "code ", "stack ", "calls, not counted"], rows),
            ]
    return parts


def quoted(result: dict[str, Any]) -> dict[str, Any]:
    """What the page says: of every model its totals, of the golden one each target."""
    golden = [_quoted_target(t) for t in result["models"][0]["targets"]]
    controls = [{k: c[k] for k in ("control", "name", "numeric", "vectors", "mismatches")} for c in result["controls"]]
    kept = {name: result[name] for name in ("schema", "machine", "nav_loop")}
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


def _model_row(m: dict[str, Any]) -> list[object]:
    counts = ("targets", "smallest_vectors", "mismatches", "rows", "rows_that_differ")
    return [
        m["name"],
        m["networks"],
        m["centers"],
        ", ".join(m["terms"]) or "-",
        *(m[name] for name in counts),
    ]


def _target_row(t: dict[str, Any]) -> list[object]:
    cost = t.get("instructions") or t.get("cycles")
    step = t.get("step_instructions") or t.get("step_cycles")
    return [
        t["name"],
        t["numeric"],
        t["compiler"],
        t["vectors"],
        t["mismatches"],
        f"{cost['mean']:.0f} ({cost['max']})" if cost else "-",
        step["max"] if step else "-",
        t["code_bytes"],
        t.get("stack_bytes", "-"),
        t.get("step_stack_bytes", "-"),
    ]


def _control_row(c: dict[str, Any]) -> list[object]:
    words = c["control"].rpartition("::")[2].removeprefix("test_")
    name, _, case = words.partition("[")
    text = re.sub(r"_", " ", name) + (f" ({case.rstrip(']')})" if case else "")
    return [text, c["name"], c["numeric"], c["vectors"], c["mismatches"]]
