"""The emitted files themselves: each must be, byte for byte, what the model gives.

`emit_texts` makes the files again in memory; nothing that lies in the folder has a say in what they should be, but for
the options in its record, and that is compared, too.
"""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from ..common.errors import CheckFailed, InputError
from ..model import Model
from ..results.verification import VerifiedFile
from ..tables.files import Emission, quantise_all
from ..tables.record import BESIDES, Options, read_options

__all__ = ["EDITABLE", "c_hash", "file_entries", "made_again"]

#: Files that a user may make their own: `verify --allow-edited`. All else is written by gyrotc alone.
EDITABLE = frozenset({"main.c"})
_SHOWN = 160  # characters of a line
_BEYOND = 2**16  # bytes that are read of a file beyond its right length


def c_hash(c_folder: Path) -> str:
    """SHA-256 over names and contents of the emitted files."""
    digest = hashlib.sha256()
    for path in sorted(p for p in c_folder.iterdir() if p.is_file() and p.name not in BESIDES):
        digest.update(f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest()


def made_again(c_folder: Path, model: Model) -> tuple[Options, Emission]:
    """Options and tables of an emitted folder. Where its record is damaged, those of `gyrotc emit` without options:
    the record is then among the files that differ.

    Raises:
        InputError: There is no emitted folder.
        CheckFailed: `emit` refuses the model.
    """
    if not c_folder.is_dir():
        raise InputError(str(c_folder), "is not there", "a folder that emit wrote")
    try:
        options = read_options(c_folder)
        return options, quantise_all(options.shifted(model), options.numeric)
    except (InputError, CheckFailed):
        options = Options()
        return options, quantise_all(model, None)


def file_entries(
    c_folder: Path, texts: Mapping[str, bytes], edited: Collection[str] = ()
) -> list[VerifiedFile]:
    """One entry for each file that should be there or is.

    Args:
        c_folder: The emitted folder.
        texts: What must lie there, by name.
        edited: Names of `EDITABLE` that may differ, but not be missing.
    """
    return list(_entries(c_folder, texts, edited))


def _entries(c_folder: Path, texts: Mapping[str, bytes], edited: Collection[str]) -> Iterator[VerifiedFile]:
    there = set(os.listdir(c_folder))  # noqa: PTH208 names, not paths
    for name, data in sorted(texts.items()):
        if name not in there:
            yield VerifiedFile(file=name, verdict="missing", status="fail", mismatches=1)
            continue
        found = _content(c_folder / name, len(data))
        if found == data:
            yield VerifiedFile(file=name, verdict="equal", status="pass", mismatches=0)
        else:
            yield _differing(name, found, data, allowed=name in edited)
    for name in sorted(there - set(texts) - BESIDES):
        yield VerifiedFile(file=name, verdict="foreign", status="fail", mismatches=1)


def _content(path: Path, length: int) -> bytes | None:
    """Bytes of a regular file, as many as are needed to compare; None for anything else, which is not opened."""
    try:
        if not stat.S_ISREG(path.lstat().st_mode):
            return None
        with path.open("rb") as file:
            return file.read(length + _BEYOND)
    except OSError:
        return None


def _differing(name: str, found: bytes | None, data: bytes, *, allowed: bool) -> VerifiedFile:
    """How much differs, and the first place: a line, or a word of an image."""
    if found is None:
        told = "no regular file that can be read"
        return VerifiedFile(file=name, verdict="differs", status="fail", mismatches=1, found=told)
    image = name.endswith(".bin")
    parts = _words if image else _lines
    got, want = parts(found), parts(data)
    pairs = zip(got, want, strict=False)
    wrong = [number for number, (a, b) in enumerate(pairs, 1) if a != b]
    first = wrong[0] if wrong else min(len(got), len(want)) + 1
    there, expected = (side[first - 1] if first <= len(side) else "nothing" for side in (got, want))
    return VerifiedFile(
        file=name,
        verdict="edited" if allowed else "differs",
        status="pass" if allowed else "fail",
        mismatches=len(wrong) + abs(len(got) - len(want)),
        found=there,
        expected=expected,
        **{"word" if image else "line": first},
    )


def _words(data: bytes) -> list[str]:
    """Words of an image in the order of its bytes."""
    return [data[start : start + 4].hex() for start in range(0, len(data), 4)]


def _lines(data: bytes) -> list[str]:
    """Lines as printable text; what is no ASCII, and a carriage return, shows as an escape."""
    return [_shown(line) for line in data.split(b"\n")]


def _shown(line: bytes) -> str:
    return line.decode("latin-1").encode("unicode_escape").decode("ascii")[:_SHOWN]
