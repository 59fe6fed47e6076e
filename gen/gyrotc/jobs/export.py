"""Other forms of a correction: parameters of autopilots, the map as a table."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from ..errors import InputError
from ..model import Model, load_model
from ..outputs import write_result
from ..quantise.cubic import Autopilot, Cubic, best_cubic
from ..texts import toml_comment
from .axes import axes_in

__all__ = ["Format", "export", "map_text", "parameters"]

Format = Literal["px4", "ardupilot", "csv"]
_AXES = ("x", "y", "z")
_GRID = (61, 25)  # temperatures and rates of a table: finer than any map of a gyro
_REAL, _INTEGER = 9, 6  # MAV_PARAM_TYPE_REAL32, MAV_PARAM_TYPE_INT32


def export(folder: Path, format: Format, out: Path, *, axis_as: str = "x", device: int = 0) -> list[str]:
    """Writes one file; returns what it loses, a line for each axis.

    Args:
        folder: What `build` wrote, also with `--axis all`.
        axis_as: Axis of the autopilot for a result of a single axis.
        device: PX4's id of the gyro (`CAL_GYRO0_ID`).

    Raises:
        InputError: The folder has no model, or `out` holds what gyrotc did not write.
        CheckFailed: The autopilot cannot hold the correction.
    """
    names = axes_in(folder)
    models = [load_model(folder / name / "model.json") for name in names] or [
        load_model(folder / "model.json")
    ]
    if format == "csv":
        write_result(out, map_text(models))
        return [f"{len(models) * _GRID[0] * _GRID[1]} rows"]
    if axis_as not in _AXES:
        raise InputError("--axis-as", repr(axis_as), ", ".join(_AXES))
    cubics = {model.axis or axis_as: best_cubic(model, format) for model in models}
    lost = [
        f"axis {axis}: the cubic is {c.rms_dph:.2e} deg/h RMS from the map, at most {c.largest_dph:.2e}; the map "
        f"takes off {c.flat_dph:.2e}"
        for axis, c in cubics.items()
    ]
    write_result(out, parameters(models[0].serial, format, cubics, lost, device))
    return lost


def parameters(
    serial: str, autopilot: Autopilot, cubics: Mapping[str, Cubic], notes: Sequence[str], device: int
) -> str:
    """The text of a parameter file; axes that are not there get zeros."""
    first = next(iter(cubics.values()))
    rows = _of_px4(first, cubics, device) if autopilot == "px4" else _of_ardupilot(first, cubics)
    lines = [
        f"# gyrotc: gyro {serial}, best cubic over temperature in float32",
        *(f"# {note}" for note in notes),
    ]
    if autopilot == "px4":
        lines.append("# TC_G0_ID has to be CAL_GYRO0_ID of the vehicle (--device)" if not device else "#")
        told = (f"1\t1\t{name}\t{text}\t{kind}" for name, text, kind in rows)
    else:
        lines.append("# set INS_GYR_CAL to 0: a calibration at start would replace INS_GYROFFS")
        told = (f"{name},{text}" for name, text, _ in rows)
    return "\n".join([*(toml_comment(line, 300) for line in lines), *told]) + "\n"


def _text(value: np.float32) -> str:
    return f"{value:.9g}"  # gives the same float32 again


def _of(cubics: Mapping[str, Cubic], axis: str, order: int) -> np.float32:
    return cubics[axis].x[order] if axis in cubics else np.float32(0.0)


def _of_px4(first: Cubic, cubics: Mapping[str, Cubic], device: int) -> Iterator[tuple[str, str, int]]:
    yield "TC_G_ENABLE", "1", _INTEGER
    yield "TC_G0_ID", str(device), _INTEGER
    for order in range(4):
        for number, axis in enumerate(_AXES):
            yield f"TC_G0_X{order}_{number}", _text(_of(cubics, axis, order)), _REAL
    yield "TC_G0_TREF", _text(first.reference_c), _REAL
    yield "TC_G0_TMIN", _text(first.lowest_c), _REAL
    yield "TC_G0_TMAX", _text(first.highest_c), _REAL


def _of_ardupilot(first: Cubic, cubics: Mapping[str, Cubic]) -> Iterator[tuple[str, str, int]]:
    yield "INS_TCAL1_ENABLE", "1", _INTEGER
    yield "INS_TCAL1_TMIN", _text(first.lowest_c), _REAL
    yield "INS_TCAL1_TMAX", _text(first.highest_c), _REAL
    for axis in _AXES:
        yield f"INS_GYROFFS_{axis.upper()}", _text(_of(cubics, axis, 0)), _REAL
        for order in (1, 2, 3):
            yield f"INS_TCAL1_GYR{order}_{axis.upper()}", _text(_of(cubics, axis, order)), _REAL
    yield "INS_GYR1_CALTEMP", _text(first.reference_c), _REAL  # the offset is that of the middle


def map_text(models: Sequence[Model]) -> str:
    """The static maps over their envelopes, terms not included: a row for each temperature and rate."""
    stream = io.StringIO()
    table = csv.writer(stream, lineterminator="\n")
    table.writerow(["serial", "axis", "temperature_c", "slope_c_per_min", "bias_dph"])
    for model in models:
        spans = (model.envelope.temperature_c, model.envelope.slope_c_per_min)
        t, r = (np.linspace(*span, n) for span, n in zip(spans, _GRID, strict=True))
        bias = model.map_dph(*np.meshgrid(t, r, indexing="ij"))
        for k, temperature in enumerate(t):
            for n, slope in enumerate(r):
                cells = (float(temperature), float(slope), float(bias[k, n]))
                table.writerow([model.serial, model.axis or "", *(repr(cell) for cell in cells)])
    return stream.getvalue()
