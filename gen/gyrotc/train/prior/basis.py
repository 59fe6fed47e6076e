"""The functions that maps of a lot are written in, and how large a smooth process makes each of them.

A Hilbert-space process as the smooth map of training (`train/gaussian.py`, docs/training.md, section 1): a constant,
sines of T for a short and a long scale, and products of sines for what couples T and dT/dt. Inputs are normalised to
the lot's envelope, so that units with other programmes share one set of functions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...common.arrays import FloatArray
from ...results.fleet import LotFunctions

PARAMETERS = ("constant", "short", "short_scale", "long", "long_scale", "coupled", "coupled_scale_t", "coupled_scale_r")
"""Standard deviations in units of the lot and scales in half ranges; a process is given by their logarithms."""
PRIOR_LOG = np.log([1.0, 0.3, 0.15, 1.0, 0.7, 0.3, 0.8, 0.8])
_PRIOR_SD = np.array([3.0, 1.5, 0.7, 1.0, 0.5, 1.5, 0.5, 0.5])
CONSTANT = np.log(10.0)  # of the mean of a lot: nothing is known of it
_OF_T, _COUPLED = 40, (10, 8)  # 121 functions
_REACH = 1.4  # the functions vanish at the edge of the domain
_FREQUENCIES: FloatArray = np.asarray(np.pi * (np.arange(_OF_T) + 1.0) / (2.0 * _REACH), dtype=np.float64)
_FLOOR = 1e-10  # a function that is not used keeps the equations solvable
_STEPS = 15  # of a search that goes on in the next round
_BOUND = 5.0  # prior standard deviations: no parameter of use lies beyond


@dataclass(frozen=True, slots=True)
class LotBasis:
    """Functions of T and dT/dt.

    Attributes:
        center_c, half_range_c, half_range_c_per_min: Normalisation of the inputs.
        kept: Which of the 121 functions are used, shape (n,).
    """

    center_c: float
    half_range_c: float
    half_range_c_per_min: float
    kept: NDArray[np.int64]

    def values(self, temperature_c: FloatArray, slope_c_per_min: FloatArray) -> FloatArray:
        """The functions at inputs in C and C/min, shape (points, n)."""
        t = (np.asarray(temperature_c) - self.center_c) / self.half_range_c
        r = np.asarray(slope_c_per_min) / self.half_range_c_per_min
        limit = 0.999 * _REACH  # beyond its domain a sine comes back: the value at the edge stands
        of_t = _sines(np.clip(t, -limit, limit), _OF_T)
        of_r = _sines(np.clip(r, -limit, limit), _COUPLED[1])
        coupled = (of_t[:, : _COUPLED[0], None] * of_r[:, None, :]).reshape(len(t), -1)
        return np.concatenate([np.ones((len(t), 1)), of_t, coupled], axis=1)[:, self.kept]

    def variance(self, log_parameters: FloatArray) -> FloatArray:
        """Variance of each coefficient under a smooth process, shape (n,)."""
        return np.asarray(_variance(log_parameters)[0][self.kept])

    @staticmethod
    def over(temperature_c: tuple[float, float], slope_c_per_min: tuple[float, float]) -> LotBasis:
        """All functions over an envelope."""
        low, high = temperature_c
        largest = max(-slope_c_per_min[0], slope_c_per_min[1], 0.05)  # C/min: as the floor of a model's scale
        every = np.arange(1 + _OF_T + _COUPLED[0] * _COUPLED[1])
        return LotBasis(0.5 * (low + high), max(0.5 * (high - low), 1.0), largest, every)

    @staticmethod
    def read(functions: LotFunctions) -> LotBasis:
        """The functions that a file tells."""
        kept = np.array(functions.kept, dtype=np.int64)
        return LotBasis(functions.center_c, functions.half_range_c, functions.half_range_c_per_min, kept)

    def result(self) -> LotFunctions:
        """The functions as a file tells them."""
        return LotFunctions(
            center_c=self.center_c,
            half_range_c=self.half_range_c,
            half_range_c_per_min=self.half_range_c_per_min,
            kept=tuple(int(k) for k in self.kept),
        )

    def only(self, used: NDArray[np.bool_]) -> LotBasis:
        """Some of these functions."""
        return LotBasis(self.center_c, self.half_range_c, self.half_range_c_per_min, self.kept[used])


def fitted_parameters(
    basis: LotBasis, squares: FloatArray, units: float, start: FloatArray, *, free: bool = True
) -> FloatArray:
    """Log parameters of the process whose coefficients have given mean squares.

    Args:
        squares: Mean square of each coefficient, shape (n,).
        units: How many squares are behind each mean.
        start: Where the search begins.
        free: Whether the constant's is sought, too; else it stays.
    """
    from scipy.optimize import minimize  # 0.1 s: who only uses a lot needs none

    seen = np.maximum(squares, 1e-14)

    def cost(x: FloatArray) -> tuple[float, FloatArray]:
        variance, slope = _variance(x)
        variance, slope = variance[basis.kept], slope[:, basis.kept]
        off = (x - PRIOR_LOG) / _PRIOR_SD
        fit = 0.5 * units * float(np.sum(np.log(variance) + seen / variance)) + 0.5 * float(off @ off)
        gradient = 0.5 * units * (slope @ (1.0 / variance - seen / variance**2)) + off / _PRIOR_SD
        if not free:
            gradient[0] = 0.0
        return fit, gradient

    bounds = [(m - _BOUND * s, m + _BOUND * s) for m, s in zip(PRIOR_LOG, _PRIOR_SD, strict=True)]
    if not free:
        bounds[0] = (start[0], start[0])
    found = minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": _STEPS})
    return np.asarray(found.x)


def _sines(x: FloatArray, n: int) -> FloatArray:
    return np.asarray(np.sin(np.outer(x + _REACH, _FREQUENCIES[:n])) / np.sqrt(_REACH))


def _density(size: float, scale: float, w: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Spectral density of a squared-exponential process, and its derivative by the logarithm of the scale."""
    reach = (scale * w) ** 2
    density = size**2 * np.sqrt(2.0 * np.pi) * scale * np.exp(-0.5 * reach)
    return np.asarray(density), np.asarray(density * (1.0 - reach))


def _variance(log_parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Variances of all functions, shape (121,), and their derivatives by the parameters, shape (8, 121).

    By the logarithm of a standard deviation a variance changes by twice itself.
    """
    constant, short, short_scale, long, long_scale, size, scale_t, scale_r = np.exp(log_parameters)
    near, near_slope = _density(short, short_scale, _FREQUENCIES)
    far, far_slope = _density(long, long_scale, _FREQUENCIES)
    of_t, of_t_slope = _density(size, scale_t, _FREQUENCIES[: _COUPLED[0]])
    of_r, of_r_slope = _density(1.0, scale_r, _FREQUENCIES[: _COUPLED[1]])
    coupled = np.outer(of_t, of_r).ravel()
    slope = np.zeros((len(PARAMETERS), 1 + _OF_T + coupled.size))
    slope[0, 0] = 2.0 * constant**2
    slope[1:5, 1 : 1 + _OF_T] = 2.0 * near, near_slope, 2.0 * far, far_slope
    products = np.outer(of_t_slope, of_r), np.outer(of_t, of_r_slope)
    slope[5:, 1 + _OF_T :] = 2.0 * coupled, products[0].ravel(), products[1].ravel()
    return np.concatenate([[constant**2], near + far, coupled]) + _FLOOR, slope
