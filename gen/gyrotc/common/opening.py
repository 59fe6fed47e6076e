"""Files that somebody gives us are opened as regular files, and read no further than they were long when opened."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import BinaryIO

from .ceilings import refuse_above
from .errors import InputError

__all__ = ["open_input", "read_input"]

_KINDS = (
    (stat.S_ISDIR, "is a folder"),
    (stat.S_ISFIFO, "is a pipe"),
    (stat.S_ISSOCK, "is a socket"),
    (stat.S_ISCHR, "is a device"),
    (stat.S_ISBLK, "is a device"),
)


def open_input(path: Path, where: str, expected: str) -> tuple[BinaryIO, int]:
    """Opens a regular file (or a link to one) for reading, unbuffered.

    Anything else is not even opened: a pipe without a writer would wait for ever, and a device has no end.

    Args:
        path: The file.
        where: Its name in messages.
        expected: What it should be.

    Returns:
        The open file and its size, bytes. Reading stops there: what grows meanwhile, and what the kernel makes up
        under a size of 0 (`/proc/kmsg`), is not read.

    Raises:
        InputError: It does not exist, cannot be opened, or is no regular file.
    """
    try:
        _refuse_special(path.stat(), where, expected)
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY)
        try:
            facts = os.fstat(handle)  # of what was really opened
            _refuse_special(facts, where, expected)
            os.set_blocking(handle, True)
            return os.fdopen(handle, "rb", buffering=0), facts.st_size
        except BaseException:
            os.close(handle)
            raise
    except FileNotFoundError:
        raise InputError(where, "does not exist", expected) from None
    except (OSError, ValueError) as error:  # ValueError: a NUL byte in the name
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(where, f"cannot be read ({reason})", expected) from error


def _refuse_special(facts: os.stat_result, where: str, expected: str) -> None:
    if not stat.S_ISREG(facts.st_mode):
        found = next((text for is_one, text in _KINDS if is_one(facts.st_mode)), "is no regular file")
        raise InputError(where, found, expected)


def read_input(path: Path, ceiling_name: str, expected: str, where: str | None = None) -> bytes:
    """All bytes of a file.

    Args:
        path: The file.
        ceiling_name: Ceiling of its size, in MiB.
        expected: What it should be.
        where: Its name in messages; default the path.

    Raises:
        InputError: As `open_input`; or it is larger than the ceiling.
    """
    where = where or str(path)
    file, size = open_input(path, where, expected)
    with file:
        if size == 0:
            raise InputError(where, "is empty", expected)
        refuse_above(ceiling_name, size / 2**20, where, "MiB")
        parts = []
        try:
            while size > 0 and (part := file.read(size)):
                parts.append(part)
                size -= len(part)
        except OSError as error:
            raise InputError(where, f"cannot be read ({error.strerror})", expected) from error
    return b"".join(parts)
