"""The candidates that a search goes through: every cause of the catalogue on a grid of its parameter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .. import terms
from ..terms.base import History, Parameter, Values
from .records import Records

__all__ = ["PENALTY", "Candidate", "Role", "columns_of", "grid", "shape_parameter", "testable"]

Array = NDArray[np.float64]
Role = Literal["columns", "input", "variance", "structure"]

PENALTY: dict[str, int] = {
    "cavity_lag": 2,
    "time_misalignment": 2,
    "thermal_gradient": 2,
    "hysteresis": 2,
    "warm_up": 2,
    "turn_on_offset": 1,
    "ageing": 1,
    "map_too_coarse": 1,
    "path_length_periodicity": 3,
    "auxiliary": 1,
}
"""Free parameters that a cause adds to the model: its share of the information criterion."""

_POINTS = {"cavity_lag": 22, "thermal_gradient": 24, "hysteresis": 20, "warm_up": 12}
_SHIFT_S, _SHIFTS = 50.0, 12


@dataclass(frozen=True, slots=True)
class Candidate:
    """One point of the search.

    Attributes:
        id: Cause.
        values: Its nonlinear parameters.
        role: columns: added to the map; input: the map of other inputs; variance: weights with one common
            variance; structure: anything in the span of the dictionary, no cause.
        channel: Auxiliary channel, else None.
    """

    id: str
    values: dict[str, float]
    role: Role
    channel: str | None = None


def shape_parameter(cause: str) -> Parameter | None:
    """The parameter over which a cause is searched, if it has one."""
    if cause in ("ageing", "map_too_coarse"):
        return None
    shape = terms.CATALOGUE[cause].nonlinear()
    return shape[0] if shape else None


def grid(cause: str, span_c: float, longest_s: float) -> list[Values]:
    """Grid of the nonlinear parameter: fine enough that less than 1 % of a signature's energy falls between points.

    Args:
        cause: Id.
        span_c: Range of the recorded temperatures, C.
        longest_s: Length of the longest run, s.
    """
    parameter = shape_parameter(cause)
    if cause == "ageing":
        return [{"d0_day": float("inf")}, {"d0_day": 2.0}]
    if cause == "map_too_coarse" or parameter is None:
        return [{}]
    low, high = parameter.low, parameter.high
    if cause == "time_misalignment":
        steps = _SHIFT_S * np.arange(1, _SHIFTS + 1)
        return [{parameter.name: float(s)} for s in np.concatenate([-steps[::-1], steps])]
    if cause == "path_length_periodicity":
        high = min(high, 0.7 * span_c)
        if high <= low:
            return []
        waves = np.arange(1.0 / high, 1.0 / low, 1.0 / (3.0 * span_c))
        return [{parameter.name: float(1.0 / w)} for w in waves]
    high = min(high, 0.45 * span_c) if cause == "hysteresis" else min(high, 0.5 * longest_s)
    if high <= low:
        return []
    return [{parameter.name: float(v)} for v in np.geomspace(low, high, _POINTS[cause])]


def columns_of(records: Records, cause: str, values: Values) -> Array:
    """Block means of the columns that a cause adds, shape (N, k)."""
    features = terms.CATALOGUE[cause].features
    assert features is not None

    def rows(history: History) -> Array:
        return features(history, values).columns

    return records.columns(rows)


def testable(records: Records, cause: str) -> str:
    """Why a cause cannot be tested on these recordings; empty if it can."""
    needs = terms.CATALOGUE[cause].needs
    histories = [run.history for run in records.runs]
    if len(histories) < needs.runs:
        return f"needs {needs.runs} runs, there are {len(histories)}"
    dates = {h.day for h in histories if h.day is not None}
    if needs.dates and (len(dates) < needs.dates or any(h.day is None for h in histories)):
        return f"needs runs on {needs.dates} dates"
    if needs.power_on and any(h.on_s is None for h in histories):
        return "needs the time of power-on of every run"
    return ""
