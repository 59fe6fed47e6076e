"""What a result depends on, as hashes of contents: times and sizes of files say nothing."""

from __future__ import annotations

import functools
import os
import stat
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Any

from .. import __version__, _core
from ..common.runtime import runtime_folders
from .jsontext import digest_of
from .marker import sha256

__all__ = ["inputs_of", "program_of"]

_COMPUTING = ("numpy", "scipy", "pyarrow")  # libraries that a model's figures come out of


@functools.cache
def program_of() -> str:
    """SHA-256 of the program: the package, its compiled core, the C runtime, and what they compute with."""
    here = Path(__file__).resolve().parents[1]
    parts: list[Any] = [__version__, {name: metadata.version(name) for name in _COMPUTING}]
    for folder in (here, *runtime_folders()):
        files = (path for path in _regular(folder) if "__pycache__" not in path.parts)
        parts.append({path.relative_to(folder).as_posix(): sha256(path) for path in files})
    return digest_of([*parts, sha256(Path(_core.__file__))])


def inputs_of(dataset: Path) -> dict[str, str]:
    """Every file of a data set by its path in it, with the SHA-256 of its contents, or why it cannot be read."""
    found = {}
    for path in _regular(dataset):
        try:
            found[str(path.relative_to(dataset))] = sha256(path)
        except OSError as error:
            found[str(path.relative_to(dataset))] = str(error.strerror)
    return found


def _regular(folder: Path) -> Iterator[Path]:
    """Regular files below a folder in the order of their names; each folder once, also behind links."""
    seen = set()
    for root, folders, names in os.walk(folder, followlinks=True):
        here = Path(root).stat()
        if (here.st_dev, here.st_ino) in seen:
            folders.clear()
            continue
        seen.add((here.st_dev, here.st_ino))
        folders.sort()
        yield from (path for name in sorted(names) if _is_regular(path := Path(root) / name))


def _is_regular(path: Path) -> bool:
    try:
        return stat.S_ISREG(path.stat().st_mode)
    except OSError:
        return False
