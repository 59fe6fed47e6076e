"""What units of one type share, and what a unit's few runs say with it (docs/lot.md)."""

from __future__ import annotations

from .learn import LEAST_UNITS, Learned, learn
from .use import LotPrior, prior_of

__all__ = ["LEAST_UNITS", "Learned", "LotPrior", "learn", "prior_of"]
