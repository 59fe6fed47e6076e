"""Is there anything? Every candidate with its p-value, its own and adjusted for the whole search."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from ..common.arrays import FloatArray
from ..common.quantiles import CHI2_95_TWO
from .candidates import Candidate
from .joined import Held
from .project import project
from .scores import Projection, ScoredColumns, draw_null, score
from .search import Search
from .views import View, residual_log_likelihood

__all__ = ["Found", "detect"]


_SEED = 20140916  # any: it fixes the draws, so that a diagnosis repeats to the last digit
_PLACES = 9  # of an adjusted p-value: below every draw all are alike, and the sum's rounding is no order
_DEPENDENT = 1e-4  # eigenvalues of a group's inner products below this share of the largest add no parameter


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
    projections = [project(search, search.views[k], held) for k in search.allowed]
    own = np.array([score(p, columns, p.a).joined() for p in projections])
    fits = [
        _refitted(p, columns, search.views[k], search.y.size)
        for k, p in zip(search.allowed, projections, strict=True)
    ]
    behind = np.max(fits, axis=0) - np.array(fits)
    weight = np.exp(-behind)
    weight /= weight.sum(axis=0)
    null = np.sort(draw_null(projections[search.allowed.index(search.best)], columns, _SEED))
    tail = (null.size - np.searchsorted(null, own) + 1.0) / (null.size + 1.0)
    adjusted = (weight * tail).sum(axis=0)
    log_p = -logsumexp(np.log(weight + 1e-300) - own, axis=0)
    if search.cautious:
        inside = 2.0 * behind <= CHI2_95_TWO
        adjusted = np.where(inside, tail, 0.0).max(axis=0)
        log_p = np.where(inside, own, np.inf).min(axis=0)
    order = np.lexsort((-log_p, np.round(adjusted, _PLACES)))
    return [Found(search.joined.owners[i], float(log_p[i]), float(adjusted[i])) for i in order]


def _refitted(projection: Projection, columns: ScoredColumns, view: View, size: int) -> FloatArray:
    """Residual log-likelihood of a colour with map and candidate projected out, for every candidate."""
    gram, a = projection.gram, projection.a * view.scale
    alive, diagonal = projection.alive, np.diag(projection.gram)
    index = columns.single
    safe = np.where(alive[index], diagonal[index], 1.0)
    energy = np.where(alive[index], a[index] ** 2 / safe, 0.0)
    freedom = size - projection.rank
    parts = [
        residual_log_likelihood(projection.rest - energy, freedom - 1, projection.log_det + np.log(safe))
    ]
    for group in (*columns.pairs, *columns.variance):
        values, vectors = np.linalg.eigh(gram[np.ix_(group, group)])
        keep = values > _DEPENDENT * values[-1]
        c = vectors[:, keep].T @ a[group]
        left = projection.rest - float((c**2 / values[keep]).sum())
        log_det = projection.log_det + float(np.log(values[keep]).sum())
        parts.append(np.array([residual_log_likelihood(left, freedom - int(keep.sum()), log_det)]))
    parts.append(np.array([view.log_likelihood]))
    return np.concatenate(parts)
