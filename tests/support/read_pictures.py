"""Read pictures of pages back: what each series of each panel shows, in the units of its axes.

Nothing of the code that draws is used. Places on an axis become numbers by the words of its ticks; a series has the
words that the legend gives its kind of mark and colour.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_RAISED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


@dataclass(frozen=True)
class Axis:
    """Pixels to numbers: a line through the ticks, of logarithms where these are equally far apart."""

    words: str
    at_zero: float
    per_pixel: float
    log: bool

    def numbers(self, pixels: Floats) -> Floats:
        straight = self.at_zero + self.per_pixel * pixels
        return np.asarray(10.0**straight if self.log else straight)


@dataclass(frozen=True)
class Series:
    """One mark of a panel: `kind` is line, dots, rings, band, errors, bars, vertical, horizontal or span."""

    kind: str
    colour: str
    label: str
    dash: str
    pixels: Floats
    x: Floats
    y: Floats


@dataclass(frozen=True)
class PanelRead:
    """A panel with its title, its axes and all that is drawn between them."""

    title: str
    x: Axis
    y: Axis
    series: tuple[Series, ...]

    def labelled(self, label: str, kind: str = "line") -> Series:
        (one,) = (s for s in self.series if s.label == label and s.kind == kind)
        return one

    def places(self, x: Floats, y: Floats) -> Floats:
        """Where numbers are drawn, points of the picture, shape (n, 2)."""
        return np.column_stack([_place(self.x, x), _place(self.y, y)])

    def pixels_off(self, series: Series, x: Floats, y: Floats) -> float:
        """Largest distance, in points of the picture, of the drawn places from those that these numbers have."""
        return float(np.abs(series.pixels - self.places(x, y)).max())


def _place(axis: Axis, values: Floats) -> Floats:
    straight = np.log10(values) if axis.log else np.asarray(values, dtype=np.float64)
    return np.asarray((straight - axis.at_zero) / axis.per_pixel)


def pictures_of(page: str) -> list[ET.Element]:
    """The SVG elements of a page, in their order."""
    return [ET.fromstring(_plain(text)) for text in re.findall(r"<svg .*?</svg>", page, re.DOTALL)]


def _plain(svg: str) -> str:
    return re.sub(r'xmlns="[^"]*"', "", re.sub(r"<style>.*?</style>", "", svg, flags=re.DOTALL))


def panels_of(svg: ET.Element | str) -> list[PanelRead]:
    """Panels of a picture; those without ticks of their own have those of the others in their row or column."""
    root = ET.fromstring(_plain(svg)) if isinstance(svg, str) else svg
    legend: dict[tuple[str, str, str], str] = {}
    found: list[tuple[str, ET.Element, list[ET.Element], ET.Element]] = []
    title, sample, begun = "", None, False
    for element in root:
        if element.get("class") == "title":
            title, begun = element.text or "", True
        elif element.tag == "clipPath":
            begun = True
            box = element[0]
        elif element.tag == "g" and (element.get("clip-path") or ""):
            found.append((title, box, [], element))
            title = ""
        elif begun and found:
            found[-1][2].append(element)
        elif not begun and element.tag == "text" and sample is not None:
            legend.setdefault(_look(sample), element.text or "")
            sample = None
        elif not begun and element.get("class") != "grid":
            sample = element
    read = []
    for name, box, after, marks in found:
        x = _axis(after, "middle") or _axis(found[-1][2], "middle")
        y = _axis(after, "end") or next(a for a in (_axis(p[2], "end") for p in found if _beside(p[1], box)) if a)
        assert x is not None
        read.append(PanelRead(name, x, y, tuple(_series(marks, x, y, legend))))
    return read


def _beside(one: ET.Element, other: ET.Element) -> bool:
    return one.get("y") == other.get("y")


def _axis(after: list[ET.Element], anchor: str) -> Axis | None:
    ticks = [t for g in after if g.get("class") == "numbers" for t in g if t.get("text-anchor") == anchor]
    if len(ticks) < 2:
        return None
    rotated = anchor == "end"
    words = [t.text or "" for t in after if t.tag == "text" and bool(t.get("transform")) == rotated]
    texts = [t.text or "" for t in ticks]
    try:
        values = np.array([_value(text) for text in texts])
    except ValueError:  # words in place of numbers: rows, counted
        values = np.arange(len(texts), dtype=np.float64)
    places = np.array([float(t.get("y") or 0) - 4.0 if rotated else float(t.get("x") or 0) for t in ticks])
    # The power of ten that the numbers are written without stands before the unit.
    power = re.search(r"10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", words[0]) if words else None
    values = values * 10.0 ** int(power[1].translate(_RAISED)) if power else values
    log = len(values) > 2 and (values > 0).all() and _bent(places, values) > 1e-2 > _bent(places, np.log10(values))
    straight = np.log10(values) if log else values
    slope, at_zero = np.polyfit(places, straight, 1)
    return Axis(words[0] if words else "", float(at_zero), float(slope), bool(log))


def _bent(places: Floats, values: Floats) -> float:
    """How far values are from a line over places, as a share of their range."""
    line = np.polyval(np.polyfit(places, values, 1), places)
    return float(np.abs(values - line).max() / np.ptp(values))


def _value(text: str) -> float:
    text = text.replace("−", "-")
    if power := re.search(r"10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", text):
        head = text[: power.start()].rstrip("·")
        return float(head or 1.0) * 10.0 ** int(power[1].translate(_RAISED))
    return float(text)


def _look(element: ET.Element) -> tuple[str, str, str]:
    """Kind, colour and dashes of a mark or of a sample in the legend."""
    inner = element[0] if element.tag == "g" else element
    names = (inner.get("class") or "").split()
    colour = next((n.split("-", 1)[1] for n in names if n[:2] in ("s-", "f-")), "")
    d = inner.get("d") or ""
    if inner.tag == "rect" or element.get("class") == "area":
        kind = ("span" if inner.tag == "rect" else "band") if element.get("class") == "area" else "bars"
    elif "dots" in names:
        kind = "dots"
    elif "a" in d:
        kind = "rings"
    elif re.fullmatch(r"M[\d.-]+ [\d.-]+v[\d.-]+", d):
        kind = "vertical"
    elif "V" in d:
        kind = "errors"
    elif re.fullmatch(r"M[\d.-]+ [\d.-]+h[\d.-]+", d) and inner.get("vector-effect"):
        kind = "horizontal"
    else:
        kind = "line"
    return kind, colour, inner.get("stroke-dasharray") or ""


def _series(marks: ET.Element, x: Axis, y: Axis, legend: dict[tuple[str, str, str], str]) -> Iterator[Series]:
    inside = list(marks)
    if len(inside) == 1 and inside[0].get("class") == "moved":
        inside = list(inside[0])
    for element in inside:
        kind, colour, dash = _look(element)
        sampled = {"band": "span", "errors": "none"}.get(kind, kind)
        label = legend.get((sampled, colour, dash), "")
        if kind in ("vertical", "horizontal"):
            label = label or legend.get(("line", colour, dash), "")
        inner = element[0] if element.tag == "g" else element
        pixels = _pixels(kind, inner)
        if pixels.size:
            yield Series(kind, colour, label, dash, pixels, x.numbers(pixels[:, 0]), y.numbers(pixels[:, 1]))


def _pixels(kind: str, element: ET.Element) -> Floats:
    """Places of a mark: of bars their far ends, of bars of uncertainty both ends."""
    if element.tag == "rect":
        left, top, width, height = (float(element.get(name) or 0.0) for name in ("x", "y", "width", "height"))
        if kind == "bars":
            return np.array([[left, top + height / 2], [left + width, top + height / 2]])
        return np.array([[left, top], [left + width, top + height]])
    d = element.get("d") or ""
    if kind == "errors":
        bars = re.findall(r"M([\d.-]+) ([\d.-]+)V([\d.-]+)", d)
        return np.array([[float(a), float(e)] for a, b, c in bars for e in (b, c)])
    if kind == "rings":
        (a, b), (size,) = re.findall(r"M([\d.-]+) ([\d.-]+)", d)[0], re.findall(r"0 1 0 ([\d.]+) 0", d)[:1]
        return np.array([[float(a) + float(size) / 2, float(b)]])
    return np.array([[float(a), float(b)] for a, b in re.findall(r"[ML]([\d.-]+) ([\d.-]+)", d)])


def tables_of(html: Path | str) -> list[list[list[str]]]:
    """Tables of a page: rows of texts of cells."""
    page = html if isinstance(html, str) else html.read_text("utf-8")
    tables = []
    for table in re.findall(r"<table.*?</table>", page, re.DOTALL):
        rows = re.findall(r"<tr.*?</tr>", table, re.DOTALL)
        tables.append([[_text(c) for c in re.findall(r"<t[hd].*?</t[hd]>", row, re.DOTALL)] for row in rows])
    return tables


def _text(html: str) -> str:
    return " ".join(re.sub(r"<[^>]*>", "", html).split())


def number(text: str) -> float:
    """The first number of a text as pages write it: 7.5·10⁻³, (7.2 ± 0.3)·10⁻⁴, −3, 10.7×."""
    plain = text.replace("−", "-").replace(",", "")
    scale = re.search(r"10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", plain)
    found = _NUMBER.search(plain)
    assert found is not None, text
    return float(found[0]) * (10.0 ** int(scale[1].translate(_RAISED)) if scale else 1.0)
