"""The page of a fleet says first how many gyros are done, which ones to look at, and what is next."""

from __future__ import annotations

from pathlib import Path

from gyrotc.fleet import write_summary
from gyrotc.results import FleetEntry


def test_it_names_gyros_with_findings_first_and_praises_nothing_without_limits(tmp_path: Path) -> None:
    """Columns that no gyro fills are left out, so that the table fits a screen."""
    plain = FleetEntry(name="A", axis=None, status="done", serial="A")
    found = plain.model_copy(update={"name": "B", "serial": "B", "findings": ("rate_outliers",)})
    write_summary(tmp_path, [plain, found])
    page = (tmp_path / "fleet.html").read_text("utf-8")
    first = page[page.index('<div class="verdict') : page.index("Every gyro")]
    assert "2 of 2 done" in first and "No limits were given" in first and "rate outliers" in first
    assert 'class="verdict good"' not in page
    heads = page[page.index("<thead>") : page.index("</thead>")]
    assert "improvement" in heads
    assert "limits met" not in heads and ">axis<" not in heads and ">verdict<" not in heads


def test_limits_that_all_gyros_meet_are_praised(tmp_path: Path) -> None:
    met = FleetEntry(name="A", axis="x", status="done", serial="A", verdict="PASS", limits_met=2, limits_held=2)
    write_summary(tmp_path, [met])
    page = (tmp_path / "fleet.html").read_text("utf-8")
    assert 'class="verdict good"' in page and "1 PASS" in page
    heads = page[page.index("<thead>") : page.index("</thead>")]
    assert ">axis<" in heads and ">verdict<" in heads and "limits met" in heads
