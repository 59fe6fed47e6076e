"""Lasting steps of a rate: change points that neither temperature, nor its rate, nor a drift explains.

At every place of a run a step is fitted in a window around it beside a constant, a drift, the temperature and its rate,
for windows of several lengths. What such a fit makes of noise is read off the run itself, robustly, over all places,
whatever the colour of its noise; a step is reported where the fit is so far beyond it that chance makes one in 200
records, over all places and lengths of all runs together (Bonferroni). See Basseville and Nikiforov, Detection of
Abrupt Changes, 1993, 2.2. A narrow feature of the static map that is passed quickly looks the same within one run: a
step that the other passages over the same temperatures show as well is none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.special import stdtrit

from ..common.arrays import FloatArray
from ..common.statistics import NORMAL_95, cell_means, noise_of

__all__ = ["Rows", "Step", "curve_elsewhere", "steps_of"]

Rows = tuple[FloatArray, FloatArray, FloatArray]
"""Time in s, temperature in C, rate in deg/h of a run, shape (n,) each."""

_BINS = 48  # over the temperatures of a window, which has 24 to 40 cells: a quick passage is as sharp as in its cells
_WHOLE = 0.75  # of these temperatures, what a passage has to cover for its level to be that of the others
_LEAST_C = 0.3  # what a chamber's ripple moves is no passage


def curve_elsewhere(
    runs: Sequence[Rows], run: int, window_s: tuple[float, float], temperature: FloatArray
) -> FloatArray | None:
    """Mean rate over temperature of all passages but a run's own window, less each one's mean, shape (n,).

    Args:
        runs: All runs; `run` is the number of the window's.
        window_s: From and to, on that run's clock.
        temperature: Where the curve is wanted, C, shape (n,): the temperatures of the window.

    Returns:
        None where the temperature stands still or nothing else passes there.
    """
    edges = np.linspace(float(temperature.min()), float(temperature.max()), _BINS + 1)
    if edges[-1] - edges[0] < _LEAST_C:
        return None
    curves = []
    for k, (time, x, y) in enumerate(runs):
        counts = (x >= edges[0]) & (x <= edges[-1])
        if k == run:
            counts &= (time < window_s[0]) | (time > window_s[1])
        curves += list(_curves(x, y, counts, edges))
    if not curves:
        return None
    return np.interp(temperature, 0.5 * (edges[1:] + edges[:-1]), np.mean(curves, axis=0))


def _curves(
    x: FloatArray, y: FloatArray, counts: NDArray[np.bool_], edges: FloatArray
) -> Iterator[FloatArray]:
    """Of every stretch of rows that count and cover most of the bins: mean rate of each, less the mean of all."""
    at = np.flatnonzero(counts)
    middle = 0.5 * (edges[1:] + edges[:-1])
    for part in np.split(at, np.flatnonzero(np.diff(at) > 1) + 1):
        if len(part) < 2 or np.ptp(x[part]) < _WHOLE * (edges[-1] - edges[0]):
            continue
        number = np.minimum(np.searchsorted(edges, x[part], side="right") - 1, _BINS - 1)
        count = np.bincount(number, minlength=_BINS)
        mean = np.bincount(number, y[part], minlength=_BINS)[count > 0] / count[count > 0]
        curve = np.interp(middle, middle[count > 0], mean)
        yield curve - curve.mean()


FALSE_ALARMS = 0.005  # records of which one has a step by chance: with drifts one in a hundred has an event
_HALVES_S = (120.0, 600.0, 3000.0)  # half windows: short ones place a large step, long ones find a small one
_CELLS = 20  # of a half window
_LEAST_CELLS = 8  # of a half window, where rows are long: eight columns are fitted to twice as many cells
_LEAST_WINDOWS = 4.0  # a run shorter than this many windows does not show what noise makes
_KNOWN = 6.0  # degrees of freedom of a scale from a median, for each window that a run is long
_STILL_THERE = 0.8  # of the limit, what is to be left beside other passages: their own noise costs some
_NOT_OF_MAP = 0.6  # of the step: their noise costs a true one a tenth, the map's own leaves a third at most
_OWN = 0.02  # of a column's size, what it has to have on its own to count: what is left of less is rounding
_LEAST_ENERGY = 1e-3  # of a step's own, below which what stands beside it holds it
_EDGE = 3  # cells on either side of a place that its time may lie in
_PLACED_95 = 7.35  # of a likelihood ratio of places: Hansen, Econometrica 68 (2000) 575, table 1


@dataclass(frozen=True, slots=True)
class Step:
    """A step of the rate.

    Attributes:
        run: Number of its run.
        time_s: First row behind it, and the times between which it lies, s (95 %).
        size_dph: Size and its 95 % limits, deg/h.
        sigmas: Size over what the fit makes of noise.
        over_gap: Whether there are no rows where it happened.
    """

    run: int
    time_s: tuple[float, float, float]
    size_dph: tuple[float, float, float]
    sigmas: float
    over_gap: bool = False


def steps_of(runs: Sequence[Rows]) -> list[Step]:
    """Steps of all runs, by run in order of time.

    Args:
        runs: Time in s, temperature in C, rate in deg/h of the rows that count, finite, shape (n,) each.
    """
    tried = [_Windows.of(k, *rows, half) for k, rows in enumerate(runs) for half in _HALVES_S]
    windows = [w for w in tried if w is not None]
    lengths = len({w.half_s for w in windows})
    found: dict[int, list[tuple[Step, float]]] = {}
    for half in _HALVES_S:
        alike = [w for w in windows if w.half_s == half]
        if not alike:
            continue
        noise = noise_of(np.concatenate([w.z for w in alike]))
        looks = lengths * sum(len(w.z) for w in alike)
        limit = -float(stdtrit(_KNOWN * sum(w.windows for w in alike), FALSE_ALARMS / 2.0 / looks))
        for w in alike:
            steps = w.beyond(limit, noise, runs)
            found.setdefault(w.run, []).extend((step, half) for step in steps)
    return [step for run in sorted(found) for step in _largest(found[run])]


def _largest(steps: list[tuple[Step, float]]) -> list[Step]:
    """Of steps found by several lengths at about one place, the clearest."""
    kept: list[tuple[Step, float]] = []
    for step, half in sorted(steps, key=lambda s: -s[0].sigmas):
        if all(abs(step.time_s[0] - k.time_s[0]) > min(half, h) for k, h in kept):
            kept.append((step, half))
    return sorted((s for s, _ in kept), key=lambda s: s.time_s[0])


@dataclass(frozen=True, slots=True)
class _Windows:
    """Fits of a step at every place of a run, in windows of one length.

    Attributes:
        run: Number of the run.
        half_s: Half of a window, s.
        cells: Time (s), temperature and rate of the cells; `cell_s`: their length; `width`: cells in half a window.
        size, spread: Of the steps, and the error that white noise of size 1 makes of them, shape (n,).
        z: Sizes over spreads, less their median. Every one is a look of its own: so high up, neighbours that share all
            but one cell are beyond a limit one by one (of white noise 23 of 24 and 42 of 40 places in a window were).
        windows: How many the run is long.
    """

    run: int
    half_s: float
    cells: tuple[FloatArray, FloatArray, FloatArray]
    cell_s: float
    width: int
    size: FloatArray
    spread: FloatArray
    z: FloatArray
    windows: float

    @property
    def t(self) -> FloatArray:
        """Times of the cells, s."""
        return self.cells[0]

    @staticmethod
    def of(
        run: int, time: FloatArray, temperature: FloatArray, rate: FloatArray, half_s: float
    ) -> _Windows | None:
        """None where the run is too short to show what noise makes of such windows."""
        if len(time) <= 4 * _CELLS:
            return None
        windows = float(time[-1] - time[0]) / (2.0 * half_s)
        cell = max(float(np.median(np.diff(time))), half_s / _CELLS)
        t, x, y = cell_means(cell, time, temperature, rate)
        width = max(round(half_s / cell), _LEAST_CELLS)
        if min(windows, len(t) / (2 * width)) < _LEAST_WINDOWS:
            return None
        size, spread = _fitted(t, x, y, width)
        z = size / spread - float(np.median(size / spread))
        return _Windows(run, half_s, (t, x, y), cell, width, size, spread, z, windows)

    def beyond(self, limit: float, noise: float, runs: Sequence[Rows]) -> Iterator[Step]:
        """Steps of more than `limit` times what noise makes, of all such runs or of this one, the clearest first."""
        scale = max(noise, noise_of(self.z))
        if scale == 0.0:
            return
        far = np.abs(self.z) / scale
        gaps, over_gap = self._gaps()
        open_ = (far > limit) & ~gaps
        while open_.any():
            k = int(np.argmax(np.where(open_, far, 0.0)))
            open_[max(k - self.width, 0) : k + self.width + 1] = False
            at = k + self.width  # the first cell behind the step
            least = max(_STILL_THERE * limit * scale, _NOT_OF_MAP * float(abs(self.z[k])))
            if self._beside_map(k, runs) < least:
                continue
            placed = self._behind_gap if over_gap[k] else self._placed
            yield placed(runs[self.run], at, scale, float(far[k]))

    def _beside_map(self, k: int, runs: Sequence[Rows]) -> float:
        """Magnitude of z at place k beside what the other passages over the window's temperatures show."""
        first, n = max(k - self.width, 0), 2 * self.width
        t, x, y = (v[first : k + 3 * self.width] for v in self.cells)
        own = slice(k - first, k - first + n)
        elsewhere = curve_elsewhere(runs, self.run, (t[own][0], t[own][-1]), x[own])
        if elsewhere is None:
            return float(abs(self.z[k]))
        known = np.zeros(len(t))
        known[own] = elsewhere
        size, spread = _fitted(t, x, y, self.width, known)
        return float(abs(size[own.start] / spread[own.start]))

    def _gaps(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Windows that say nothing for a gap of the rows, and those with one gap in their middle, shape (n,).

        Over a gap that is longer than half a window a gyro may drift by more than such windows show.
        """
        steps = np.diff(self.t)
        gap = steps > 3.0 * self.cell_s
        count = sliding_window_view(gap, 2 * self.width - 1).sum(axis=1)
        middle = slice(self.width - 1, self.width - 1 + len(count))
        over = gap[middle] & (count == 1) & (steps[middle] < self.half_s)
        return (count > 0) & ~over, over

    def _between(self, at: int, scale: float) -> tuple[float, float, float]:
        """Size of the step between two cells and its limits."""
        k = at - self.width
        size, error = float(self.size[k]), NORMAL_95 * scale * float(self.spread[k])
        return size, size - error, size + error

    def _behind_gap(self, rows: Rows, at: int, scale: float, sigmas: float) -> Step:
        """The step between the last row before a gap and the first behind it."""
        time, edge = rows[0], 0.5 * float(self.t[at - 1] + self.t[at])
        behind = int(np.searchsorted(time, edge))
        between = float(time[behind]), float(time[behind - 1]), float(time[behind])
        return Step(self.run, between, self._between(at, scale), sigmas, True)

    def _placed(self, of_run: Rows, at: int, scale: float, sigmas: float) -> Step:
        """The step among the rows: where two levels leave least, and the times between which it lies."""
        time, _, rate = of_run
        fit = self._fit(at - self.width)
        edge = float(self.t[at] - 0.5 * self.cell_s)
        near = np.flatnonzero(np.abs(time - edge) <= min(_EDGE + 8, self.width) * self.cell_s)
        rows, n = rate[near] - fit.without_step(edge, time[near]), len(near)
        inside = np.flatnonzero(np.abs(time[near] - edge) <= _EDGE * self.cell_s)
        inside = inside[(inside > 0) & (inside < n)]
        if len(inside) == 0:
            around = (edge, edge - self.cell_s, edge + self.cell_s)
            return Step(self.run, around, self._between(at, scale), sigmas)
        total = np.concatenate([[0.0], np.cumsum(rows)])
        left = np.array(
            [rows @ rows - total[k] ** 2 / k - (total[n] - total[k]) ** 2 / (n - k) for k in inside]
        )
        best = int(np.argmin(left))
        noise = max(float(left[best]) / max(n - 2, 1), 1e-300)
        likely = inside[left <= left[best] + _PLACED_95 * noise]
        # One row more on either side: a row that is a mean may hold the step, and bear the time of its end or its start
        between = float(time[near[max(likely[0] - 2, 0)]]), float(time[near[min(likely[-1] + 1, n - 1)]])
        first = float(time[near[inside[best]]])
        size, spread = max((fit.step(s) for s in (edge, first)), key=lambda s: abs(s[0] / s[1]))
        error = NORMAL_95 * scale * spread
        return Step(self.run, (first, *between), (size, size - error, size + error), sigmas)

    def _fit(self, k: int) -> _Fit:
        """What stands beside a step in the window at place k."""
        lead = max(k - self.width, 0)
        t, x, y = (v[lead : k + 3 * self.width] for v in self.cells)
        own = slice(k - lead, k - lead + 2 * self.width)
        columns = [np.ones(2 * self.width), *(c[own.start] for c in _beside(t, x, self.width))]
        known = np.column_stack([c / max(float(np.linalg.norm(c)), 1e-300) for c in columns])
        q, size, _ = np.linalg.svd(known, full_matrices=False)
        return _Fit(t[own], y[own], self.cell_s, q[:, size > _OWN * size[0]])


@dataclass(frozen=True, slots=True)
class _Fit:
    """Cells of one window: times, rates, length; `q`: an orthonormal basis of what stands beside a step."""

    t: FloatArray
    y: FloatArray
    cell_s: float
    q: FloatArray

    def step(self, first_s: float) -> tuple[float, float]:
        """Size of a step from a time on, and the error that white noise of size 1 makes of it.

        Of the cell that the time lies in only a part is behind it.
        """
        rest = self._behind(first_s)
        rest -= self.q @ (self.q.T @ rest)
        energy = max(float(rest @ rest), _LEAST_ENERGY * len(self.t) * 0.25)
        return float(rest @ self.y) / energy, float(1.0 / np.sqrt(energy))

    def without_step(self, first_s: float, time_s: FloatArray) -> FloatArray:
        """What the fit says at some times less its step from a time on, deg/h."""
        left = self.y - self.step(first_s)[0] * self._behind(first_s)
        return np.asarray(np.interp(time_s, self.t, self.q @ (self.q.T @ left)))

    def _behind(self, first_s: float) -> FloatArray:
        return np.asarray(np.clip((self.t - first_s) / self.cell_s + 0.5, 0.0, 1.0))


def _fitted(
    t: FloatArray, x: FloatArray, y: FloatArray, width: int, known: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Step at the middle of every window and the error that white noise of size 1 makes of it, shape (places,).

    `known` is a further column beside the step, shape (cells,).
    """
    y_ = _centred(sliding_window_view(y, 2 * width))
    step = np.where(np.arange(2 * width) < width, -0.5, 0.5)
    rest_step, rest_y = np.broadcast_to(step, y_.shape).copy(), y_.copy()
    columns = _beside(t, x, width)
    columns += [] if known is None else [_centred(sliding_window_view(known, 2 * width))]
    for column in _orthogonal(columns):
        rest_step -= column * np.sum(column * rest_step, axis=1, keepdims=True)
        rest_y -= column * np.sum(column * rest_y, axis=1, keepdims=True)
    energy = np.maximum(np.sum(rest_step**2, axis=1), _LEAST_ENERGY * 2 * width * 0.25)
    return np.sum(rest_step * rest_y, axis=1) / energy, 1.0 / np.sqrt(energy)


def _beside(t: FloatArray, x: FloatArray, width: int) -> list[FloatArray]:
    """What is fitted beside a step in every window, less its mean: a drift, temperature, its rate, their products."""
    slope = np.gradient(x, t)
    smooth = np.convolve(np.pad(slope, width // 4, mode="edge"), np.ones(2 * (width // 4) + 1), "valid")
    tau, x_, r_ = (_centred(sliding_window_view(v, 2 * width)) for v in (t, x, smooth))
    scale = np.maximum(np.ptp(tau, axis=1, keepdims=True), 1e-12)
    return [tau / scale, x_, r_, _centred(x_**2), _centred(x_ * r_), _centred(r_**2)]


def _centred(columns: FloatArray) -> FloatArray:
    return np.asarray(columns - columns.mean(axis=1, keepdims=True))


def _orthogonal(columns: list[FloatArray]) -> list[FloatArray]:
    """The columns of every window, orthonormal one after the other; those that hardly vary on their own drop out."""
    done: list[FloatArray] = []
    for column in columns:
        size = np.linalg.norm(column, axis=1, keepdims=True)
        rest = column.copy()
        for known in done:
            rest -= known * np.sum(known * rest, axis=1, keepdims=True)
        left = np.linalg.norm(rest, axis=1, keepdims=True)
        own = left > np.maximum(_OWN * size, 1e-12)
        done.append(np.where(own, rest / np.where(own, left, 1.0), 0.0))
    return done
