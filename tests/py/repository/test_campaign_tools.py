"""Slices of the campaigns and their tools: planted faults, the oracle, killed jobs, coverage, the page of proofs."""

from __future__ import annotations

import copy
import json
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from results import recorded

from tests.mutants.run import MODELS, Fault, House, faults, tried
from tests.oracle.__main__ import REFERENCE
from tests.oracle.compare import Reference, differences
from tests.oracle.normalise import content_of
from tests.oracle.sets import SETS

ROOT = Path(__file__).resolve().parents[3]


FAULTS = faults()


def test_there_are_enough_and_no_name_twice() -> None:
    assert len(FAULTS) >= 20
    assert max(Counter(fault.name for fault in FAULTS).values()) == 1
    assert len({fault.file for fault in FAULTS}) >= 10
    assert all((ROOT / path).is_file() for path in MODELS.values())


@pytest.mark.parametrize("fault", FAULTS, ids=[fault.name for fault in FAULTS])
def test_what_it_changes_stands_there_once(fault: Fault) -> None:
    assert (fault.model in MODELS) != bool(fault.tests)
    assert all((ROOT / "tests" / "py" / test.partition("::")[0]).is_file() for test in fault.tests)
    assert fault.old != fault.new
    assert (ROOT / "gen" / "gyrotc" / fault.file).read_text("utf-8").count(fault.old) == 1


@pytest.mark.slow
def test_each_way_of_seeing_one_sees_one() -> None:
    """A fault of the tables, one of the answers; the generator as it is passes both before."""
    found = {r["name"]: r["seen_by"] for r in tried(["width multiplied", "result rounded instead of cut off"])}
    assert found == {"width multiplied": "check_table", "result rounded instead of cut off": "verify"}


@pytest.mark.slow
def test_a_fault_that_changes_nothing_is_seen_by_nobody(tmp_path: Path) -> None:
    """The campaign can fail: what is no fault must not count as seen."""
    none = Fault("none", "tables/f32.py", "_GAIN / width", "_GAIN / (width * 1.0)", "plain")
    assert House(tmp_path).objection("plain", none)["seen_by"] is None


def test_the_last_campaign_tried_all_of_them() -> None:
    result = recorded(ROOT / "docs", "mutants")
    assert [m["name"] for m in result["mutants"]] == [fault.name for fault in FAULTS]
    assert all(m["seen_by"] or m.get("survives") for m in result["mutants"])
    seen = Counter(m["seen_by"] is not None for m in result["mutants"])
    assert seen[True] >= 0.95 * seen.total()


RESULT: dict[str, Any] = {
    "schema": "gyrotc.x/1",
    "versions": {"gcc": "12"},
    "rms_dph": 7.1e-4,
    "runs": [{"file": "a.csv", "rows": 10}, {"file": "b.csv", "rows": 11, "span": None}],
    "cells": [[1, 2], [3, 4]],
}
CHANGES: dict[str, Callable[[dict[str, Any]], object]] = {
    "document.rms_dph": lambda r: r.update(rms_dph=7.1000000000000013e-4),
    "document.runs[].rows": lambda r: r["runs"][1].update(rows=12),
    "document.runs[].span": lambda r: r["runs"][1].pop("span"),
    "document.cells": lambda r: r["cells"][1].reverse(),
    "document.new": lambda r: r.update(new=1),
}


def content(path: Path, result: dict[str, Any]) -> Any:
    path.write_text(json.dumps(result), "utf-8")
    return content_of(path)


@pytest.mark.parametrize("path", CHANGES)
def test_the_path_of_a_change_is_named(path: str, tmp_path: Path) -> None:
    before = content(tmp_path / "x.json", RESULT)
    changed = copy.deepcopy(RESULT)
    CHANGES[path](changed)
    after = content(tmp_path / "x.json", changed)
    reference = Reference(tmp_path / "reference.json")
    reference.enter("set", {"step": {"x.json": before}})
    reference.write({})
    reference = Reference(tmp_path / "reference.json")
    part = reference.steps("set")["step"]["x.json"]
    assert not [*reference.differences(part, before)] and not [*differences(before, before)]
    reported = [line.split(": ")[0] for line in reference.differences(part, after)]
    assert set(reported) == {"sha256", path}
    assert len([*differences(before, after)]) >= 2


def test_what_depends_on_the_machine_is_left_out_and_the_order_of_keys_is_not(tmp_path: Path) -> None:
    before = content(tmp_path / "x.json", RESULT)
    assert content(tmp_path / "x.json", RESULT | {"versions": {"gcc": "13"}}) == before
    assert content(tmp_path / "x.json", dict(reversed(RESULT.items()))) != before


def test_the_tracked_reference_is_small_and_has_every_set() -> None:
    assert REFERENCE.stat().st_size < 400_000
    reference = Reference(REFERENCE)
    assert all(reference.steps(name) for name in SETS)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the shim counts system calls of Linux")
def test_a_slice_of_the_kills(tmp_path: Path) -> None:
    """Every 101st call of each way of writing, ended by KILL, TERM, INT, EIO and ENOSPC."""
    command = [sys.executable, "-m", "tests.kills.run", "--commands", "0", "--every", "101", "--json"]
    done = subprocess.run(
        [*command, tmp_path / "kills.json"],
        cwd=ROOT, env=os.environ | {"TMPDIR": str(tmp_path)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    result = json.loads((tmp_path / "kills.json").read_text())
    assert result["ended"] >= 40 and result["wrong"] == 0
    assert all(counted["calls"] > 250 for counted in result["counts"].values()), "the shim sees the calls"


@pytest.mark.slow
def test_without_the_tests_of_a_file_its_lines_are_reported(tmp_path: Path) -> None:
    for folder in ("include", "libc", "tests/c"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    for test in (tmp_path / "tests/c").glob("test_*.c"):
        if test.stem not in ("test_map", "test_broken", "test_least"):  # the script names the last two
            test.unlink()
    (tmp_path / "tools").mkdir()
    shutil.copy(ROOT / "tools" / "coverage.sh", tmp_path / "tools")
    gcovr = Path(sys.executable).with_name("gcovr")
    if not gcovr.is_file():
        pytest.skip("gcovr is not installed: tools/setup.sh test")
    done = subprocess.run(
        [tmp_path / "tools" / "coverage.sh"],
        env=os.environ | {"GCOVR": str(gcovr)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    rows = {row.split()[0]: row.split()[1:] for row in done.stdout.splitlines() if row.startswith("libc/")}
    branches, taken, _, missed = rows["libc/gtc_save.inl"]
    assert int(taken) < int(branches) and missed


PAGE = (ROOT / "docs" / "proof.md").read_text("utf-8")
REQUIREMENTS = re.findall(r"^\| (R-[A-Z]+-\d+) \| (.+?) \| (.+) \|$", PAGE, re.MULTILINE)
PROVED_FAULTS = re.findall(r"^\| ([^|]+) \| (`tests/[^|]+::[^|]+) \|$", PAGE.partition("\n## 6.")[2], re.MULTILINE)
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
    assert len(PROVED_FAULTS) >= 20
    assert len(PROVED_FAULTS) == len(re.findall(r"^\| (?!fault|---)", PAGE.partition("\n## 6.")[2], re.MULTILINE))
    for _, answers in PROVED_FAULTS:
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
