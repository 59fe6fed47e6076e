"""Places where cosmic-ray's operators apply, faults that are drawn of them, and planting one in a copy."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from cosmic_ray.ast import Visitor, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

from ..records import ROOT

Place = tuple[tuple[int, int], tuple[int, int]]  # line and column of the first character, and behind the last one
_DECORATORS = "core/RemoveDecorator"  # without one a module does not even import: any test sees it


@dataclass(frozen=True, slots=True)
class Fault:
    """A module with one fault.

    Attributes:
        file: The module, below the sources.
        line: Number of the line that differs first.
        before, after: That line without and with the fault.
        text: The whole module with the fault.
        span: First and last line of the statement with the place, in the module without the fault; None outside of
            functions.
    """

    file: Path
    line: int
    before: str
    after: str
    text: str
    span: tuple[int, int] | None

    def reached_by(self, lines: Mapping[str, Sequence[int]]) -> bool:
        """Test whether lines that were executed, by module below the package, are those of the place."""
        numbers = lines.get(self.file.relative_to("gen/gyrotc").as_posix(), ())
        return bool(numbers) if self.span is None else any(self.span[0] <= n <= self.span[1] for n in numbers)

    @property
    def place(self) -> str:
        """File and line."""
        return f"{self.file.name}:{self.line}"


def drawn(modules: Sequence[Path], count: int, rng: np.random.Generator) -> list[Fault]:
    """Draw faults: places with equal chance, then one of the operators that apply there."""
    known = [(path, place, ways) for path in modules for place, ways in _places(path.read_text("utf-8")).items()]
    faults: list[Fault] = []
    for number in rng.permutation(len(known)):
        if len(faults) == count:
            break
        path, _, ways = known[number]
        operator, occurrence = ways[int(rng.integers(len(ways)))]
        fault = _fault(path, operator, occurrence)
        faults += [fault] if fault else []
    return faults


@contextmanager
def planted(copy: Path, fault: Fault) -> Iterator[None]:
    """Plant a fault in a copy of the sources for a block."""
    path = copy / fault.file
    whole = path.read_text("utf-8")
    path.write_text(fault.text, "utf-8")
    try:
        yield
    finally:
        path.write_text(whole, "utf-8")


class _Occurrences(Visitor):
    """Gather the places where one operator applies, in the order in which cosmic-ray counts them."""

    def __init__(self, operator: Any) -> None:
        self.operator = operator
        self.places: list[Place] = []

    def visit(self, node: Any) -> Any:
        self.places += self.operator.mutation_positions(node)
        return node


def _places(text: str) -> dict[Place, list[tuple[str, int]]]:
    """Return every place that is executed, with operators that apply there and the number of their occurrence."""
    annotations, tree = list(_annotations(ast.parse(text))), get_ast(text)
    found: dict[Place, list[tuple[str, int]]] = {}
    for name in sorted(operator_names()):
        if name == _DECORATORS or get_operator(name).arguments():  # those need the name of a variable
            continue
        visitor = _Occurrences(get_operator(name)())
        visitor.walk(tree)
        for occurrence, place in enumerate(visitor.places):
            if not any(start <= place[0] and place[1] <= end for start, end in annotations):
                found.setdefault(place, []).append((name, occurrence))
    return found


def _annotations(tree: ast.AST) -> Iterator[Place]:
    for node in ast.walk(tree):
        for name in ("annotation", "returns"):
            part = getattr(node, name, None)
            if isinstance(part, ast.expr):
                yield (part.lineno, part.col_offset), (part.end_lineno or 0, part.end_col_offset or 0)


def _fault(path: Path, operator: str, occurrence: int) -> Fault | None:
    """Return a module with a fault; None if nothing but its looks would differ, or if it were no Python.

    Operators take the stars of `{**a, **b}` for a power.
    """
    before = path.read_text("utf-8")
    after = mutate_code(before, get_operator(operator)(), occurrence)
    try:
        if after is None or ast.dump(ast.parse(before)) == ast.dump(ast.parse(after)):
            return None
    except SyntaxError:
        return None
    lines = zip(before.splitlines(), after.splitlines(), strict=False)
    line, (one, other) = next((k, pair) for k, pair in enumerate(lines, start=1) if pair[0] != pair[1])
    return Fault(path.relative_to(ROOT), line, one.strip(), other.strip(), after, _span(ast.parse(before), line))


def _span(tree: ast.AST, line: int) -> tuple[int, int] | None:
    """Return the lines of the innermost statement around a line; None outside of functions."""
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    statements = [node for function in functions for node in ast.walk(function) if isinstance(node, ast.stmt)]
    spans = [(node.lineno, node.end_lineno or node.lineno) for node in statements]
    around = [span for span in spans if span[0] <= line <= span[1]]
    return min(around, key=lambda span: span[1] - span[0], default=None)
