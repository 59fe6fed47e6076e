"""A program links of the runtime what it uses: no term, bank or opening of images that its table does not name."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
MAIN = """
#include "{table}.h"

int main(void)
{{
    gtc_q31_state_t state;
    const int_least32_t channels[3] = {{0, 0, 0}};

    return (gtc_q31_init(&state, &{table}_q31, 2500000UL) == 0) && (gtc_q31_sample(&state, channels) >= 0) ? 0 : 1;
}}
"""
ALL = {"memory", "play", "warm_up", "harmonic", "auxiliary", "curve", "product"}


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


def _terms(symbols: set[str]) -> set[str]:
    return {m[1] for s in symbols if (m := re.fullmatch(r"gtc_q31_term_(\w+)_20blocks_4terms", s))}


def test_a_plain_table_links_the_front_end_and_the_map(library: Path, tmp_path: Path) -> None:
    found = _symbols(library, tmp_path, "gtc_rlg_0042", ROOT / "examples" / "minimal")
    assert _terms(found) == set()
    assert not [s for s in found if s.startswith("gtc_f32_")], "the other arithmetic"
    for name in ("blend", "open", "save", "restore", "check", "angle", "missed"):
        assert not [s for s in found if s.startswith(f"gtc_q31_{name}")]
    assert "gtc_q31_map_20blocks_4terms" in found


@pytest.mark.parametrize(
    ("table", "terms"),
    [("gtc_test_t", {"memory", "play", "warm_up", "auxiliary"}), ("gtc_test_h", {"memory", "harmonic"})],
)
def test_a_table_links_the_terms_that_it_names(
    library: Path, tmp_path: Path, table: str, terms: set[str]
) -> None:
    found = _terms(_symbols(library, tmp_path, table, ROOT / "tests" / "c" / "table"))
    assert found == terms and found < ALL
