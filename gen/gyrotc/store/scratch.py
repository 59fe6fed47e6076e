"""Folders for work that is thrown away: what a killed job left of them is removed by the next that needs one."""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_PREFIX = ".gyrotc-scratch-"
_NAME = re.compile(re.escape(_PREFIX) + r"[a-z0-9_]{8}")  # as `tempfile` makes it


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """An empty folder, this user's alone, in the place for temporary files; gone with all that is in it afterwards.

    Its job holds a lock on it (`flock`). One that nobody holds is of a job that was killed, and is removed here.

    Raises:
        OSError: There is no place for temporary files, or no space in it.
    """
    _clean()
    folder, lock = _made()
    try:
        with folder:
            yield Path(folder.name)
    finally:
        os.close(lock)


def _made() -> tuple[tempfile.TemporaryDirectory[str], int]:
    """A new folder and the handle that locks it."""
    while True:
        folder = tempfile.TemporaryDirectory(prefix=_PREFIX)
        with suppress(FileNotFoundError):  # another job took it for left over before it was locked
            lock = os.open(folder.name, os.O_RDONLY | os.O_DIRECTORY)
            with suppress(OSError):  # no locks here; then none can be locked to be removed, either
                fcntl.flock(lock, fcntl.LOCK_SH)
            if Path(folder.name).exists():
                return folder, lock
            os.close(lock)
        folder.cleanup()


def _clean() -> None:
    """Removes what jobs of this user left that are dead."""
    with os.scandir(tempfile.gettempdir()) as entries:
        left = [entry.path for entry in entries if _NAME.fullmatch(entry.name)]
    for path in left:
        with suppress(OSError):  # another's, gone, held, or not to be locked
            _remove_if_dead(path)


def _remove_if_dead(path: str) -> None:
    handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        if _is_own(os.fstat(handle)):
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(path)
    finally:
        os.close(handle)


def _is_own(status: os.stat_result) -> bool:
    """Whether it is as `tempfile` made it: of this user, and for this user alone."""
    return status.st_uid == os.getuid() and stat.S_IMODE(status.st_mode) == stat.S_IRWXU
