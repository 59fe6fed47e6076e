"""Quantiles that more than one package uses, each from the distribution it belongs to."""

from __future__ import annotations

from scipy.special import chdtri, ndtri

__all__ = ["CHI2_95_ONE", "CHI2_95_TWO", "NORMAL_95"]

CHI2_95_ONE = float(chdtri(1, 0.05))
"""Fall of twice the log-likelihood at the ends of a 95 % interval of one parameter (Wilks): 3.84."""

CHI2_95_TWO = float(chdtri(2, 0.05))
"""The same for the 95 % set of two parameters: 5.99."""

NORMAL_95 = float(ndtri(0.975))
"""Half width of a 95 % interval in standard deviations: 1.96."""
