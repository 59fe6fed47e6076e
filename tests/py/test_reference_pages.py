"""Reference pages are what the code says, and the site has every page."""

from __future__ import annotations

import re
import sys

from conftest import ROOT
from gyrotc.verify.sizes import PUBLIC

sys.path.insert(0, str(ROOT / "tools"))

import reference


def test_no_reference_page_is_stale() -> None:
    """`make formats` writes them."""
    for name, made in reference.PAGES.items():
        page = ROOT / "docs" / f"reference-{name}.md"
        assert page.read_text("utf-8") == made().rstrip() + "\n", page.name


def test_every_public_function_of_c_has_its_heading() -> None:
    headings = re.findall(r"^## (.+)$", reference.c_page(), re.MULTILINE)
    named = [name for heading in headings for name in re.findall(r"gtc_<n>_(\w+)", heading)]
    assert sorted(named) == sorted(PUBLIC)


def test_the_site_has_every_page() -> None:
    """A page that stands in no list of the site is found by nobody."""
    text = (ROOT / "docs" / "mkdocs.yml").read_text("utf-8")
    listed = set(re.findall(r": ([\w/-]+\.md)$", text, re.MULTILINE))
    pages = {p.relative_to(ROOT / "docs").as_posix() for p in (ROOT / "docs").rglob("*.md")}
    decisions = {p for p in pages if re.match(r"adr/\d", p)}  # listed by adr/README.md
    assert listed == pages - decisions
