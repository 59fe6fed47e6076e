"""Compare a check run with the earlier map of its unit, in parts of the run, and find the shape of a change."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from ...common.arrays import FloatArray
from ...common.metrics import LEAST_SPAN_C
from ...results.training import ChangeKind, CheckedCell, MapChange
from .hypotheses import COVERAGE_FACTOR
from .learn import FALSE_ALARM
from .run_residual import RunResidual
from .unit_means import UnitMeans
from .use import MapPosterior

TemperatureSpan = tuple[float, float]

_CENTERS = 17  # of regions over the run's temperatures: at half of the narrowest one's width
_WIDTHS = (0.125, 0.25, 0.5)  # of regions, shares of the run's span: narrower ones hold too few means of a short run
_STILL_C_PER_MIN = 0.2  # a chamber that holds: nine tenths of the paper's holds are slower
_LEAST_SHARE = 0.05  # of a run, ramps of one direction: less says nothing of them
_CELLS = 8  # of T, for the table


@dataclass(frozen=True, slots=True)
class _Shape:
    kind: str
    temperature_c: TemperatureSpan
    slope_c_per_min: TemperatureSpan
    values: FloatArray


class Departures:
    """Residual of the earlier map on a run, with its covariance for an unchanged unit."""

    def __init__(self, expected: MapPosterior, run: UnitMeans) -> None:
        """Compare a run with a map that has not seen it.

        Args:
            expected: The earlier model with its ageing.
            run: Means of the check run, as `within`.
        """
        self.run = run
        residual = RunResidual(expected, run)
        self.left, self.covariance = residual.left, residual.scatter(expected.covariance)

    def cells(self) -> Iterator[CheckedCell]:
        """Yield the parts of the run, by temperature and direction of dT/dt."""
        t, r = self.run.temperature_c, self.run.slope_c_per_min
        low, high = _range(t)
        edges = np.linspace(low, high, _CELLS + 1)
        number = np.clip(((t - low) / max(high - low, 1e-9) * _CELLS).astype(int), 0, _CELLS - 1)
        branch = np.sign(np.where(np.abs(r) > _STILL_C_PER_MIN, r, 0.0))
        parts = [(k, b) for k in range(_CELLS) for b in (-1.0, 0.0, 1.0) if np.any((number == k) & (branch == b))]
        reach = -float(ndtri(0.5 * FALSE_ALARM / len(parts)))  # Bonferroni
        for k, b in parts:
            there = (number == k) & (branch == b)
            weight = np.where(there, self.run.count, 0.0)
            weight = weight / weight.sum()
            found = float(weight @ self.left)
            limit = reach * float(np.sqrt(weight @ self.covariance @ weight))
            yield CheckedCell(
                temperature_c=(float(edges[k]), float(edges[k + 1])),
                slope_c_per_min=_range(r[there]),
                found_dph=found,
                limit_dph=limit,
                within=bool(abs(found) <= limit),
            )

    def change(self, kind: ChangeKind) -> MapChange | None:
        """Return the change of a kind, by generalised least squares; None if the map is unchanged."""
        if kind == "unchanged":
            return None
        if kind == "full":
            return self._regional()
        shapes = list(_lines(self.run))[: 1 if kind == "offset" else None]
        columns = np.array([s.values for s in shapes]).T
        known = np.linalg.solve(self.covariance, columns)
        covariance = np.linalg.inv(columns.T @ known)
        sizes, sigmas = covariance @ (known.T @ self.left), np.sqrt(np.diag(covariance))
        best = int(np.argmax(np.abs(sizes[1:]) / sigmas[1:])) + 1 if len(shapes) > 1 else 0
        parts = [_named(*one) for one in zip(shapes, sizes, sigmas, strict=True)]
        return _change(shapes[best], float(sizes[best]), float(sigmas[best]), ", ".join(parts))

    def _regional(self) -> MapChange:
        """Return the single shape that explains most; a region pays for being one of many (a scan: Naus 1965)."""
        shapes = [*_lines(self.run), *_regions(self.run)]
        factor = np.linalg.cholesky(self.covariance)
        columns = np.linalg.solve(factor, np.array([s.values for s in shapes]).T)
        length = np.linalg.norm(columns, axis=0)
        size = (columns / length).T @ np.linalg.solve(factor, self.left)
        regions = sum(s.kind == "local" for s in shapes)
        price = [2.0 * np.log(max(regions, 1)) if s.kind == "local" else 0.0 for s in shapes]
        best = int(np.argmax(size**2 - price))
        found = float(size[best] / length[best]), float(1.0 / length[best])
        return _change(shapes[best], *found, _named(shapes[best], *found))


def _lines(run: UnitMeans) -> Iterator[_Shape]:
    """Yield the shapes of a change: constant, in proportion to T, and to dT/dt if that varies."""
    t, r = run.temperature_c, run.slope_c_per_min
    span, rates = _range(t), _range(r)
    yield _Shape("offset", span, rates, np.ones(len(t)))
    if span[1] - span[0] >= LEAST_SPAN_C:
        yield _Shape("slope", span, rates, (t - 0.5 * sum(span)) / (span[1] - span[0]))
    if rates[1] - rates[0] > _STILL_C_PER_MIN:
        yield _Shape("rate", span, rates, r / (rates[1] - rates[0]))


def _regions(run: UnitMeans) -> Iterator[_Shape]:
    t, r = run.temperature_c, run.slope_c_per_min
    low, high = _range(t)
    span = max(high - low, 1e-9)
    for inside in _branches(run):
        for width in _WIDTHS:
            for center in np.linspace(low, high, _CENTERS):
                bump = np.exp(-0.5 * ((t - center) / (0.5 * width * span)) ** 2) * inside
                if float(np.sum(run.count * bump)) > _LEAST_SHARE * width * float(run.count.sum()):
                    ends = max(low, center - 0.5 * width * span), min(high, center + 0.5 * width * span)
                    yield _Shape("local", ends, _range(r[inside]), bump)


def _branches(run: UnitMeans) -> Iterator[NDArray[np.bool_]]:
    """Yield masks of all of a run, of its ramps down, of its rests and of its ramps up, where it has them."""
    r = run.slope_c_per_min
    yield np.ones(len(r), dtype=bool)
    for part in (r < -_STILL_C_PER_MIN, np.abs(r) <= _STILL_C_PER_MIN, r > _STILL_C_PER_MIN):
        if _LEAST_SHARE <= float(np.sum(run.count[part]) / run.count.sum()) < 1.0:
            yield part


def _range(x: FloatArray) -> TemperatureSpan:
    return float(x.min()), float(x.max())


def _named(shape: _Shape, size: float, sigma: float) -> str:
    (t0, t1), (r0, r1) = shape.temperature_c, shape.slope_c_per_min
    figure = f"{size:+.2g} ± {COVERAGE_FACTOR * sigma:.2g} deg/h"
    return {
        "offset": f"an offset of {figure}, the same everywhere",
        "slope": f"a slope over temperature of {figure} from {t0:.0f} to {t1:.0f} C",
        "rate": f"a dependence on dT/dt of {figure} from {r0:.1f} to {r1:.1f} C/min",
        "local": f"{figure} in the middle of {t0:.0f} ... {t1:.0f} C and {r0:.1f} ... {r1:.1f} C/min",
    }[shape.kind]


def _change(shape: _Shape, size: float, sigma: float, text: str) -> MapChange:
    return MapChange(
        kind=shape.kind,  # type: ignore[arg-type]
        temperature_c=shape.temperature_c,
        slope_c_per_min=shape.slope_c_per_min,
        size_dph=size,
        standard_uncertainty_dph=sigma,
        text=f"{text} (U, k = {COVERAGE_FACTOR:g})",
    )
