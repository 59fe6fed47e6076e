"""State from which size on a cause can be told from each rival on these temperatures."""

from __future__ import annotations

import numpy as np

from ..common.arrays import FloatArray
from ..common.statistics import TOLERANCE, orthonormal
from .profile_likelihood import Gains
from .refinement import Refined

_TELLING = 10.0  # d² of the part that the rival cannot mimic: odds of about e^5 for the right one (docs/diagnosis.md)
_LEAST = 1e-3  # 1 − R² below which nothing distinguishes the two


def overlap(gains: Gains, cause: Refined, rivals: list[str]) -> dict[str, float]:
    """d from which a cause can be distinguished from each rival: √(10/(1 − R²)), R² what the rival can mimic of it."""
    search = gains.search
    total = gains.whiten(_fitted(gains, cause))
    own = total - gains.map_q @ (gains.map_q.T @ total)
    energy = float(own @ own)
    out = {}
    for rival in rivals:
        best = 0.0
        for candidate, at in (*gains.plain, *gains.random):
            if candidate.id == rival:
                best = max(best, _explained(gains.plain_columns(at), own))
        for base in search.bank.inputs:
            if base.id == rival:
                best = max(best, 1.0 - gains.rest_after(base, total) / energy)
        out[rival] = float(np.sqrt(_TELLING / max(1.0 - best, _LEAST)))
    return out


def _explained(columns: FloatArray, target: FloatArray) -> float:
    """Share of the energy of `target`, shape (N,), that lies in the span of columns, shape (N, k)."""
    return float(((orthonormal(columns).T @ target) ** 2).sum() / (target @ target))


def _fitted(gains: Gains, cause: Refined) -> FloatArray:
    """Map and cause as fitted, without noise, deg/h."""
    bank = gains.search.bank
    if cause.candidate.role == "input":
        return np.asarray(cause.columns @ np.linalg.lstsq(cause.columns, gains.search.y, rcond=TOLERANCE)[0])
    rest = gains.search.y - cause.contribution
    return np.asarray(bank.map @ (bank.map.T @ rest) + cause.contribution)
