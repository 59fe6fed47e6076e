"""A place: a name at which a file or a folder appears whole. Lock it, and name what lies beside it meanwhile."""

from __future__ import annotations

import os
import re
import secrets
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from ..common.errors import InputError

_PART = ".gyrotc-part-"  # in the names, beside a place, of files and folders that are not yet or no longer in it


def part_of(place: Path) -> Path:
    """Return a new name beside a place, for what a job makes before it takes the place."""
    return place.with_name(f".{place.name}{_PART}{secrets.token_hex(4)}")


def parts_beside(place: Path) -> list[Path]:
    """List what lies beside a place under such names, in their order. Call it only while the place is held."""
    own = re.compile(re.escape(f".{place.name}{_PART}") + "[0-9a-f]{8}")
    return sorted(path for path in place.parent.iterdir() if own.fullmatch(path.name))


def unfinished_beside(folder: Path, names: Sequence[str]) -> set[str]:
    """Return the names in a folder that a job, dead or alive, has not finished, and those of `names` that are held."""
    hidden = {path.name[1:] for path in folder.iterdir() if path.name.startswith(".")}
    unfinished = {name.partition(_PART)[0] for name in hidden if _PART in name}
    return unfinished | {name for name in names if f"{name}{_LOCK}" in hidden}


_LOCK = ".lock"


@contextmanager
def held(place: Path, *, wait: bool = False) -> Iterator[None]:
    """Hold a place: no other job of gyrotc writes there meanwhile. `.<name>.lock` beside it is locked, and removed.

    Raises:
        InputError: Another job writes there, or something else has the name of the lock.
        OSError: The folder that the place lies in cannot be written.
    """
    path = place.with_name(f".{place.name}{_LOCK}")
    _check_lock(path)
    lock = FileLock(path, timeout=-1 if wait else 0, mode=0o644)
    try:
        lock.acquire()
    except Timeout:
        raise InputError(str(place), "another job writes there", "its end, or another place") from None
    try:
        yield
    finally:
        path.unlink(missing_ok=True)  # a job that waits for this file finds out, and locks a new one
        lock.release()


def _check_lock(path: Path) -> None:
    """Refuse anything but an empty file of this user at the name of a lock; there may be none."""
    try:
        facts = path.lstat()
    except FileNotFoundError:
        return
    if not stat.S_ISREG(facts.st_mode) or facts.st_size or facts.st_nlink > 1 or facts.st_uid != os.geteuid():
        raise InputError(str(path), "is no lock of gyrotc", "none; move it away")
