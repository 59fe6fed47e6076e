"""What could still hide: the smallest amplitude of every cause that the search would find, and what mimics what.

d is the matched-filter signal-to-noise ratio of a cause after the static map is taken out; the search finds
`Search.needed_d` (6.3 for most causes) in 95 % of cases at a familywise level of 1 %.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...terms import CATALOGUE
from ..attribute.gains import Gains
from ..attribute.refine import Refined
from ..signatures.candidates import Candidate, searched, shape_parameter
from .search import Search

__all__ = ["Limit", "amplitude_energy", "detection_limits", "limit_of", "overlap"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Limit:
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


def detection_limits(search: Search) -> dict[str, Limit]:
    """Limits at the likeliest colour, by cause (channels: `auxiliary:name`)."""
    view = search.likeliest
    projection = search.project(view, search.base)
    size = np.diag(projection.gram) / view.scale**2
    found: dict[str, list[tuple[Candidate, float]]] = {}
    for group in search.bank.groups:
        if group.candidate.role == "structure":
            continue
        at = np.arange(group.columns.start, group.columns.stop)
        power = size[at + search.n_map] * search.bank.scale[at] ** 2
        amount = amplitude_energy(group.candidate.id, power)
        if CATALOGUE[group.candidate.id].kind == "static":  # any shape: a unit of it in every block
            amount = search.y.size / view.scale**2
        found.setdefault(group.candidate.id, []).append((group.candidate, amount))
    for k, candidate in enumerate(search.extra_candidates):
        at_extra = search.n_map + search.n_bank + k
        key = candidate.id if candidate.channel is None else f"{candidate.id}:{candidate.channel}"
        found.setdefault(key, []).append(
            (candidate, float(size[at_extra]) * min(search.extra_norm[k], 1e150) ** 2)
        )
    return {key: limit_of(key.split(":")[0], points) for key, points in found.items()}


def amplitude_energy(cause: str, power: Array) -> float:
    """d² of a cause at unit amplitude from that of its columns, shape (k,): of all draws, or of any one column."""
    return float(power.sum() if CATALOGUE[cause].kind == "random" else power.mean())


def limit_of(cause: str, points: list[tuple[Candidate, float]]) -> Limit:
    """Limit from the energies of unit amplitudes over the grid of a cause."""
    d, unit = searched(cause).needed_d, CATALOGUE[cause].unit
    parameter = shape_parameter(cause)
    if CATALOGUE[cause].kind == "input":
        assert parameter is not None
        seen = [abs(c.values[parameter.name]) for c, power in points if np.sqrt(power) >= d]
        at = tuple((c.values[parameter.name], float(np.sqrt(power))) for c, power in points)
        return Limit(min(seen) if seen else None, unit, at, parameter.name)
    limits = [d / np.sqrt(power) if power > 0.0 else np.inf for _, power in points]
    finite = [v for v in limits if np.isfinite(v)]
    value = float(np.exp(np.median(np.log(finite)))) if finite else None
    if parameter is None:
        return Limit(value, unit, (), None)
    at = tuple(
        (c.values[parameter.name], float(v))
        for (c, _), v in zip(points, limits, strict=True)
        if np.isfinite(v)
    )
    return Limit(value, unit, at, parameter.name)


def overlap(gains: Gains, cause: Refined, rivals: list[str]) -> dict[str, float]:
    """d from which a cause can be told from each rival: √(10/(1 − R²)), R² what the rival can mimic of it."""
    search = gains.search
    total = gains.whiten(_fitted(gains, cause))
    own = total - gains.map_q @ (gains.map_q.T @ total)
    energy = float(own @ own)
    out = {}
    for rival in rivals:
        best = 0.0
        for candidate, at in (*gains.plain, *gains.random):
            if candidate.id == rival:
                best = max(best, _explained(gains.plain_columns(at), own))
        for base in search.bank.inputs:
            if base.id == rival:
                best = max(best, 1.0 - gains.rest_after(base, total) / energy)
        out[rival] = float(np.sqrt(10.0 / max(1.0 - best, 1e-3)))
    return out


def _explained(columns: Array, target: Array) -> float:
    q, r = np.linalg.qr(columns)
    q = q[:, np.abs(np.diag(r)) > 1e-6 * np.abs(np.diag(r)).max()]
    return float(((q.T @ target) ** 2).sum() / (target @ target))


def _fitted(gains: Gains, cause: Refined) -> Array:
    """Map and cause as fitted, without noise, deg/h."""
    bank = gains.search.bank
    if cause.candidate.role == "input":
        return np.asarray(cause.columns @ np.linalg.lstsq(cause.columns, gains.search.y, rcond=1e-9)[0])
    rest = gains.search.y - cause.contribution
    return np.asarray(bank.map @ (bank.map.T @ rest) + cause.contribution)
