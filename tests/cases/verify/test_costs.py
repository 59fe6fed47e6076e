"""The visit of every input, and the code and stack that each public function takes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from conftest import ROOT, Command, require
from emitted import emitted
from gyrotc.common import CheckFailed, InputError
from gyrotc.verify import PUBLIC, all_targets, function_costs, parse_graph, runtime_object, verify


def test_without_a_fixed_point_table_it_is_refused(tmp_path: Path, gyrotc: Command) -> None:
    folder = emitted(tmp_path)
    assert gyrotc("emit", folder / "model.json", "--out", folder, "--numeric", "f32").returncode == 0
    with pytest.raises(InputError, match="fixed-point"):
        verify(folder, exhaustive=True)
    done = gyrotc("verify", folder, "--exhaustive")
    assert done.returncode == 2 and "fixed-point" in done.stderr


GRAPH = """
node: { title: "gtc_f32.c:map_value" label: "map_value\\ngtc_f32.c:1:1\\n16 bytes (static)" }
node: { title: "gtc_f32_sample" label: "gtc_f32_sample\\ngtc_f32.c:2:1\\n8 bytes (static)" }
node: { title: "gtc_f32.c:play_step" label: "play_step\\ngtc_f32.c:3:1\\n40 bytes (static)" }
edge: { sourcename: "gtc_f32_sample" targetname: "gtc_f32.c:map_value" label: "gtc_f32.c:5:5" }
edge: { sourcename: "gtc_f32_sample" targetname: "gtc_f32.c:play_step" label: "gtc_f32.c:6:5" }
edge: { sourcename: "gtc_f32.c:map_value" targetname: "__aeabi_uldivmod" }
"""


def test_the_deepest_call_counts() -> None:
    graph = parse_graph(GRAPH)
    assert graph.deepest("map_value") == 16
    assert graph.deepest("gtc_f32_sample") == 8 + 40
    assert graph.helpers("gtc_f32_sample") == {"__aeabi_uldivmod"}
    assert graph.reached("gtc_f32_sample") == {"gtc_f32_sample", "map_value", "play_step", "__aeabi_uldivmod"}


def test_public_functions_are_those_of_the_header() -> None:
    """None is left out of the figures of code, stack and cost."""
    for numeric in ("f32", "q31"):
        declared = [*_declared("gtc.h", numeric), *_declared("gtc_private_state.h", numeric)]
        assert sorted(declared) == sorted(PUBLIC)


def _declared(name: str, numeric: str) -> list[str]:
    header = (ROOT / "include" / name).read_text(encoding="ascii")
    return re.findall(rf"^(?:GTC_MUST_CHECK )?int gtc_{numeric}_(\w+)\(", header, re.MULTILINE)


def test_a_stack_without_a_bound_is_refused() -> None:
    again = '\nedge: { sourcename: "gtc_f32.c:map_value" targetname: "gtc_f32_sample" label: "gtc_f32.c:5:5" }\n'
    with pytest.raises(CheckFailed, match="calls itself"):
        parse_graph(GRAPH + again).deepest("gtc_f32_sample")
    with pytest.raises(CheckFailed, match="dynamic"):
        parse_graph(GRAPH.replace("16 bytes (static)", "16 bytes (dynamic)"))


def test_every_public_function_of_the_emitted_runtime_has_its_costs(tmp_path: Path) -> None:
    target = all_targets()["cortex-m4f"]
    require(target.missing())
    folder = emitted(tmp_path / "model")
    for numeric in ("f32", "q31"):
        found = function_costs(runtime_object(target, folder / "c", numeric, tmp_path), numeric)
        assert list(found) == list(PUBLIC)
        assert all(cost.code_bytes > 0 for cost in found.values())
        assert all(helper.startswith(("__", "mem")) for cost in found.values() for helper in cost.helpers)
