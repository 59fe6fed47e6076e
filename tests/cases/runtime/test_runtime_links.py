"""The runtime as compiler, linker and user see it: headers, names, what a program takes of it, images that open."""

from __future__ import annotations

import ctypes
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import require
from gyrotc.mirror import E_ID, E_IMAGE, E_LAYOUT, SERIAL_WORDS, Table, Words
from gyrotc.model import Model, RuntimePart, Term
from gyrotc.tables import NUMERICS, emit, emit_texts, quantise_all
from gyrotc.verify import all_targets, compile_c, compile_objects, run_program
from libc_build import Runtime, runtime
from libc_device import Device, history, variant
from models import random_model

ROOT = Path(__file__).resolve().parents[3]
MINIMAL = ROOT / "examples" / "minimal"
RIGHT = ("-std=c99", "-ffp-contract=off", f"-I{ROOT / 'include'}", f"-I{ROOT / 'libc'}", f"-I{MINIMAL}")
SOURCES = [str(ROOT / "libc" / f"gtc_{name}.c") for name in ("f32", "q31")]
#: Every public function, in a program without start-up code; `_start` is never run here.
ALONE = """
#include <stddef.h>
#include "gtc_rlg_0042.h"

static gtc_{n}_state_t state;
static gtc_{n}_table_t opened;
static gtc_{n}_angle_t sum;
static gtc_word_t words[GTC_SAVE_WORDS];
static gtc_{n}_snapshot_t snapshot;

/* What a compiler calls of its own accord. */
void *memcpy(void *restrict to, const void *restrict from, size_t n)
{{
    char *restrict a = to;
    const char *restrict b = from;
    while (n-- != 0U) {{
        *a++ = *b++;
    }}
    return to;
}}

void *memset(void *to, int value, size_t n)
{{
    char *a = to;
    while (n-- != 0U) {{
        *a++ = (char)value;
    }}
    return to;
}}

void _start(void);
void _start(void)
{{
    static {number} x[1];
    volatile int done = gtc_{n}_check(&gtc_rlg_0042_{n}) + gtc_{n}_open(&opened, words, 9U, 1U)
                        + gtc_{n}_check_words(&opened)
                        + gtc_{n}_map(&opened, x[0], x[0], x) + gtc_{n}_init(&state, &opened, 1000000UL)
                        + gtc_{n}_sample(&state, &opened, 9U, x) + gtc_{n}_bias(&state, &opened, x)
                        + gtc_{n}_snapshot(&state, &opened, &snapshot)
                        + gtc_{n}_rezero(&state, &opened, x[0], 9U)
                        + gtc_{n}_angle(&sum, x[0], x[0], x) + gtc_{n}_save(&state, &opened, words)
                        + gtc_{n}_restore(&state, &opened, 9U, words, 0U);
    while (done != 0) {{
    }}
}}
"""
NUMBERS = {"f32": "float", "q31": "int_least32_t"}
ARM = ("arm-none-eabi-gcc", "-mthumb", "-ffreestanding")
COMPILERS = {
    "gcc": ("gcc", "-fno-stack-protector"),
    "clang": ("clang", "-fno-stack-protector"),
    "Cortex-M0": (*ARM, "-mcpu=cortex-m0"),
    "Cortex-M4F": (*ARM, "-mcpu=cortex-m4", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"),
}


@pytest.mark.parametrize(
    ("compiler", "level"), [("gcc", "-O0"), ("clang", "-O3"), ("Cortex-M4F", "-O2"), ("Cortex-M0", "-Os")]
)
def test_a_program_links_with_four_functions_of_a_c_library(compiler: str, level: str, tmp_path: Path) -> None:
    """With every option, and all of the runtime kept: memcpy, memset, memmove and memcmp are all that it may need."""
    command = [*COMPILERS[compiler], level, "-ffreestanding", *RIGHT, "-DGTC_WITH_BANK=1"]
    if compiler != "clang":
        command += ["-fno-tree-loop-distribute-patterns"]
    for numeric, number in NUMBERS.items():
        (tmp_path / f"alone_{numeric}.c").write_text(ALONE.format(n=numeric, number=number))
    alone = [f"alone_{numeric}.c" for numeric in NUMBERS]
    subprocess.run([*command, "-c", *alone, *SOURCES, MINIMAL / "gtc_rlg_0042.c"], cwd=tmp_path, check=True)
    for numeric in NUMBERS:
        objects = [f"alone_{numeric}.o", "gtc_f32.o", "gtc_q31.o", "gtc_rlg_0042.o"]
        link = [*COMPILERS[compiler], "-nostdlib", "-static", *objects, "-lgcc", "-o", "alone"]
        done = subprocess.run(link, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[:2000]


MAIN = """
#include "{table}.h"

int main(void)
{{
    gtc_q31_state_t state;
    const int_least32_t channels[3] = {{0, 0, 0}};

    return (gtc_q31_init(&state, &{table}_q31, 2500000UL) == 0)
        && (gtc_q31_sample(&state, &{table}_q31, 2500000UL, channels) >= 0) ? 0 : 1;
}}
"""


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """libgtc.a, one object for each file, as the package makes it."""
    folder = tmp_path_factory.mktemp("library")
    flags = ["-std=c99", "-O2", "-ffp-contract=off", "-ffunction-sections", "-fdata-sections"]
    sources = sorted(str(p) for p in (ROOT / "libc").glob("*.c"))
    subprocess.run(["gcc", *flags, f"-I{ROOT / 'include'}", "-c", *sources], cwd=folder, check=True)
    subprocess.run(["ar", "rcs", "libgtc.a", *(p.name for p in folder.glob("*.o"))], cwd=folder, check=True)
    return folder / "libgtc.a"


def _symbols(library: Path, work: Path, table: str, c: Path) -> set[str]:
    """Names of the runtime in a program that runs one table in fixed point."""
    (work / "main.c").write_text(MAIN.format(table=table))
    command = ["gcc", "-std=c99", "-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections"]
    include = [f"-I{ROOT / 'include'}", f"-I{c}"]
    files = ["main.c", str(c / f"{table}.c"), str(library)]
    subprocess.run([*command, *include, *files, "-o", "program"], cwd=work, check=True)
    subprocess.run([str(work / "program")], check=True)
    names = subprocess.run(["nm", "program"], cwd=work, check=True, capture_output=True, text=True).stdout
    return set(re.findall(r"\bgtc_\w+", names))


def test_a_plain_table_links_the_front_end_and_the_map(library: Path, tmp_path: Path) -> None:
    found = _symbols(library, tmp_path, "gtc_rlg_0042", ROOT / "examples" / "minimal")
    assert not [s for s in found if s.startswith("gtc_f32_")], "the other arithmetic"
    assert {s for s in found if s.startswith("gtc_q31_")} == {"gtc_q31_init", "gtc_q31_sample"}


C_FLAGS = ("-std=c99", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion", "-Werror")


@pytest.mark.parametrize("name", ["host-gcc-O2", "cortex-m4f"])
def test_the_snippet_of_the_readme_compiles_links_and_corrects(name: str, tmp_path: Path) -> None:
    target = all_targets()[name]
    require(target.missing())
    snippet = re.findall(r"```c [^\n]*\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    model = random_model(1, serial="SIM-0001")
    emit(model, tmp_path)
    middle = sum(model.envelope.temperature_c) / 2.0
    held = round(model.agree_s * 100.0)  # samples of 10 ms
    main = (
        "int correction_start(void);\nint correct(float temperature_c, float *rate_dph);\n"
        f"{snippet[0]}\nint main(void)\n{{\n    float rate = 1.0F;\n    int k, held = 0;\n"
        "    const int started = (correction_start() == 0);\n"
        f"    for (k = 0; k < {held}; k++) {{\n        held += (correct({middle:.3f}F, &rate) == GTC_HELD);\n    }}\n"
        f"    if (!started || (held != {held}) || (rate != 1.0F) || (correct({middle:.3f}F, &rate) != GTC_WARMING)"
        " || (rate == 1.0F)) {\n        return 1; /* accepted once readings agree for the guard's time */\n    }\n"
        "    /* a wild reading is stated with the sample that brought it, though the correction in force is sound */\n"
        "    return (correct(150.0F, &rate) == (GTC_WARMING | GTC_HELD)) ? 0 : 2;\n}\n"
    )
    (tmp_path / "c" / "user.c").write_text(main)
    warned = target.model_copy(update={"flags": (*target.flags, *C_FLAGS, "-Wmissing-declarations")})
    c = tmp_path / "c"
    compile_c(warned, [c / name for name in ("user.c", "gtc_f32.c", "gtc_sim_0001.c")], c / "user", include=c)
    assert run_program(target, c / "user").returncode == 0


def test_the_header_begins_with_the_manual() -> None:
    text = (ROOT / "include" / "gtc.h").read_text()
    lines = text.splitlines()
    assert lines[0].startswith("/* gtc.h - ")
    assert (
        lines.index(
            "/* A table, and a state of the caller, whose members are private: the structs are below the functions. */"
        )
        < 110
    )
    for numeric in NUMERICS:
        assert len(set(re.findall(rf"^GTC_MUST_CHECK int (gtc_{numeric}_\w+)\(", text, re.MULTILINE))) == 11


def test_macros_of_an_emitted_header_are_those_of_the_model(tmp_path: Path) -> None:
    terms = tuple(
        Term(id="auxiliary", parameters={"slope_dph_per_unit": 1e-3, "reference": 5.0}, channel=name)
        for name in ("supply_v", "magnetic_ut")
    )
    model = random_model(2, serial="SIM-0002", terms=terms)
    emission = emit(model, tmp_path)
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    claims = [
        "GTC_SIM_0002_BLOCK_US == 10000000UL",
        *(
            f"fabs((double)GTC_SIM_0002_{name} - {value!r}) < 1e-5"
            for name, value in (
                ("T_MIN_C", t0), ("T_MAX_C", t1), ("SLOPE_MIN_C_PER_MIN", r0), ("SLOPE_MAX_C_PER_MIN", r1),
            )
        ),
        "GTC_SIM_0002_N_CHANNELS == 3",
        'strcmp(GTC_SIM_0002_CHANNEL_0, "temperature_c") == 0',
        'strcmp(GTC_SIM_0002_CHANNEL_1, "magnetic_ut") == 0',
        'strcmp(GTC_SIM_0002_CHANNEL_2, "supply_v") == 0',
        f"GTC_SIM_0002_Q31_BIAS_FRAC_BITS == {emission.tables['q31'].bias_frac_bits}",
    ]  # fmt: skip
    checks = "".join(f"    if (!({claim})) {{\n        return {k + 1};\n    }}\n" for k, claim in enumerate(claims))
    includes = '#include <math.h>\n#include <string.h>\n#include "gtc_sim_0002.h"\n'
    text = f"{includes}int main(void)\n{{\n{checks}    return 0;\n}}\n"
    (tmp_path / "c" / "user.c").write_text(text)
    subprocess.run(["gcc", "-std=c99", "user.c", "-o", "user"], cwd=tmp_path / "c", check=True)
    done = subprocess.run([tmp_path / "c" / "user"], check=False)
    assert done.returncode == 0, claims[done.returncode - 1]


@pytest.mark.parametrize("numeric", ["f32", "q31"])
def test_read_only_bytes_of_the_header_are_those_of_a_compiled_table(numeric: str, tmp_path: Path) -> None:
    target = all_targets()["cortex-m4f"]
    require(target.missing())
    model = random_model(3, serial="SIM-0003")
    emit(model, tmp_path, numerics=[numeric])
    c = tmp_path / "c"
    (table,) = compile_objects(target, [c / "gtc_sim_0003.c"], tmp_path, include=c)
    sections = subprocess.run(["arm-none-eabi-size", "-A", table], capture_output=True, text=True, check=True)
    found = sum(int(n) for n in re.findall(r"^\.rodata\S*\s+(\d+)", sections.stdout, re.MULTILINE))
    stated = re.search(rf"{numeric.upper()}_TABLE_BYTES (\d+)UL", (c / "gtc_sim_0003.h").read_text())
    assert stated is not None and int(stated[1]) == found


CPLUSPLUS = """
#include "gtc.hpp"
#include "gtc_rlg_0042.h"

template struct gtc::Runtime<gtc::F32>; // every member, used here or not
template struct gtc::Runtime<gtc::Q31>;

int main()
{
    gtc::q31::Correction fixed;
    gtc::f32::Correction correction;
    gtc::f32::Increments increments;
    gtc::f32::DegPerHour bias(0.0F);
    float map = 0.0F;
    gtc::f32::Angle angle(0.0F);
    gtc_word_t words[GTC_SAVE_WORDS];
    const bool started = gtc::f32::check(gtc_rlg_0042_f32).is_ok()
        && fixed.init(gtc_rlg_0042_q31, 1000000UL).is_ok()
        && !fixed.sample(1000000UL, gtc::q31::Celsius(20L * 65536L)).failed()
        && correction.init(gtc_rlg_0042_f32, 1000000UL).is_ok()
        && correction.sample(1000000UL, gtc::f32::Celsius(20.0F)).has(GTC_HELD)
        && correction.sample(1000000UL, gtc::f32::Celsius(20.0F)).has(GTC_HELD); // two are not accepted
    const bool went = correction.sample(1000000UL, gtc::f32::Celsius(20.0F)).has(GTC_WARMING)
        && correction.bias(bias).has(GTC_WARMING)
        && (gtc_f32_map(&gtc_rlg_0042_f32, 20.0F, 0.0F, &map) >= 0)
        && increments.angle(bias, gtc::f32::Time(1.0F), angle).is_ok() && correction.save(words).is_ok()
        && correction.restore(gtc_rlg_0042_f32, 1000000UL, words, 0U).is_ok();
    gtc_f32_table_t other = gtc_rlg_0042_f32;
    other.crc ^= 1U;
    const bool kept = (correction.init(other, 1U).code() == GTC_E_PERIOD) // which leaves table and state as they were
        && (correction.restore(other, 1000000UL, words, 0U).code() == GTC_E_ID)
        && correction.bias(bias).has(GTC_WARMING);
    return (started && went && kept && (bias.value() == map) WRONG) ? 0 : 1;
}
"""


def test_the_cplusplus_header_has_every_call_of_c() -> None:
    header = (ROOT / "include" / "gtc.h").read_text("ascii")
    own = (ROOT / "include" / "gtc.hpp").read_text("ascii")
    declared = set(re.findall(r"^GTC_MUST_CHECK int (gtc_(?:f32|q31)_\w+)\(", header, re.MULTILINE))
    assert len(declared) >= 22 and declared <= set(re.findall(r"= &(gtc_(?:f32|q31)_\w+);", own))


#: Each swaps units, and must not compile.
SWAPPED = (
    "&& correction.sample(1000000UL, 20.0F).failed()",
    "&& correction.sample(1000000UL, gtc::f32::DegPerHour(1.0F)).failed()",
    "&& correction.bias(angle).failed()",
    "&& increments.angle(gtc::f32::Time(1.0F), bias, angle).failed()",
    "&& correction.sample(1000000UL, gtc::q31::Celsius(1)).failed()",
)


def _cplusplus(work: Path, compiler: str, wrong: str) -> int:
    include = [f"-I{ROOT / 'include'}", f"-I{MINIMAL}"]
    (work / "user.cpp").write_text(CPLUSPLUS.replace("WRONG", wrong))
    flags = ["-std=c++11", "-Wall", "-Wextra", "-pedantic", "-Wconversion", "-Werror", "-fno-exceptions"]
    done = subprocess.run([compiler, *flags, *include, "-c", "user.cpp"], cwd=work, capture_output=True, check=False)
    return done.returncode


@pytest.mark.parametrize("compiler", ["g++", "clang++"])
def test_the_cplusplus_face_gives_what_c_gives_and_refuses_swapped_units(compiler: str, tmp_path: Path) -> None:
    for wrong in SWAPPED:
        assert _cplusplus(tmp_path, compiler, wrong) != 0, wrong
    assert _cplusplus(tmp_path, compiler, "") == 0
    flags = [*C_FLAGS[:2], f"-I{ROOT / 'include'}", f"-I{ROOT / 'libc'}"]
    files = [*SOURCES, str(MINIMAL / "gtc_rlg_0042.c")]
    subprocess.run(["gcc", *flags, "-c", *files], cwd=tmp_path, check=True)
    subprocess.run([compiler, *(p.name for p in tmp_path.glob("*.o")), "-o", "user"], cwd=tmp_path, check=True)
    subprocess.run([tmp_path / "user"], check=True)


@pytest.mark.parametrize(("numeric", "part"), [("f32", "uncertainty"), ("q31", "saved_state"), ("f32", "image")])
def test_the_cplusplus_face_is_of_any_emitted_header(numeric: str, part: RuntimePart, tmp_path: Path) -> None:
    """Every member, over a runtime of one arithmetic that lacks a part."""
    emit(random_model(3).model_copy(update={"left_out": (part,)}), tmp_path, numerics=[numeric])
    user = tmp_path / "user.cpp"
    user.write_text(f'#include "gtc.hpp"\ntemplate struct gtc::Runtime<gtc::{numeric.upper()}>;\n', "ascii")
    include = [f"-I{tmp_path / 'c'}", f"-idirafter{ROOT / 'include'}"]
    subprocess.run(
        ["g++", "-std=c++11", "-Wall", "-Wextra", "-Werror", "-Wundef", *include, "-fsyntax-only", user], check=True
    )


@pytest.mark.parametrize("file", ["gtc.h", "gtc_table.h", "gtc_private_state.h"])
def test_the_structs_of_both_arithmetics_have_the_same_members(file: str) -> None:
    """They are written twice, with the types of each, and must not drift apart."""
    code = re.sub(r"/\*.*?\*/", "", (ROOT / "include" / file).read_text("ascii"), flags=re.DOTALL)
    members: dict[str, dict[str, list[str]]] = {"f32": {}, "q31": {}}
    for tag, body, name in re.findall(r"^(?:typedef )?struct (\w*) ?\{\n(.*?)^\}(?: (\w+))?;", code, re.DOTALL | re.M):
        _, numeric, kind = (tag or name.removesuffix("_t")).split("_", 2)
        lines = (line.strip() for line in body.splitlines())
        members[numeric][kind] = [
            line if line.startswith("#") else re.sub(r"^.*?(\w+)(?:\[.*\])?;$", r"\1", line) for line in lines if line
        ]
    assert members["f32"] == members["q31"] and members["f32"]


def test_the_rule_of_the_header_is_free_of_races_and_a_breach_is_seen(tmp_path: Path) -> None:
    include = [f"-I{ROOT / 'include'}", f"-I{ROOT / 'libc'}", f"-I{MINIMAL}"]
    flags = ["-std=gnu99", "-O1", "-g", "-ffp-contract=off", "-fsanitize=thread", "-pthread"]
    files = [*SOURCES, MINIMAL / "gtc_rlg_0042.c"]
    subprocess.run(["clang", *flags, *include, "-c", *files], cwd=tmp_path, check=True)
    command = ["clang", *flags, *include, ROOT / "tests" / "support" / "threads.c", *tmp_path.glob("*.o")]
    for broken in (False, True):
        extra = ["-DBREAK_THE_RULE"] if broken else []
        subprocess.run([*command, *extra, "-o", "threads"], cwd=tmp_path, check=True)
        # Without randomised addresses, which older sanitizers do not find their way in.
        done = subprocess.run(["setarch", "-R", "./threads"], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert "FATAL" not in done.stderr, done.stderr[:500]
        assert ("data race" in done.stderr) == broken, done.stderr[:2000]
        assert broken or done.returncode == 0


SMALLEST = ("-UGTC_WITH_BANK", "-DGTC_MAX_TERMS=0")


def _images(model: Model) -> dict[str, tuple[Table, Words]]:
    """Tables by arithmetic, each with the image that emit writes of it."""
    emission = quantise_all(model, None)
    texts = emit_texts(model, emission)
    names = [f"gtc_{model.id}{suffix}.bin" for suffix in ("", *(f"_{n}" for n in list(emission.tables)[1:]))]
    images = (np.frombuffer(texts[name], dtype="<u4").astype(np.uint32) for name in names)
    return {n: (t, w) for (n, t), w in zip(emission.tables.items(), images, strict=True)}


@pytest.fixture(scope="module")
def build() -> Runtime:
    return runtime("gcc", ("-O2",))


@pytest.mark.parametrize("seed", range(12))
def test_an_emitted_image_opens_to_the_bits_of_the_compiled_table(build: Runtime, seed: int) -> None:
    model = variant(seed)
    for numeric, (table, words) in _images(model).items():
        device = Device(build, table)
        status, opened = device.open(words)
        assert status == 0, numeric
        assert opened.crc == table.crc and opened.calibrated == table.calibrated
        assert device.function("check")(ctypes.byref(opened)) == 0
        channels, missed = history(model, table, seed, 400, 7)
        compiled, image = device.state(), device.state()
        device.init(compiled, 7)
        expected = device.steps(compiled, channels, missed)
        device.struct = opened
        device.init(image, 7)
        for a, b in zip(expected, device.steps(image, channels, missed), strict=True):
            np.testing.assert_array_equal(a, b, err_msg=numeric)


@pytest.mark.parametrize("serial", ["RLG-0042", "S" * 64])
def test_an_opened_image_has_the_serial_and_the_date_of_its_model(build: Runtime, serial: str) -> None:
    """It had none: a firmware could not say whose correction it had."""
    model = random_model(3, serial=serial, meta={"calibrated_on": "2026-11-21"})
    for table, words in _images(model).values():
        status, opened = Device(build, table).open(words)
        text = ctypes.string_at(opened.serial, 4 * SERIAL_WORDS)
        assert status == 0 and text.rstrip(b"\0").decode("ascii") == serial
        assert opened.calibrated == 20261121


@pytest.mark.parametrize("seed", [1, 2])
def test_what_was_not_compiled_in_is_refused(seed: int) -> None:
    for table, words in _images(variant(seed)).values():
        device = Device(runtime("gcc", ("-O2", *SMALLEST)), table)
        assert device.open(words)[0] == E_LAYOUT


@pytest.mark.parametrize("numeric", NUMERICS)
def test_every_flipped_bit_of_an_emitted_image_is_refused(
    build: Runtime, numeric: str, model_dict: dict[str, Any]
) -> None:
    table, words = _images(Model.from_dict(model_dict))[numeric]
    device = Device(build, table)
    spoiled = words.copy()
    for i in range(32 * len(words)):
        spoiled[i // 32] ^= np.uint32(1 << i % 32)
        assert device.open(spoiled)[0] == E_IMAGE, f"bit {i % 32} of word {i // 32}"
        spoiled[i // 32] = words[i // 32]
    for n in range(len(words)):
        assert device.open(words[:n].copy())[0] == E_IMAGE, f"{n} words"
    assert device.open(words.byteswap())[0] == E_IMAGE
    assert device.open(words, expected_id=table.id ^ 1)[0] == E_ID
    assert device.open(words)[0] == 0


def test_an_image_of_the_other_arithmetic_is_refused(build: Runtime, model_dict: dict[str, Any]) -> None:
    images = _images(Model.from_dict(model_dict))
    (f32, f32_words), (q31, q31_words) = images["f32"], images["q31"]
    assert Device(build, f32).open(q31_words)[0] == E_LAYOUT
    assert Device(build, q31).open(f32_words)[0] == E_LAYOUT


def test_damaged_images_never_open(build: Runtime) -> None:
    """Several words at once: exchanged, overwritten, parts of another image."""
    seed = int(np.random.default_rng().integers(2**31))
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    for numeric, (table, words) in _images(random_model(seed)).items():
        device = Device(build, table)
        other = _images(random_model(seed, fallback_dph=0.5))[numeric][1]
        for _ in range(2000):
            spoiled = words.copy()
            at, n = int(rng.integers(0, len(words))), int(rng.integers(1, 9))
            kind = rng.integers(0, 3)
            if kind == 0:
                spoiled[at : at + n] = rng.integers(0, 2**32, len(spoiled[at : at + n]), dtype=np.uint32)
            elif kind == 1:
                spoiled[at : at + n] = rng.choice([0, 0xFFFFFFFF])
            else:
                spoiled[at:] = other[at:]
            if (spoiled != words).any() and (spoiled != other).any():
                assert device.open(spoiled)[0] == E_IMAGE, (numeric, at, n, kind)
