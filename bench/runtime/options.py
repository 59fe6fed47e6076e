"""What each option of the runtime costs: flash, RAM and stack, by switching one off in a program that calls everything.

`make bench ONLY=runtime` writes gen/gyrotc/tables/costs.json, which `emit` prints into `gtc_config.h`.
"""

from __future__ import annotations

import json
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gyrotc.model import load_model
from gyrotc.tables import COSTS, emit_texts, needs_of, quantise_all
from gyrotc.verify import parse_graph

from .sizes import COMPILER, CORES, LEVELS, LINKED, MODEL


@dataclass(frozen=True, slots=True)
class Option:
    """An option, what stands for it in the table, and its values with and without; `per`: steps between them."""

    option: str
    name: str
    more: int = 1
    less: int = 0
    per: int = 1


OPTIONS = (
    Option("GTC_MAX_SLOPE_BLOCKS", "a block of the slope", 20, 10, 10),
    Option("GTC_MAX_TERMS", "the first term, channels", 1, 0),
    Option("GTC_MAX_TERMS", "each further term", 4, 1, 3),
    Option("GTC_WITH_BANK", "several networks"),
    Option("GTC_WITH_UNCERTAINTY", "uncertainty and re-zero"),
    Option("GTC_WITH_REZERO", "re-zero alone"),
    Option("GTC_WITH_COVERAGE", "coverage"),
    Option("GTC_WITH_PROBES", "known answers"),
    Option("GTC_WITH_IMAGE", "images (open)"),
    Option("GTC_WITH_SAVE", "save, restore"),
    Option("GTC_WITH_TIME", "any time of a sample"),
)
_FULL = {"GTC_MAX_SLOPE_BLOCKS": 20, "GTC_MAX_TERMS": 4, "GTC_WITH_BANK": 1}
_PROGRAM = """#include "gtc_{id}.h"
gtc_f32_state_t state;
gtc_f32_table_t opened;
gtc_word_t saved[GTC_SAVE_WORDS];
gtc_f32_angle_t angle;
#if GTC_WITH_UNCERTAINTY
gtc_f32_snapshot_t snapshot;
#endif
const gtc_word_t *volatile image;
volatile float in[8];
volatile int status;
int main(void)
{{
    float c[GTC_MAX_TERMS + 1];
    c[0] = in[0];
    c[GTC_MAX_TERMS] = in[1];
    status = gtc_f32_check(&gtc_{symbol}_f32);
    status = gtc_f32_init(&state, &gtc_{symbol}_f32, 1000000UL);
    status = gtc_f32_sample(&state, (uint_least32_t)status, c);
    status = gtc_f32_bias(&state, c);
    status = gtc_f32_angle(&angle, c[0], 0.5F, c);
#if GTC_WITH_IMAGE
    status = gtc_f32_open(&opened, image, 64UL, 1UL);
#endif
#if GTC_WITH_SAVE
    status = gtc_f32_save(&state, saved);
    status = gtc_f32_restore(&state, &gtc_{symbol}_f32, 1000000UL, saved, 0UL);
#endif
#if GTC_WITH_UNCERTAINTY
    status = gtc_f32_snapshot(&state, &snapshot);
#endif
#if GTC_WITH_REZERO
    status = gtc_f32_rezero(&state, c[0], 60UL);
#endif
    return status;
}}
"""


def measure(core: str, level: str, options: dict[str, int], folder: Path) -> tuple[int, int, int]:
    """Bytes of flash, RAM and of the deepest stack of any function.

    Raises:
        subprocess.CalledProcessError: It does not compile.
    """
    defined = [f"-D{name}={value}" for name, value in options.items()]
    table = next(p.name for p in folder.glob("gtc_*.c") if p.name != "gtc.c")
    command = [*COMPILER, *CORES[core], level, *defined, "-fcallgraph-info=su", "program.c", "gtc.c", table]
    subprocess.run([*command, *LINKED, "-o", "program.elf"], cwd=folder, check=True, capture_output=True)
    printed = subprocess.run(
        ["arm-none-eabi-size", "program.elf"], cwd=folder, check=True, capture_output=True, text=True
    ).stdout.splitlines()[1]
    text_bytes, data_bytes, zero_bytes = (int(word) for word in printed.split()[:3])
    graph = parse_graph(next(folder.glob("*gtc.ci")).read_text("utf-8"))
    stack = max(graph.deepest(name) for name in graph.stack)
    return text_bytes + data_bytes, data_bytes + zero_bytes, stack


def costs() -> dict[str, Any]:
    """Every option on every core at every level."""
    model = load_model(MODEL)
    columns = [(core, level) for core in CORES for level in LEVELS]
    rows: list[dict[str, Any]] = [{"option": o.option, "name": o.name, "cells": []} for o in OPTIONS]
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for name, data in emit_texts(model, quantise_all(model, ["f32"])).items():
            (folder / name).write_bytes(data)
        program = _PROGRAM.format(id=model.id, symbol=model.symbol)
        (folder / "program.c").write_text(program, encoding="ascii")
        whole = {name: 1 for name in needs_of(model) if name.startswith("GTC_WITH_")} | _FULL
        for core, level in columns:
            found: dict[str, tuple[int, int, int]] = {}  # many pairs begin with the whole runtime
            for row, option in zip(rows, OPTIONS, strict=True):
                sizes = []
                for value in (option.more, option.less):
                    options = whole | {option.option: value}
                    if options["GTC_WITH_UNCERTAINTY"] == 0:
                        options["GTC_WITH_REZERO"] = 0
                    key = str(options)
                    found[key] = found.get(key) or measure(core, level, options, folder)
                    sizes.append(found[key])
                row["cells"].append([round((a - b) / option.per) for a, b in zip(*sizes, strict=True)])
    version = subprocess.run([COMPILER[0], "-dumpversion"], check=True, capture_output=True, text=True).stdout
    names = [f"{core.removeprefix('Cortex-')} {level}" for core, level in columns]
    return {"compiler": version.strip(), "columns": names, "rows": rows}


def write() -> None:
    """Writes the record that `emit` prints."""
    text = json.dumps(costs(), indent=1)
    COSTS.write_text(text + "\n", encoding="ascii")
