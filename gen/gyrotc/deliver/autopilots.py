"""Parameter files of autopilots: the best cubic over temperature in their own arithmetic."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ..common.texts import toml_comment
from .cubic import Autopilot, Cubic

__all__ = ["AXES", "parameters"]

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
