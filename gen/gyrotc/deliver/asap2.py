"""ASAP2 (A2L, ASAM MCD-2 MC 1.6.1): the map of each axis as a MAP over two common axes, and as a CURVE at rest.

Memory from `address` on, float32 with the least significant byte first and without gaps, for each axis of the gyro:
the temperatures, the rates of temperature, the bias at rest (one for each temperature), and the map, rate by rate
(ROW_DIR: the temperature varies fastest).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..common.errors import InputError
from ..common.texts import c_comment, c_literal
from .grid import MapGrid

__all__ = ["a2l_text", "names_of"]

_BYTES = 4  # of a float32
_MEMORY = 2**32  # bytes: addresses of ASAP2 have 32 bits
_HEAD = """/* gyrotc: gyro {serial}: the map of its bias
{notes} */
ASAP2_VERSION 1 61
/begin PROJECT gyrotc "Bias of a gyro over temperature"
  /begin MODULE gtc_{module} "Gyro {serial}"
    /begin MOD_COMMON "Numbers of this module"
      BYTE_ORDER MSB_LAST
      ALIGNMENT_FLOAT32_IEEE 4
    /end MOD_COMMON
    /begin MOD_PAR "Identification"
      VERSION "{version}"
    /end MOD_PAR
{units}    /begin RECORD_LAYOUT gtc_points
      AXIS_PTS_X 1 FLOAT32_IEEE INDEX_INCR DIRECT
    /end RECORD_LAYOUT
    /begin RECORD_LAYOUT gtc_values
      FNC_VALUES 1 FLOAT32_IEEE ROW_DIR DIRECT
    /end RECORD_LAYOUT
"""
_TAIL = """  /end MODULE
/end PROJECT
"""
_UNITS = (
    ("gtc_temperature", "Temperature of the gyro", "%9.4", "C"),
    ("gtc_slope", "Rate of temperature", "%9.5", "C/min"),
    ("gtc_bias", "Bias to be subtracted", "%12.8", "deg/h"),
)
_UNIT = """    /begin COMPU_METHOD {name} "{text}"
      IDENTICAL "{form}" "{unit}"
    /end COMPU_METHOD
"""
_POINTS = """    /begin AXIS_PTS {name} "{text}"
      0x{address:08X} NO_INPUT_QUANTITY gtc_points 0 {method} {count} {low} {high}
    /end AXIS_PTS
"""
_VALUES = """    /begin CHARACTERISTIC {name} "{text}"
      {kind} 0x{address:08X} gtc_values 0 gtc_bias {low} {high}
{axes}    /end CHARACTERISTIC
"""
_AXIS = """      /begin AXIS_DESCR
        COM_AXIS NO_INPUT_QUANTITY {method} {count} {low} {high}
        AXIS_PTS_REF {name}
      /end AXIS_DESCR
"""


def names_of(grid: MapGrid) -> dict[str, str]:
    """Names of an axis's objects, in A2L and CDF alike."""
    stem = f"gtc_{grid.model.symbol}"
    return {what: f"{stem}_{what}" for what in ("temperature", "slope", "rest", "map")}


def a2l_text(grids: Sequence[MapGrid], notes: Sequence[str], address: int) -> str:
    """The whole file.

    Args:
        notes: What is to be known of the maps, a line each.
        address: Of the first byte.

    Raises:
        InputError: The tables do not fit below the end of the memory.
    """
    model = grids[0].model
    units = "".join(_UNIT.format(name=n, text=t, form=f, unit=u) for n, t, f, u in _UNITS)
    text = _HEAD.format(
        serial=c_literal(model.serial), module=model.symbol, units=units, version=model.hash[:16],
        notes="".join(f" * {c_comment(note, 300)}\n" for note in notes),
    )  # fmt: skip
    for grid in grids:
        text += "".join(_objects(grid, address))
        address += _BYTES * (
            grid.temperature_c.size * (grid.slope_c_per_min.size + 2) + grid.slope_c_per_min.size
        )
    if address > _MEMORY:
        raise InputError("--address", "the map ends beyond 0xFFFFFFFF", "a smaller address")
    return text + _TAIL


def _objects(grid: MapGrid, address: int) -> Iterator[str]:
    """Axes, curve and map of one axis, one behind the other in memory."""
    names = names_of(grid)
    t = {"count": grid.temperature_c.size, "method": "gtc_temperature", "name": names["temperature"]}
    r = {"count": grid.slope_c_per_min.size, "method": "gtc_slope", "name": names["slope"]}
    for axis, points in ((t, grid.temperature_c), (r, grid.slope_c_per_min)):
        axis |= {"low": _number(points[0]), "high": _number(points[-1])}
        yield _POINTS.format(address=address, text="Points of the map", **axis)
        address += _BYTES * points.size
    biases = [*grid.bias_dph.ravel(), *grid.rest_dph]
    low, high = _number(min(biases)), _number(max(biases))
    whole = (("rest", "CURVE", "Bias where the temperature rests", (t,)), ("map", "MAP", "Bias", (t, r)))
    for what, kind, text, axes in whole:
        described = "".join(_AXIS.format(**axis) for axis in axes)
        yield _VALUES.format(
            name=names[what], kind=kind, text=text, address=address, axes=described, low=low, high=high
        )
        address += _BYTES * grid.temperature_c.size


def _number(value: float) -> str:
    return f"{float(np.float32(value)):.9g}"  # gives the same float32 again
