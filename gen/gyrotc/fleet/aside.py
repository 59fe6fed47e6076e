"""A unit's folder before its job: what somebody changed is set aside, what dead jobs left is removed."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from ..common.errors import InputError
from ..store.folder import clean, leftovers
from ..store.lock import Lock
from ..store.marker import read_marker, survey

__all__ = ["clean_units", "set_aside"]


def set_aside(place: Path) -> str:
    """A result in which somebody changed a file makes room for a new one, under a name of its own.

    Returns:
        That name; empty if there was no such result.

    Raises:
        InputError: A job is writing there.
    """
    if not place.exists() or not _changed(place):
        return ""
    lock = Lock(place, "fleet")
    try:
        names = (f"{place.name}.changed-{k}" for k in itertools.count(1))
        other = next(path for name in names if not (path := place.with_name(name)).exists())
        place.rename(other)
    finally:
        lock.release()
    return other.name


def _changed(place: Path) -> bool:
    try:
        marker = read_marker(place)
        return marker is not None and bool(survey(place, marker)[1])
    except InputError:  # the marker itself is damaged
        return True


def clean_units(out: Path, names: Sequence[str]) -> None:
    """Removes what jobs that were killed left beside results in a fleet's folder; of these names also their locks."""
    for name in leftovers(out, names):
        with suppress(InputError):  # a job is at work there
            clean(out / name)
