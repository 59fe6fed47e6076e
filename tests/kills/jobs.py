"""Jobs to be killed: each kind of writing by itself, and the commands as users type them."""

from __future__ import annotations

import itertools
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from gyrotc.outputs import MARKER, faults, read_marker, result_folder, write_atomically, write_result

from .driver import Job

_version = itertools.count()


@dataclass(frozen=True)
class Case:
    """A job, the results that it writes, and what must be there besides."""

    name: str
    job: Job
    results: tuple[Path, ...]


def content(folder: Path) -> dict[str, bytes]:
    """Every file of a folder but the markers."""
    return {
        p.relative_to(folder).as_posix(): p.read_bytes()
        for p in sorted(folder.rglob("*"))
        if p.is_file() and p.name != MARKER
    }


def wrong(result: Path) -> list[str]:
    """What keeps a result from being complete, the earlier one or the new."""
    if result.suffix == ".json":
        try:
            return [] if json.loads(result.read_bytes())["whole"] is True else ["not whole"]
        except (OSError, ValueError, KeyError) as error:
            return [repr(error)]
    return faults(result) if result.is_dir() else ["is not there"]


def left_beside(folder: Path, expected: set[str]) -> set[str]:
    """Names in a folder that should not be there: any but those expected, and the folder that a link points to."""
    links = {str(p.readlink()) for p in folder.iterdir() if p.is_symlink()}
    found = {p.name for p in folder.iterdir()} - expected - links
    for result in (folder / name for name in expected):
        if result.is_dir() and read_marker(result) is not None:
            found |= {str(p.relative_to(folder)) for p in result.rglob(".*") if p.name != MARKER}
    return found


def writing(root: Path) -> list[Case]:
    """The ways in which commands write, without their work: every call can be tried."""
    out, alone = root / "out", root / "alone.json"

    def build() -> None:
        with result_folder(out, "build") as stage:
            _fill(stage.folder / "c", "table.c", "table.h")
            write_atomically(stage.folder / "model.json", _text())
            with result_folder(stage.folder / "diagnosis", "diagnose") as part:
                _fill(part.folder, "diagnose.json")

    def emit() -> None:
        with result_folder(out, "emit", entries=["c"]) as stage:
            _fill(stage.folder / "c", "table.c", "table.h")

    def verify() -> None:
        with result_folder(out, "verify", entries=["verify.json"]) as stage:
            _fill(stage.folder, "verify.json")

    def evaluate() -> None:
        with result_folder(out, "evaluate", entries=["evaluate.json", "trace"]) as stage:
            _fill(stage.folder / "trace", "run-01.csv")
            _fill(stage.folder, "evaluate.json")

    def single() -> None:
        write_result(alone, json.dumps({"schema": "gyrotc.plan/1", "text": _text(), "whole": True}))

    folders = [Case(job.__name__, job, (out,)) for job in (build, emit, verify, evaluate)]
    return [*folders, Case("json", single, (alone,))]


def _text() -> str:
    return f"version {next(_version)}\n"


def _fill(folder: Path, *names: str) -> None:
    folder.mkdir(exist_ok=True)
    for name in names:
        (folder / name).write_text(_text())


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
    scenario = root / "short.toml"
    scenario.write_text(SCENARIO, encoding="utf-8")
    data, out, apart = root / "data", root / "out", root / "apart"
    typed: dict[str, tuple[Sequence[object], tuple[Path, ...]]] = {
        "simulate": (["simulate", scenario, "--seed", 3, "--out", data], (data,)),
        "build": (["build", data, "--out", out, "--numeric", "f32"], (out,)),
        "fit": (["fit", data, "--out", root / "fitted", "--json", root / "fit.json"], (root / "fitted",)),
        "emit": (["emit", out / "model.json", "--out", apart], (apart,)),
        "verify": (["verify", apart, "--target", "host-gcc-O2"], (apart,)),
        "evaluate": (["evaluate", apart, data, "--trace", apart / "trace"], (apart,)),
        "report": (["report", out], (out,)),
        "compare": (["compare", data, "--out", root / "compared"], (root / "compared",)),
        "diagnose": (["diagnose", data, "--out", root / "diagnosed"], (root / "diagnosed",)),
        "plan": (["plan", scenario, "--out", root / "planned"], (root / "planned",)),
    }
    return [Case(name, _command(*arguments), results) for name, (arguments, results) in typed.items()]


def _command(*arguments: object) -> Job:
    def job() -> None:
        from gyrotc.cli import _status

        sys.argv = ["gyrotc", *(str(a) for a in arguments)]
        raise SystemExit(_status())  # `main` leaves at once: the calls could not be counted

    return job
