"""Values over two axes as colours: a picture within a chart, its scale beside it, and hatched cells."""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from .marks import Box, text_svg
from .scales import AxisScale, scale_of

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
    data = (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", head)
        + chunk(b"IDAT", zlib.compress(lines, 9))
        + chunk(b"IEND", b"")
    )
    return "data:image/png;base64," + base64.b64encode(data).decode("ascii")


def image_svg(
    image: Image, box: Box, xs: AxisScale, ys: AxisScale, named: Callable[[str, AxisScale], str]
) -> str:
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
        parts.append(
            text_svg(right + 16.0, y + h * (1.0 - float(scale.place(np.array([at]))[0])) + 4.0, text)
        )
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
