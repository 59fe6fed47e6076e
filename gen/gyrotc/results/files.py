"""Write single files: a file is replaced as a whole, or stays as it was."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import stat
from pathlib import Path
from typing import BinaryIO

from ..common.errors import InputError
from .place import held, part_of, parts_beside
from .signals import deferred

_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC


def create(path: Path) -> BinaryIO:
    """Create a new file and open it for writing.

    Raises:
        FileExistsError: The name is taken, even if by a link that leads nowhere.
        OSError: The file cannot be created.
    """
    return os.fdopen(os.open(path, _NEW, 0o666), "wb")


def write_own(path: Path, data: str | bytes) -> None:
    """Write a file into a folder that this job made for itself; it replaces one that the job wrote there before.

    Raises:
        OSError: The file cannot be written.
    """
    path.unlink(missing_ok=True)
    with create(path) as stream:
        stream.write(data.encode("utf-8") if isinstance(data, str) else data)


def sha256(path: Path, *, sync: bool = False) -> str:
    """Return the SHA-256 of a file; with `sync` the file is on disk when this returns."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(2**20):
            digest.update(block)
        if sync:
            os.fsync(file.fileno())
    return digest.hexdigest()


def sync_folder(folder: Path) -> None:
    """Put the names in a folder on disk, if the file system can."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


unfinished: list[Path] = []
"""Folders that this process is writing; each is put on disk and into its place as a whole."""


def write_atomically(path: Path, data: str | bytes, more: bytes = b"") -> None:
    """Write a file under a temporary name and rename it into place; it is on disk when this returns.

    `more` follows `data`. A device or a pipe is written directly; a link is replaced, and its target stays as it was.

    Raises:
        InputError: Something else has the name of the lock, or nobody reads the pipe.
        OSError: The file cannot be written; the earlier one stays.
    """
    content = data.encode("utf-8") if isinstance(data, str) else data
    try:
        if _is_stream(path):
            with _open_stream(path) as stream:
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
    with deferred(), held(path, wait=True):
        for left in parts_beside(path):  # of a job that was killed
            if left.is_file() and not left.is_symlink():
                left.unlink()
        part = part_of(path)
        try:
            with create(part) as stream:
                stream.writelines(content)
                stream.flush()
                os.fsync(stream.fileno())
            part.replace(path)
            sync_folder(path.parent)
        finally:
            part.unlink(missing_ok=True)


_MOST_BYTES = 2**30  # 1 GiB: no result comes near it
_PAGE, _HEAD = b'<meta name="generator" content="gyrotc">', 1000  # a page, and where that stands in it
_MAP = b"serial,axis,temperature_c,slope_c_per_min,bias_dph"  # how a map in CSV begins


def check_replaceable(path: Path) -> None:
    """Refuse to replace a file that gyrotc did not write (`--json`, `--map`).

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
    """Test whether a path is a device or a pipe; behind a link only if the link is the system's, as `/dev/stdout`."""
    try:
        mode = path.stat().st_mode
    except OSError:
        return False
    known = not path.is_symlink() or path.parent.resolve().parts[1:2] in (("dev",), ("proc",))
    return known and not stat.S_ISREG(mode) and not stat.S_ISDIR(mode)


def _open_stream(path: Path) -> BinaryIO:
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
