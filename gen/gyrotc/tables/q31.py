"""Fixed-point tables: (s, k) of every Gaussian rounded first, then the linear weights solved again with them.

A position x = 0 ... 2^16 - 1 stands for the middle of its cell of the envelope. In positions a
Gaussian is 2^-((α_T (x_T - c_T))² + (α_r (x_r - c_r))²), a product of two functions of one input each; so
sums over a grid of the envelope need only functions of one input.

The weights are solved against the model over the whole envelope, in closed form: the Gaussians are
products of functions of one input, so the Gram matrix of a grid is the product of two small ones. The
bound is proved from a grid of the difference and what its derivative allows between grid points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..common.errors import CheckFailed
from ..mirror.q31 import GAUSS_ERROR
from ..mirror.table import Table
from ..model import Envelope, Model, Network, Scale
from .error_bounds import CoordinateMap, handover_error_dph, regions, unbounded
from .rounding import (
    STEEPEST,
    Floats,
    exp2_of_minus,
    gram,
    guard_words,
    largest_gradient,
    q31_terms,
    shared,
    sigma_values,
    solve_cholesky,
    term_size_dph,
)

POSITIONS = 65536  # 16 bits of an input: docs/numerics.md, section 3
_UNITS_PER_C = 65536.0  # fixed point holds a temperature in 2^-16 C: docs/FORMAT.md
_GAIN_BITS = 27  # position = offset · gain · 2^-27: docs/numerics.md, section 3
_SQRT_LOG2E = 1.2011224087864498  # √(log2 e)
_SQRT_LN2 = 0.8325546111576977  # √(ln 2)
# Largest |d/dx| and |d²/dx²| of 2^-(α x)², as factors of α and α².
_SLOPE = STEEPEST * _SQRT_LN2
_CURVE = 2.0 * 0.6931471805599453  # 2 ln 2


@dataclass(frozen=True, slots=True)
class InputScale:
    """position = ((input - low) · gain) >> 27; input in 2^-16 C."""

    low: int
    gain: int

    def position(self, value: float) -> float:
        """Return the position of an input (2^-16 C) among the middles of the cells, not rounded."""
        return (value - self.low) * self.per_unit - 0.5

    @property
    def per_unit(self) -> float:
        """Positions per 2^-16 C."""
        return self.gain * 2.0**-_GAIN_BITS


Inputs = tuple[InputScale, InputScale]  # T, slope


def position_scale(low: int, high: int) -> InputScale:
    """Scale that spreads an envelope (2^-16 C) over the positions."""
    gain = (POSITIONS * 2**_GAIN_BITS - 1) // max(high - low, 1)
    return InputScale(low, min(gain, 2**31 - 1))


@dataclass(frozen=True, slots=True)
class Surface:
    """w0 + linear · x/2^16 + Σ weights · Gaussians, over positions."""

    w0: float
    linear: Floats  # (2,) deg/h over the whole range of positions
    alpha: Floats  # (n, 2)
    center: Floats  # (n, 2)
    weights: Floats  # (n,)

    def factors(self, axis: int, x: Floats) -> Floats:
        """The Gaussians' factors of one input at positions x: shape (len(x), n)."""
        d = (x[:, None] - self.center[None, :, axis]) * self.alpha[None, :, axis]
        return exp2_of_minus(d * d)

    def on_grid(self, x_t: Floats, x_r: Floats) -> Floats:
        """Values at every pair of positions, shape (len(x_t), len(x_r))."""
        scaled = self.linear[0] * x_t[:, None] + self.linear[1] * x_r[None, :]
        total = self.w0 + scaled / POSITIONS
        return _add_products(total, self.weights, self.factors(0, x_t), self.factors(1, x_r))

    def steepest(self, reach: Floats) -> Floats:
        """Bounds of the derivatives by one position, shape (2,); `reach`: positions beyond the first and the last."""
        low, high = -reach, POSITIONS + reach
        inverse = self.alpha * _SQRT_LN2
        return largest_gradient(self.linear / POSITIONS, self.center, inverse, self.weights, low, high)


def _add_products(total: Floats, weights: Floats, a: Floats, b: Floats) -> Floats:
    product = np.empty_like(total)
    for k, weight in enumerate(weights):
        total += np.multiply((weight * a[:, k])[:, None], b[None, :, k], out=product)
    return total


def difference(first: Surface, second: Surface, cells: int) -> float:
    """Bound of |first - second| over the whole envelope: largest on a grid, and what may lie between.

    Both must have the same Gaussians in the same order, nearly the same each.
    """
    step = POSITIONS / cells
    x = np.arange(cells + 1) * step
    largest = float(np.max(np.abs(first.on_grid(x, x) - second.on_grid(x, x))))
    between = np.abs(first.linear - second.linear) / POSITIONS
    size = np.abs(first.weights)[:, None]
    change = np.abs(first.weights - second.weights)[:, None]
    alpha = np.maximum(first.alpha, second.alpha)
    spread = np.abs(first.alpha - second.alpha)
    shift = np.abs(first.center - second.center) * alpha
    # Derivative of the difference: changed weight, changed width and center of this input, and of the other.
    own = _SLOPE * alpha * change + size * (2.0 * spread + _CURVE * alpha * shift)
    others = np.divide(spread, alpha, out=np.zeros_like(alpha), where=alpha > 0.0) + _SLOPE * shift
    mixed = size * _SLOPE * alpha * others[:, ::-1]
    for row in own + mixed:
        between = between + row
    return largest + step / 2.0 * float(between[0] + between[1])


def surface_of(network: Network, scale: Scale, per_block: float, inputs: Inputs) -> Surface:
    """The model's network over positions; `per_block` is minutes per block."""
    center_t, half_t = scale.temperature_c
    halves = (half_t, scale.slope_c_per_min * per_block)
    zeros = (center_t, 0.0)
    units = [half * _UNITS_PER_C * i.per_unit for half, i in zip(halves, inputs, strict=True)]
    middle = [i.position(zero * _UNITS_PER_C) for zero, i in zip(zeros, inputs, strict=True)]
    linear = np.array([network.linear[k] * POSITIONS / units[k] for k in (0, 1)])
    alpha = np.zeros((len(network.weights), 2))
    center = np.zeros_like(alpha)
    for n, ((c_t, c_r), widths) in enumerate(zip(network.centers, network.widths, strict=True)):
        for k, (c, width) in enumerate(zip((c_t, c_r * per_block), widths, strict=True)):
            if width is not None:
                alpha[n, k] = _SQRT_LOG2E / (width * units[k])
                center[n, k] = inputs[k].position(c * _UNITS_PER_C)
    return Surface(
        w0=network.w0 - (linear[0] * middle[0] + linear[1] * middle[1]) / POSITIONS,
        linear=linear,
        alpha=alpha,
        center=center,
        weights=np.array(network.weights, dtype=np.float64),
    )


_MAX_SPAN = 2**26  # 1024 C in 2^-16 C: an offset times 32 then fits 32 bits
_FINEST = 28  # largest number of fraction bits of an argument
# Fraction bits of a bias where the product states none (GTC_BIAS_FRAC_BITS of gtc_config.h): the same for every gyro
# and calibration, so that firmware decodes all tables alike. The unit is 6e-8 deg/h; sums of weights go up to 64 deg/h.
DEFAULT_BITS = 24
_LARGEST_SIZE = 2**30 - 1024  # so that a sum stays below 2^30 after the rounding of 512 weights
_COARSEST = 12  # smallest; the sum of squares is shifted by 2 fraction - 24 bits
_LARGEST_ARGUMENT = 2**31 - 1  # a signed 32-bit word
_MAX_FACTOR = 65535  # of s
_SOLVE_POINTS = 256  # of each input: weights are solved for on this grid, whose time grows with it
# Of the normal equations, which it keeps solvable where Gaussians nearly coincide: docs/numerics.md, section 3
_RIDGE = 1e-6
# Of each input: the bound is loose by what a surface grows within a cell, the time grows with their number
_GRID_CELLS = 512
_SHARE = 2.0**-24  # unit of a share of a bank, which is cut off


@dataclass(frozen=True, slots=True)
class _Gaussians:
    """Rounded Gaussians: arguments s x + k in 2^-fraction."""

    factor: NDArray[np.int64]  # s, shape (n, 2)
    offset: NDArray[np.int64]  # k
    fraction: int

    def fits(self) -> bool:
        """True if every argument, and every factor of one, fits its word."""
        reach = np.maximum(np.abs(self.offset), np.abs(self.offset + self.factor * (POSITIONS - 1)))
        return bool(np.max(reach, initial=0) <= _LARGEST_ARGUMENT and np.max(self.factor, initial=0) <= _MAX_FACTOR)

    def on(self, surface: Surface) -> Surface:
        """The surface with these Gaussians in place of its own."""
        alpha = self.factor * 2.0**-self.fraction
        center = np.divide(-self.offset, self.factor, out=np.zeros(alpha.shape), where=self.factor > 0)
        return replace(surface, alpha=alpha, center=center)


@dataclass(frozen=True, slots=True)
class _Fixed:
    """One network in fixed point, but for the unit of its weights."""

    exact: Surface
    gaussians: _Gaussians
    solved: Surface
    lost: float  # |weights| of Gaussians that are nowhere felt


def table_of(model: Model) -> Table:
    """The table of a model in fixed point, without known answers.

    Raises:
        CheckFailed: The model cannot be held in fixed point, with the reason.
    """
    per_block = model.block_s / 60.0
    envelope = _envelope(model, per_block)
    inputs = (position_scale(*envelope[:2]), position_scale(*envelope[2:]))
    given = (*model.networks, *model.fallback_models)
    surfaces = [surface_of(n, model.scale, per_block, inputs) for n in given]
    felt = [_felt(surface, _moved(inputs)) for surface in surfaces]
    chosen = [_chosen(surface, keep) for surface, keep in zip(surfaces, felt, strict=True)]
    fraction = min(_fraction(surface) for surface in chosen)
    if fraction < _COARSEST:
        raise CheckFailed("q31: a Gaussian is too narrow for the envelope, or too far from it, for its argument")
    networks = [_fixed(whole, part, keep, fraction) for whole, part, keep in zip(surfaces, chosen, felt, strict=True)]
    largest = max(_size(network.solved) for network in networks)
    size = max(largest, abs(model.fallback_dph)) + term_size_dph(model) + model.rezero_dph
    frac_bits = _frac_bits(size, model.q31_bias_frac_bits)
    bounds = [_bound(network, inputs, frac_bits) for network in networks]
    of_map, fallback_models = bounds[: len(model.networks)], bounds[len(model.networks) :]
    parts = {part: max(bound[part] for bound in of_map) for part in bounds[0]}
    if len(model.networks) > 1:
        axes = _axes(model, inputs, per_block)
        parts["hand-over"] = handover_error_dph(model, "q31", axes, share_step=_SHARE, share_error=0.0)
        parts["blend"] = 2.0**-frac_bits  # the quotient is rounded
    table = _table(model, envelope, inputs, networks, frac_bits, parts)
    return replace(table, fallback_model_bounds_dph=tuple(math.fsum(bound.values()) for bound in fallback_models))


def _fixed(whole: Surface, part: Surface, keep: NDArray[np.bool_], fraction: int) -> _Fixed:
    gaussians = _rounded(part, fraction)
    lost = math.fsum(np.abs(whole.weights[~keep]))
    return _Fixed(part, gaussians, _solved(part, gaussians.on(part)), lost)


def _bound(network: _Fixed, inputs: Inputs, frac_bits: int) -> dict[str, float]:
    """Largest departures from the model in float64 over the envelope, deg/h, by their origin."""
    whole = _whole(network.solved, frac_bits)
    final = _in_dph(network.gaussians.on(network.solved), whole, frac_bits)
    size = math.fsum(abs(w) for w in final.weights)
    return {
        "rounded inputs": _input_error(network.exact, inputs),
        "rounded parameters": difference(network.exact, final, _GRID_CELLS),
        "Gaussian": GAUSS_ERROR * size + network.lost * 2.0**-32,
        "truncated result": 2.0**-frac_bits,
    }


def _envelope(model: Model, per_block: float) -> tuple[int, int, int, int]:
    """T min, T max, slope min, slope max in 2^-16 C and 2^-16 C per block."""
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    low_t, high_t, low_r, high_r = (round(v * _UNITS_PER_C) for v in (t0, t1, r0 * per_block, r1 * per_block))
    if max(high_t - low_t, high_r - low_r) >= _MAX_SPAN - 1024:
        raise CheckFailed("q31: the envelope spans more than 1023 C, or 1023 C per block")
    return low_t, high_t, low_r, high_r


def _moved(inputs: Inputs) -> Floats:
    """Positions by which an input can be moved: to the middle of its cell, and by the rounded edges of the envelope.

    As far can the model's own envelope reach beyond the positions: many of them, where it is narrower than 2^-16 C.
    """
    return np.array([0.5 + 0.5 * i.per_unit for i in inputs])


def _felt(surface: Surface, reach: Floats) -> NDArray[np.bool_]:
    """Gaussians that reach 2^-32 somewhere in the envelope, which ends at most `reach` beyond the positions."""
    center = surface.center
    beyond = np.maximum(np.maximum(-center, center - POSITIONS) - reach, 0.0) * surface.alpha
    return np.asarray(beyond[:, 0] ** 2 + beyond[:, 1] ** 2 < 32.0)


def _chosen(surface: Surface, keep: NDArray[np.bool_]) -> Surface:
    return replace(surface, alpha=surface.alpha[keep], center=surface.center[keep], weights=surface.weights[keep])


def _fraction(surface: Surface) -> int:
    """Return the number of fraction bits that the farthest argument leaves."""
    fraction = _FINEST
    while not _rounded(surface, fraction).fits():
        fraction -= 1
    return fraction


def _rounded(surface: Surface, fraction: int) -> _Gaussians:
    """s and k of every Gaussian."""
    factor = np.rint(surface.alpha * 2.0**fraction).astype(np.int64)
    offset = np.rint(-factor * surface.center).astype(np.int64)
    return _Gaussians(factor, offset, fraction)


def _columns(surface: Surface) -> tuple[Floats, Floats]:
    """Factors of constant, linear parts and Gaussians on the grid: for T and for the slope."""
    x = (np.arange(_SOLVE_POINTS) + 0.5) * (POSITIONS / _SOLVE_POINTS)
    one, ramp = np.ones((x.size, 1)), x[:, None] / POSITIONS
    first = np.concatenate([one, ramp, one, surface.factors(0, x)], axis=1)
    second = np.concatenate([one, one, ramp, surface.factors(1, x)], axis=1)
    return first, second


def _solved(exact: Surface, rounded: Surface) -> Surface:
    """Weights for the rounded Gaussians that come nearest to the exact surface, close to its own."""
    old_t, old_r = _columns(exact)
    new_t, new_r = _columns(rounded)
    normal = gram(new_t, new_t) * gram(new_r, new_r)
    cross = gram(new_t, old_t) * gram(new_r, old_r)
    values = np.array([exact.w0, *exact.linear, *exact.weights])
    right = np.zeros(len(values))
    for k, value in enumerate(values):
        right = right + value * (cross[:, k] - normal[:, k])
    diagonal = np.arange(len(values))
    normal[diagonal, diagonal] += _RIDGE * _SOLVE_POINTS**2
    values = values + solve_cholesky(normal, right)
    return replace(exact, w0=float(values[0]), linear=values[1:3], weights=values[3:])


def _size(surface: Surface) -> float:
    """Largest sum that the surface's parts can make, deg/h."""
    return math.fsum(abs(p) for p in (surface.w0, *surface.linear, *surface.weights))


def _frac_bits(size: float, stated: int | None) -> int:
    """Return the fraction bits of a bias: those that the product states, or the default.

    Raises:
        CheckFailed: The weights, terms and re-zero of this gyro do not fit.
    """
    bits = DEFAULT_BITS if stated is None else stated
    if size * 2.0**bits > _LARGEST_SIZE:
        raise CheckFailed(
            f"q31: weights, terms and re-zero of {size:.3g} deg/h in all leave the range of 32 bits in the product's "
            f"unit of 2^-{bits} deg/h: state a smaller q31_bias_frac_bits in the limits file, for all of its gyros"
        )
    return bits


def _whole(surface: Surface, frac_bits: int) -> NDArray[np.int64]:
    """w0, linear parts and weights as integers."""
    values = np.array([surface.w0, *surface.linear, *surface.weights])
    return np.rint(values * 2.0**frac_bits).astype(np.int64)


def _in_dph(surface: Surface, whole: NDArray[np.int64], frac_bits: int) -> Surface:
    values = whole * 2.0**-frac_bits
    return replace(surface, w0=float(values[0]), linear=values[1:3], weights=values[3:])


def _input_error(exact: Surface, inputs: Inputs) -> float:
    """Largest effect of an input that is moved, deg/h."""
    moved = _moved(inputs)
    steepest = exact.steepest(moved)
    return math.fsum(moved[k] * float(steepest[k]) for k in (0, 1))


def _table(
    model: Model,
    envelope: tuple[int, int, int, int],
    inputs: Inputs,
    networks: list[_Fixed],
    frac_bits: int,
    parts: dict[str, float],
) -> Table:
    unit = 2.0**frac_bits
    narrow = 2 * (_FINEST - networks[0].gaussians.fraction)
    wholes = [_whole(network.solved, frac_bits) for network in networks]
    heads = [
        [len(whole) - 3, *whole[:3], *_region(region, inputs, model)]
        for whole, region in zip(wholes, regions(model), strict=True)
    ]
    records = [_records(n.gaussians, whole) for n, whole in zip(networks, wholes, strict=True)]
    return Table(
        numeric="q31",
        **shared(model),
        bias_frac_bits=frac_bits,
        fallback=_word(round(model.fallback_dph * unit)),
        **unbounded("q31"),
        rezero=_word(round(model.rezero_dph * unit)),
        scale=(inputs[0].gain, inputs[1].gain, narrow),
        envelope=tuple(_word(v) for v in envelope),
        networks=_words(heads),
        centers=_words(np.concatenate(records)),
        guards=guard_words(model, "q31"),
        terms=q31_terms(model, frac_bits),
        sigma=_words(sigma_values(model, frac_bits)),
        probes=np.zeros(0, dtype=np.uint32),
        error_bound_dph=math.fsum(parts.values()),
        bound_parts_dph=parts,
    )


def _records(gaussians: _Gaussians, whole: NDArray[np.int64]) -> NDArray[np.int64]:
    """Records of the centers, shape (n, 5): s, k, s, k, weight."""
    pairs = np.stack([gaussians.factor, gaussians.offset], axis=2).reshape(len(whole) - 3, 4)
    return np.concatenate([pairs, whole[3:, None]], axis=1)


def _region(region: Envelope, inputs: Inputs, model: Model) -> list[int]:
    """A network's region in positions."""
    per_block = model.block_s / 60.0
    edges = []
    for scale, pair, unit in zip(inputs, (region.temperature_c, region.slope_c_per_min), (1.0, per_block), strict=True):
        for value in pair:
            edges.append(min(max(round(scale.position(value * unit * _UNITS_PER_C)), 0), POSITIONS - 1))
    return edges


def _axes(model: Model, inputs: Inputs, per_block: float) -> tuple[CoordinateMap, CoordinateMap]:
    """Inputs as the table compares them with the edges of regions: positions.

    An input is moved to the middle of its cell, and by the rounding of the envelope to which both sides clamp.
    """
    boxes = regions(model)[: len(model.networks)]
    edges = np.array([_region(region, inputs, model) for region in boxes], dtype=np.float64)
    t, r = (
        CoordinateMap(
            factor=unit * _UNITS_PER_C * scale.per_unit,
            offset=-scale.low * scale.per_unit - 0.5,
            limits=(0.0, POSITIONS - 1.0),
            edges=edges[:, 2 * k : 2 * k + 2],
            moved=0.5 + 0.5 * scale.per_unit,
        )
        for k, (scale, unit) in enumerate(zip(inputs, (1.0, per_block), strict=True))
    )
    return t, r


def _word(value: int) -> int:
    return int(value) & 0xFFFFFFFF


def _words(values: object) -> NDArray[np.uint32]:
    whole = np.asarray(values).reshape(-1).astype(np.int64)
    return (whole & 0xFFFFFFFF).astype(np.uint32)
