"""`SHA256SUMS`: what gyrotc wrote into a folder, so that `sha256sum -c` checks it and only this is ever removed.

The first line is a comment to sha256sum; it says what kind of result it is, of which gyro, and which folders inside
have a marker of their own. Names that stand in a marker are compared with names found in the folder; none is opened
or removed because a marker names it. A part is followed only where it leads to a folder inside.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import stat
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import __version__
from ..common.errors import InputError
from .files import create, sha256, sync_folder

if TYPE_CHECKING:
    from typing_extensions import Self

MARKER = "SHA256SUMS"
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
    "fleet": "runtime",
}
"""Kind of folder that a command writes."""

_NEXT = f".{MARKER}"  # a marker that is being written
_HEAD = "# gyrotc "
_LINE = re.compile(r"(\\?)([0-9a-f]{64}) [ *](.+)")
_MOST_BYTES = 2**26  # 64 MiB: a marker of half a million files


@dataclass(frozen=True, slots=True)
class Marker:
    """The files of a folder that gyrotc wrote, and the result that they are.

    Attributes:
        kind: One of `KINDS`, `trace` (traces outside a result) or `board test`.
        command: Command that wrote the folder last.
        serial: Serial number of the gyro; None if the folder is not of one gyro.
        axis: Axis; None if the folder is not of one axis.
        parts: Paths of folders inside with a marker of their own (an axis, a diagnosis).
        finished: True if the job that made the folder came to its end.
        files: SHA-256 of every file that gyrotc wrote, by its path in the folder, without markers and parts.
    """

    kind: str
    command: str
    serial: str | None = None
    axis: str | None = None
    parts: tuple[str, ...] = ()
    finished: bool = True
    files: dict[str, str] = field(default_factory=dict)

    def but(self, **changed: Any) -> Self:
        """Return a copy with other values in some fields."""
        return replace(self, **changed)

    def text(self) -> str:
        """Return the text of the file: a line that says whose it is, then lines of `sha256sum`."""
        head = {
            "version": __version__,
            "kind": self.kind,
            "command": self.command,
            "serial": self.serial,
            "axis": self.axis,
            "parts": sorted(self.parts),
            "finished": self.finished,
        }
        lines = (_line(name, digest) for name, digest in sorted(self.files.items()))
        return f"{_HEAD}{json.dumps(head)}\n" + "".join(lines)


def _line(name: str, digest: str) -> str:
    escaped = name.replace("\\", "\\\\").replace("\n", "\\n").replace("\r", "\\r")
    mark = "\\" if escaped != name else ""
    return f"{mark}{digest}  {escaped}\n"


_ESCAPES = {"\\\\": "\\", "\\n": "\n", "\\r": "\r"}


def _file_of(line: str) -> tuple[str, str]:
    """Return the path and the hash that a line states.

    Raises:
        ValueError: The line is none of a list of hashes.
    """
    found = _LINE.fullmatch(line)
    if found is None:
        raise ValueError(f"{line[:80]!r} is no line of it")
    escaped, digest, name = found.groups()
    return (re.sub(r"\\.", lambda m: _ESCAPES.get(m[0], m[0]), name) if escaped else name), digest


def read_marker(folder: Path) -> Marker | None:
    """Read the marker of a folder; None if it has none.

    Raises:
        InputError: The marker is damaged, or gyrotc did not write it.
    """
    path = folder / MARKER
    try:
        facts = path.lstat()
        if not stat.S_ISREG(facts.st_mode) or facts.st_size > _MOST_BYTES:
            raise ValueError("no regular file of a likely size")
        head, *lines = path.read_text(encoding="utf-8").split("\n")
        if not head.startswith(_HEAD) or lines[-1:] != [""]:
            raise ValueError(f"it does not begin with {_HEAD.strip()!r}, or ends within a line")
        said = json.loads(head[len(_HEAD) :])
        texts = {name: said[name] for name in ("kind", "command", "serial", "axis")}
        if not all(isinstance(text, str | None) for text in texts.values()):
            raise ValueError("its first line is not as gyrotc writes it")
        parts = tuple(_checked_part(folder, part) for part in said["parts"])
        files = dict(map(_file_of, lines[:-1]))
        return Marker(**texts, parts=parts, finished=said["finished"] is True, files=files)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(str(path), f"is no marker of a result ({error})", "the list that gyrotc wrote") from error


def _checked_part(folder: Path, part: str) -> str:
    """Check that a part is a folder inside: a forged marker may name one of the user's own.

    Raises:
        ValueError: The path leads elsewhere.
    """
    names = part.split("/")
    if not all(names) or {".", ".."} & set(names) or "\0" in part:
        raise ValueError(f"a part is {part[:80]!r}, which is no folder inside")
    if (folder / part).is_symlink() or not (folder / part).parent.resolve().is_relative_to(folder.resolve()):
        raise ValueError(f"the part {part[:80]!r} lies behind a link")
    return part


def write_marker(folder: Path, marker: Marker) -> None:
    """Write the marker of a folder in one step; it is on disk when this returns.

    Raises:
        OSError: The marker cannot be written.
    """
    new = folder / _NEXT
    new.unlink(missing_ok=True)
    with create(new) as stream:
        stream.write(marker.text().encode("utf-8"))
        stream.flush()
        os.fsync(stream.fileno())
    new.replace(folder / MARKER)
    sync_folder(folder)


def walk(folder: Path, parts: Collection[str] = ()) -> Iterator[str]:
    """Yield the paths of all that is in a folder except its marker and its parts; an empty folder ends with a slash.

    Links are not followed.
    """

    def fails(error: OSError) -> None:
        raise error

    for place, folders, files in os.walk(folder, onerror=fails):
        inside = Path(place).relative_to(folder)
        if not folders and not files and inside.parts:
            yield f"{inside.as_posix()}/"
        for name in files:
            if inside.parts or name not in (MARKER, _NEXT):
                yield (inside / name).as_posix()
        for name in list(folders):
            path = (inside / name).as_posix()
            if path in parts:
                folders.remove(name)
            elif (folder / path).is_symlink():
                folders.remove(name)
                yield path


def described(folder: Path, marker: Marker) -> Marker:
    """Return a marker with the hashes of all files in a folder; puts them on disk and removes empty folders."""
    files = {}
    for name in walk(folder, marker.parts):
        path = folder / name
        if not name.endswith("/"):
            files[name] = sha256(path, sync=True)
            continue
        while path != folder and not any(path.iterdir()):
            path.rmdir()
            path = path.parent
    return marker.but(files=files, finished=True)


def top(name: str) -> str:
    """Return the first name of a path."""
    return name.split("/", 1)[0]


def survey_folder(folder: Path, marker: Marker, entries: Collection[str] | None = None) -> tuple[list[str], list[str]]:
    """List the files of a folder that gyrotc did not write, and those that it wrote and somebody changed.

    Args:
        entries: Names in the folder to look at; None: all.
    """
    foreign, edited = [], []
    for name in walk(folder, marker.parts):
        known = marker.files.get(name)
        if entries is not None and top(name) not in entries:
            continue
        if known is None:
            foreign.append(name)
        elif not _is(folder / name, known):
            edited.append(name)
    for part in marker.parts:
        if (folder / part).is_dir() and (entries is None or top(part) in entries):
            own = read_marker(folder / part) or Marker(marker.kind, marker.command)
            for found, more in zip((foreign, edited), survey_folder(folder / part, own), strict=True):
                found.extend(f"{part}/{name}" for name in more)
    return sorted(foreign), sorted(edited)


def result_faults(folder: Path) -> list[str]:
    """List what keeps a folder from being a complete result as it was written, a line each.

    Files that gyrotc did not write are no fault.
    """
    marker = read_marker(folder)
    if marker is None or not marker.finished:
        return ["no marker" if marker is None else "unfinished"]
    found = [f"{name}: missing or changed" for name, known in marker.files.items() if not _is(folder / name, known)]
    return found + [f"{part}/{fault}" for part in marker.parts for fault in result_faults(folder / part)]


_AS_WRITTEN = "a folder as gyrotc wrote it; make it again"


def check_intact(folder: Path, names: Collection[str], *, needed: bool = True) -> None:
    """Refuse a result of which a file is missing, or is not as gyrotc wrote it.

    Args:
        names: Paths of the files and folders in it to look at; the example, which users edit, is passed over.
        needed: True if a folder without a marker is refused, too.

    Raises:
        InputError: A file is missing, changed or not of gyrotc.
    """
    marker = read_marker(folder)
    if marker is None:
        if needed:
            raise InputError(str(folder), f"has no {MARKER}", _AS_WRITTEN)
        return
    for name, known in sorted(marker.files.items()):
        if _among(name, names) and name != EXAMPLE and not _is(folder / name, known):
            found = "is not as gyrotc wrote it" if os.path.lexists(folder / name) else "is missing"
            raise InputError(str(folder / name), found, _AS_WRITTEN)
    for part in marker.parts:
        inside = [name[len(part) + 1 :] for name in names if name.startswith(f"{part}/")]
        if inside and not _among(part, names):
            check_intact(folder / part, inside)
    for name in names:
        listed = name in marker.files or any(_among(name, [part]) for part in marker.parts)
        if not listed and os.path.lexists(folder / name) and not (folder / name).is_dir():
            raise InputError(str(folder / name), "was not written by gyrotc", _AS_WRITTEN)


EXAMPLE = "c/main.c"
"""Path of the example, which a user may change in a result."""


def _among(name: str, names: Collection[str]) -> bool:
    return any(name == other or name.startswith(f"{other}/") for other in names)


def _is(path: Path, known: str) -> bool:
    return path.is_file() and not path.is_symlink() and sha256(path) == known


def remove_listed(folder: Path) -> bool:
    """Remove what gyrotc wrote into a folder, and the folder if nothing else is in it.

    A job that was killed left no list of its files; the name of its folder was known to it alone, so all of it goes.

    Returns:
        True if the folder is gone; False if it holds files that gyrotc did not write, or that were changed.
    """
    try:
        marker = read_marker(folder)
    except InputError:
        return False
    if marker is None:
        return _remove_empty(folder)
    if not marker.finished:
        shutil.rmtree(folder)
        return True
    for part in marker.parts:
        if (folder / part).is_dir():
            remove_listed(folder / part)
    for name in list(walk(folder, marker.parts)):
        if name in marker.files and _is(folder / name, marker.files[name]):
            (folder / name).unlink()
    return _remove_empty(folder)


def _remove_empty(folder: Path) -> bool:
    """Remove a folder that holds nothing but folders and its marker; return whether it was one."""
    if any(not name.endswith("/") for name in walk(folder)):
        return False
    for place, _, _ in os.walk(folder, topdown=False):
        if Path(place) != folder:
            Path(place).rmdir()
    for name in (_NEXT, MARKER):
        (folder / name).unlink(missing_ok=True)
    folder.rmdir()
    return True
