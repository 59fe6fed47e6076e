"""Static bounds on the instructions of every public function, beside the most that an emulator counted."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from gyrotc.model import Coverage, Model, load_model
from gyrotc.tables.emit import emit
from gyrotc.tables.quantise import NUMERICS, quantise
from gyrotc.target.table import Table
from gyrotc.verify.bounds import instruction_bounds
from gyrotc.verify.toolchain import Target, all_targets, compile_c, run_program, runtime_object

__all__ = ["MODELS", "bounds", "bounds_of", "model_of"]

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
