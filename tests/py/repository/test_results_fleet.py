"""The section on a fleet says what the measurement beside it says."""

from __future__ import annotations

import copy
import json
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from bench.fleet import filled, section  # noqa: E402


@pytest.fixture
def figures() -> dict[str, Any]:
    found: dict[str, Any] = json.loads((ROOT / "docs/results/fleet.json").read_text("utf-8"))
    return found


def test_the_section_is_made_from_the_json(figures: dict[str, Any]) -> None:
    page = (ROOT / "docs/results.md").read_text("utf-8")
    assert f"<!-- fleet -->\n{section(figures)}<!-- /fleet -->" in page
    assert filled(page, figures) == page


def test_other_figures_give_another_page(figures: dict[str, Any]) -> None:
    other = copy.deepcopy(figures) | {"elapsed_s": figures["elapsed_s"] + 1.0}
    assert section(other) != section(figures)
    assert "kept" in filled("# Results\n\n<!-- other -->\nkept\n<!-- /other -->\n", figures)


def test_a_thousand_serials_without_a_failure(figures: dict[str, Any]) -> None:
    assert (figures["serials"], figures["failed"], figures["exit_status"]) == (1000, 0, 0)
    assert figures["rms_over_floor"]["median"] < 1.01
