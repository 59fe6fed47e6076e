"""Set-up on any release of Debian, and what a user sets for `make`."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
#: Programs of a machine on which nothing is installed yet; $UNKNOWN are packages that its release does not have.
STUBS = {
    "id": "echo 0",
    "dpkg-query": "exit 1",
    "apt-get": 'echo "$@" >>"$CALLS"',
    "apt-cache": '[ "$1" = show ]; case " $UNKNOWN " in *" $2 "*) exit 100 ;; esac',
    "gcc": "echo 14",
    "clang": "echo 19.1.7",
}


@pytest.fixture
def house(tmp_path: Path) -> Path:
    """A folder with nothing but the script, what it looks at, and an environment that is there."""
    for name in ("tools", "gen/core", "gen/gyrotc", "bin", ".venv/bin"):
        (tmp_path / name).mkdir(parents=True)
    shutil.copy(ROOT / "tools/setup.sh", tmp_path / "tools")
    for name in ("gen/pyproject.toml", "gen/CMakeLists.txt", "gen/core/x.cpp"):
        (tmp_path / name).touch()
    for name, body in {**{f"bin/{k}": v for k, v in STUBS.items()}, ".venv/bin/python": "exit 0"}.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{body}\n")
        (tmp_path / name).chmod(0o755)
    return tmp_path


def setup(house: Path, level: str, unknown: str = "") -> tuple[int, list[str], str]:
    """Exit status, the packages asked for, and what was reported."""
    calls = house / "calls"
    calls.unlink(missing_ok=True)
    environment = os.environ | {
        "PATH": f"{house / 'bin'}:{os.environ['PATH']}", "CALLS": str(calls), "UNKNOWN": unknown,
    }  # fmt: skip
    done = subprocess.run(
        [house / "tools/setup.sh", level], env=environment, capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    lines = calls.read_text().splitlines() if calls.exists() else []
    assert lines.count("update -qq") == 1, "the lists are fetched once"
    asked = [word for line in lines if line.startswith("install") for word in line.split()[1:] if word[0] != "-"]
    return done.returncode, asked, done.stderr


def test_packages_of_a_compiler_have_its_version(house: Path) -> None:
    status, asked, reported = setup(house, "targets")
    assert (status, reported) == (0, "")
    assert {"libclang-rt-19-dev", "lib32gcc-14-dev"} <= set(asked)
    assert asked.index("libclang-rt-19-dev") > asked.index("clang")
    assert not [name for name in setup(house, "demo")[1] if re.search("clang|lib32|qemu-user", name)]


def test_a_package_that_a_release_lacks_is_reported_and_left_out(house: Path) -> None:
    status, asked, reported = setup(house, "prove", "frama-c-base libclang-rt-19-dev")
    assert status == 0 and {"gappa", "z3", "cmake"} <= set(asked)
    assert "frama-c-base" not in asked and "libclang-rt-19-dev" not in asked
    assert reported.splitlines() == [
        f"setup: this release has no package {name}: what needs it does not run"
        for name in ("frama-c-base", "libclang-rt-19-dev")
    ]


def test_what_the_main_job_needs_is_never_left_out(house: Path) -> None:
    assert "libeigen3-dev" in setup(house, "demo", "libeigen3-dev")[1], "apt-get says what is wrong"


@pytest.mark.parametrize("level", ["demo", "test", "check", "targets", "prove"])
def test_every_level_brings_the_core_on_which_the_main_job_proves_its_code(level: str, house: Path) -> None:
    assert {"gcc-arm-none-eabi", "qemu-system-arm"} <= set(setup(house, level)[1])


def test_no_release_stands_in_a_package_name() -> None:
    """libfoo-14-dev is one release's; libeigen3-dev and libc6-dev are names."""
    files = [ROOT / "tools/setup.sh", *(ROOT / "gen/gyrotc/verify/targets").glob("*.toml")]
    numbered = [
        word for path in files for word in re.findall(r"\b[a-z0-9+-]+-\d+(?:-[a-z]+)?\b", path.read_text())
        if re.match(r"lib|gcc-\d|clang-\d|g\+\+-\d", word)
    ]  # fmt: skip
    assert numbered == []


#: Stands in for every program: writes what it was called with.
STUB = '#!/bin/sh\nprintf "%s\\n" "$(basename "$0")" "$@" >>"$CALLS"\n'
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
def stubbed(tmp_path: Path) -> Path:
    """A folder with the Makefile in which every program is a stub."""
    folder = tmp_path / 'a "house"'
    for program in (
        "tools/setup.sh",
        ".venv/bin/gyrotc",
        ".venv/bin/python",
        "bin/cmake",
        "build/fuzz/fuzz_map_f32",
    ):
        path = folder / program
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(STUB)
        path.chmod(0o755)
    shutil.copy(ROOT / "Makefile", folder)
    return folder


def make(stubbed: Path, *arguments: str, **variables: str) -> tuple[int, list[str]]:
    """Exit status of make, and the words that the programs were called with, in order."""
    calls = stubbed.parent / "calls"
    calls.unlink(missing_ok=True)
    known = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")}
    path = f"{stubbed / 'bin'}:{os.environ['PATH']}"
    environment = known | {"CALLS": str(calls), "PATH": path} | variables
    done = subprocess.run(
        ["make", *arguments], cwd=stubbed, env=environment, capture_output=True, check=False, timeout=60
    )
    assert not (stubbed / "y").exists(), "the value was run"
    return done.returncode, calls.read_text().splitlines() if calls.exists() else []


def _after(calls: list[str], word: str) -> str:
    """What the program that is called with `word` is given next."""
    return calls[calls.index(word) + 1]


@pytest.mark.parametrize("value", HOSTILE)
def test_values_reach_programs_as_they_are(value: str, stubbed: Path) -> None:
    for given in ({}, {"DATA": value, "AXIS": value, "SEED": value, "GYROTC_REAL_DATA": value}):
        words = [] if given else [f"{name}={value}" for name in ("DATA", "AXIS", "SEED", "GYROTC_REAL_DATA")]
        status, calls = make(stubbed, "demo", *words, **given)
        assert status == 0
        assert calls[:2] == ["setup.sh", "gyrotc"] and calls[-3:] == [f"--axis={value}", "--", value]
        status, calls = make(stubbed, "blind", *words, **given)
        assert status == 0 and calls[-1] == f"--seed={value}"
        status, calls = make(stubbed, "real", *words, **given)
        assert status == 0 and _after(calls, "bench.real.page") == value


@pytest.mark.parametrize("value", HOSTILE)
def test_what_is_set_for_a_campaign_reaches_it_as_it_is(value: str, stubbed: Path) -> None:
    names = ("ONLY", "BASE", "SETS", "SEED")
    for given in ({}, dict.fromkeys(names, value)):
        words = [] if given else [f"{name}={value}" for name in names]
        status, calls = make(stubbed, "bench", *words, **given)
        assert status == 0
        assert calls[-5:] == [f"--seed={value}", f"--sets={value}", f"--base={value}", "--", value]


@pytest.mark.parametrize("value", [*HOSTILE, "-1", "0", "1e3", "20 30"])
def test_a_fuzzing_time_that_is_none_is_refused(value: str, stubbed: Path) -> None:
    """libFuzzer would take it for 0, which is for ever."""
    for name in ("SECONDS", "STORM", "SEED"):
        status, calls = make(stubbed, "fuzz", f"{name}={value}")
        assert status == 2 and calls == []


def test_values_left_out_are_the_defaults(stubbed: Path) -> None:
    assert make(stubbed, "blind", "SEED=")[1][-2:] == ["--docs", "docs"]
    assert _after(make(stubbed, "real")[1], "bench.real.page") == "../shared/data/real"
    assert make(stubbed, "bench")[1][-2:] == ["--real=../shared/data/real", "--"]
    assert make(stubbed, "bench", "QUICK=1", "ONLY=sigma")[1][-3:] == ["--quick", "--", "sigma"]
    calls = make(stubbed, "fuzz", "SECONDS=7")[1]
    assert "-max_total_time=7" in calls
    assert "-max_total_time=20" in make(stubbed, "fuzz")[1]
