"""Emitted folders for the tests of verify, and ways to spoil them."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.model import Model, load_model
from gyrotc.recordings import Dataset, load
from gyrotc.tables import Emission, board_test_texts, emit, quantise_all
from gyrotc.verify import Target, all_targets, compiler_version, verify
from recordings import csv_text, toml

#: What the negative controls of this session showed: a record for each program that ran to its end and differed.
CAUGHT: list[dict[str, Any]] = []
_SHOWN = ("name", "numeric", "vectors", "mismatches")
#: Releases of arm-none-eabi-gcc in Debian 12 and 13: what they make of the runtime was measured with both.
_MEASURED = ("12.2.1", "14.2.1")
GOLDEN = Path(__file__).resolve().parents[2] / "examples" / "minimal" / "model.json"


def measured(target: Target) -> bool:
    """Whether bytes and instructions of this target's code may be asserted; other releases decide them anew."""
    name, _, release = compiler_version(target.compiler).rpartition(" ")
    return name == "arm-none-eabi-gcc" and release in _MEASURED


def emitted(folder: Path, model: Model | None = None) -> Path:
    """`folder` with `model.json` and `c/`, as `gyrotc emit` leaves it."""
    model = model or load_model(GOLDEN)
    emit(model, folder)
    return folder


def board_folder(folder: Path, model: Model | None = None, emission: Emission | None = None) -> Path:
    """`folder` with the board test of a model, its vectors and its answers, as `gyrotc emit --board` writes it."""
    model = model or load_model(GOLDEN)
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in board_test_texts(model, emission or quantise_all(model, None)).items():
        (folder / name).write_bytes(data)
    return folder


def spoil(path: Path, pattern: str, replacement: str, *, count: int = 1) -> None:
    """Replaces `pattern`; the replacement must have taken place, else the control controls nothing."""
    text, n = re.subn(pattern, replacement, path.read_text(encoding="ascii"), count=count)
    assert n >= 1, f"{pattern!r} is not in {path.name}"
    path.write_text(text, encoding="ascii")


def flip(path: Path, pattern: str, bit: int = 0) -> None:
    """Flips one bit of the hexadecimal word that the first group of `pattern` finds."""
    text = path.read_text(encoding="ascii")
    match = re.search(pattern, text)
    assert match is not None, f"{pattern!r} is not in {path.name}"
    word = f"{int(match[1], 16) ^ (1 << bit):0{len(match[1])}x}"
    path.write_text(text[: match.start(1)] + word + text[match.end(1) :], encoding="ascii")


def entries(folder: Path, *names: str) -> dict[tuple[str, str], dict[str, Any]]:
    """Entries of `verify` by target and arithmetic; code that a test has spoilt is run all the same."""
    result = verify(folder, targets=names, trust_code=True).content()
    return {(e["name"], e["numeric"]): e for e in result["targets"]}


def with_flags(name: str, *flags: str) -> Target:
    """A target with more flags; the last one of contradicting flags holds."""
    target = all_targets()[name]
    return target.model_copy(update={"flags": (*target.flags, *flags)})


def ran_and_differed(entry: dict[str, Any]) -> bool:
    """The program ran to its end and its results differ: what a negative control must show."""
    caught = entry["status"] == "fail" and "error" not in entry and entry["mismatches"] > 0
    if caught:
        control = os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" (")[0]
        CAUGHT.append({"control": control, **{k: entry[k] for k in _SHOWN}})
    return caught


def recorded(folder: Path) -> Dataset:
    """Two runs of 15 minutes with gaps, an outage, a spike and two auxiliary channels."""
    folder.mkdir()
    rng = np.random.default_rng(5)
    for k in range(2):
        time_s = np.delete(np.arange(900.0), [*range(200, 203), *range(500, 540)])
        temperature = 15.0 + 10.0 * k + 20.0 * np.sin(time_s / 400.0 + k) + rng.normal(0.0, 0.003, time_s.size)
        temperature[300 + k] += 25.0
        columns = {
            "time_s": time_s,
            "temperature_c": np.round(temperature, 4),
            "rate_dph": np.round(rng.normal(0.007, 0.01, time_s.size), 5),
            "supply_v": np.round(0.2 + rng.normal(0.0, 0.02, time_s.size), 4),
            "magnetic_ut": np.round(rng.normal(0.0, 0.5, time_s.size), 4),
        }
        (folder / f"run-{k}.csv").write_text(csv_text(columns), encoding="utf-8")
    description = toml('file = "run-0.csv"', 'file = "run-1.csv"')
    (folder / "dataset.toml").write_text(description, encoding="utf-8")
    return load(folder)
