"""The candidates that a search goes through: every cause of the catalogue on a grid of its parameter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..causes import CATALOGUE
from ..causes.base import Cause, History, Parameter, Values
from ..causes.search import Reach, SearchRule
from ..common.arrays import FloatArray
from .blocks import Records

__all__ = [
    "Candidate",
    "Role",
    "columns_of",
    "diagnosed",
    "planned",
    "reach_of",
    "searched",
    "shape_parameter",
    "testable",
]

Role = Literal["columns", "input", "variance", "structure"]


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


def diagnosed() -> dict[str, Cause]:
    """The causes of the catalogue that diagnosis looks for, in the order in which results list them."""
    return {id: term for id, term in CATALOGUE.items() if term.search is not None}


def planned() -> list[str]:
    """Those of which a profile without rates says something."""
    return [id for id in diagnosed() if searched(id).planned]


def searched(cause: str) -> SearchRule:
    """How diagnosis looks for a cause."""
    search = CATALOGUE[cause].search
    assert search is not None
    return search


def shape_parameter(cause: str) -> Parameter | None:
    """The parameter over which a cause is searched, if it has one."""
    over = searched(cause).over
    return next((p for p in CATALOGUE[cause].parameters if p.name == over), None)


def reach_of(records: Records) -> Reach:
    """What these recordings can show of a cause."""
    span = float(np.ptp(np.concatenate([r.history.temperature_c for r in records.runs])))
    return Reach(span, max(float(np.ptp(r.history.time_s)) for r in records.runs))


def columns_of(records: Records, cause: str, values: Values) -> FloatArray:
    """Block means of the columns that a cause adds, shape (N, k)."""
    features = CATALOGUE[cause].features
    assert features is not None

    def rows(history: History) -> FloatArray:
        return features(history, values).columns

    return records.columns(rows)


def testable(records: Records, cause: str) -> str:
    """Why a cause cannot be tested on these recordings; empty if it can."""
    needs = CATALOGUE[cause].needs
    histories = [run.history for run in records.runs]
    if len(histories) < needs.runs:
        return f"needs {needs.runs} runs, there are {len(histories)}"
    dates = {h.day for h in histories if h.day is not None}
    if needs.dates and (len(dates) < needs.dates or any(h.day is None for h in histories)):
        return f"needs runs on {needs.dates} dates"
    if needs.power_on and any(h.on_s is None for h in histories):
        return "needs the time of power-on of every run"
    return ""
