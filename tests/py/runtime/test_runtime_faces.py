"""What users write against the headers: README's snippet, macros, C++, and who calls what from which thread."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from gyrotc.model import Term
from gyrotc.tables.emit import emit
from gyrotc.verify.toolchain import all_targets, compile_objects
from models import random_model

ROOT = Path(__file__).resolve().parents[3]
MINIMAL = ROOT / "examples" / "minimal"
SOURCES = [str(ROOT / "libc" / f"gtc_{name}.c") for name in ("crc", "f32", "q31")]
C_FLAGS = ("-std=c99", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion", "-Werror")


def test_the_snippet_of_the_readme_compiles_links_and_corrects(tmp_path: Path) -> None:
    snippet = re.findall(r"```c\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    model = random_model(1, serial="SIM-0001")
    emit(model, tmp_path)
    middle = sum(model.envelope.temperature_c) / 2.0
    held = round(model.agree_s * 100.0)  # samples of 10 ms
    main = (
        "int correction_start(void);\nint correct(float temperature_c, float *rate_dph);\n"
        f"{snippet[0]}\nint main(void)\n{{\n    float rate = 1.0F;\n    int k, held = 0;\n"
        "    const int started = (correction_start() == 0);\n"
        f"    for (k = 0; k < {held}; k++) {{\n        held += (correct({middle:.3f}F, &rate) == GTC_HELD);\n    }}\n"
        f"    return started && (held == {held}) && (rate == 1.0F) && (correct({middle:.3f}F, &rate) == GTC_WARMING)"
        " && (rate != 1.0F) ? 0 : 1; /* believed once readings agree for the guard's time */\n}\n"
    )
    (tmp_path / "c" / "user.c").write_text(main)
    command = ["gcc", *C_FLAGS, "-Wmissing-declarations", "user.c", "gtc.c", "gtc_sim_0001.c", "-o", "user"]
    subprocess.run(command, cwd=tmp_path / "c", check=True)
    subprocess.run([tmp_path / "c" / "user"], check=True)


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
    checks = "".join(
        f"    if (!({claim})) {{\n        return {k + 1};\n    }}\n" for k, claim in enumerate(claims)
    )
    includes = '#include <math.h>\n#include <string.h>\n#include "gtc_sim_0002.h"\n'
    text = f"{includes}int main(void)\n{{\n{checks}    return 0;\n}}\n"
    (tmp_path / "c" / "user.c").write_text(text)
    subprocess.run(["gcc", "-std=c99", "user.c", "-o", "user"], cwd=tmp_path / "c", check=True)
    done = subprocess.run([tmp_path / "c" / "user"], check=False)
    assert done.returncode == 0, claims[done.returncode - 1]


@pytest.mark.parametrize("numeric", ["f32", "q31"])
def test_read_only_bytes_of_the_header_are_those_of_a_compiled_table(numeric: str, tmp_path: Path) -> None:
    target = all_targets()["cortex-m4f"]
    if target.missing():
        pytest.skip(f"{target.missing()} is not installed")
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

int main()
{
    gtc::q31::Correction fixed;
    gtc::f32::Correction correction;
    gtc::f32::Increments increments;
    gtc::f32::DegPerHour bias(0.0F), map(0.0F);
    gtc::f32::Angle angle(0.0F);
    gtc_word_t words[GTC_SAVE_WORDS];
    const bool started = gtc::f32::check(gtc_rlg_0042_f32).is_ok()
        && fixed.init(gtc_rlg_0042_q31, 1000000UL).is_ok() && !fixed.sample(gtc::q31::Celsius(20L * 65536L)).failed()
        && correction.init(gtc_rlg_0042_f32, 1000000UL).is_ok()
        && correction.sample(gtc::f32::Celsius(20.0F)).has(GTC_HELD); // one alone is not believed
    const bool went = correction.sample(gtc::f32::Celsius(20.0F)).has(GTC_WARMING)
        && correction.bias(bias).has(GTC_WARMING)
        && !gtc::f32::map(gtc_rlg_0042_f32, gtc::f32::Celsius(20.0F), gtc::f32::CelsiusPerBlock(0.0F), map).failed()
        && increments.angle(bias, gtc::f32::Time(1.0F), angle).is_ok() && correction.save(words).is_ok()
        && correction.restore(gtc_rlg_0042_f32, 1000000UL, words, 0U).is_ok();
    return (started && went && (bias.value() == map.value()) WRONG) ? 0 : 1;
}
"""
#: Each swaps units, and must not compile.
SWAPPED = (
    "&& correction.sample(20.0F).failed()",
    "&& correction.sample(gtc::f32::DegPerHour(1.0F)).failed()",
    "&& correction.bias(angle).failed()",
    "&& increments.angle(gtc::f32::Time(1.0F), bias, angle).failed()",
    "&& correction.sample(gtc::q31::Celsius(1)).failed()",
)


def _cplusplus(work: Path, compiler: str, wrong: str) -> int:
    include = [f"-I{ROOT / 'include'}", f"-I{MINIMAL}"]
    (work / "user.cpp").write_text(CPLUSPLUS.replace("WRONG", wrong))
    flags = ["-std=c++11", "-Wall", "-Wextra", "-pedantic", "-Wconversion", "-Werror", "-fno-exceptions"]
    done = subprocess.run(
        [compiler, *flags, *include, "-c", "user.cpp"], cwd=work, capture_output=True, check=False
    )
    return done.returncode


@pytest.mark.parametrize("compiler", ["g++", "clang++"])
def test_the_cplusplus_face_gives_what_c_gives_and_refuses_swapped_units(
    compiler: str, tmp_path: Path
) -> None:
    for wrong in SWAPPED:
        assert _cplusplus(tmp_path, compiler, wrong) != 0, wrong
    assert _cplusplus(tmp_path, compiler, "") == 0
    flags = [*C_FLAGS[:2], f"-I{ROOT / 'include'}", f"-I{ROOT / 'libc'}"]
    files = [*SOURCES, str(MINIMAL / "gtc_rlg_0042.c")]
    subprocess.run(["gcc", *flags, "-c", *files], cwd=tmp_path, check=True)
    subprocess.run(
        [compiler, *(p.name for p in tmp_path.glob("*.o")), "-o", "user"], cwd=tmp_path, check=True
    )
    subprocess.run([tmp_path / "user"], check=True)


@pytest.mark.parametrize("broken", [False, True])
@pytest.mark.slow
def test_the_rule_of_the_header_is_free_of_races_and_a_breach_is_seen(broken: bool, tmp_path: Path) -> None:
    include = [f"-I{ROOT / 'include'}", f"-I{ROOT / 'libc'}", f"-I{MINIMAL}"]
    files = [str(ROOT / "tests" / "py" / "threads.c"), *SOURCES, str(MINIMAL / "gtc_rlg_0042.c")]
    flags = ["-std=gnu99", "-O1", "-g", "-ffp-contract=off", "-fsanitize=thread", "-pthread"]
    extra = ["-DBREAK_THE_RULE"] if broken else []
    subprocess.run(["clang", *flags, *extra, *include, *files, "-o", "threads"], cwd=tmp_path, check=True)
    # Without randomised addresses, which older sanitizers do not find their way in.
    done = subprocess.run(
        ["setarch", "-R", "./threads"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert "FATAL" not in done.stderr, done.stderr[:500]
    assert ("data race" in done.stderr) == broken, done.stderr[:2000]
    assert broken or done.returncode == 0
