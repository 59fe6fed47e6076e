"""The smallest and largest correction that a table may give, and that its terms may add.

The range of the map over the envelope, seen by the reference on a grid, at every center, where lines through two
centers cross and along the lines of those narrower than the grid (a Gaussian may be a ridge, whose highest place lies
in another one or at the envelope's edge), as of regions that are, and of the terms, as training saw it or as their
parameters allow; each with a margin. 0 belongs to it: before anything is believed there is no correction.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from ..model import Model, Term
from ..target.maps import evaluate_map
from ..target.recursion import TableKind
from ..target.table import Numeric, Table, f32_words
from .guards import guard_of

__all__ = ["MARGIN", "Bounds", "unbounded", "with_authority"]

#: Share of the range of the map, and of the terms, that is granted beyond it at either end.
MARGIN = 0.25
_LARGEST_DPH = 1.5e7  # twice the largest rate that anything here takes for one
_LARGEST = 2**31 - 1  # a signed 32-bit word
_CELLS = (96, 48)  # of the grid, T and slope
_CROSSING = 64  # lines that are all crossed: 4096 places, as many as the grid has
_NARROW = 2.0  # cells: half a cell off, a wider Gaussian keeps 94 % of its height
_STATIONS = np.linspace(0.0, 1.0, 5)
"""Of a narrow region, from edge to edge: alone in the middle, handed over outside."""

Range = tuple[float, float]


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
    """What the map may give, deg/h: its range with the margin."""
    envelope = (model.envelope.temperature_c, model.envelope.slope_c_per_min)
    lines = [np.linspace(*ends, cells + 1) for ends, cells in zip(envelope, _CELLS, strict=True)]
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
    """Where along an axis (0: C, 1: C/min) Gaussians and regions lie that are narrow beside a cell of the grid."""
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
    """What the parameters of a term allow within the envelope and the guard of its channel, deg/h."""
    kind, values = term.table.kind, term.table.parameters(term.parameters, model.block_s)
    low, high = model.envelope.temperature_c
    if kind.reads_channel:
        guard = guard_of(model, term.channel)
        return _of_channel(kind, values, (low, high), (guard.low, guard.high))
    size = {
        TableKind.MEMORY: abs(values[1]) * (high - low),
        TableKind.PLAY: abs(values[1]) * values[0],
        TableKind.WARM_UP: abs(values[1]),
        TableKind.HARMONIC: abs(values[-1]),
    }[kind]
    return -size, size


def _of_channel(kind: TableKind, values: Sequence[float], temperature_c: Range, readings: Range) -> Range:
    """What a term of a channel can add at these temperatures and readings, 0 among it, deg/h."""
    slopes, reference, bells = [values[0]], values[1], (0.0, 0.0)
    if kind == TableKind.CURVE:
        reference, bells = values[2], (values[3], values[5])
    elif kind == TableKind.PRODUCT:
        slopes = [values[0] + values[2] * (t - values[3]) for t in temperature_c]
    ends = [slope * (x - reference) for slope in slopes for x in readings]
    low, high = (math.fsum(pick(0.0, weight) for weight in bells) for pick in (min, max))
    return min(0.0, *ends) + low, max(0.0, *ends) + high


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
