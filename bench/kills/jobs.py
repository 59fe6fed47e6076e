"""Jobs to be killed: each kind of writing by itself, and the commands as users type them.

A job takes the number of a version: with another number it writes something else, with the same number the same.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from gyrotc.results import MARKER, read_marker, result_faults, result_folder, write_atomically, write_result

from .driver import Job

Content = dict[str, bytes]
Versioned = Callable[[int], None]


def _nothing(_version: int) -> None:
    pass


@dataclass(frozen=True)
class Case:
    """Job that is killed, and what it writes.

    Attributes:
        write: The job; it is killed.
        results: Folders and files, each of which is at every moment as before or as the job leaves it.
        prepare: Called before the job, undisturbed.
        disagree: What is wrong with what the job writes besides.
        worker_calls: Calls that change a file in each process that the job starts; 0: it is not a target by itself.
    """

    name: str
    write: Versioned
    results: tuple[Path, ...]
    prepare: Versioned = _nothing
    disagree: Callable[[], list[str]] = list
    worker_calls: int = 0

    def job(self, version: int) -> Job:
        """The job that writes a version."""
        return lambda: self.write(version)

    def contents(self) -> tuple[Content, ...]:
        """Return the present contents of its results."""
        return tuple(content(result) for result in self.results)


def content(result: Path) -> Content:
    """Every file of a result but its marker, which says the same; hidden names are left over (`left_beside`)."""
    if result.is_file():
        return {"": result.read_bytes()}
    return {
        p.relative_to(result).as_posix(): p.read_bytes()
        for p in sorted(result.rglob("*"))
        if p.is_file() and p.name != MARKER and not any(name.startswith(".") for name in p.relative_to(result).parts)
    }


def wrong(result: Path) -> list[str]:
    """Return the reasons why a result that exists is not complete."""
    if result.is_dir():
        return result_faults(result)
    try:
        json.loads(result.read_bytes())
    except FileNotFoundError:
        return []
    except ValueError as error:
        return [repr(error)]
    return []


def left_beside(folder: Path, expected: set[str]) -> set[str]:
    """Names in a folder that should not be there: any but those expected."""
    found = {p.name for p in folder.iterdir()} - expected
    for result in (folder / name for name in expected):
        if result.is_dir() and read_marker(result) is not None:
            found |= {str(p.relative_to(folder)) for p in result.rglob(".*")}
    return found


def writing(root: Path) -> list[Case]:
    """The ways in which commands write, without their work: every call can be tried."""
    out, alone = root / "out", root / "alone.json"

    def build(version: int) -> None:
        with result_folder(out, "build") as stage:
            _fill(version, stage.folder / "c", "table.c", "table.h")
            write_atomically(stage.folder / "model.json", f"{version}\n")
            with result_folder(stage.folder / "diagnosis", "diagnose") as part:
                _fill(version, part.folder, "diagnose.json")

    def emit(version: int) -> None:
        with result_folder(out, "emit", entries=["c"]) as stage:
            _fill(version, stage.folder / "c", "table.c", "table.h")

    def verify(version: int) -> None:
        with result_folder(out, "verify", entries=["verify.json"]) as stage:
            _fill(version, stage.folder, "verify.json")

    def evaluate(version: int) -> None:
        with result_folder(out, "evaluate", entries=["evaluate.json", "trace"]) as stage:
            _fill(version, stage.folder / "trace", "run-01.csv")
            _fill(version, stage.folder, "evaluate.json")

    def single(version: int) -> None:
        write_result(alone, json.dumps({"schema": "gyrotc.check/1", "version": version}))

    folders = [Case(job.__name__, job, (out,)) for job in (build, emit, verify, evaluate)]
    return [*folders, Case("json", single, (alone,))]


def _fill(version: int, folder: Path, *names: str) -> None:
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / name).write_text(f"version {version}\n")


SCENARIO = """extends = "paper"
title = "short"
[profile.ramp]
start_c = 20.0
record_min = 40
steps = [{ramp_to_c = 40.0, c_per_min = 1.0}, {hold_min = 20}]
[[set]]
role = "train"
started = 2026-03-02T08:00:00Z
profiles = ["ramp", "ramp"]
"""


def commands(root: Path) -> list[Case]:
    """Commands on small recordings; `root` gets what they need."""
    scenario, data, out, other = root / "short.toml", root / "data", root / "out", root / "other"
    scenario.write_text(SCENARIO, encoding="utf-8")
    subprocess.run([*GYROTC, "simulate", scenario, "--seed", "3", "--out", data], check=True, stdout=subprocess.DEVNULL)

    def case(name: str, line: Callable[[int], Sequence[object]], *results: Path) -> Case:
        return Case(name, lambda version: command(name, *line(version)), results)

    targets, numerics, described = ("host-gcc-O2", "host-clang-O2"), ("f32", "q31"), (data, root / "cubic")
    shutil.copytree(data, described[1])
    for folder, method in zip(described, ("linear", "cubic"), strict=True):
        with (folder / "dataset.toml").open("a") as file:
            file.write(f'[fit]\nmethod = "{method}"\n')
    return [
        case("simulate", lambda v: [scenario, "--seed", v, "--out", root / "made"], root / "made"),
        case("build", lambda v: [described[v % 2], "--out", out, "--numeric", "f32"], out),
        case("fit", lambda v: [described[v % 2], "--out", root / "fitted"], root / "fitted"),
        case("emit", lambda v: [out / "model.json", "--out", other, "--numeric", numerics[v % 2]], other),
        case("verify", lambda v: [other, "--target", targets[v % 2]], other),
        case("evaluate", lambda _: [other, data, "--trace", other / "trace"], other),
        case("report", lambda _: [out], out),
        case("compare", lambda _: [data, "--out", root / "compared"], root / "compared"),
        case("diagnose", lambda v: [described[v % 2], "--out", root / "diagnosed"], root / "diagnosed"),
        case("import", lambda v: [data / "run-01.csv", "--out", root / "imported", "--serial", f"RLG-{v}"],
             root / "imported"),
        case("check", lambda _: [data, "--json", root / "check.json"], root / "check.json"),
    ]  # fmt: skip


GYROTC = (sys.executable, "-c", "from gyrotc.cli.main import main; main()")


def command(*arguments: object) -> None:
    """A command line, in this process."""
    from gyrotc.cli.main import run

    raise SystemExit(run([str(a) for a in arguments]))  # `main` leaves at once: the calls could not be counted
