"""Lack of fit: is anything left, and are the causes what they seem?

Three tests: what the causes leave is held against the whole dictionary, flat and weighted; and every cause must
have one amplitude over all runs, temperatures and directions: a foreign effect that happens to look like a cause in
one run does not in the next. Each under every colour of the noise that the data allow, and on their average by
likelihood, for a colour that is a little too fast makes structure of the noise; and under the declared noise, unless
the data contradict it: what is left of a wrong declaration is no structure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaincc, ndtr

from ..causes import CATALOGUE
from ..common.arrays import FloatArray
from ..common.orthonormal import main_directions, orthonormal
from .joined import Held
from .project import project
from .refine import Refined
from .scores import Projection, ratio_of
from .search import Search
from .signature_bank import direction_of
from .views import View
from .whitener import Whitener

__all__ = ["Misfit", "explained", "misfit"]


_DIRECTION_C = (
    3.0  # width of the play whose side tells the direction: above thermometer noise, far below a cycle
)
_MAIN = 0.03  # share of the strongest direction of changes below which a direction says nothing
_TESTS = 3  # of which the smallest p-value counts
_OWN = 1e-3  # share of a column that must be left after the model is projected out


@dataclass(frozen=True, slots=True)
class Misfit:
    """What causes leave.

    Attributes:
        p_value: p-value of what is left, under the noise that the data allow and that which is declared, unless the
            data contradict it.
        worst: The same with the declared noise in any case.
        share: Share of the structure that the causes explain, under the noise of `p_value`.
    """

    p_value: float
    worst: float
    share: float


def misfit(current: Search, held: Held, causes: Sequence[Refined], chance: int = 0) -> Misfit:
    """Whether anything is left.

    Args:
        current: The search with the causes taken.
        held: What the model holds: not the map where a cause replaces its input.
        causes: The causes that were taken.
        chance: Energy that the model explains of noise alone, where it has many columns beside the causes' own.
    """
    changed = _changed(current, causes)
    views = [current.views[k] for k in current.allowed]
    weight = np.exp([view.log_likelihood - current.likeliest.log_likelihood for view in views])
    p_value, share = _told(current, views, weight / weight.sum(), held, changed, chance)
    if current.declared is None:
        return Misfit(p_value, p_value, share)
    view = current.view_of(current.declared)
    declared = replace(view, scale=max(view.scale, 1.0))
    own_p, own_share = _told(current, [declared], np.ones(1), held, changed, chance)
    worst = min(1.0, 2.0 * min(p_value, own_p))
    if current.contradicts(view):
        return Misfit(p_value, worst, share)
    return Misfit(worst, worst, min(share, own_share))


def _told(
    current: Search, views: Sequence[View], weight: FloatArray, held: Held, changed: FloatArray, chance: int
) -> tuple[float, float]:
    """The same where the noise has one of some colours, each as likely as its weight says."""
    tests = np.array([_tests(current, view, held, changed) for view in views])
    p_values, left = np.einsum("v,vtk->kt", weight, tests)
    gain = max(float(weight @ [explained(current, view, held) for view in views]) - chance, 0.0)
    return min(1.0, _TESTS * float(p_values.min())), gain / max(gain + max(float(left.max()), 0.0), 1e-300)


def _tests(current: Search, view: View, held: Held, changed: FloatArray) -> list[tuple[float, float]]:
    """p-value and energy left of every test under one colour."""
    return [*_dictionary(project(current, view, held)), _changes(current, view, held, changed)]


def explained(current: Search, view: View, held: Held) -> float:
    """Energy that the causes of a search explain beyond the map under one colour, over the noise."""
    before = project(current, view, "map")
    after = project(current, view, held)
    return max((before.rest - after.rest) / view.scale**2, 0.0)


def _dictionary(projection: Projection) -> list[tuple[float, float]]:
    """p-value and energy left in the dictionary.

    Flat: the energy in all directions. Weighted: one variance common to all signatures, which weighs
    directions by how many signatures share them.
    """
    directions, size = projection.structure
    energy = (projection.a @ directions) ** 2
    total = float(energy.sum())
    ratio, variance = ratio_of(energy, size)
    held = float(variance) * size / (1.0 + float(variance) * size)
    return [
        (float(gammaincc(0.5 * size.size, 0.5 * total)), total - size.size),
        (float(ndtr(-np.sqrt(float(ratio)))), float(((energy - 1.0) * held).sum())),
    ]


def _changed(current: Search, causes: Sequence[Refined]) -> FloatArray:
    """Every cause with an amplitude that differs by run, temperature and direction, shape (N, k)."""
    records = current.records
    t = records.columns(lambda h: h.temperature_c[:, None])[:, 0]
    direction = direction_of(records, _DIRECTION_C)[:, 0] / _DIRECTION_C
    t = (t - t.mean()) / max(float(np.ptp(t)), 1e-9)
    columns = []
    for cause in causes:
        term = CATALOGUE[cause.candidate.id]
        if term.family == "between_runs" or term.kind == "static":  # nothing of them changes within a run
            continue
        shape = cause.contribution
        columns += [shape * t, shape * direction]
        for span in records.spans():
            part = np.zeros_like(shape)
            part[span] = shape[span]
            columns.append(part)
    return np.column_stack(columns) if columns else np.zeros((records.size, 0))


def _changes(current: Search, view: View, held: Held, changed: FloatArray) -> tuple[float, float]:
    """p-value and energy of what changing amplitudes would explain."""
    if changed.shape[1] == 0:
        return 1.0, 0.0
    whiten = Whitener(view.colour, current.records.kept, current.records.block_s, current.sigma)
    model = current.joined.beside
    if held != "beside":
        model = np.column_stack([current.bank.map, model])
    q = orthonormal(whiten(model))
    white = whiten(np.column_stack([changed, current.y]))
    norm = np.linalg.norm(white[:, :-1], axis=0)
    rest = white - q @ (q.T @ white)
    use = np.linalg.norm(rest[:, :-1], axis=0) > _OWN * norm
    left = main_directions(rest[:, :-1][:, use] / norm[use], _MAIN)
    if left.shape[1] == 0:
        return 1.0, 0.0
    energy = float(((left.T @ rest[:, -1]) ** 2).sum()) / view.scale**2
    return float(gammaincc(0.5 * left.shape[1], 0.5 * energy)), energy - left.shape[1]
