"""One file of another form, from what `build` (or `fit` and `emit`) wrote.

Parameter files of autopilots hold the best cubic over temperature in their own arithmetic.
PX4 (TemperatureCompensation, `calc_thermal_offsets_3D`): x0 + x1 d + x2 d² + x3 d³ with d² and d³ multiplied first.
ArduPilot (AP_InertialSensor, `TCal::polynomial_eval`): (c0 + (c1 + c2 d) d) d 1e-6, the constant in the gyro's offset.
Both clip the temperature to their range and work in rad/s.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from ..common.errors import CheckFailed, InputError
from ..common.texts import toml_comment
from ..jobs.axes import axes_in
from ..model import Model, load_model
from ..store.files import check_replaceable, json_text, write_atomically
from ..store.marker import check_intact
from ..tables.record import RECORD, read_options
from .fmu import fmu
from .grid import GRID, MapGrid, a2l_text, cdf_text, csv_text, grid_of, map_result

Autopilot = Literal["px4", "ardupilot"]
Words = NDArray[np.float32]

_RAD_S = np.pi / 180.0 / 3600.0  # of one deg/h
_SCALE = np.float32(1e-6)  # ArduPilot's, so that its parameters are easy to read
_ORDERS = 4  # of a cubic


@dataclass(frozen=True, slots=True)
class Cubic:
    """A cubic as an autopilot holds it.

    Attributes:
        autopilot: Whose arithmetic it is in.
        reference_c, lowest_c, highest_c: Temperatures in float32.
        x: Coefficients of d⁰ ... d³, rad/s (ArduPilot: from d¹ on in 1e-6 rad/s).
        rms_dph, largest_dph: What it loses against the map where training was, rates of temperature included.
        flat_dph: RMS of the map itself there.
    """

    autopilot: Autopilot
    reference_c: np.float32
    lowest_c: np.float32
    highest_c: np.float32
    x: tuple[np.float32, np.float32, np.float32, np.float32]
    rms_dph: float
    largest_dph: float
    flat_dph: float

    def offset(self, temperature_c: NDArray[np.floating]) -> Words:
        """What the autopilot subtracts, rad/s, in its own operations; shape as given."""
        seen = np.clip(np.asarray(temperature_c, dtype=np.float32), self.lowest_c, self.highest_c)
        return _evaluated(self.autopilot, seen - self.reference_c, self.x)


def _evaluated(autopilot: Autopilot, d: Words, x: tuple[np.float32, ...]) -> Words:
    if autopilot == "px4":
        square = d * d
        return np.asarray(x[0] + x[1] * d + x[2] * square + x[3] * (square * d), dtype=np.float32)
    return np.asarray(x[0] + (x[1] + (x[2] + x[3] * d) * d) * d * _SCALE, dtype=np.float32)


def best_cubic(model: Model, autopilot: Autopilot) -> Cubic:
    """Least squares over the cells where training was; each coefficient is rounded with the lower ones fitted anew.

    Raises:
        CheckFailed: ArduPilot corrects nothing where the middle of the range is not above 0 C.
    """
    t, r = model.trained_inputs()
    y = model.map_dph(t, r)
    low, high = (np.float32(edge) for edge in model.envelope.temperature_c)
    middle = (high + low) * np.float32(0.5)
    if autopilot == "ardupilot" and middle <= 0:
        raise CheckFailed(f"ArduPilot corrects nothing where the middle of the range is not above 0 C: {middle:.1f} C")
    d = (t.astype(np.float32) - middle).astype(np.float64)
    unit = np.array([1.0, *([1.0 if autopilot == "px4" else float(_SCALE)] * (_ORDERS - 1))])
    columns = d[:, None] ** np.arange(_ORDERS) * unit
    x = np.zeros(_ORDERS, dtype=np.float32)
    rest = y * _RAD_S
    for order in reversed(range(_ORDERS)):
        scale = np.abs(columns[:, : order + 1]).max(axis=0)
        found = np.linalg.lstsq(columns[:, : order + 1] / scale, rest, rcond=None)[0] / scale
        x[order] = np.float32(found[order])
        rest = rest - columns[:, order] * float(x[order])
    coefficients = (x[0], x[1], x[2], x[3])
    lost = _evaluated(autopilot, t.astype(np.float32) - middle, coefficients).astype(np.float64) / _RAD_S - y
    return Cubic(
        autopilot, middle, low, high, coefficients, float(np.sqrt(np.mean(lost**2))), float(np.abs(lost).max()),
        float(np.sqrt(np.mean(y**2))),
    )  # fmt: skip


AXES = ("x", "y", "z")
_REAL, _INTEGER = 9, 6  # MAV_PARAM_TYPE_REAL32, MAV_PARAM_TYPE_INT32


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
        body = (f"1\t1\t{name}\t{text}\t{kind}" for name, text, kind in rows)
    else:
        lines.append("# set INS_GYR_CAL to 0: a calibration at start would replace INS_GYROFFS")
        body = (f"{name},{text}" for name, text, _ in rows)
    return "\n".join([*(toml_comment(line, 300) for line in lines), *body]) + "\n"


def _text(value: np.float32) -> str:
    return f"{value:.9g}"  # gives the same float32 again


def _of(cubics: Mapping[str, Cubic], axis: str, order: int) -> np.float32:
    return cubics[axis].x[order] if axis in cubics else np.float32(0.0)


def _of_px4(first: Cubic, cubics: Mapping[str, Cubic], device: int) -> Iterator[tuple[str, str, int]]:
    yield "TC_G_ENABLE", "1", _INTEGER
    yield "TC_G0_ID", str(device), _INTEGER
    for order in range(4):
        for number, axis in enumerate(AXES):
            yield f"TC_G0_X{order}_{number}", _text(_of(cubics, axis, order)), _REAL
    yield "TC_G0_TREF", _text(first.reference_c), _REAL
    yield "TC_G0_TMIN", _text(first.lowest_c), _REAL
    yield "TC_G0_TMAX", _text(first.highest_c), _REAL


def _of_ardupilot(first: Cubic, cubics: Mapping[str, Cubic]) -> Iterator[tuple[str, str, int]]:
    yield "INS_TCAL1_ENABLE", "1", _INTEGER
    yield "INS_TCAL1_TMIN", _text(first.lowest_c), _REAL
    yield "INS_TCAL1_TMAX", _text(first.highest_c), _REAL
    for axis in AXES:
        yield f"INS_GYROFFS_{axis.upper()}", _text(_of(cubics, axis, 0)), _REAL
        for order in (1, 2, 3):
            yield f"INS_TCAL1_GYR{order}_{axis.upper()}", _text(_of(cubics, axis, order)), _REAL
    yield "INS_GYR1_CALTEMP", _text(first.reference_c), _REAL  # the offset is that of the middle


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
