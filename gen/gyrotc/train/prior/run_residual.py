"""Residual of a map on a run that it has not seen, with its covariance."""

from __future__ import annotations

import numpy as np

from ...common.arrays import FloatArray
from ...common.errors import InputError
from .unit_means import UnitMeans
from .use import MapPosterior, MapPrior


def within(prior: MapPrior, run: UnitMeans) -> UnitMeans:
    """Return the means of a run that lie in the envelope of a prior: the others say nothing of it.

    Raises:
        InputError: None does.
    """
    (t0, t1), (r0, r1) = prior.temperature_c, prior.slope_c_per_min
    t, r = run.temperature_c, run.slope_c_per_min
    inside = (t >= t0) & (t <= t1) & (r >= r0) & (r <= r1)
    if not inside.any():
        found = f"is nowhere within {t0:.1f} ... {t1:.1f} C and {r0:.2f} ... {r1:.2f} C/min"
        raise InputError("--prior", f"the check run {found}", "a run where the earlier model holds")
    return run.select(inside)


class RunResidual:
    """Means of a run less a map that has not seen them, deg/h.

    Everything is solved among the means, whose noise keeps the equations regular however wide a map's covariance is.

    Attributes:
        values: Columns at the means, deg/h, shape (means, n).
        noise: Covariance of the means about the map of all power-ons.
        left: Means less the map, shape (means,).
    """

    def __init__(self, expected: MapPosterior, run: UnitMeans) -> None:
        prior = expected.prior
        self.values = prior.unit_dph * prior.basis.values(run.temperature_c, run.slope_c_per_min)
        self.noise = _scatter_of(run, self.values, prior.own)
        self.left = run.bias_dph - prior.center_dph - self.values @ expected.mean

    def scatter(self, covariance: FloatArray) -> FloatArray:
        """Return the covariance of the residual for a covariance of the coefficients."""
        return np.asarray(self.values @ covariance @ self.values.T + self.noise)

    def log_odds(self, scatter: FloatArray, root: FloatArray, sizes: FloatArray) -> FloatArray:
        """Return the log evidence of the residual for changes of some sizes, over that of none.

        Args:
            scatter: Covariance of the residual where nothing has changed.
            root: Of the covariance of the coefficients' change of size 1, shape (n, m).
            sizes: Of the change, in the coefficients' unit.
        """
        white = np.linalg.solve(np.linalg.cholesky(scatter), np.column_stack([self.values @ root, self.left]))
        q, size, _ = np.linalg.svd(white[:, :-1], full_matrices=False)
        more = np.outer(sizes**2, size**2)
        return np.asarray(0.5 * np.sum((q.T @ white[:, -1]) ** 2 * more / (1.0 + more) - np.log1p(more), axis=1))

    def gain(self, covariance: FloatArray) -> FloatArray:
        """Return the movement of the coefficients per unit of the residual, shape (coefficients, means)."""
        return np.asarray(np.linalg.solve(self.scatter(covariance), self.values @ covariance).T)


def _scatter_of(run: UnitMeans, values: FloatArray, own: FloatArray) -> FloatArray:
    """Return the covariance of means about the map of all power-ons: noise, and what each power-on has of its own.

    Args:
        run: The means.
        values: Columns at the means, deg/h.
        own: Variances of what a power-on has of its own, of the first columns.
    """
    of_own = (values[:, : len(own)] * own) @ values[:, : len(own)].T
    if run.power_on is not None:
        of_own = of_own * (run.power_on[:, None] == run.power_on)
    return np.asarray(of_own + np.diag(run.sigma_dph**2 / run.count))
