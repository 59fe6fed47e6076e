"""Draw charts as SVG text: panels with scales, marks, ticks and a legend; the same data give the same bytes.

Colours are names (`LINE_COLOURS`), so that a style sheet within the picture turns them for a dark screen. Coordinates
are in points of a picture that is 960 wide over a whole page; browsers scale it. Values over two axes are colours, an
image within the chart.
"""

from __future__ import annotations

import base64
import math
import re
import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from markupsafe import Markup
from numpy.typing import ArrayLike, NDArray

from ..common.arrays import FloatArray
from ..common.texts import checked_svg, picture_text, pictures_in_rows
from .display import power
from .marks import AxisScale, Box, Drawn, legend_sample, mark_svg, scale_of, text_svg

_CIVIDIS = ("#00224e", "#35456c", "#666970", "#948e77", "#c8b866", "#fee838")
"""Steps of cividis, which looks alike to people who see few colours (Nuñez, Anderton and Renslow 2018)."""


@dataclass
class Image:
    values: FloatArray
    x: tuple[float, float]
    y: tuple[float, float]
    hidden: NDArray[np.bool_] | None
    bar: str


def _colored(values: FloatArray) -> NDArray[np.uint8]:
    """0 ... 1 as red, green, blue."""
    steps = np.array([[int(c[k : k + 2], 16) for k in (1, 3, 5)] for c in _CIVIDIS], dtype=np.float64)
    at = np.clip(values, 0.0, 1.0) * (len(steps) - 1)
    places = np.arange(len(steps))
    channels = [np.interp(at, places, steps[:, k]) for k in range(3)]
    return np.asarray(np.stack(channels, axis=-1).round(), dtype=np.uint8)


def _png(pixels: NDArray[np.uint8]) -> str:
    """Pixels, shape (rows from above, columns, 3), as the text of a PNG file (W3C PNG, third edition, 5 and 9)."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows, columns, _ = pixels.shape
    lines = np.concatenate((np.zeros((rows, 1), np.uint8), pixels.reshape(rows, -1)), axis=1).tobytes()
    head = struct.pack(">IIBBBBB", columns, rows, 8, 2, 0, 0, 0)
    data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(lines, 9)) + chunk(b"IEND", b"")
    return "data:image/png;base64," + base64.b64encode(data).decode("ascii")


def image_svg(image: Image, box: Box, xs: AxisScale, ys: AxisScale, named: Callable[[str, AxisScale], str]) -> str:
    """The picture and its scale; `named` gives the words of an axis."""
    x, y, w, h = box
    finite = image.values[np.isfinite(image.values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    if not high > low:
        low, high = low - 0.5, high + 0.5
    a, b = x + w * xs.place(np.array(image.x))
    d, c = y + h * (1.0 - ys.place(np.array(image.y)))
    parts = [_picture(_colored((image.values[::-1] - low) / (high - low)), a, c, b - a, d - c)]
    if image.hidden is not None:
        parts.append(_hatched(image.hidden, a, c, b - a, d - c))
    right = x + w + 12.0
    shades = np.linspace(1.0, 0.0, 64)[:, None]
    parts.append(_picture(_colored(shades), right, y, 12.0, h))
    scale = scale_of(np.array([low, high]), (low, high), False, 0.0)
    for at, text in scale.ticks(max(int(h / 36.0), 2)):
        parts.append(text_svg(right + 16.0, y + h * (1.0 - float(scale.place(np.array([at]))[0])) + 4.0, text))
    middle = f' transform="rotate(-90 {x + w + 70.0:.1f} {y + h / 2:.1f})"'
    parts.append(text_svg(x + w + 70.0, y + h / 2, named(image.bar, scale), anchor="middle", more=middle))
    return "".join(parts)


def _picture(pixels: NDArray[np.uint8], x: float, y: float, w: float, h: float) -> str:
    place = f'x="{x:.1f}" y="{y:.1f}" width="{w:.1f}" height="{h:.1f}"'
    return f'<image {place} preserveAspectRatio="none" href="{_png(pixels)}"/>'


def _hatched(hidden: NDArray[np.bool_], x: float, y: float, w: float, h: float) -> str:
    """White lines over cells, shape (rows from below, columns)."""
    rows, columns = hidden.shape
    cell_w, cell_h = w / columns, h / rows
    lines = '<path d="M-1 7L7 -1M3 9L9 3" stroke="#fff" stroke-width="0.9"/>'
    size = 'width="6" height="6" patternUnits="userSpaceOnUse"'
    pattern = f'<defs><pattern id="gy-hatch" {size}>{lines}</pattern></defs>'
    d = "".join(
        f"M{x + k * cell_w:.1f} {y + (rows - 1 - r) * cell_h:.1f}h{cell_w:.2f}v{cell_h:.2f}h{-cell_w:.2f}z"
        for r, k in zip(*(v.tolist() for v in np.nonzero(hidden)), strict=True)
    )
    return f'{pattern}<g><path d="{d}" style="fill:url(#gy-hatch)"/></g>'


FULL, HALF, THIRD = 960.0, 470.0, 310.0  # widths of a picture over the page, and of two and three in a row
BEFORE, AFTER, COVERED, ACCENT = "before", "after", "covered", "accent"
LINE_COLOURS = {
    BEFORE: ("#b4552d", "#f08c5e"),
    AFTER: ("#1f6f8b", "#62bbd9"),
    COVERED: ("#7a7a7a", "#9aa0a6"),
    ACCENT: ("#222222", "#e8e8e6"),
}
"""On a light ground, and on a dark one."""

_GRID = ("#e4e4e4", "#363c42")
_TEXT, _SMALL = 12.0, 11.0  # points
_WIDE = 0.56  # of the size of letters: a mean one of the usual fonts without serifs
_MARGIN = 0.04  # of the data's range, beyond it at either side
_LINE = 16.0  # height of a line of text
_GAP = 18.0  # between panels
_SIZE = re.compile(r'viewBox="0 0 ([\d.]+) ([\d.]+)"')


def _style() -> str:
    def rules(k: int) -> str:
        named = "".join(
            f".gy .s-{n}{{stroke:{c[k]}}}.gy .f-{n},.gy text.f-{n}{{fill:{c[k]}}}" for n, c in LINE_COLOURS.items()
        )
        return f".gy text{{fill:{LINE_COLOURS[ACCENT][k]}}}.gy .grid{{stroke:{_GRID[k]}}}" + named

    still = (
        ".gy{font:11px system-ui,'DejaVu Sans',sans-serif}.gy path,.gy line{fill:none;stroke-linejoin:round}"
        ".gy .dots{stroke-linecap:round}.gy .title{font-size:12px}.gy .area{stroke:none;opacity:.25}"
    )
    dark = rules(1)
    return f"<style>{still}{rules(0)}@media screen and (prefers-color-scheme:dark){{{dark}}}</style>"


@dataclass
class Panel:
    """One pair of axes and what is drawn between them.

    Args:
        x, y: Words of the axes; a unit stands last, behind a comma.
        x_log, y_log: Logarithmic; a number is the place up to which the axis is linear.
        x_range, y_range: From and to; None: what the data need.
        x_ticks, y_ticks: Places and words, in place of numbers.
    """

    x: str = ""
    y: str = ""
    title: str = ""
    x_log: bool | float = False
    y_log: bool | float = False
    x_range: tuple[float | None, float | None] = (None, None)
    y_range: tuple[float | None, float | None] = (None, None)
    x_ticks: Sequence[tuple[float, str]] | None = None
    y_ticks: Sequence[tuple[float, str]] | None = None
    whole_x: bool = False
    zoom: bool = False
    marks: list[Drawn] = field(default_factory=list)
    background: Image | None = None

    def line(
        self, x: ArrayLike, y: ArrayLike, color: str, label: str = "", *,
        width: float = 1.2, dash: str = "", title: str = "",
    ) -> None:  # fmt: skip
        """Add a line through points, broken where one is not finite."""
        self._add("line", x, y, color, label, width=width, dash=dash, title=title)

    def dots(
        self, x: ArrayLike, y: ArrayLike, color: str, label: str = "", *, size: float = 4.0, hollow: bool = False
    ) -> None:
        """Add points, `size` across."""
        self._add("rings" if hollow else "dots", x, y, color, label, width=size)

    def band(self, x: ArrayLike, low: ArrayLike, high: ArrayLike, color: str, label: str = "") -> None:
        """Add the area between two lines."""
        self._add("band", x, low, color, label, far=np.asarray(high, dtype=np.float64))

    def errors(self, x: ArrayLike, low: ArrayLike, high: ArrayLike, color: str) -> None:
        """Add bars of uncertainty from `low` to `high`."""
        self._add("errors", x, low, color, far=np.asarray(high, dtype=np.float64))

    def vertical(self, x: float, color: str = ACCENT, label: str = "", *, dash: str = "", width: float = 0.8) -> None:
        """Add a line from bottom to top."""
        self._add("vertical", [x], [np.nan], color, label, dash=dash, width=width)

    def horizontal(self, y: float, color: str = ACCENT, label: str = "", *, dash: str = "", width: float = 0.8) -> None:
        """Add a line from left to right."""
        self._add("horizontal", [np.nan], [y], color, label, dash=dash, width=width)

    def span(self, low: float, high: float, color: str, label: str = "") -> None:
        """Add a shaded part of the x axis."""
        self._add("span", [low, high], [np.nan, np.nan], color, label)

    def bars(self, values: ArrayLike, places: ArrayLike, color: str, label: str = "", *, height: float = 0.6) -> None:
        """Add bars from zero to the right; `height` is in units of the y axis."""
        self._add("bars", values, places, color, label, width=height)

    def tops(self, x: ArrayLike) -> None:
        """Add triangles at the upper edge."""
        self._add("tops", x, np.full(np.size(x), np.nan), ACCENT)

    def words(self, x: ArrayLike, y: ArrayLike, texts: Sequence[str]) -> None:
        """Add text to the right of places."""
        self._add("words", x, y, ACCENT, texts=tuple(texts))

    def image(
        self, values: FloatArray, x: tuple[float, float], y: tuple[float, float], bar: str,
        hidden: NDArray[np.bool_] | None = None,
    ) -> None:  # fmt: skip
        """Show values, shape (rows from below, columns), as colours between the axes; `hidden` cells are hatched."""
        self.background = Image(values, x, y, hidden, bar)

    def _add(self, kind: str, x: ArrayLike, y: ArrayLike, color: str, label: str = "", **more: object) -> None:
        at, to = (np.atleast_1d(np.asarray(v, dtype=np.float64)) for v in (x, y))
        self.marks.append(Drawn(kind, at, to, color, label, **more))  # type: ignore[arg-type]

    def span_of(self, axis: str) -> FloatArray:
        """The numbers that an axis has to hold."""
        own = self.x_range if axis == "x" else self.y_range
        found = [np.array([v for v in own if v is not None], dtype=np.float64)]
        for mark in self.marks:
            paired = mark.kind not in ("vertical", "horizontal", "span", "tops")  # which have one coordinate
            known = np.isfinite(mark.x) & np.isfinite(mark.y) if paired else slice(None)
            found.append((mark.x if axis == "x" else mark.y)[known])
            if axis == "y" and mark.far is not None and mark.kind in ("band", "errors"):
                found.append(mark.far)
            if mark.kind == "bars" and axis == "x":
                found.append(np.zeros(1))
        if self.background:
            found.append(np.array(self.background.x if axis == "x" else self.background.y))
        numbers = np.concatenate(found)
        return np.asarray(numbers[np.isfinite(numbers)])


def side_by_side(*pictures: Markup | None) -> Markup | None:
    """Put pictures beside each other where there is room; None without a picture."""
    there = [picture for picture in pictures if picture is not None]
    if not there:
        return None
    return pictures_in_rows(there, "small" if f'viewBox="0 0 {THIRD:g} ' in there[0] else "")


def drawing(
    panels: Sequence[Panel], *, columns: int = 1, width: float = FULL, height: float = 190.0,
    heights: Sequence[float] | None = None, share_x: bool = False, share_y: bool = False,
) -> Markup:  # fmt: skip
    """Draw panels in a grid as one `<svg>` element, with one legend above.

    Args:
        height: Height of the axes of a row, points.
        heights: Height of each row, in place of `height`.
        share_x, share_y: All panels have one range; a shared y axis is written at the left only.
    """
    rows = -(-len(panels) // columns)
    tall = list(heights or [height] * rows)
    xs = _scales(panels, "x", share_x)
    ys = _scales(panels, "y", share_y)
    legend, top = _legend(panels, width)
    parts, y = [legend], top
    lefts = [_left(panel, scale, tall[k // columns]) for k, (panel, scale) in enumerate(zip(panels, ys, strict=True))]
    column_left = [8.0 if share_y and column else max(lefts[column::columns], default=0.0) for column in range(columns)]
    rights = [76.0 if panel.background else 10.0 for panel in panels]
    column_right = [max(rights[column::columns], default=0.0) for column in range(columns)]
    inner = (width - sum(column_left) - sum(column_right) - _GAP * (columns - 1)) / columns
    for row in range(rows):
        members = range(row * columns, min((row + 1) * columns, len(panels)))
        head = _LINE + 4.0 if any(panels[k].title for k in members) else 4.0
        last = row == rows - 1
        foot = max(_foot(panels[k], last or not share_x or k + columns >= len(panels)) for k in members)
        for k in members:
            column = k - row * columns
            x = sum(column_left[: column + 1]) + sum(column_right[:column]) + (inner + _GAP) * column
            box = (x, y + head, inner, tall[row])
            bottom = last or not share_x or k + columns >= len(panels)
            parts.append(_panel(panels[k], box, xs[k], ys[k], left=not share_y or column == 0, bottom=bottom))
        y += head + tall[row] + foot
    size = f'viewBox="0 0 {width:g} {y:.0f}" width="100%"'
    small = " half" if width <= HALF else ""
    return checked_svg(
        f'<svg xmlns="http://www.w3.org/2000/svg" class="gy{small}" {size}>{_style()}{"".join(parts)}</svg>'
    )


def stacked(*pictures: Markup) -> Markup:
    """Put pictures of one width below each other, as one `<svg>` element."""
    parts, y, wide = [], 0.0, FULL
    for picture in pictures:
        size = _SIZE.search(picture)
        assert size is not None
        wide, height = float(size[1]), float(size[2])
        parts.append(str(picture).replace(' width="100%"', f' y="{y:g}" width="{wide:g}" height="{height:g}"', 1))
        y += height
    head = f'<svg xmlns="http://www.w3.org/2000/svg" class="gy" viewBox="0 0 {wide:g} {y:g}" width="100%">'
    return checked_svg(f"{head}{''.join(parts)}</svg>")


def _scales(panels: Sequence[Panel], axis: str, shared: bool) -> list[AxisScale]:
    numbers = [panel.span_of(axis) for panel in panels]
    if shared:
        numbers = [np.concatenate(numbers)] * len(panels)
    made = []
    for panel, found in zip(panels, numbers, strict=True):
        log, limits = (panel.x_log, panel.x_range) if axis == "x" else (panel.y_log, panel.y_range)
        margin = 0.0 if panel.background else _MARGIN
        made.append(scale_of(found, limits, log, margin, whole=axis == "x" and panel.whole_x))
    return made


def _wide(text: str) -> float:
    return _WIDE * _SMALL * len(text)


def _ticks(panel: Panel, scale: AxisScale, axis: str, length: float) -> list[tuple[float, str]]:
    given = panel.x_ticks if axis == "x" else panel.y_ticks
    if given is None:
        return scale.ticks(max(int(length / (55.0 if axis == "x" else 36.0)), 2))
    if axis == "y":
        return [(at, picture_text(text)) for at, text in given]
    kept: list[tuple[float, str]] = []
    free = -math.inf
    for at, text in given:  # those that fit beside each other
        half = max(_wide(part) for part in text.split("\n")) / 2 + 3.0
        middle = float(scale.place(np.array([at]))[0]) * length
        if middle - half >= free:
            kept.append((at, text))
            free = middle + half
    return kept


def _left(panel: Panel, scale: AxisScale, height: float) -> float:
    widest = max((_wide(text) for _, text in _ticks(panel, scale, "y", height)), default=0.0)
    return widest + 10.0 + (_LINE + 2.0 if panel.y else 0.0)


def _foot(panel: Panel, numbered: bool) -> float:
    return (_LINE + (_LINE + 2.0 if panel.x else 0.0) if numbered else 0.0) + 8.0


def _legend(panels: Sequence[Panel], width: float) -> tuple[str, float]:
    """One entry for each label, in lines from the left; and their height."""
    entries: dict[str, Drawn] = {}
    for panel in panels:
        for mark in panel.marks:
            if mark.label:
                entries.setdefault(mark.label, mark)
    parts, x, y = [], 4.0, 12.0
    for label, mark in entries.items():
        text = picture_text(label)
        need = 26.0 + _wide(text) + 16.0
        if x > 4.0 and x + need > width:
            x, y = 4.0, y + _LINE
        parts.append(legend_sample(mark, x, y - 4.0) + text_svg(x + 26.0, y, text))
        x += need
    return "".join(parts), y + 6.0 if entries else 2.0


def _panel(
    panel: Panel, box: tuple[float, float, float, float], xs: AxisScale, ys: AxisScale, *, left: bool, bottom: bool
) -> str:
    x, y, w, h = box
    parts = []
    if panel.title:
        parts.append(text_svg(x, y - 7.0, picture_text(panel.title), more=' class="title"'))
    x_ticks, y_ticks = _ticks(panel, xs, "x", w), _ticks(panel, ys, "y", h)
    at_x = x + w * xs.place(np.array([at for at, _ in x_ticks]))
    at_y = y + h * (1.0 - ys.place(np.array([at for at, _ in y_ticks])))
    grid = "".join(f"M{a:.1f} {y:.1f}v{h:.1f}" for a in at_x) + "".join(f"M{x:.1f} {b:.1f}h{w:.1f}" for b in at_y)
    frame = f"M{x:.1f} {y:.1f}v{h:.1f}h{w:.1f}"
    if panel.background:
        parts.append(image_svg(panel.background, box, xs, ys, _named))
    else:
        parts.append(f'<path class="grid" stroke-width="0.8" d="{grid}"/>')
    parts.append(_drawn(panel, box, xs, ys))
    parts.append(f'<path class="s-accent" stroke-width="0.9" d="{frame}"/>')
    if bottom:
        parts.append('<g class="numbers">' + "".join(
            text_svg(a, y + h + 14.0, text, anchor="middle") for a, (_, text) in zip(at_x, x_ticks, strict=True)
        ) + "</g>")  # fmt: skip
        if panel.x:
            under = y + h + _foot(panel, True) - 10.0
            parts.append(text_svg(x + w / 2, under, _named(panel.x, xs), anchor="middle"))
    if left:
        parts.append('<g class="numbers">' + "".join(
            text_svg(x - 6.0, b + 4.0, text, anchor="end") for b, (_, text) in zip(at_y, y_ticks, strict=True)
        ) + "</g>")  # fmt: skip
        if panel.y:
            at = x - max((_wide(text) for _, text in y_ticks), default=0.0) - 16.0
            rotated = f' transform="rotate(-90 {at:.1f} {y + h / 2:.1f})"'
            parts.append(text_svg(at, y + h / 2, _named(panel.y, ys), anchor="middle", more=rotated))
    return "".join(parts)


def _named(words: str, scale: AxisScale) -> str:
    """Words of an axis, with the power of ten of its numbers before the unit."""
    if not scale.exponent:
        return picture_text(words)
    before, comma, unit = words.rpartition(", ")
    return picture_text(f"{before}{comma}{power(scale.exponent)} {unit}")


_clips = "gy-clip"


def _drawn(panel: Panel, box: tuple[float, float, float, float], xs: AxisScale, ys: AxisScale) -> str:
    """The marks, cut off at the axes."""
    x, y, w, h = box
    name = f"{_clips}-{x:.0f}-{y:.0f}-{w:.0f}-{h:.0f}"
    inside = "".join(mark_svg(mark, box, xs, ys) for mark in panel.marks)
    clip = f'<clipPath id="{name}"><rect x="{x:.1f}" y="{y:.1f}" width="{w:.1f}" height="{h:.1f}"/></clipPath>'
    data = ""
    if panel.zoom:
        limits = " ".join(f"{v:.9g}" for v in (xs.low, xs.high, ys.low, ys.high))
        data = f' class="zoom" data-box="{x:.1f} {y:.1f} {w:.1f} {h:.1f}" data-limits="{limits}"'
        inside = f'<g class="moved">{inside}</g>'
    return f'{clip}<g clip-path="url(#{name})"{data}>{inside}</g>'
