"""Requirements of docs/proof.md and tests answer for each other; the coverage of the C library can fail."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "proof.md").read_text("utf-8")
FAULTS = re.findall(r"^\| ([^|]+) \| (`tests/[^|]+::[^|]+) \|$", PAGE.partition("\n## 6.")[2], re.MULTILINE)
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
    _exist(requirement[2])


@pytest.mark.parametrize("fault", FAULTS, ids=[f[0] for f in FAULTS])
def test_what_was_left_by_a_fault_exists(fault: tuple[str, str]) -> None:
    _exist(fault[1])


def _exist(answers: str) -> None:
    found = ANSWER.findall(answers)
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
