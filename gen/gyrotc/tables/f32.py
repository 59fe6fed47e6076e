"""Float32 tables: parameters rounded to float32, centers to multiples of 2^-20, and the error bound.

The bound follows docs/numerics.md, section 4: every rounding of one evaluation, its largest effect on
the bias, summed over all Gaussians.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..common.errors import CheckFailed
from ..mirror.table import Table, Words, f32_words
from ..model import Envelope, Model, Network
from .error_bounds import CoordinateMap, handover_error_dph, regions, unbounded
from .rounding import STEEPEST, f32_terms, guard_words, largest_gradient, shared, sigma_values

_UNIT = 2.0**-24  # largest relative error of one rounding
_GRID = 2.0**-20  # centers lie on it
_INPUT_GRID = 2.0**-21  # largest error of a normalised input by its rounding to the grid
_GAIN = 8.0 * math.sqrt(math.log2(math.e))  # u = 64 log2(e) d²/δ²
_POLYNOMIAL = 6.7e-9  # of 2^(-f/64), relative
_TINY = 2.0**-80  # smaller weights could make subnormal products
_MAX_ABS_Z = 8.0  # half ranges, as `words` has it for every table: docs/numerics.md rests on it
_SHARE = 4.0 * _UNIT  # relative error of a share of a bank: two differences, their quotient


def table_of(model: Model) -> Table:
    """The table of a model in float32, without known answers.

    Raises:
        CheckFailed: The model needs what the float32 runtime does not have.
    """
    per_block = model.block_s / 60.0
    center, half = model.scale.temperature_c
    scale = f32_words([center, 1.0 / half, 1.0 / (model.scale.slope_c_per_min * per_block)])
    envelope = _region(model.envelope, per_block)
    _check_range(scale, envelope)
    of_map, networks = len(model.networks), (*model.networks, *model.fallback_models)
    centers = [_centers(network, scale, per_block) for network in networks]
    heads = [_record(n, region, per_block) for n, region in zip(networks, regions(model), strict=True)]
    parts = _bound_parts(model, scale, envelope, centers[:of_map], np.concatenate(heads[:of_map]))
    fallback_models = zip(model.fallback_models, centers[of_map:], strict=True)
    return Table(
        numeric="f32",
        **shared(model),
        bias_frac_bits=0,
        fallback=_word(model.fallback_dph),
        **unbounded("f32"),
        rezero=_word(model.rezero_dph),
        scale=tuple(scale.tolist()),
        envelope=tuple(envelope.tolist()),
        networks=np.concatenate(heads),
        centers=np.concatenate(centers).view(np.uint32).reshape(-1),
        guards=guard_words(model, "f32"),
        terms=f32_terms(model),
        sigma=f32_words(sigma_values(model)),
        probes=np.zeros(0, dtype=np.uint32),
        error_bound_dph=math.fsum(parts.values()),
        bound_parts_dph=parts,
        fallback_model_bounds_dph=tuple(
            math.fsum(_bound(*one, scale, envelope, per_block).values()) for one in fallback_models
        ),
    )


def _bound_parts(
    model: Model, scale: Words, envelope: Words, centers: Sequence[NDArray[np.float32]], heads: Words
) -> dict[str, float]:
    """The error bound part by part, deg/h: of a bank the largest of its networks, and what the hand-over adds."""
    per_block = model.block_s / 60.0
    bounds = [
        _bound(network, own, scale, envelope, per_block) for network, own in zip(model.networks, centers, strict=True)
    ]
    parts = {part: max(bound[part] for bound in bounds) for part in bounds[0]}
    if len(model.networks) > 1:
        axes = _axes(envelope, heads, per_block)
        parts["hand-over"] = handover_error_dph(model, "f32", axes, share_step=0.0, share_error=_SHARE)
        parts["blend"] = _blend(model, scale, envelope)
    return parts


def _word(value: float) -> int:
    return int(f32_words([value])[0])


def _flushed(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(np.abs(values) < _TINY, 0.0, values)


def _lost(network: Network, largest: NDArray[np.float64]) -> float:
    """Return the most that numbers too small for the table would have added, deg/h."""
    values = np.array([network.w0, network.linear[0] * largest[0], network.linear[1] * largest[1]])
    small = np.abs([network.w0, *network.linear]) < _TINY
    weights = np.array(network.weights, dtype=np.float64)
    return float(np.abs(values[small]).sum() + np.abs(weights[np.abs(weights) < _TINY]).sum())


def _record(network: Network, region: Envelope, per_block: float) -> Words:
    count = np.array([len(network.weights)], np.uint32)
    head = f32_words(_flushed(np.array([network.w0, *network.linear])))
    return np.concatenate([count, head, _region(region, per_block)])


def _numbers(words: Words) -> NDArray[np.float64]:
    return words.view(np.float32).astype(np.float64)


def _normalised(scale: Words, temperature: float, slope: float) -> tuple[float, float]:
    """Normalise an input as the target does, without its rounding."""
    offset, gain_t, gain_r = _numbers(scale).tolist()
    return (temperature - offset) * gain_t, slope * gain_r


def _corners(scale: Words, envelope: Words) -> NDArray[np.float64]:
    """Lowest and highest inputs of the envelope, normalised, shape (2, 2)."""
    t0, t1, r0, r1 = _numbers(envelope).tolist()
    return np.array([_normalised(scale, t, r) for t, r in ((t0, r0), (t1, r1))])


def _check_range(scale: Words, envelope: Words) -> None:
    if not np.all(np.abs(_corners(scale, envelope)) <= _MAX_ABS_Z):  # nor NaN
        raise CheckFailed(f"f32: the envelope reaches beyond {_MAX_ABS_Z:g} half ranges of the model's scale")


def _centers(network: Network, scale: Words, per_block: float) -> NDArray[np.float32]:
    """Records of the centers, shape (n, 5): c_T, g_T, c_r, g_r, weight."""
    records = np.zeros((len(network.weights), 5))
    positions = _positions(network, scale, per_block)
    for record, position, widths, weight in zip(records, positions, network.widths, network.weights, strict=True):
        for k in (0, 1):
            width = widths[k]
            if width is not None:
                record[2 * k] = round(position[k] / _GRID) * _GRID
                record[2 * k + 1] = _GAIN / width
        record[4] = weight
    return f32_words(_flushed(records)).view(np.float32).reshape(-1, 5)


def _positions(network: Network, scale: Words, per_block: float) -> NDArray[np.float64]:
    """Centers as the table's scale normalises them, shape (n, 2)."""
    found = [_normalised(scale, c_t, c_r * per_block) for c_t, c_r in network.centers]
    return np.array(found, dtype=np.float64).reshape(-1, 2)


def _gradient(
    network: Network, scale: Words, envelope: Words, per_block: float, margin: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Largest slopes of the network over the envelope and `margin` around it, in normalised inputs."""
    corners = _corners(scale, envelope)
    inverse = [[1.0 / w if w is not None else 0.0 for w in pair] for pair in network.widths]
    return largest_gradient(
        np.array(network.linear),
        _positions(network, scale, per_block),
        np.array(inverse).reshape(-1, 2),
        np.array(network.weights),
        corners[0] - margin,
        corners[1] + margin,
    )


def _largest(scale: Words, envelope: Words) -> NDArray[np.float64]:
    """Largest |z| over the envelope, shape (2,)."""
    return np.asarray(np.max(np.abs(_corners(scale, envelope)), axis=0))


def _input_errors(scale: Words, envelope: Words) -> NDArray[np.float64]:
    """Largest errors of the normalised inputs, shape (2,).

    Offset, gain, subtraction and product are rounded, then z itself; the envelope's edges likewise.
    """
    t0, t1, r0, r1 = _numbers(envelope).tolist()
    offset = float(_numbers(scale)[0])
    reach = np.array([max(abs(t0), abs(t1), abs(offset)), max(abs(r0), abs(r1))])
    edges = reach * _numbers(scale)[1:] * np.array([2.0, 1.0]) * _UNIT
    return np.asarray(_largest(scale, envelope) * 4.0 * _UNIT + edges + _INPUT_GRID)


def _region(region: Envelope, per_block: float) -> Words:
    (t0, t1), (r0, r1) = region.temperature_c, region.slope_c_per_min
    return f32_words([t0, t1, r0 * per_block, r1 * per_block])


def _axes(envelope: Words, networks: Words, per_block: float) -> tuple[CoordinateMap, CoordinateMap]:
    """Inputs as the table compares them with the edges of regions: C and C per block.

    The envelope, to which both sides clamp, is rounded.
    """
    limits = _numbers(envelope).tolist()
    edges = _numbers(networks.reshape(-1, 8)[:, 4:])
    t, r = (
        CoordinateMap(
            factor=factor,
            offset=0.0,
            limits=(limits[2 * k], limits[2 * k + 1]),
            edges=edges[:, 2 * k : 2 * k + 2],
            moved=2.0 * _UNIT * max(map(abs, limits[2 * k : 2 * k + 2])),
        )
        for k, factor in ((0, 1.0), (1, per_block))
    )
    return t, r


def _blend(model: Model, scale: Words, envelope: Words) -> float:
    """Roundings of Σ share · network / Σ share: each product, the two sums, the quotient."""
    largest = _largest(scale, envelope)
    sizes = [
        math.fsum(map(abs, (n.w0, n.linear[0] * largest[0], n.linear[1] * largest[1], *n.weights)))
        for n in model.networks
    ]
    return (2.0 * len(sizes) + 2.0) * _UNIT * max(sizes)


def _bound(
    network: Network, centers: NDArray[np.float32], scale: Words, envelope: Words, per_block: float
) -> dict[str, float]:
    """Largest departures from the model in float64 over the envelope, deg/h, by their origin."""
    largest = _largest(scale, envelope)
    z_error = _input_errors(scale, envelope)
    weights = np.abs(np.array(network.weights, dtype=np.float64))
    linear = np.abs(np.array(network.linear))
    steep = np.zeros((len(weights), 2))
    for row, record in zip(steep, centers.astype(np.float64), strict=True):
        row[:] = STEEPEST * np.array([record[1], record[3]]) / _GAIN
    finite = centers[:, [1, 3]] != 0.0
    center_error = np.where(finite, np.abs(centers[:, [0, 2]] - _positions(network, scale, per_block)), 0.0)
    total = float(weights.sum())
    # u: gain, product, square (twice the error of its root), sum: 2 (1 + 1 + 1) + 1 + 1 roundings at most,
    # and x exp(-x) <= 1/e.
    argument = 8.0 * _UNIT / math.e
    # f - H, its square, + G, the table's entry, the product with it, the product with the weight.
    kernel = (0.7 + 0.5 + 1.0 + 1.0 + 1.0 + 1.0) * _UNIT + argument + _POLYNOMIAL + 2.0**-32
    start = abs(network.w0) + float(linear @ largest)
    partial = start + np.cumsum(weights)  # largest magnitude of each partial sum
    return {
        "rounded inputs": float(_gradient(network, scale, envelope, per_block, z_error) @ z_error),
        "rounded centers": float(np.sum(weights[:, None] * steep * center_error)),
        "rounded weights": _UNIT * (start + float(linear @ largest) + total) + _lost(network, largest),
        "Gaussian": kernel * total,
        "summation": _UNIT * (2.0 * start + float(partial.sum())),
    }
