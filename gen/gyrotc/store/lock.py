"""One job at a time writes to a place: a lock file beside it says who. The lock of a dead process is free."""

from __future__ import annotations

import fcntl
import json
import os
import socket
import time
from pathlib import Path

from ..common.errors import InputError
from .jsontext import json_text
from .opening import open_or_create

__all__ = ["Lock"]

_MOST_BYTES = 4096  # of a lock: names of a command and a host, a number and a time are far fewer


class Lock:
    """`.<name>.lock` beside a place, held by `flock` from construction until `release`.

    A second job is refused, for it would replace what the first has just made; `wait` is for a single file, which
    is written in a moment.

    Attributes:
        inherited: Its last holder was killed; what that was writing may still be there.

    Raises:
        InputError: Another job holds it; what has its name is no lock of gyrotc.
        OSError: The folder that the place lies in cannot be written.
    """

    def __init__(self, place: Path, command: str, *, wait: bool = False) -> None:
        self._path = place.parent / f".{place.name}.lock"
        while True:
            self._file, self.inherited = open_or_create(self._path)
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
                if self._still_there():
                    self._refuse_foreign()
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
            return os.path.samestat(os.fstat(self._file), self._path.lstat())
        except FileNotFoundError:
            return False

    def _refuse_foreign(self) -> None:
        """A file of this name that says something else is left as it is; a power cut leaves nothing, or zeros."""
        text = os.pread(self._file, _MOST_BYTES + 1, 0)
        if len(text) > _MOST_BYTES or (text.strip(b"\0") and _parsed(text) is None):
            raise InputError(str(self._path), "is no lock of gyrotc", "none, or gyrotc's own; move it away")

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
        who = _parsed(os.pread(file, _MOST_BYTES, 0))
    except OSError:
        who = None
    if who is None:
        return "a job that has just begun"
    return f"gyrotc {who['command']}, process {who['pid']} on {who['host']}, since {who['since']}"


def _parsed(text: bytes) -> dict[str, object] | None:
    """What a lock file says; None where it is none."""
    try:
        who = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return who if isinstance(who, dict) and list(who) == ["command", "pid", "host", "since"] else None
