"""Data flows one way: a module imports from stages to its left, never from its right."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import architecture  # noqa: E402

PACKAGE = architecture.PACKAGE

# From left to right. A stage is a module or a package of gyrotc.
ORDER = [
    "errors",
    "status",
    "inputs",
    "results",
    "outputs",
    "texts",
    "quantiles",
    "metrics",
    "_core",
    "terms",
    "dataset",
    "importers",
    "simulate",
    "frontend",
    "model",
    "train",
    "reference",
    "quantise",
    "emit",
    "verify",
    "judge",
    "diagnose",
    "plan",
    "pages",
    "paper",
    "jobs",
    "commands",
    "crash",
    "cli",
]


MODULES = architecture.modules()


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_point_left(path: Path) -> None:
    stage = architecture.stage(path)
    assert stage in ORDER, f"{stage} has no place in the house; give it one in ORDER"
    for other in architecture.imported(path) - {stage}:
        assert other in ORDER, f"{path.name} imports {other}, which has no place in ORDER"
        assert ORDER.index(other) < ORDER.index(stage), f"{stage} must not import {other}"


def test_the_reader_of_imports_sees_a_wrong_one(tmp_path: Path) -> None:
    """The check itself can fail: cli is seen as an import of any module that names it."""
    assert "model" in architecture.imported(PACKAGE / "emit" / "files.py")
    assert "errors" in architecture.imported(PACKAGE / "model.py")


def test_the_page_shows_the_imports_that_there_are() -> None:
    """Red: run `python tools/architecture.py`."""
    assert architecture.PAGE.read_text(encoding="utf-8") == architecture.page(architecture.rooms())


def test_an_arrow_is_left_out_only_where_a_longer_way_says_it() -> None:
    text = architecture.page({"a": set(), "b": {"a"}, "c": {"a", "b"}})
    assert [line for line in text.splitlines() if "-->" in line] == ["  a --> b", "  b --> c"]
    assert "| `c` | `a`, `b` |" in text


def _exists(module: str) -> bool:
    path = PACKAGE.joinpath(*module.split(".")[1:])
    return module == "gyrotc._core" or path.with_suffix(".py").is_file() or (path / "__init__.py").is_file()


def test_what_stands_beside_the_package_imports_modules_that_are_there() -> None:
    """Much of it runs in an hour of `make bench` or `make blind` only: a module that moved must not wait for that."""
    root = PACKAGE.parents[1]
    for path in (
        p for folder in ("tests", "bench", "tools", "examples") for p in (root / folder).rglob("*.py")
    ):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            found = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            found += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            for module in (m for m in found if m.split(".")[0] == "gyrotc"):
                assert _exists(module), f"{path.relative_to(root)}:{node.lineno} imports {module}"


#: Classes that have one name on purpose, with the reason.
_SAME = {"Points": "reference/f32.py and reference/q31.py say the same in either arithmetic"}


def _classes() -> dict[str, list[str]]:
    """Modules by the name of every public class that they define."""
    found: dict[str, list[str]] = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found.setdefault(node.name, []).append(str(path.relative_to(PACKAGE)))
    return found


def test_a_name_of_a_class_means_one_thing() -> None:
    found = _classes()
    assert len(found) > 150
    twice = {name: where for name, where in found.items() if len(where) > 1 and name not in _SAME}
    assert twice == {}, "give one of them a name of its own"
    assert all(len(found[name]) > 1 for name in _SAME), "no longer there twice"


def test_modules_import_in_no_circle() -> None:
    """Whatever runs when a module is loaded or later in a function of it; what only types ask for does not count."""
    graph = {_module(path): _modules_of(path) for path in PACKAGE.rglob("*.py")}
    assert _circle(graph) == []
    assert set(_circle({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}})) == {"a", "b", "c"}


def _module(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _modules_of(path: Path) -> set[str]:
    """Modules of the package that a module imports by their own names, `from .. import _core` without its package."""
    inside = path.relative_to(PACKAGE.parent).parts[:-1]
    found: set[str] = set()
    tree = ast.parse(path.read_text(encoding="utf-8"))
    typing = {
        id(part)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING")
        for part in ast.walk(node)
    }
    for node in ast.walk(tree):
        if not isinstance(node, ast.ImportFrom) or id(node) in typing:
            continue
        base = (
            (*inside[: len(inside) - node.level + 1], *(node.module or "").split(".")) if node.level else ()
        )
        place = PACKAGE.parent.joinpath(*(part for part in base if part))
        for name in (alias.name for alias in node.names):
            inner = place / name
            if inner.with_suffix(".py").is_file() or (inner / "__init__.py").is_file():
                found.add(".".join(inner.relative_to(PACKAGE.parent).parts))
            elif node.level and place != PACKAGE:
                found.add(".".join(place.relative_to(PACKAGE.parent).parts))
    return found - {_module(path)}


def _circle(graph: dict[str, set[str]]) -> list[str]:
    """Modules that a circle runs through or leads to: what is left when those that import nothing left go, again and
    again, and those that nothing left imports."""
    left = {name: set(others) & set(graph) for name, others in graph.items()}
    while True:
        wanted = set().union(*left.values()) if left else set()
        kept = {name: others for name, others in left.items() if others & set(left) and name in wanted}
        if kept.keys() == left.keys():
            return sorted(left)
        left = {name: others & set(kept) for name, others in kept.items()}
