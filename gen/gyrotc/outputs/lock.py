"""One job at a time writes to a place: a lock file beside it says who. The lock of a dead process is free."""

from __future__ import annotations

import fcntl
import json
import os
import socket
import time
from pathlib import Path

from ..errors import InputError
from .jsontext import json_text

__all__ = ["Lock"]


class Lock:
    """`.<name>.lock` beside a place, held by `flock` from construction until `release`.

    A second job is refused, for it would replace what the first has just made; `wait` is for a single file, which
    is written in a moment.

    Raises:
        InputError: Another job holds it.
        OSError: The folder that the place lies in cannot be written.
    """

    def __init__(self, place: Path, command: str, *, wait: bool = False) -> None:
        self._path = place.parent / f".{place.name}.lock"
        while True:
            self._file = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o644)
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
                if self._still_there():
                    break
            except BlockingIOError:
                holder = _holder(self._file)
                os.close(self._file)
                found = f"another job writes there: {holder}"
                raise InputError(str(place), found, "its end, or another place") from None
            except BaseException:
                os.close(self._file)
                raise
            os.close(self._file)
        try:
            os.ftruncate(self._file, 0)
            os.pwrite(self._file, _who(command).encode(), 0)
        except BaseException:
            self.release()
            raise

    def _still_there(self) -> bool:
        """Whether the file that is locked is the one of this name: its last holder may have removed it."""
        try:
            return os.path.samestat(os.fstat(self._file), self._path.stat())
        except FileNotFoundError:
            return False

    def release(self) -> None:
        """Removes the file while it is held, then lets go."""
        try:
            self._path.unlink(missing_ok=True)
        finally:
            os.close(self._file)


def _who(command: str) -> str:
    since = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime())
    who = {"command": command, "pid": os.getpid(), "host": socket.gethostname(), "since": since}
    return json_text(who)


def _holder(file: int) -> str:
    """Who holds a lock, as far as its file says."""
    try:
        who = json.loads(os.pread(file, 4096, 0))
        return f"gyrotc {who['command']}, process {who['pid']} on {who['host']}, since {who['since']}"
    except (OSError, ValueError, KeyError, TypeError):
        return "a job that has just begun"
