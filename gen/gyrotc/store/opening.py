"""Every file that gyrotc writes is opened here: a new one, or one of its own; never through a link, never truncated."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO

from ..common.errors import InputError

__all__ = ["check_own", "create", "open_or_create", "open_stream", "write_own"]

_EXPECTED = "a regular file that gyrotc wrote, or none; move it away"
_NEW = os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC


def create(path: Path) -> BinaryIO:
    """A new file, open for writing.

    Raises:
        FileExistsError: The name is taken, be it by a link that leads nowhere.
        OSError: It cannot be made.
    """
    return os.fdopen(os.open(path, os.O_WRONLY | _NEW, 0o666), "wb")


def write_own(path: Path, data: str | bytes) -> None:
    """Writes a file into a folder that this job has made for itself, in place of one that it wrote there before.

    Raises:
        OSError: It cannot be written.
    """
    path.unlink(missing_ok=True)
    with create(path) as stream:
        stream.write(data.encode("utf-8") if isinstance(data, str) else data)


def open_or_create(path: Path) -> tuple[int, bool]:
    """A handle to read and write a file as it is, made empty where there is none; and whether it was there.

    What is in it is for the caller to judge before a byte is changed.

    Raises:
        InputError: A link, a folder, a pipe, a device, a file of another user or one with a second name is there.
        OSError: It cannot be opened.
    """
    while True:
        try:
            return os.open(path, os.O_RDWR | _NEW, 0o644), False
        except FileExistsError:
            pass
        try:
            check_own(path)
            handle = os.open(path, os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
        except FileNotFoundError:  # its owner has removed it meanwhile
            continue
        try:
            _refuse_foreign(path, os.fstat(handle))  # of what was really opened
        except BaseException:
            os.close(handle)
            raise
        return handle, True


def check_own(path: Path) -> None:
    """Refuses a file that gyrotc cannot have written; raises as `open_or_create`, and where there is none."""
    _refuse_foreign(path, path.lstat())


def _refuse_foreign(path: Path, facts: os.stat_result) -> None:
    if stat.S_ISLNK(facts.st_mode):
        found = "is a link"
    elif not stat.S_ISREG(facts.st_mode):
        found = "is no regular file"
    elif facts.st_uid != os.geteuid():
        found = "is another user's"
    elif facts.st_nlink > 1:
        found = "has another name elsewhere (a hard link)"
    else:
        return
    raise InputError(str(path), found, _EXPECTED)


def open_stream(path: Path) -> BinaryIO:
    """A device or a pipe that the user has named, open for writing, unbuffered.

    Raises:
        InputError: It is a pipe that nobody reads: it would wait for ever.
        OSError: It cannot be opened.
    """
    try:
        handle = os.open(path, os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    except OSError as error:
        if error.errno != errno.ENXIO:
            raise
        raise InputError(
            str(path), "is a pipe that nobody reads", "a reader, or the name of a file"
        ) from None
    os.set_blocking(handle, True)
    return os.fdopen(handle, "wb", buffering=0)
