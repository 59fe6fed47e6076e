"""Code and stack of each public function: a graph of calls by hand, and the emitted runtime on a Cortex-M4F."""

from __future__ import annotations

from pathlib import Path

import pytest
from emitted import emitted
from gyrotc.errors import CheckFailed
from gyrotc.verify.functions import PUBLIC, function_costs, parse_graph
from gyrotc.verify.toolchain import all_targets

GRAPH = """
node: { title: "gtc.c:gtc_f32_map" label: "gtc_f32_map\\ngtc.c:1:1\\n16 bytes (static)" }
node: { title: "gtc_f32_sample" label: "gtc_f32_sample\\ngtc.c:2:1\\n8 bytes (static)" }
node: { title: "gtc.c:gtc_f32_play_step" label: "gtc_f32_play_step\\ngtc.c:3:1\\n40 bytes (static)" }
node: { title: "gtc.c:gtc_q31_play_step" label: "gtc_q31_play_step\\ngtc.c:3:1\\n400 bytes (static)" }
node: { title: "__indirect_call" label: "Indirect Call Placeholder" shape : ellipse }
edge: { sourcename: "gtc_f32_sample" targetname: "gtc.c:gtc_f32_map" label: "gtc.c:5:5" }
edge: { sourcename: "gtc_f32_sample" targetname: "__indirect_call" label: "gtc.c:6:5" }
edge: { sourcename: "gtc.c:gtc_f32_map" targetname: "__aeabi_uldivmod" }
"""


def test_the_deepest_call_counts_and_a_pointer_goes_to_a_hook_of_its_arithmetic() -> None:
    graph = parse_graph(GRAPH)
    assert graph.deepest("gtc_f32_map") == 16
    assert graph.deepest("gtc_f32_sample") == 8 + 40
    assert graph.helpers("gtc_f32_sample") == {"__aeabi_uldivmod"}


def test_a_stack_without_a_bound_is_refused() -> None:
    again = '\nedge: { sourcename: "gtc.c:gtc_f32_map" targetname: "gtc_f32_sample" label: "gtc.c:5:5" }\n'
    with pytest.raises(CheckFailed, match="calls itself"):
        parse_graph(GRAPH + again).deepest("gtc_f32_sample")
    with pytest.raises(CheckFailed, match="dynamic"):
        parse_graph(GRAPH.replace("16 bytes (static)", "16 bytes (dynamic)"))


def test_every_public_function_of_the_emitted_runtime_has_its_costs(tmp_path: Path) -> None:
    target = all_targets()["cortex-m4f"]
    if target.missing():
        pytest.skip(f"{target.missing()} is not installed")
    folder = emitted(tmp_path / "model")
    costs = function_costs(target, folder / "c", tmp_path)
    for numeric in ("f32", "q31"):
        found = costs[numeric]
        assert list(found) == list(PUBLIC)
        assert found["sample"].stack_bytes > found["map"].stack_bytes > 0
        assert found["restore"].stack_bytes <= 1000, "one state on the stack, not two"
        assert found["save"].stack_bytes <= 100
        assert all(cost.code_bytes > 0 for cost in found.values())
