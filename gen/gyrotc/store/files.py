"""A single file that is there as it was, or whole and new."""

from __future__ import annotations

import json
import os
import stat
from pathlib import Path

from ..common.errors import InputError
from .interrupts import deferred
from .lock import Lock
from .opening import create, open_stream, write_own

__all__ = ["check_replaceable", "sync_folder", "unfinished", "write_atomically"]

_MOST_BYTES = 2**30  # 1 GiB: no result comes near it
_PAGE, _HEAD = b'<meta name="generator" content="gyrotc">', 1000  # a page, and where that stands in it
_EXPORTED = (
    b"# gyrotc: ",
    b"serial,axis,temperature_c,slope_c_per_min,bias_dph",
    b"/* gyrotc: ",
    b'<?xml version="1.0" encoding="UTF-8"?>\n<!-- gyrotc: ',
)  # fmt: skip; how exports begin
_UNIT, _MADE_BY = (
    b"PK\x03\x04",
    b'generationTool="gyrotc"',
)  # an FMU: a ZIP file, its description first and as it is

unfinished: list[Path] = []
"""Folders that this process is writing; they are put on disk and into their places as a whole."""


def write_atomically(path: Path, data: str | bytes) -> None:
    """Writes a file under a temporary name beside it and renames it into place, on disk when this returns.

    A device or a pipe is written as it is; a link is replaced, and where it led stays as it was.

    Raises:
        InputError: A file that gyrotc did not write has a name that it needs meanwhile; nobody reads the pipe.
        OSError: It cannot be written; then what was there still is.
    """
    content = data.encode("utf-8") if isinstance(data, str) else data
    try:
        if _is_stream(path):
            with open_stream(path) as stream:
                stream.write(content)
            return
        path = path.parent.resolve() / path.name
        path.parent.mkdir(parents=True, exist_ok=True)
        if any(folder in path.parents for folder in unfinished):
            write_own(path, content)
        else:
            _replace(path, content)
    except OSError as error:
        error.filename = error.filename or str(path)
        raise


def _replace(path: Path, content: bytes) -> None:
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
                    stream.write(content)
                    stream.flush()
                    os.fsync(stream.fileno())
                part.replace(path)
                sync_folder(path.parent)
            finally:
                part.unlink(missing_ok=True)
        finally:
            lock.release()


def check_replaceable(path: Path) -> None:
    """Refuses to replace a file, named by `--json`, `--plots` or `export --out`, that gyrotc did not write.

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
            if _PAGE in head or head.startswith(_EXPORTED) or (head.startswith(_UNIT) and _MADE_BY in head):
                return
        content = json.loads(path.read_bytes()) if path.stat().st_size < _MOST_BYTES else None
    except FileNotFoundError:
        return
    except (ValueError, RecursionError):
        content = None
    parts = [content, *(content.values() if isinstance(content, dict) else ())]
    if not any(isinstance(p, dict) and str(p.get("schema", "")).startswith("gyrotc.") for p in parts):
        raise InputError(
            str(path), "exists and was not written by gyrotc", "a new name, or an earlier result"
        )


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
