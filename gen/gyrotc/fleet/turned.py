"""Gyros whose bias over temperature is that of the lot turned over: wired or mounted with the other sign."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..results.fleet import FleetEntry

__all__ = ["turned"]


_LEAST = 8  # gyros; fewer do not say what is usual
_LEAST_PLACES = 6  # of a shorter curve a correlation of 0.9 may be chance
_ALIKE = (
    0.9  # correlation of the usual gyro with the median of the lot, and of a turned one with its negative
)
_SWING = 3.0  # how much more or less than the median it may swing
_KNOWN = 0.8  # share of the lot that knows a temperature


def turned(entries: Sequence[FleetEntry]) -> list[str]:
    """Names of gyros whose curve is the lot's turned over, axis by axis; none where the lot has no common one."""
    names: list[str] = []
    for axis in dict.fromkeys(entry.axis for entry in entries):
        lot = [(e.name, e.facts.curve) for e in entries if e.axis == axis and e.facts is not None]
        names += _turned_of(lot) if len(lot) >= _LEAST else []
    return names


def _turned_of(lot: Sequence[tuple[str, Sequence[float | None]]]) -> list[str]:
    curves = np.array([[np.nan if b is None else b for b in curve] for _, curve in lot], dtype=np.float64)
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
    return [lot[whole[k]][0] for k in np.flatnonzero((alike < -_ALIKE) & even)]
