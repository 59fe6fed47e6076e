"""A single file that is there as it was, or whole and new."""

from __future__ import annotations

import json
import os
import stat
from pathlib import Path

from ..errors import InputError
from .interrupts import deferred
from .lock import Lock

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

    A device or a pipe is written as it is.

    Raises:
        OSError: It cannot be written; then what was there still is.
    """
    content = data.encode("utf-8") if isinstance(data, str) else data
    try:
        if _is_device(path):
            with path.open("wb", buffering=0) as stream:
                stream.write(content)
            return
        path = path.resolve()
        path.parent.mkdir(parents=True, exist_ok=True)
        if any(folder in path.parents for folder in unfinished):
            path.write_bytes(content)
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
            part.unlink(missing_ok=True)  # of a job that was killed
            with part.open("xb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            part.replace(path)
            sync_folder(path.parent)
        finally:
            try:
                part.unlink(missing_ok=True)
            finally:
                lock.release()


def check_replaceable(path: Path) -> None:
    """Refuses to replace a file, named by `--json`, `--plots` or `export --out`, that gyrotc did not write.

    Raises:
        InputError: There is such a file, or a folder.
    """
    if _is_device(path):
        return
    try:
        if path.stat().st_size == 0:
            return
        if not path.is_file():
            raise InputError(str(path), "is a folder", "the name of a file")
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


def _is_device(path: Path) -> bool:
    try:
        mode = path.stat().st_mode
    except OSError:
        return False
    return not stat.S_ISREG(mode) and not stat.S_ISDIR(mode)


def sync_folder(folder: Path) -> None:
    """Names in a folder are on disk when this returns, where the file system can do that."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
