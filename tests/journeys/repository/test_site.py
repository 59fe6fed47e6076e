"""The site of the documents: what its pages are made of, and the pages in a browser."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
import reference
import site_pages
from browser import Browser, browser
from conftest import ROOT, require

PAGES = sorted((ROOT / "docs").rglob("*.md")) + sorted(p for p in site_pages.beside() if p.suffix == ".md")
MKDOCS = Path(sys.executable).with_name("mkdocs")
_SEARCH = """(async () => {
  const field = document.querySelector('.md-search__input');
  field.focus();
  field.value = 'hysteresis';
  for (const name of ['keyup', 'input']) field.dispatchEvent(new Event(name, {bubbles: true}));
  for (let k = 0; k < 300; k++) {
    await new Promise(done => setTimeout(done, 100));
    const found = document.querySelectorAll('.md-search-result__link');
    if (found.length) return [...found].map(e => e.href);
  }
  return [];
})()"""


def _name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_links_of_a_page_lead_to_what_the_site_has(page: Path) -> None:
    """Pages beside docs/ were dead links, and a block with words behind its language became headings."""
    name = site_pages.place(page)
    assert name is not None and site_pages.source(name) == page
    text = site_pages.prepared(page.read_text("utf-8"), page, name)
    assert not re.search(r"^```[a-z]+ ", text, re.MULTILINE)
    for _, target, _ in site_pages.LINK.findall(site_pages.BLOCK.sub("", text)):
        if not re.match(r"[a-z]+:|//", target):
            there = os.path.normpath(Path(name).parent / target)
            assert site_pages.source(there).is_file(), f"{target} is no file of the site"


@pytest.mark.parametrize("name", sorted(reference.PAGES))
def test_no_link_of_a_page_that_is_made_is_lost(name: str) -> None:
    """A link to what the site does not have becomes its words alone."""
    text = reference.PAGES[name]()
    links = site_pages.LINK.findall(site_pages.BLOCK.sub("", text))
    made = site_pages.prepared(text, ROOT / "docs" / name, name)
    assert len(site_pages.LINK.findall(site_pages.BLOCK.sub("", made))) == len(links)


class _References(HTMLParser):
    """Names that a page has, and what it refers to: every `href` and `src`; those that a browser loads by itself."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.names: set[str] = set()
        self.to: list[str] = []
        self.loaded: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {key: value for key, value in attrs if value}
        self.names.update(found[key] for key in ("id",) if key in found)
        refers = [found[key] for key in ("href", "src") if key in found]
        self.to += refers
        self.loaded += refers if tag != "a" else []


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, made anew."""
    require(None if MKDOCS.is_file() else "mkdocs")
    folder = tmp_path_factory.mktemp("site")
    command = [MKDOCS, "build", "-q", "--strict", "-f", "docs/mkdocs.yml", "-d", folder]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_no_link_of_the_site_is_dead_and_nothing_is_fetched(site: Path) -> None:
    pages = {page.resolve(): _References(page.read_text("utf-8")) for page in site.rglob("*.html")}
    dead = []
    for page, found in pages.items():
        assert [to for to in found.loaded if to.startswith(("http", "//"))] == []
        for to in found.to if page.name != "404.html" else ():  # which stands at any place of a server
            parts = urlsplit(to)
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            known = pages[target].names if target in pages else {parts.fragment}
            is_there = target.is_file() and (not parts.fragment or parts.fragment in known)
            if not (parts.scheme or parts.netloc or is_there):
                dead.append(f"{page.relative_to(site)}: {to}")
    assert len(pages) > 40 and dead == []


def test_the_site_has_the_pages_that_are_made(site: Path) -> None:
    for name in reference.PAGES:
        assert (site / name).with_suffix(".html").is_file()
    assert "rms_over_floor" in (site / "reference-schemas.html").read_text("utf-8")


@pytest.fixture(scope="module")
def tab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browser(tmp_path_factory.mktemp("browser"), trusting=False) as opened:
        yield opened


@pytest.mark.parametrize("width", [390, 1300])
def test_no_page_complains_or_scrolls_sideways(width: int, site: Path, tab: Browser) -> None:
    for page in sorted(site.rglob("*.html")):
        if page.name != "404.html":
            tab.open(page, width=width)
            assert (page.name, tab.console) == (page.name, [])
            assert (page.name, tab.value("document.documentElement.scrollWidth")) == (page.name, width)
            assert tab.value("document.querySelectorAll('h1').length") == 1, page.name


def test_search_works_from_the_disk(site: Path, tab: Browser) -> None:
    """As browsers are: a page of the disk may not start a worker."""
    tab.open(site / "index.html")
    found = tab.value(_SEARCH)
    assert any("diagnosis.html" in link for link in found), found
    assert tab.console == []
