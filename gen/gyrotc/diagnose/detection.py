"""Detection: is there anything of the catalogue under any noise colour that the data allow, and what could be hidden?

d is the matched-filter signal-to-noise ratio of a cause after the static map is taken out; the search finds
`causes.base.SearchRule.needed_d` (6.3 for most causes) in 95 % of cases at a familywise level of 1 %.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from ..causes import CATALOGUE
from ..common.arrays import FloatArray
from ..common.statistics import CHI2_95_TWO, TOLERANCE
from .candidates import Candidate, searched, shape_parameter
from .joined import Held
from .scores import Projection, ScoredColumns, p_values, score
from .search import Search, View, residual_log_likelihood
from .tolerances import INDEPENDENT


def project(search: Search, view: View, held: Held) -> Projection:
    """Everything after the columns of a model are projected out, under the colour of a view.

    Where the map itself is not among them (its input is replaced), candidates get back what the map had taken of
    them, and other inputs are no candidates any more.
    """
    out, full, b = search.joined.layout.held(held), view.gram, view.b
    if held == "beside":
        mix = _without_map(search)
        full, b = mix.T @ full @ mix, mix.T @ b
    size, vectors = np.linalg.eigh(full[np.ix_(out, out)])
    keep = size > TOLERANCE * size[-1]
    half = vectors[:, keep] / np.sqrt(size[keep])
    cross = half.T @ full[out]
    taken = half.T @ b[out]
    common = np.zeros((len(full), search.bank.common.shape[1]))
    common[search.joined.layout.signatures] = search.bank.common
    return Projection(
        a=(b - cross.T @ taken) / view.scale,
        gram=full - cross.T @ cross,
        before=np.maximum(np.diag(full), 1e-12),
        common=common,
        rest=view.yy - float(taken @ taken),
        log_det=view.log_det + float(np.log(size[keep]).sum()),
        rank=int(keep.sum()),
    )


def _without_map(search: Search) -> FloatArray:
    """Return the matrix from the joined columns to those of a model without the map, shape (P, P)."""
    joined = search.joined
    layout = joined.layout
    mix = np.eye(layout.total)
    mix[layout.static, layout.signatures] = search.bank.on_map
    mix[layout.static, layout.channels] = joined.on_map[:, : joined.channels.shape[1]]
    mix[layout.inputs, layout.inputs] = 0.0
    return mix


_SEED = 20140916  # any: it fixes the draws, so that a diagnosis repeats to the last digit
_PLACES = 9  # of an adjusted p-value: below every draw all are alike, and the sum's rounding is no order


@dataclass(frozen=True)
class Found:
    """A candidate with its p-values: of its own, and adjusted for the whole search (worst colour)."""

    candidate: Candidate
    log_p: float
    p_value: float


def detect(search: Search, held: Held) -> list[Found]:
    """Candidates beside a model, by adjusted p-value, best first.

    The p-value of a candidate is the mean over the colours that the data allow, each weighted by its likelihood
    with map and candidate projected out; where the data contradict the declared noise, the largest over the colours
    within the 95 % set. The null distribution is that of the likeliest colour: between colours its 1 % point moves
    by less than 0.2 in ln p.
    """
    columns = search.joined.columns
    views = [search.views[k] for k in search.allowed]
    projections = [project(search, view, held) for view in views]
    own = np.array([score(p, columns, p.a).joined() for p in projections])
    fits = np.array([_refitted(p, columns, v, search.y.size) for p, v in zip(projections, views, strict=True)])
    exhausted = np.isnan(fits).any(axis=0)
    fits[:, exhausted] = 0.0
    behind = fits.max(axis=0) - fits
    weight = np.exp(-behind)
    weight /= weight.sum(axis=0)
    tail = p_values(own, projections[search.allowed.index(search.best)], columns, _SEED)
    adjusted = (weight * tail).sum(axis=0)
    log_p = -logsumexp(np.log(weight + 1e-300) - own, axis=0)
    if search.cautious:
        inside = 2.0 * behind <= CHI2_95_TWO
        adjusted = np.where(inside, tail, 0.0).max(axis=0)
        log_p = np.where(inside, own, np.inf).min(axis=0)
    adjusted[exhausted], log_p[exhausted] = 1.0, 0.0
    order = np.lexsort((-log_p, np.round(adjusted, _PLACES)))
    return [Found(search.joined.owners[i], float(log_p[i]), float(adjusted[i])) for i in order]


def _refitted(projection: Projection, columns: ScoredColumns, view: View, size: int) -> FloatArray:
    """Residual log-likelihood of a colour with map and candidate projected out, for every candidate.

    nan: map and candidate have as many columns as there are data, which then say nothing about it.
    """
    gram, a = projection.gram, projection.a * view.scale
    alive, diagonal = projection.alive, np.diag(projection.gram)
    index = columns.single
    safe = np.where(alive[index], diagonal[index], 1.0)
    energy = np.where(alive[index], a[index] ** 2 / safe, 0.0)
    freedom = size - projection.rank
    parts = [
        residual_log_likelihood(projection.rest - energy, freedom - 1, projection.log_det + np.log(safe))
        if freedom > 1
        else np.full(len(safe), np.nan)
    ]
    for group in (*columns.pairs, *columns.variance):
        values, vectors = np.linalg.eigh(gram[np.ix_(group, group)])
        keep = values > INDEPENDENT * values[-1]  # the others add no parameter
        c = vectors[:, keep].T @ a[group]
        left = projection.rest - float((c**2 / values[keep]).sum())
        log_det = projection.log_det + float(np.log(values[keep]).sum())
        remaining = freedom - int(keep.sum())
        likelihood = residual_log_likelihood(left, remaining, log_det) if remaining > 0 else np.nan
        parts.append(np.array([likelihood]))
    parts.append(np.array([view.log_likelihood]))
    return np.concatenate(parts)


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
        found.setdefault(key, []).append((candidate, float(energy) * norm**2 if np.isfinite(norm) else 0.0))
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
    at = tuple((c.values[parameter.name], float(v)) for (c, _), v in zip(points, limits, strict=True) if np.isfinite(v))
    return CauseLimit(value, unit, at, parameter.name)
