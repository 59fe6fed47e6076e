"""What could still hide: the smallest amplitude of every cause that the search would find.

d is the matched-filter signal-to-noise ratio of a cause after the static map is taken out; the search finds
`terms.search.SearchRule.needed_d` (6.3 for most causes) in 95 % of cases at a familywise level of 1 %.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..causes import CATALOGUE
from ..common.arrays import FloatArray
from .candidates import Candidate, searched, shape_parameter
from .project import project
from .search import Search

__all__ = ["CauseLimit", "amplitude_energy", "detection_limits", "limit_of"]


_LARGEST = 1e150  # a norm whose square is finite stands for an infinite one


@dataclass(frozen=True)
class CauseLimit:
    """Detection limit of one cause.

    Attributes:
        value: Typical limit over the parameter's range, in `unit`; None where nothing would be seen.
        unit: Of the amplitude; s for a change of the map's input (the shortest that shows in this gyro).
        at: Limits over the parameter: (parameter value, limit).
        parameter: Name of that parameter, or None.
    """

    value: float | None
    unit: str
    at: tuple[tuple[float, float], ...]
    parameter: str | None


def detection_limits(search: Search) -> dict[str, CauseLimit]:
    """Limits at the likeliest colour, by cause (channels: `auxiliary:name`)."""
    view, joined = search.likeliest, search.joined
    projection = project(search, view, "map and beside")
    size = np.diag(projection.gram) / view.scale**2
    found: dict[str, list[tuple[Candidate, float]]] = {}
    for group in search.bank.groups:
        if group.candidate.role == "structure":
            continue
        at = np.arange(group.columns.start, group.columns.stop)
        power = size[at + joined.layout.signatures.start] * search.bank.scale[at] ** 2
        amount = amplitude_energy(group.candidate.id, power)
        if CATALOGUE[group.candidate.id].kind == "static":  # any shape: a unit of it in every block
            amount = search.y.size / view.scale**2
        found.setdefault(group.candidate.id, []).append((group.candidate, amount))
    outside = size[joined.layout.channels.start : joined.layout.inputs.stop]
    for candidate, energy, norm in zip(joined.added, outside, joined.norm, strict=True):
        key = candidate.id if candidate.channel is None else f"{candidate.id}:{candidate.channel}"
        found.setdefault(key, []).append((candidate, float(energy) * min(norm, _LARGEST) ** 2))
    return {key: limit_of(key.split(":")[0], points) for key, points in found.items()}


def amplitude_energy(cause: str, power: FloatArray) -> float:
    """d² of a cause at unit amplitude from that of its columns, shape (k,): of all draws, or of any one column."""
    return float(power.sum() if CATALOGUE[cause].kind == "random" else power.mean())


def limit_of(cause: str, points: list[tuple[Candidate, float]]) -> CauseLimit:
    """Limit from the energies of unit amplitudes over the grid of a cause."""
    d, unit = searched(cause).needed_d, CATALOGUE[cause].unit
    parameter = shape_parameter(cause)
    if CATALOGUE[cause].kind == "input":
        assert parameter is not None
        seen = [abs(c.values[parameter.name]) for c, power in points if np.sqrt(power) >= d]
        at = tuple((c.values[parameter.name], float(np.sqrt(power))) for c, power in points)
        return CauseLimit(min(seen) if seen else None, unit, at, parameter.name)
    limits = [d / np.sqrt(power) if power > 0.0 else np.inf for _, power in points]
    finite = [v for v in limits if np.isfinite(v)]
    value = float(np.exp(np.median(np.log(finite)))) if finite else None
    if parameter is None:
        return CauseLimit(value, unit, (), None)
    at = tuple(
        (c.values[parameter.name], float(v))
        for (c, _), v in zip(points, limits, strict=True)
        if np.isfinite(v)
    )
    return CauseLimit(value, unit, at, parameter.name)
