"""The walk-throughs of CONTRIBUTING, word for word: a target, a logger's format and a cause are added to a copy."""

from __future__ import annotations

import json
from pathlib import Path

import documents
import pytest
from conftest import ROOT


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sources after all blocks of the page."""
    folder = tmp_path_factory.mktemp("walk")
    assert list(documents.run(ROOT / "CONTRIBUTING.md", folder)) == []
    return folder / "gyrotc"


def test_a_cause_is_found_with_its_parameters_and_stands_in_the_table(copy: Path) -> None:
    truth = {"width_c": 8.0, "growth_dph_per_c2": 2e-5}
    (found,) = json.loads((copy / "result" / "diagnosis" / "diagnose.json").read_text())["causes"]
    assert found["id"] == "loop_reversal"
    assert {name: found["parameters"][name]["value"] for name in truth} == pytest.approx(truth, rel=0.15)
    (term,) = json.loads((copy / "result" / "model.json").read_text())["terms"]
    assert term["id"] == "loop_reversal" and term["parameters"] == pytest.approx(truth, rel=0.15)


def test_the_page_and_the_report_name_the_cause(copy: Path) -> None:
    for page in ("report.html", "diagnosis/report.html"):
        assert "A loop over temperature changes its sense at 20 C" in (copy / "result" / page).read_text("utf-8")


def test_the_target_has_run_both_arithmetics_bit_for_bit(copy: Path) -> None:
    targets = json.loads((copy / "build" / "minimal" / "verify.json").read_text())["targets"]
    found = {(one["name"], one["numeric"]): (one["status"], one["mismatches"]) for one in targets}
    assert found == {("cortex-m4", "f32"): ("pass", 0), ("cortex-m4", "q31"): ("pass", 0)}


def test_the_format_is_in_the_table_of_what_is_imported_and_nothing_is_left_of_a_refusal(copy: Path) -> None:
    assert "`gyrotc import chamber.acme`" in (copy / "docs" / "import.md").read_text("utf-8")
    assert not (copy / "RLG-0042").exists()
