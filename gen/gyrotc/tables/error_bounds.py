"""Bounds on what a table gives: its authority, the cost of rounding in channels and at hand-over of networks.

The range of the map over the envelope, seen by the reference on a grid, at every center, where lines through two
centers cross and along the lines of those narrower than the grid (a Gaussian may be a ridge, whose highest place lies
in another one or at the envelope's edge), as of regions that are, and of the terms, as training saw it or as their
parameters allow; each with a margin. 0 belongs to it: before any reading is accepted there is no correction.

docs/numerics.md, section 8, has the sums; the channel's mean and the temperature are those of the target. Every part
is a rounding of one step times the largest effect that it has.

The bank is f = Σ s_k n_k / Σ s_k. With shares s_k that are off by at most ε_k,

    f' − f = Σ (s'_k − s_k) (n_k − f) / Σ s'_k,   so   |f' − f| ≤ (Σ ε_k − min ε_k) · D / (Σ s_k − Σ ε_k)

where D is the largest difference of the networks that count there; |n_k − f| ≤ (1 − s_k/Σ s) D. A narrow overlap has
a small Σ s_k and a large bound. Shares are ramps. On a cell of a grid with every edge of a region among its lines
each is concave, and Σ s_k is least at a corner. All in the coordinates in which the table compares inputs with edges.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..common.errors import CheckFailed
from ..mirror.history import evaluate_map
from ..mirror.kinds import InputDistances, Range
from ..mirror.table import Table, f32_words
from ..model import Envelope, Model, Network, Term
from ..results.base import Numeric
from .rounding import LOG2E, exp2_of_minus, guard_of, largest_gradient

#: Share of the range of the map, and of the terms, that is granted beyond it at either end.
MARGIN = 0.25
_LARGEST_DPH = 1.5e7  # twice the largest rate that anything here takes for one
_LARGEST = 2**31 - 1  # a signed 32-bit word
_GRID_CELLS = (96, 48)  # of the grid, T and slope
_CROSSING = 64  # lines that are all crossed: 4096 places, as many as the grid has
_NARROW = 2.0  # cells: half a cell off, a wider Gaussian keeps 94 % of its height
_STATIONS = np.linspace(0.0, 1.0, 5)
"""Of a narrow region, from edge to edge: alone in the middle, handed over outside."""


class Bounds(TypedDict):
    """Members of a table: smallest and largest correction, and of what the terms add."""

    authority: tuple[int, ...]
    effect: tuple[int, ...]


def unbounded(numeric: Numeric) -> Bounds:
    """The widest that a table holds."""
    most = _LARGEST_DPH if numeric == "f32" else float(_LARGEST)
    words = _words((-most, most), numeric, 0)
    return Bounds(authority=words, effect=words)


def with_authority(model: Model, table: Table) -> Table:
    """The table with the bounds of its corrections."""
    low, high = _granted(model, table)
    effect = _effects(model)
    least = min(low + effect[0], model.fallback_dph, 0.0) - model.rezero_dph
    most = max(high + effect[1], model.fallback_dph, 0.0) + model.rezero_dph
    return replace(
        table,
        authority=_words((least, most), table.numeric, table.bias_frac_bits),
        effect=_words(effect, table.numeric, table.bias_frac_bits),
    )


def _wider(bounds: Range, least: float = 0.0) -> Range:
    """The range with the margin at either end, at least `least`."""
    margin = max(MARGIN * (bounds[1] - bounds[0]), least)
    return bounds[0] - margin, bounds[1] + margin


def _granted(model: Model, table: Table) -> Range:
    """Return the authority of the map, deg/h: its range with the margin."""
    envelope = (model.envelope.temperature_c, model.envelope.slope_c_per_min)
    lines = [np.linspace(*ends, cells + 1) for ends, cells in zip(envelope, _GRID_CELLS, strict=True)]
    grid = _lattice(*lines)
    centers = np.array([center for network in model.networks for center in network.centers]).reshape(-1, 2)
    floor = model.noise_floor_dph or 0.0
    seen = _map_range(model, table, np.concatenate([grid, centers]))
    granted = _wider(seen, floor)
    narrow = [_ridges(model, axis, float(line[1] - line[0])) for axis, line in enumerate(lines)]
    crossing = [_lattice(narrow[0], lines[1]), _lattice(lines[0], narrow[1])]
    crossing += [_lattice(*each) for each in (centers.T, narrow) if max(map(len, each)) <= _CROSSING]
    places = np.concatenate(crossing)
    if len(places):
        crossed = _map_range(model, table, places)
        if crossed[0] < granted[0] or crossed[1] > granted[1]:
            return _wider((min(seen[0], crossed[0]), max(seen[1], crossed[1])), floor)
    return granted


def _ridges(model: Model, axis: int, cell: float) -> NDArray[np.float64]:
    """Return places along an axis (0: C, 1: C/min) of Gaussians and regions narrower than two cells of the grid."""
    unit = (model.scale.temperature_c[1], model.scale.slope_c_per_min)[axis]
    places: list[float] = []
    for network in model.networks:
        gaussians = zip(network.centers, network.widths, strict=True)
        places += [c[axis] for c, widths in gaussians if (widths[axis] or np.inf) * unit < _NARROW * cell]
        if network.region is not None:
            low, high = (network.region.temperature_c, network.region.slope_c_per_min)[axis]
            places += (low + (high - low) * _STATIONS).tolist() if high - low < _NARROW * cell else []
    return np.array(places, dtype=np.float64)


def _lattice(temperature_c: NDArray[np.float64], slope_c_per_min: NDArray[np.float64]) -> NDArray[np.float64]:
    """Every temperature with every slope, shape (n, 2)."""
    return np.stack(np.meshgrid(temperature_c, slope_c_per_min), axis=-1).reshape(-1, 2)


def _map_range(model: Model, table: Table, points: NDArray[np.float64]) -> Range:
    """Smallest and largest of the map at points (C, C/min), deg/h."""
    inputs = table.encode_inputs(points * np.array([1.0, model.block_s / 60.0]))
    _, bits = evaluate_map(table, inputs)
    biases = table.decode_bias(bits)
    return float(biases.min()), float(biases.max())


def _effects(model: Model) -> Range:
    """Smallest and largest that the terms together add, 0 among them, deg/h."""
    if not model.terms:
        return 0.0, 0.0
    if model.effects_dph is not None:
        return _wider(model.effects_dph)
    parts = [_effect(model, term) for term in model.terms]
    return _wider((math.fsum(p[0] for p in parts), math.fsum(p[1] for p in parts)))


def _effect(model: Model, term: Term) -> Range:
    """Return the range of a term within the envelope and the guard of its channel, deg/h."""
    kind, values = term.table.kind.description, term.table.parameters(term.parameters, model.block_s)
    guard = guard_of(model, term.channel)
    return kind.effect(values, model.envelope.temperature_c, (guard.low, guard.high))


def _words(bounds: Range, numeric: Numeric, frac_bits: int) -> tuple[int, ...]:
    """Two numbers as words, rounded outwards, and no wider than words can be."""
    if numeric == "f32":
        ends = np.clip(np.array(bounds), -_LARGEST_DPH, _LARGEST_DPH).astype(np.float32)
        outer = [np.nextafter(ends[0], np.float32(-np.inf)), np.nextafter(ends[1], np.float32(np.inf))]
        within = np.clip(np.where(ends == 0.0, ends, outer), -_LARGEST_DPH, _LARGEST_DPH)
        return tuple(f32_words(within).tolist())
    unit = 2.0**frac_bits
    low = max(math.floor(bounds[0] * unit), -_LARGEST)
    high = min(math.ceil(bounds[1] * unit), _LARGEST)
    return low & 0xFFFFFFFF, high & 0xFFFFFFFF


def channel_error_dph(model: Model, numeric: Numeric, frac_bits: int) -> float:
    """Return the largest error by rounding of the terms for which it is stated, added up, deg/h; 0 without any."""
    errors = []
    for term in model.terms:
        error_of = term.table.kind.description.rounding_error
        if error_of is not None:
            values = term.table.parameters(term.parameters, model.block_s)
            errors.append(error_of[numeric](values, _distances(model, term), 2.0**-frac_bits))
    return math.fsum(errors)


def _distances(model: Model, term: Term) -> InputDistances:
    guard, p = guard_of(model, term.channel), term.parameters
    reference_c = p.get("reference_c", 0.0)
    return InputDistances(
        reading=max(abs(x - p["reference"]) for x in (guard.low, guard.high)),
        temperature_c=max(abs(t - reference_c) for t in model.envelope.temperature_c),
    )


# Of T and of dT/dt: the bound is loose by what a share grows within a cell, the time grows with their number
_CELLS = (256, 128)


@dataclass(frozen=True, slots=True)
class CoordinateMap:
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
        """Return the lines of a grid over the envelope that has every edge among them."""
        low, high = self.envelope
        points = np.concatenate([np.linspace(low, high, cells + 1), self.edges.ravel(), self.near.ravel()])
        return np.unique(np.clip(points[np.isfinite(points)], low, high))

    def count(self, x: FloatArray) -> NDArray[np.bool_]:
        """Return a mask of the networks that can count between two lines, shape (n, len(x) - 1)."""
        if x.size == 1:
            return (x >= self.near[:, :1]) & (x <= self.near[:, 1:])
        return (x[None, 1:] > self.near[:, :1]) & (x[None, :-1] < self.near[:, 1:])


def regions(model: Model) -> tuple[Envelope, ...]:
    """Region of every network, those of fallback models last; the envelope where it has none of its own."""
    return tuple(n.region or model.envelope for n in (*model.networks, *model.fallback_models))


def handover_error_dph(
    model: Model, numeric: str, axes: tuple[CoordinateMap, CoordinateMap], *, share_step: float, share_error: float
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
            f"{numeric}: networks hand over within less than this arithmetic can separate; let their regions "
            f"overlap by more than {float(np.max(moved)):.1g} of their width"
        )
    spread = _spread(model, axes, lines, counts)
    part = np.where(blended, np.minimum((moved - smallest) / np.where(blended, room, 1.0), 1.0), 0.0)
    return float(np.max(spread * (part + 2.0 * share_error)))


def _ramps(axis: CoordinateMap, pairs: list[tuple[float, float]], limits: tuple[float, float], numeric: str) -> _Ramps:
    """Model and table side by side in one input."""
    low, high = (axis.factor * limit + axis.offset for limit in limits)
    edges = axis.factor * np.array(pairs) + axis.offset
    rises, falls = (np.array([p[k] > limits[0] if k == 0 else p[k] < limits[1] for p in pairs]) for k in (0, 1))
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
    return _Ramps((low, high), np.where(ramp[:, None], edges, edges + np.array([0.0, 1.0])), rises, falls, near, error)


def _over_cells(values: FloatArray, least: np.ufunc) -> FloatArray:
    """`least` (or greatest) of the corners of every cell; a single line is a cell of its own."""
    for axis in (0, 1):
        n = values.shape[axis]
        first, second = (np.take(values, part, axis=axis) for part in (range(max(n - 1, 1)), range(min(1, n - 1), n)))
        values = least(first, second)
    return values


def _spread(
    model: Model, axes: tuple[CoordinateMap, CoordinateMap], lines: list[FloatArray], counts: NDArray[np.bool_]
) -> FloatArray:
    """Bound of how far from one another the networks are that count in a cell, deg/h."""
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
        values = values + weight * exp2_of_minus(a * a * LOG2E)[:, None] * exp2_of_minus(b * b * LOG2E)
    low, high = (np.array([x[end] for x in z]) for end in (0, -1))
    steepest = largest_gradient(linear, centers, inverse, weights, low, high)
    span = np.abs(linear) * (high - low)
    return values, steepest, 2.0 * float(np.abs(weights).sum()) + float(span[0] + span[1])
