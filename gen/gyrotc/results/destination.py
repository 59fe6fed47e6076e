"""Check that a result may be written to a place: a new folder, or an earlier result that is gyrotc's alone."""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from pathlib import Path

from ..common.errors import InputError
from .marker import MARKER, Marker, read_marker, survey_folder

_PACKAGE = Path(__file__).resolve().parents[1]
_SHOWN = 3  # names in a message


def real_path(path: Path) -> Path:
    """Return a path with all links followed; a loop of links is no error."""
    return Path(os.path.realpath(path))  # resolve() raises for a loop until Python 3.13


def check_separate(out: Path, inputs: Sequence[Path] = ()) -> None:
    """Refuse an `out` that is a file, or that is, contains or lies in an input of the job or gyrotc's own sources.

    Raises:
        InputError: `out` is one of these.
    """
    place = real_path(out)
    if place.exists() and not place.is_dir():
        raise InputError(str(out), "is a file", "the name of a folder")
    if place.parent == place or place.is_mount():
        raise InputError(str(out), "is the root of a file system", "a folder inside it")
    named = [(path, "the data set") for path in inputs] + [(path, "gyrotc's sources") for path in _sources()]
    for path, name in named:
        other = real_path(path)
        if place == other:
            raise InputError(str(out), f"is {name}", "a folder beside it")
        if place in other.parents:
            raise InputError(str(out), f"is above {name} ({path})", "a folder of its own")
        if other in place.parents:
            raise InputError(str(out), f"lies inside {name} ({path})", "a folder outside it")


def _sources() -> list[Path]:
    root = _PACKAGE.parents[1]
    checkout = [root / name for name in ("gen", "libc", "include")]
    return checkout if all(path.is_dir() for path in checkout) else [_PACKAGE]


def check_contents(out: Path, kind: str | None, entries: Collection[str] | None) -> Marker | None:
    """Check that gyrotc wrote all that would be replaced at `out`, and return the marker of what stands there.

    Args:
        kind: Kind of folder that it must be; None: any.
        entries: Names in it that are replaced; None: all.

    Raises:
        InputError: A file that gyrotc did not write would be lost, or it is another kind of folder.
    """
    place = real_path(out)
    if not place.exists():
        return None
    marker = read_marker(place)
    if marker is None:
        names = sorted(path.name for path in place.iterdir())
        if names:
            found = f"exists and was not written by gyrotc (no {MARKER}): {_some(names)}"
            raise InputError(str(out), found, "a new folder or one with a result; move or delete what is there")
        return None
    if kind is not None and marker.kind != kind:
        found = f"holds the {marker.kind} of gyrotc {marker.command}"
        raise InputError(str(out), found, f"a new folder, or a {kind}")
    foreign, edited = survey_folder(place, marker, entries)
    if foreign:
        found = f"holds what gyrotc did not write: {_some(foreign)}"
        raise InputError(str(out), found, "nothing else in what is replaced; move it away")
    if edited:
        found = f"was changed since gyrotc wrote it: {_some(edited)}"
        raise InputError(str(out), found, "a result as it was written; move the changed file away or delete it")
    return marker


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(names[:_SHOWN]) + more
