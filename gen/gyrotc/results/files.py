"""Single files: opened for writing in one place, replaced whole or not at all; JSON as gyrotc writes it.

Signals that end a job are raised where it can clean up, and held back while a result changes places.
"""

from __future__ import annotations

import errno
import fcntl
import functools
import hashlib
import json
import os
import signal
import socket
import stat
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, BinaryIO

from ..common.errors import InputError

_NESTED = (dict, list, tuple)
_SERIES = 32  # numbers; a longer list stands in one line: a third of its bytes were line ends and blanks


def json_text(content: Any) -> str:
    """The text of a JSON file: one blank for each level, long lists of numbers in one line, a line end at the end.

    Raises:
        ValueError: A number is not finite.
    """
    return _text(content, 0) + "\n"


def _text(content: Any, level: int) -> str:
    """As `json.dumps(content, indent=1)` but for series; that goes value by value in Python: ten times as long.

    What holds no list or object itself is written in one go, with line ends for blanks.
    """
    if not isinstance(content, _NESTED) or not content:
        return _encoder(level).encode(content)
    inner = content.values() if isinstance(content, dict) else content
    kinds = set(map(type, inner))  # few, however many numbers there are
    line, last = "\n" + " " * (level + 1), "\n" + " " * level
    if not any(issubclass(kind, _NESTED) for kind in kinds):
        if len(content) > _SERIES and not isinstance(content, dict) and not any(issubclass(k, str) for k in kinds):
            return _line().encode(content)
        text = _encoder(level).encode(content)
        return text[0] + line + text[1:-1] + last + text[-1]
    if not isinstance(content, dict):
        return "[" + line + ("," + line).join(_text(part, level + 1) for part in content) + last + "]"
    if not all(isinstance(key, str) for key in content):
        raise TypeError("a key of an object is text")
    parts = (f"{_encoder(0).encode(key)}: {_text(part, level + 1)}" for key, part in content.items())
    return "{" + line + ("," + line).join(parts) + last + "}"


@functools.cache
def _encoder(level: int) -> json.JSONEncoder:
    """Writes lists and objects that hold plain values, one a line."""
    return json.JSONEncoder(allow_nan=False, separators=(",\n" + " " * (level + 1), ": "))


@functools.cache
def _line() -> json.JSONEncoder:
    return json.JSONEncoder(allow_nan=False, separators=(",", ":"))


def canonical_json(content: Any) -> bytes:
    """What a hash is taken of: sorted keys, no blanks, ASCII.

    Raises:
        ValueError: A number is not finite.
    """
    return json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False).encode("ascii")


def digest_of(content: Any) -> str:
    """SHA-256 of the canonical form, hexadecimal. Raises as that."""
    return hashlib.sha256(canonical_json(content)).hexdigest()


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
        raise InputError(str(path), "is a pipe that nobody reads", "a reader, or the name of a file") from None
    os.set_blocking(handle, True)
    return os.fdopen(handle, "wb", buffering=0)


_MOST_LOCK_BYTES = 4096  # of a lock: names of a command and a host, a number and a time are far fewer


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
        text = os.pread(self._file, _MOST_LOCK_BYTES + 1, 0)
        if len(text) > _MOST_LOCK_BYTES or (text.strip(b"\0") and _parsed(text) is None):
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
        who = _parsed(os.pread(file, _MOST_LOCK_BYTES, 0))
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


_MOST_BYTES = 2**30  # 1 GiB: no result comes near it
_PAGE, _HEAD = b'<meta name="generator" content="gyrotc">', 1000  # a page, and where that stands in it
_MAP = b"serial,axis,temperature_c,slope_c_per_min,bias_dph"  # how a map in CSV begins

unfinished: list[Path] = []
"""Folders that this process is writing; they are put on disk and into their places as a whole."""


def write_atomically(path: Path, data: str | bytes, more: bytes = b"") -> None:
    """Writes a file under a temporary name beside it and renames it into place, on disk when this returns.

    `more` comes behind `data`.

    A device or a pipe is written as it is; a link is replaced, and where it led stays as it was.

    Raises:
        InputError: A file that gyrotc did not write has a name that it needs meanwhile; nobody reads the pipe.
        OSError: It cannot be written; then what was there still is.
    """
    content = data.encode("utf-8") if isinstance(data, str) else data
    try:
        if _is_stream(path):
            with open_stream(path) as stream:
                stream.write(content + more)
            return
        path = path.parent.resolve() / path.name
        path.parent.mkdir(parents=True, exist_ok=True)
        if any(folder in path.parents for folder in unfinished):
            write_own(path, content + more)
        else:
            _replace(path, content, more)
    except OSError as error:
        error.filename = error.filename or str(path)
        raise


def _replace(path: Path, *content: bytes) -> None:
    with deferred():
        lock = Lock(path, "output", wait=True)
        part = path.with_name(f".{path.name}.gyrotc-part")
        try:
            if lock.inherited:
                part.unlink(missing_ok=True)
            try:
                stream = create(part)
            except FileExistsError:
                found = "is in the way, and gyrotc did not write it"
                raise InputError(str(part), found, "nothing of that name; move it away") from None
            try:
                with stream:
                    stream.writelines(content)
                    stream.flush()
                    os.fsync(stream.fileno())
                part.replace(path)
                sync_folder(path.parent)
            finally:
                part.unlink(missing_ok=True)
        finally:
            lock.release()


def check_replaceable(path: Path) -> None:
    """Refuses to replace a file, named by `--json` or `--map`, that gyrotc did not write.

    Raises:
        InputError: There is such a file, a folder, or a link to a device or a pipe.
    """
    if _is_stream(path):
        return
    try:
        if not path.is_file() and path.exists():
            found = "is a folder" if path.is_dir() else "is a link to a device or a pipe"
            raise InputError(str(path), found, "the name of a file")
        if path.stat().st_size == 0:
            return
        with path.open("rb") as stream:
            head = stream.read(_HEAD)
            if _PAGE in head or head.startswith(_MAP):
                return
        content = json.loads(path.read_bytes()) if path.stat().st_size < _MOST_BYTES else None
    except FileNotFoundError:
        return
    except (ValueError, RecursionError):
        content = None
    parts = [content, *(content.values() if isinstance(content, dict) else ())]
    if not any(isinstance(p, dict) and str(p.get("schema", "")).startswith("gyrotc.") for p in parts):
        raise InputError(str(path), "exists and was not written by gyrotc", "a new name, or an earlier result")


def _is_stream(path: Path) -> bool:
    """Whether it is a device or a pipe; behind a link only where that is the system's, such as `/dev/stdout`."""
    try:
        mode = path.stat().st_mode
    except OSError:
        return False
    known = not path.is_symlink() or path.parent.resolve().parts[1:2] in (("dev",), ("proc",))
    return known and not stat.S_ISREG(mode) and not stat.S_ISDIR(mode)


def sync_folder(folder: Path) -> None:
    """Names in a folder are on disk when this returns, where the file system can do that."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interrupted(BaseException):
    """A signal asked the process to end. No `Exception`: nothing but clean-up may catch it."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


class _State:
    depth = 0
    waiting: int | None = None


def raise_on_signals() -> None:
    """From now on SIGINT, SIGTERM and SIGHUP raise `Interrupted` in the main thread; those ignored stay so."""
    for number in _ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _on_signal)


def _on_signal(number: int, _frame: FrameType | None) -> None:
    for other in _ENDING:  # the clean-up that now begins is not interrupted again
        signal.signal(other, signal.SIG_IGN)
    if _State.depth:
        _State.waiting = number
    else:
        raise Interrupted(number)


@contextmanager
def deferred() -> Iterator[None]:
    """Inside, a signal waits until the outermost block has ended. Other threads are never interrupted anyway."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _State.depth += 1
    try:
        yield
    finally:
        _State.depth -= 1
        if _State.depth == 0 and _State.waiting is not None:
            number, _State.waiting = _State.waiting, None
            raise Interrupted(number)


def die_of(number: int) -> None:
    """Ends the process by the signal itself, so that a shell sees 128 + number and stops its loop."""
    signal.signal(number, signal.SIG_DFL)
    os.kill(os.getpid(), number)
