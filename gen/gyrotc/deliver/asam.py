"""ASAP2 and CDF 2.0: the map of each axis as calibration data, and the values of what the A2L file describes.

Memory from `address` on, float32 with the least significant byte first and without gaps, for each axis of the gyro:
the temperatures, the rates of temperature, the bias at rest (one for each temperature), and the map, rate by rate
(ROW_DIR: the temperature varies fastest).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from ..common.errors import InputError
from ..common.texts import c_comment, c_literal, toml_comment
from .grid import MapGrid

__all__ = ["a2l_text", "cdf_text", "names_of"]

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


_DOCTYPE = (
    '<!DOCTYPE MSRSW PUBLIC "-//ASAM//DTD CALIBRATION DATA FORMAT:V2.0.0:LAI:IAI:XML:CDF200.XSD//EN" '
    '"cdf_v2.0.0.sl.dtd">'
)
_TEMPERATURE, _SLOPE, _BIAS = "C", "C/min", "deg/h"


def cdf_text(grids: Sequence[MapGrid], notes: Sequence[str]) -> str:
    """The whole file. A MAP has one group of values (VG) for each rate of temperature, its label."""
    model = grids[0].model
    root = Element("MSRSW", {"CREATOR": "gyrotc"})
    _add(root, "SHORT-NAME", f"gtc_{model.symbol}")
    _add(root, "CATEGORY", "CDF20")
    system = SubElement(SubElement(root, "SW-SYSTEMS"), "SW-SYSTEM")
    _add(system, "SHORT-NAME", f"gtc_{model.symbol}")
    tree = SubElement(SubElement(system, "SW-INSTANCE-SPEC"), "SW-INSTANCE-TREE")
    _add(tree, "SHORT-NAME", f"gtc_{model.symbol}")
    _add(tree, "CATEGORY", "NO_VCD")
    for grid in grids:
        _instances(tree, grid)
    indent(root, " ")
    told = [f"gyrotc: gyro {model.serial}", *notes]
    comment = "\n".join(toml_comment(note, 300).replace("--", "- -") for note in told)
    head = f'<?xml version="1.0" encoding="UTF-8"?>\n<!-- {comment} -->\n{_DOCTYPE}\n'
    return head + tostring(root, "unicode") + "\n"


def _instances(tree: Element, grid: MapGrid) -> None:
    names = names_of(grid)
    for what, unit, points in (
        ("temperature", _TEMPERATURE, grid.temperature_c),
        ("slope", _SLOPE, grid.slope_c_per_min),
    ):
        _numbers(_content(_instance(tree, names[what], "COM_AXIS"), unit), points)
    rest = _instance(tree, names["rest"], "CURVE")
    _numbers(_content(rest, _BIAS), grid.rest_dph)
    _axes(rest, (names["temperature"],))
    whole = _instance(tree, names["map"], "MAP")
    values = _content(whole, _BIAS)
    for slope, row in zip(grid.slope_c_per_min, grid.bias_dph.T, strict=True):
        group = SubElement(values, "VG")
        _add(group, "LABEL", _text(slope))
        _numbers(group, row)
    _axes(whole, (names["temperature"], names["slope"]))


def _instance(tree: Element, name: str, category: str) -> Element:
    found = SubElement(tree, "SW-INSTANCE")
    _add(found, "SHORT-NAME", name)
    _add(found, "CATEGORY", category)
    return found


def _content(instance: Element, unit: str) -> Element:
    content = SubElement(instance, "SW-VALUE-CONT")
    _add(content, "UNIT-DISPLAY-NAME", unit)
    return SubElement(content, "SW-VALUES-PHYS")


def _axes(instance: Element, names: Iterable[str]) -> None:
    listed = SubElement(instance, "SW-AXIS-CONTS")
    for name in names:
        axis = SubElement(listed, "SW-AXIS-CONT")
        _add(axis, "CATEGORY", "COM_AXIS")
        _add(axis, "SW-INSTANCE-REF", name)


def _numbers(parent: Element, values: Iterable[float]) -> None:
    for value in values:
        _add(parent, "V", _text(value))


def _add(parent: Element, tag: str, text: str) -> None:
    SubElement(parent, tag).text = text


def _text(value: float) -> str:
    return f"{float(np.float32(value)):.9g}"  # gives the same float32 again
