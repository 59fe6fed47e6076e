"""`report.html` of a unit in service, from `service.json`. Computes nothing new."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from markupsafe import Markup

from ..common.arrays import FloatArray
from ..results.base import read_result
from ..results.evaluation import InService, ServedStops
from .chart import AFTER, BEFORE, COVERED, HALF, Panel, drawing, side_by_side
from .display import NATIVE, displayed, rate_unit, shown
from .report import page_environment, page_from, write_page

_BAND = 2.0  # sigma that a band reaches, about 95 %
_NEAR = 0.25  # of the authority: what is drawn reaches so far, and the picture has room for it


def is_service(folder: Path) -> bool:
    """Whether a folder holds what a unit learned in service."""
    return (folder / "service.json").is_file()


def write_service_page(folder: Path, display: str | None = None) -> Path:
    """Writes `folder/report.html` from `folder/service.json`; returns its path.

    Raises:
        InputError: `service.json` is missing or broken.
    """
    source = folder / "service.json"
    read = read_result(source, InService)
    with displayed(display or NATIVE), page_from(source):
        result = shown(read)
        text = (
            page_environment()
            .get_template("service.html.j2")
            .render(r=result, where=_where(result), over_time=_over_time(result), band=_BAND)
        )
    return write_page(folder, text)


def _over_time(result: InService) -> Markup | None:
    """Measured bias and learned correction at every stop, and how far they are apart."""
    if result.stops is None:
        return None
    days = np.array(result.stops.clock_h) / 24.0
    days -= days[0]
    y, half = np.array(result.stops.shift_dph), _BAND * np.array(result.stops.sigma_dph)
    both = Panel(y=f"bias, {rate_unit()}")
    _dots(both, days, result.stops, np.zeros(len(y)))
    both.errors(days, y - half, y + half, AFTER)
    both.dots(days, y, AFTER, "correction after it", size=3.0)
    _authority(both, result)
    apart = Panel(x="days in service", y=f"difference, {rate_unit()}")
    apart.band(days, -half, half, COVERED, f"{_BAND:g} sigma of the correction")
    _dots(apart, days, result.stops, y)
    return drawing([both, apart], heights=(190.0, 110.0), share_x=True)


def _where(result: InService) -> Markup | None:
    """What was learned at each knot beside what was not known."""
    t, shift, sigma, unlearned = (
        np.array([getattr(knot, name) for knot in result.knots])
        for name in ("temperature_c", "shift_dph", "sigma_dph", "unlearned_dph")
    )
    learned = Panel(x="temperature, C", y=f"learned, {rate_unit()}")
    learned.band(t, -_BAND * unlearned, _BAND * unlearned, COVERED, "without learning")
    learned.band(t, shift - _BAND * sigma, shift + _BAND * sigma, AFTER)
    learned.line(t, shift, AFTER, "learned")
    learned.dots(t, shift, AFTER)
    if result.stops is not None:
        _dots(learned, np.array(result.stops.temperature_c), result.stops, np.zeros(len(result.stops.rate_dph)))
    _authority(learned, result)
    known = Panel(x="temperature, C", y=f"1 sigma, {rate_unit()}", y_log=True)
    for values, color, label in ((unlearned, COVERED, "without learning"), (sigma, AFTER, "with")):
        known.line(t, values, color, label)
        known.dots(t, values, color)
    return side_by_side(*(drawing([panel], width=HALF) for panel in (learned, known)))


def _dots(panel: Panel, x: FloatArray, stops: ServedStops, less: FloatArray) -> None:
    """Stops that taught and those that were refused, less something, as far as the picture reaches."""
    rate, refused = np.array(stops.rate_dph), np.array(stops.status) < 0
    seen = np.abs(rate) <= 2.0 * float(np.max(np.abs(stops.shift_dph) + 2.0 * _BAND * np.array(stops.sigma_dph)))
    rate = rate - less
    panel.dots(x[~refused & seen], rate[~refused & seen], BEFORE, "measured at a stop", size=3.0)
    if (refused & seen).any():
        panel.dots(x[refused & seen], rate[refused & seen], COVERED, "refused", size=4.0, hollow=True)


def _authority(panel: Panel, result: InService) -> None:
    """Its two lines, where the picture comes near them."""
    numbers = panel.span_of("y")
    if len(numbers) and np.max(np.abs(numbers)) >= _NEAR * result.authority_dph:
        for sign in (-1.0, 1.0):
            panel.horizontal(sign * result.authority_dph, dash="5 3", label="authority" if sign > 0.0 else "")
