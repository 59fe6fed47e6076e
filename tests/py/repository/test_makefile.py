"""What a user sets for `make` reaches the programs as it is: nothing in it is read by make or by the shell."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
#: Stands in for every program: writes what it was called with.
STUB = '#!/bin/sh\nprintf "%s\\n" "$(basename "$0")" "$@" ${GYROTC_ODD:+"ODD=$GYROTC_ODD"} >>"$CALLS"\n'
HOSTILE = (
    'x"; touch y; "',
    "x'; touch y; '",
    "$(touch y)",
    "$(shell touch y)",
    "${shell touch y}",
    "`touch y`",
    "x; touch y",
    "x | touch y #",
    "--out=y",
    "a folder",
    "a$b",
    "*",
    "~",
    "Mämmi\\",
)


@pytest.fixture
def house(tmp_path: Path) -> Path:
    """A folder with the Makefile in which every program is a stub."""
    folder = tmp_path / 'a "house"'
    for program in (
        "tools/setup.sh",
        ".venv/bin/gyrotc",
        ".venv/bin/python",
        "build/bench/bin/python",
        "bin/cmake",
        "build/fuzz/fuzz_map_f32",
    ):
        path = folder / program
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(STUB)
        path.chmod(0o755)
    shutil.copy(ROOT / "Makefile", folder)
    return folder


def make(house: Path, *arguments: str, **variables: str) -> tuple[int, list[str]]:
    """Exit status of make, and the words that the programs were called with, in order."""
    calls = house.parent / "calls"
    calls.unlink(missing_ok=True)
    known = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")}
    path = f"{house / 'bin'}:{os.environ['PATH']}"
    environment = known | {"CALLS": str(calls), "PATH": path} | variables
    done = subprocess.run(
        ["make", *arguments], cwd=house, env=environment, capture_output=True, check=False, timeout=60
    )
    assert not (house / "y").exists(), "the value was run"
    return done.returncode, calls.read_text().splitlines() if calls.exists() else []


def _after(calls: list[str], word: str) -> str:
    """What the program that is called with `word` is given next."""
    return calls[calls.index(word) + 1]


@pytest.mark.parametrize("value", HOSTILE)
def test_values_reach_programs_as_they_are(value: str, house: Path) -> None:
    for given in ({}, {"DATA": value, "AXIS": value, "SEED": value, "GYROTC_REAL_DATA": value}):
        words = [] if given else [f"{name}={value}" for name in ("DATA", "AXIS", "SEED", "GYROTC_REAL_DATA")]
        status, calls = make(house, "demo", *words, **given)
        assert status == 0
        assert calls[:2] == ["setup.sh", "gyrotc"] and calls[-3:] == [f"--axis={value}", "--", value]
        for target in ("blind", "blind-other", "kills"):
            status, calls = make(house, target, *words, **given)
            assert status == 0 and calls[-1] == f"--seed={value}"
        status, calls = make(house, "real", *words, **given)
        assert status == 0 and _after(calls, "tools/real.py") == value


@pytest.mark.parametrize("value", HOSTILE)
def test_numbers_for_one_target_reach_it_as_they_are(value: str, house: Path) -> None:
    """Before: `make odd SETS='1; touch y'` ran what it said."""
    for given in ({}, {"SETS": value, "MEGABYTES": value}):
        words = [] if given else [f"SETS={value}", f"MEGABYTES={value}"]
        assert make(house, "odd", *words, **given)[1][-1] == f"ODD={value}"
        assert make(house, "bench-import", *words, **given)[1][-1] == value


@pytest.mark.parametrize("value", [*HOSTILE, "-1", "0", "1e3", "20 30"])
def test_a_fuzzing_time_that_is_none_is_refused(value: str, house: Path) -> None:
    """libFuzzer would take it for 0, which is for ever."""
    for name in ("SECONDS", "STORM", "SEED"):
        status, calls = make(house, "fuzz", f"{name}={value}")
        assert status == 2 and calls == []


def test_values_left_out_are_the_defaults(house: Path) -> None:
    assert make(house, "blind", "SEED=")[1][-2:] == ["--docs", "docs"]
    assert _after(make(house, "real")[1], "tools/real.py") == "../shared/data/real"
    assert make(house, "bench-import")[1][-1] == "docs" and make(house, "odd")[1][-1] == "ODD=2000"
    calls = make(house, "fuzz", "SECONDS=7")[1]
    assert "-max_total_time=7" in calls
    assert "-max_total_time=20" in make(house, "fuzz")[1]
