"""Emitted folders for the tests of verify, and ways to spoil them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from gyrotc.emit import emit
from gyrotc.model import Model, load_model
from gyrotc.toolchain import Target, all_targets
from gyrotc.verify import verify

GOLDEN = Path(__file__).resolve().parents[2] / "examples" / "minimal" / "model.json"


def emitted(folder: Path, model: Model | None = None) -> Path:
    """`folder` with `model.json` and `c/`, as `gyrotc emit` leaves it."""
    model = model or load_model(GOLDEN)
    emit(model, folder)
    model.save(folder / "model.json")
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
    """Entries of `verify` by target and arithmetic."""
    result = verify(folder, targets=names)
    return {(e["name"], e["numeric"]): e for e in result["targets"]}


def with_flags(name: str, *flags: str) -> Target:
    """A target with more flags; the last one of contradicting flags holds."""
    target = all_targets()[name]
    return target.model_copy(update={"flags": (*target.flags, *flags)})


def ran_and_differed(entry: dict[str, Any]) -> bool:
    """The program ran to its end and its results differ: what a negative control must show."""
    return entry["status"] == "fail" and "error" not in entry and entry["mismatches"] > 0
