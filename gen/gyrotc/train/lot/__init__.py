"""What units of one type share, and what a unit's few runs say with it (docs/lot.md)."""

from __future__ import annotations

from .learn import LEAST_UNITS, Learned, UnitMeans, learn
from .prior import LotPrior, prior_of

__all__ = ["LEAST_UNITS", "Learned", "LotPrior", "UnitMeans", "learn", "prior_of"]
