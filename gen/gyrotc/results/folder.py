"""A result folder: written beside its place, then exchanged with it in one step where the system can do that."""

from __future__ import annotations

import fcntl
import os
import re
import secrets
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from ..common.errors import GyrotcError, InputError
from .base import Marker
from .files import Lock, check_replaceable, deferred, sync_folder, unfinished, write_atomically, write_own
from .marker import (
    KINDS,
    MARKER,
    OWN,
    check_contents,
    check_same_serial,
    check_separate,
    final_place,
    is_inside,
    marker_of,
    marker_text,
    prefix_of,
    read_marker,
    remove_listed,
    result_faults,
    sha256,
    walk,
)
from .update import Update, can_exchange, exchange, write_marker

_open: list[_Job] = []
_EARLIER = ".old"


class Stage:
    """What a job sees of its output.

    Attributes:
        folder: Write here. It is empty at first; what is written takes its place at the end.
    """

    def __init__(self, folder: Path, job: _Job, part: str) -> None:
        self.folder = folder
        self._job = job
        self._part = part

    def of(self, serial: str, axis: str | None = None) -> None:
        """Says whose result it is: call it as soon as that is known, before the work.

        Raises:
            InputError: An earlier result there is another gyro's.
        """
        if not self._part:
            check_same_serial(self._job.out, self._job.earlier, serial)
        parts = self._job.parts
        parts[self._part] = parts[self._part].but(serial=serial, axis=axis)

    def stale(self) -> None:
        """Says that what else gyrotc wrote into the folder no longer holds: it is removed when the new files come.

        Raises:
            InputError: Some of it was changed since.
        """
        if not self._part:
            self._job.whole()


@contextmanager
def result_folder(
    out: Path,
    command: str,
    *,
    kind: str | None = None,
    entries: Iterable[str] | None = None,
    inputs: Sequence[Path] = (),
) -> Iterator[Stage]:
    """A folder to write into, which becomes `out` when the block ends well; else `out` stays as it was.

    Whoever reads `out` meanwhile, and whenever the job is killed, sees the earlier result or the new one.
    Inside another result folder of this process it is a part of that one: written there, placed with it.

    Args:
        out: Where the result goes.
        command: The command that writes it.
        kind: What kind of folder it becomes; default: the kind of the command. "" takes any kind that is there.
        entries: Names in `out` that are written; all else in it stays. None: the folder is replaced as a whole.
        inputs: What the job reads: `out` must lie outside of it.

    Raises:
        InputError: `out` holds what gyrotc did not write, or another kind of result; it is the same as, above or
            inside an input or gyrotc's sources; another job is writing there.
        GyrotcError: It cannot be written (disk full, no permission).
    """
    kind = KINDS[command] if kind is None else kind
    names = None if entries is None else frozenset(entries)
    outer = next((job for job in reversed(_open) if _within(out, job.work)), None)
    if outer is not None:
        yield outer.part(out, kind, command)
        return
    job: _Job | None = None
    try:
        with deferred():
            job = _Job(out, kind, command, names, inputs)
        yield Stage(job.work, job, "")
        job.prepare()
        with deferred():
            job.commit()
    except OSError as error:
        if isinstance(error, BrokenPipeError):
            raise
        raise GyrotcError(f"{error.filename or out}: {error.strerror or error}") from error
    finally:
        with deferred():
            if job is not None:
                job.end()


def write_result(path: Path, text: str) -> None:
    """Writes a JSON result or a page where the user asked for it; in a result folder it becomes one of its files.

    Raises:
        InputError: As `check_replaceable`.
    """
    check_replaceable(path)
    if not path.is_symlink() and read_marker(path.parent) is not None:
        with result_folder(path.parent, "json", kind="", entries=(path.name,)) as stage:
            write_atomically(stage.folder / path.name, text)
    else:
        write_atomically(path, text)


def _within(path: Path, folder: Path) -> bool:
    resolved = path.resolve()
    return resolved == folder or folder in resolved.parents


class _Job:
    """A folder that is being written, from the lock to its release."""

    def __init__(
        self, out: Path, kind: str, command: str, entries: frozenset[str] | None, inputs: Sequence[Path]
    ) -> None:
        self.out = out
        self.place = final_place(out)
        self._prefix = prefix_of(self.place)
        self._entries = entries
        check_separate(out, self.place, inputs, whole=entries is None)
        self.place.parent.mkdir(parents=True, exist_ok=True)
        self._lock = Lock(self.place, command)
        try:
            self._recover()
            _clean_beside(self.place)  # what dead jobs left, which held this lock
            self._clean_parts()
            self.earlier = check_contents(out, self.place, kind or None, entries)
            self.parts = {"": marker_of(kind or (self.earlier.kind if self.earlier else "result"), command)}
            self.work = self._begun = self._begin()
        except BaseException:
            self._lock.release()
            raise
        _open.append(self)
        unfinished.append(self.work)

    def _begin(self) -> Path:
        work = self.place.parent / f"{self._prefix}{secrets.token_hex(4)}"
        work.mkdir(mode=0o755)
        try:
            write_own(work / MARKER, marker_text(self.parts[""].but(unfinished=True)))
        except BaseException:
            (work / MARKER).unlink(missing_ok=True)
            work.rmdir()
            raise
        return work

    def part(self, path: Path, kind: str, command: str) -> Stage:
        """A result inside this one, with a marker of its own."""
        name = path.resolve().relative_to(self.work).as_posix()
        name = "" if name == "." else name
        path.mkdir(parents=True, exist_ok=True)
        self.parts.setdefault(name, marker_of(kind, command))
        return Stage(path, self, name)

    def whole(self) -> None:
        """From now on all that gyrotc wrote is replaced, not only the entries asked for."""
        if self._entries is not None and self.earlier is not None:
            names = self._entries | self.earlier.entries()
            self.earlier = check_contents(self.out, self.place, None, names)
            self._entries = names

    def prepare(self) -> None:
        """Gives what was written its markers, and sees to it that all is on disk."""
        tops = {path.name for path in self.work.iterdir()} - OWN
        if self._entries is not None and tops - self._entries:
            raise ValueError(f"{sorted(tops - self._entries)} is not among the entries of this job")
        for name in sorted(self.parts, reverse=True):
            self.parts[name] = _described(self.work / name, self.parts[name], self._parts_of(name))
            if name:
                write_marker(self.work, self.work / name, self.parts[name])
        for place, _, _ in os.walk(self.work):
            sync_folder(Path(place))

    def _parts_of(self, name: str) -> tuple[str, ...]:
        """Parts of a part, by their paths in it."""
        inside = f"{name}/" if name else ""
        return tuple(part[len(inside) :] for part in self.parts if part != name and part.startswith(inside))

    def commit(self) -> None:
        """Puts the work into its place; what was there before then lies in `work`."""
        if self._entries is None or not self.place.exists():
            write_marker(self.work, self.work, self.parts[""])
            self._put()
        else:
            Update(self.place, self.work, self.earlier, self.parts[""], self._entries).commit(self._put)
        sync_folder(self.place.parent)

    def _put(self) -> None:
        """The whole folder, in one step."""
        linked = self.place.is_symlink()
        if not linked and not (self.place.exists() and any(self.place.iterdir())) and can_exchange(self.work):
            self.work.rename(self.place)
        elif linked or not self.place.exists() or not exchange(self.work, self.place):
            self._point()

    def _point(self) -> None:
        """Where names cannot be exchanged the place is a link, and links can be: a reader always finds a result."""
        link = self.work.with_name(f"{self.work.name}.link")
        link.symlink_to(self.work.name)
        old = self.place.readlink() if self.place.is_symlink() else None
        earlier = self.work.with_name(f"{self.work.name}{_EARLIER}")
        if old is None and self.place.exists():
            self.place.rename(earlier)
        link.replace(self.place)
        self.work = earlier if old is None else self.place.parent / old

    def end(self) -> None:
        """Removes what is left of the work, or of the earlier result, and releases the place."""
        _open.remove(self)
        unfinished.remove(self._begun)
        try:
            _clean_beside(self.place)
        finally:
            self._lock.release()

    def _recover(self) -> None:
        """A job that died between two renames (where names cannot be exchanged) left the place empty."""
        if not self.place.exists() and not self.place.is_symlink():
            for path in sorted(self.place.parent.iterdir()):
                if path.name.startswith(self._prefix) and path.name.endswith(_EARLIER) and not result_faults(path):
                    path.rename(self.place)
                    return

    def _clean_parts(self) -> None:
        """Removes what dead jobs left beside parts of a result that is replaced as a whole; none may be in work."""
        marker = read_marker(self.place) if self._entries is None and self.place.is_dir() else None
        for part in marker.parts if marker else ():
            place = self.place / part
            if place.parent.is_dir():
                clean(place)


def leftovers(folder: Path, names: Sequence[str] = ()) -> set[str]:
    """Names in a folder beside which jobs, at work or dead, left a folder; and those of `names` that have a lock."""
    hidden = {path.name[1:] for path in folder.iterdir() if path.name.startswith(".")}
    parted = (name.partition(prefix_of(Path())[1:]) for name in hidden)
    return {name for name, found, _ in parted if found} | {name for name in names if f"{name}.lock" in hidden}


def clean(place: Path) -> None:
    """Removes what dead jobs left beside a place.

    Raises:
        InputError: A job is writing there.
    """
    lock = Lock(place, "clean")
    try:
        _clean_beside(place)
    finally:
        lock.release()


def _clean_beside(place: Path) -> None:
    current = place.readlink().name if place.is_symlink() else ""
    for path in sorted(place.parent.iterdir()):
        if not path.name.startswith(prefix_of(place)) or path.name == current:
            continue
        if path.is_symlink():
            path.unlink()
        elif path.is_dir() and _of_gyrotc(path):
            for name in remove_listed(path):
                _carry(path, place, name)
            if path.is_dir():
                remove_listed(path)


def _of_gyrotc(path: Path) -> bool:
    """Whether a leftover tells that gyrotc made it: by its marker, or as nothing but a marker ever was in it."""
    try:
        return read_marker(path) is not None or not any(path.iterdir())
    except InputError:
        return {p.name for p in path.iterdir()} <= OWN


def _carry(old: Path, place: Path, name: str) -> None:
    """What somebody put into a result while it was replaced goes on into the new one; nobody's file is lost."""
    source, target = old / name, place / name
    if target.is_file() and not source.is_symlink() and target.samefile(source):
        source.unlink()
    elif place.is_dir() and not target.exists() and not target.is_symlink() and is_inside(place, name):
        target.parent.mkdir(parents=True, exist_ok=True)
        source.rename(target)
    else:
        print(f"gyrotc: {source} was not written by gyrotc and is left there", file=sys.stderr)


def _described(folder: Path, marker: Marker, parts: tuple[str, ...]) -> Marker:
    """A marker with the hashes of what is in a folder; the files are on disk then, empty folders are gone."""
    files = {}
    for name in walk(folder, parts):
        path = folder / name
        if not name.endswith("/"):
            files[name] = sha256(path, sync=True)
            continue
        while path != folder and not any(path.iterdir()):
            path.rmdir()
            path = path.parent
    return marker.but(files=files, parts=parts)


_PREFIX = ".gyrotc-scratch-"
_NAME = re.compile(re.escape(_PREFIX) + r"[a-z0-9_]{8}")  # as `tempfile` makes it


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """An empty folder, this user's alone, in the place for temporary files; gone with all that is in it afterwards.

    Its job holds a lock on it (`flock`). One that nobody holds is of a job that was killed, and is removed here.

    Raises:
        OSError: There is no place for temporary files, or no space in it.
    """
    _clean()
    folder, lock = _made()
    try:
        with folder:
            yield Path(folder.name)
    finally:
        os.close(lock)


def _made() -> tuple[tempfile.TemporaryDirectory[str], int]:
    """A new folder and the handle that locks it."""
    while True:
        folder = tempfile.TemporaryDirectory(prefix=_PREFIX)
        with suppress(FileNotFoundError):  # another job took it for left over before it was locked
            lock = os.open(folder.name, os.O_RDONLY | os.O_DIRECTORY)
            with suppress(OSError):  # no locks here; then none can be locked to be removed, either
                fcntl.flock(lock, fcntl.LOCK_SH)
            if Path(folder.name).exists():
                return folder, lock
            os.close(lock)
        folder.cleanup()


def _clean() -> None:
    """Removes what jobs of this user left that are dead."""
    with os.scandir(tempfile.gettempdir()) as entries:
        left = [entry.path for entry in entries if _NAME.fullmatch(entry.name)]
    for path in left:
        with suppress(OSError):  # another's, gone, held, or not to be locked
            _remove_if_dead(path)


def _remove_if_dead(path: str) -> None:
    handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        if _is_own(os.fstat(handle)):
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(path)
    finally:
        os.close(handle)


def _is_own(status: os.stat_result) -> bool:
    """Whether it is as `tempfile` made it: of this user, and for this user alone."""
    return status.st_uid == os.getuid() and stat.S_IMODE(status.st_mode) == stat.S_IRWXU
