"""Requirements of docs/proof.md and tests answer for each other; the coverage of the C library can fail."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from eva_parts import PARTS, SOURCES, preprocessor_options, text_of

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "proof.md").read_text("utf-8")
REQUIREMENTS = re.findall(r"^\| (R-[A-Z]+-\d+) \| (.+?) \| (.+) \|$", PAGE, re.MULTILINE)
ANSWER = re.compile(r"`(tests/[\w/]+\.(?:py|c))::(\w+)`")


def _names(path: Path) -> set[str]:
    """Return test functions of a Python file, or tests of a C file that its main() runs."""
    text = path.read_text("utf-8")
    if path.suffix == ".py":
        return set(re.findall(r"^def (test_\w+)\(", text, re.MULTILINE))
    return set(re.findall(r"^TEST\((\w+)\)", text, re.MULTILINE)) & set(re.findall(r"RUN\((\w+)\)", text))


@pytest.mark.parametrize("requirement", REQUIREMENTS, ids=[r[0] for r in REQUIREMENTS])
def test_what_answers_for_a_requirement_exists(requirement: tuple[str, str, str]) -> None:
    found = ANSWER.findall(requirement[2])
    assert found
    for file, name in found:
        assert (ROOT / file).is_file(), file
        assert name in _names(ROOT / file), f"{file}::{name}"


def test_every_file_of_tests_answers_for_requirements() -> None:
    """None is missing in section 5, none that it names is gone, and each id is one of section 4."""
    listed = dict(re.findall(r"^\| `(tests/\S+)` \| ((?:R-[A-Z]+-\d+ ?)+)\|$", PAGE, re.MULTILINE))
    patterns = ("tests/c/test_*.c", "tests/prove/test_*.py", "tests/targets/test_*.py")
    there = [path.relative_to(ROOT).as_posix() for pattern in patterns for path in ROOT.glob(pattern)]
    assert sorted(listed) == sorted(there)
    assert {word for words in listed.values() for word in words.split()} <= {name for name, _, _ in REQUIREMENTS}


#: What Frama-C declares, for a compiler.
FRAMA_C = """#include <stddef.h>
int Frama_C_interval(int least, int most);
unsigned Frama_C_unsigned_int_interval(unsigned least, unsigned most);
long Frama_C_long_interval(long least, long most);
unsigned long Frama_C_unsigned_long_interval(unsigned long least, unsigned long most);
long long Frama_C_long_long_interval(long long least, long long most);
float Frama_C_float_interval(float least, float most);
"""


@pytest.mark.parametrize("numeric", ["f32", "q31"])
@pytest.mark.parametrize("name", PARTS)
def test_the_files_of_the_eva_proof_are_of_the_text_that_is_emitted(name: str, numeric: str, tmp_path: Path) -> None:
    """They compile with it, and each function that a contract stands for is defined there."""
    part = PARTS[name]
    c = text_of(part, tmp_path)
    (tmp_path / "__fc_builtin.h").write_text(FRAMA_C, "ascii")
    options = [f"-I{tmp_path}", *preprocessor_options(c, part, numeric)]
    # To a compiler the checks are comments, and what only they read is not used.
    unused = ["-Wno-unused-variable", "-Wno-unused-but-set-variable"]
    flags = ["-std=gnu99", "-Wall", "-Wextra", "-Werror", *unused, "-fsyntax-only"]
    done = subprocess.run(
        ["gcc", *flags, *options, str(SOURCES / f"{part.file}.c")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    text = (c / f"gtc_{numeric}.c").read_text("ascii")
    declared = (SOURCES / f"{part.file}.c").read_text("utf-8") + (SOURCES / "arithmetic.h").read_text("utf-8")
    for function in part.contracts.get(numeric, "").split(","):
        assert re.search(rf"^static (?:inline )?\w+ {function}\(", text, re.MULTILINE) or not function
        assert re.search(rf"\b{function}\(.*\n?.*\);", declared) or not function
