"""The most instructions that each public function can take on a target, from its object code and a table's sizes.

The code of a function with all that it calls is one graph of blocks; how often each can run is limited by what leads to
it and by the bounds of loops, and the most instructions under these limits are a linear program (`paths`). What is
known of the runtime beside its loops (`loops`) stands here, each fact with its reason. What has no bound is refused.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from ..store.opening import write_own
from ..target.table import Table
from .flow import parse_flows
from .functions import PUBLIC
from .loops import MEMORY, POWER, LoopText, counts_of, totals
from .paths import Paths, Program
from .toolchain import Target, compile_objects, disassembly, link, symbols

__all__ = ["instruction_bounds"]

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


def instruction_bounds(
    target: Target, c_folder: Path, tables: Mapping[str, Table], symbol: str, runtime: Path
) -> dict[str, dict[str, int]]:
    """The most instructions of each public function with a table, by arithmetic.

    Arithmetics for which the target has no instructions, so that the compiler's library computes, are left out; and
    all of them for targets without Thumb-2.

    Args:
        target: Compiler and flags.
        c_folder: Has the headers and the tables' source `gtc_<id>.c`.
        tables: Of the arithmetics that the source holds.
        symbol: The id of the tables.
        runtime: The object of `gtc.c`, with lines (`-g`); the program is built beside it.

    Raises:
        CheckFailed: The compiler refused, or the code has no bound.
    """
    if not _THUMB_2.intersection(target.flags):
        return {}
    program = _linked(target, c_folder, list(tables), symbol, runtime)
    flows = parse_flows("\n".join(disassembly(target, program)), "gtc.c")
    linked = symbols(target, program)
    addresses = {s.name: s.address & ~1 for s in linked}
    lines = (c_folder / "gtc.c").read_text("ascii").splitlines()
    headers = "\n".join((c_folder / name).read_text("ascii") for name in ("gtc.h", "gtc.c"))
    macros = {name: int(number) for name, number in _MACRO.findall(headers)}
    macros["GTC_SAVE_WORDS"] = next(s.size // 4 for s in linked if s.name == "gtc_bound_saved")
    found: dict[str, dict[str, int]] = {}
    for numeric, table in tables.items():
        if numeric == "f32" and "-mfloat-abi=soft" in target.flags:
            continue
        of_table = Program(flows, addresses, LoopText(lines, macros, counts_of(table)))
        found[numeric] = {
            f: _bound(of_table, numeric, f, _public(addresses, numeric, f), table) for f in PUBLIC
        }
    return found


def _public(addresses: Mapping[str, int], numeric: str, function: str) -> int:
    linked = re.compile(rf"gtc_{numeric}_{function}(?:_\d+blocks_\d+terms)?$")
    return next(address for name, address in addresses.items() if linked.match(name))


def _linked(target: Target, c_folder: Path, numerics: list[str], symbol: str, runtime: Path) -> Path:
    """A program with every public function and the tables."""
    work = runtime.parent
    source = work / "bound.c"
    names = [f"&gtc_{symbol}_{n}" for n in numerics] + [
        f"(void *)gtc_{n}_{f}" for n in numerics for f in PUBLIC
    ]
    rows = "\n".join(f"    {name}," for name in names)
    write_own(source, _ALL.format(symbol=symbol, rows=rows))
    lax = target.model_copy(update={"flags": (*target.flags, "-Wno-pedantic")})  # functions as addresses
    objects = compile_objects(lax, [c_folder / f"gtc_{symbol}.c", source], work, include=c_folder)
    placed = target.model_copy(update={"link": (*target.link, f"-Wl,--section-start=.text={_TEXT:#x}")})
    link(placed, [runtime, *objects], work / "bound")
    return work / "bound"


def _bound(program: Program, numeric: str, function: str, address: int, table: Table) -> int:
    paths = Paths(program, numeric)
    paths.whole(address)
    for text, most in totals(program.text.macros, function, table).items():
        paths.limit(paths.turns.get(text, []), most)
    _of_blocks(paths, function, table.n_channels, int(table.guards[6]))
    _of_memories(paths, function, program.text.counts.kinds.count(MEMORY))
    if function == "angle":  # an increment with more than 32 bits is refused
        long = [{e: 1.0} for e in paths.long_quotients]
        paths.limit([*long, *paths.stores("*increment = (int_least32_t)out;")], 1)
    return paths.most()


def _of_blocks(paths: Paths, function: str, n_channels: int, missing_blocks: int) -> None:
    """Of the blocks that end while samples are missing, only the first can have readings; terms take note of it and of
    those until the temperature counts as missing."""
    if function in ("sample", "missed", "sample_at"):
        # A mean of each channel, and either a slope or, while the window fills, what stands for it.
        paths.limit(paths.calls("gtc_", "__aeabi_uldivmod"), n_channels + 1)
    if function in ("missed", "sample_at"):
        paths.limit(paths.calls(".*", "gtc_..._map"), 1 if function == "missed" else 2)
        paths.limit(paths.calls("gtc_..._end_block", ".*"), n_channels)
        paths.limit(paths.calls(".*", "gtc_..._step_terms"), missing_blocks + 1)


def _of_memories(paths: Paths, function: str, memories: int) -> None:
    """A memory is brought forward once in a call: by its first start, before which no block had readings, or for the
    uncertainty, over the blocks since the start."""
    for text in POWER:
        begun = [{e: 1.0} for e in paths.begun.get(text, [])]
        paths.limit(begun, memories)
        if function in ("sample", "sample_at") and memories:
            shares = [{e: 1.0 / memories} for (e,) in begun]
            paths.limit([*shares, *paths.calls(".*", "gtc_..._map")], 2)
        if function in ("snapshot", "rezero"):
            paths.limit(paths.turns.get(text, []), _ELAPSED_BITS * memories)
