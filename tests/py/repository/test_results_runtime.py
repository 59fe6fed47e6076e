"""The section on the runtime's costs says what the measurements beside it say, and a missed aim is told."""

from __future__ import annotations

import copy
import json
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from bench.runtime import CORES, GRIDS, LEVELS, grid_model  # noqa: E402
from bench.runtime_page import AIMS, section  # noqa: E402


@pytest.fixture
def result() -> dict[str, Any]:
    found: dict[str, Any] = json.loads((ROOT / "docs/results/runtime.json").read_text("utf-8"))
    return found


def test_the_section_is_made_from_the_json(result: dict[str, Any]) -> None:
    page = (ROOT / "docs/results.md").read_text("utf-8")
    assert f"<!-- runtime -->\n{section(result)}<!-- /runtime -->" in page


def test_a_missed_aim_is_told(result: dict[str, Any]) -> None:
    other = copy.deepcopy(result)
    for cost in other["costs"]:
        cost["map"]["mean"] += 1000.0
    assert f"| {AIMS[0].what} | {AIMS[0].limit:g} | **" in section(other)


def test_errors_keep_their_bounds(result: dict[str, Any]) -> None:
    for error in result["errors"]:
        assert error["worst_dph"] <= error["bound_dph"]
        if error["numeric"] == "q31":
            assert error["arithmetic_dph"] <= error["naive_float32_dph"]
            assert error["inputs"] > 2**25


def test_no_writable_data_anywhere(result: dict[str, Any]) -> None:
    assert {cost["ram_bytes"] for cost in result["costs"]} == {0}
    assert len(result["costs"]) == 3 * len(CORES) * len(LEVELS) * 2


@pytest.mark.parametrize("n", GRIDS)
def test_the_models_have_individual_widths_in_both_inputs(n: int) -> None:
    (network,) = grid_model(n).networks
    widths = [w for pair in network.widths for w in pair]
    assert len(network.centers) == n and len(set(widths)) == 2 * n
