"""Model banks: what rounding costs where networks hand over, and whether their regions leave a gap.

The bank is f = Σ s_k n_k / Σ s_k. With shares s_k that are off by at most ε_k,

    f' − f = Σ (s'_k − s_k) (n_k − f) / Σ s'_k,   so   |f' − f| ≤ (Σ ε_k − min ε_k) · D / (Σ s_k − Σ ε_k)

where D is how far apart the networks are that count there; |n_k − f| ≤ (1 − s_k/Σ s) D. A narrow overlap has a small
Σ s_k: this is why it is dear. Shares are ramps, so on a cell of a grid that has every edge of a region among its lines
each is concave, and Σ s_k is least at a corner. All in the coordinates in which the table compares inputs with edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..common.errors import CheckFailed
from ..model import Envelope, Model, Network
from .gradient import largest_gradient
from .solve import exp2_of_minus

__all__ = ["Axis", "handover_error_dph", "regions"]

# Of T and of dT/dt: the bound is loose by what a share grows within a cell, the time grows with their number
_CELLS = (256, 128)
_LOG2E = 1.4426950408889634  # log2(e)


@dataclass(frozen=True, slots=True)
class Axis:
    """One input as a table compares it with the edges of regions: coordinate = factor · input + offset.

    `limits` are the envelope's edges in the table and `edges` those of its regions, shape (n, 2); `moved` is the
    largest error of a coordinate. Inputs are C and C/min.
    """

    factor: float
    offset: float
    limits: tuple[float, float]
    edges: FloatArray
    moved: float


@dataclass(frozen=True, slots=True)
class _Ramps:
    """Shares by one input: the model's edges and envelope in the table's coordinate, and what the table's are off.

    Where `rises[k]` (`falls[k]`) the share of network k grows from its lower (to its upper) edge; `near` is where it
    can count in model or table, `error` the largest error of its share, shape (n, 2) and (n,).
    """

    envelope: tuple[float, float]
    edges: FloatArray
    rises: NDArray[np.bool_]
    falls: NDArray[np.bool_]
    near: FloatArray
    error: FloatArray

    def shares(self, x: FloatArray) -> FloatArray:
        """The model's shares at coordinates x, shape (n, len(x)); below 0 outside the region."""
        width = self.edges[:, 1] - self.edges[:, 0]
        up = (x[None, :] - self.edges[:, :1]) / width[:, None]
        down = (self.edges[:, 1:] - x[None, :]) / width[:, None]
        share = np.where(self.rises[:, None], np.minimum(up, 1.0), 1.0)
        return np.where(self.falls[:, None], np.minimum(down, share), share)

    def lines(self, cells: int) -> FloatArray:
        """Coordinates of a grid over the envelope that has every edge among its lines."""
        low, high = self.envelope
        points = np.concatenate([np.linspace(low, high, cells + 1), self.edges.ravel(), self.near.ravel()])
        return np.unique(np.clip(points[np.isfinite(points)], low, high))

    def count(self, x: FloatArray) -> NDArray[np.bool_]:
        """Whether a network can count between two lines, shape (n, len(x) - 1)."""
        if x.size == 1:
            return (x >= self.near[:, :1]) & (x <= self.near[:, 1:])
        return (x[None, 1:] > self.near[:, :1]) & (x[None, :-1] < self.near[:, 1:])


def regions(model: Model) -> tuple[Envelope, ...]:
    """Region of every network, those of stand-ins last; the envelope where it has none of its own."""
    return tuple(n.region or model.envelope for n in (*model.networks, *model.stand_ins))


def handover_error_dph(
    model: Model, numeric: str, axes: tuple[Axis, Axis], *, share_step: float, share_error: float
) -> float:
    """Largest effect of moved inputs, rounded edges and rounded shares through the shares of a bank, deg/h.

    Args:
        model: The model; two or more networks.
        numeric: Name of the arithmetic, for the message of a refusal.
        axes: T and dT/dt as the table sees them.
        share_step: Largest error of a share by its own rounding.
        share_error: The same relative to the share.

    Raises:
        CheckFailed: The regions leave a gap, only touch, or overlap by less than the arithmetic can tell.
    """
    boxes = regions(model)[: len(model.networks)]
    pairs = ([b.temperature_c for b in boxes], [b.slope_c_per_min for b in boxes])
    limits = (model.envelope.temperature_c, model.envelope.slope_c_per_min)
    ramps = [_ramps(*given, numeric) for given in zip(axes, pairs, limits, strict=True)]
    lines = [ramp.lines(cells) for ramp, cells in zip(ramps, _CELLS, strict=True)]
    by_t, by_r = (ramp.shares(x) for ramp, x in zip(ramps, lines, strict=True))
    shares = np.maximum(np.minimum(by_t[:, :, None], by_r[:, None, :]), 0.0)
    least = _over_cells(shares.sum(axis=0), np.minimum)
    if not np.all(least > 0.0):
        raise CheckFailed("the regions of the networks leave a gap, or only touch: there is nothing to blend")
    count_t, count_r = (ramp.count(x) for ramp, x in zip(ramps, lines, strict=True))
    counts = count_t[:, :, None] & count_r[:, None, :]
    errors = np.maximum(ramps[0].error, ramps[1].error) + share_step
    moved = np.where(counts, errors[:, None, None], 0.0).sum(axis=0)
    smallest = np.where(counts, errors[:, None, None], np.inf).min(axis=0)
    room = least - moved
    blended = counts.sum(axis=0) > 1
    if np.any(blended & (room <= 0.0)):
        raise CheckFailed(
            f"{numeric}: networks hand over within less than this arithmetic can tell apart; let their regions "
            f"overlap by more than {float(np.max(moved)):.1g} of their width"
        )
    apart = _apart(model, axes, lines, counts)
    part = np.where(blended, np.minimum((moved - smallest) / np.where(blended, room, 1.0), 1.0), 0.0)
    return float(np.max(apart * (part + 2.0 * share_error)))


def _ramps(axis: Axis, pairs: list[tuple[float, float]], limits: tuple[float, float], numeric: str) -> _Ramps:
    """Model and table side by side in one input."""
    low, high = (axis.factor * limit + axis.offset for limit in limits)
    edges = axis.factor * np.array(pairs) + axis.offset
    rises, falls = (
        np.array([p[k] > limits[0] if k == 0 else p[k] < limits[1] for p in pairs]) for k in (0, 1)
    )
    same = (rises == (axis.edges[:, 0] > axis.limits[0])) & (falls == (axis.edges[:, 1] < axis.limits[1]))
    ramp = rises | falls
    width, table_width = (e[:, 1] - e[:, 0] for e in (edges, axis.edges))
    if not np.all(same & (~ramp | ((width > 0.0) & (table_width > 0.0)))):
        raise CheckFailed(
            f"{numeric}: the region of a network is narrower than this arithmetic can tell, or ends that close to "
            "the envelope's edge"
        )
    width, table_width = np.where(ramp, width, 1.0), np.where(ramp, table_width, 1.0)
    near = np.stack(
        [
            np.where(rises, np.minimum(edges[:, 0], axis.edges[:, 0]) - axis.moved, -np.inf),
            np.where(falls, np.maximum(edges[:, 1], axis.edges[:, 1]) + axis.moved, np.inf),
        ],
        axis=1,
    )
    ends = np.clip(near, low - axis.moved, high + axis.moved)
    up = (ends - axis.edges[:, :1]) / table_width[:, None] - (ends - edges[:, :1]) / width[:, None]
    down = (axis.edges[:, 1:] - ends) / table_width[:, None] - (edges[:, 1:] - ends) / width[:, None]
    off = np.maximum(np.where(rises[:, None], np.abs(up), 0.0), np.where(falls[:, None], np.abs(down), 0.0))
    error = np.where(ramp, off.max(axis=1) + axis.moved / table_width, 0.0)
    return _Ramps(
        (low, high), np.where(ramp[:, None], edges, edges + np.array([0.0, 1.0])), rises, falls, near, error
    )


def _over_cells(values: FloatArray, least: np.ufunc) -> FloatArray:
    """`least` (or greatest) of the corners of every cell; a single line is a cell of its own."""
    for axis in (0, 1):
        n = values.shape[axis]
        first, second = (
            np.take(values, part, axis=axis) for part in (range(max(n - 1, 1)), range(min(1, n - 1), n))
        )
        values = least(first, second)
    return values


def _apart(
    model: Model, axes: tuple[Axis, Axis], lines: list[FloatArray], counts: NDArray[np.bool_]
) -> FloatArray:
    """Bound of how far apart the networks are that count in a cell, deg/h."""
    center, half = model.scale.temperature_c
    inputs = [(x - a.offset) / a.factor for x, a in zip(lines, axes, strict=True)]
    z = [(inputs[0] - center) / half, inputs[1] / model.scale.slope_c_per_min]
    steps = [np.diff(x) if x.size > 1 else np.zeros(1) for x in z]
    high, low = np.full(counts.shape[1:], -np.inf), np.full(counts.shape[1:], np.inf)
    for network, count in zip(model.networks, counts, strict=True):
        value, steepest, size = _values(model, network, z)
        between = steepest[0] * steps[0][:, None] / 2.0 + steepest[1] * steps[1][None, :] / 2.0
        between = np.minimum(between, size)
        high = np.maximum(high, np.where(count, _over_cells(value, np.maximum) + between, -np.inf))
        low = np.minimum(low, np.where(count, _over_cells(value, np.minimum) - between, np.inf))
    return np.where(counts.any(axis=0), high - low, 0.0)


def _values(model: Model, network: Network, z: list[FloatArray]) -> tuple[FloatArray, FloatArray, float]:
    """A network on the grid, bounds of its slopes in normalised inputs, and of what its parts can make, deg/h."""
    center, half = model.scale.temperature_c
    centers = np.array([((t - center) / half, r / model.scale.slope_c_per_min) for t, r in network.centers])
    inverse = np.array([[0.0 if w is None else 1.0 / w for w in pair] for pair in network.widths])
    centers, inverse = centers.reshape(-1, 2), inverse.reshape(-1, 2)
    weights, linear = np.array(network.weights, dtype=np.float64), np.array(network.linear)
    values = network.w0 + linear[0] * z[0][:, None] + linear[1] * z[1][None, :]
    for place, narrow, weight in zip(centers, inverse, weights, strict=True):
        a, b = ((z[k] - place[k]) * narrow[k] for k in (0, 1))
        values = values + weight * exp2_of_minus(a * a * _LOG2E)[:, None] * exp2_of_minus(b * b * _LOG2E)
    low, high = (np.array([x[end] for x in z]) for end in (0, -1))
    steepest = largest_gradient(linear, centers, inverse, weights, low, high)
    span = np.abs(linear) * (high - low)
    return values, steepest, 2.0 * float(np.abs(weights).sum()) + float(span[0] + span[1])
