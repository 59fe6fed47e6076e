"""What the pages need to become a site (`make site`): MkDocs calls `on_files` and `on_page_markdown` (docs/mkdocs.yml).

Pages that stand beside `docs/` come along below `sources/`, as do files that a page links to, so that no link is dead;
words behind the language of a block, which say how a test runs it, go; pages that are made from the code
(tools/reference.py) are made by the Python of .venv; the drawing of the packages is made here, since what draws it on a
server would be fetched by every reader.
"""

from __future__ import annotations

import html
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))

import architecture
import reference

ROOT = architecture.ROOT
DOCS = ROOT / "docs"
PLACE = "sources"  # of what lies beside docs/
_LINK = re.compile(r"(!?\[(?:[^\[\]]|\[[^\]]*\])*\])\(([^)\s#]+)(#[^)\s]*)?\)")
_OUTSIDE = re.compile(r"[a-z]+:|//")
_BLOCK = re.compile(r"(^```.*?^```$|`[^`\n]*`)", re.MULTILINE | re.DOTALL)
_WORDS = re.compile(r"^(```[a-z]+) .*$", re.MULTILINE)
_PICTURE = re.compile(r"^```mermaid$.*?^```$", re.MULTILINE | re.DOTALL)
_WIDTH, _HEIGHT, _ACROSS, _DOWN = (
    84,
    22,
    100,
    46,
)  # of a box, and from one to the next, in points of the picture


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
    plain = _BLOCK.sub("", text)
    return {(page.parent / t).resolve() for _, t, _ in _LINK.findall(plain) if not _OUTSIDE.match(t)}


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

    parts = _BLOCK.split(text)
    # a link may hold code in its words: blocks of several lines alone are left as they are
    whole = "".join(p if not p.startswith("```") else f"\0{k}\0" for k, p in enumerate(parts))
    return re.sub(r"\0(\d+)\0", lambda m: parts[int(m[1])], _LINK.sub(link, whole))


def drawn(block: str) -> dict[str, set[str]]:
    """Packages by name, with those from which an arrow of the drawing leads to them."""
    found = re.findall(r"^ *(\w+) --> (\w+)$", block, re.MULTILINE)
    return {name: {a for a, b in found if b == name} for name in sorted({n for arrow in found for n in arrow})}


def picture(graph: dict[str, set[str]]) -> str:
    """The packages as an SVG drawing: each in the row below the last package that it imports."""
    depth: dict[str, int] = {}
    for name in sorted(graph, key=lambda n: len(architecture.reach(graph, n))):
        depth[name] = max((depth[other] + 1 for other in graph[name]), default=0)
    rows = [[n for n in graph if depth[n] == k] for k in range(max(depth.values()) + 1)]
    columns = max(map(len, rows))
    at = {
        n: (4 + int(_ACROSS * (i + (columns - len(row)) / 2)), 4 + _DOWN * k)
        for k, row in enumerate(rows)
        for i, n in enumerate(row)
    }
    drawn = [_arrow(at[a], at[b]) for a, b in architecture.arrows(graph)]
    drawn += [_box(n, *at[n]) for n in graph]
    width, height = _ACROSS * columns, _DOWN * len(rows)
    head = (
        '<marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        '<path d="M0 0L8 4L0 8z" fill="currentColor"/></marker>'
    )
    return (
        f'<svg role="img" aria-label="What leads to what" viewBox="0 0 {width} {height}" width="{width}"'
        f' style="max-width:100%"><defs>{head}</defs>{"".join(drawn)}</svg>'
    )


def _arrow(a: tuple[int, int], b: tuple[int, int]) -> str:
    x, y = a[0] + _WIDTH // 2, a[1] + _HEIGHT
    u, v = b[0] + _WIDTH // 2, b[1]
    bend = (v - y) // 2
    way = f"M{x} {y}C{x} {y + bend} {u} {v - bend} {u} {v}"
    return f'<path d="{way}" fill="none" stroke="currentColor" opacity="0.6" marker-end="url(#tip)"/>'


def _box(name: str, x: int, y: int) -> str:
    return (
        f'<rect x="{x}" y="{y}" width="{_WIDTH}" height="{_HEIGHT}" rx="4" stroke="currentColor" fill="#fff"/>'
        f'<text x="{x + _WIDTH // 2}" y="{y + 15}" text-anchor="middle" font-size="12" fill="currentColor">'
        f"{html.escape(name)}</text>"
    )


def prepared(text: str, page: Path, name: str) -> str:
    """The text of a page as the site takes it."""
    text = _PICTURE.sub(lambda block: picture(drawn(block[0])), text)
    return _WORDS.sub(r"\1", linked(text, page, name))


def on_files(files: Any, config: Any) -> Any:
    """MkDocs: the files of the site."""
    from mkdocs.structure.files import File

    with tempfile.TemporaryDirectory() as folder:
        python = ROOT / ".venv" / "bin" / "python"
        reference.write(Path(folder), python)
        results = [python, ROOT / "tests" / "py" / "sections.py", Path(folder) / "results-all.md"]
        subprocess.run(results, check=True)
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
