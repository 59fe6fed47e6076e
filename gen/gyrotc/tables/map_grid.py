"""The static map at the points of a grid of temperatures and rates of temperature, as CSV and JSON."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import __version__
from ..common.arrays import FloatArray
from ..model import Model
from ..results.release import MapOnGrid

# Temperatures and rates of temperature: a finer grid than any map of a gyro needs.
_POINTS = (61, 25)
# The error of interpolation is evaluated at this many places of a cell in each direction, its corner among them.
_PLACES_IN_CELL = 4


@dataclass(frozen=True, slots=True)
class MapGrid:
    """A map at the points of a grid.

    Attributes:
        model: Model of the map.
        temperature_c: Shape (n,), ascending; every number is one of float32.
        slope_c_per_min: Shape (m,), likewise; 0 is among them where the envelope contains it.
        bias_dph: Shape (n, m).
        rms_dph, max_abs_dph: Error of bilinear interpolation of the points in float32 against the map.
    """

    model: Model
    temperature_c: FloatArray
    slope_c_per_min: FloatArray
    bias_dph: FloatArray
    rms_dph: float
    max_abs_dph: float

    @property
    def summary(self) -> str:
        """The number of points, and what the grid lacks against the map and its terms."""
        shape = f"{self.temperature_c.size} x {self.slope_c_per_min.size}"
        terms = [term.id for term in self.model.terms]
        without = f"; without the terms {', '.join(terms)}" if terms else ""
        return (
            f"{shape} points; bilinear interpolation departs from the map by {self.rms_dph:.2e} deg/h RMS, "
            f"at most {self.max_abs_dph:.2e} deg/h{without}"
        )


def grid_of_map(model: Model, points: tuple[int, int] = _POINTS) -> MapGrid:
    """Return the map of a model over its envelope, without its terms."""
    t = _axis_points(model.envelope.temperature_c, points[0])
    r = _axis_points(model.envelope.slope_c_per_min, points[1])
    if r.size > 2 and r[0] < 0.0 < r[-1]:  # a gyro at rest is asked for most
        r[1 + int(np.argmin(np.abs(r[1:-1])))] = 0.0
    bias = model.map_dph(*np.meshgrid(t, r, indexing="ij"))
    error = _interpolation_error(model, t, r, bias.astype(np.float32).astype(np.float64))
    rms, max_abs = float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())
    return MapGrid(model, t, r, bias, rms, max_abs)


def csv_text(grid: MapGrid) -> str:
    """Return a row for each temperature and rate."""
    stream = io.StringIO()
    table = csv.writer(stream, lineterminator="\n")
    table.writerow(["serial", "axis", "temperature_c", "slope_c_per_min", "bias_dph"])
    for k, temperature in enumerate(grid.temperature_c):
        for n, slope in enumerate(grid.slope_c_per_min):
            cells = (float(temperature), float(slope), float(grid.bias_dph[k, n]))
            table.writerow([grid.model.serial, grid.model.axis or "", *(repr(cell) for cell in cells)])
    return stream.getvalue()


def map_result(grid: MapGrid) -> MapOnGrid:
    """Return the JSON result (docs/FORMAT.md)."""
    return MapOnGrid(
        gyrotc_version=__version__,
        serial=grid.model.serial,
        axis=grid.model.axis,
        model_hash=grid.model.hash,
        units={"temperature_c": "C", "slope_c_per_min": "C/min", "bias_dph": "deg/h"},
        temperature_c=tuple(grid.temperature_c.tolist()),
        slope_c_per_min=tuple(grid.slope_c_per_min.tolist()),
        bias_dph=tuple(tuple(row) for row in grid.bias_dph.tolist()),
        linear_rms_dph=grid.rms_dph,
        linear_largest_dph=grid.max_abs_dph,
        terms=tuple(term.id for term in grid.model.terms),
    )


def _axis_points(span: tuple[float, float], count: int) -> FloatArray:
    """Return points in float32, each once: an envelope without width has one."""
    return np.unique(np.linspace(*span, count).astype(np.float32)).astype(np.float64)


def _interpolation_error(model: Model, t: FloatArray, r: FloatArray, bias: FloatArray) -> FloatArray:
    """Return bilinear interpolation minus map at places in all cells."""
    (i, u), (k, v) = _places(t), _places(r)
    i1, k1 = np.minimum(i + 1, t.size - 1), np.minimum(k + 1, r.size - 1)
    along = bias[i] + u[:, None] * (bias[i1] - bias[i])
    interpolated = along[:, k] + v * (along[:, k1] - along[:, k])
    at_t, at_r = t[i] + u * (t[i1] - t[i]), r[k] + v * (r[k1] - r[k])
    return np.asarray(interpolated - model.map_dph(*np.meshgrid(at_t, at_r, indexing="ij")))


def _places(axis: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """Return places within the cells of an axis: the number of the cell, and the share of it that is passed."""
    if axis.size == 1:
        return np.zeros(1, dtype=np.int64), np.zeros(1)
    cell = np.repeat(np.arange(axis.size - 1), _PLACES_IN_CELL)
    return cell, np.tile(np.arange(_PLACES_IN_CELL) / _PLACES_IN_CELL, axis.size - 1)
