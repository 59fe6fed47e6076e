"""Pages that a user follows: their commands run and print what the pages say."""

from __future__ import annotations

from pathlib import Path

import documents
import pytest
from conftest import ROOT

WALK_THROUGHS = ROOT / "CONTRIBUTING.md"  # has a test file of its own, which looks at what its commands leave
RUNNING = [page for page in documents.pages() if documents.steps(page.read_text("utf-8")) and page != WALK_THROUGHS]
FOLLOWED = [
    ROOT / "README.md",
    WALK_THROUGHS,
    *sorted(ROOT.glob("docs/tutorial.md")),
    *sorted(ROOT.glob("docs/howto-*")),
]


def _name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("page", RUNNING, ids=_name)
def test_what_a_page_shows_is_what_happens(page: Path, tmp_path: Path) -> None:
    assert list(documents.run(page, tmp_path)) == []


@pytest.mark.parametrize("page", FOLLOWED, ids=_name)
def test_a_block_is_run_or_says_why_it_is_not(page: Path) -> None:
    assert [one for one in documents.shown(page.read_text("utf-8")) if not one.reason] == []
