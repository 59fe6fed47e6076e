"""The picture of the rooms, made from what the modules import: writes docs/architecture.md.

`--check` compares instead (exit status 1 if the page is another one). Standard library only.
"""

from __future__ import annotations

import argparse
import ast
import functools
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "gen" / "gyrotc"
PAGE = ROOT / "docs" / "architecture.md"

_HEAD = """# Who imports whom

Made from the imports of `gen/gyrotc` by `tools/architecture.py`; a test holds it against them. What each room knows
and must not know stands in [design.md](design.md). An arrow points from a room to one that imports it: data flow the
same way. Drawn are the arrows that no longer way implies; the table has all.

"""


def stage(path: Path, package: Path = PACKAGE) -> str:
    """The room of a module: its package or module below gyrotc."""
    return path.relative_to(package).parts[0].removesuffix(".py")


@functools.cache
def imported(path: Path, package: Path = PACKAGE) -> frozenset[str]:
    """Rooms that a module imports, relative or absolute, at any depth of its functions."""
    found: set[str] = set()
    depth = len(path.relative_to(package).parts)
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            module = node.module or ""
            if node.level == depth:
                names = [module.split(".")[0]] if module else [alias.name for alias in node.names]
            elif node.level == 0 and module.split(".")[0] == "gyrotc":
                names = module.split(".")[1:2] or [alias.name for alias in node.names]
            else:
                names = []
            found.update(names)
        elif isinstance(node, ast.Import):
            found.update(a.name.split(".")[1] for a in node.names if a.name.startswith("gyrotc."))
    return frozenset(name for name in found if not name.startswith("__"))


def modules(package: Path = PACKAGE) -> list[Path]:
    """Every module but the package's own `__init__`."""
    return sorted(p for p in package.rglob("*.py") if p.name != "__init__.py" or p.parent != package)


def rooms(package: Path = PACKAGE) -> dict[str, set[str]]:
    """Rooms by name, with the rooms that their modules import."""
    found: dict[str, set[str]] = {}
    for path in modules(package):
        found.setdefault(stage(path, package), set()).update(imported(path, package))
    for names in list(found.values()):
        for name in names:
            found.setdefault(name, set())
    return {name: names - {name} for name, names in sorted(found.items())}


def reach(graph: dict[str, set[str]], name: str) -> set[str]:
    """All rooms that a room imports, directly or by way of others."""
    found: set[str] = set()
    todo = list(graph[name])
    while todo:
        room = todo.pop()
        if room not in found:
            found.add(room)
            todo += graph[room]
    return found


def arrows(graph: dict[str, set[str]]) -> Iterator[tuple[str, str]]:
    """From each room to those that import it, but for what a longer way implies."""
    for name, direct in graph.items():
        implied = set().union(*(reach(graph, other) for other in direct)) if direct else set()
        yield from ((other, name) for other in sorted(direct - implied))


def page(graph: dict[str, set[str]]) -> str:
    """The whole page."""
    lines = ["```mermaid", "flowchart LR"]
    lines += [f"  {other} --> {name}" for other, name in arrows(graph)]
    lines += ["```", "", "| room | imports |", "| --- | --- |"]
    depth = {name: len(reach(graph, name)) for name in graph}
    for name in sorted(graph, key=lambda n: (depth[n], n)):
        lines.append(
            f"| `{name}` | {', '.join(f'`{o}`' for o in sorted(graph[name])) or 'nothing of gyrotc'} |"
        )
    return _HEAD + "\n".join(lines) + "\n"


def main() -> int:
    """Writes the page, or compares it."""
    parser = argparse.ArgumentParser(prog="tools/architecture.py", description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare, do not write")
    arguments = parser.parse_args()
    text = page(rooms())
    if not arguments.check:
        PAGE.write_text(text, encoding="utf-8")
        return 0
    if PAGE.read_text(encoding="utf-8") == text:
        return 0
    print("docs/architecture.md is not what the imports say: run tools/architecture.py")
    return 1


if __name__ == "__main__":
    sys.exit(main())
