"""How far curves and products of channels on the target may be from the model's, for every reading in the guard.

docs/numerics.md, section 8, has the sums; the channel's mean and the temperature are those of the target. Every part
is a rounding of one step times the largest effect that it has.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..model import Model, Term
from ..target.q31 import GAUSS_ERROR
from ..target.recursion import TableKind
from ..target.table import Numeric
from .guards import guard_of

__all__ = ["channel_error_dph"]

_EPS = 2.0**-24  # largest relative error of one float32 rounding
_F32_GAUSSIAN = 1.9e-7  # of 2^-v in float32, by visiting every argument: docs/numerics.md, section 2
_STEEP = 0.715  # largest |d/da 2^(-a²)|: sqrt(2 ln2 / e)
_SCALED = 0.736  # largest |da²/da a 2^(-a²)|: 2/e
_CUT = 2.0**-32  # what a Gaussian is at 32 octaves, where it ends


def channel_error_dph(model: Model, numeric: Numeric, frac_bits: int) -> float:
    """Sum over the curves and products of a model, deg/h; 0 without any."""
    of = _f32 if numeric == "f32" else _q31
    kinds = (TableKind.CURVE, TableKind.PRODUCT)
    return math.fsum(of(model, term, 2.0**-frac_bits) for term in model.terms if term.table.kind in kinds)


def _reaches(model: Model, term: Term) -> tuple[float, float]:
    """Largest distance of a reading from the reference; of T from its own, C."""
    guard, p = guard_of(model, term.channel), term.parameters
    reach = max(abs(x - p["reference"]) for x in (guard.low, guard.high))
    middle = p.get("reference_c", 0.0)
    return reach, max(abs(t - middle) for t in model.envelope.temperature_c)


def _q31(model: Model, term: Term, unit: float) -> float:
    values = term.table.parameters(term.parameters, model.block_s)
    reach, reach_c = _reaches(model, term)
    if term.table.kind == TableKind.CURVE:
        slope, gain, _, first, _, second = values
        argument = gain * 2.0**-17 + 2.0**-28  # a center is rounded, the product cut off
        bell = GAUSS_ERROR + _CUT + _STEEP * argument + _SCALED * 2.0**-25 / gain
        line = 0.5 * unit * reach + abs(slope) * 2.0**-17 + unit
        return line + (abs(first) + abs(second)) * bell + 2.0 * unit
    slope, _, growth, _ = values
    here = 0.5 * unit + 0.5 * unit * reach_c + abs(growth) * 2.0**-17 + unit
    return here * reach + _steepest(values, reach_c) * 2.0**-17 + unit


def _f32(model: Model, term: Term, unit: float) -> float:
    values = term.table.parameters(term.parameters, model.block_s)
    reach, reach_c = _reaches(model, term)
    if term.table.kind == TableKind.CURVE:
        slope, gain, reference, first, center, second = values
        line = abs(slope) * (3.0 * reach + abs(reference)) * _EPS
        bells = math.fsum(
            abs(w) * (_F32_GAUSSIAN + _CUT + _STEEP * gain * abs(c) * _EPS + (4.0 * _SCALED + 2.0) * _EPS)
            for c, w in ((reference, first), (center, second))
        )
        total = abs(slope) * reach + 2.0 * (abs(first) + abs(second))  # of the two sums
        return 1.01 * (line + bells + total * _EPS)
    slope, reference, growth, middle = values
    here = abs(slope) + abs(growth) * (4.0 * reach_c + abs(middle)) + _steepest(values, reach_c)
    return 1.01 * _EPS * (here * reach + _steepest(values, reach_c) * (2.0 * reach + abs(reference)))


def _steepest(values: Sequence[float], reach_c: float) -> float:
    return abs(values[0]) + abs(values[2]) * reach_c
