"""The checks of `make check` on the C runtime: each sees a breach that is put there."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from emitted import spoil
from libc_build import UNGUARDED

ROOT = Path(__file__).resolve().parents[3]
TOOL = ROOT / "tools" / "promises"
sys.path.insert(0, str(TOOL))

import analysers  # noqa: E402
import objects  # noqa: E402
import oldest  # noqa: E402
import origins  # noqa: E402
import source  # noqa: E402

pytestmark = pytest.mark.slow

CRC = "libc/gtc_crc.c"


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """A copy of the runtime that a test may spoil."""
    for folder in ("include", "libc", "examples/minimal"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    shutil.copy(ROOT / ".clang-tidy", tmp_path)
    return tmp_path


@pytest.fixture
def one_file(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tools that are slow look at one file."""
    for module in (objects, analysers):
        monkeypatch.setattr(module, "sources", lambda root: [root / CRC])


def _append(path: Path, text: str) -> None:
    path.write_text(path.read_text(encoding="ascii") + text, encoding="ascii")


def test_cheap_promises_are_kept() -> None:
    names = ["words", "functions", "cplusplus", "symbols", "writable", "origins"]
    done = subprocess.run([sys.executable, str(TOOL), *names], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines() == [f"{name}: kept" for name in names]


def test_a_breach_is_exit_status_1_and_an_unknown_check_2(tree: Path) -> None:
    _append(tree / CRC, "typedef double wide_t;\n")
    done = subprocess.run(
        [sys.executable, str(TOOL), "words", "--root", str(tree)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1 and "libc/gtc_crc.c:30: 'double' is double" in done.stdout
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
        "x = expf(y);",
        "memcpy(a, b, 4);",
    ],
)
@pytest.mark.parametrize("file", [CRC, "include/gtc_config.h", "libc/gtc_front.inl"])
def test_forbidden_words_are_seen(text: str, file: str, tree: Path) -> None:
    _append(tree / file, f"\n{text}\n")
    assert [f for f in source.forbidden_words(tree) if f.startswith(f"{file}:")]


def test_words_in_comments_are_not_code(tree: Path) -> None:
    _append(tree / CRC, "\n/* no double, malloc(),\n * uint8_t or 1.5 */\n")
    assert not list(source.forbidden_words(tree))


@pytest.mark.parametrize(
    ("body", "what"),
    [
        ("    x++;\n" * 39, "42 lines"),
        ("    if ((x > 1) && (x < 9)) {\n        x++;\n    }\n" * 5, "11 ways"),
    ],
)
def test_long_and_branchy_functions_are_seen(body: str, what: str, tree: Path) -> None:
    _append(tree / CRC, f"\nvoid gtc_long(int x)\n{{\n{body}}}\n")
    (found,) = source.long_functions(tree)
    assert "gtc_long" in found and what in found


def test_many_parameters_are_seen(tree: Path) -> None:
    _append(tree / CRC, "\nvoid gtc_many(int a, int b, int c, int d, int e, int f)\n{\n    (void)a;\n}\n")
    (found,) = source.long_functions(tree)
    assert "6 parameters" in found


def test_a_symbol_from_outside_and_a_foreign_name_are_seen(tree: Path) -> None:
    spoil(tree / CRC, r"    int bit;\n", "    int bit = outside();\n")
    spoil(
        tree / CRC,
        r'(#include "gtc_private.h"\n)',
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
    assert "gtc_f32.c: gtc_f32_gaussian has a product and a sum in one expression" in list(objects.fused(tree))
    monkeypatch.setattr(objects, "DOCUMENTED", ("-std=gnu99", "-ffp-contract=fast", *UNGUARDED))
    assert next(f for f in objects.fused(tree) if f.startswith("Cortex-M4F: ") and "vfma" in f)


def test_an_implicit_conversion_is_seen(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(objects, "COMPILERS", {"gcc": objects.HOST})
    monkeypatch.setattr(objects, "OPTIONS", {"default options": ()})
    monkeypatch.setattr(objects, "sources", lambda root: [root / CRC])
    assert not list(objects.warnings(tree))
    spoil(tree / CRC, "int bit;", "short bit;")
    spoil(tree / CRC, r"bit = 0;", "bit = (int)crc;")
    found = list(objects.warnings(tree))
    assert len(found) == 2 and all("conversion" in f for f in found), "in libc/ and in gtc.c"


def test_a_header_that_is_not_cplusplus_is_seen(tree: Path) -> None:
    _append(tree / "include" / "gtc.h", "static int class;\n")
    assert len(list(objects.cplusplus(tree))) == 2


def test_a_breach_of_misra_is_seen_where_it_is_not_permitted(tree: Path, one_file: None) -> None:
    spoil(tree / CRC, r"    int bit;\n", "    int bit = 017;\n")
    found = list(analysers.misra(tree))
    breach = any("gtc_crc.c:10: MISRA C:2012, rule 7.1" in f for f in found)
    version = subprocess.run(["cppcheck", "--version"], capture_output=True, text=True, check=False).stdout.strip()
    if not breach and version != "Cppcheck 2.10":
        pytest.skip(f"{version} does not report rule 7.1 as 2.10 does: {found[:3]}")
    assert breach, found
    spoil(
        tree / CRC,
        r"    int bit = 017;\n",
        "    int bit = 017; /* MISRA 7.1: to see whether this is read. */\n",
    )
    assert not any("rule 7.1" in f for f in analysers.misra(tree))


def test_a_permission_that_nothing_needs_and_too_many_of_them_are_seen(tree: Path, one_file: None) -> None:
    _append(tree / CRC, "".join(f"\n/* MISRA 1.{k}: no reason. */\n" for k in range(10)))
    found = list(analysers.misra(tree))
    assert "libc/gtc_crc.c: nothing breaks rule 1.3 where it is permitted" in found
    assert any("rules are deviated from" in f for f in found)


def test_analysers_see_what_is_wrong_with_a_path(tree: Path, one_file: None) -> None:
    spoil(
        tree / CRC,
        r"    int bit;\n",
        "    int bit;\n    const int *nowhere = 0;\n\n    rest ^= (uint_least32_t)*nowhere;\n",
    )
    assert list(analysers.fanalyzer(tree))
    assert any("null" in f.lower() for f in analysers.tidy(tree))


@pytest.mark.parametrize(
    ("name", "text", "unexplained"),
    [
        ("a.py", "_A = 3\n", 1),
        ("a.py", "_A = 3  # sides of a triangle\n", 0),
        ("a.py", "# Sides of a triangle\n_A = 3\n", 0),
        ("a.py", "# Sides of a triangle\n_A = 3\n_B = 4\n", 1),
        ("a.py", "# Sides of a triangle, by Pythagoras:\n_A = 3\n_B = 4\n", 0),
        ("a.py", '_A = 3\n"""Sides of a triangle."""\n', 0),
        ("a.py", "_A = {'x': 0.5}\n_B, _C = 1, 2\n_D = np.float32(2.0**-9)\n_E = -7.0 * _X\n", 4),
        ("a.py", "def f():\n    x = 3\nA = 'text'\nB = (1, 'x')\nC = True\nb = 5\n", 0),
        ("a.h", "#define A 3U\n", 1),
        ("a.h", "/* Sides. */\n#define A 3U\n#define B 4U\n\n#define C 5.5F\n", 1),
        (
            "a.h",
            "#define A 0U\n#define B (1.0F)\n#define C (A + 3U)\nstatic const int d = 7; /* days */\n",
            0,
        ),
        ("a.cpp", "constexpr double kA = 2.5;\nconst int kB = 7;  // days\n", 1),
    ],
)
def test_a_number_without_its_origin_is_named(name: str, text: str, unexplained: int, tmp_path: Path) -> None:
    place = {"py": "gen/gyrotc", "h": "libc", "cpp": "gen/core"}[name.partition(".")[2]]
    (tmp_path / place).mkdir(parents=True)
    (tmp_path / place / name).write_text(text)
    found = [line for line in origins.unexplained_numbers(tmp_path) if "no constant" not in line]
    assert len(found) == unexplained, found


def test_what_the_oldest_python_lacks_is_found(tmp_path: Path) -> None:
    """A module, a function, a method, an argument; not what stands behind a look at the release."""
    (tmp_path / "gen").mkdir()
    shutil.copy(ROOT / "gen/pyproject.toml", tmp_path / "gen")
    (tmp_path / "tools").mkdir()
    (tmp_path / "tools" / "young.py").write_text(
        "import contextlib\n"
        "import sys\n"
        "import tarfile\n"
        "from datetime import UTC\n"
        "from pathlib import Path\n\n"
        "if sys.version_info >= (3, 11):\n"
        "    import tomllib\n\n\n"
        "def young(archive: Path):\n"
        "    with contextlib.chdir(archive.parent):\n"
        "        list(archive.walk())\n"
        "    with tarfile.open(archive) as opened:\n"
        '        opened.extractall(archive.parent, filter="data")\n'
        "    error = ValueError(sys.version, UTC)\n"
        '    error.add_note("x")\n'
        "    unknown: int = 'a type that is wrong in every release'\n"
    )
    found = sorted(int(text.split(":")[1]) for text in oldest.younger_than_supported(tmp_path))
    assert found == [4, 12, 13, 15, 17]
