"""docs/results.md says what the measurements beside it say: no figure is edited by hand."""

from __future__ import annotations

import copy
import json
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from bench.aims import AIMS  # noqa: E402
from bench.page import filled, section  # noqa: E402


@pytest.fixture
def result() -> dict[str, Any]:
    found: dict[str, Any] = json.loads((ROOT / "docs/results/bench.json").read_text("utf-8"))
    return found


def test_the_section_is_made_from_the_json(result: dict[str, Any]) -> None:
    page = (ROOT / "docs/results.md").read_text("utf-8")
    assert filled(page, result) == page
    assert section(result) in page


def test_another_figure_gives_another_page(result: dict[str, Any]) -> None:
    """The comparison can fail."""
    other = copy.deepcopy(result)
    other["accuracy"]["default"][0]["ratio"]["worst"] += 0.01
    assert section(other) != section(result)


def test_the_figures_are_what_the_project_promises(result: dict[str, Any]) -> None:
    """Accuracy and bytes of the default method; times depend on the machine and are not held to anything here."""
    smooth, *ripple = result["accuracy"]["default"]
    assert smooth["ratio"]["median"] <= 1.006
    assert smooth["ratio"]["worst"] <= 1.015
    assert smooth["bytes"]["worst"] <= 144
    for scenario in ripple:
        assert scenario["ratio"]["worst"] <= 1.02
        assert scenario["bytes"]["worst"] <= 264
    for scenario in result["accuracy"]["default"]:
        assert scenario["withheld"] > 0 or abs(scenario["found_minus_predicted"]) <= 0.002
    for scenario in result["accuracy"]["more_centers"]:
        assert max(abs(change) for change in scenario["largest"].values()) <= 0.005
    for scenario in result["accuracy"]["left_out"]:
        assert scenario["median"] <= 1.03


def test_the_selection_depends_neither_on_units_nor_on_order_nor_on_duplicates(
    result: dict[str, Any],
) -> None:
    """Ours; scikit-learn's, with its absolute threshold, shows that the measure can fail."""
    gyros = result["invariance"]["gyros"]
    *ours, peer = result["invariance"]["rows"]
    for row in ours:
        assert [change["same"] for change in row["changes"].values()] == [gyros] * 3, row["name"]
    assert peer["changes"]["rad/s"]["same"] < gyros


def test_every_aim_has_its_figure(result: dict[str, Any]) -> None:
    for what, _, _, figure in AIMS:
        assert figure(result) > 0.0, what


@pytest.mark.parametrize(("worst", "told"), [(1.2, "**1.2000** (missed)"), (1.01, "1.0100")])
def test_a_missed_aim_is_told(result: dict[str, Any], worst: float, told: str) -> None:
    other = copy.deepcopy(result)
    other["accuracy"]["default"][0]["ratio"]["worst"] = worst
    assert f"| RMS ÷ floor, smooth maps: worst | 1.015 | {told} |" in section(other)


def test_a_new_page_has_the_section_and_other_sections_stay(result: dict[str, Any]) -> None:
    assert section(result) in filled(None, result)
    page = "# Results\n\n<!-- bench -->\nold\n<!-- /bench -->\n\n<!-- targets -->\nkept\n<!-- /targets -->\n"
    assert "kept" in filled(page, result)
    assert "old" not in filled(page, result)
