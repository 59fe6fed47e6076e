"""The section on a long file says what the measurement beside it says, and the memory that docs/import.md promises."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT))

from bench.importing import section  # noqa: E402


@pytest.fixture
def figures() -> dict[str, Any]:
    found: dict[str, Any] = json.loads((ROOT / "docs/results/import.json").read_text("utf-8"))
    return found


def test_the_section_is_made_from_the_json(figures: dict[str, Any]) -> None:
    page = (ROOT / "docs/results.md").read_text("utf-8")
    assert f"<!-- import -->\n{section(figures)}<!-- /import -->" in page


def test_less_than_a_gibibyte(figures: dict[str, Any]) -> None:
    assert figures["readers"]["gyrotc import"]["peak_mib"] < 1024.0
    assert figures["bytes"] > 1.9e9
