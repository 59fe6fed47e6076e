"""Promise about the text of the generator: functions and modules are short, or say at their line why they are not."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

MOST_FUNCTION = 30
MOST_MODULE = 250
_REASON = re.compile(r"#.*\blong: \S")


def long_python(root: Path) -> Iterator[str]:
    """Functions and modules of more lines of code than they may have.

    Blank lines, comments and docstrings are no code. A function's head is not counted: the commands' options are
    there. A departure names its reason as `# long: reason`: of a function in its head, of a module in its first line.
    """
    package = root / "gen" / "gyrotc"
    found = 0
    for path in sorted(package.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        lines = text.splitlines()
        tree = ast.parse(text)
        code = _code_lines(lines, tree)
        place = path.relative_to(root)
        if len(code) > MOST_MODULE and not _REASON.search(lines[0]):
            yield f"{place} has {len(code)} lines of code, more than {MOST_MODULE}"
        for node in ast.walk(tree):
            if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                continue
            found += 1
            first, last = node.body[0].lineno, node.end_lineno or 0
            size = sum(first <= line <= last for line in code)
            if size > MOST_FUNCTION and not _REASON.search("\n".join(lines[node.lineno - 1 : first - 1])):
                yield (
                    f"{place}:{node.lineno}: {node.name} has {size} lines of code, more than {MOST_FUNCTION}"
                )
    if not found:
        yield f"{package}: no function found"


def _code_lines(lines: list[str], tree: ast.Module) -> set[int]:
    """Numbers of the lines that hold code."""
    told: set[int] = set()
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ):
            told.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    numbered = ((number, line.strip()) for number, line in enumerate(lines, 1))
    return {number for number, line in numbered if line and not line.startswith("#")} - told
