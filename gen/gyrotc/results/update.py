"""Entries of a result folder are replaced in one step where the system can exchange two names."""

from __future__ import annotations

import ctypes
import errno
import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

from .base import Marker
from .files import create, sync_folder, write_own
from .marker import MARKER, NEW, OWN, marker_text, sha256, walk

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


def write_marker(work: Path, folder: Path, marker: Marker) -> None:
    """Writes a folder's marker, on disk; `work` is a folder of the job's own on the same file system."""
    new = work / NEW
    new.unlink(missing_ok=True)
    with create(new) as stream:
        stream.write(marker_text(marker).encode("utf-8"))
        stream.flush()
        os.fsync(stream.fileno())
    new.replace(folder / MARKER)
    sync_folder(folder)


class Update:
    """New entries of the folder `place`, which lie in `work`.

    One entry is exchanged by itself, between a marker that allows for both its versions and one with the new.
    More than one are exchanged with the whole folder, to whose new version the other files are linked; where
    the folder holds what is not gyrotc's, one after another.

    Args:
        earlier: The marker of `place`, if it has one.
        marker: Says what lies in `work`.
        entries: Names in `place` that belong to this job: those that were not written again are removed.
    """

    def __init__(
        self, place: Path, work: Path, earlier: Marker | None, marker: Marker, entries: frozenset[str]
    ) -> None:
        self._place, self._work = place, work
        self._before = _settled(place, earlier or marker.but(files={}, parts=()))
        self._marked = earlier is not None
        self._new = marker
        written = {path.name for path in work.iterdir()} - OWN
        self._changed = sorted(written | (entries & self._before.entries()))
        kept = {n: h for n, h in self._before.files.items() if _top(n) not in self._changed}
        parts = {part for part in self._before.parts if _top(part) not in self._changed}
        self._after = marker.but(files=kept | marker.files, parts=tuple(sorted(parts | set(marker.parts))))
        if earlier is not None:  # who made the folder, and of what gyro, unless this job says it anew
            self._after = self._after.but(kind=earlier.kind, command=earlier.command)
        if marker.serial is None:
            self._after = self._after.but(serial=self._before.serial, axis=self._before.axis)

    def commit(self, put: Callable[[], None]) -> None:
        """Puts the new entries into their places.

        Args:
            put: Puts `work` into the place as a whole.
        """
        several = len(self._changed) > 1 or not can_exchange(self._work)
        if self._marked and several and self._all_listed():
            self._link_others()
            write_marker(self._work, self._work, self._after)
            put()
        else:
            self._one_by_one()

    def _all_listed(self) -> bool:
        return all(self._before.known(name) for name in walk(self._place, self._before.parts))

    def _link_others(self) -> None:
        """The files that stay, under their names in the new folder too."""
        for name in walk(self._place):
            if _top(name) in self._changed:
                continue
            target = self._work / name
            if name.endswith("/"):
                target.mkdir(parents=True)
                continue
            target.parent.mkdir(parents=True, exist_ok=True)
            try:
                os.link(self._place / name, target, follow_symlinks=False)
            except OSError:  # a file system without hard links
                shutil.copy2(self._place / name, target, follow_symlinks=False)
        for folder, _, _ in os.walk(self._work):
            sync_folder(Path(folder))

    def _one_by_one(self) -> None:
        old, new = self._before, self._new
        later = {entry: _of(new, entry) for entry in self._changed}
        parts = tuple(sorted({*old.parts, *new.parts}))
        write_marker(self._work, self._work, new.but(pending={e: _of(old, e) for e in later}, parts=parts))
        write_marker(self._work, self._place, old.but(pending=later, parts=parts))
        for entry in self._changed:
            _swap(self._work / entry, self._place / entry)
        write_marker(self._work, self._place, self._after)


def _swap(new: Path, old: Path) -> None:
    """Afterwards each lies where the other was, or neither there."""
    if not os.path.lexists(new):
        old.rename(new)
    elif not os.path.lexists(old):
        new.rename(old)
    elif not exchange(new, old):
        if new.is_dir():
            old.rename(new.with_name(f"{new.name}.old"))
        new.replace(old)


def _settled(place: Path, marker: Marker) -> Marker:
    """The marker of a folder in which a killed job replaced some entries: what is there now."""
    if not marker.pending:
        return marker
    files = {n: h for n, h in marker.files.items() if _top(n) not in marker.pending}
    for name in walk(place, marker.parts):
        if _top(name) in marker.pending and (place / name).is_file():
            found = sha256(place / name)
            if found in marker.known(name):
                files[name] = found
    return marker.but(files=files, pending={})


def _of(marker: Marker, entry: str) -> dict[str, str]:
    return {name: digest for name, digest in marker.files.items() if _top(name) == entry}


def _top(name: str) -> str:
    return name.split("/", 1)[0]
