"""docs/proof.md names tests and proofs that exist, and every requirement has at least one."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "proof.md").read_text("utf-8")
REQUIREMENTS = re.findall(r"^\| (R-[A-Z]+-\d+) \| (.+?) \| (.+) \|$", PAGE, re.MULTILINE)
FAULTS = re.findall(r"^\| ([^|]+) \| (`tests/[^|]+::[^|]+) \|$", PAGE.partition("\n## 6.")[2], re.MULTILINE)
ANSWER = re.compile(r"`(tests/[\w/]+\.(?:py|c))::(\w+)`")


def _names(path: Path) -> set[str]:
    """Test functions of a Python file, or tests of a C file that its main() runs."""
    text = path.read_text("utf-8")
    if path.suffix == ".py":
        return set(re.findall(r"^def (test_\w+)\(", text, re.MULTILINE))
    return set(re.findall(r"^TEST\((\w+)\)", text, re.MULTILINE)) & set(re.findall(r"RUN\((\w+)\)", text))


def test_there_are_requirements_and_no_id_twice() -> None:
    ids = [name for name, _, _ in REQUIREMENTS]
    assert len(ids) >= 30
    assert len(set(ids)) == len(ids)
    assert len(ids) == len(re.findall(r"^\| R-", PAGE, re.MULTILINE))


def test_every_fault_that_was_met_has_a_test() -> None:
    assert len(FAULTS) >= 20
    assert len(FAULTS) == len(re.findall(r"^\| (?!fault|---)", PAGE.partition("\n## 6.")[2], re.MULTILINE))
    for _, answers in FAULTS:
        _exist(answers)


@pytest.mark.parametrize("requirement", REQUIREMENTS, ids=[r[0] for r in REQUIREMENTS])
def test_what_answers_for_a_requirement_exists(requirement: tuple[str, str, str]) -> None:
    _exist(requirement[2])


def _exist(answers: str) -> None:
    found = ANSWER.findall(answers)
    assert found
    assert ANSWER.sub("", answers).strip() == ""
    for file, name in found:
        assert (ROOT / file).is_file(), file
        assert name in _names(ROOT / file), f"{file}::{name}"


def test_files_that_the_page_names_exist() -> None:
    for name in re.findall(r"`((?:tests|gen|tools)/[\w/.]+?)`", PAGE):
        assert (ROOT / name).exists(), name
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", PAGE):
        assert (ROOT / "docs" / target).exists(), target


def test_every_file_of_tests_answers_for_requirements() -> None:
    """The other direction: none is missing in section 5, none that it names is gone, each id is one of section 4."""
    listed = dict(re.findall(r"^\| `(tests/\S+)` \| ((?:R-[A-Z]+-\d+ ?)+)\|$", PAGE, re.MULTILINE))
    there = [
        *ROOT.glob("tests/c/test_*.c"),
        *ROOT.glob("tests/prove/test_*.py"),
        *ROOT.glob("tests/targets/test_*.py"),
    ]
    assert sorted(listed) == sorted(path.relative_to(ROOT).as_posix() for path in there)
    ids = {name for name, _, _ in REQUIREMENTS}
    assert {word for words in listed.values() for word in words.split()} <= ids
