"""The drawing of which package imports which: writes docs/architecture.md from the imports of `gen/gyrotc`.

`--check` compares instead (exit status 1 if the page is another one). The order of the packages itself is a contract in
gen/pyproject.toml, which `lint-imports` checks.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "architecture.md"

_HEAD = """# Which package imports which

Made from the imports of `gen/gyrotc` by `tools/architecture.py`; a test compares them.
What each package is for stands in [design.md](design.md).
An arrow points from a package to one that imports it.
Arrows that follow from longer paths are left out of the drawing; the table has all imports.

"""


def packages() -> dict[str, set[str]]:
    """Packages and top-level modules of gyrotc by name, with those that their modules import."""
    import grimp  # not where the site is made

    graph = grimp.build_graph("gyrotc")
    names = {child.split(".")[1]: child for child in graph.find_children("gyrotc")}
    return {
        name: {
            other
            for other, target in names.items()
            if other != name and graph.direct_import_exists(importer=child, imported=target, as_packages=True)
        }
        for name, child in sorted(names.items())
    }


def reach(graph: dict[str, set[str]], name: str) -> set[str]:
    """All packages that a package imports, directly or by way of others."""
    found: set[str] = set()
    todo = list(graph[name])
    while todo:
        package = todo.pop()
        if package not in found:
            found.add(package)
            todo += graph[package]
    return found


def arrows(graph: dict[str, set[str]]) -> Iterator[tuple[str, str]]:
    """From each package to those that import it, but for what a longer path implies."""
    for name, direct in graph.items():
        implied = set().union(*(reach(graph, other) for other in direct)) if direct else set()
        yield from ((other, name) for other in sorted(direct - implied))


def page(graph: dict[str, set[str]]) -> str:
    """The whole page."""
    lines = ["```mermaid", "flowchart LR"]
    lines += [f"  {other} --> {name}" for other, name in arrows(graph)]
    lines += ["```", "", "| package | imports |", "| --- | --- |"]
    depth = {name: len(reach(graph, name)) for name in graph}
    for name in sorted(graph, key=lambda n: (depth[n], n)):
        lines.append(f"| `{name}` | {', '.join(f'`{o}`' for o in sorted(graph[name])) or 'nothing of gyrotc'} |")
    return _HEAD + "\n".join(lines) + "\n"


def main() -> int:
    """Writes the page, or compares it."""
    parser = argparse.ArgumentParser(prog="tools/architecture.py", description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare, do not write")
    arguments = parser.parse_args()
    text = page(packages())
    if not arguments.check:
        PAGE.write_text(text, encoding="utf-8")
        return 0
    if PAGE.read_text(encoding="utf-8") == text:
        return 0
    print("docs/architecture.md is not what the imports say: run tools/architecture.py")
    return 1


if __name__ == "__main__":
    sys.exit(main())
