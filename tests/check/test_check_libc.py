"""Checks of `make check` on the C runtime: each sees a breach that is put there."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from emitted import spoil

ROOT = Path(__file__).resolve().parents[2]
TOOL = ROOT / "tools" / "check_libc"
sys.path.insert(0, str(TOOL))

import analysers  # noqa: E402
import objects  # noqa: E402
import words  # noqa: E402

CRC = "libc/gtc_crc.inl"


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A copy of the runtime that a test may spoil."""
    for folder in ("include", "libc", "examples/minimal"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    return tmp_path


@pytest.fixture
def one_file(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tools that are slow look at one text, in a file that a compiler takes."""
    alone = tree / "libc" / "gtc_alone.c"
    call = "uint_least32_t gtc_alone(const gtc_word_t *words)\n{\n    return crc_words(CRC_START, words, 2U);\n}\n"
    alone.write_text(f'#include "gtc_private.h"\n#include "gtc_crc.inl"\n\n{call}', encoding="ascii")
    for module in (objects, analysers):
        monkeypatch.setattr(module, "sources", lambda root: [root / "libc" / "gtc_alone.c"])


def _append(path: Path, text: str) -> None:
    path.write_text(path.read_text(encoding="ascii") + text, encoding="ascii")


def test_a_breach_is_exit_status_1_and_an_unknown_check_2(tree: Path) -> None:
    line = len((tree / CRC).read_text(encoding="ascii").splitlines()) + 1
    _append(tree / CRC, "typedef double wide_t;\n")
    done = subprocess.run(
        [sys.executable, str(TOOL), "words", "--root", str(tree)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1 and f"{CRC}:{line}: 'double' is double" in done.stdout
    assert subprocess.run([sys.executable, str(TOOL), "word"], capture_output=True, check=False).returncode == 2


@pytest.mark.parametrize(
    "text",
    [
        "typedef uint8_t octet_t;",
        "typedef int16_t half_t;",
        "typedef uint_fast32_t fast_t;",
        "typedef signed char octet_t;",
        "static const char name[2];",
        "#include <math.h>",
        "#include <stdio.h>",
        "void *p = malloc(4);",
        "static int counter = 0;",
        "static int counter;",
        "static const float x = 1.5;",
        "static const float x = 0x1p-3;",
        "static const float x = 1e3 + 1.e3;",
        "static const int_least32_t x = 02;",
        "static const uint_least32_t x = 0017UL;",
        "x = expf(y);",
        "memcpy(a, b, 4);",
    ],
)
@pytest.mark.parametrize("file", [CRC, "include/gtc_config.h", "libc/gtc_front.inl"])
def test_forbidden_words_are_seen(text: str, file: str, tree: Path) -> None:
    _append(tree / file, f"\n{text}\n")
    assert [f for f in words.forbidden_words(tree) if f.startswith(f"{file}:")]


def test_words_in_comments_are_not_code(tree: Path) -> None:
    _append(tree / CRC, "\n/* no double, malloc(),\n * uint8_t or 1.5 */\n")
    assert not list(words.forbidden_words(tree))


def test_a_symbol_from_outside_and_a_foreign_name_are_seen(tree: Path) -> None:
    spoil(tree / CRC, r"    int bit;\n", "    int bit = outside();\n")
    spoil(
        tree / CRC,
        r"(#define CRC_FINAL 0xFFFFFFFFUL\n)",
        r"\1int outside(void);\nvoid helper(void);\nvoid helper(void) {}\n",
    )
    found = list(objects.symbols(tree))
    assert "Cortex-M0: needs outside" in found and "x86-64: public name helper" in found


def test_writable_data_is_seen(tree: Path) -> None:
    spoil(tree / CRC, r"    int bit;\n", "    int bit;\n    static int calls;\n\n    calls++;\n")
    assert [f for f in objects.writable(tree) if "Cortex-M4F: calls" in f]


def test_an_expression_that_could_be_fused_is_seen(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(objects, "FUSING", {"Cortex-M4F": objects.M4F})
    assert not list(objects.fused(tree))
    spoil(
        tree / "libc" / "gtc_num_f32.h",
        r"f = center\[CENTER_WEIGHT\]\.value \* f;\n    f = acc \+ f;",
        "f = acc + (center[CENTER_WEIGHT].value * f);",
    )
    assert "gtc_f32.c: gaussian has a product and a sum in one expression" in list(objects.fused(tree))
    monkeypatch.setattr(objects, "DOCUMENTED", ("-std=gnu99", "-ffp-contract=fast"))
    assert next(f for f in objects.fused(tree) if f.startswith("Cortex-M4F: ") and "vfma" in f)


def test_an_implicit_conversion_is_seen(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(objects, "COMPILERS", {"gcc": objects.HOST})
    monkeypatch.setattr(objects, "OPTIONS", {"default options": ()})
    monkeypatch.setattr(objects, "sources", lambda root: [root / "libc" / "gtc_f32.c"])
    assert not list(objects.warnings(tree))
    spoil(tree / CRC, "int bit;", "short bit;")
    spoil(tree / CRC, r"bit = 0;", "bit = (int)crc;")
    found = list(objects.warnings(tree))
    assert len(found) == 2 and all("conversion" in f for f in found), "in libc/ and in what is emitted"


def test_a_header_that_is_not_cplusplus_is_seen(tree: Path) -> None:
    _append(tree / "include" / "gtc.h", "static int class;\n")
    assert len(list(objects.cplusplus(tree))) == 2


def test_a_breach_of_misra_is_seen_where_it_is_not_permitted(tree: Path, one_file: None) -> None:
    condition = "    if (rest) {\n"
    spoil(tree / CRC, r"    return rest;\n", f"{condition}        rest = 2U;\n    }}\n    return rest;\n")
    line = (tree / CRC).read_text(encoding="ascii").splitlines().index(condition.rstrip()) + 1
    assert f"{CRC}:{line}: MISRA C:2012, rule 14.4" in list(analysers.misra(tree))
    spoil(tree / CRC, r"    if \(rest\)", "    /* MISRA 14.4: to see whether this is read. */\n    if (rest)")
    assert not any("rule 14.4" in f for f in analysers.misra(tree))


def test_a_permission_that_nothing_needs_and_too_many_of_them_are_seen(tree: Path, one_file: None) -> None:
    _append(tree / CRC, "".join(f"\n/* MISRA 1.{k}: no reason. */\n" for k in range(10)))
    found = list(analysers.misra(tree))
    assert f"{CRC}: nothing breaks rule 1.3 where it is permitted" in found
    assert any("rules are deviated from" in f for f in found)


def test_analysers_see_what_is_wrong_with_a_path(tree: Path, one_file: None) -> None:
    spoil(
        tree / CRC,
        r"    int bit;\n",
        "    int bit;\n    const int *nowhere = 0;\n\n    rest ^= (uint_least32_t)*nowhere;\n",
    )
    assert list(analysers.fanalyzer(tree))
    assert any("null" in f.lower() for f in analysers.tidy(tree))
