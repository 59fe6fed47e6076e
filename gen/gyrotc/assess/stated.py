"""Contributions to the uncertainty budget that are stated, proven, or of earlier calibrations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import date
from itertools import pairwise
from typing import Final, Literal

import numpy as np

from ..model import Model
from ..results.budget import Contribution, Instrument
from ..results.changes import Calibration, Changes
from ..results.verification import Verification
from .limits import Limits

__all__ = [
    "AGEING", "DAYS_A_YEAR", "Known", "ageing", "arithmetic", "combined", "part", "reference", "thermometer",
    "yearly_drifts",
]  # fmt: skip

_STEP = 0.01  # of the range of temperatures, for the map's gradient
DAYS_A_YEAR = 365.25  # the Julian year
AGEING: Final = "ageing"  # the contribution of that name
Known = tuple[float, float | None]
"""A contribution, deg/h, and its degrees of freedom (None: many)."""


def combined(parts: Sequence[Known]) -> Known:
    """Combined standard uncertainty and effective degrees of freedom (JCGM 100:2008, 5.1.2 and G.2b)."""
    variance = math.fsum(u**2 for u, _ in parts)
    few = math.fsum(u**4 / freedom for u, freedom in parts if freedom is not None)
    return math.sqrt(variance), variance**2 / few if few > 0.0 else None


def part(
    id: Literal["noise", "fit", "unseen", "turn_on", "thermometer", "reference", "arithmetic", "ageing"],
    text: str,
    u: float,
    source: str,
    *,
    unit: str = "deg/h",
    sensitivity: float = 1.0,
    freedom: float | None = None,
    statistical: bool = False,
    rectangular: bool = False,
    certificate: str = "",
) -> Contribution:
    """A row of the budget; `u` in `unit`, `sensitivity` in deg/h for one of it."""
    few: Literal["normal", "t"] = "t" if freedom is not None else "normal"
    return Contribution(
        id=id,
        text=text,
        type="A" if statistical else "B",
        distribution="rectangular" if rectangular else few,
        standard_uncertainty=u,
        unit=unit,
        sensitivity=sensitivity,
        contribution_dph=sensitivity * u,
        freedom=freedom,
        source=source,
        certificate=certificate,
    )


def thermometer(model: Model, instruments: Sequence[Instrument]) -> Contribution | str:
    """Of the temperatures, or why it is not known."""
    found = _stated(instruments, "temperature")
    if found is None:
        return "thermometer: no uncertainty of its temperatures between calibration and use is stated"
    u, freedom, names, certificates = found
    return part(
        "thermometer",
        "temperature that the table is asked with, against that of the calibration",
        u,
        names,
        unit="C",
        sensitivity=_gradient(model),
        freedom=freedom,
        certificate=certificates,
    )


def reference(model: Model, instruments: Sequence[Instrument]) -> Contribution | str:
    """Of the rate that recordings are referred to, or why it is not known."""
    found = _stated(instruments, "rate")
    if found is None:
        rate = model.meta.get("earth_rate")
        return "reference rate: no uncertainty of it is stated" + (
            f" (Earth's rate: {rate})" if isinstance(rate, str) and rate else ""
        )
    u, freedom, names, certificates = found
    return part(
        "reference",
        "rate that the recordings are referred to",
        u,
        names,
        freedom=freedom,
        certificate=certificates,
    )


def _stated(instruments: Sequence[Instrument], quantity: str) -> tuple[float, float | None, str, str] | None:
    """Combined standard uncertainty of all instruments of a quantity, degrees of freedom, names, certificates."""
    mine = [i for i in instruments if i.quantity == quantity and i.expanded_uncertainty is not None]
    if not mine:
        return None
    u, freedom = combined(
        [((i.expanded_uncertainty or 0.0) / i.coverage_factor, i.degrees_of_freedom) for i in mine]
    )
    certificates = ", ".join(i.certificate for i in mine if i.certificate)
    return u, freedom, ", ".join(i.name for i in mine), certificates


def _gradient(model: Model) -> float:
    """RMS of the map's slope over temperature where training was, deg/h/C."""
    t, r = model.trained_inputs()
    t0, t1 = model.envelope.temperature_c
    step = _STEP * (t1 - t0)
    if step <= 0.0:
        return 0.0
    apart = model.map_dph(np.minimum(t + step, t1), r) - model.map_dph(np.maximum(t - step, t0), r)
    across = np.minimum(t + step, t1) - np.maximum(t - step, t0)
    return float(np.sqrt(np.mean((apart / across) ** 2)))


def arithmetic(verification: Verification | None) -> Contribution | str:
    """Of rounding, or why it is not known."""
    if verification is None or not verification.errors:
        return "arithmetic of the target: no bound was proven"
    return part(
        "arithmetic",
        "rounding of the table and of its evaluation",
        verification.error_bound_dph / math.sqrt(3.0),
        "proven bound of every input",
        rectangular=True,
    )


def ageing(limits: Limits | None, changes: Changes | None) -> Contribution | str:
    """To the end of the interval, or why it is not known."""
    interval = limits.interval if limits else None
    if interval is None:
        return "ageing: no interval until the next calibration is stated"
    years = interval.days / DAYS_A_YEAR
    if interval.drift_dph_per_year is not None:
        return part(
            AGEING,
            f"drift of the bias to the end of {interval.days:g} days",
            interval.drift_dph_per_year / math.sqrt(3.0),
            "largest drift of the type, as the limits file states it",
            unit="deg/h a year",
            sensitivity=years,
            rectangular=True,
        )
    drifts = yearly_drifts(changes.history if changes else ())
    if not drifts:
        return "ageing: neither a drift of the type nor an earlier calibration with its date is known"
    return part(
        AGEING,
        f"drift of the bias to the end of {interval.days:g} days",
        math.sqrt(math.fsum(d**2 for d in drifts) / len(drifts)),
        f"{len(drifts) + 1} calibrations",
        unit="deg/h a year",
        sensitivity=years,
        freedom=float(len(drifts)),
        statistical=True,
    )


def yearly_drifts(history: Sequence[Calibration]) -> list[float]:
    """Move of the map's mean between calibrations that have dates, deg/h a year."""
    found = []
    for before, after in pairwise(history):
        if before.date and after.date and after.moved_mean_dph is not None:
            try:
                days = (date.fromisoformat(after.date[:10]) - date.fromisoformat(before.date[:10])).days
            except ValueError:
                continue
            if days > 0:
                found.append(after.moved_mean_dph * DAYS_A_YEAR / days)
    return found
