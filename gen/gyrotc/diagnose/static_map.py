"""The static map that diagnosis starts from, and the same map seen through other inputs.

The basis is fixed before any memory is looked for, from where the recordings are in (T, dT/dt). A candidate
that changes the map's input sees the same functions: equal flexibility for all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..causes import CATALOGUE, History
from ..common.arrays import FloatArray
from ..train.data import MIN_HALF_RANGE_C, MIN_HALF_RANGE_C_PER_MIN
from .blocks import Records, centred_slope
from .candidates import Candidate, diagnosable_causes, reach_of, searched

LEVELS: tuple[tuple[int, int, int], ...] = ((9, 5, 3), (13, 6, 3))
"""Gaussians over T alone, and over T × dT/dt, from coarse to fine: finer maps are named, not taken in silence."""

_KEEP = 3e-4  # singular values of the averaged basis below this share of the largest are dropped
FINE_C = 2.5  # spacing of the local functions that say whether the map is too coarse


@dataclass(frozen=True)
class MapBasis:
    """Functions of (T, dT/dt), orthonormal over the recordings.

    Attributes:
        middle_c: Of the range of T, C.
        half: Half ranges of T and of dT/dt about 0, C and C/min.
        along: Centers over T, normalised, shape (a,), and their common width.
        across: Centers over (T, dT/dt), shape (b, 2), and their widths.
        mix: From raw functions to the basis, shape (3 + a + b, m).
        lead_s: What the functions get in place of T is T + lead dT/dt: a sensor that lags by so much makes that of a
            function of the true temperature.
    """

    middle_c: float
    half: tuple[float, float]
    along: FloatArray
    along_width: float
    across: FloatArray
    across_width: tuple[float, float]
    mix: FloatArray
    lead_s: float = 0.0

    def raw(self, temperature_c: FloatArray, slope_c_per_min: FloatArray) -> FloatArray:
        """Constant, linear and Gaussian functions, shape (n, 3 + a + b)."""
        t, r, along = self._alone(temperature_c, slope_c_per_min)
        across = np.exp(
            -(((t[:, None] - self.across[:, 0]) / self.across_width[0]) ** 2)
            - ((r[:, None] - self.across[:, 1]) / self.across_width[1]) ** 2
        )
        return np.column_stack([np.ones_like(t), t, r, along, across])

    def proportional(self, temperature_c: FloatArray, slope_c_per_min: FloatArray) -> FloatArray:
        """Functions of which dT/dt is a factor at most once, shape (n, 5 + a): no more of the rate than that."""
        t, r, along = self._alone(temperature_c, slope_c_per_min)
        return np.column_stack([np.ones_like(t), t, r, t * r, t * t * r, along])

    def _alone(self, temperature_c: FloatArray, slope_c_per_min: FloatArray) -> tuple[FloatArray, ...]:
        """Normalised T and dT/dt, and the Gaussians over T alone."""
        t = np.asarray((temperature_c - self.middle_c) / self.half[0])
        r = np.asarray(slope_c_per_min / self.half[1])
        return t, r, np.asarray(np.exp(-(((t[:, None] - self.along) / self.along_width) ** 2)))

    def __call__(self, temperature_c: FloatArray, slope_c_per_min: FloatArray) -> FloatArray:
        """The basis at rows, shape (n, m)."""
        return np.asarray(self.raw(temperature_c, slope_c_per_min) @ self.mix)


_LEAD_SPAN_S = 60.0  # window of the dT/dt that a lead is taken with: a lag of a minute bends within it


def _led(history: History, lead_s: float) -> History:
    """The history of the temperature that a sensor shows which lags by so much."""
    if not lead_s:
        return history
    slope = centred_slope(history, _LEAD_SPAN_S)
    return replace(history, temperature_c=history.temperature_c + (lead_s / 60.0) * slope)


def make_basis(records: Records, level: int, lead_s: float = 0.0) -> tuple[MapBasis, FloatArray]:
    """Basis of a level and its block means, shape (N, m) with orthonormal columns."""
    n_t, n_a, n_r = LEVELS[level]
    led = [_led(run.history, lead_s) for run in records.runs]
    slopes = [centred_slope(history) for history in led]
    t = records.average([history.temperature_c for history in led])
    r = records.average(slopes)
    grid_t, grid_a, grid_r = np.linspace(-1, 1, n_t), np.linspace(-1, 1, n_a), np.linspace(-1, 1, n_r)
    across = np.array([(a, b) for a in grid_a for b in grid_r])
    raw = MapBasis(
        middle_c=float(0.5 * (t.min() + t.max())),
        half=(max(0.5 * float(np.ptp(t)), MIN_HALF_RANGE_C), max(float(abs(r).max()), MIN_HALF_RANGE_C_PER_MIN)),
        along=grid_t,
        along_width=1.5 * 2.0 / (n_t - 1),
        across=across,
        across_width=(1.5 * 2.0 / (n_a - 1), 1.5 * 2.0 / (n_r - 1)),
        mix=np.eye(3 + n_t + len(across)),
        lead_s=lead_s,
    )
    mean = records.average([raw(history.temperature_c, s) for history, s in zip(led, slopes, strict=True)])
    left, size, right = np.linalg.svd(mean, full_matrices=False)
    keep = size > _KEEP * size[0]
    return replace(raw, mix=right[keep].T / size[keep]), left[:, keep]


def fits_exactly(records: Records, level: int = 0) -> bool:
    """Test whether the map of a level has a function for every block, so that nothing tells of noise or a cause.

    Args:
        level: Of `LEVELS`; 0 is the coarsest.
    """
    n_t, n_a, n_r = LEVELS[level]
    return records.size <= 3 + n_t + n_a * n_r and make_basis(records, level)[1].shape[1] >= records.size


def fine_columns(records: Records, spacing_c: float = FINE_C) -> FloatArray:
    """Local functions of T over the recorded range, as block means, shape (N, k); none that is zero."""
    low = min(float(r.history.temperature_c.min()) for r in records.runs)
    high = max(float(r.history.temperature_c.max()) for r in records.runs)
    nodes = np.arange(low, high + spacing_c, spacing_c)
    columns = records.columns(lambda h: np.maximum(0.0, 1.0 - np.abs(h.temperature_c[:, None] - nodes) / spacing_c))
    return columns[:, columns.max(axis=0) > 0.0]


def changed_inputs(records: Records, basis: MapBasis) -> tuple[list[Candidate], FloatArray, NDArray[np.bool_]]:
    """Map of the changed inputs for every candidate of kind "input"."""
    reach = reach_of(records)
    candidates, maps, knowns = [], [], []
    for cause in (i for i, term in diagnosable_causes().items() if term.kind == "input"):
        for values in searched(cause).grid(reach):
            candidates.append(Candidate(cause, dict(values), "input"))
            block, known = replaced_map(records, basis, candidates[-1])
            maps.append(block)
            knowns.append(known)
    return candidates, np.array(maps), np.array(knowns)


def replaced_map(records: Records, basis: MapBasis, candidate: Candidate) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Block means of the map of changed inputs, shape (N, m), and where these are known, shape (N,)."""
    seen = _moved_inputs(records, basis, candidate)
    maps = [records.average_run(k, basis(t, slope)) for k, (t, slope, _) in enumerate(seen)]
    return np.concatenate(maps), np.concatenate([known for _, _, known in seen])


def led_map(records: Records, basis: MapBasis, lead_s: float) -> FloatArray:
    """Block means of the map of T + lead dT/dt in place of T, shape (N, m)."""
    led = [_led(run.history, lead_s) for run in records.runs]
    return records.average([basis(history.temperature_c, centred_slope(history)) for history in led])


def proportional_map(records: Records, basis: MapBasis, candidate: Candidate | None) -> FloatArray:
    """Block means of `MapBasis.proportional` of changed inputs (None: of the plain ones), shape (N, k)."""
    if candidate is None:
        led = [_led(run.history, basis.lead_s) for run in records.runs]
        seen = [(history.temperature_c, centred_slope(history)) for history in led]
    else:
        seen = [(t, slope) for t, slope, _ in _moved_inputs(records, basis, candidate)]
    return records.average([basis.proportional(t, slope) for t, slope in seen])


def _moved_inputs(
    records: Records, basis: MapBasis, candidate: Candidate
) -> list[tuple[FloatArray, FloatArray, NDArray[np.bool_]]]:
    """Temperature and its rate as the map sees them, per run and row, and the blocks where they are known."""
    term = CATALOGUE[candidate.id]
    assert term.features is not None
    out = []
    for k, run in enumerate(records.runs):
        temperature, slope = term.features(run.history, candidate.values).T
        known = np.ones(records.kept[k].size, dtype=bool)
        if term.mended is not None:
            mended = term.mended(run.history.time_s, run.history.temperature_c, slope, candidate.values)[0]
            slope = centred_slope(replace(run.history, temperature_c=temperature))
            known = records.average_run(k, np.isnan(mended).astype(float)) == 0.0
        if basis.lead_s:
            moved = _led(replace(run.history, temperature_c=temperature), basis.lead_s)
            temperature, slope = moved.temperature_c, centred_slope(moved)
        out.append((temperature, slope, known))
    return out
