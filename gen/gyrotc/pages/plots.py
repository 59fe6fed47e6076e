"""Pictures of reports, of a unit's history and of priors: results in, SVG out.

Pictures of a fleet are in `fleet_plots`, those of bias against temperature in `thermal`.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from itertools import pairwise

import numpy as np
from markupsafe import Markup

from ..common.metrics import Averages
from ..model import Model
from ..results.evaluation import Calibration
from ..results.training import Training
from .chart import ACCENT, AFTER, BEFORE, COVERED, HALF, THIRD, Panel, drawing, side_by_side
from .display import in_unit, rate_unit

_CURVES = (
    ("unexplained", "1 − Σ error-reduction ratio"),
    ("departure", "squared departure from the smooth estimate ÷ noise variance"),
    ("misfit", "cost of the fit"),
)
_LEAST = 1e-12  # of what a logarithmic axis shows: rounding of float64 over the values that are compared
_REST_C_PER_MIN = 0.1  # means at up to this rate are drawn as at rest: a cell of the gathered means
_BAND = 2.0  # sigma that a band reaches, about 95 %


def bias_over_time(
    runs: Sequence[tuple[str, str, Averages]], left_out_s: Sequence[Sequence[float]] = ()
) -> Markup | None:
    """Measured and compensated bias of every run (label, role, averages), one panel a run, common scales.

    Args:
        left_out_s: Times of rows that were left out of training, for each run, s; drawn as marks above.
    """
    marks = [*left_out_s, *[()] * (len(runs) - len(left_out_s))]
    rates = in_unit(np.concatenate([np.r_[a.before_dph, a.after_dph, 0.0] for _, _, a in runs]))
    span = (float(rates.min()), float(rates.max()))
    pictures = []
    for k, ((label, role, a), times) in enumerate(zip(runs, marks, strict=True)):
        panel = Panel(x="time, h", y=f"bias, {rate_unit()}", title=f"{label} ({role})", y_range=span)
        first = a.time_s[0] if a.time_s.size else 0.0
        hours = (a.time_s - first) / 3600.0
        panel.horizontal(0.0)
        panel.line(hours, in_unit(a.before_dph), BEFORE, "" if k else "measured", width=1.0)
        panel.line(hours, in_unit(a.after_dph), AFTER, "" if k else "compensated", width=1.0)
        if len(times) and a.time_s.size:
            panel.tops((np.array(times) - first) / 3600.0)
        pictures.append(drawing([panel], width=THIRD, height=110.0))
    return side_by_side(*pictures)


def map_with_centers(model: Model) -> Markup | None:
    """The map over its envelope, hatched where there was no training data, with its centers; and cuts through it."""
    (t0, t1), (r0, r1) = _shown(model.envelope.temperature_c), _shown(model.envelope.slope_c_per_min)
    t, r = np.linspace(t0, t1, 160), np.linspace(r0, r1, 80)
    tt, rr = np.meshgrid(t, r)
    seen = model.coverage
    hidden = np.array([[c == "0" for c in row] for row in seen.rows]) if seen is not None else None
    surface = Panel(x="temperature, C", y="dT/dt, C/min", title="dots: centers (rings: beyond); hatched: not trained")
    surface.image(in_unit(model.map_dph(tt, rr)), (t0, t1), (r0, r1), f"bias, {rate_unit()}", hidden)
    centers = np.array([c for network in model.networks for c in network.centers]).reshape(-1, 2)
    places = np.clip(centers, (t0, r0), (t1, r1))
    within = np.all(places == centers, axis=1)
    for of, hollow in ((within, False), (~within, True)):
        surface.dots(places[of, 0], places[of, 1], ACCENT, size=7.0, hollow=hollow)
    cuts = Panel(x="temperature, C", y=f"bias, {rate_unit()}", title="cuts through the map")
    for rate, dash, color in zip(np.linspace(r0, r1, 3), ("5 3", "", "1.5 2.5"), (AFTER, COVERED, BEFORE), strict=True):
        label = f"{round(rate, 2) + 0.0:+.2f} C/min".replace("-", "−")  # + 0.0: not "-0.00"
        cuts.line(t, in_unit(model.map_dph(t, np.full_like(t, rate))), color, label, dash=dash, width=1.4)
    return side_by_side(drawing([surface], width=HALF, height=240.0), drawing([cuts], width=HALF, height=220.0))


def _shown(limits: tuple[float, float]) -> tuple[float, float]:
    """Limits of an axis: those of the envelope, widened a little where they are one value."""
    low, high = limits
    return limits if high > low else (low - 0.5, high + 0.5)


def curve_by_size(training: Training) -> Markup | None:
    """What each further center brings: error left over the number of centers, the chosen one marked."""
    sizes = training.curves.get("sizes") or []
    if len(sizes) < 2:
        return None
    panel = Panel(x="number of centers", y_log=True, whole_x=True)
    keys = [(k, label) for k, label in _CURVES if all(s.get(k) is not None for s in sizes)]
    n = [s["centers"] for s in sizes]
    for (key, label), color in zip(keys, (AFTER, BEFORE, COVERED), strict=False):
        values = np.maximum([s[key] for s in sizes], _LEAST)
        panel.line(n, values, color, label)
        panel.dots(n, values, color, size=6.0)
    chosen = training.curves.get("chosen")
    if chosen is not None:
        panel.vertical(chosen, label=f"chosen: {chosen}", dash="5 3")
    return drawing([panel], width=HALF)


_MOST_NAMED = 12  # dates that fit below a panel


def calibrations_over_time(history: Sequence[Calibration]) -> Markup | None:
    """RMS as found and as left, and the map's mean against the first calibration's; None with fewer than two."""
    if len(history) < 2:
        return None
    at, dated = _times(history)
    named = dated and len(at) <= _MOST_NAMED
    ticks = [(t, str(one.date)[:10]) for t, one in zip(at, history, strict=True)] if named else None
    words = "" if named else "days since the first calibration" if dated else "number of the calibration"
    left = Panel(x=words, y=f"RMS of what remains, {rate_unit()}", y_range=(0.0, None), x_ticks=ticks, whole_x=True)
    for label, color, values in (
        ("as found: the correction before", BEFORE, [one.as_found_rms_dph for one in history]),
        ("as left: the new one", AFTER, [one.as_left_rms_dph for one in history]),
    ):
        known = np.array([(t, v) for t, v in zip(at, values, strict=True) if v is not None])
        if known.size:
            left.line(known[:, 0], known[:, 1], color, label)
            left.dots(known[:, 0], known[:, 1], color, size=6.0)
    right = Panel(x=words, y=f"mean of the map, {rate_unit()}", x_ticks=ticks, whole_x=True)
    _moved(right, at, history)
    return side_by_side(drawing([left], width=HALF), drawing([right], width=HALF))


def _times(history: Sequence[Calibration]) -> tuple[list[float], bool]:
    """Days since the first where each has a date after the one before, else the number of each."""
    try:
        days = [float(date.fromisoformat(str(one.date)[:10]).toordinal()) for one in history]
    except ValueError:
        days = []
    if days and all(b > a for a, b in pairwise(days)):
        return [day - days[0] for day in days], True
    return [float(k) for k in range(1, len(history) + 1)], False


def _moved(panel: Panel, at: Sequence[float], history: Sequence[Calibration]) -> None:
    """Steps of the map's mean, summed; each with the U of how far the map moved, and filled where that is exceeded."""
    steps = [one.moved_mean_dph or 0.0 for one in history]
    total = np.cumsum(steps) - steps[0]
    panel.horizontal(0.0)
    panel.line(at, total, COVERED, "since the first calibration")
    spread = np.array([(one.expanded_uncertainty_dph or np.nan) if k else np.nan for k, one in enumerate(history)])
    panel.errors(at, total - spread, total + spread, AFTER)
    more = np.array([bool(one.significant) for one in history])
    x = np.array(at)
    if more.any():
        panel.dots(x[more], total[more], AFTER, "moved by more than U", size=8.0)
    panel.dots(x[~more], total[~more], AFTER, size=8.0, hollow=True)


def prior_and_posterior(training: Training) -> Markup | None:
    """Prior, recordings and posterior where temperature stands still, deg/h over C; None where nothing was known."""
    if training.lot is not None:
        curve, name = training.lot.curve, f"the lot alone, {training.lot.units} units"
    elif training.prior is not None:
        curve, name = training.prior.curve, "the earlier model after ageing"
    else:
        return None
    if curve is None:
        return None
    t = np.array(curve.temperature_c)
    panel = Panel(x="temperature, C", y=f"bias at rest, {rate_unit()}")
    for mean, sigma, color, label in (
        (curve.prior_dph, curve.prior_sigma_dph, COVERED, name),
        (curve.posterior_dph, curve.posterior_sigma_dph, AFTER, "with this unit's own runs"),
    ):
        middle, half = np.array(mean), _BAND * np.array(sigma)
        panel.band(t, middle - half, middle + half, color)
        panel.line(t, middle, color, label, width=1.4)
    if (means := training.means) is not None:
        still = np.abs(means.slope_c_per_min) <= _REST_C_PER_MIN
        at = np.array(means.temperature_c)[still], np.array(means.bias_dph)[still]
        panel.dots(*at, BEFORE, "its recordings at rest")
    return drawing([panel], width=HALF)
