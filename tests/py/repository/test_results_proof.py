"""docs/results.md says what `make targets` and `make prove` found, and that is what is promised."""

from __future__ import annotations

import copy
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from results import filled

ROOT = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / "tests" / "targets"), str(ROOT / "tests" / "prove")]

import prove_page  # noqa: E402
import self_test_page  # noqa: E402
import targets_page  # noqa: E402

SECTIONS: dict[str, Callable[[dict[str, Any]], str]] = {
    "targets": targets_page.section,
    "prove": prove_page.section,
    "self-test": self_test_page.section,
}


def _result(name: str) -> dict[str, Any]:
    result: dict[str, Any] = json.loads((ROOT / "docs" / "results" / f"{name}.json").read_text("utf-8"))
    assert result["schema"] == f"gyrotc.{name}/1"
    return result


@pytest.mark.parametrize("name", SECTIONS)
def test_the_section_is_made_from_the_json(name: str) -> None:
    page = (ROOT / "docs" / "results.md").read_text("utf-8")
    section = SECTIONS[name](_result(name))
    assert section in page
    assert filled(page, name, section) == page


def test_another_figure_gives_another_section() -> None:
    """The comparison can fail."""
    targets, prove = _result("targets"), _result("prove")
    wrong = copy.deepcopy((targets, prove))
    wrong[0]["models"][0]["targets"][0]["mismatches"] = 1
    wrong[1]["every_input"][0]["mismatches"] = 1
    assert targets_page.section(wrong[0]) != targets_page.section(targets)
    assert prove_page.section(wrong[1]) != prove_page.section(prove)


def test_a_new_page_gets_the_section_and_other_sections_stay() -> None:
    page = "# Results\n\n<!-- bench -->\nkept\n<!-- /bench -->\n"
    once = filled(page, "prove", "one\n")
    assert "kept" in once and "one" in once
    assert "two" in filled(once, "prove", "two\n") and "one" not in filled(once, "prove", "two\n")
    assert filled(None, "prove", "one\n").startswith("# Results")


def test_no_build_whose_results_differ_passes_the_self_test() -> None:
    result = _result("self-test")
    differing = [b for b in result["builds"] if b["differ"]]
    assert result["tables"] == 40 and len(differing) >= 30, "the flags break something"
    assert all(b["refused"] == b["differ"] for b in differing)


def test_every_target_agreed_in_every_bit() -> None:
    for model in _result("targets")["models"]:
        assert model["failed"] == 0
        assert len({t["name"] for t in model["targets"]}) >= 12
        for target in model["targets"]:
            assert (target["status"], target["mismatches"]) == ("pass", 0)
            assert target["vectors"] >= 20000
            assert target.get("replayed", {"mismatches": 0})["mismatches"] == 0
    assert [n["differing_lines"] for n in _result("targets")["nav_loop"]] == [0, 0]


@pytest.mark.parametrize(
    "control",
    [
        "contracted_build", "fast_math", "natural_expressions_on_x87", "wrong_rounding_shift", "flipped_bit",
        "m68k_software_float", "another_layout", "fault_in_a_term",
    ],
)  # fmt: skip
def test_every_negative_control_was_caught(control: str) -> None:
    caught = [c for c in _result("targets")["controls"] if control in c["control"]]
    assert caught and all(c["mismatches"] > 0 for c in caught)


def test_every_input_agreed_and_kept_the_bound() -> None:
    result = _result("prove")
    visits = result["every_input"]
    assert max(v["inputs"] for v in visits) == 2**32
    for visit in visits:
        assert visit["mismatches"] == 0
        assert visit["worst_dph"] <= visit["bound_dph"]
    assert all(p["differ"] == 0 for p in result["primitives"])
    fixed = {p["name"]: p["worst_error"] for p in result["primitives"] if p["name"].startswith("fixed")}
    gauss = {name: worst for name, worst in fixed.items() if name.endswith(("gauss", "curve"))}
    assert len(gauss) == 4 and max(gauss.values()) <= 3.5e-8


def test_no_run_time_error_was_left_but_those_with_an_argument() -> None:
    """docs/proof.md, section 2."""
    left = {(e["part"], e["numeric"]) for e in _result("prove")["run_time_errors"] if e["alarms"]}
    assert left == {("map of a bank", "q31"), ("map of any bank", "q31"), ("memory", "q31")}
