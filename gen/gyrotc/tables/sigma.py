"""Words of a table's uncertainty: two grids, the rules, a word for each term (docs/FORMAT.md, section 3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..model import Model, Rules, Uncertainty

__all__ = ["sigma_cells", "sigma_values"]

_S_PER_MIN = 60.0  # a minute
_S_PER_H = 3600.0  # an hour


def sigma_cells(model: Model) -> tuple[int, int]:
    """Cells of T and of the slope; 0, 0 where the model does not say how uncertain it is."""
    known = model.uncertainty_dph
    return known.cells if known and known.rules else (0, 0)


def sigma_values(model: Model, frac_bits: int | None = None) -> NDArray[np.float64]:
    """The words as numbers, in the units of gtc_sigma.inl; empty where the model does not say.

    Args:
        frac_bits: Fraction bits of a bias in fixed point: numbers are whole then. None: float32.
    """
    known = model.uncertainty_dph
    if known is None or known.rules is None:
        return np.zeros(0)
    biases = [*_grids(known, known.rules), *_rules(known.rules, model.block_s), *known.rules.terms]
    values = np.array(biases)
    correlation = 2 * known.cells[0] * known.cells[1] + len(_rules(known.rules, model.block_s)) - 1
    if frac_bits is None:
        return values
    scale = np.full(values.size, 2.0**frac_bits)
    scale[correlation] = 1.0
    return np.asarray(np.rint(np.minimum(values * scale, 2.0**31 - 1)))


def _grids(known: Uncertainty, rules: Rules) -> list[float]:
    """Covered cells, uncovered ones, without the constant from power-on to power-on."""
    both = np.array([known.rows, known.uncovered or known.rows])
    apart = np.sqrt(np.maximum(both**2 - rules.between_dph**2, 0.0))
    return [float(sigma) for sigma in apart.reshape(-1)]


def _rules(rules: Rules, block_s: float) -> list[float]:
    """In the order of gtc_sigma.inl; the last one is a time."""
    per_min = block_s / _S_PER_MIN
    return [
        rules.hold_dph_per_c,
        rules.rest_dph_per_min * per_min,
        rules.slope_dph_per_c_per_min / per_min,
        rules.start_dph,
        rules.beyond_dph_per_c,
        rules.beyond_dph_per_c_per_min / per_min,
        rules.fallback_dph,
        rules.none_dph,
        rules.between_dph,
        rules.noise_deg_per_sqrt_h * np.sqrt(_S_PER_H),
        rules.correlation_s,
    ]
