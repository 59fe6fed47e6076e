"""The stages of diagnosis read only what came before, and each of their modules has tests of its own."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parent
DIAGNOSE = TESTS.parents[1] / "gen" / "gyrotc" / "diagnose"

# From left to right; a name is a folder or a module of diagnose.
ORDER = [
    "orthonormal",
    "screen",
    "noise_colour",
    "signatures",
    "detect",
    "attribute",
    "noise_words",
    "discrepancy",
    "verdict",
    "advice",
    "pipeline",
    "extend",
    "summary",
    "result",
]
MODULES = sorted(p for p in DIAGNOSE.rglob("*.py") if p.name != "__init__.py")


def _stage(path: Path) -> str:
    return path.relative_to(DIAGNOSE).parts[0].removesuffix(".py")


def _imported(path: Path) -> set[str]:
    """Stages of diagnose that one of its modules imports."""
    depth = len(path.relative_to(DIAGNOSE).parts)
    nodes = [n for n in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(n, ast.ImportFrom)]
    return {n.module.split(".")[0] for n in nodes if n.level == depth and n.module}


@pytest.mark.parametrize("path", MODULES, ids=lambda p: str(p.relative_to(DIAGNOSE)))
def test_a_stage_reads_only_what_came_before(path: Path) -> None:
    stage = _stage(path)
    for other in _imported(path) - {stage}:
        assert ORDER.index(other) < ORDER.index(stage), f"{stage} must not import {other}"


def test_every_module_is_tested_by_name() -> None:
    texts = "\n".join(p.read_text("utf-8") for p in TESTS.glob("test_*.py"))
    for path in MODULES:
        dotted = ".".join(("gyrotc.diagnose", *path.relative_to(DIAGNOSE).with_suffix("").parts))
        package, name = dotted.rsplit(".", 1)
        assert f"from {dotted} import" in texts or f"from {package} import {name}\n" in texts, dotted
