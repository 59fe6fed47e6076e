"""Write a result folder: it is made beside its place and exchanged with it in one step, so it is never half-written."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from ..common.errors import GyrotcError, InputError
from .destination import check_contents, check_separate, real_path
from .exchange import exchange
from .files import check_replaceable, sha256, sync_folder, unfinished, write_atomically
from .marker import (
    KINDS,
    MARKER,
    Marker,
    described,
    read_marker,
    remove_listed,
    result_faults,
    top,
    walk,
    write_marker,
)
from .place import held, part_of, parts_beside
from .signals import deferred

_open: list[_Job] = []


class Stage:
    """The folder that a job writes into.

    Attributes:
        folder: Path of the folder. It is empty at first; its content takes its place at the end of the job.
    """

    def __init__(self, folder: Path, job: _Job, part: str) -> None:
        self.folder = folder
        self._job = job
        self._part = part

    def of(self, serial: str, axis: str | None = None) -> None:
        """State whose result it is. Call it as soon as that is known, before the work.

        Raises:
            InputError: There is an earlier result of another gyro.
        """
        if not self._part:
            self._job.check_serial(serial)
        markers = self._job.markers
        markers[self._part] = markers[self._part].but(serial=serial, axis=axis)

    def stale(self) -> None:
        """State that everything else gyrotc wrote into the folder is out of date: it goes when the new files come.

        Raises:
            InputError: Some of it was changed since.
        """
        if not self._part:
            self._job.replace_all()


@contextmanager
def result_folder(
    out: Path,
    command: str,
    *,
    kind: str | None = None,
    entries: Collection[str] | None = None,
    inputs: Sequence[Path] = (),
) -> Iterator[Stage]:
    """Provide a folder to write into, which becomes `out` if the block ends well; else `out` stays as it was.

    A reader of `out` sees the earlier result or the new one, whenever he looks and whenever the job is killed. Inside
    another result folder of this process it is a part of that one: written there, and placed with it.

    Args:
        out: Place of the result.
        command: Command that writes it.
        kind: Kind of the folder; None: the kind of the command; "": any kind that is there.
        entries: Names in `out` that are written; everything else in it stays. None: the folder is replaced as a whole.
        inputs: Folders that the job reads; `out` must lie outside of them.

    Raises:
        InputError: `out` contains files that gyrotc did not write, or is another kind of result; it is the same as,
            above or inside an input or gyrotc's sources; another job is writing there.
        GyrotcError: The folder cannot be written (disk full, no permission).
    """
    kind = KINDS[command] if kind is None else kind
    outer = next((job for job in reversed(_open) if job.work in (real := real_path(out), *real.parents)), None)
    if outer is not None:
        yield outer.part(out, Marker(kind, command))
        return
    place = real_path(out)
    try:
        check_separate(out, inputs)
        with deferred():
            place.parent.mkdir(parents=True, exist_ok=True)
        with held(place):
            job = _Job(out, Marker(kind, command), entries)
            try:
                with deferred():
                    job.begin()
                yield Stage(job.work, job, "")
                job.describe()
                with deferred():
                    job.commit()
            finally:
                with deferred():
                    job.end()
    except OSError as error:
        if isinstance(error, BrokenPipeError):
            raise
        raise GyrotcError(f"{error.filename or out}: {error.strerror or error}") from error


def write_result(path: Path, text: str) -> None:
    """Write a JSON result or a page to a path of the user's; in a result folder it becomes one of its files.

    Raises:
        InputError: As `check_replaceable`.
    """
    check_replaceable(path)
    if not path.is_symlink() and (path.parent / MARKER).is_file() and read_marker(path.parent) is not None:
        with result_folder(path.parent, "json", kind="", entries=(path.name,)) as stage:
            write_atomically(stage.folder / path.name, text)
    else:
        write_atomically(path, text)


class _Job:
    """A folder that is being written while its place is held."""

    def __init__(self, out: Path, marker: Marker, entries: Collection[str] | None) -> None:
        self.out = out
        self.place = real_path(out)
        self.entries = None if entries is None else frozenset(entries)
        self.work = part_of(self.place)
        _recover(self.place)
        self.earlier = check_contents(out, marker.kind or None, self.entries)
        kind = marker.kind or (self.earlier.kind if self.earlier else "result")
        self.markers = {"": marker.but(kind=kind)}

    def begin(self) -> None:
        """Make the folder to work in, with a marker that says what it is."""
        self.work.mkdir(mode=0o755)
        _open.append(self)
        unfinished.append(self.work)
        write_marker(self.work, self.markers[""].but(finished=False))

    def check_serial(self, serial: str) -> None:
        """Refuse to put a result of one gyro into the place of another's; raises as `Stage.of`."""
        earlier = self.earlier
        if earlier is not None and earlier.serial not in (None, serial) and earlier.kind in _OF_ONE_GYRO:
            found = f"holds the result of serial {earlier.serial}, and this is of {serial}"
            raise InputError(str(self.out), found, "another folder; or delete the earlier result first")

    def part(self, path: Path, marker: Marker) -> Stage:
        """Begin a result inside this one, with a marker of its own."""
        name = real_path(path).relative_to(self.work).as_posix()
        name = "" if name == "." else name
        path.mkdir(parents=True, exist_ok=True)
        self.markers.setdefault(name, marker)
        return Stage(path, self, name)

    def replace_all(self) -> None:
        """Replace all that gyrotc wrote, not only the entries asked for."""
        if self.entries is not None and self.earlier is not None:
            self.earlier = check_contents(self.out, None, None)
            self.entries = None

    def describe(self) -> None:
        """Write the markers of what was written and of what stays of the earlier result; all is on disk then."""
        for name in sorted(self.markers, reverse=True):
            inside = f"{name}/" if name else ""
            parts = tuple(p[len(inside) :] for p in self.markers if p not in ("", name) and p.startswith(inside))
            found = described(self.work / name, self.markers[name].but(parts=parts))
            if not name and self.entries is not None and self.earlier is not None:
                found = self._with_earlier(found, self.earlier, self.entries)
            write_marker(self.work / name, found)
        for place, _, _ in os.walk(self.work):
            sync_folder(Path(place))

    def _with_earlier(self, new: Marker, earlier: Marker, entries: Collection[str]) -> Marker:
        """Link all that stays of the earlier folder into the new one, and return the marker of both."""
        written = {top(name) for name in (*new.files, *new.parts)}
        if beyond := written.difference(entries):
            raise ValueError(f"{sorted(beyond)} is not among the entries of this job")
        for name in walk(self.place):
            if top(name) in entries:
                continue
            path = self.work / name
            (path if name.endswith("/") else path.parent).mkdir(parents=True, exist_ok=True)
            if not name.endswith("/"):
                _link(self.place / name, path)
        kept = {name: digest for name, digest in earlier.files.items() if top(name) not in entries}
        parts = [part for part in earlier.parts if top(part) not in entries]
        who = new if new.serial is not None else earlier
        return earlier.but(
            serial=who.serial, axis=who.axis, files=kept | new.files, parts=tuple(sorted({*parts, *new.parts}))
        )

    def commit(self) -> None:
        """Put the work into its place; what was there before then lies in `work`."""
        if not self.place.exists():
            self.work.rename(self.place)
        elif not exchange(self.work, self.place):
            aside = part_of(self.place)
            self.place.rename(aside)  # a job that is killed here leaves both: `_recover`
            try:
                self.work.rename(self.place)
            except OSError:
                aside.rename(self.place)
                raise
            aside.rename(self.work)
        sync_folder(self.place.parent)

    def end(self) -> None:
        """Remove what is left of the work, or of the earlier result."""
        if self in _open:
            _open.remove(self)
            unfinished.remove(self.work)
        if self.work.exists():
            _remove(self.work, self.place)


_OF_ONE_GYRO = frozenset((KINDS["build"], KINDS["diagnose"], KINDS["compare"]))


def _link(source: Path, target: Path) -> None:
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError:  # a file system without hard links
        shutil.copy2(source, target, follow_symlinks=False)


def clean(place: Path) -> None:
    """Remove what dead jobs left beside a place.

    Raises:
        InputError: A job is writing there.
    """
    with held(place):
        _recover(place)


def _recover(place: Path) -> None:
    """Put a finished result into a place that a dead job left empty, and remove what the job left beside it."""
    parts = [path for path in parts_beside(place) if path.is_dir() and not path.is_symlink()]
    if parts and not place.exists():
        whole = next((path for path in parts if _is_whole(path)), None)
        if whole is not None:
            whole.rename(place)
            parts.remove(whole)
    for path in parts:
        _remove(path, place)
    marker = read_marker(place) if (place / MARKER).is_file() else None
    for part in marker.parts if marker else ():
        if (place / part).parent.is_dir() and parts_beside(place / part):
            clean(place / part)


def _is_same(path: Path, other: Path) -> bool:
    """Test whether two files are one, or equal; links are neither."""
    if path.is_symlink() or other.is_symlink() or not other.is_file():
        return False
    if path.samefile(other):
        return True
    return path.stat().st_size == other.stat().st_size and sha256(path) == sha256(other)


def _is_whole(path: Path) -> bool:
    try:
        return not result_faults(path)
    except InputError:
        return False


def _remove(path: Path, place: Path) -> None:
    """Remove a folder of a job; files that somebody else put into it are kept, under a visible name."""
    for name in list(walk(path)):
        if not name.endswith("/") and _is_same(path / name, place / name):
            (path / name).unlink()
    if remove_listed(path):
        return
    names = (place.with_name(f"{place.name}.left-{number}") for number in range(1, 1000))
    kept = next(name for name in names if not os.path.lexists(name))
    path.rename(kept)
    print(f"gyrotc: {kept} holds what was in {place} and gyrotc did not write", file=sys.stderr)


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Provide an empty folder of this user alone among the temporary files; it is removed with its content afterwards.

    Raises:
        OSError: There is no place for temporary files, or no space in it.
    """
    with tempfile.TemporaryDirectory(prefix="gyrotc-") as folder:
        yield Path(folder)
