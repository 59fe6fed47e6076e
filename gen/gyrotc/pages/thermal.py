"""The first pictures of a lab: bias against temperature, heating and cooling in two colours; Allan deviation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from ..common.arrays import BoolArray, FloatArray
from ..common.metrics import Averages
from ..model import Model
from ..results.training import NoiseTerms
from .chart import ACCENT, AFTER, BEFORE, COVERED, HALF, Panel, drawing, side_by_side
from .display import COVERAGE, in_unit, rate_unit, sci

MOVING_C_PER_MIN = 0.1
"""Slower than that temperature stands still: no chamber's programme asks for less, and a hold drifts by less."""
_DOT = 2.5  # points, across
_FLOOR_OVER_B = float(np.sqrt(2.0 * np.log(2.0) / np.pi))  # IEEE Std 952-2020, annex C
_TAU_OVER_Q = float(np.sqrt(3.0))  # Allan deviation times averaging time over Q: the same annex


def slopes(a: Averages) -> FloatArray:
    """dT/dt of the means of a run, C/min, shape (n,); zero of a single one."""
    if a.time_s.size < 2:
        return np.zeros(a.time_s.size)
    return np.asarray(np.gradient(a.temperature_c, a.time_s / 60.0))


def sorted_by_rate(slope: FloatArray) -> tuple[tuple[str, str, BoolArray], ...]:
    """Heating, cooling and held: words, colour and which rows."""
    return (
        ("held", COVERED, np.abs(slope) <= MOVING_C_PER_MIN),
        ("heating", BEFORE, slope > MOVING_C_PER_MIN),
        ("cooling", AFTER, slope < -MOVING_C_PER_MIN),
    )


def bias_against_temperature(model: Model, runs: Sequence[Averages]) -> Markup | None:
    """Bias over temperature before and after, then what remains over temperature and over its rate.

    Args:
        runs: Means of every run that has some.
    """
    there = [a for a in runs if a.time_s.size]
    if not there:
        return None
    t = np.concatenate([a.temperature_c for a in there])
    before, after = (in_unit(np.concatenate([getattr(a, name) for a in there])) for name in ("before_dph", "after_dph"))
    slope = np.concatenate([slopes(a) for a in there])
    kinds = [kind for kind in sorted_by_rate(slope) if kind[2].any()]
    first = Panel(x="temperature, C", y=f"bias, {rate_unit()}", title="measured, and the map")
    second = Panel(x="temperature, C", y=f"bias, {rate_unit()}", title="before and after, on one scale")
    third = Panel(x="temperature, C", y=f"residual, {rate_unit()}", title="what remains, over temperature")
    fourth = Panel(x="dT/dt, C/min", y=f"residual, {rate_unit()}", title="what remains, over dT/dt")
    second.dots(t, before, COVERED, "before", size=_DOT)
    for panel in (second, third, fourth):
        panel.horizontal(0.0)
    for label, color, of in kinds:
        first.dots(t[of], before[of], color, label, size=_DOT)
        second.dots(t[of], after[of], color if label != "held" else ACCENT, f"after, {label}", size=_DOT)
        third.dots(t[of], after[of], color, size=_DOT)
        fourth.dots(slope[of], after[of], color, size=_DOT)
    _fit(first, model, kinds, slope)
    return side_by_side(*(drawing([panel], width=HALF, height=210.0) for panel in (first, second, third, fourth)))


def _fit(panel: Panel, model: Model, kinds: Sequence[tuple[str, str, BoolArray]], slope: FloatArray) -> None:
    """The map at the median rate of heating and of cooling, and at rest with its band of U."""
    t0, t1 = model.envelope.temperature_c
    t = np.linspace(t0, t1, 160) if t1 > t0 else np.array([t0 - 0.5, t0 + 0.5])
    rest = in_unit(model.map_dph(t, np.zeros_like(t)))
    sigma = _sigma_at_rest(model, t)
    if sigma is not None:
        sigma = in_unit(sigma)
        panel.band(t, rest - COVERAGE * sigma, rest + COVERAGE * sigma, ACCENT, "U of the map at rest, k = 2")
    panel.line(t, rest, ACCENT, "map at rest", width=1.4)
    for label, color, of in kinds:
        if label != "held":
            rate = float(np.median(slope[of]))
            words = f"map at {rate:+.2g} C/min".replace("-", "−")
            panel.line(t, in_unit(model.map_dph(t, np.full_like(t, rate))), color, words, dash="5 3", width=1.6)


def _sigma_at_rest(model: Model, t: FloatArray) -> FloatArray | None:
    """1 sigma of the correction at dT/dt = 0, deg/h, as the table's cells have it; None where it has none."""
    known = model.uncertainty_dph
    if known is None:
        return None
    columns, rows = known.cells
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    column = np.clip(((t - t0) / (t1 - t0 or 1.0) * columns).astype(int), 0, columns - 1)
    row = min(max(int((0.0 - r0) / (r1 - r0 or 1.0) * rows), 0), rows - 1)
    covered = _covered_at_rest(model, t)
    cells = np.where(covered, np.array(known.rows)[row, column], np.array(known.uncovered or known.rows)[row, column])
    return np.asarray(cells, dtype=np.float64)


def _covered_at_rest(model: Model, t: FloatArray) -> BoolArray:
    seen = model.coverage
    if seen is None:
        return np.ones(t.shape, dtype=bool)
    columns, rows = seen.cells
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    column = np.clip(((t - t0) / (t1 - t0 or 1.0) * columns).astype(int), 0, columns - 1)
    row = min(max(int((0.0 - r0) / (r1 - r0 or 1.0) * rows), 0), rows - 1)
    return np.array([seen.rows[row][k] == "1" for k in column])


def allan_deviation(noise: NoiseTerms) -> Markup | None:
    """Allan deviation over averaging time with its uncertainty, and the lines of N, B, K and Q that are resolved.

    N: sigma = N / sqrt(tau); B: sigma = B sqrt(2 ln 2 / pi); K: sigma = K sqrt(tau / 3); Q: sigma = sqrt(3) Q / tau
    (IEEE Std 952-2020, annex C; IEEE Std 647 has the same).
    """
    points = [p for p in noise.allan if p.deviation_dph > 0.0]
    if len(points) < 2:
        return None
    tau, value, freedom = (
        np.array([getattr(p, name) for p in points]) for name in ("tau_s", "deviation_dph", "freedom")
    )
    panel = Panel(x="averaging time, s", y=f"Allan deviation, {rate_unit()}", x_log=True, y_log=True)
    spread = value / np.sqrt(2.0 * freedom)
    low, high = np.maximum(value - spread, 0.1 * value), value + spread
    panel.y_range = (float(low.min()) / 1.5, float(high.max()) * 1.5)
    at = np.geomspace(tau[0], tau[-1], 60)
    n, b = noise.arw_deg_per_sqrt_h, noise.bias_instability_dph
    k, q = noise.rate_random_walk_dph_per_sqrt_h, noise.quantisation_arcsec
    if n:
        panel.line(at, in_unit(60.0 * n / np.sqrt(at)), BEFORE, f"N = {sci(n)} deg/√h", dash="5 3")
    if b:
        panel.horizontal(b * _FLOOR_OVER_B, COVERED, f"B = {sci(b)} {rate_unit()}", dash="5 3", width=1.2)
    if k:
        panel.line(at, k * np.sqrt(at / 3600.0 / 3.0), ACCENT, f"K = {sci(k)} {rate_unit()}/√h", dash="2 3")
    if q:
        panel.line(at, in_unit(_TAU_OVER_Q * q / at), COVERED, f"Q = {sci(q)} arcsec", dash="2 3")
    panel.errors(tau, low, high, AFTER)
    panel.line(tau, value, AFTER, "compensated training records")
    panel.dots(tau, value, AFTER, size=6.0)
    return drawing([panel], width=HALF)
