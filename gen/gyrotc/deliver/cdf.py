"""ASAM CDF 2.0 (`.cdfx`): the values of what the A2L file describes, by the same names."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from ..common.texts import toml_comment
from .asap2 import names_of
from .grid import MapGrid

__all__ = ["cdf_text"]

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
