"""Where a result may go: into a new folder, or into the place of an earlier result that is all gyrotc's."""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from pathlib import Path

from ..common.errors import InputError
from .marker import MARKER, Marker, read_marker, survey_folder

_PACKAGE = Path(__file__).resolve().parents[1]
_SHOWN = 3  # names in a message


def real_path(path: Path) -> Path:
    """Where a path is when links are followed; also of a loop of links."""
    return Path(os.path.realpath(path))  # resolve() raises for a loop until Python 3.13


def check_separate(out: Path, inputs: Sequence[Path] = ()) -> None:
    """Refuses an `out` that is a file, or is, holds or lies in what the job reads or gyrotc's own sources.

    Raises:
        InputError: It is.
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
    """The marker of what stands at `out`, once it is seen that gyrotc wrote all that is replaced.

    Args:
        kind: What it must be; None: anything.
        entries: Names in it that are replaced; None: all.

    Raises:
        InputError: Something there would be lost that gyrotc did not write, or it is another kind of result.
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
