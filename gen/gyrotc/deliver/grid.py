"""The static map on a grid of temperatures and rates of temperature, as CSV, JSON, ASAP2 (A2L) and ASAM CDF 2.0.

ASAP2 describes each axis of the gyro as calibration data, CDF has the values of what the A2L file describes. Memory
from `address` on, float32 with the least significant byte first and without gaps, for each axis of the gyro: the
temperatures, the rates of temperature, the bias at rest (one for each temperature), and the map, rate by rate (ROW_DIR:
the temperature varies fastest).
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from numpy.typing import NDArray

from .. import __version__
from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..common.texts import c_comment, c_literal, toml_comment
from ..model import Model
from ..results.base import MapOfAxis, MapOnGrid

GRID = (61, 25)  # temperatures and rates of a table: finer than any map of a gyro
_WITHIN = 4  # parts of a cell at which the loss is measured: its middle and two more in each direction


@dataclass(frozen=True, slots=True)
class MapGrid:
    """A map at the points of a grid.

    Attributes:
        model: Whose map it is.
        temperature_c: Shape (n,), ascending; every number is one of float32.
        slope_c_per_min: Shape (m,), the same; 0 is among them where the envelope holds it.
        bias_dph: Shape (n, m), float64.
        rest_dph: Where dT/dt is 0 (or the edge of the envelope nearest to it), shape (n,).
        rms_dph, largest_dph: What the straight line between points (bilinear) and float32 lose against the map.
    """

    model: Model
    temperature_c: FloatArray
    slope_c_per_min: FloatArray
    bias_dph: FloatArray
    rest_dph: FloatArray
    rms_dph: float
    largest_dph: float


def grid_of(model: Model, points: tuple[int, int] = GRID) -> MapGrid:
    """The map of a model over its envelope, terms not included."""
    t = _points(model.envelope.temperature_c, points[0])
    r = _points(model.envelope.slope_c_per_min, points[1])
    if r.size > 2 and r[0] < 0.0 < r[-1]:  # a unit at rest is asked for most
        r[1 + int(np.argmin(np.abs(r[1:-1])))] = 0.0
    bias = model.map_dph(*np.meshgrid(t, r, indexing="ij"))
    lost = _lost(model, t, r, bias.astype(np.float32).astype(np.float64))
    rms, largest = float(np.sqrt(np.mean(lost**2))), float(np.abs(lost).max())
    return MapGrid(model, t, r, bias, np.asarray(model.map_dph(t, 0.0)), rms, largest)


def _points(span: tuple[float, float], count: int) -> FloatArray:
    """Points of an axis in float32, each once: an envelope without width has one."""
    return np.unique(np.linspace(*span, count).astype(np.float32)).astype(np.float64)


def _between(axis: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """Places within the cells of an axis: the cell's number, and how far in it they lie."""
    if axis.size == 1:
        return np.zeros(1, dtype=np.int64), np.zeros(1)
    cell = np.repeat(np.arange(axis.size - 1), _WITHIN)
    return cell, np.tile(np.arange(_WITHIN) / _WITHIN, axis.size - 1)


def _lost(model: Model, t: FloatArray, r: FloatArray, bias: FloatArray) -> FloatArray:
    """Bilinear interpolation minus map, at places in all cells."""
    (i, u), (k, v) = _between(t), _between(r)
    i1, k1 = np.minimum(i + 1, t.size - 1), np.minimum(k + 1, r.size - 1)
    along = bias[i] + u[:, None] * (bias[i1] - bias[i])
    seen = along[:, k] + v * (along[:, k1] - along[:, k])
    at_t, at_r = t[i] + u * (t[i1] - t[i]), r[k] + v * (r[k1] - r[k])
    return np.asarray(seen - model.map_dph(*np.meshgrid(at_t, at_r, indexing="ij")))


def csv_text(grids: Sequence[MapGrid]) -> str:
    """A row for each axis, temperature and rate."""
    stream = io.StringIO()
    table = csv.writer(stream, lineterminator="\n")
    table.writerow(["serial", "axis", "temperature_c", "slope_c_per_min", "bias_dph"])
    for grid in grids:
        for k, temperature in enumerate(grid.temperature_c):
            for n, slope in enumerate(grid.slope_c_per_min):
                cells = (float(temperature), float(slope), float(grid.bias_dph[k, n]))
                table.writerow([grid.model.serial, grid.model.axis or "", *(repr(cell) for cell in cells)])
    return stream.getvalue()


def map_result(grids: Sequence[MapGrid]) -> MapOnGrid:
    """The JSON result (docs/FORMAT.md)."""
    return MapOnGrid(
        gyrotc_version=__version__,
        serial=grids[0].model.serial,
        axis=None,
        units={"temperature_c": "C", "slope_c_per_min": "C/min", "bias_dph": "deg/h"},
        maps=tuple(
            MapOfAxis(
                axis=grid.model.axis,
                model_hash=grid.model.hash,
                temperature_c=tuple(grid.temperature_c.tolist()),
                slope_c_per_min=tuple(grid.slope_c_per_min.tolist()),
                bias_dph=tuple(tuple(row) for row in grid.bias_dph.tolist()),
                linear_rms_dph=grid.rms_dph,
                linear_largest_dph=grid.largest_dph,
                terms=tuple(term.id for term in grid.model.terms),
            )
            for grid in grids
        ),
    )


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
        address += _BYTES * (grid.temperature_c.size * (grid.slope_c_per_min.size + 2) + grid.slope_c_per_min.size)
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
    remarks = [f"gyrotc: gyro {model.serial}", *notes]
    comment = "\n".join(toml_comment(note, 300).replace("--", "- -") for note in remarks)
    head = f'<?xml version="1.0" encoding="UTF-8"?>\n<!-- {comment} -->\n{_DOCTYPE}\n'
    return head + tostring(root, "unicode") + "\n"


def _instances(tree: Element, grid: MapGrid) -> None:
    names = names_of(grid)
    for what, unit, points in (("temperature", "C", grid.temperature_c), ("slope", "C/min", grid.slope_c_per_min)):
        _numbers(_content(_instance(tree, names[what], "COM_AXIS"), unit), points)
    rest = _instance(tree, names["rest"], "CURVE")
    _numbers(_content(rest, "deg/h"), grid.rest_dph)
    _axes(rest, (names["temperature"],))
    whole = _instance(tree, names["map"], "MAP")
    values = _content(whole, "deg/h")
    for slope, row in zip(grid.slope_c_per_min, grid.bias_dph.T, strict=True):
        group = SubElement(values, "VG")
        _add(group, "LABEL", _number(slope))
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
        _add(parent, "V", _number(value))


def _add(parent: Element, tag: str, text: str) -> None:
    SubElement(parent, tag).text = text
