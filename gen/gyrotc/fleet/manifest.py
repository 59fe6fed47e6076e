"""The manifest of a fleet: which data sets, and the options that all of them are built with."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..dataset import axes_of
from ..errors import InputError
from ..fitting import FitOptions
from ..inputs import read_toml, refuse_above
from ..limits import Limits, load_limits

__all__ = ["Fleet", "Unit", "load_manifest"]


@dataclass(frozen=True, slots=True)
class Unit:
    """One job: a data set, and the axis of three-axis recordings."""

    dataset: Path
    axis: str | None

    @property
    def name(self) -> str:
        """Name of its result folder."""
        return self.dataset.resolve().name + (f"-{self.axis}" if self.axis else "")


@dataclass(frozen=True, slots=True)
class Fleet:
    """What is to be done, and how."""

    units: tuple[Unit, ...]
    options: FitOptions
    numerics: tuple[str, ...] | None
    limits: Limits | None


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


_Place = Annotated[str, Field(max_length=4096, pattern=r"^[^\x00-\x1f]+$")]


class _UnitEntry(_Part):
    dataset: _Place
    axis: Literal["x", "y", "z", "all"] | None = None


class _Options(_Part):
    method: str = "mrbf"
    seed: Annotated[int, Field(ge=0, le=2**63 - 1)] = 0
    centers: Annotated[int, Field(ge=0, le=512)] | None = None
    rho: Annotated[float, Field(ge=0.0, le=1.0)] | None = None
    block_s: Annotated[float, Field(ge=0.001, le=3600.0)] = 10.0
    average_s: Annotated[float, Field(ge=0.001, le=1e6)] = 100.0


class _Manifest(_Part):
    schema_: Annotated[Literal[1], Field(alias="schema")]
    datasets: tuple[_Place, ...] = ()  # patterns of folders
    axis: Literal["x", "y", "z", "all"] | None = None  # of those
    unit: tuple[_UnitEntry, ...] = ()
    options: _Options = _Options()
    numeric: tuple[Literal["f32", "q31"], ...] | None = None
    limits: _Place | None = None


def load_manifest(path: Path) -> Fleet:
    """Reads a manifest; a folder is one too: each of its folders with recordings is a data set.

    Raises:
        InputError: It cannot be read, a field is wrong, nothing is named, or two results would have one name.
    """
    if path.is_dir():
        folders = [folder for folder in sorted(path.iterdir()) if _has_recordings(folder)]
        return _distinct(
            path, Fleet(tuple(Unit(folder, None) for folder in folders), FitOptions(), None, None)
        )
    manifest = _parsed(path)
    named = (
        *((folder, manifest.axis) for folder in _matching(path, manifest.datasets)),
        *((path.parent / entry.dataset, entry.axis) for entry in manifest.unit),
    )
    units = tuple(unit for folder, axis in named for unit in _units(folder, axis))
    limits = load_limits(path.parent / manifest.limits) if manifest.limits else None
    options = FitOptions(**manifest.options.model_dump())
    return _distinct(path, Fleet(units, options, manifest.numeric, limits))


def _units(folder: Path, axis: str | None) -> Iterator[Unit]:
    """A unit for each axis that is asked for; where the recordings cannot tell their axes, the job will say why."""
    axes: tuple[str | None, ...] = (axis,)
    if axis == "all":
        try:
            axes = axes_of(folder) or (None,)
        except InputError:
            axes = (None,)
    yield from (Unit(folder, name) for name in axes)


def _parsed(path: Path) -> _Manifest:
    content = read_toml(path, "a manifest or a folder")
    try:
        return _Manifest.model_validate(content)
    except ValidationError as error:
        raise _wrong_field(path, error) from error


def _wrong_field(path: Path, error: ValidationError) -> InputError:
    detail: Any = error.errors()[0]
    where = f"{path}, field {'.'.join(str(part) for part in detail['loc'])}"
    if detail["type"] == "extra_forbidden":
        return InputError(where, "is not known", "a field named in docs/fleet.md")
    if detail["type"] == "missing":
        return InputError(where, "is missing", f"{detail['loc'][-1]} = ...")
    return InputError(where, repr(detail["input"]), detail["msg"])


def _matching(path: Path, patterns: tuple[str, ...]) -> Iterator[Path]:
    for pattern in patterns:
        if Path(pattern).is_absolute() or ".." in Path(pattern).parts:
            raise InputError(
                f"{path}, field datasets", repr(pattern), "a pattern below the manifest's folder"
            )
        try:
            found = sorted(folder for folder in path.parent.glob(pattern) if _has_recordings(folder))
        except (
            IndexError,
            NotImplementedError,
            ValueError,
            OSError,
            RecursionError,
        ) as error:  # ".", "a**", a name that no folder can have
            expected = "a pattern below the manifest's folder, e.g. 2026-*"
            raise InputError(f"{path}, field datasets", repr(pattern)[:80], expected) from error
        if not found:
            raise InputError(f"{path}, field datasets", f"{pattern!r} matches no folder of recordings")
        yield from found


def _has_recordings(folder: Path) -> bool:
    if not folder.is_dir() or folder.name.startswith("."):
        return False
    return (folder / "dataset.toml").is_file() or any(
        file.suffix.lower() in (".csv", ".parquet") for file in folder.iterdir()
    )


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
