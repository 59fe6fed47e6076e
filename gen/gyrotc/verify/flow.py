"""Blocks, branches, calls and loops of linked Thumb-2 code, and how often its loops turn at most.

Every instruction carries the line of the C text that it was made for (`-g`), by which a loop of the object code is
known as a loop of the text. What cannot be followed (a jump through a table, a loop with two entries) is refused,
never passed over.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace

from ..common.errors import CheckFailed
from ..mirror.table import ARRAYS, Table

_FUNCTION = re.compile(r"^([0-9a-f]+) <([^>]+)>:$")
_INSTRUCTION = re.compile(r"^ *([0-9a-f]+):\t(\S+)(?:\t(.*))?$")
_LINE = re.compile(r"^\S*?([^/\s]+):(\d+)(?: \(discriminator \d+\))?$")
_TARGET = re.compile(r"(?:^|, )([0-9a-f]+) <")
_CONDITION = "(?:eq|ne|cs|hs|cc|lo|mi|pl|vs|vc|hi|ls|ge|lt|gt|le)"
_BRANCH = re.compile(rf"b({_CONDITION})?(?:\.[nw])?$")
_CALL = re.compile(r"bl(?:\.w)?$")
_INDIRECT = re.compile(r"blx$")
_BY_REGISTER = re.compile(rf"bx({_CONDITION})?$")
_DATA = (".word", ".short", ".byte")
_UNKNOWN = re.compile(rf"(?:tb[bh]|(?:mov|add)s?(?:{_CONDITION})?(?:\.w)?$|bl{_CONDITION}$|blx{_CONDITION}$)")
_RETURN = re.compile(rf"(?:pop|ldmia|ldmdb|ldr)({_CONDITION})?(?:\.w)?$")


@dataclass(frozen=True, slots=True)
class Instruction:
    """One instruction; `line` is that of the C text, 0 where there is none."""

    address: int
    name: str
    operands: str
    line: int

    @property
    def target(self) -> int | None:
        """The address that a branch or call names."""
        found = _TARGET.search(self.operands)
        return int(found[1], 16) if found else None


@dataclass(slots=True)
class Block:
    """Instructions that run one after the other; what comes behind them.

    `call` is the address of a function called at the end, `hook` says that a pointer is called there; `leaves` that
    the function ends there (after a call in last place, too).
    """

    instructions: list[Instruction]
    successors: list[int] = field(default_factory=list)
    call: int | None = None
    hook: bool = False
    leaves: bool = False

    @property
    def start(self) -> int:
        return self.instructions[0].address

    @property
    def last(self) -> Instruction:
        return self.instructions[-1]

    def ends_with(self, before: tuple[str, str], name: str) -> bool:
        """Whether the last two instructions are `before`, with these operands, and one whose name begins so."""
        tests = [(i.name, i.operands) for i in self.instructions[-2:]]
        return tests[0] == before and self.last.name.startswith(name)

    def shifts_by(self, n: int) -> bool:
        """Whether a branch at its end asks if what a word has above its lowest n bits is 0."""
        moved = self.instructions[-2:][0]
        shifted = moved.name.startswith("lsrs") or (moved.name.startswith("movs") and "lsr" in moved.operands)
        return shifted and moved.operands.endswith(f"#{n}") and self.last.name.startswith(("beq", "bne"))


@dataclass(frozen=True, slots=True)
class Loop:
    """A natural loop: addresses of blocks; `inner` are those of loops within it."""

    header: int
    latches: frozenset[int]
    body: frozenset[int]
    inner: frozenset[int]


@dataclass(slots=True)
class Flow:
    """A function: its blocks by address, entered at `entry`."""

    name: str
    entry: int
    blocks: dict[int, Block]

    def loops(self) -> list[Loop]:
        """Natural loops, by back edges to a block that dominates them.

        Raises:
            CheckFailed: A loop has more than one entry.
        """
        dominators = self._dominators()
        latches: dict[int, set[int]] = {}
        for start, block in self.blocks.items():
            for after in block.successors:
                if start in dominators and after in dominators[start]:
                    latches.setdefault(after, set()).add(start)
        bodies = {header: self._body(header, found) for header, found in latches.items()}
        self._refuse_other_cycles({(b, h) for h, found in latches.items() for b in found})
        return [
            Loop(h, frozenset(latches[h]), frozenset(body), frozenset(_inside(h, body, bodies)))
            for h, body in bodies.items()
        ]

    def _dominators(self) -> dict[int, set[int]]:
        reached = self._reached()
        before: dict[int, set[int]] = {b: set() for b in reached}
        for b in reached:
            for after in self.blocks[b].successors:
                before[after].add(b)
        found = {b: set(reached) for b in reached}
        found[self.entry] = {self.entry}
        changed = True
        while changed:
            changed = False
            for b in reached[1:]:
                new = {b} | set.intersection(*(found[p] for p in before[b]))
                changed |= new != found[b]
                found[b] = new
        return found

    def _reached(self) -> list[int]:
        order, seen = [self.entry], {self.entry}
        for b in order:
            for after in self.blocks[b].successors:
                if after not in seen:
                    seen.add(after)
                    order.append(after)
        return order

    def _body(self, header: int, latches: set[int]) -> set[int]:
        before: dict[int, set[int]] = {b: set() for b in self.blocks}
        for b in self._reached():
            for after in self.blocks[b].successors:
                before[after].add(b)
        body, work = {header}, list(latches)
        while work:
            b = work.pop()
            if b not in body:
                body.add(b)
                work.extend(before[b])
        return body

    def _refuse_other_cycles(self, back: set[tuple[int, int]]) -> None:
        """Without its back edges a function of natural loops has no cycle."""
        left = {b: [a for a in self.blocks[b].successors if (b, a) not in back] for b in self._reached()}
        while ends := [b for b, after in left.items() if not any(a in left for a in after)]:
            for b in ends:
                del left[b]
        if left:
            raise CheckFailed(f"{self.name} has a loop with two entries: no bound on its instructions")


def _inside(header: int, body: set[int], bodies: dict[int, set[int]]) -> Iterator[int]:
    for other, blocks in bodies.items():
        if other != header and other in body:
            yield from blocks


def parse_flows(text: str, source: str) -> dict[int, Flow]:
    """Functions by address, from `objdump -d -l --no-show-raw-insn`; lines are those of the file `source`.

    Raises:
        CheckFailed: An instruction moves the program counter in a way that is not followed.
    """
    flows: dict[int, Flow] = {}
    for name, instructions in _functions(text, source):
        if instructions:
            entry = instructions[0].address
            flows[entry] = Flow(name, entry, _blocks(name, instructions))
    return flows


def _functions(text: str, source: str) -> Iterator[tuple[str, list[Instruction]]]:
    name, found, line = "", list[Instruction](), 0
    for row in text.splitlines():
        if head := _FUNCTION.match(row):
            yield name, found
            name, found, line = head[2], [], 0
        elif (code := _INSTRUCTION.match(row)) and code[2] not in _DATA:
            operands = (code[3] or "").split("@")[0].strip()
            found.append(Instruction(int(code[1], 16), code[2], operands, line))
        elif where := _LINE.match(row):
            line = int(where[2]) if where[1] == source else 0
    yield name, found


def _blocks(name: str, instructions: list[Instruction]) -> dict[int, Block]:
    own = {i.address for i in instructions}
    ends = {i.address: _end(name, i, own) for i in instructions}
    starts = {instructions[0].address}
    for k, i in enumerate(instructions):
        if (end := ends[i.address]) is not None:
            starts.update(following.address for following in instructions[k + 1 : k + 2])
            starts.update(end.successors)
    blocks: dict[int, Block] = {}
    for k, i in enumerate(instructions):
        if i.address in starts:
            current = blocks[i.address] = Block([])
        current.instructions.append(i)
        after = instructions[k + 1].address if k + 1 < len(instructions) else None
        if (end := ends[i.address]) is not None:
            current.call, current.hook, current.leaves = end.call, end.hook, end.leaves
            current.successors = list(end.successors)
            falls = _falls(i, end)
        else:
            falls = after in starts
        if falls and after is not None:
            current.successors.append(after)
    return blocks


def _falls(i: Instruction, end: Block) -> bool:
    """Whether the instruction behind the end of a block may come next."""
    if end.call is not None or end.hook:
        return not end.leaves or _is_conditional(i)
    return _is_conditional(i)


def _is_conditional(i: Instruction) -> bool:
    if i.name.startswith("cb"):
        return True
    for form in (_BRANCH, _BY_REGISTER, _RETURN):
        if found := form.match(i.name):
            return found[1] is not None
    return False


def _end(name: str, i: Instruction, own: set[int]) -> Block | None:
    """What an instruction at the end of a block does (successors but the next one); None for any other."""
    if i.name in ("cbz", "cbnz") or _BRANCH.match(i.name):
        if i.target in own:
            return Block([i], [i.target])
        return Block([i], call=i.target, leaves=True)
    if _CALL.match(i.name):
        return Block([i], call=i.target)
    if _INDIRECT.match(i.name):
        return Block([i], hook=True)
    if _BY_REGISTER.match(i.name):
        return Block([i], hook=i.operands != "lr", leaves=True)
    if _RETURN.match(i.name) and re.search(r"\bpc\}|^pc,", i.operands):
        return Block([i], leaves=True)
    if i.name == "udf":
        return Block([i], leaves=True)
    if _UNKNOWN.match(i.name) and (i.name[0] in "tb" or i.operands.startswith("pc")):
        raise CheckFailed(f"{name}: {i.name} {i.operands} is not followed: no bound on its instructions")
    return None


_STATEMENT = re.compile(r"^\s*(?:for|while) \(")
_FOR = re.compile(
    r"for \((?P<v>\w+) = (?P<start>[^;]+); (?P=v) (?P<to><=?) (?P<end>[^;]+); (?P=v)(?:\+\+| \+= (?P<by>\d+)U)\)"
)
MEMORY = 1  # kind of a term: docs/FORMAT.md, section 3
_BITS = 32  # of a word: loops over its bits


@dataclass(frozen=True, slots=True)
class Counts:
    """Of a table, what limits its loops: all that a bound on instructions takes from it."""

    by_name: dict[str, int]
    centers: int  # of the largest network
    is_narrow: bool  # fixed point: the loop for large scales is taken
    missing_blocks: int  # most of any channel
    words: int  # of the image
    kinds: tuple[int, ...]  # of the terms
    stand_ins: int = 0
    stand_in_centers: int = 0  # of the largest of their networks
    records: dict[str, int] = field(default_factory=dict)  # of each array
    first_missing_blocks: int = 0  # of the first channel


def counts_of(table: Table) -> Counts:
    sizes = {name: getattr(table, name).size // (record or 1) for name, record in ARRAYS.items()}
    named = {f"n_{name}": sizes[name] for name in ("networks", "centers", "terms", "sigma", "probes")}
    named |= {"n_channels": table.n_channels, "slope_blocks": table.slope_blocks}
    n_map = len(table.networks) // ARRAYS["networks"] - table.n_stand_ins
    return Counts(
        named,
        int(table.records("networks")[:, 0].max()),
        table.numeric == "q31" and table.scale[2] != 0,
        int(table.records("guards")[:, 6].max()),
        len(table.words),
        tuple(int(k) for k in table.records("terms")[:, 0]),
        table.n_stand_ins,
        int(max(table.records("networks")[n_map:, 0], default=0)),
        sizes,
        int(table.guards[6]),
    )


_WORDS = "for (i = 0; i < n; i++) {"  # of gtc_crc_words()
_SAVED = 256  # more words than any state that is saved has
_NUMBERS = "for (i = 0U; i < n; i++) {"  # of numbers_fit(); n is that of the records which the loop around it goes over
#: Words of a record that are numbers with a range, by what the loop over the records is bounded by: docs/FORMAT.md,
#: section 3.
_RECORDS = {"n_sigma": 1, "network[NETWORK_CENTERS].bits": 5, "n_networks": 7, "n_terms": 6, "n_channels": 4}
#: Lines whose quotient has 32 bits: of means and slopes, which fit a word (GTC_ASSERT of `mean` and `quotient`),
#: and of a part by its whole, in 2^-31.
SHORT_QUOTIENTS = ("const uint_least64_t q = (magnitude + (den / 2U)) / den;", "part = (part << 31) / whole;")
#: Whole numbers of the header are looked at from the counts on before they are looked at from the first on.
_WHOLES = "for (i = first; i < N_WHOLE; i++) {"
POWER = ("while (rest != 0U) {", "for (rest = blocks; rest != 0U; rest >>= 1) {")

#: Loops that are no plain count, by their text; docs/numerics.md says why each ends.
_OTHER: dict[str, Callable[[Counts, int], int]] = {
    "for (i = state->table->slope_blocks - 1U; i > 0U; i--) {": lambda c, _: c.by_name["slope_blocks"] - 1,
    "for (bit = (uint_least32_t)1U << last; bit > 1U; bit >>= 1) {": lambda c, _: c.by_name["slope_blocks"] - 1,
    "for (i = 1U; i < number; i++) {": lambda c, _: c.by_name["n_networks"] - 1,  # before a fallback model
    # A running block, those until every channel counts as missing, and the rest of the last one.
    "while (rest > 0U) {": lambda c, _: c.missing_blocks + 3,
    "while (center != end) {": lambda c, unrolled: 0 if c.is_narrow else c.centers // unrolled,
    "for (center = centers; center != end; center = &center[GTC_CENTER_WORDS]) {": (
        lambda c, _: c.centers if c.is_narrow else 0
    ),
    "while (rest != 0U) {": lambda _c, _: _BITS,
    "for (rest = blocks; rest != 0U; rest >>= 1) {": lambda _c, _: _BITS,
    "while (whole > 0xFFFFFFFFU) {": lambda _c, _: _BITS,
    "while (bit != 0U) {": lambda _c, _: _BITS,
    # Words of several arrays, of which all together are as many as `totals` says.
    _WORDS: lambda c, _: max(c.words, _SAVED),
}


@dataclass(slots=True)
class LoopText:
    """The C text by its lines, with what its loops say."""

    lines: list[str]
    macros: dict[str, int]
    counts: Counts

    def is_loop(self, line: int) -> bool:
        return 0 < line <= len(self.lines) and _STATEMENT.match(self.lines[line - 1]) is not None

    def at(self, line: int) -> str:
        return self.lines[line - 1].strip()

    def most(self, line: int, around: str, of_stand_in: bool = False) -> int:
        """The most turns of a loop, in the loop with the text `around`, for each time that it is come to.

        Args:
            line, around: The loop's line; the text of the loop around it.
            of_stand_in: In a function that asks no network of the map.

        Raises:
            CheckFailed: Its text gives no bound.
        """
        text = self.at(line)
        if text == _NUMBERS:
            return next((n for name, n in _RECORDS.items() if name in around), self.macros["N_NUMBERS"])
        if text in _OTHER:
            centers = self.counts.stand_in_centers if of_stand_in else self.counts.centers
            return _OTHER[text](replace(self.counts, centers=centers), 1 + self.macros.get("GTC_UNROLL", 1))
        found = _FOR.match(text)
        end = self._number(found["end"]) if found else None
        if found is None or end is None:
            raise CheckFailed(f"no bound for the loop of line {line}: {text}")
        n = end - (self._number(found["start"]) or 0) + (found["to"] == "<=")
        return max(0, -(-n // int(found["by"] or 1)))

    def _number(self, text: str) -> int | None:
        word = re.sub(r"^\(uint_least32_t\)|^FN\((?=n_\w+\)\()", "", text)
        word = word.partition(")(")[0].rsplit("->", 1)[-1]
        if word == "network[NETWORK_CENTERS].bits":
            return self.counts.centers
        if number := re.fullmatch(r"(\d+)U?L?", word):
            return int(number[1])
        return self.counts.by_name.get(word, self.macros.get(word))


def totals(macros: Mapping[str, int], function: str, counts: Counts) -> dict[str, int]:
    """Turns that all calls of a function that takes the words of an array make together."""
    size = counts.records
    numbers = (
        macros["N_NUMBERS"] + 7 * size["networks"] + 5 * size["centers"] + 5 * size["guards"] + 6 * size["terms"]
        + size["sigma"]
    )  # fmt: skip
    words = macros["GTC_SAVE_WORDS"] if function in ("save", "restore") else counts.words
    known = macros["N_WHOLE"] - macros["FIRST_COUNT"]
    wholes = macros["N_WHOLE"] + (2 if function == "check" else 1) * known
    return {_NUMBERS: numbers, _WORDS: words, _WHOLES: wholes}
