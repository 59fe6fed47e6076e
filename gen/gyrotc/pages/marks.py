"""Marks of charts as SVG: lines, points, areas, bars and words between two scales, and the scales themselves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from html import escape
from itertools import pairwise

import numpy as np

from ..common.arrays import FloatArray
from ..common.texts import picture_text
from .display import is_plain, power

_ROUND = (1.0, 2.0, 5.0, 10.0, 20.0)  # steps whose multiples people read at a glance; 10 begins the next decade


@dataclass(frozen=True, slots=True)
class AxisScale:
    """An axis from `low` to `high`; `exponent`: the power of ten that its numbers are written without.

    `linear_to`: 0: a linear axis; infinite: a logarithmic one; else linear up to there on both sides of zero.
    """

    low: float
    high: float
    linear_to: float = 0.0
    whole: bool = False

    @property
    def exponent(self) -> int:
        largest = max(abs(self.low), abs(self.high))
        if self.linear_to or largest == 0.0:
            return 0
        found = math.floor(math.log10(largest))
        return 0 if is_plain(found) else found

    def _stretched(self, values: FloatArray) -> FloatArray:
        if not self.linear_to:
            return values
        if math.isinf(self.linear_to):
            with np.errstate(divide="ignore", invalid="ignore"):
                return np.asarray(np.where(values > 0.0, np.log10(np.abs(values)), np.nan))
        edge, size = self.linear_to, np.abs(values)
        far = edge * (1.0 + np.log10(np.maximum(size, edge) / edge))
        return np.asarray(np.sign(values) * np.where(size > edge, far, size))

    def place(self, values: FloatArray) -> FloatArray:
        """Return the places of numbers: 0 at `low`, 1 at `high`; NaN where a logarithmic axis has none."""
        a, b = self._stretched(np.array([self.low, self.high]))
        return np.asarray((self._stretched(np.asarray(values, dtype=np.float64)) - a) / (b - a))

    def ticks(self, most: int) -> list[tuple[float, str]]:
        """Return at most about `most` round numbers with their labels."""
        if math.isinf(self.linear_to):
            return self._powers(most)
        if self.linear_to:
            return self._both(most)
        step = _step(self.low, self.high, most)
        if self.whole:
            step = max(round(step), 1.0)
        first, last = math.ceil(self.low / step - 1e-9), math.floor(self.high / step + 1e-9)
        scaled = step / 10.0**self.exponent
        digits = max(0, -math.floor(math.log10(scaled) + 1e-9))
        return [(k * step, _minus(f"{k * scaled:.{digits}f}")) for k in range(first, last + 1)]

    def _powers(self, most: int) -> list[tuple[float, str]]:
        a, b = math.log10(self.low), math.log10(self.high)
        decades = range(math.ceil(a - 1e-9), math.floor(b + 1e-9) + 1)
        if len(decades) > 2:
            every = max(math.ceil(len(decades) / most), 1)
            return [(10.0**k, _plain(10.0**k)) for k in decades if k % every == 0]
        numbers = [f * 10.0**k for k in range(math.floor(a), math.ceil(b) + 1) for f in _ROUND[:3]]
        return [(v, _plain(v)) for v in numbers if self.low * (1 - 1e-9) <= v <= self.high * (1 + 1e-9)]

    def _both(self, most: int) -> list[tuple[float, str]]:
        step = _step(0.0, self.linear_to, max(most // 2, 2))
        inner = [k * step for k in range(int(self.linear_to / step + 1e-9) + 1)]
        decades = range(math.ceil(math.log10(self.linear_to) + 1e-9), math.floor(math.log10(self.high)) + 1)
        return [(v, f"{v:g}") for v in (*inner, *(10.0**k for k in decades)) if self.low <= v <= self.high]


def _step(low: float, high: float, most: int) -> float:
    """The least round step of which at most one more than `most` lie in a range."""
    unit = 10.0 ** math.floor(math.log10((high - low) / (most + 1)))
    return next(
        f * unit for f in _ROUND if math.floor(high / (f * unit) + 1e-9) - math.ceil(low / (f * unit) - 1e-9) <= most
    )


def _minus(text: str) -> str:
    zero = not text.strip("-0.")
    return text.lstrip("-") if zero else text.replace("-", "−")


def _plain(value: float) -> str:
    exponent = math.floor(math.log10(value) + 1e-9)
    if is_plain(exponent):
        return f"{value:g}"
    mantissa = round(value / 10.0**exponent)
    return power(exponent) if mantissa == 1 else f"{mantissa}·{power(exponent)}"


def scale_of(
    numbers: FloatArray,
    limits: tuple[float | None, float | None],
    log: bool | float,
    margin: float,
    *,
    whole: bool = False,
) -> AxisScale:
    """The scale of an axis that has to hold these numbers.

    Args:
        numbers: Finite, shape (n,); n may be 0.
        limits: From and to, where they are given.
        log: True for a logarithmic axis; a number: linear up to there.
        margin: Room at either side, as a share of the range; none at a given limit.
        whole: Only whole numbers are written.
    """
    logarithmic = log is True
    if logarithmic:
        numbers = numbers[numbers > 0.0]
    low, high = (float(numbers.min()), float(numbers.max())) if numbers.size else (1.0, 10.0)
    low, high = (own if own is not None else found for own, found in zip(limits, (low, high), strict=True))
    if not high > low:
        around = 0.1 * abs(low) or 0.5
        low, high = (low / 2.0, low * 2.0) if logarithmic else (low - around, high + around)
    if logarithmic:
        more = (high / low) ** margin
        return AxisScale(
            low if limits[0] is not None else low / more, high if limits[1] is not None else high * more, math.inf
        )
    room = margin * (high - low)
    low, high = low - room * (limits[0] is None), high + room * (limits[1] is None)
    return AxisScale(low, high, 0.0 if isinstance(log, bool) else log, whole)


Box = tuple[float, float, float, float]
"""Left, top, width and height, points."""
_MOST = 4000  # points of a line: four for each column of the widest picture, more cannot be seen


@dataclass
class Drawn:
    """Something in a panel: its SVG is made when the scales are known."""

    kind: str
    x: FloatArray
    y: FloatArray
    color: str
    label: str = ""
    width: float = 1.2
    dash: str = ""
    far: FloatArray | None = None
    title: str = ""
    texts: tuple[str, ...] = ()


def legend_sample(mark: Drawn, x: float, y: float) -> str:
    if mark.kind in ("band", "span", "bars"):
        kind = "" if mark.kind == "bars" else ' class="area"'
        return f'<g{kind}><rect class="f-{mark.color}" x="{x:g}" y="{y - 5:g}" width="20" height="10"/></g>'
    if mark.kind == "dots":
        return _dotted(f"M{x + 10:g} {y:g}h0", mark.color, max(mark.width, 5.0))
    if mark.kind == "rings":
        return _ring(x + 10.0, y, mark.color, mark.width)
    return f'<path d="M{x:g} {y:g}h20" class="s-{mark.color}" stroke-width="{max(mark.width, 1.2):g}"{_dash(mark)}/>'


def _dash(mark: Drawn) -> str:
    return f' stroke-dasharray="{mark.dash}"' if mark.dash else ""


def _dotted(path: str, color: str, size: float) -> str:
    still = ' vector-effect="non-scaling-stroke"'
    return f'<path class="dots s-{color}" stroke-width="{size:g}" d="{path}"{still}/>'


def _ring(x: float, y: float, color: str, size: float) -> str:
    half = size / 2
    return (
        f'<path class="s-{color}" stroke-width="1.2" d="M{x - half:.1f} {y:.1f}a{half:g} {half:g} 0 1 0 {size:g} 0'
        f'a{half:g} {half:g} 0 1 0 {-size:g} 0"/>'
    )


def text_svg(x: float, y: float, text: str, *, anchor: str = "start", more: str = "") -> str:
    where = "" if anchor == "start" else f' text-anchor="{anchor}"'
    return f'<text x="{x:.1f}" y="{y:.1f}"{where}{more}>{escape(text, quote=False)}</text>'


def mark_svg(mark: Drawn, box: Box, xs: AxisScale, ys: AxisScale) -> str:
    x0, y0, w, h = box
    x = x0 + w * xs.place(mark.x)
    y = y0 + h * (1.0 - ys.place(mark.y))
    far = None if mark.far is None else y0 + h * (1.0 - ys.place(mark.far))
    stroke = f'class="s-{mark.color}" stroke-width="{mark.width:g}"{_dash(mark)} vector-effect="non-scaling-stroke"'
    match mark.kind:
        case "line":
            title = f"<title>{escape(picture_text(mark.title), quote=False)}</title>" if mark.title else ""
            return f'<path {stroke} d="{_path(*_thinned(x, y))}">{title}</path>'
        case "dots":
            return _dotted(_points(x, y), mark.color, mark.width)
        case "rings":
            return "".join(_ring(a, b, mark.color, mark.width) for a, b in zip(x, y, strict=True))
        case "band":
            assert far is not None
            return f'<g class="area"><path class="f-{mark.color}" style="fill-opacity:1" d="{_area(x, y, far)}"/></g>'
        case "errors":
            assert far is not None
            d = "".join(
                f"M{a:.1f} {b:.1f}V{c:.1f}M{a - 3:.1f} {b:.1f}h6M{a - 3:.1f} {c:.1f}h6"
                for a, b, c in zip(x, y, far, strict=True) if math.isfinite(a + b + c)
            )  # fmt: skip
            return f'<path class="s-{mark.color}" stroke-width="1" d="{d}"/>'
        case "vertical":
            return f'<path {stroke} d="M{x[0]:.1f} {y0:.1f}v{h:.1f}"/>'
        case "horizontal":
            return f'<path {stroke} d="M{x0:.1f} {y[0]:.1f}h{w:.1f}"/>'
        case "span":
            a, b = float(x.min()), max(float(x.max()), float(x.min()) + 1.0)
            return (
                f'<g class="area"><rect class="f-{mark.color}" x="{a:.1f}" y="{y0:.1f}" '
                f'width="{b - a:.1f}" height="{h:.1f}"/></g>'
            )
        case "tops":
            d = "".join(f"M{a - 3.5:.1f} {y0 + 1:.1f}h7l-3.5 6z" for a in x)
            return f'<g class="f-accent"><path class="f-accent" style="fill-opacity:1" d="{d}"/></g>'
        case "bars":
            zero = x0 + w * float(xs.place(np.zeros(1))[0])
            high = mark.width * h * abs(float(ys.place(np.array([ys.low + 1.0]))[0]))
            return "".join(
                f'<rect class="f-{mark.color}" x="{min(a, zero):.1f}" y="{b - high / 2:.1f}" '
                f'width="{abs(a - zero):.1f}" height="{high:.1f}"/>'
                for a, b in zip(x, y, strict=True)
            )
        case _:
            return "".join(text_svg(a + 5.0, b + 4.0, t) for a, b, t in zip(x, y, mark.texts, strict=True))


def _thinned(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A line of many points by the first, least, largest and last of each column of points: it looks the same."""
    if len(x) < _MOST or not np.all(x[1:] >= x[:-1]) or not np.isfinite(y).all():
        return x, y
    column = np.floor(x).astype(np.int64)
    starts = np.flatnonzero(np.concatenate(([True], column[1:] != column[:-1])))
    kept = []
    for a, b in pairwise([*starts.tolist(), len(x)]):
        part = y[a:b]
        kept += sorted({a, a + int(part.argmin()), a + int(part.argmax()), b - 1})
    return x[kept], y[kept]


def _path(x: FloatArray, y: FloatArray) -> str:
    parts, pen = [], "M"
    for a, b in zip(x.tolist(), y.tolist(), strict=True):
        if math.isfinite(a) and math.isfinite(b):
            parts.append(f"{pen}{a:.1f} {b:.1f}")
            pen = "L"
        else:
            pen = "M"
    return "".join(parts)


def _points(x: FloatArray, y: FloatArray) -> str:
    """Points, each place of half a point once."""
    known = np.isfinite(x) & np.isfinite(y)
    places = np.unique(np.round(2.0 * np.column_stack((x[known], y[known]))), axis=0) / 2.0
    return "".join(f"M{a:g} {b:g}h0" for a, b in places.tolist())


def _area(x: FloatArray, low: FloatArray, high: FloatArray) -> str:
    known = np.isfinite(x) & np.isfinite(low) & np.isfinite(high)
    there = np.flatnonzero(known)
    parts = []
    for run in np.split(there, np.flatnonzero(np.diff(there) > 1) + 1):
        if len(run):
            back = run[::-1]
            parts.append(_path(np.r_[x[run], x[back]], np.r_[low[run], high[back]]) + "z")
    return "".join(parts)
