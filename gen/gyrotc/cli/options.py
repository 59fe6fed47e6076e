"""Define the arguments and options that several commands have, and read what they name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..common.errors import InputError
from .output import OUT, STANDARD_OUTPUT

if TYPE_CHECKING:
    from ..train.prior.use import LotPrior


# Words of options repeat literal types of modules that are too slow to import for `--help`; a test compares both.
class GyroAxis(str, Enum):
    """Axis of a gyro."""

    x = "x"
    y = "y"
    z = "z"


def completing(words: Sequence[str]) -> Callable[[str], list[str]]:
    """The completion of an option whose values the job itself checks: a list of words, or an axis of the data."""

    def begun(incomplete: str) -> list[str]:
        return [word for word in words if word.startswith(incomplete)]

    return begun


DatasetArg = Annotated[Path, typer.Argument(help="Folder of recordings, with or without dataset.toml.")]
OutOption = Annotated[Path, typer.Option("--out", help="Folder for the result.")]


def written_place(path: Path | None) -> Path | None:
    """Checks, before the work begins, that gyrotc wrote what stands in the place of the result."""
    from ..results.files import check_replaceable

    if path is not None:
        check_replaceable(path)
    return path


def _json_place(path: Path | None) -> Path | None:
    """Check the place of JSON; with `-`, text goes to standard error, so that standard output holds the JSON alone."""
    if path != STANDARD_OUTPUT:
        return written_place(path)
    OUT.stderr = True
    return path


JsonOption = Annotated[
    Path | None,
    typer.Option(
        "--json",
        callback=_json_place,
        help="Write the machine-readable result here; -: standard output; default: nowhere.",
    ),
]
AxisOption = Annotated[
    str | None,
    typer.Option(
        "--axis",
        help="Axis of a three-axis recording: x, y, z or all; build and diagnose take all by default.",
        autocompletion=completing((*(axis.value for axis in GyroAxis), "all")),
    ),
]


def _targets_begun(incomplete: str) -> list[str]:
    from ..verify.toolchain import all_targets

    return completing(("all", *all_targets()))(incomplete)


SeedOption = Annotated[
    int,
    typer.Option(
        "--seed",
        metavar="N",
        min=0,
        help="Number from which everything random is drawn.",
    ),
]
NumericOption = Annotated[
    str | None,
    typer.Option(
        "--numeric",
        help="Arithmetics, e.g. f32 or f32,q31; default: all, in build those that the limits need.",
        autocompletion=completing(("f32", "q31", "f32,q31")),
    ),
]
TargetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--target",
        metavar="NAME",
        help="Name of a target, or all; may be repeated; default: Cortex-M4F and one host.",
        autocompletion=_targets_begun,
    ),
]
LotOption = Annotated[
    Path | None,
    typer.Option("--lot", help="A lot (gyrotc lot) as prior of the gyro, which then needs fewer runs; default: none."),
]
PriorOption = Annotated[
    Path | None,
    typer.Option("--prior", help="An earlier result of this gyro as prior, tested by the new runs; default: none."),
]
AcceptOption = Annotated[
    str | None,
    typer.Option(
        "--accept-fail",
        metavar="REASON",
        help="Release a unit whose verdict is not PASS, and print why; default: refuse.",
    ),
]


def _result_place(folder: Path) -> Path:
    """Check that a folder holds a result; the message names a folder beside it that does."""
    if _holds_result(folder):
        return folder
    if (folder / "fleet.json").is_file():
        found = "is a fleet, whose page fleet.html gyrotc fleet draws"
        example = next((f", e.g. {place}" for place in _below(folder) if _holds_result(place)), "")
        raise InputError(str(folder), found, f"the folder of a gyro{example}")
    near = next((place for place in (folder.parent, *_below(folder)) if _holds_result(place)), None)
    expected = f"{near}, which holds one" if near is not None else "a folder that gyrotc build wrote"
    raise InputError(str(folder), "holds no result" if folder.is_dir() else "is no folder", expected)


def _holds_result(folder: Path) -> bool:
    names = ("model.json", *(f"{axis.value}/model.json" for axis in GyroAxis), "diagnose.json")
    return any((folder / name).is_file() for name in names)


def _below(folder: Path) -> list[Path]:
    """Return the folders in a folder; none where it cannot be read."""
    try:
        return sorted(path for path in folder.iterdir() if path.is_dir())
    except (OSError, ValueError):
        return []


DirArg = Annotated[Path, typer.Argument(callback=_result_place, help="Folder that build (or fit and emit) wrote.")]


def numerics_of(text: str | None) -> list[str] | None:
    return None if text is None else [part.strip() for part in text.split(",")]


def lot_in(path: Path | None) -> LotPrior | None:
    """The lot of `--lot` as what is known of a unit. Raises as `load_lot`."""
    if path is None:
        return None
    from ..jobs.lot import load_lot  # with what learns one: not for who has none
    from ..train.prior.use import prior_of

    return prior_of(load_lot(path))
