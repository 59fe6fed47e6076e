"""The runtime as a linker sees it: no C library, one set of options, the functions under their names."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from conftest import quick_and_slow
from gyrotc.common.runtime import runtime_folders
from gyrotc.tables.amalgamate import amalgamate
from gyrotc.verify.sizes import PUBLIC

ROOT = Path(__file__).resolve().parents[3]
MINIMAL = ROOT / "examples" / "minimal"
RIGHT = ("-std=c99", "-ffp-contract=off", f"-I{ROOT / 'include'}", f"-I{ROOT / 'libc'}", f"-I{MINIMAL}")
SOURCES = [str(ROOT / "libc" / f"gtc_{name}.c") for name in ("crc", "f32", "q31")]
#: Every public function, in a program without start-up code; `_start` is never run here.
ALONE = """
#include "gtc_rlg_0042.h"

static gtc_{n}_state_t state;
static gtc_{n}_table_t opened;
static gtc_{n}_angle_t sum;
static gtc_word_t words[GTC_SAVE_WORDS];
static gtc_{n}_snapshot_t snapshot;

void _start(void);
void _start(void)
{{
    static {number} x[1];
    volatile int done = gtc_{n}_check(&gtc_rlg_0042_{n}) + gtc_{n}_open(&opened, words, 9U, 1U)
                        + gtc_{n}_map(&opened, x[0], x[0], x) + gtc_{n}_init(&state, &opened, 1000000UL)
                        + gtc_{n}_sample(&state, x) + gtc_{n}_missed(&state, 9U) + gtc_{n}_bias(&state, x)
                        + gtc_{n}_sample_at(&state, 9U, x) + gtc_{n}_snapshot(&state, &snapshot)
                        + gtc_{n}_rezero(&state, x[0], 9U) + gtc_{n}_unzero(&state)
                        + gtc_{n}_angle(&sum, x[0], x[0], x) + gtc_{n}_save(&state, words)
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
    ("compiler", "level"),
    quick_and_slow(
        [("gcc", "-O0"), ("Cortex-M4F", "-O2")],
        [
            (compiler, level)
            for compiler in COMPILERS
            for level in ("-O0", "-O2", "-Os", "-O3")
            if (compiler, level) not in {("gcc", "-O0"), ("Cortex-M4F", "-O2")}
        ],
    ),
)
def test_a_program_links_without_a_c_library(compiler: str, level: str, tmp_path: Path) -> None:
    """With every option, and all of the runtime kept."""
    options = ("-DGTC_WITH_BANK=1", "-DGTC_OPEN_TERMS=1")
    for numeric, number in NUMBERS.items():
        (tmp_path / "alone.c").write_text(ALONE.format(n=numeric, number=number))
        files = ["alone.c", str(MINIMAL / "gtc_rlg_0042.c"), *SOURCES]
        command = [*COMPILERS[compiler], level, *RIGHT, *options, *files, "-nostdlib", "-static", "-lgcc"]
        done = subprocess.run(
            [*command, "-o", "alone"], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr[:2000]


@pytest.mark.parametrize("option", ["-DGTC_MAX_TERMS=1", "-DGTC_MAX_SLOPE_BLOCKS=32"])
@pytest.mark.parametrize("unit", ["the program", "a table with terms", "the runtime"])
def test_units_with_different_options_do_not_link_and_the_linker_says_which(
    unit: str, option: str, tmp_path: Path
) -> None:
    table = ROOT / "tests" / "c" / "table" / "gtc_test_t.c"
    (tmp_path / "main.c").write_text(
        '#include "gtc_test_t.h"\nint main(void)\n{\n    static gtc_f32_state_t state;\n'
        "    return gtc_f32_init(&state, &gtc_test_t_f32, 1000000UL) >= 0 ? 0 : 1;\n}\n"
    )
    if unit == "a table with terms" and "TERMS" in option:
        option = "-DGTC_MAX_TERMS=8"
    units = {"the program": ["main.c"], "a table with terms": [str(table)], "the runtime": SOURCES}
    for name, sources in units.items():
        extra = [option] if name == unit else []
        command = ["gcc", *RIGHT, f"-I{table.parent}", *extra, "-c", *sources]
        subprocess.run(command, cwd=tmp_path, check=True)
    objects = [p.name for p in sorted(tmp_path.glob("*.o"))]
    done = subprocess.run(["gcc", *objects], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert re.search(r"undefined reference to .gtc_f32_\w+_[0-9]+blocks_[0-9]+terms", done.stderr), (
        done.stderr
    )


@pytest.mark.parametrize("numeric", NUMBERS)
def test_every_public_function_is_found_by_its_name(numeric: str) -> None:
    """In the sources and in what is emitted: a definition at the start of a line."""
    for text in (Path(SOURCES[1 if numeric == "f32" else 2]).read_text(), amalgamate(*runtime_folders())[1]):
        for name in PUBLIC:
            assert len(re.findall(rf"^int gtc_{numeric}_{name}\(", text, re.MULTILINE)) == 1, name


@pytest.mark.parametrize("numeric", NUMBERS)
def test_an_emitted_runtime_holds_the_arithmetics_asked_for_alone(numeric: str, tmp_path: Path) -> None:
    header, source = amalgamate(*runtime_folders(), numerics=(numeric,))
    other = "q31" if numeric == "f32" else "f32"
    assert f"gtc_{other}.c" not in source and source.count("static const FN(range_t) FN(number_limits)") == 1
    (tmp_path / "gtc.h").write_text(header)
    (tmp_path / "gtc.c").write_text(source)
    subprocess.run(
        ["gcc", *RIGHT[:2], "-Wall", "-Wextra", "-Werror", "-c", "gtc.c"], cwd=tmp_path, check=True
    )
    names = subprocess.run(["nm", "gtc.o"], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert f"gtc_{other}_" not in names and f"gtc_{numeric}_map_20blocks_4terms" in names


def test_the_runtime_is_about_a_dozen_files() -> None:
    assert len([p for p in (ROOT / "libc").iterdir() if p.suffix in {".c", ".h", ".inl"}]) <= 16
