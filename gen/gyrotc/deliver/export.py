"""One file of another form, from what `build` (or `fit` and `emit`) wrote."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast, get_args

from ..common.errors import InputError
from ..jobs.axes import axes_in
from ..model import Model, load_model
from ..store.files import check_replaceable, json_text, write_atomically
from ..store.marker import check_intact
from ..tables.record import RECORD, read_options
from .autopilots import AXES, Autopilot, best_cubic, parameters
from .fmu import fmu
from .grid import GRID, MapGrid, a2l_text, cdf_text, csv_text, grid_of, map_result

Format = Literal["px4", "ardupilot", "csv", "json", "a2l", "cdf", "fmu"]


@dataclass(frozen=True, slots=True)
class Exporting:
    """What an export goes by, beside its form.

    Attributes:
        axis_as: Axis of the autopilot for a result of a single axis.
        device: PX4's id of the gyro (`CAL_GYRO0_ID`).
        points: Temperatures and rates of temperature of a table.
        address: Where the table begins in the memory of the control unit (A2L).
    """

    axis_as: str = "x"
    device: int = 0
    points: tuple[int, int] = GRID
    address: int = 0


def export(folder: Path, format: Format, out: Path, options: Exporting = Exporting()) -> list[str]:
    """Writes one file; returns what is to be known of it, a line for each axis.

    Args:
        folder: What `build` wrote, also with `--axis all`.

    Raises:
        InputError: The folder has no model, or `out` holds what gyrotc did not write.
        CheckFailed: The other form cannot hold the correction, or what `folder` holds was changed.
    """
    check_replaceable(out)
    parts = [folder / name for name in axes_in(folder)] or [folder]
    for part in parts:
        check_intact(part, ("model.json", "c"), needed=False)
    models = [load_model(part / "model.json") for part in parts]
    if format == "fmu":
        data, lines = fmu(folder, models)
        write_atomically(out, data)
        return lines
    shifted = [_as_emitted(part, model) for part, model in zip(parts, models, strict=True)]
    if format in get_args(Autopilot):
        text, lines = _cubics(shifted, cast(Autopilot, format), options)
    else:
        text, lines = _tables(shifted, format, options)
    write_atomically(out, text)
    return lines


def _as_emitted(part: Path, model: Model) -> Model:
    """The model whose map the tables beside it compute (`emit --zero-at`)."""
    c = part / "c"
    return read_options(c).shifted(model) if (c / RECORD).is_file() else model


def _cubics(models: Sequence[Model], format: Autopilot, options: Exporting) -> tuple[str, list[str]]:
    if options.axis_as not in AXES:
        raise InputError("--axis-as", repr(options.axis_as), ", ".join(AXES))
    cubics = {model.axis or options.axis_as: best_cubic(model, format) for model in models}
    lost = [
        f"axis {axis}: the cubic is {c.rms_dph:.2e} deg/h RMS from the map, at most {c.largest_dph:.2e} deg/h; "
        f"the map takes off {c.flat_dph:.2e} deg/h"
        for axis, c in cubics.items()
    ]
    return parameters(models[0].serial, format, cubics, lost, options.device), lost


def _tables(models: Sequence[Model], format: Format, options: Exporting) -> tuple[str, list[str]]:
    grids = [grid_of(model, options.points) for model in models]
    lost = [_lost(grid) for grid in grids]
    if format == "csv":
        return csv_text(grids), lost
    if format == "json":
        return json_text(map_result(grids).content()), lost
    return a2l_text(grids, lost, options.address) if format == "a2l" else cdf_text(grids, lost), lost


def _lost(grid: MapGrid) -> str:
    axis = f"axis {grid.model.axis}: " if grid.model.axis else ""
    terms = [term.id for term in grid.model.terms]
    without = f"; without the terms {', '.join(terms)}" if terms else ""
    shape = f"{grid.temperature_c.size} x {grid.slope_c_per_min.size}"
    return (
        f"{axis}{shape} points; linear between them it is {grid.rms_dph:.2e} deg/h RMS from the map, at most "
        f"{grid.largest_dph:.2e} deg/h{without}"
    )
