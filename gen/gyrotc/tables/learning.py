"""The prior of learning in service, `gtc_learn_prior_t`, from what a model says: docs/numerics.md, section 9."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..common.arrays import FloatArray
from ..common.texts import c_code
from ..model import BiasSpread, Learning
from ..target.learning import KNOTS, ServicePrior, packed
from .text import float_text

MONTH_H = 30.44 * 24.0  # the mean month
_COMMENTS = {
    "low_c": "first knot, C",
    "knots_per_c": "1/C",
    "reference_c": "C",
    "authority_dph": "|shift| is at most this, deg/h",
    "power_on_var": "offset, its slope, warm-up, memory",
    "off_s": "without power, where the caller does not know it",
    "map_var": "covariance of the knots, packed rows",
    "ageing_var": "what it gains each second",
}
_ROW = 6  # numbers


def data_sheet_spread(table_dph: float, turn_on_dph: float, ageing_dph_per_sqrt_month: float) -> BiasSpread:
    """Of a laser gyro, from its data sheet: the table's error, turn-on offsets, ageing of the level.

    A table's error is mostly one of its level, a fifth of it a slope over 30 C; a fiftieth comes and goes with the
    thermal history, as do 3e-5 deg/h of any gyro.
    """
    ageing = ageing_dph_per_sqrt_month / float(np.sqrt(MONTH_H))
    return BiasSpread(
        level=table_dph, slope=0.2 * table_dph / 30.0, shape=0.16 * table_dph, turn_on=turn_on_dph,
        turn_on_slope=0.0, warm_up=0.0, warm_up_s=600.0, memory=float(np.hypot(3e-5, 0.02 * table_dph)),
        memory_s=14400.0, memory_c=20.0, ageing=1.06 * ageing, ageing_shape=0.09 * ageing,
    )  # fmt: skip


def walk(knots: FloatArray) -> FloatArray:
    """Covariance of a random walk from 0 to either side."""
    same_side = np.outer(knots, knots) > 0
    return np.where(same_side, np.minimum.outer(np.abs(knots), np.abs(knots)), 0.0)


def service_prior(learning: Learning, envelope_c: tuple[float, float], id: int = 0) -> ServicePrior:
    """The prior of a table with this id; the knots lie over the envelope."""
    spread, (low, high) = learning.spread, envelope_c
    knots = np.linspace(low, high, KNOTS) - learning.reference_c
    level = spread.level**2 + spread.slope**2 * np.outer(knots, knots) + spread.shape**2 * walk(knots)
    ageing = spread.ageing**2 + spread.ageing_shape**2 * walk(knots)
    return ServicePrior(
        id=id, low_c=low, knots_per_c=(KNOTS - 1) / (high - low), reference_c=learning.reference_c,
        authority_dph=learning.authority_dph,
        power_on_var=(spread.turn_on**2, spread.turn_on_slope**2, spread.warm_up**2, spread.memory**2),
        memory_per_c=float(np.sqrt(3.0)) / spread.memory_c, memory_per_s=1.0 / spread.memory_s,
        warm_up_per_s=1.0 / spread.warm_up_s, off_s=86400.0,
        noise_var=(60.0 * learning.noise_deg_per_sqrt_h) ** 2, noise_ratio=9.0, span_c=learning.span_c,
        settle_s=learning.settle_s, gate_square=learning.gate_sigma**2, jump_square=learning.jump_sigma**2,
        agreeing_rests=learning.agreeing_rests, agreeing_power_ons=learning.agreeing_power_ons - 1,
        map_var=packed(level), ageing_var=packed(ageing / 3600.0),
    )  # fmt: skip


def learning_text(prior: ServicePrior) -> list[dict[str, Any]]:
    """Members of the prior as the template of a table prints them: name, rows of numbers, comment."""
    found: list[dict[str, Any]] = []
    for name, value in prior.members().items():
        if isinstance(value, int):
            cells = [f"0x{value:08x}UL" if name == "id" else f"{value}UL"]
        else:
            cells = [float_text(int(word)) for word in value.view(np.uint32)]
        rows = [c_code(", ".join(cells[k : k + _ROW])) for k in range(0, len(cells), _ROW)]
        found.append({"name": name, "rows": rows, "array": len(cells) > 1, "comment": _COMMENTS.get(name, "")})
    return found
