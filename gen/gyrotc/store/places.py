"""Where a result may go: not over recordings, sources or anything else that gyrotc did not write."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..common.errors import InputError
from .marker import KINDS, MARKER, Marker, read_marker, survey

__all__ = ["check_apart", "check_contents", "check_serial", "final_place", "prefix_of"]

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


def check_apart(out: Path, place: Path, inputs: Sequence[Path], *, whole: bool) -> None:
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
        other = path.resolve()
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
            raise InputError(
                str(out), found, "a new folder or one with a result; move or delete what is there"
            )
        return None
    if kind is not None and marker.kind != kind:
        found = f"holds the {marker.kind} of gyrotc {marker.command}"
        raise InputError(str(out), found, f"a new folder, or a {kind}")
    foreign, edited = survey(place, marker, entries)
    if foreign:
        found = f"holds what gyrotc did not write: {_some(foreign)}"
        raise InputError(str(out), found, "nothing else in a result that is replaced; move it away")
    if edited:
        found = f"was changed since gyrotc wrote it: {_some(edited)}"
        raise InputError(
            str(out), found, "a result as it was written; move the changed file away or delete it"
        )
    return marker


def check_serial(out: Path, marker: Marker | None, serial: str) -> None:
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
