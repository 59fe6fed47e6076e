"""The static map seen through other inputs: of causes that act on the temperature that the map gets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..causes import CATALOGUE
from ..common.arrays import FloatArray
from .blocks import Records, centred_slope
from .candidates import Candidate, diagnosed, reach_of, searched
from .static_map import MapBasis

__all__ = ["changed_inputs", "proportional_map", "replaced_map"]


_WHOLE = 0.999  # share of a block's rows that must know their input: all, up to the rounding of the mean


def changed_inputs(
    records: Records, basis: MapBasis
) -> tuple[list[Candidate], FloatArray, NDArray[np.bool_]]:
    """Map of the changed inputs for every candidate of kind "input"."""
    reach = reach_of(records)
    candidates, maps, knowns = [], [], []
    for cause in (i for i, term in diagnosed().items() if term.kind == "input"):
        for values in searched(cause).grid(reach):
            candidates.append(Candidate(cause, dict(values), "input"))
            block, known = replaced_map(records, basis, candidates[-1])
            maps.append(block)
            knowns.append(known)
    return candidates, np.array(maps), np.array(knowns)


def replaced_map(
    records: Records, basis: MapBasis, candidate: Candidate
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Block means of the map of changed inputs, shape (N, m), and where these are known, shape (N,)."""
    seen = _moved_inputs(records, candidate)
    maps = [records.average_run(k, basis(t, slope)) for k, (t, slope, _) in enumerate(seen)]
    return np.concatenate(maps), np.concatenate([known for _, _, known in seen])


def proportional_map(records: Records, basis: MapBasis, candidate: Candidate | None) -> FloatArray:
    """Block means of `MapBasis.proportional` of changed inputs (None: of the plain ones), shape (N, k)."""
    if candidate is None:
        seen = [(run.history.temperature_c, centred_slope(run.history)) for run in records.runs]
    else:
        seen = [(t, slope) for t, slope, _ in _moved_inputs(records, candidate)]
    return records.average([basis.proportional(t, slope) for t, slope in seen])


def _moved_inputs(
    records: Records, candidate: Candidate
) -> list[tuple[FloatArray, FloatArray, NDArray[np.bool_]]]:
    """Temperature and its rate as the map sees them, per run and row, and the blocks where they are known."""
    features = CATALOGUE[candidate.id].features
    assert features is not None
    out = []
    for k, run in enumerate(records.runs):
        seen = features(run.history, candidate.values)
        temperature, slope = seen.columns[:, 0], seen.columns[:, 1]
        known = np.ones(records.kept[k].size, dtype=bool)
        if CATALOGUE[candidate.id].unseen_s is not None:
            slope = centred_slope(replace(run.history, temperature_c=temperature))
            known = records.average_run(k, seen.known.astype(float)) > _WHOLE
        out.append((temperature, slope, known))
    return out
