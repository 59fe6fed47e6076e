"""The manifest of a fleet: which data sets, and the options that all of them are built with."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from ..assess.limits import Limits, load_limits
from ..common.errors import GyrotcError, InputError, quoted
from ..common.inputs import read_toml, refuse_above, refused
from ..jobs.lot import load_lot
from ..recordings.fit_options import options_in
from ..recordings.loading import asked_axes
from ..results.base import Numeric
from ..results.marker import KINDS, read_marker
from ..train.fitting import FitOptions
from ..train.prior.use import prior_of

SUMMARY = ("fleet.json", "fleet.csv", "fleet.html")
"""Files of a summary, beside the folders of the units."""
RUNTIME = "runtime"
"""Folder of the runtime that all units share, beside theirs."""
OF_FLEET = (*SUMMARY, RUNTIME)
"""All that a fleet writes beside the folders of the units."""


@dataclass(frozen=True, slots=True)
class Unit:
    """One job: a data set, and the axis of three-axis recordings."""

    dataset: Path
    axis: str | None

    @property
    def folder(self) -> str:
        """Name of its result folder: as the user calls the data set, also where that is a link."""
        name = os.path.basename(os.path.abspath(self.dataset))  # noqa: PTH100, PTH119 (no links followed)
        return name + (f"-{self.axis}" if self.axis else "")

    @property
    def name(self) -> str:
        """Name of its result folder as it is shown."""
        return printable(self.folder)

    @property
    def refused(self) -> str:
        """Reason why no result folder may have this name; empty if it may."""
        if self.folder.casefold() in OF_FLEET:
            return "is a name in the folder of a fleet; give the data set another name"
        if not self.folder.strip("-xyz") or self.folder.startswith("."):
            return "a name that is empty or begins with a dot is no name for a result"
        return ""


@dataclass(frozen=True, slots=True)
class Fleet:
    """The units of a fleet and the options of their builds.

    `releases`: Reasons, by serial, for which units are released although a finding bars them.
    `skipped`: Folders of a folder that was given as a manifest that hold no recordings.
    """

    units: tuple[Unit, ...]
    options: FitOptions
    numerics: tuple[str, ...] | None
    limits: Limits | None
    releases: Mapping[str, str] = field(default_factory=dict)
    skipped: tuple[Path, ...] = ()


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


_Place = Annotated[str, Field(max_length=4096, pattern=r"^[^\x00-\x1f]+$")]


def _of_words(reason: str) -> str:
    if not reason.strip():
        raise ValueError("a reason in words")
    return reason


_Reason = Annotated[str, Field(max_length=1024), AfterValidator(_of_words)]
_Axis = Literal["x", "y", "z", "all"] | None


class _UnitEntry(_Part):
    dataset: _Place
    axis: _Axis = None


class _Manifest(_Part):
    schema_: Annotated[Literal[1], Field(alias="schema")]
    datasets: list[_Place] = []  # patterns of folders
    axis: _Axis = None  # of those
    unit: list[_UnitEntry] = []
    options: dict[str, Any] = {}
    numeric: Annotated[list[Numeric], Field(min_length=1)] | None = None
    limits: _Place | None = None
    lot: _Place | None = None
    release: dict[str, _Reason] = {}


def load_manifest(path: Path) -> Fleet:
    """Read a manifest; a folder is one too: each of its folders with recordings is a data set.

    Raises:
        InputError: It cannot be read, a field is wrong, nothing is named, or two results would have one name.
    """
    if path.is_dir():
        try:
            listed = sorted(path.iterdir())
        except OSError as error:
            raise InputError(str(path), f"cannot be read ({error.strerror})", "a folder of data sets") from error
        every = tuple(unit for folder in listed if _has_recordings(folder) for unit in _units(folder, None))
        skipped = tuple(place for place in listed if _is_empty(place))
        return _distinct(path, Fleet(every, FitOptions(), None, None, skipped=skipped))
    content = read_toml(path, "a manifest or a folder")
    try:
        manifest = _Manifest.model_validate(content)
    except ValidationError as error:
        raise refused(error, lambda field: f"{path}, field {field}", _Manifest) from error
    named = (
        *((folder, manifest.axis) for folder in _matching(path, manifest.datasets)),
        *((path.parent / entry.dataset, entry.axis) for entry in manifest.unit),
    )
    units = tuple(unit for folder, axis in named for unit in _units(folder, axis))
    limits = load_limits(path.parent / manifest.limits) if manifest.limits else None
    prior = prior_of(load_lot(path.parent / manifest.lot)) if manifest.lot else None
    options = FitOptions(**options_in(manifest.options, f"{path}, field options."), prior=prior)
    numerics = tuple(manifest.numeric) if manifest.numeric else None
    releases = {serial: " ".join(reason.split()) for serial, reason in manifest.release.items()}
    return _distinct(path, Fleet(units, options, numerics, limits, releases))


def _units(folder: Path, axis: str | None) -> Iterator[Unit]:
    """A unit for each axis that is asked for; where the recordings cannot tell their axes, the job will say why."""
    try:
        axes = asked_axes(folder, axis)
    except (GyrotcError, OSError):
        axes = (None,) if axis == "all" else (axis,)
    yield from (Unit(folder, name) for name in axes)


def _matching(path: Path, patterns: Sequence[str]) -> Iterator[Path]:
    for pattern in patterns:
        if Path(pattern).is_absolute() or ".." in Path(pattern).parts:
            raise InputError(f"{path}, field datasets", quoted(pattern), "a pattern below the manifest's folder")
        try:
            found = sorted(folder for folder in path.parent.glob(pattern) if _has_recordings(folder))
        except (IndexError, ValueError, OSError, RecursionError, NotImplementedError) as error:
            # ".", "a**", a name that no folder can have
            expected = "a pattern below the manifest's folder, e.g. 2026-*"
            raise InputError(f"{path}, field datasets", quoted(pattern), expected) from error
        if not found:
            raise InputError(f"{path}, field datasets", f"{quoted(pattern)} matches no folder of recordings")
        yield from found


def _has_recordings(folder: Path) -> bool:
    """Test whether a folder is a data set. One that cannot be read may be one: its job will say what is wrong."""
    if folder.name.startswith("."):
        return False
    try:
        if not folder.is_dir() or _is_result(folder):
            return False
        return (folder / "dataset.toml").is_file() or any(
            file.suffix.lower() in (".csv", ".parquet") for file in folder.iterdir()
        )
    except OSError:
        return True


def _is_empty(folder: Path) -> bool:
    """Test whether a folder that can be read, and is neither hidden nor a result, has no recordings."""
    if folder.name.startswith(".") or _has_recordings(folder):  # so does one that cannot be read
        return False
    return folder.is_dir() and not _is_result(folder)


def _is_result(folder: Path) -> bool:
    """Test whether gyrotc made a folder of recordings: a fleet's folder holds CSV files, too."""
    if (folder / SUMMARY[0]).is_file():
        return True
    try:
        marker = read_marker(folder)
    except InputError:
        return False
    return marker is not None and marker.kind != KINDS["simulate"]


def printable(text: str) -> str:
    r"""A name as it can be shown and written as UTF-8: bytes that are no character and controls as ``\x..``."""
    known = os.fsencode(text).decode("utf-8", "backslashreplace")
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in known)


def _distinct(path: Path, fleet: Fleet) -> Fleet:
    if not fleet.units:
        raise InputError(str(path), "names no data set", "one at least")
    refuse_above("units", len(fleet.units), str(path), "data sets")
    seen: dict[str, Path] = {}
    for unit in fleet.units:
        if unit.name in seen:
            raise InputError(
                str(path), f"{seen[unit.name]} and {unit.dataset} are both {unit.name}", "names that differ"
            )
        seen[unit.name] = unit.dataset
    return fleet
