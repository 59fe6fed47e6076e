"""Static bounds on the instructions of every public function, beside the most that an emulator counted.

Besides, instructions of one Gaussian of a channel, counted in the object code of a bent line on a Cortex-M4F.
"""

from __future__ import annotations

import re
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from gyrotc.model import Coverage, Model, load_model
from gyrotc.tables.emit import emit
from gyrotc.tables.quantise import NUMERICS, quantise
from gyrotc.mirror.table import Table
from gyrotc.verify.bounds import instruction_bounds
from gyrotc.verify.toolchain import Target, all_targets, compile_c, disassembly, run_program, runtime_object
from results import table

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
MODELS = ("filter", "terms")
_CORES = ("cortex-m3", "cortex-m4f", "cortex-m7")
_EMPTY = 2  # instructions of the empty call that is taken off


def bounds() -> list[dict[str, Any]]:
    """A row for each model, core, arithmetic and function: the bound, the most that was counted, in how many calls."""
    return [
        row | {"model": name, "core": core}
        for name in MODELS
        for core in _CORES
        for row in bounds_of(model_of(name), all_targets()[core])
    ]


def model_of(name: str) -> Model:
    """The model of examples/nav_loop, whose constant a rest may move; or one with four terms and two channels."""
    if name == "filter":
        model = load_model(ROOT / "examples" / "nav_loop" / "filter_model.json")
        return model.model_copy(update={"rezero_dph": 0.003})
    model = load_model(ROOT / "tests" / "c" / "model_terms.json")
    return model.model_copy(update={"coverage": Coverage(cells=(2, 1), rows=("10",))})


def bounds_of(model: Model, target: Target) -> list[dict[str, Any]]:
    """Rows of one model and core."""
    with tempfile.TemporaryDirectory() as place:
        emit(model, Path(place))
        c, work = Path(place) / "c", Path(place) / "work"
        work.mkdir()
        tables = {n: quantise(model, n) for n in NUMERICS}
        runtime = runtime_object(target, c, work)
        found = instruction_bounds(target, c, tables, model.symbol, runtime, work)
        return [
            {"numeric": n, "function": function, "bound": most[function], "counted": counted, "calls": calls}
            for n, most in found.items()
            for function, (calls, counted) in _counted(model, target, tables[n], c, work).items()
        ]


def _counted(model: Model, target: Target, table: Table, c: Path, work: Path) -> dict[str, tuple[int, int]]:
    """Calls and the most instructions, by function."""
    (work / "counted.h").write_text(_header(model, table), "ascii")
    quiet = target.model_copy(update={"flags": (*target.flags, "-Wno-unused-parameter", f"-I{work}")})
    program = work / f"counted_{table.numeric}"
    compile_c(quiet, [HERE / "counted.c", c / "gtc.c", c / f"gtc_{model.symbol}.c"], program, include=c)
    run = run_program(target, program)
    rows = [line.split() for line in (run.stdout.decode("ascii") + run.stderr).splitlines()]
    return {
        row[0]: (int(row[1], 16), round(int(row[2], 16) / target.ticks_per_count) + _EMPTY)
        for row in rows
        if len(row) == 3
    }


def _header(model: Model, table: Table) -> str:
    n = table.numeric
    is_float = n == "f32"
    words = "\n".join(f"    {{.bits = 0x{word:08X}UL}}," for word in table.words)
    return f"""#include "gtc_{model.symbol}.h"
#define NAME(x) gtc_{n}_##x
#define NUM {"float" if is_float else "int_least32_t"}
#define TABLE gtc_{model.symbol}_{n}
#define ID GTC_{model.symbol.upper()}_ID
#define EDGE(member) ({"(member).value" if is_float else "(member)"})
#define WORD(word) ((word).{"value" if is_float else "integer"})
#define MISSING {"0x7FC00000UL" if is_float else "0x80000000UL"}
#define DT {"0.0009765625F" if is_float else "1000"}
#define N_CHANNELS {table.n_channels}U
#define PERIOD_BLOCK {table.block_us}UL
static const gtc_word_t image[] = {{
{words}
}};
"""


AIM = 1.2  # largest quotient of bound and count that was set as a goal
_TEXT = """## The most instructions of each function (`python -m bench docs --only bounds`)

*Bound*: that no call exceeds, from the object code: the graph of its blocks with all that it calls, loops bounded by
the sizes of the table, solved as a linear program (`gen/gyrotc/verify/bounds.py`). *Counted*: the most of {calls} calls
in QEMU that were made to take the longest ways (`bench/counted.c`). No count exceeds its bound; {within} of {all}
bounds are within {aim} of the count, the others in bold. What separates them: corrections in libgcc's 64-bit division
that its divisor never needs (`angle`); a loop over 32 bits for uncertainties that no table has (`rezero`); channels
that are lost one after the other, and blocks that end in the same call (`missed`, `sample`, `sample_at`). Instructions are
not cycles: what an instruction costs is the core's and its memory's. float32 on the M3 is software and has no bound
here.

`filter` is the table of `examples/nav_loop` with a constant that a rest may move, `terms` has a memory, a play, a
warm-up and an auxiliary channel.
"""
_COLUMNS = ("function", "bound ", "counted ", "bound ÷ counted ")


def section(result: dict[str, Any]) -> str:
    """The text and a table for each model, core and arithmetic."""
    rows = result["rows"]
    within = sum(row["bound"] <= AIM * row["counted"] for row in rows)
    parts = [_TEXT.format(calls=sum(r["calls"] for r in rows), within=within, all=len(rows), aim=AIM)]
    kinds = dict.fromkeys((r["model"], r["core"], r["numeric"]) for r in rows)
    for kind in kinds:
        own = [r for r in rows if (r["model"], r["core"], r["numeric"]) == kind]
        parts += [f"### {', '.join(kind)}\n", table(_COLUMNS, [_row(r) for r in own])]
    return "\n".join(parts)


def _row(row: dict[str, Any]) -> tuple[str, ...]:
    quotient = row["bound"] / row["counted"]
    text = f"{quotient:.3f}" if quotient <= AIM else f"**{quotient:.3f}**"
    return f"`{row['function']}`", str(row["bound"]), str(row["counted"]), text


ROOT = Path(__file__).resolve().parents[1]
_MODEL = ROOT / "tests" / "c" / "model_curve.json"
_OPENS = re.compile(r"(?:GTC_IN_LOOP|static|const|int|float)\b.*?FN\((\w+)\)\(")
_HEAD = re.compile(r"[0-9a-f]+ <(\w+)>:$")
_LINE = re.compile(r"\S*?gtc\.c:(\d+)(?: \(discriminator \d+\))?$")
_INSTRUCTION = re.compile(r"\s+[0-9a-f]+:\t(?!\.(?:word|short|byte))")
_GAUSSIANS = 2  # of a bent line
_OF_GAUSSIAN = {"gaussian_of_channel", "exp2", "high_of_squares", "high", "weighted", "accumulate"}


def gaussian_instructions() -> dict[str, float]:
    """Of one Gaussian, by arithmetic."""
    target = all_targets()["cortex-m4f"]
    with tempfile.TemporaryDirectory(prefix="gyrotc-part-") as place:
        emit(load_model(_MODEL), Path(place))
        c, work = Path(place) / "c", Path(place) / "work"
        work.mkdir()
        rows = disassembly(target, runtime_object(target, c, work).put(work / "gtc.o"))
        owner = _owners((c / "gtc.c").read_text("ascii"))
    return {n: _count_of(rows, owner, f"gtc_{n}_curve_apply") / _GAUSSIANS for n in NUMERICS}


def _owners(text: str) -> list[str]:
    """The function that every line of the text stands in, or the last one before it."""
    found, name = [], ""
    for line in text.splitlines():
        opens = _OPENS.match(line)
        name = opens[1] if opens and not line.rstrip().endswith(";") else name
        found.append(name)
    return found


def _count_of(rows: list[str], owner: list[str], function: str) -> int:
    """Instructions of Gaussians in a function.

    Raises:
        ValueError: The code has none, so that their text has other names now.
    """
    count: Counter[str] = Counter()
    inside, line = False, 0
    for row in rows:
        if head := _HEAD.match(row):
            inside = head[1] == function
        elif where := _LINE.match(row):
            line = int(where[1])
        elif inside and _INSTRUCTION.match(row):
            count[owner[line - 1]] += 1
    if not count["gaussian_of_channel"]:
        raise ValueError(f"{function} holds no Gaussian: {dict(count)}")
    return sum(count[name] for name in _OF_GAUSSIAN)
