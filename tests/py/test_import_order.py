"""Data flows one way: a module imports from stages to its left, never from its right."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "gen" / "gyrotc"

# From left to right. A stage is a module or a package of gyrotc.
ORDER = [
    "errors",
    "status",
    "inputs",
    "results",
    "outputs",
    "texts",
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


def _stage(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def _imported(path: Path) -> set[str]:
    """Stages that a module imports, relative or absolute, at any depth of its functions."""
    found: set[str] = set()
    depth = len(path.relative_to(PACKAGE).parts)
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
    return {name for name in found if not name.startswith("__")}


MODULES = sorted(p for p in PACKAGE.rglob("*.py") if p.name != "__init__.py" or p.parent != PACKAGE)


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_point_left(path: Path) -> None:
    stage = _stage(path)
    assert stage in ORDER, f"{stage} has no place in the house; give it one in ORDER"
    for other in _imported(path) - {stage}:
        assert other in ORDER, f"{path.name} imports {other}, which has no place in ORDER"
        assert ORDER.index(other) < ORDER.index(stage), f"{stage} must not import {other}"


def test_the_reader_of_imports_sees_a_wrong_one(tmp_path: Path) -> None:
    """The check itself can fail: cli is seen as an import of any module that names it."""
    assert "model" in _imported(PACKAGE / "emit" / "files.py")
    assert "errors" in _imported(PACKAGE / "model.py")


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
