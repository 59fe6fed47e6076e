"""The columns of the Gaussian model over T and dT/dt in physical units, as files hold them, and their variances.

Maps of a lot and of an earlier calibration are written in the columns of the model of training (`train/gaussian.py`),
so what is known of a unit before its runs is a mean and a covariance of the same coefficients. Inputs are normalised to
one envelope, so that units with other programmes share one set of columns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...common.arrays import FloatArray
from ...results.fleet import LotFunctions
from ..data import Scaling
from ..gaussian import COLUMNS, FREE, Basis, Structure

PARAMETERS = (
    "constant",
    "line",
    "curve",
    "slope",
    "smooth",
    "smooth_scale",
    "coupled",
    "coupled_scale_t",
    "coupled_scale_r",
)
"""Standard deviations in units of the coefficients and scales in half ranges; searched by their logarithms."""
_MAP = Structure(COLUMNS, 0)
_OF_MAP = _MAP.map_parameters
PRIOR_LOG: FloatArray = np.append(0.0, _MAP.prior(1.0)[0][:_OF_MAP])
_PRIOR_SD: FloatArray = np.append(3.0, _MAP.prior(1.0)[1][:_OF_MAP])
CONSTANT = 0.5 * float(np.log(FREE))
"""Log standard deviation of a constant of which nothing is known."""
_STEPS = 15  # of a search that goes on in the next round
_BOUND = 5.0  # prior standard deviations: no parameter of use lies beyond
# Beyond its domain a sine comes back: from this share of it on, the value there stands.
_EDGE = 0.999


@dataclass(frozen=True, slots=True)
class PriorBasis:
    """Columns of the model at inputs in C and C/min.

    Attributes:
        center_c, half_range_c, half_range_c_per_min: Normalisation of the inputs.
        columns: The columns over normalised inputs.
        kept: Numbers of the columns that are used, ascending, shape (n,).
    """

    center_c: float
    half_range_c: float
    half_range_c_per_min: float
    columns: Basis
    kept: NDArray[np.int64]

    def values(self, temperature_c: FloatArray, slope_c_per_min: FloatArray) -> FloatArray:
        """Return the columns at inputs in C and C/min, shape (points, n)."""
        t = (np.asarray(temperature_c) - self.center_c) / self.half_range_c
        r = np.asarray(slope_c_per_min) / self.half_range_c_per_min
        far_t, far_r = _EDGE * self.columns.reach_t, _EDGE * self.columns.reach_r
        return self.columns.columns(np.clip(t, -far_t, far_t), np.clip(r, -far_r, far_r))[:, self.kept]

    def variance(self, log_parameters: FloatArray) -> FloatArray:
        """Return the variance of each coefficient, shape (n,)."""
        return self._variance(log_parameters)[0]

    def fitted_parameters(
        self, squares: FloatArray, units: float, start: FloatArray, *, free: bool = True
    ) -> FloatArray:
        """Return the most probable log parameters of coefficients with given mean squares.

        Args:
            squares: Mean square of each coefficient, shape (n,).
            units: How many squares are behind each mean.
            start: Where the search begins.
            free: True if the constant's is sought, too; else it stays.
        """
        from scipy.optimize import minimize  # 0.1 s: who only uses a lot needs none

        seen = np.maximum(squares, 1e-14)

        def cost(x: FloatArray) -> tuple[float, FloatArray]:
            variance, slope = self._variance(x)
            off = (x - PRIOR_LOG) / _PRIOR_SD
            fit = 0.5 * units * float(np.sum(np.log(variance) + seen / variance)) + 0.5 * float(off @ off)
            gradient = 0.5 * units * ((1.0 / variance - seen / variance**2) @ slope) + off / _PRIOR_SD
            if not free:
                gradient[0] = 0.0
            return fit, gradient

        bounds = [(m - _BOUND * s, m + _BOUND * s) for m, s in zip(PRIOR_LOG, _PRIOR_SD, strict=True)]
        if not free:
            bounds[0] = (start[0], start[0])
        found = minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": _STEPS})
        return np.asarray(found.x)

    def _variance(self, log_parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the variances, shape (n,), and their derivatives by the parameters, shape (n, 9)."""
        variance, by_map = _MAP.variances(log_parameters[1:], self.columns)
        slope = np.column_stack([np.zeros(COLUMNS), by_map])
        variance[0] = np.exp(2.0 * log_parameters[0])
        slope[0, 0] = 2.0 * variance[0]
        return variance[self.kept], slope[self.kept]

    @staticmethod
    def over(temperature_c: tuple[float, float], slope_c_per_min: tuple[float, float]) -> PriorBasis:
        """Return all columns over an envelope."""
        low, high = temperature_c
        largest = max(-slope_c_per_min[0], slope_c_per_min[1], 0.05)  # C/min: as the floor of a model's scale
        ends = np.array([-1.0, 1.0])
        columns = Basis.over(ends, ends)
        return PriorBasis(0.5 * (low + high), max(0.5 * (high - low), 1.0), largest, columns, np.arange(COLUMNS))

    @staticmethod
    def of(columns: Basis, scaling: Scaling) -> PriorBasis:
        """Return all columns of a fit."""
        ranges = scaling.half_range_c, scaling.half_range_c_per_min
        return PriorBasis(scaling.center_c, *ranges, columns, np.arange(COLUMNS))

    @staticmethod
    def read(functions: LotFunctions) -> PriorBasis:
        """Return the columns that a file states."""
        f = functions
        columns = Basis(f.slope_unit, f.reach_t, f.reach_r)
        kept = np.array(f.kept, dtype=np.int64)
        return PriorBasis(f.center_c, f.half_range_c, f.half_range_c_per_min, columns, kept)

    def result(self) -> LotFunctions:
        """Return the columns as a file states them."""
        return LotFunctions(
            center_c=self.center_c,
            half_range_c=self.half_range_c,
            half_range_c_per_min=self.half_range_c_per_min,
            slope_unit=self.columns.rate,
            reach_t=self.columns.reach_t,
            reach_r=self.columns.reach_r,
            kept=tuple(int(k) for k in self.kept),
        )

    def only(self, used: NDArray[np.bool_]) -> PriorBasis:
        """Return some of these columns."""
        return replace(self, kept=self.kept[used])
