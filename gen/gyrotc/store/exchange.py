"""Two names of one file system change places in one step, where the system can do that."""

from __future__ import annotations

import ctypes
import errno
import os
import sys
from collections.abc import Callable
from pathlib import Path

from .opening import write_own

__all__ = ["can_exchange", "exchange"]

_AT_FDCWD, _RENAME_EXCHANGE = -100, 2  # linux/fcntl.h, linux/fs.h
_RENAME_SWAP = 2  # sys/stdio.h of macOS
_NOT_HERE = (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP)


def exchange(first: Path, second: Path) -> bool:
    """Swaps two existing names; False where system or file system cannot (nothing is done then).

    Raises:
        OSError: It can, and it failed.
    """
    call = _call()
    if call is None:
        return False
    if call(os.fsencode(first), os.fsencode(second)) == 0:
        return True
    number = ctypes.get_errno()
    if number in _NOT_HERE:
        return False
    raise OSError(number, os.strerror(number), str(first), None, str(second))


def _call() -> Callable[[bytes, bytes], int] | None:
    library = ctypes.CDLL(None, use_errno=True)
    try:
        if sys.platform == "darwin":
            swap = library.renamex_np
            return lambda a, b: int(swap(a, b, ctypes.c_uint(_RENAME_SWAP)))
        rename = library.renameat2
    except AttributeError:
        return None
    return lambda a, b: int(rename(_AT_FDCWD, a, _AT_FDCWD, b, ctypes.c_uint(_RENAME_EXCHANGE)))


def can_exchange(folder: Path) -> bool:
    """Whether two names in `folder`, one of gyrotc's own, can be swapped: tried."""
    names = [folder / ".gyrotc-try-1", folder / ".gyrotc-try-2"]  # see marker.OWN
    try:
        for name in names:
            write_own(name, b"")
        return exchange(*names)
    finally:
        for name in names:
            name.unlink(missing_ok=True)
