"""The section on kills says what the campaign found: every command that writes, every way to end, nothing wrong."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest
from results import filled

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from tests.kills.driver import ACTIONS  # noqa: E402
from tests.kills.page import section  # noqa: E402

WRITING = {
    "build", "check", "compare", "diagnose", "emit", "evaluate", "fit", "fleet", "import", "plan", "report", "sign",
    "simulate", "stamp", "verify",
}  # fmt: skip


@pytest.fixture
def result() -> dict[str, Any]:
    found: dict[str, Any] = json.loads((ROOT / "docs/results/kills.json").read_text("utf-8"))
    return found


def test_the_section_is_made_from_the_json(result: dict[str, Any]) -> None:
    page = (ROOT / "docs/results.md").read_text("utf-8")
    assert section(result) in page and filled(page, "kills", section(result)) == page
    assert section(result | {"ended": 1}) not in page


def test_every_command_that_writes_was_ended_in_every_way(result: dict[str, Any]) -> None:
    assert result["wrong"] == 0 and result["ended"] >= 300
    assert set(result["counts"]["commands"]) >= WRITING
    for counted in result["counts"].values():
        assert set(ACTIONS) <= set(counted)
