"""The static map on a grid of temperatures and rates of temperature, and what is lost between the points."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import __version__
from ..common.arrays import FloatArray
from ..model import Model
from ..results.folder import MapOfAxis, MapOnGrid

__all__ = ["GRID", "MapGrid", "csv_text", "grid_of", "map_result"]


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
        maps=tuple(_of_axis(grid) for grid in grids),
    )


def _of_axis(grid: MapGrid) -> MapOfAxis:
    return MapOfAxis(
        axis=grid.model.axis,
        model_hash=grid.model.hash,
        temperature_c=tuple(grid.temperature_c.tolist()),
        slope_c_per_min=tuple(grid.slope_c_per_min.tolist()),
        bias_dph=tuple(tuple(row) for row in grid.bias_dph.tolist()),
        linear_rms_dph=grid.rms_dph,
        linear_largest_dph=grid.largest_dph,
        terms=tuple(term.id for term in grid.model.terms),
    )
