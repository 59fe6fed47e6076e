"""The most instructions of each public function on a target, from object code, loops and a table's sizes.

Li and Malik, "Performance analysis of embedded software using implicit path enumeration", DAC 1995.

The code of a function with all that it calls is one graph of blocks; how often each can run is limited by what leads to
it and by the bounds of loops, and the most instructions under these limits are a linear program (`paths`). What is
known of the runtime beside its loops (`loops`) stands here, each fact with its reason. What has no bound is refused.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from ..common.errors import CheckFailed
from ..mirror.table import Table
from ..results import cache
from ..results.files import canonical_json, digest_of, write_own
from .flow import MEMORY, POWER, SHORT_QUOTIENTS, Block, Counts, Flow, Loop, LoopText, counts_of, parse_flows, totals
from .sizes import TERM_CODES, functions_of, linked_name
from .toolchain import Object, Target, compile_objects, disassembly, link, symbols

STAND_IN = "is_shown"  # the function that asks the network of a fallback model
_ROUNDING = 1e-3  # of the solver (its tolerance is 1e-7 of a flow), far below one instruction


@dataclass(slots=True)
class Program:
    """Linked code, and the text it was made of."""

    flows: dict[int, Flow]
    addresses: dict[str, int]
    text: LoopText
    loops: dict[int, list[tuple[Loop, int]]] = field(default_factory=dict)

    def loops_of(self, flow: Flow) -> list[tuple[Loop, int]]:
        """Loops of a function, each with the line of its text (0 in the compiler's library)."""
        if flow.entry not in self.loops:
            self.loops[flow.entry] = [(loop, self._line(flow, loop)) for loop in flow.loops()]
        return self.loops[flow.entry]

    def _line(self, flow: Flow, loop: Loop) -> int:
        """The line of its `for`, whose test the compiler put where the loop goes round or is left."""
        leaving = [b for b in loop.body - loop.inner if not loop.body.issuperset(flow.blocks[b].successors)]
        tests = [[flow.blocks[b].last.line for b in some] for some in (loop.latches, leaving)]
        inside = [
            [i.line for b in some for i in flow.blocks[b].instructions]
            for some in (loop.latches, loop.body - loop.inner)
        ]
        for lines in (*tests, *inside):
            found = {line for line in lines if self.text.is_loop(line)}
            if len({self.text.at(line) for line in found}) == 1:
                return min(found)
        raise CheckFailed(f"{flow.name}: the loop at {loop.header:x} is of no one loop of the text")

    def hooks(self, numeric: str, slot: str) -> list[tuple[int, int]]:
        """Functions behind a pointer of a term's code: address, and how many terms of the table have it."""
        found: dict[int, int] = {}
        twin = "q31" if numeric == "f32" else "f32"  # what is the same in both is linked by one of the two names
        for kind in self.text.counts.kinds:
            hooks = (f"{TERM_CODES[kind - 1]}_{slot}", "nothing")
            names = [f"gtc_{n}_{what}" for what in hooks for n in (numeric, twin)]
            address = next(self.addresses[n] for n in names if n in self.addresses)
            found[address] = found.get(address, 0) + 1
        return list(found.items())


@dataclass(slots=True)
class _Copy:
    """A function in one place where it is called: nodes of its blocks, edges by the blocks that they join."""

    flow: Flow
    around: str  # text of the loop that it is called in
    line: str  # text of the line that calls it, or what it is called by in the compiler's library
    node: dict[int, int]
    ways: dict[tuple[int, int], list[int]] = field(default_factory=dict)
    hooks: list[tuple[int, int, int]] = field(default_factory=list)  # block, edge to it, terms that have it


@dataclass(slots=True)
class Paths:
    """The linear program: flows along edges, each from a node to another; node 0 is the end."""

    program: Program
    numeric: str
    cost: list[int] = field(default_factory=lambda: [0])
    edges: list[tuple[int, int]] = field(default_factory=list)
    # Sum of factors x edges <= limit
    limits: list[tuple[dict[int, float], float]] = field(default_factory=list)
    entered: list[tuple[str, str, int]] = field(default_factory=list)  # caller, function, edge into it
    turns: dict[str, list[dict[int, float]]] = field(default_factory=dict)  # of loops, by text
    begun: dict[str, list[int]] = field(default_factory=dict)  # edges into loops from outside, by text
    stored: dict[str, list[int]] = field(default_factory=dict)  # nodes that write to memory for a line, by text
    long_quotients: list[int] = field(default_factory=list)  # edges into libgcc's way of dividing for these

    def whole(self, address: int) -> None:
        """Makes the graph of a function from its first instruction (edge 0) to its end (node 0)."""
        self.edges.append((-1, 0))
        first, exits = self.function(address)
        self.edges[0] = (-1, first)
        self.edges += [(node, 0) for node in exits]

    def function(
        self, address: int, above: tuple[int, ...] = (), around: str = "", line: str = ""
    ) -> tuple[int, list[int]]:
        """A copy of a function for one place where it is called: its first node, and those at which it ends.

        Raises:
            CheckFailed: It calls itself, or code that is not there.
        """
        if address in above or address not in self.program.flows:
            raise CheckFailed(f"a call to {address:x} cannot be followed: no bound on the instructions")
        flow = self.program.flows[address]
        copy = _Copy(flow, around, line, {start: self._node(block) for start, block in flow.blocks.items()})
        exits: list[int] = []
        for start, block in flow.blocks.items():
            done = self._called(copy, start, (*above, address))
            calls = block.hook or block.call is not None
            if block.leaves:
                exits += done if calls else [copy.node[start]]
            from_here = done if calls and not block.leaves else [copy.node[start]]
            for after in block.successors:
                ways = [self._edge(a, copy.node[after]) for a in from_here]
                copy.ways.setdefault((start, after), []).extend(ways)
        self._divided(copy)
        self._without_stand_ins(copy)
        for loop, at in self.program.loops_of(flow):
            self._bounded(copy, loop, at)
        return copy.node[address], exits

    def _node(self, block: Block) -> int:
        self.cost.append(len(block.instructions))
        for line in {i.line for i in block.instructions if i.line and i.name.startswith("str")}:
            self.stored.setdefault(self.program.text.at(line), []).append(len(self.cost) - 1)
        return len(self.cost) - 1

    def _edge(self, a: int, b: int) -> int:
        self.edges.append((a, b))
        return len(self.edges) - 1

    def _called(self, copy: _Copy, start: int, above: tuple[int, ...]) -> list[int]:
        """The nodes at which what a block calls ends; none where it calls nothing."""
        block = copy.flow.blocks[start]
        if block.hook:
            slot = re.search(r"->(begin|step|apply)\(", self.program.text.at(block.last.line))
            if slot is None:
                raise CheckFailed(f"{copy.flow.name}: a call through a pointer at {start:x} cannot be followed")
            callees = self.program.hooks(self.numeric, slot[1])
        elif block.call is not None:
            callees = [(block.call, 0)]
        else:
            return []
        ends: list[int] = []
        for callee, terms in callees:
            line = self.program.text.at(block.last.line) if block.last.line else copy.line
            if copy.flow.name.endswith("_angle"):
                line = ""  # an increment that does not fit is refused behind the division
            first, exits = self.function(callee, above, self._around(copy, start), line)
            way = self._edge(copy.node[start], first)
            self.entered.append((copy.flow.name, self.program.flows[callee].name, way))
            if terms:
                copy.hooks.append((start, way, terms))
            ends += exits
        return ends

    def _divided(self, copy: _Copy) -> None:
        """Ways through libgcc's division that no call takes: divisors of the runtime have 32 bits, and so have the
        quotients of most of its lines; then the upper word of what is divided is below the divisor."""
        if copy.flow.name != "__udivmoddi4":
            return
        first = copy.flow.blocks[copy.flow.entry]
        if not first.ends_with(("cmp", "r3, #0"), "bne"):
            return
        self._not_taken(copy, first)
        second = copy.flow.blocks[first.successors[1]]
        compared = [i.operands for i in second.instructions if i.name == "cmp"]
        if not (second.last.name.startswith("bls") and compared and compared[0].endswith(", r1")):
            return
        if copy.line in SHORT_QUOTIENTS:
            self._not_taken(copy, second)
        else:
            self.long_quotients += copy.ways[second.start, second.successors[0]]

    def _without_stand_ins(self, copy: _Copy) -> None:
        """A table without fallback models has 0 in the upper half of the word of a term's channel."""
        if self.program.text.counts.stand_ins:
            return
        for block in copy.flow.blocks.values():
            line = self.program.text.at(block.last.line) if block.last.line else ""
            if "(stand_in != 0U)" in line and block.shifts_by(16) and len(block.successors) == 2:
                self._not_taken(copy, block, 0 if block.last.name.startswith("bne") else 1)

    def _not_taken(self, copy: _Copy, block: Block, k: int = 0) -> None:
        """What comes behind the branch at the end of a block never runs: k = 0 where it is taken, 1 where it is not."""
        self.limits.append((dict.fromkeys(copy.ways[block.start, block.successors[k]], 1.0), 0.0))

    def _around(self, copy: _Copy, start: int) -> str:
        """The text of the innermost loop around a block; where there is none, of the loop that calls the function."""
        loops = [(len(loop.body), line) for loop, line in self.program.loops_of(copy.flow) if start in loop.body]
        return self.program.text.at(min(loops)[1]) if loops else copy.around

    def _bounded(self, copy: _Copy, loop: Loop, line: int) -> None:
        """Limits how often a loop goes round, and which terms it meets."""
        text = self.program.text
        outer = [(len(o.body), n) for o, n in self.program.loops_of(copy.flow) if o.body > loop.body]
        most = text.most(line, text.at(min(outer)[1]) if outer else copy.around, STAND_IN in copy.flow.name)
        back = [e for b in loop.latches for e in copy.ways[b, loop.header]]
        entries = [e for (a, b), es in copy.ways.items() for e in es if b == loop.header and a not in loop.body]
        tested_last = self._is_tested_last(copy.flow, loop, text.at(line))
        turns = dict.fromkeys(back, 1.0) | (dict.fromkeys(entries, 1.0) if tested_last else {})
        self.limits.append((_less(turns, entries, float(most)), float(most) if not entries else 0.0))
        self.turns.setdefault(text.at(line), []).append(turns)
        self.begun.setdefault(text.at(line), []).extend(entries)
        for start, way, terms in copy.hooks:
            if start in loop.body - loop.inner:
                self.limits.append((_less({way: 1.0}, entries, float(terms)), 0.0))

    def _is_tested_last(self, flow: Flow, loop: Loop, text: str) -> bool:
        """Whether a turn ends, and does not begin, with the test of the loop: turns are ways back and one more."""

        def tests(start: int) -> bool:
            block = flow.blocks[start]
            line = block.last.line
            leaves = any(after not in loop.body for after in block.successors)
            return leaves and self.program.text.is_loop(line) and self.program.text.at(line) == text

        one_block = loop.latches == {loop.header} and len(loop.body) == 1
        if all(tests(b) for b in loop.latches) and (one_block or not tests(loop.header)):
            return True
        # What is tested first is tested without a branch before: the conditions of the text are comparisons.
        return not tests(self._straight(flow, loop)) and any(tests(b) for b in loop.body)

    def _straight(self, flow: Flow, loop: Loop) -> int:
        """The block at which what always runs from the first block of a loop on ends with a branch or a call."""
        start = loop.header
        for _ in flow.blocks:
            block = flow.blocks[start]
            if len(block.successors) != 1 or block.call is not None or block.hook:
                break
            (start,) = block.successors
        return start

    def calls(self, caller: str, callee: str) -> list[dict[int, float]]:
        """Edges of calls, by patterns of the names' beginnings."""
        return [{e: 1.0} for a, b, e in self.entered if re.match(caller, a) and re.match(callee, b)]

    def stores(self, text: str) -> list[dict[int, float]]:
        """Edges into blocks that write to memory for a line with this text."""
        nodes = set(self.stored.get(text, []))
        return [{e: 1.0} for e, (_, to) in enumerate(self.edges) if to in nodes]

    def limit(self, flows: list[dict[int, float]], most: float) -> None:
        """The sum of flows is at most so much."""
        total: dict[int, float] = {}
        for some in flows:
            for edge, factor in some.items():
                total[edge] = total.get(edge, 0.0) + factor
        self.limits.append((total, float(most)))

    def most(self) -> int:
        """The most instructions on any way from the first node, that of edge 0, to the end."""
        from scipy import sparse  # a second for each start of gyrotc that asks for no bound
        from scipy.optimize import linprog

        n = len(self.edges)
        ends = np.array(self.edges)
        into, out_of = ends[:, 1], ends[1:, 0]
        balance = sparse.csr_matrix(
            (
                np.concatenate([np.ones(n), -np.ones(n - 1)]),
                (np.concatenate([into, out_of]), np.concatenate([np.arange(n), np.arange(1, n)])),
            ),
            shape=(len(self.cost), n),
        )
        cells = [(row, e, f) for row, (factors, _) in enumerate(self.limits) for e, f in factors.items()]
        rows, columns, factors = np.array(cells, dtype=float).reshape(-1, 3).T
        unequal = sparse.csr_matrix((factors, (rows.astype(int), columns.astype(int))), (len(self.limits), n))
        cost = np.array(self.cost, dtype=float)[into]
        right = np.zeros(len(self.cost))
        right[0] = 1.0  # what goes in at edge 0 comes out at the end
        found = linprog(
            -cost, A_ub=unequal, b_ub=[limit for _, limit in self.limits], A_eq=balance, b_eq=right,
            bounds=(0.0, None), method="highs",
        )  # fmt: skip
        if found.status != 0:
            raise CheckFailed(f"no bound on the instructions: {found.message}")
        return int(np.floor(-found.fun + _ROUNDING))


def _less(turns: dict[int, float], entries: list[int], most: float) -> dict[int, float]:
    """Factors of `turns - most x entries`."""
    factors = dict(turns)
    for e in entries:
        factors[e] = factors.get(e, 0.0) - most
    return factors


_MACRO = re.compile(r"^#define (\w+) (\d+)U?L?(?: |$)", re.MULTILINE)
_THUMB_2 = {"-mcpu=cortex-m3", "-mcpu=cortex-m4", "-mcpu=cortex-m7"}
_ELAPSED_BITS = 24  # of the blocks since the start: MAX_ELAPSED of libc/gtc_front.inl
# Of the program: the linker leaves lines of functions that it drops at addresses from 0 on, where objdump finds them.
_TEXT = 0x20000
_ALL = """#include "gtc_{symbol}.h"
gtc_word_t gtc_bound_saved[GTC_SAVE_WORDS];
const void *volatile gtc_bound[] = {{
{rows}
}};
int main(void)
{{
    return (gtc_bound[0] == 0) || (gtc_bound_saved[0].bits != 0U);
}}
"""


Bounds = dict[str, dict[str, int]]


def instruction_bounds(
    target: Target, c_folder: Path, tables: Mapping[str, Table], symbol: str, runtime: Object, work: Path
) -> Bounds:
    """The most instructions of each public function with a table, by arithmetic; those of an earlier call where the
    runtime is the same and the tables have the same sizes.

    Arithmetics for which the target has no instructions, so that the compiler's library computes, are left out; and
    all of them for targets without Thumb-2.

    Args:
        target: Compiler and flags.
        c_folder: Has the headers and the tables' source `gtc_<id>.c`.
        tables: Of the arithmetics that the source holds.
        symbol: The id of the tables.
        runtime: The object of `gtc.c`, with lines (`-g`).
        work: A folder to build in.

    Raises:
        CheckFailed: The compiler refused, or the code has no bound.
    """
    if not _THUMB_2.intersection(target.flags):
        return {}
    counts = {numeric: counts_of(table) for numeric, table in tables.items()}
    linked = [target.flags, target.link, target.script, target.bare]
    asked = [runtime.name, linked, [[numeric, asdict(known)] for numeric, known in counts.items()]]
    name = f"{digest_of(asked)}.bounds" if runtime.name else ""
    functions = functions_of((c_folder / "gtc_config.h").read_text("ascii"))
    found = cache.kept(name, lambda data: _checked(json.loads(data), counts, functions)) if name else None
    if found is None:
        found = _bounds(target, c_folder, counts, functions, symbol, runtime, work)
        if name:
            cache.keep(name, canonical_json(found))
    return found


def _checked(found: Bounds, counts: Mapping[str, Counts], functions: Sequence[str]) -> Bounds | None:
    numbers = [n for of_one in found.values() for n in of_one.values()]
    sound = set(found) <= set(counts) and all(set(of_one) == set(functions) for of_one in found.values())
    return found if sound and all(type(n) is int and n > 0 for n in numbers) else None


def _bounds(
    target: Target, c_folder: Path, counts: Mapping[str, Counts], functions: Sequence[str], symbol: str,
    runtime: Object, work: Path,
) -> Bounds:  # fmt: skip
    named = [f"(void *)gtc_{n}_{f}" for n in counts for f in functions]
    named += [f"&gtc_{symbol}_{n}" for n in counts]
    program = _linked(target, c_folder, named, symbol, runtime, work)
    flows = parse_flows("\n".join(disassembly(target, program)), "gtc.c")
    linked = symbols(target, program)
    addresses = {s.name: s.address & ~1 for s in linked}
    lines = (c_folder / "gtc.c").read_text("ascii").splitlines()
    headers = "\n".join((c_folder / name).read_text("ascii") for name in ("gtc.h", "gtc.c", "gtc_config.h"))
    macros = {name: int(number) for name, number in _MACRO.findall(headers)}
    macros["GTC_TERM_SLOTS"] = max(macros["GTC_MAX_TERMS"], 1)
    macros["GTC_SAVE_WORDS"] = next(s.size // 4 for s in linked if s.name == "gtc_bound_saved")
    found: Bounds = {}
    for numeric, known in counts.items():
        if numeric == "f32" and "-mfloat-abi=soft" in target.flags:
            continue
        of_table = Program(flows, addresses, LoopText(lines, macros, known))
        found[numeric] = {
            f: _bound(of_table, numeric, f, addresses[str(linked_name(addresses, numeric, f))]) for f in functions
        }
    return found


def _linked(target: Target, c_folder: Path, named: Sequence[str], symbol: str, runtime: Object, work: Path) -> Path:
    """A program with the functions and tables that are named."""
    source = work / "bound.c"
    rows = "\n".join(f"    {name}," for name in named)
    write_own(source, _ALL.format(symbol=symbol, rows=rows))
    lax = target.model_copy(update={"flags": (*target.flags, "-Wno-pedantic")})  # functions as addresses
    objects = compile_objects(lax, [c_folder / f"gtc_{symbol}.c", source], work, include=c_folder)
    placed = target.model_copy(update={"link": (*target.link, f"-Wl,--section-start=.text={_TEXT:#x}")})
    link(placed, [runtime.put(work / "gtc.o"), *objects], work / "bound")
    return work / "bound"


def _bound(program: Program, numeric: str, function: str, address: int) -> int:
    counts = program.text.counts
    paths = Paths(program, numeric)
    paths.whole(address)
    for text, most in totals(program.text.macros, function, counts).items():
        paths.limit(paths.turns.get(text, []), most)
    _of_blocks(paths, function, counts.by_name["n_channels"], counts.first_missing_blocks)
    _of_memories(paths, function, counts.kinds.count(MEMORY))
    if function == "angle":  # an increment with more than 32 bits is refused
        long = [{e: 1.0} for e in paths.long_quotients]
        paths.limit([*long, *paths.stores("*increment = (int_least32_t)out;")], 1)
    return paths.most()


def _of_blocks(paths: Paths, function: str, n_channels: int, missing_blocks: int) -> None:
    """Of the blocks that end while samples are missing, only the first can have readings; terms take note of it and of
    those until the temperature counts as missing."""
    if function == "sample":
        # A mean of each channel, and either a slope or, while the window fills, what stands for it.
        paths.limit(paths.calls("gtc_", "__aeabi_uldivmod"), n_channels + 1)
        paths.limit(paths.calls(".*", "gtc_..._map"), 2)
        paths.limit(paths.calls("gtc_..._end_block", ".*"), n_channels)
        paths.limit(paths.calls(".*", "gtc_..._step_terms"), missing_blocks + 1)


def _of_memories(paths: Paths, function: str, memories: int) -> None:
    """A memory is brought forward once in a call: by its first start, before which no block had readings, or for the
    uncertainty, over the blocks since the start."""
    for text in POWER:
        begun = [{e: 1.0} for e in paths.begun.get(text, [])]
        paths.limit(begun, memories)
        if function == "sample" and memories:
            shares = [{e: 1.0 / memories} for (e,) in begun]
            paths.limit([*shares, *paths.calls(".*", "gtc_..._map")], 2)
        if function in ("snapshot", "rezero"):
            paths.limit(paths.turns.get(text, []), _ELAPSED_BITS * memories)
