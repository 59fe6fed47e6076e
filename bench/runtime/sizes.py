"""Link programs with the runtime and without it: flash, RAM, and instructions for a sample.

Beside the runtime stand programs without any test of their inputs: block means and slope by hand with four Gaussians or
with a network of emlearn, and a cubic. Everything that the linker keeps counts: code, constants, the table with its
uncertainties, helpers of the compiler; not start-up code or stack.
"""

from __future__ import annotations

import importlib.util
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.common import CheckFailed
from gyrotc.model import Model, RuntimePart, load_model
from gyrotc.tables import NUMERICS, SWITCHES, emit_texts, needs_of, quantise_all, runtime_texts
from gyrotc.verify import all_targets, compile_objects, link, run_program

from ..campaigns import say
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
#: Every text below defines in, out, start() and step(), which is called once for each sample.
_FOREVER = """
int main(void)
{{
    start();
    for (;;) {{
        step();
    }}
}}
"""
#: Prints the ticks of SAMPLES calls of step(), a slow ramp of T, as a decimal number from its last digit on.
_COUNTED = """
#include <stdio.h>
#include "board.h"
int main(void)
{{
    uint_least32_t ticks;
    int k;
    start();
    ticks = board_ticks();
    for (k = 0; k < {samples}; k++) {{
        in = 10.0F + 0.004F * (float)k;
        step();
    }}
    ticks = (board_ticks() - ticks) & BOARD_TICKS_MASK;
    do {{
        putchar('0' + (int)(ticks % 10U));
        ticks /= 10U;
    }} while (ticks != 0U);
    putchar('\\n');
    return 0;
}}
"""
_SAMPLES = 2000
_MAIN = """#include "gtc_{id}.h"
gtc_f32_state_t state;
{objects}
volatile float in;
volatile float out;
volatile int status;
static void start(void)
{{
    float c = in;
    float b = 0.0F;
    (void)c;
    (void)b;
    status = gtc_f32_init(&state, &gtc_{symbol}_f32, 1000000UL);
{calls}
}}
static void step(void)
{{
    float c = in;
    float b = 0.0F;
    status = gtc_f32_sample(&state, &gtc_{symbol}_f32, 1000000UL, &c);
    status = gtc_f32_bias(&state, &gtc_{symbol}_f32, &b);
    out = b;
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
#: Block means of ten samples, least-squares slope over ten of them, and a map; nothing is tested.
_BY_HAND = """
float window[10], sum, bias;
int n, filled;
volatile float in, out;
static void start(void) {{ }}
static void step(void)
{{
    sum += in;
    if (++n == 10) {{
        float slope = 0.0F;
        for (int i = 9; i > 0; i--) {{ window[i] = window[i - 1]; }}
        window[0] = sum / 10.0F;
        if (filled < 10) {{ filled++; }}
        for (int i = 0; i < 10; i++) {{ slope += (4.5F - (float)i) * window[i]; }}
        slope = (filled == 10) ? slope / 82.5F : 0.0F;
        bias = map(window[0], slope);
        sum = 0.0F;
        n = 0;
    }}
    out = bias;
}}
"""
_GAUSSIANS = """/* 2^-u by a cubic of its fraction, 1e-4 */
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
static float map(float temp, float slope)
{{
    float bias = 0.01F + 0.02F * temp + 0.03F * slope;
    for (int i = 0; i < 4; i++) {{
        const float a = (temp - centers[i][0]) * centers[i][1];
        const float b = (slope - centers[i][2]) * centers[i][3];
        bias += centers[i][4] * exp2_of_minus(a * a + b * b);
    }}
    return bias;
}}
"""
#: The network of `_mlp` in the file that emlearn writes.
_NETWORK = """#include "mlp.h"
static float map(float temp, float slope)
{{
    const float inputs[2] = {{ (temp - 10.0F) * 0.02F, slope * 2.0F }};
    return 0.01F + (0.0005F * mlp_regress1(inputs, 2));
}}
"""
_CUBIC = """volatile float in, out;
static void start(void) {{ }}
static void step(void)
{{
    const float t = in;
    out = 0.01F + t * (0.02F + t * (0.03F + t * 0.04F));
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


EMLEARN = "by hand: mean, slope, network of emlearn with 16 neurons"
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
    Program("by hand: mean, slope, four Gaussians", text=_GAUSSIANS + _BY_HAND),
    Program(EMLEARN, text=_NETWORK + _BY_HAND),
    Program("by hand: a cubic of each sample", text=_CUBIC),
)


_WHOLE = {"GTC_MAX_SLOPE_BLOCKS": 20, "GTC_MAX_TERMS": 4}


def size(program: Program, core: str, level: str, folder: Path) -> tuple[int, int]:
    """Return the bytes of flash and of RAM of a program.

    Raises:
        subprocess.CalledProcessError: It does not compile.
    """
    sources = _written(program, folder, _FOREVER)
    flags, libraries = _of_emlearn(program)
    command = [*COMPILER, *CORES[core], level, *flags, *sources, str(_MEMORY), *libraries, *LINKED, "-o", "program.elf"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    reported = subprocess.run(
        ["arm-none-eabi-size", "program.elf"], cwd=folder, check=True, capture_output=True, text=True
    ).stdout.splitlines()[1]
    text_bytes, data_bytes, zero_bytes = (int(word) for word in reported.split()[:3])
    return text_bytes + data_bytes, data_bytes + zero_bytes


def instructions_per_sample(program: Program, folder: Path) -> float:
    """Return the instructions of a program for a sample on a Cortex-M4F at -O2, mean over whole blocks.

    Raises:
        CheckFailed: It does not compile, or the emulator is missing or failed.
    """
    target = all_targets()["cortex-m4f"]
    if target.missing() is not None:
        raise CheckFailed(f"{target.name}: {target.missing()} is not installed")
    sources = [folder / name for name in _written(program, folder, _COUNTED)]
    flags, libraries = _of_emlearn(program)
    changes = {"flags": (*target.flags, "-Wno-error", *flags), "link": (*libraries, *target.link)}
    target = target.model_copy(update=changes)
    link(target, compile_objects(target, sources, folder, include=folder), folder / "counted")
    digits = run_program(target, folder / "counted").stdout.decode("ascii").strip()
    return int(digits[::-1]) / target.ticks_per_count / _SAMPLES


def _written(program: Program, folder: Path, main: str) -> list[str]:
    """Write the sources of a program; return the names of those to compile."""
    model = load_model(MODEL)
    model = model.model_copy(update={"left_out": program.left_out})
    (folder / "program.c").write_text(_text(program, main), encoding="ascii")
    if program.name == EMLEARN:
        (folder / "mlp.h").write_text(_mlp(model), encoding="ascii")
    if program.text is not _MAIN:
        return ["program.c"]
    for name, data in emit_texts(model, quantise_all(model, None)).items():
        (folder / name).write_bytes(data)
    if not program.is_fitted:
        whole = {name: max(value, 1) for name, value in needs_of(model).items()} | _WHOLE
        for name, data in runtime_texts(whole, NUMERICS).items():
            (folder / name).write_bytes(data)
    return ["program.c", "gtc_f32.c", f"gtc_{model.id}.c"]


def _text(program: Program, main: str) -> str:
    model = load_model(MODEL)
    calls = "\n".join(f"    status = {_CALLS[name].format(symbol=model.symbol)};" for name in program.calls)
    objects = "\n".join(text for name, text in _OBJECTS.items() if name in program.calls)
    return (program.text + main).format(
        id=model.id, symbol=model.symbol, calls=calls, objects=objects, samples=_SAMPLES
    )


def _is_measurable(program: Program) -> bool:
    """Test whether a program can be built: the network needs emlearn, and newlib for the functions of libm it names."""
    if program.name != EMLEARN:
        return True
    command = [*COMPILER, *CORES["Cortex-M4F"], "-print-file-name=libm.a"]
    found = subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()
    return Path(found).is_absolute() and importlib.util.find_spec("emlearn") is not None


def _of_emlearn(program: Program) -> tuple[list[str], list[str]]:
    """Return the flags for the compiler and for the linker that the network needs."""
    if program.name != EMLEARN:
        return [], []
    import emlearn

    return [f"-I{emlearn.includedir}"], ["-lm", "-lc"]


def _mlp(model: Model) -> str:
    """Train a network of 16 neurons on the map of the model, and return its C text."""
    from emlearn.net import c_generate_net_loadable
    from sklearn.neural_network import MLPRegressor

    rng = np.random.default_rng(0)
    z = rng.uniform(-1.0, 1.0, (4000, 2))
    low, high = np.transpose([model.envelope.temperature_c, model.envelope.slope_c_per_min])
    inputs = low + (z + 1.0) / 2.0 * (high - low)
    bias = model.map_dph(inputs[:, 0], inputs[:, 1])
    network = MLPRegressor(hidden_layer_sizes=(16,), activation="relu", solver="lbfgs", max_iter=3000, random_state=0)
    network.fit(z, (bias - bias.mean()) / bias.std())
    return str(c_generate_net_loadable(["relu", "identity"], network.coefs_, network.intercepts_, prefix="mlp"))


def _everywhere(measure: Callable[[str, str], tuple[int, int]]) -> dict[str, tuple[int, int]]:
    return {f"{core} {level}": measure(core, level) for core in CORES for level in LEVELS}


def sizes() -> dict[str, Any]:
    """Return flash and RAM of every program on every core at every level, and its instructions for a sample."""
    rows = []
    for program in PROGRAMS:
        if not _is_measurable(program):
            say(f"{program.name}: not measured, emlearn or newlib is not installed")
            continue
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            cells = _everywhere(partial(size, program, folder=folder))
            rows.append({"name": program.name, **cells, "instructions": instructions_per_sample(program, folder)})
    return {"centers": len(load_model(MODEL).networks[0].centers), "rows": rows}
