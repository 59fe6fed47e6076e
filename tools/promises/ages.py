"""Which records of docs/results/summary.json are older than the code that they measure.

`summary.json` has, under `code`, the SHA-256 of the code of each campaign when it was measured. docs/results.md names
the campaigns whose code has changed since, between two comments; `python tools/promises/figures.py` writes that line.
Comments, documentation strings and blanks do not count as code.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_TRAIN = ("gen/core", "gen/gyrotc/train", "gen/gyrotc/model.py")
_RUNTIME = ("libc", "include", "gen/gyrotc/target", "gen/gyrotc/tables")
_DIAGNOSE = (*_TRAIN, "gen/gyrotc/causes", "gen/gyrotc/diagnose", "gen/gyrotc/quality")
_MANY = ("gen/core", "gen/gyrotc/fleet", "gen/gyrotc/jobs", "gen/gyrotc/recordings", "gen/gyrotc/train")
CODE: dict[str, tuple[str, ...]] = {
    "bench": _TRAIN,
    "blind": _DIAGNOSE,
    "budget": ("gen/gyrotc/assess", *_TRAIN),
    "events": ("gen/gyrotc/quality",),
    "evidence": ("gen/gyrotc/assess", "gen/gyrotc/fleet/outliers.py", "gen/gyrotc/quality", "gen/gyrotc/recordings"),
    "faults": (*_RUNTIME, *_TRAIN),
    "fleet": _MANY,
    "fleet-kills": ("gen/gyrotc/fleet",),
    "growth": _MANY,
    "formats": ("gen/gyrotc/recordings/importers",),
    "import": ("gen/gyrotc/recordings",),
    "invariance": _DIAGNOSE,
    "kills": ("gen/gyrotc/store",),
    "lot": ("gen/gyrotc/fleet", "gen/gyrotc/quality"),
    "lot-prior": ("gen/core/posteriors.cpp", "gen/gyrotc/lot"),
    "mutants": ("gen/gyrotc/target", "gen/gyrotc/tables", "gen/gyrotc/train"),
    "prove": _RUNTIME,
    "runtime": _RUNTIME,
    "self-test": _RUNTIME,
    "sigma": ("gen/gyrotc/train/uncertainty.py", *_RUNTIME),
    "signals": _TRAIN,
    "splits": _DIAGNOSE,
    "recalibration": ("gen/gyrotc/lot",),
    "planted": ("gen/gyrotc/fleet", "gen/gyrotc/quality"),
    "sizes": _RUNTIME,
    "targets": _RUNTIME,
}
_PAGE = Path("docs/results.md")
_SUMMARY = Path("docs/results/summary.json")
_LINE = re.compile(r"(?<=<!-- older -->\n).*?(?=<!-- /older -->)", re.DOTALL)


@functools.cache
def _python(text: str) -> str:
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and ast.get_docstring(node) is not None:
            node.body = node.body[1:] or [ast.Pass()]
    return ast.unparse(tree)


@functools.cache
def _c(text: str) -> str:
    return "".join(re.sub(r"/\*.*?\*/|//[^\n]*", " ", text, flags=re.DOTALL).split())


def code_of(root: Path, name: str) -> str:
    """SHA-256 of the code that a campaign measures, in hexadecimal."""
    total = hashlib.sha256()
    for place in map(root.joinpath, CODE[name]):
        for path in sorted(place.rglob("*")) if place.is_dir() else [place]:
            if path.suffix in {".py", ".c", ".h", ".inl", ".cpp", ".hpp"}:
                text = path.read_text("utf-8")
                found = _python(text) if path.suffix == ".py" else _c(text)
                total.update(f"{path.relative_to(root).as_posix()}\0{found}\0".encode())
    return total.hexdigest()


def older(root: Path) -> list[str]:
    """Campaigns whose code is not that of their record, in order."""
    summary: dict[str, Any] = json.loads((root / _SUMMARY).read_text("utf-8"))
    known = summary.get("code", {})
    return [name for name in CODE if name in summary and known.get(name) != code_of(root, name)]


def line(root: Path) -> str:
    """What docs/results.md says of it."""
    names = older(root)
    if not names:
        return "No code has changed since its figures were measured.\n"
    return f"The code has changed since these were measured: {', '.join(f'`{n}`' for n in names)}.\n"


def filled(root: Path, text: str) -> str:
    """The page with that line."""
    return _LINE.sub(lambda _: line(root), text)


def unnamed(root: Path) -> Iterator[str]:
    """Whether the page names others than those that are older."""
    text = (root / _PAGE).read_text("utf-8")
    if filled(root, text) != text:
        yield f"{_PAGE}: older than their code are {', '.join(older(root)) or 'none'}: write it with figures.py"
