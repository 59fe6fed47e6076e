"""Lack of fit: is anything left, and are the causes what they seem?

Three tests under the likeliest colour and under the declared one. What the causes leave is held against the
whole dictionary, flat and weighted; and every cause must have one amplitude over all runs, temperatures and
directions: a foreign effect that happens to look like a cause in one run does not in the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincc, ndtr

from ...terms import CATALOGUE
from ..detect.joined import Held
from ..detect.project import project
from ..detect.scores import Projection, ratio_of
from ..detect.search import Search
from ..detect.views import View
from ..noise_colour.whitener import Whitener
from ..orthonormal import main_directions, orthonormal
from ..signatures.signature_bank import direction_of
from .refine import Refined

__all__ = ["misfit"]

Array = NDArray[np.float64]

_DIRECTION_C = (
    3.0  # width of the play whose side tells the direction: above thermometer noise, far below a cycle
)
_MAIN = 0.03  # share of the strongest direction of changes below which a direction says nothing
_OWN = 1e-3  # share of a column that must be left after the model is projected out


def misfit(current: Search, held: Held, causes: Sequence[Refined], gain: float) -> tuple[float, float]:
    """p-value of what is left, and the share of the structure that the causes explain.

    Args:
        current: The search with the causes taken.
        held: What the model holds: not the map where a cause replaces its input.
        causes: The causes that were taken.
        gain: What they explain, twice the log-likelihood.
    """
    views = [current.likeliest]
    if current.declared is not None:
        view = current.view_of(current.declared)
        views.append(replace(view, scale=max(view.scale, 1.0)))
    changed = _changed(current, causes)
    p_value, left = 1.0, 0.0
    for view in views:
        found = [*_dictionary(project(current, view, held)), _changes(current, view, held, changed)]
        p_value = min([p_value, *(p for p, _ in found)])
        left = max([left, *(e for _, e in found)])
    return min(1.0, 3.0 * len(views) * p_value), gain / max(gain + left, 1e-300)


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


def _changed(current: Search, causes: Sequence[Refined]) -> Array:
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


def _changes(current: Search, view: View, held: Held, changed: Array) -> tuple[float, float]:
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
