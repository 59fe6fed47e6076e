"""Promise about numbers: a constant of a module says where it comes from, at its line or beside it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

_NAME = re.compile(r"_?[A-Z][A-Z0-9_]*$")
_C_NUMBER = re.compile(
    r"^\s*(?:#\s*define\s+(?P<macro>\w+)\s+|(?:static\s+)?(?:inline\s+)?const(?:expr)?\s+\w+\s+(?P<name>\w+)\s*=\s*)"
    r"\(?-?(?:\d|\.\d|0x)[\w.+-]*\)?"
)


def unexplained_numbers(root: Path) -> Iterator[str]:
    """Constants that are numbers, or tables of them, without a word about their origin.

    A comment counts at the line of the name or on the line above; in Python also one in the lines of the value, and
    a string that stands right after it. Of names that follow one another without an empty line the first one's
    comment counts for all only if it stands above, on a line of its own, and ends with a colon.
    """
    package = root / "gen" / "gyrotc"
    for path in sorted(package.rglob("*.py")):
        yield from _python(path, path.relative_to(root))
    for folder in ("include", "libc", "gen/core"):
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in (".h", ".c", ".inl", ".hpp", ".cpp"):
                yield from _c(path, path.relative_to(root))


def _python(path: Path, place: Path) -> Iterator[str]:
    text = path.read_text(encoding="utf-8")
    lines = text.splitlines()
    body = ast.parse(text).body
    for node, after in zip(body, [*body[1:], None], strict=True):
        name = _name(node)
        if name is None or not _is_number(node.value):  # type: ignore[attr-defined]
            continue
        last = node.end_lineno or node.lineno
        told = any("#" in line for line in lines[node.lineno - 1 : last]) or _text_follows(after)
        if not told and not _above(lines, node.lineno - 1, "#"):
            yield f"{place}:{node.lineno}: {name} does not say where it comes from"


def _name(node: ast.stmt) -> str | None:
    """Name of a constant that a statement sets."""
    if isinstance(node, ast.Assign) and len(node.targets) == 1:
        target = node.targets[0]
    elif isinstance(node, ast.AnnAssign) and node.value is not None:
        target = node.target
    else:
        return None
    if isinstance(target, ast.Tuple):
        names = [t.id for t in target.elts if isinstance(t, ast.Name)]
        return ", ".join(names) if names and all(map(_NAME.match, names)) else None
    return target.id if isinstance(target, ast.Name) and _NAME.match(target.id) else None


def _is_number(value: ast.expr) -> bool:
    """A number, an expression of numbers, or a tuple or dictionary of them."""
    if isinstance(value, ast.Constant):
        return isinstance(value.value, int | float) and not isinstance(value.value, bool)
    if isinstance(value, ast.UnaryOp):
        return _is_number(value.operand)
    if isinstance(value, ast.BinOp):
        return _is_number(value.left) or _is_number(value.right)
    if isinstance(value, ast.Tuple | ast.List):
        return bool(value.elts) and all(map(_is_number, value.elts))
    if isinstance(value, ast.Dict):
        return bool(value.values) and all(map(_is_number, value.values))
    if isinstance(value, ast.Call) and isinstance(value.func, ast.Name) and value.func.id in ("float", "int"):
        return True
    return False


def _text_follows(after: ast.stmt | None) -> bool:
    return (
        isinstance(after, ast.Expr)
        and isinstance(after.value, ast.Constant)
        and isinstance(after.value.value, str)
    )


def _above(lines: list[str], index: int, *marks: str) -> bool:
    """Whether a comment stands right above, or above a block of constants and ends with a colon."""
    if index > 0 and lines[index - 1].lstrip().startswith(marks):
        return True
    while index > 0 and lines[index - 1].strip() and not lines[index - 1][0].isspace():
        index -= 1
        line = lines[index].strip()
        if line.startswith(marks):
            return line.removesuffix("*/").rstrip().endswith(":")
    return False


def _c(path: Path, place: Path) -> Iterator[str]:
    lines = path.read_text(encoding="utf-8").splitlines()
    for index, line in enumerate(lines):
        found = _C_NUMBER.match(line)
        if found is None or "/*" in line or "//" in line:
            continue
        above = lines[index - 1].strip() if index else ""
        if above.endswith("*/") or above.startswith("//") or _above(lines, index, "/*", "//"):
            continue
        yield f"{place}:{index + 1}: {found['macro'] or found['name']} does not say where it comes from"
