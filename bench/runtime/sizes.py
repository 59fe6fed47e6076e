"""What a program takes of the runtime: flash and RAM of six programs, beside a map and a cubic written by hand.

Everything that the linker keeps counts: code, constants, the table with its uncertainties, helpers of the compiler; not
start-up code or stack.
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from gyrotc.model import RuntimePart, load_model
from gyrotc.tables import NUMERICS, SWITCHES, emit_texts, needs_of, quantise_all, runtime_texts

from ..records import ROOT

MODEL = ROOT / "examples" / "nav_loop" / "filter_model.json"  # of a simulated gyro, with uncertainties
CORES = {
    "Cortex-M0": ("-mcpu=cortex-m0",),
    "Cortex-M4F": ("-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"),
    "Cortex-M7": ("-mcpu=cortex-m7", "-mfloat-abi=hard", "-mfpu=fpv5-sp-d16"),
}
LEVELS = ("-Os", "-O2")
COMPILER = (
    "arm-none-eabi-gcc",
    "-std=c99",
    "-ffp-contract=off",
    "-mthumb",
    "-ffunction-sections",
    "-fdata-sections",
)
LINKED = ("-nostdlib", "-Wl,--gc-sections", "-Wl,-e,main", "-lgcc")

#: The four functions of a C library that compilers call of their own accord.
_MEMORY = ROOT / "gen" / "gyrotc" / "verify" / "bare" / "memory.c"
_MAIN = """#include "gtc_{id}.h"
gtc_f32_state_t state;
{objects}
volatile float in;
volatile float out;
volatile int status;
int main(void)
{{
    float c = in;
    float b = 0.0F;
    status = gtc_f32_init(&state, &gtc_{symbol}_f32, 1000000UL);
{calls}
    for (;;) {{
        c = in;
        status = gtc_f32_sample(&state, &gtc_{symbol}_f32, 1000000UL, &c);
        status = gtc_f32_bias(&state, &gtc_{symbol}_f32, &b);
        out = b;
    }}
}}
"""
_CALLS = {
    "check": "gtc_f32_check(&gtc_{symbol}_f32)",
    "snapshot": "gtc_f32_snapshot(&state, &gtc_{symbol}_f32, &snapshot)",
    "rezero": "gtc_f32_rezero(&state, &gtc_{symbol}_f32, c, 60UL)",
    "save": "gtc_f32_save(&state, &gtc_{symbol}_f32, saved)",
    "restore": "gtc_f32_restore(&state, &gtc_{symbol}_f32, 1000000UL, saved, 0UL)",
    "open": "gtc_f32_open(&opened, image, 64UL, 1UL)",
    "angle": "gtc_f32_angle(&angle, b, 0.5F, &c)",
}
_OBJECTS = {
    "snapshot": "gtc_f32_snapshot_t snapshot;",
    "save": "gtc_word_t saved[GTC_SAVE_WORDS];",
    "open": "gtc_f32_table_t opened;\nconst gtc_word_t *volatile image; /* no constant of the program */",
    "angle": "gtc_f32_angle_t angle;",
}
#: Block means of a minute's samples, least-squares slope over ten of them, four Gaussians; nothing is tested.
_MAP = """/* 2^-u by a cubic of its fraction, 1e-4 */
static float exp2_of_minus(float u)
{{
    union {{ float value; unsigned bits; }} power;
    const int whole = (u < 120.0F) ? (int)u : 120;
    const float f = (float)whole - u;
    power.bits = (unsigned)(127 - whole) << 23;
    return power.value * (1.0F + f * (0.6930F + f * (0.2362F + f * 0.0432F)));
}}
static const float centers[4][5] = {{ {{1.0F,2.0F,3.0F,4.0F,5.0F}}, {{2.0F,2.0F,3.0F,4.0F,5.0F}},
                                      {{3.0F,2.0F,3.0F,4.0F,5.0F}}, {{4.0F,2.0F,3.0F,4.0F,5.0F}} }};
float window[10], sum, bias;
int n, filled;
volatile float in, out;
int main(void)
{{
    for (;;) {{
        sum += in;
        if (++n == 10) {{
            float slope = 0.0F;
            for (int i = 9; i > 0; i--) {{ window[i] = window[i - 1]; }}
            window[0] = sum / 10.0F;
            if (filled < 10) {{ filled++; }}
            for (int i = 0; i < 10; i++) {{ slope += (4.5F - (float)i) * window[i]; }}
            slope = (filled == 10) ? slope / 82.5F : 0.0F;
            bias = 0.01F + 0.02F * window[0] + 0.03F * slope;
            for (int i = 0; i < 4; i++) {{
                const float a = (window[0] - centers[i][0]) * centers[i][1];
                const float b = (slope - centers[i][2]) * centers[i][3];
                bias += centers[i][4] * exp2_of_minus(a * a + b * b);
            }}
            sum = 0.0F;
            n = 0;
        }}
        out = bias;
    }}
}}
"""
_CUBIC = """volatile float in, out;
int main(void)
{{
    for (;;) {{
        const float t = in;
        out = 0.01F + t * (0.02F + t * (0.03F + t * 0.04F));
    }}
}}
"""


@dataclass(frozen=True)
class Program:
    """Functions that are called beside init, sample and bias.

    `is_fitted`: the runtime has what the table needs, else everything.
    `left_out`: parts that the product leaves out of table and runtime.
    """

    name: str
    calls: tuple[str, ...] = ()
    is_fitted: bool = True
    left_out: tuple[RuntimePart, ...] = ()
    text: str = _MAIN


_ALL_BUT_SIGMA = tuple(part for part in SWITCHES if part != "uncertainty")
PROGRAMS = (
    Program("init, sample, bias; whole runtime", is_fitted=False),
    Program("init, sample, bias"),
    Program("init, sample, bias; all else left out", left_out=tuple(SWITCHES)),
    Program("with check; all else left out", ("check",), left_out=tuple(SWITCHES)),
    Program("with snapshot; all else left out", ("snapshot",), left_out=_ALL_BUT_SIGMA),
    Program("with check", ("check",)),
    Program("with check and snapshot", ("check", "snapshot")),
    Program("with check, snapshot, rezero, save, restore", ("check", "snapshot", "rezero", "save", "restore")),
    Program("every function, whole runtime", tuple(_CALLS), is_fitted=False),
    Program("by hand: mean, slope, four Gaussians", text=_MAP),
    Program("by hand: a cubic of each sample", text=_CUBIC),
)


_WHOLE = {"GTC_MAX_SLOPE_BLOCKS": 20, "GTC_MAX_TERMS": 4}


def size(program: Program, core: str, level: str, folder: Path) -> tuple[int, int]:
    """Bytes of flash and of RAM of a program.

    Raises:
        subprocess.CalledProcessError: It does not compile.
    """
    model = load_model(MODEL)
    model = model.model_copy(update={"left_out": program.left_out})
    for name, data in emit_texts(model, quantise_all(model, None)).items():
        (folder / name).write_bytes(data)
    if not program.is_fitted:
        whole = {name: max(value, 1) for name, value in needs_of(model).items()} | _WHOLE
        for name, data in runtime_texts(whole, NUMERICS).items():
            (folder / name).write_bytes(data)
    (folder / "program.c").write_text(_text(program), encoding="ascii")
    sources = ["program.c", *(("gtc_f32.c", f"gtc_{model.id}.c") if program.text is _MAIN else ())]
    return _linked(sources, core, level, folder)


def _text(program: Program) -> str:
    model = load_model(MODEL)
    calls = "\n".join(f"    status = {_CALLS[name].format(symbol=model.symbol)};" for name in program.calls)
    objects = "\n".join(text for name, text in _OBJECTS.items() if name in program.calls)
    return program.text.format(id=model.id, symbol=model.symbol, calls=calls, objects=objects)


def _linked(sources: Sequence[str], core: str, level: str, folder: Path) -> tuple[int, int]:
    command = [*COMPILER, *CORES[core], level, *sources, str(_MEMORY), *LINKED, "-o", "program.elf"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    reported = subprocess.run(
        ["arm-none-eabi-size", "program.elf"], cwd=folder, check=True, capture_output=True, text=True
    ).stdout.splitlines()[1]
    text_bytes, data_bytes, zero_bytes = (int(word) for word in reported.split()[:3])
    return text_bytes + data_bytes, data_bytes + zero_bytes


def _everywhere(measure: Callable[[str, str], tuple[int, int]]) -> dict[str, tuple[int, int]]:
    return {f"{core} {level}": measure(core, level) for core in CORES for level in LEVELS}


def sizes() -> dict[str, Any]:
    """Return flash and RAM of every program on every core at every level of the compiler."""
    with tempfile.TemporaryDirectory() as place:
        rows = [{"name": p.name, **_everywhere(partial(size, p, folder=Path(place)))} for p in PROGRAMS]
    return {"centers": len(load_model(MODEL).networks[0].centers), "rows": rows}
