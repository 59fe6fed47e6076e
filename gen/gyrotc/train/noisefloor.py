"""Noise and thermal sensitivity of a gyro in the terms of IEEE Std 647 and 952, from rates and residuals.

The Allan variance of a rate ω averaged over τ is, as a sum of independent noises (IEEE Std 952-2020, annex C):

    σ²(τ) = 3 Q²/τ² + N²/τ + (2 ln 2/π) B² + K² τ/3

with quantisation Q, angle random walk N, bias instability B and rate random walk K.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..common.metrics import LEAST_SPAN_C
from ..results.training import AllanPoint, BiasPlane, NoiseTerms

__all__ = ["allan_variance", "noise_terms", "sensitivities", "stretches"]


_FLICKER = 2.0 * np.log(2.0) / np.pi  # 2 ln 2/π: IEEE Std 952-2020, annex C
_LEAST_PAIRS = 8  # independent differences behind a point, which then scatters by a quarter: 1/√(2·8)
_LEAST_SPAN_C_PER_MIN = 0.1  # a chamber at rest wanders by this
_S_PER_H = 3600.0  # s in an hour


def stretches(
    values: FloatArray, time_s: FloatArray, run: NDArray[np.int64], step_s: float
) -> list[FloatArray]:
    """Values of gap-free stretches: cut where the run changes or a step of time is longer than 1.5 `step_s`."""
    cuts = np.flatnonzero((np.diff(run) != 0) | (np.diff(time_s) > 1.5 * step_s)) + 1
    return list(np.split(values, cuts))


def allan_variance(residuals: Sequence[FloatArray], step_s: float) -> list[AllanPoint]:
    """Overlapping Allan deviation at octaves of the step, pooled over gap-free stretches (NIST SP 1065, eq. 11).

    Args:
        residuals: Mean rates over `step_s`, one array for each stretch, deg/h.
        step_s: Length of a mean, s.
    """
    total: dict[int, tuple[float, int]] = {}
    for stretch in residuals:
        factors = [2**k for k in range(32) if 2 ** (k + 1) <= len(stretch) // 2]
        for factor in factors:
            differences = _differences(stretch, factor)
            square, count = total.get(factor, (0.0, 0))
            total[factor] = (square + 0.5 * float(differences @ differences), count + len(differences))
    return [
        AllanPoint(
            tau_s=factor * step_s, deviation_dph=float(np.sqrt(square / count)), freedom=count / factor
        )
        for factor, (square, count) in sorted(total.items())
        if count / factor >= _LEAST_PAIRS
    ]


def _differences(rates: FloatArray, factor: int) -> FloatArray:
    """Every difference of two means over `factor` rates that follow one another: two of sums of sums."""
    angle = np.concatenate([[0.0], np.cumsum(rates - rates.mean())])
    return np.asarray(angle[2 * factor :] - 2.0 * angle[factor:-factor] + angle[: -2 * factor]) / factor


def noise_terms(residuals: Sequence[FloatArray], step_s: float) -> NoiseTerms:
    """Q, N, B and K of residuals by least squares with non-negative squares, and the Allan deviation itself.

    Each square of an Allan deviation is weighted by its own scatter, 2 σ⁴ / freedom. A term that the record does
    not show is 0; all are None where the record is too short.

    Args:
        residuals: Mean rates over `step_s`, one array for each gap-free stretch, deg/h.
        step_s: Length of a mean, s.
    """
    from scipy.optimize import nnls  # 0.2 s to import, which who fits nothing need not wait for

    points = allan_variance(residuals, step_s)
    names = (
        "quantisation_arcsec",
        "arw_deg_per_sqrt_h",
        "bias_instability_dph",
        "rate_random_walk_dph_per_sqrt_h",
    )
    terms: dict[str, float | None] = dict.fromkeys(names)
    if len(points) >= len(names) and all(p.deviation_dph > 0.0 for p in points):
        tau = np.array([p.tau_s for p in points])
        square = np.array([p.deviation_dph for p in points]) ** 2
        weight = np.sqrt(np.array([p.freedom for p in points]) / 2.0) / square
        # 1 arcsec/s is 1 deg/h, so that Q in arcsec goes with τ in s, and N, K with τ in h.
        shapes = np.stack(
            [3.0 / tau**2, _S_PER_H / tau, np.full(len(tau), _FLICKER), tau / _S_PER_H / 3.0], axis=1
        )
        scale = shapes.max(axis=0)
        squares, _ = nnls(weight[:, None] * shapes / scale, weight * square)
        terms = dict(zip(names, (float(v) for v in np.sqrt(squares / scale)), strict=True))
    return NoiseTerms(**terms, allan=tuple(points))


def sensitivities(
    temperature_c: FloatArray, slope_c_per_min: FloatArray, bias_dph: FloatArray, weight: FloatArray
) -> BiasPlane:
    """Slopes of the uncompensated bias per C and per C/min, by least squares of a plane."""
    root = np.sqrt(weight)
    inputs = {"bias_dph_per_c": temperature_c, "bias_dph_per_c_per_min": slope_c_per_min}
    least = {"bias_dph_per_c": LEAST_SPAN_C, "bias_dph_per_c_per_min": _LEAST_SPAN_C_PER_MIN}
    used = [name for name, values in inputs.items() if len(values) and np.ptp(values) >= least[name]]
    columns = [np.ones(len(bias_dph)), *(inputs[name] - inputs[name].mean() for name in used)]
    design = np.stack(columns, axis=1)
    solution, *_ = np.linalg.lstsq(design * root[:, None], bias_dph * root, rcond=None)
    residual = bias_dph - design @ solution
    slopes = dict(zip(used, (float(value) for value in solution[1:]), strict=True))
    return BiasPlane(
        bias_dph_per_c=slopes.get("bias_dph_per_c"),
        bias_dph_per_c_per_min=slopes.get("bias_dph_per_c_per_min"),
        residual_rms_dph=float(np.sqrt(np.average(residual**2, weights=weight))),
    )
