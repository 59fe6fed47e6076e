"""Turn the pages into a site (`make site`): MkDocs calls `on_files` and `on_page_markdown` (docs/mkdocs.yml).

Pages that stand beside `docs/` come along below `sources/`, as do files that a page links to, so that no link is dead;
words behind the language of a block, which say how a test runs it, go; pages that are made from the code
(tools/reference.py) are made by the Python of .venv.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

import reference

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PLACE = "sources"  # of what lies beside docs/
LINK = re.compile(r"(!?\[(?:[^\[\]]|\[[^\]]*\])*\])\(([^)\s#]+)(#[^)\s]*)?\)")
_OUTSIDE = re.compile(r"[a-z]+:|//")
BLOCK = re.compile(r"(^```.*?^```$|`[^`\n]*`)", re.MULTILINE | re.DOTALL)
_WORDS = re.compile(r"^(```[a-z]+) .*$", re.MULTILINE)


def place(path: Path) -> str | None:
    """Where a file of the sources stands in the site, as MkDocs names it; None for one that does not come along."""
    if path.is_dir():
        path = path / "README.md"
    if not path.is_file() or not path.is_relative_to(ROOT):
        return None
    if path.is_relative_to(DOCS):
        return path.relative_to(DOCS).as_posix() if path.suffix != ".json" else None
    name = f"{PLACE}/{path.relative_to(ROOT).as_posix()}"
    return name if path.suffix in (".md", ".png") else name + ".txt"


def source(name: str) -> Path:
    """The file of the sources that stands at `name` in the site."""
    if not name.startswith(f"{PLACE}/"):
        return DOCS / name
    path = ROOT / name.removeprefix(f"{PLACE}/")
    return path if path.is_file() else path.with_suffix("")


def targets(text: str, page: Path) -> set[Path]:
    """Files of the sources that a page links to."""
    plain = BLOCK.sub("", text)
    return {(page.parent / t).resolve() for _, t, _ in LINK.findall(plain) if not _OUTSIDE.match(t)}


def beside() -> set[Path]:
    """What lies beside docs/ and comes along: what pages link to, and what those pages link to."""
    todo, seen = sorted(DOCS.rglob("*.md")), set[Path]()
    while todo:
        page = todo.pop()
        for target in targets(page.read_text("utf-8"), page):
            path = target / "README.md" if target.is_dir() else target
            if path not in seen and path.is_file() and not path.is_relative_to(DOCS):
                seen.add(path)
                todo += [path] if path.suffix == ".md" else []
    return {path for path in seen if place(path)}


def linked(text: str, page: Path, name: str) -> str:
    """A page with links as they are in the site; one to what does not come along is its words alone."""

    def link(found: re.Match[str]) -> str:
        words, target, anchor = found[1], found[2], found[3] or ""
        if _OUTSIDE.match(target):
            return found[0]
        there = place((page.parent / target).resolve())
        if there is None:
            return words.lstrip("!")[1:-1]
        return f"{words}({os.path.relpath(there, Path(name).parent)}{anchor})"

    parts = BLOCK.split(text)
    # a link may hold code in its words: blocks of several lines alone are left as they are
    whole = "".join(p if not p.startswith("```") else f"\0{k}\0" for k, p in enumerate(parts))
    return re.sub(r"\0(\d+)\0", lambda m: parts[int(m[1])], LINK.sub(link, whole))


def prepared(text: str, page: Path, name: str) -> str:
    """The text of a page as the site takes it."""
    return _WORDS.sub(r"\1", linked(text, page, name))


def on_files(files: Any, config: Any) -> Any:
    """MkDocs: the files of the site."""
    from mkdocs.structure.files import File

    with tempfile.TemporaryDirectory() as folder:
        reference.write(Path(folder), ROOT / ".venv" / "bin" / "python")
        for path in sorted(Path(folder).iterdir()):
            written = files.get_file_from_path(path.name)  # without tables
            if written is not None:
                files.remove(written)
            files.append(File.generated(config, path.name, content=path.read_text("utf-8")))
    for path in sorted(beside()):
        name = place(path)
        assert name is not None
        content: str | bytes = path.read_text("utf-8") if path.suffix == ".md" else path.read_bytes()
        files.append(File.generated(config, name, content=content))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """MkDocs: the text of a page."""
    name: str = page.file.src_uri
    return prepared(markdown, source(name), name)
