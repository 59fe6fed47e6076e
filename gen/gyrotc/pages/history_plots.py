"""The picture of a unit's calibrations: how it was found and left each time, and how its map moved since the first."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from itertools import pairwise
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..common.texts import picture_text
from ..results.changes import Calibration
from .plots import ACCENT, AFTER, BEFORE, COVERED, STYLE, svg

__all__ = ["calibrations_over_time"]

_MOST_NAMED = 12  # dates that fit below a panel


def calibrations_over_time(history: Sequence[Calibration]) -> str | None:
    """RMS as found and as left, and the map's mean against the first calibration's; None with fewer than two."""
    if len(history) < 2:
        return None
    at, days = _times(history)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 3.0), layout="constrained")
        left, right = figure.subplots(1, 2)
        _remaining(left, at, history)
        _moved(right, at, history)
        for ax in (left, right):
            _labelled(ax, at, history, days)
        return svg(figure)


def _times(history: Sequence[Calibration]) -> tuple[list[float], bool]:
    """Days since the first where each has a date after the one before, else the number of each."""
    try:
        days = [float(date.fromisoformat(str(one.date)[:10]).toordinal()) for one in history]
    except ValueError:
        days = []
    if days and all(b > a for a, b in pairwise(days)):
        return [day - days[0] for day in days], True
    return [float(k) for k in range(1, len(history) + 1)], False


def _remaining(ax: Axes, at: Sequence[float], history: Sequence[Calibration]) -> None:
    series = (
        ("as found: the correction before", BEFORE, [one.as_found_rms_dph for one in history]),
        ("as left: the new one", AFTER, [one.as_left_rms_dph for one in history]),
    )
    for label, color, values in series:
        known = [(t, v) for t, v in zip(at, values, strict=True) if v is not None]
        if known:
            ax.plot(*zip(*known, strict=True), "o-", color=color, linewidth=1.0, markersize=4, label=label)
            ax.legend(fontsize=8)
    ax.set(ylabel="RMS of what remains, deg/h")
    ax.set_ylim(bottom=0.0)


def _moved(ax: Axes, at: Sequence[float], history: Sequence[Calibration]) -> None:
    """Steps of the map's mean, summed; each with the U of how far the map moved, and filled where that is exceeded."""
    steps = [one.moved_mean_dph or 0.0 for one in history]
    total = np.cumsum(steps) - steps[0]
    ax.axhline(0.0, color=ACCENT, linewidth=0.6)
    ax.plot(at, total, "-", color=COVERED, linewidth=1.0)
    for k, one in enumerate(history):
        style: Any = {"color": AFTER, "markersize": 5, "mfc": AFTER if one.significant else "white"}
        spread = one.expanded_uncertainty_dph
        ax.errorbar(
            at[k], total[k], yerr=spread if k and spread else None, fmt="o", capsize=2, linewidth=1.0, **style
        )
    ax.set(ylabel="mean of the map since the first, deg/h")


def _labelled(ax: Axes, at: Sequence[float], history: Sequence[Calibration], dated: bool) -> None:
    """Dates below where there are some and they fit."""
    if dated and len(at) <= _MOST_NAMED:
        ax.set_xticks(at, [picture_text(str(one.date)[:10]) for one in history], rotation=20, ha="right")
        return
    ax.set(xlabel="days since the first calibration" if dated else "number of the calibration")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
