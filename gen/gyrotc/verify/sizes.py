"""Bytes of code, data and stack: of each public function, and of table and runtime as a program links them.

gcc writes the graph of calls with the stack of each function (`-fcallgraph-info=su`). No function is called through a
pointer. Functions of the compiler's own library
(64-bit division and the like) stand in no graph: they are named, not counted.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from ..common.errors import CheckFailed
from ..mirror.table import Table
from ..model import Model
from ..results.files import write_own
from ..results.folder import scratch_folder
from ..results.release import FunctionCost
from ..results.templates import c_templates
from ..tables.text import example_period_us
from .emitted import checked_sources, table_files
from .toolchain import Object, all_targets, compile_objects, link, runtime_object, shared_object, symbols

_TARGETS = ("cortex-m4f", "host-gcc-O2")  # the first that can be built here
_STATE = "footprint_state"
_CALLED = ("check", "init", "sample", "bias")  # by footprint.c.j2


@dataclass(frozen=True, slots=True)
class Footprint:
    """Bytes on a target: code and constants of everything linked; the caller's state; the deepest stack of a call.

    `stack_bytes` is None if the compiler does not tell. Helpers of the compiler's own library are not in it.
    """

    target: str
    rom_bytes: int
    ram_bytes: int
    stack_bytes: int | None


def footprint(c_folder: Path, model: Model, table: Table) -> Footprint | None:
    """Link self-test, init, sample and bias of a table for a Cortex-M4F, or for the host if that has no compiler here.

    Returns:
        The sizes; None where nothing can be compiled.

    Raises:
        CheckFailed: The compiler refused the emitted code, or it is not gyrotc's.
    """
    target = next((t for name in _TARGETS if (t := all_targets()[name]).missing() is None), None)
    if target is None:
        return None
    text = (
        c_templates()
        .get_template("footprint.c.j2")
        .render(
            id=model.id,
            symbol=model.symbol,
            n=table.numeric,
            n_channels=table.n_channels,
            period_us=example_period_us(model),
        )
    )
    with scratch_folder() as work:
        source = work / "footprint.c"
        write_own(source, text)
        c = checked_sources(c_folder, work, table_files(c_folder, model, (table.numeric,)))
        runtime = runtime_object(target, c, table.numeric, work)
        emitted = shared_object(target, c / f"gtc_{model.id}.c", work, include=c)
        own_objects = compile_objects(target, [source], work, include=c)
        objects = [runtime.put(work / "gtc.o"), emitted.put(work / "table.o"), *own_objects]
        link(target, objects, work / "footprint")
        own = {symbol.name for symbol in (*runtime.symbols, *emitted.symbols)}
        linked = symbols(target, work / "footprint")
        state = next(symbol.size for symbol in linked if symbol.name == _STATE)
        rom = sum(symbol.size for symbol in linked if symbol.name in own)
        costs = function_costs(runtime, table.numeric)
        stack = max((costs[function].stack_bytes for function in _CALLED if function in costs), default=None)
        return Footprint(target.name, rom, state, stack)


PUBLIC = (
    "check", "check_words", "open", "map", "init", "sample", "bias", "snapshot", "rezero", "angle", "save", "restore",
)  # fmt: skip
"""Every function that gtc.h and what it includes declare, without its prefix."""
_NODE = re.compile(
    r'^node: \{ title: "(?:[^":]*:)?(?P<name>[\w.]+)" label: "[^"]*\\n(?P<bytes>\d+) bytes \((?P<how>[^)]*)\)'
)
_EDGE = re.compile(
    r'^edge: \{ sourcename: "(?:[^":]*:)?(?P<caller>[\w.]+)" targetname: "(?:[^":]*:)?(?P<callee>[\w.]+)"'
)


@dataclass(slots=True)
class Graph:
    """Bytes of stack of each function by name, and whom it calls."""

    stack: dict[str, int] = field(default_factory=dict)
    calls: dict[str, set[str]] = field(default_factory=dict)

    def callees(self, name: str) -> set[str]:
        """Whom a function calls."""
        return self.calls.get(name, set())

    def reached(self, name: str) -> set[str]:
        """The function and all that it calls on the way."""
        return {name}.union(*(self.reached(callee) for callee in self.callees(name)))

    def deepest(self, name: str, above: tuple[str, ...] = ()) -> int:
        """Bytes of stack of a function and the deepest chain of calls from it.

        Raises:
            CheckFailed: A function calls itself, so that no bound exists.
        """
        if name in above:
            raise CheckFailed(f"{name} calls itself by way of {' and '.join(above)}: its stack has no bound")
        below = [self.deepest(callee, (*above, name)) for callee in self.callees(name)]
        return self.stack.get(name, 0) + max(below, default=0)

    def helpers(self, name: str) -> set[str]:
        """Functions from outside that are called on the way: their stack is not in `deepest`."""
        if name not in self.stack:
            return {name}
        return set().union(*(self.helpers(callee) for callee in self.callees(name)))


def parse_graph(text: str) -> Graph:
    """The graph in a file that gcc wrote.

    Raises:
        CheckFailed: The stack of a function depends on its arguments.
    """
    graph = Graph()
    for line in text.splitlines():
        if node := _NODE.match(line):
            if node["how"] != "static":
                raise CheckFailed(f"the stack of {node['name']} is {node['how']}")
            graph.stack[node["name"]] = int(node["bytes"])
        elif edge := _EDGE.match(line):
            graph.calls.setdefault(edge["caller"], set()).add(edge["callee"])
    return graph


def function_costs(runtime: Object, numeric: str) -> dict[str, FunctionCost]:
    """Costs by public function of one arithmetic; empty without a gcc that tells.

    Raises:
        CheckFailed: A stack has no bound.
    """
    if not runtime.graph:
        return {}
    graph = parse_graph(runtime.graph)
    sizes = {s.name: s.size for s in runtime.symbols}
    names = {function: f"gtc_{numeric}_{function}" for function in PUBLIC}
    return {
        function: FunctionCost(
            code_bytes=sum(sizes.get(n, 0) for n in graph.reached(name)),
            stack_bytes=graph.deepest(name),
            helpers=tuple(sorted(graph.helpers(name))),
        )
        for function, name in names.items()
        if name in sizes
    }
