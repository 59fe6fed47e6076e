"""Promise about all Python of the project: the oldest release that it supports has everything that is used.

mypy knows in which releases the standard library has a module, a function, a method or an argument. What it objects to
in the oldest release and not in the newest is younger than the oldest.
"""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

NEWEST = "3.13"  # that CI and Debian 13 have
_FOLDERS = ("gen/gyrotc", "tests", "tools", "bench", "examples")
_PLACES = ("gen", "tests/py", "tools", "tools/promises", ".")  # of modules that are imported by their name
_REQUIRED = re.compile(r'^requires-python = ">=(\d+\.\d+)"', re.MULTILINE)
# Security releases brought the filter of archive members to Pythons from 3.8 on, so mypy takes it for known; 3.11.2 of
# Debian 12 is older than that.
_LATE = {"extract": "filter", "extractall": "filter", "unpack_archive": "filter"}


def younger_than_supported(root: Path) -> Iterator[str]:
    """Places that use what the oldest supported Python does not have, one line each."""
    required = _REQUIRED.search((root / "gen" / "pyproject.toml").read_text("utf-8"))
    if required is None:
        yield "gen/pyproject.toml: no requires-python"
        return
    files = [p for folder in _FOLDERS for p in sorted((root / folder).rglob("*.py"))]
    newest = set(_objections(root, files, NEWEST))
    yield from (text for text in _objections(root, files, required[1]) if text not in newest)
    for path in files:
        yield from (f"{path.relative_to(root)}:{text}" for text in _late(path))


def _objections(root: Path, files: list[Path], release: str) -> list[str]:
    """What mypy says of the files for a release of Python; other libraries than the standard one are not looked at."""
    command = [
        sys.executable, "-m", "mypy", "--config-file=", f"--python-version={release}", "--no-site-packages",
        "--ignore-missing-imports", "--check-untyped-defs", "--explicit-package-bases", "--no-error-summary",
        f"--cache-dir={root / 'build' / 'mypy'}", *(str(path.relative_to(root)) for path in files),
    ]  # fmt: skip
    places = os.environ | {"MYPYPATH": os.pathsep.join(_PLACES)}
    done = subprocess.run(command, cwd=root, env=places, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        return [f"mypy for Python {release}: {done.stdout}{done.stderr}"]
    return [line for line in done.stdout.splitlines() if ": error:" in line]


def _late(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            late = _LATE.get(node.func.attr)
            if late and late in {keyword.arg for keyword in node.keywords}:
                yield f"{node.lineno}: {node.func.attr}({late}=...) is younger than some supported releases of Python"
