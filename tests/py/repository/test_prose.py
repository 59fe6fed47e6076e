"""The checker of words and sentences sees what it is for; pages keep what it asks."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools" / "promises"))

import prose  # noqa: E402


def test_pages_have_short_sentences_and_no_new_private_words() -> None:
    assert list(prose.long_sentences(ROOT)) == []
    assert list(prose.private_words(ROOT)) == []


def test_there_are_at_most_25_pages_of_60000_words_and_40_entries_of_the_glossary() -> None:
    pages = list((ROOT / "docs").glob("*.md"))
    assert len(pages) <= 25
    texts = [re.sub(r"<!--.*?-->", "", p.read_text("utf-8")) for p in pages]  # names of figures are not read
    assert sum(len(text.split()) for text in texts) <= 60000
    assert (ROOT / "README.md").read_text("utf-8").count("\n") <= 120
    glossary = (ROOT / "docs" / "index.md").read_text("utf-8").partition("## Glossary")[2]
    assert 20 <= len(re.findall(r"^\| (?!word|---)", glossary, re.MULTILINE)) <= 40


@pytest.mark.parametrize(
    ("page", "lines"),
    [
        ("One ends. Two\nends.\n", ["One ends.", "Two ends."]),
        ("- a b.\n  C (J. Opt. Eng. 3).\n1. E. `f` g.\n", ["- a b.", "  C (J. Opt. Eng. 3).", "1. E.", "   `f` g."]),
        ("| A. B. | C. |\n```\nD. E.\n```\n", ["| A. B. | C. |", "```", "D. E.", "```"]),
        ("<!-- a -->\nA. B.\n<!-- /a -->\n1 ... 3 C. D\n", ["<!-- a -->", "A. B.", "<!-- /a -->", "1 ... 3 C.", "D"]),
    ],
)  # fmt: skip
def test_lines_end_at_sentences(page: str, lines: list[str]) -> None:
    assert prose.broken(page).splitlines() == lines
    assert prose.broken(prose.broken(page)) == prose.broken(page)


def test_a_page_that_names_a_file_that_is_gone_is_seen(tmp_path: Path) -> None:
    assert list(prose.missing_files(ROOT)) == []
    (tmp_path / "docs").mkdir()
    (tmp_path / "gen").mkdir()
    (tmp_path / "gen" / "here.py").write_text("")
    (tmp_path / "docs" / "a.md").write_text("See `gen/here.py`, `here.py` and `gone.py`.\n")
    for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md"):
        (tmp_path / name).write_text("")
    assert list(prose.missing_files(tmp_path)) == ["docs/a.md: there is no gone.py"]


def test_long_sentences_and_private_words_are_seen(tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "gen" / "gyrotc").mkdir(parents=True)
    for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md"):
        (tmp_path / name).write_text("Short.\n")
    (tmp_path / "docs" / "a.md").write_text("word " * 46 + "end.\nOne. `odd` two.\n")
    (tmp_path / "gen" / "gyrotc" / "a.py").write_text("odd_name = 1  # odd\n")
    (tmp_path / "tools" / "promises").mkdir(parents=True)
    (tmp_path / "tools" / "promises" / "words.toml").write_text('[instead]\nodd = "rare"\n[most.sources]\nodd = 1\n')
    assert len(list(prose.long_sentences(tmp_path))) == 2  # too long, and not at a sentence's end
    assert list(prose.private_words(tmp_path)) == ["sources: 'odd' stands 2 times, more than 1; write rare"]
