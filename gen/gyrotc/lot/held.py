"""Does an earlier model still hold? What it leaves of a check run, held against what it may leave.

A map that has changed has changed by a smooth shape: an offset, something in proportion to T or to dT/dt, or in a
region. Each shape's size is estimated by generalised least squares, with the covariance of what remains of a unit that
has not changed (its map's, ageing's, the noise's); the largest of these sizes over its standard deviation is the
statistic (a scan: Naus 1965). Its distribution is drawn from the same covariance, so the share of false alarms is
what is stated, whatever the run was.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfc, ndtri

from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..results.earlier import CheckedCell, MapChange
from ..train.means import UnitMeans
from .prior import MapPosterior, MapPrior
from .surprise import FALSE_ALARM

__all__ = ["Held", "held"]

Span = tuple[float, float]

_CENTERS = 17  # of regions over the run's temperatures: half of the narrowest one's width apart
_WIDTHS = (
    0.125,
    0.25,
    0.5,
)  # of regions, shares of the run's span: narrower ones hold too few means of a short run
_STILL_C_PER_MIN = 0.2  # a chamber that holds: nine tenths of the paper's holds are slower
_LEAST_SHARE = 0.05  # of a run, ramps of one direction: less says nothing of them
_CELLS = 8  # of T, for the table
_DRAWS = 10_000  # of the statistic: a p-value of 1 % then has a standard error of 0.1 %
_SEED = 1  # of these draws: any; the same run gives the same answer


@dataclass(frozen=True, slots=True)
class Held:
    """What a check run says of an earlier model.

    Attributes:
        p_value: Probability that a unit that has not changed lies as far away.
        change: What explains it best, where that is less than `FALSE_ALARM`.
        cells: The run in parts.
    """

    p_value: float
    change: MapChange | None
    cells: tuple[CheckedCell, ...]


@dataclass(frozen=True, slots=True)
class _Shape:
    kind: str
    temperature_c: Span
    slope_c_per_min: Span
    values: FloatArray


def held(expected: MapPosterior, run: UnitMeans) -> Held:
    """Holds the means of a run against a posterior that has not seen them.

    Args:
        expected: The earlier model with its ageing.
        run: Means of the check run; those beyond the earlier model's envelope say nothing of it and do not count.

    Raises:
        InputError: None is within.
    """
    run = _within(expected.prior, run)
    left = run.bias_dph - expected.mean_dph(run.temperature_c, run.slope_c_per_min)
    values = expected.prior.basis.values(run.temperature_c, run.slope_c_per_min) * expected.prior.unit_dph
    covariance = values @ expected.covariance @ values.T + np.diag(run.sigma_dph**2 / run.count)
    factor = np.linalg.cholesky(covariance)
    shapes = list(_shapes(run))
    columns = np.linalg.solve(factor, np.array([s.values for s in shapes]).T)
    length = np.linalg.norm(columns, axis=0)
    columns = columns / length
    size = columns.T @ np.linalg.solve(factor, left)
    price = _prices(shapes)
    best = int(np.argmax(size**2 - price))
    p = _p_value(float(size[best] ** 2 - price[best]), columns, price)
    shape = shapes[best]
    change = _change(shape, float(size[best] / length[best]), float(1.0 / length[best]))
    return Held(p, change if p < FALSE_ALARM else None, tuple(_cells(run, left, covariance)))


def _within(prior: MapPrior, run: UnitMeans) -> UnitMeans:
    (t0, t1), (r0, r1) = prior.temperature_c, prior.slope_c_per_min
    t, r = run.temperature_c, run.slope_c_per_min
    inside = (t >= t0) & (t <= t1) & (r >= r0) & (r <= r1)
    if not inside.any():
        found = f"is nowhere within {t0:.1f} ... {t1:.1f} C and {r0:.2f} ... {r1:.2f} C/min"
        raise InputError("--prior", f"the check run {found}", "a run where the earlier model holds")
    return UnitMeans(t[inside], r[inside], run.bias_dph[inside], run.count[inside], run.sigma_dph)


def _shapes(run: UnitMeans) -> Iterator[_Shape]:
    """Ways in which a map may have changed, the simple ones first."""
    t, r = run.temperature_c, run.slope_c_per_min
    low, high = float(t.min()), float(t.max())
    span, rates = max(high - low, 1e-9), (float(r.min()), float(r.max()))
    yield _Shape("offset", (low, high), rates, np.ones(len(t)))
    yield _Shape("slope", (low, high), rates, (t - 0.5 * (low + high)) / span)
    if rates[1] - rates[0] > _STILL_C_PER_MIN:
        yield _Shape("rate", (low, high), rates, r / (rates[1] - rates[0]))
    for inside in _branches(run):
        for width in _WIDTHS:
            for center in np.linspace(low, high, _CENTERS):
                bump = np.exp(-0.5 * ((t - center) / (0.5 * width * span)) ** 2) * inside
                if float(np.sum(run.count * bump)) > _LEAST_SHARE * width * float(run.count.sum()):
                    ends = max(low, center - 0.5 * width * span), min(high, center + 0.5 * width * span)
                    yield _Shape("local", ends, _range(r[inside]), bump)


def _branches(run: UnitMeans) -> Iterator[NDArray[np.bool_]]:
    """All of a run, and its ramps up, its rests, its ramps down, where it has them."""
    r = run.slope_c_per_min
    yield np.ones(len(r), dtype=bool)
    for part in (r < -_STILL_C_PER_MIN, np.abs(r) <= _STILL_C_PER_MIN, r > _STILL_C_PER_MIN):
        if _LEAST_SHARE <= float(np.sum(run.count[part]) / run.count.sum()) < 1.0:
            yield part


def _range(x: FloatArray) -> Span:
    return float(x.min()), float(x.max())


def _prices(shapes: list[_Shape]) -> FloatArray:
    """What a region has to explain more than a simple shape: there are many to choose from."""
    regions = sum(s.kind == "local" for s in shapes)
    return np.array([2.0 * np.log(max(regions, 1)) if s.kind == "local" else 0.0 for s in shapes])


def _p_value(statistic: float, columns: FloatArray, price: FloatArray) -> float:
    """Share of unchanged units whose largest size, its price paid, is as large."""
    values, vectors = np.linalg.eigh(columns.T @ columns)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    used = values > 1e-9 * values[-1]
    drawn = np.random.default_rng(_SEED).normal(size=(_DRAWS, int(used.sum()))) @ root[:, used].T
    beyond = int(np.sum(np.max(drawn**2 - price, axis=1) >= statistic))
    if beyond:
        return beyond / _DRAWS
    bound = float(np.sum(erfc(np.sqrt(np.maximum(statistic + price, 0.0) / 2.0))))  # Bonferroni
    return min(bound, 1.0 / _DRAWS)


def _cells(run: UnitMeans, left: FloatArray, covariance: FloatArray) -> Iterator[CheckedCell]:
    t, r = run.temperature_c, run.slope_c_per_min
    low, high = float(t.min()), float(t.max())
    edges = np.linspace(low, high, _CELLS + 1)
    number = np.clip(((t - low) / max(high - low, 1e-9) * _CELLS).astype(int), 0, _CELLS - 1)
    branch = np.sign(np.where(np.abs(r) > _STILL_C_PER_MIN, r, 0.0))
    parts = [(k, b) for k in range(_CELLS) for b in (-1.0, 0.0, 1.0) if np.any((number == k) & (branch == b))]
    reach = -float(ndtri(0.5 * FALSE_ALARM / len(parts)))  # Bonferroni
    for k, b in parts:
        there = (number == k) & (branch == b)
        weight = np.where(there, run.count, 0.0)
        weight = weight / weight.sum()
        found, limit = float(weight @ left), reach * float(np.sqrt(weight @ covariance @ weight))
        yield CheckedCell(
            temperature_c=(float(edges[k]), float(edges[k + 1])),
            slope_c_per_min=_range(r[there]),
            found_dph=found,
            limit_dph=limit,
            within=bool(abs(found) <= limit),
        )


def _change(shape: _Shape, size: float, sigma: float) -> MapChange:
    (t0, t1), (r0, r1) = shape.temperature_c, shape.slope_c_per_min
    figure = f"{size:+.2g} ± {sigma:.1g} deg/h (1 sigma)"
    where = f"{t0:.0f} ... {t1:.0f} C and {r0:.1f} ... {r1:.1f} C/min"
    text = {
        "offset": f"an offset of {figure}, the same everywhere",
        "slope": f"the slope over temperature: {figure} from {t0:.0f} to {t1:.0f} C",
        "rate": f"the dependence on dT/dt: {figure} from {r0:.1f} to {r1:.1f} C/min",
        "local": f"the map between {where}: {figure} in the middle",
    }[shape.kind]
    return MapChange(
        kind=shape.kind,  # type: ignore[arg-type]
        temperature_c=shape.temperature_c,
        slope_c_per_min=shape.slope_c_per_min,
        size_dph=size,
        standard_uncertainty_dph=sigma,
        text=text,
    )
