"""Promise about numbers: a constant of a module says where it comes from, at its line or beside it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

_NAME = re.compile(r"_?[A-Z][A-Z0-9_]*$")
_CALLS = frozenset({"int", "float", "float32", "float64", "int64", "uint32", "uint64", "sqrt", "log"})
_C_FILES = (".h", ".hpp", ".c", ".inl", ".cpp")
_NUMBER = r"\(?-?(?:\d|\.\d)[\w.+-]*\)?"
_C_CONSTANT = re.compile(
    rf"(?:#\s*define\s+(?P<macro>\w+)\s+|(?:static |inline )*const(?:expr)? \w+ (?P<name>\w+) = )(?P<value>{_NUMBER})"
)
_TRIVIAL = re.compile(r"\(?[01](?:\.0)?[UuLlFf]*\)?$")


def unexplained_numbers(root: Path) -> Iterator[str]:
    """Constants that are numbers, or tables of them, without a word about their origin.

    In Python a comment in the lines of the constant or on the line above counts, a string right after it, and a
    comment that ends with a colon above a block of constants, for all of them. In C and C++ a comment at the line
    or above the block counts; 0 and 1 need none.
    """
    found = 0
    for path in sorted((root / "gen" / "gyrotc").rglob("*.py")):
        for name, number, reported in _python(path.read_text(encoding="utf-8")):
            found += 1
            if not reported:
                yield f"{path.relative_to(root)}:{number}: {name} does not say where it comes from"
    for folder in ("include", "libc", "gen/core"):
        for path in sorted(p for p in (root / folder).rglob("*") if p.suffix in _C_FILES):
            for name, number, reported in _c(path.read_text(encoding="utf-8").splitlines()):
                found += 1
                if not reported:
                    yield f"{path.relative_to(root)}:{number}: {name} does not say where it comes from"
    if not found:
        yield f"{root}: no constant found"


def _python(text: str) -> Iterator[tuple[str, int, bool]]:
    """Name, line, and whether its origin is reported, of every constant of a module."""
    lines = text.splitlines()
    body = ast.parse(text).body
    for node, after in zip(body, [*body[1:], None], strict=True):
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None or not _is_number(node.value):
            continue
        name = _name(node.targets[0] if isinstance(node, ast.Assign) else node.target)
        if name:
            at = node.lineno - 1
            reported = any("#" in line for line in lines[at : node.end_lineno])
            reported = reported or lines[at - 1].startswith("#") or _is_text(after)
            yield name, node.lineno, reported or _headed(lines, at)


def _name(target: ast.expr) -> str:
    names = target.elts if isinstance(target, ast.Tuple) else [target]
    found = [name.id for name in names if isinstance(name, ast.Name) and _NAME.match(name.id)]
    return ", ".join(found) if len(found) == len(names) else ""


def _is_number(value: ast.expr) -> bool:
    """A number, an expression of numbers, or a tuple or dictionary of them."""
    match value:
        case ast.Constant():
            return isinstance(value.value, int | float) and not isinstance(value.value, bool)
        case ast.UnaryOp():
            return _is_number(value.operand)
        case ast.BinOp():
            return _is_number(value.left) or _is_number(value.right)
        case ast.Tuple() | ast.List():
            return bool(value.elts) and all(map(_is_number, value.elts))
        case ast.Dict():
            return bool(value.values) and all(map(_is_number, value.values))
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)):
            return name in _CALLS
    return False


def _is_text(node: ast.stmt | None) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def _headed(lines: list[str], at: int) -> bool:
    """Whether a comment that ends with a colon stands above the block of lines to which this one belongs."""
    while at > 0 and lines[at - 1].strip() and not lines[at - 1].startswith("#"):
        at -= 1
    return at > 0 and lines[at - 1].startswith("#") and lines[at - 1].rstrip().endswith(":")


def _c(lines: list[str]) -> Iterator[tuple[str, int, bool]]:
    """The same of the constants at file scope of a C or C++ file."""
    for at, line in enumerate(lines):
        found = _C_CONSTANT.match(line)
        if found is None or _TRIVIAL.match(found["value"]):
            continue
        above = at
        while above > 0 and lines[above - 1].strip() and not _is_c_comment(lines[above - 1]):
            above -= 1
        reported = "/*" in line or "//" in line or (above > 0 and _is_c_comment(lines[above - 1]))
        yield found["macro"] or found["name"], at + 1, reported


def _is_c_comment(line: str) -> bool:
    return line.rstrip().endswith("*/") or line.startswith("//")
