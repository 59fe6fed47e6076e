"""The causes of the catalogue on a grid of their parameter, and what recordings can show of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..causes import CATALOGUE
from ..causes.base import OVERTONES, Cause, CauseValues, Parameter, Reach, SearchRule
from ..common.arrays import FloatArray
from .blocks import Records

CandidateRole = Literal["columns", "input", "variance", "structure"]
CandidateKey = tuple[str, tuple[tuple[str, float], ...], str | None]


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
    role: CandidateRole
    channel: str | None = None

    @property
    def key(self) -> CandidateKey:
        """Key that tells it from all others, for sets and dictionaries."""
        return self.id, tuple(sorted(self.values.items())), self.channel


def diagnosable_causes() -> dict[str, Cause]:
    """The causes of the catalogue that diagnosis looks for, in the order in which results list them."""
    return {id: term for id, term in CATALOGUE.items() if term.search is not None}


def searched(cause: str) -> SearchRule:
    """Search of diagnosis for a cause."""
    search = CATALOGUE[cause].search
    assert search is not None
    return search


def price_of(candidate: Candidate) -> int:
    """Number of its parameters: a sine and a cosine for each overtone of a wave, beside those of its kind."""
    return searched(candidate.id).price + 2 * int(candidate.values.get(OVERTONES, 0))


def shape_parameter(cause: str) -> Parameter | None:
    """The parameter over which a cause is searched, if it has one."""
    over = searched(cause).over
    return next((p for p in CATALOGUE[cause].parameters if p.name == over), None)


def reach_of(records: Records) -> Reach:
    """Return the reach of these recordings."""
    span = float(np.ptp(np.concatenate([r.history.temperature_c for r in records.runs])))
    return Reach(span, max(float(np.ptp(r.history.time_s)) for r in records.runs))


def columns_of(records: Records, cause: str, values: CauseValues) -> FloatArray:
    """Block means of the columns that a cause adds, shape (N, k)."""
    features = CATALOGUE[cause].features
    assert features is not None
    return records.columns(lambda history: features(history, values))


def testable(records: Records, cause: str) -> str:
    """Return the reason why a cause cannot be tested on these recordings; empty if it can."""
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
