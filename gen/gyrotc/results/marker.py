"""`.gyrotc-result.json`: what gyrotc wrote into a folder, and so where a result may go and what may be removed.

Names that stand in a marker are compared with names found in the folder; none is ever opened or removed because
a marker names it. Parts are followed: `read_marker` takes none that leads out of the folder.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import stat
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

from .. import __version__
from ..common.errors import InputError
from .base import Marker, checked_result
from .files import json_text

MARKER = ".gyrotc-result.json"
MARKER_SCHEMA = Marker.schema_id()
KINDS = {
    "build": "result",
    "fit": "result",
    "emit": "result",
    "verify": "result",
    "evaluate": "result",
    "diagnose": "diagnosis",
    "compare": "comparison",
    "simulate": "data set",
    "import": "data set",
    "certificate": "certificate",
    "fleet": "fleet",
}
"""Kind of folder that a command writes."""

NEW = ".gyrotc-new"
OWN = frozenset((MARKER, NEW, ".gyrotc-try-1", ".gyrotc-try-2"))
"""Names by which gyrotc keeps its books in a folder: the marker, one being written, what exchanges are tried on."""

_AS_WRITTEN = "a folder as gyrotc wrote it; make it again"
_FREE = frozenset(("c/main.c",))  # the user's
_ANYBODYS = "model.json"  # has a checksum of its own, and emit works beside one that came from elsewhere
_MOST_BYTES = 2**26  # 64 MiB: a marker of half a million files


def marker_of(kind: str = "", command: str = "") -> Marker:
    """A marker of no files yet, of no one gyro."""
    return Marker(gyrotc_version=__version__, kind=kind, command=command, serial=None, axis=None, files={}, parts=())


def marker_text(marker: Marker) -> str:
    """The text of a marker's file; this gyrotc is its writer."""
    return json_text(marker.model_copy(update={"gyrotc_version": __version__}).content())


def read_marker(folder: Path) -> Marker | None:
    """The marker of a folder; None if it has none.

    Raises:
        InputError: It is damaged.
    """
    path = folder / MARKER
    try:
        facts = path.lstat()
        if not stat.S_ISREG(facts.st_mode) or facts.st_size > _MOST_BYTES:
            raise ValueError("no regular file of a likely size")
        marker = checked_result(json.loads(path.read_text(encoding="utf-8")), Marker, MARKER)
        parts = tuple(_checked_part(folder, part) for part in marker.parts)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (InputError, ValueError, RecursionError) as error:
        raise InputError(str(path), f"is no marker of a result ({error})", f"a marker, {MARKER_SCHEMA}") from error
    return marker.but(parts=parts)


def _checked_part(folder: Path, part: str) -> str:
    """A folder inside, by a path that leads nowhere else: whoever wrote the marker may have meant one of the user's.

    Raises:
        ValueError: It is not.
    """
    names = part.split("/")
    if not all(names) or {".", ".."} & set(names) or "\0" in part:
        raise ValueError(f"a part is {part[:80]!r}, which is no folder inside")
    if not is_inside(folder, part):
        raise ValueError(f"the part {part[:80]!r} lies behind a link")
    return part


def is_inside(folder: Path, name: str) -> bool:
    """Whether no link on the way to a path in a folder leads out of it."""
    return (folder / name).parent.resolve().is_relative_to(folder.resolve())


def sha256(path: Path, *, sync: bool = False) -> str:
    """SHA-256 of a file; with `sync` the file is on disk when this returns."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(2**20):
            digest.update(block)
        if sync:
            os.fsync(file.fileno())
    return digest.hexdigest()


def walk(folder: Path, parts: tuple[str, ...] = ()) -> Iterator[str]:
    """Paths of all that is in a folder but its marker and its parts; an empty folder ends with a slash."""
    skipped = {*parts, *(Path(p).parent.joinpath(_target(folder / p)).as_posix() for p in parts)}

    def fails(error: OSError) -> None:
        raise error

    for place, folders, files in os.walk(folder, onerror=fails):
        inside = Path(place).relative_to(folder)
        if not folders and not files and inside.parts:
            yield f"{inside.as_posix()}/"
        for name in files:
            if inside.parts or name not in OWN:
                yield (inside / name).as_posix()
        for name in list(folders):
            path = (inside / name).as_posix()
            if (folder / path).is_symlink() and path not in skipped:
                yield path
            if path in skipped or (folder / path).is_symlink():
                folders.remove(name)


def _target(part: Path) -> str:
    """Name of the folder beside a part that the part is a link to (see `folder._Job._point`), or its own."""
    target = str(part.readlink()) if part.is_symlink() else part.name
    return target if target.startswith(f".{part.name}.gyrotc-part-") and "/" not in target else part.name


def survey_folder(folder: Path, marker: Marker, entries: frozenset[str] | None = None) -> tuple[list[str], list[str]]:
    """What is in a folder and not of gyrotc, and what gyrotc wrote and somebody changed: two lists of paths.

    Args:
        entries: Look at these names in the folder only.
    """
    foreign: list[str] = []
    edited: list[str] = []
    for name in walk(folder, marker.parts):
        if entries is not None and name.split("/", 1)[0] not in entries:
            continue
        known = marker.known(name)
        if not known:
            foreign.append(name)
        elif not _is(folder / name, known):
            edited.append(name)
    for part in marker.parts:
        if not (folder / part).is_dir() or (entries is not None and part.split("/", 1)[0] not in entries):
            continue
        own = read_marker(folder / part) or marker_of()
        for found, more in zip((foreign, edited), survey_folder(folder / part, own), strict=True):
            found.extend(f"{part}/{name}" for name in more)
    return sorted(foreign), sorted(edited)


def result_faults(folder: Path) -> list[str]:
    """What keeps a folder from being a complete result as it was written: a line for each; empty if it is one.

    Files that gyrotc did not write are no fault. A file is whole also where a killed job has replaced some of
    the folder's entries: each entry is then as before or as after.
    """
    marker = read_marker(folder)
    if marker is None or marker.unfinished:
        return ["no marker" if marker is None else "unfinished"]
    found = []
    here = set(walk(folder, marker.parts))
    for entry in sorted(marker.entries() | set(marker.pending)):
        versions = [{n: h for n, h in marker.files.items() if n.split("/", 1)[0] == entry}]
        versions += [marker.pending[entry]] if entry in marker.pending else []
        listed = here & {name for version in versions for name in version}
        if not any(
            listed == set(version) and all(_is(folder / name, {h}) for name, h in version.items())
            for version in versions
        ):
            found.append(f"{entry}: missing or changed")
    for part in marker.parts:
        found += [f"{part}/{fault}" for fault in result_faults(folder / part)]
    return found


def check_intact(folder: Path, names: Collection[str], *, needed: bool = True) -> None:
    """Refuses a result of which a file is missing, or is not as gyrotc wrote it.

    Args:
        names: Paths of files and folders in it; others are not looked at, nor is what a user may make his own.
        needed: A folder without a marker is refused, too.

    Raises:
        InputError: One is.
    """
    marker = read_marker(folder)
    if marker is None:
        if needed:
            raise InputError(str(folder), f"has no {MARKER}", _AS_WRITTEN)
        return
    if marker.unfinished or marker.pending:
        raise InputError(str(folder), "is not whole: a job was killed in it", "that command again")
    for name, known in sorted(marker.files.items()):
        if _among(name, names) and name not in _FREE and not _is(folder / name, {known}):
            found = "is not as gyrotc wrote it" if os.path.lexists(folder / name) else "is missing"
            raise InputError(str(folder / name), found, _AS_WRITTEN)
    for part in marker.parts:
        inside = [name[len(part) + 1 :] for name in names if name.startswith(f"{part}/")]
        if inside and not _among(part, names):
            check_intact(folder / part, inside)
    for name in names:
        listed = name in (*marker.files, _ANYBODYS) or any(_among(name, [part]) for part in marker.parts)
        if not listed and os.path.lexists(folder / name) and not (folder / name).is_dir():
            raise InputError(str(folder / name), "was not written by gyrotc", _AS_WRITTEN)


def _among(name: str, names: Collection[str]) -> bool:
    return any(name == other or name.startswith(f"{other}/") for other in names)


def _is(path: Path, known: set[str]) -> bool:
    return path.is_file() and not path.is_symlink() and sha256(path) in known


def remove_listed(folder: Path) -> list[str]:
    """Removes what gyrotc wrote into a folder, and the folder if nothing else is in it.

    Returns:
        Paths that are left because gyrotc did not write them, or not like this.
    """
    try:
        marker = read_marker(folder) or marker_of()
    except InputError:
        marker = marker_of()
    if marker.unfinished:
        for path in folder.iterdir():
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            elif path.name not in OWN:
                path.unlink()
        _remove_empty(folder)
        return []
    left = []
    for part in marker.parts:
        path = folder / part
        target = path.with_name(_target(path))
        if target.is_dir() and not target.is_symlink():
            left += [f"{part}/{name}" for name in remove_listed(target)]
        if path.is_symlink() and not target.exists():
            path.unlink()
    for name in list(walk(folder, marker.parts)):
        known = marker.known(name)
        if known and _is(folder / name, known):
            (folder / name).unlink()
        elif not name.endswith("/"):
            left.append(name)
    if not left:
        _remove_empty(folder)
    return left


def _remove_empty(folder: Path) -> None:
    """The folders inside, then the marker, then the folder: a kill between leaves what is recognisably gyrotc's."""
    for place, _, _ in os.walk(folder, topdown=False):
        if Path(place) != folder:
            Path(place).rmdir()
    for name in (*sorted(OWN - {MARKER}), MARKER):
        (folder / name).unlink(missing_ok=True)
    folder.rmdir()


_PACKAGE = Path(__file__).resolve().parents[1]
_SHOWN = 3  # names in a message


def final_place(out: Path) -> Path:
    """Where `out` is: links are followed, but for one that gyrotc made, to a folder beside it."""
    place = out.parent.resolve() / out.name if out.name not in ("", "..") else out.resolve()
    if place.is_symlink() and not str(place.readlink()).startswith(prefix_of(place)):
        return place.resolve()
    return place


def prefix_of(place: Path) -> str:
    """How the names begin that jobs give, beside a place, to what is not in it yet or any more."""
    return f".{place.name}.gyrotc-part-"


def check_separate(out: Path, place: Path, inputs: Sequence[Path], *, whole: bool) -> None:
    """Refuses an `out` that is a file, or is, holds or lies in what the job reads or gyrotc's own sources.

    Args:
        whole: The folder is replaced. A job that only adds to it may stand above: a project with its `.venv`.

    Raises:
        InputError: It is.
    """
    if place.exists() and not place.is_dir():
        raise InputError(str(out), "is a file", "the name of a folder")
    if place.parent == place or place.is_mount():
        raise InputError(str(out), "is the root of a file system", "a folder inside it")
    named = [(path, "the data set") for path in inputs] + [(path, "gyrotc's sources") for path in _sources()]
    for path, name in named:
        other = Path(os.path.realpath(path))  # resolve() raises for a loop of links until Python 3.13
        if place == other:
            raise InputError(str(out), f"is {name}", "a folder beside it")
        if whole and place in other.parents:
            raise InputError(str(out), f"is above {name} ({path})", "a folder of its own")
        if other in place.parents:
            raise InputError(str(out), f"lies inside {name} ({path})", "a folder outside it")


def _sources() -> list[Path]:
    root = _PACKAGE.parents[1]
    checkout = [root / name for name in ("gen", "libc", "include")]
    return checkout if all(path.is_dir() for path in checkout) else [_PACKAGE]


def check_contents(out: Path, place: Path, kind: str | None, entries: frozenset[str] | None) -> Marker | None:
    """The marker of what stands at `place`, once it is seen that gyrotc wrote all of it, or all of its `entries`.

    Raises:
        InputError: Something there would be lost that gyrotc did not write, or it is another kind of result.
    """
    if not place.exists():
        return None
    marker = read_marker(place)
    if marker is None:
        names = sorted(path.name for path in place.iterdir())
        lost = names if entries is None else sorted(set(names) & entries)
        if lost:
            found = f"exists and was not written by gyrotc (no {MARKER}): {_some(lost)}"
            raise InputError(str(out), found, "a new folder or one with a result; move or delete what is there")
        return None
    if kind is not None and marker.kind != kind:
        found = f"holds the {marker.kind} of gyrotc {marker.command}"
        raise InputError(str(out), found, f"a new folder, or a {kind}")
    foreign, edited = survey_folder(place, marker, entries)
    if foreign:
        found = f"holds what gyrotc did not write: {_some(foreign)}"
        raise InputError(str(out), found, "nothing else in a result that is replaced; move it away")
    if edited:
        found = f"was changed since gyrotc wrote it: {_some(edited)}"
        raise InputError(str(out), found, "a result as it was written; move the changed file away or delete it")
    return marker


def check_same_serial(out: Path, marker: Marker | None, serial: str) -> None:
    """Refuses to put a result of one gyro into the place of another's.

    Raises:
        InputError: It would.
    """
    if marker is not None and marker.serial not in (None, serial) and marker.kind in _OF_ONE_GYRO:
        found = f"holds the result of serial {marker.serial}, and this is of {serial}"
        raise InputError(str(out), found, "another folder; or delete the earlier result first")


_OF_ONE_GYRO = frozenset((KINDS["build"], KINDS["diagnose"], KINDS["compare"]))


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(names[:_SHOWN]) + more
