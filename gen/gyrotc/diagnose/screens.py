"""Screen recordings before any test for causes: outliers, uneven variance, coarse steps of the temperature sensor.

Unforeseen variance is the main source of false causes. Outliers are left out, never replaced; uneven variance becomes
weights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc, pdtrc

from ..common.arrays import FloatArray
from ..common.statistics import TOLERANCE, orthonormal
from ..quality.odds import FALSE_ALARMS
from .blocks import Records, centred_slope
from .discrepancy import NoiseFinding
from .noise import NOISE_WORDS

_MANY = 8  # few stretches of outliers are left out in silence
_P_VARIANCE = 1e-4  # weights for even noise cost little, yet a finding is reported: rarer than the 1 % of causes
_RATIO = 1.25  # of standard deviations, above which uneven variance matters
_SIGMAS = (0.1, 10.0)  # factors of a standard deviation: beyond them the functions extrapolate
_KNOTS = 4  # hats over the temperature: the variance is a slow function of it


@dataclass(frozen=True)
class Screened:
    """Findings of the screens, and what is done about them.

    Attributes:
        sigma: Factor of the noise of every block, median 1, shape (N,); None: even.
        findings: Causes of the family `noise` found here.
    """

    sigma: FloatArray | None
    findings: tuple[NoiseFinding, ...]


def screen(records: Records) -> Screened:
    """Run all screens."""
    found = [rows for run in records.runs for rows in run.outliers]
    findings: list[tuple[str, float, dict[str, float]]] = []
    if len(found) >= _MANY:
        by_chance = float(pdtrc(len(found) - 1, FALSE_ALARMS * len(records.runs)))
        share = sum(found) / sum(run.read for run in records.runs)
        findings.append(("outliers", by_chance, {"count": float(sum(found)), "share": share}))
    sigma, p_variance, ratio = _variance(records)
    if sigma is not None:
        findings.append(("noise_variance", p_variance, {"ratio": ratio}))
    step = _temperature_step(records)
    if step is not None:
        findings.append(("temperature_quantisation", 0.0, {"step_c": step}))
    return Screened(sigma, tuple(NoiseFinding(id, p, values, NOISE_WORDS[id]) for id, p, values in findings))


def _variance(records: Records) -> tuple[FloatArray | None, float, float]:
    """Estimate how the quick part of the noise depends on |dT/dt|, T and the time since power-on.

    The log of the mean squared difference of neighbouring rows in a block (of neighbouring blocks where a
    block is one row) is regressed on smooth functions of the three (Breusch and Pagan's idea, robust).

    Returns:
        Factor of every block's standard deviation (None if it is even), p-value, and ratio of the largest to the
        smallest factor (95 % range).
    """
    value, at = _quick_power(records)
    design = _variance_design(records)
    usable_rows = value > 0.0
    logs, x = np.log(value[usable_rows]), design[at[usable_rows]]
    if logs.size < 4 * x.shape[1]:
        return None, 1.0, 1.0
    q = orthonormal((x - x.mean(axis=0))[:, 1:])
    rank = max(q.shape[1], 1)
    centred = logs - logs.mean()
    weights = q.T @ centred
    left = float(((centred - q @ weights) ** 2).sum())
    freedom = logs.size - 1 - q.shape[1]
    f = float((weights**2).sum()) / rank / (left / freedom)
    p = float(fdtrc(rank, freedom, f))
    beta, *_ = np.linalg.lstsq(x, logs, rcond=TOLERANCE)
    sigma = np.exp(np.clip(0.5 * (design @ beta - np.median(design @ beta)), *np.log(_SIGMAS)))
    low, high = np.quantile(sigma, [0.025, 0.975])
    ratio = float(high / low)
    if p > _P_VARIANCE or ratio < _RATIO:
        return None, p, ratio
    return sigma, p, ratio


def _quick_power(records: Records) -> tuple[FloatArray, NDArray[np.int64]]:
    """Mean squared difference of neighbouring usable rows of a block, and the block, where there are such rows."""
    power, index = [], []
    for k, (run, span) in enumerate(zip(records.runs, records.spans(), strict=True)):
        usable = run.usable
        pair = usable[1:] & usable[:-1]
        square = np.where(pair, np.diff(np.where(usable, run.rate_dph, 0.0)) ** 2, 0.0)
        number = records.index[k][1:]
        size = int(records.index[k][-1]) + 1
        total = np.bincount(number, weights=square, minlength=size)
        count = np.bincount(number, weights=pair, minlength=size)
        kept = records.kept[k]
        ok = count[kept] > 0
        power.append(total[kept][ok] / count[kept][ok])
        index.append(np.arange(span.start, span.stop)[ok])
    return np.concatenate(power), np.concatenate(index)


def _variance_design(records: Records) -> FloatArray:
    """Constant, |dT/dt|, its square, hats over T, and a fading with time since power-on, shape (N, k)."""
    t = records.columns(lambda h: h.temperature_c)
    r = np.abs(records.columns(centred_slope))
    r = r / max(float(r.max()), 1e-9)
    columns = [np.ones_like(t), r, r**2]
    span = float(np.ptp(t))
    if span > 2.0:
        nodes = np.linspace(t.min(), t.max(), _KNOTS)
        width = nodes[1] - nodes[0]
        columns += [np.maximum(0.0, 1.0 - np.abs(t - n) / width) for n in nodes[1:]]
    if all(run.history.on_s is not None for run in records.runs):
        on = records.average([np.asarray(run.history.on_s) for run in records.runs])
        columns.append(np.exp(-np.maximum(on, 0.0) / 1800.0))
    return np.column_stack(columns)


def _temperature_step(records: Records) -> float | None:
    """Step of the temperature record, C, where it is so coarse that the record stands still between steps."""
    steps = []
    for run in records.runs:
        t = run.history.temperature_c
        change = np.abs(np.diff(t))
        moved = change[change > 1e-9]
        if moved.size < 20:
            continue
        unit = float(np.quantile(moved, 0.02))
        even = np.abs(moved / unit - np.round(moved / unit)) < 0.02
        still = float(np.mean(change <= 1e-9))
        if unit >= 0.05 and even.mean() > 0.95 and still > 0.5:
            steps.append(unit)
    return float(np.median(steps)) if len(steps) * 2 > len(records.runs) else None
