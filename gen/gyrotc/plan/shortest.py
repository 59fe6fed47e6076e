"""The shortest list of runs that reaches required detection limits: the best further run, again and again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..common.errors import InputError
from .sensitivity import Sensitivity

__all__ = ["FoundProfile", "shortest"]

_MOST_RUNS = 60  # bounds the search
_UNSEEN = 1e3  # times the required limit: what counts for a cause that would not be seen at all


@dataclass(frozen=True)
class FoundProfile:
    """Runs by name (with repetitions) and their hours; None where no number of these runs reaches the limits."""

    runs: tuple[str, ...] | None
    hours: float | None
    reached: dict[str, float | None]


def shortest(sensitivity: Sensitivity, required: Mapping[str, float]) -> FoundProfile:
    """Adds the run that helps most for its hours, until every limit is reached.

    Args:
        sensitivity: Belongs to the programme whose runs may be used, each as often as needed.
        required: Limits by cause, in the unit of its limit.

    Raises:
        InputError: A cause is unknown or cannot be tested by these runs.
    """
    known = sensitivity.limits()
    for id in required:
        if id not in known:
            raise InputError("--require", repr(id), ", ".join(known))
    hours = sensitivity.programme.hours
    chosen: list[int] = []
    now = _distance(sensitivity, chosen, required)
    while now > 0.0 and len(chosen) < _MOST_RUNS:
        after = [_distance(sensitivity, [*chosen, k], required) for k in range(len(hours))]
        best = max(range(len(hours)), key=lambda k: ((now - after[k]) / hours[k], -chosen.count(k)))
        chosen.append(best)
        now = after[best]
    if now > 0.0:
        return FoundProfile(None, None, _values(sensitivity, chosen, required))
    for k in sorted(chosen, key=lambda k: -hours[k]):
        rest = [*chosen]
        rest.remove(k)
        if _distance(sensitivity, rest, required) == 0.0:  # what a later run has made needless
            chosen = rest
    reached = _values(sensitivity, chosen, required)
    names = [run.name for run in sensitivity.programme.records.runs]
    return FoundProfile(tuple(names[k] for k in chosen), sum(hours[k] for k in chosen), reached)


def _values(
    sensitivity: Sensitivity, runs: list[int], required: Mapping[str, float]
) -> dict[str, float | None]:
    if not runs:
        return dict.fromkeys(required)
    limits = sensitivity.limits(runs)
    return {id: limits[id].value for id in required}


def _distance(sensitivity: Sensitivity, runs: list[int], required: Mapping[str, float]) -> float:
    """Sum of the logarithms by which limits are above what is required; 0 when all are reached."""
    values = _values(sensitivity, runs, required)
    return sum(
        float(np.log(_UNSEEN if v is None else max(v / required[id], 1.0))) for id, v in values.items()
    )
