"""Gyros whose bias over temperature is that of the lot turned over: wired or mounted with the other sign."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...model import Model
from ...results.fleet import FleetEntry

__all__ = ["curve_of", "turned", "with_turned"]

Floats = NDArray[np.float64]

_PLACES_C = np.arange(-60.0, 126.0, 5.0)
_LEAST = 8  # gyros; fewer do not say what is usual
_LEAST_PLACES = 6  # 30 C: on a shorter curve a correlation of 0.9 may be chance
_ALIKE = (
    0.9  # correlation of the usual gyro with the median of the lot, and of a turned one with its negative
)
_SWING = 3.0  # how much more or less than the median it may swing
_KNOWN = 0.8  # share of the lot that knows a temperature


def curve_of(model: Model) -> list[float | None]:
    """Bias at a slope of 0, deg/h, every 5 C from -60 to 125 C; None outside the envelope."""
    low, high = model.envelope.temperature_c
    bias = model.map_dph(_PLACES_C, np.zeros(len(_PLACES_C)))
    return [float(b) if low <= t <= high else None for t, b in zip(_PLACES_C, bias, strict=True)]


def turned(entries: Sequence[FleetEntry]) -> list[str]:
    """Names of gyros whose curve is the lot's turned over, axis by axis; none where the lot has no common one."""
    names: list[str] = []
    for axis in dict.fromkeys(entry.axis for entry in entries):
        lot = [e for e in entries if e.axis == axis and e.curve]
        names += _turned_of(lot) if len(lot) >= _LEAST else []
    return names


def _turned_of(lot: Sequence[FleetEntry]) -> list[str]:
    curves = np.array([[np.nan if b is None else b for b in entry.curve] for entry in lot], dtype=np.float64)
    known = np.mean(np.isfinite(curves), axis=0) >= _KNOWN
    curves = curves[:, known]
    if curves.shape[1] < _LEAST_PLACES:
        return []
    whole = np.flatnonzero(np.isfinite(curves).all(axis=1))
    shapes = curves[whole] - curves[whole].mean(axis=1, keepdims=True)
    usual = np.median(shapes, axis=0)
    swing = np.sqrt(np.mean(shapes**2, axis=1))
    size = float(np.sqrt(np.mean(usual**2)))
    if len(whole) < _LEAST or size == 0.0:
        return []
    alike = np.mean(shapes * usual, axis=1) / np.maximum(swing * size, np.finfo(float).tiny)
    if float(np.median(alike)) < _ALIKE:
        return []
    even = (swing < _SWING * size) & (swing > size / _SWING)
    return [lot[whole[k]].name for k in np.flatnonzero((alike < -_ALIKE) & even)]


def with_turned(entries: Sequence[FleetEntry]) -> list[FleetEntry]:
    """The entries, those of turned gyros with the finding `sign_reversed`."""
    names = set(turned(entries))
    return [
        entry.model_copy(update={"findings": (*entry.findings, "sign_reversed")})
        if entry.name in names and "sign_reversed" not in entry.findings
        else entry
        for entry in entries
    ]
