"""Rates of all runs as one regression with coloured noise: what a change is judged against.

A rate is a smooth function of temperature and its rate that all runs share, a level, a trend and a warm-up of each
run, and noise: white, with a level and a slope that walk (a local linear trend; Harvey, Forecasting, Structural Time
Series Models and the Kalman Filter, 1989, 2.3). Its steady Kalman filter is the recursive filter by which rates and
columns become white; least squares of what it leaves is generalised least squares. The two walks are those of the
largest likelihood.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from ..common.arrays import FloatArray
from ..common.metrics import median_step
from ..common.statistics import TOLERANCE, cell_means, orthonormal, running_mean
from ..mirror.recursions import first_order, play

RowArrays = tuple[FloatArray, FloatArray, FloatArray]
"""Time in s, temperature in C, rate in deg/h of a run, shape (n,) each."""

_KNOTS_C = (5.0, 2.5, 1.25)  # between knots of the map: finer ones only where the recordings say so
_LEAST_SPAN_C = 1.0  # the temperature moves less: a level and a trend say all of it
_SLOPE_S = 300.0  # over which dT/dt is taken: a resolution of 0.1 C makes 0.01 C/min of it
_WARM_UP_S = (300.0, 1000.0, 3000.0)  # time constants of a level that settles after power-on
_GAP_CELLS = 3.0  # without rows: the next cell comes behind a gap
_LEVELS = 10.0 ** np.arange(-7.0, 0.5)  # variance of the level's walk over the white one, in a coarse cell
_SLOPES = 10.0 ** np.arange(-13.0, -2.0, 1.5)  # of the slope's walk; at the lowest it moves nothing in a day
_START = (4, 2)  # where the search over both begins
_LEAST_SLOPE = 1e-14  # below it the equation of the filter has no solution in float64


@dataclass(frozen=True, slots=True)
class RunCells:
    """Means of one run.

    Attributes:
        time_s, temperature_c, rate_dph: Shape (n,) each; the time is the mean of the rows' times.
        cell_s: Length of a cell.
        behind_gap: First cells behind a gap, and how long the gaps are, s.
    """

    time_s: FloatArray
    temperature_c: FloatArray
    rate_dph: FloatArray
    cell_s: float
    behind_gap: tuple[tuple[int, float], ...]

    def __len__(self) -> int:
        return len(self.time_s)


def run_cells(rows: RowArrays, cell_s: float) -> RunCells:
    """Means over cells of at least one row."""
    length = max(median_step(rows[0]), cell_s)
    t, x, y = cell_means(length, *rows)
    return cells_of_means(t, x, y, length)


def cells_of_means(t: FloatArray, x: FloatArray, y: FloatArray, length: float) -> RunCells:
    """Return the cells with these means of time (s), temperature (C) and rate (deg/h), and the gaps between them."""
    steps = np.diff(t)
    gaps = np.flatnonzero(steps > _GAP_CELLS * length)
    return RunCells(t, x, y, length, tuple((int(k) + 1, float(steps[k])) for k in gaps))


@dataclass(frozen=True, slots=True)
class WalkNoise:
    """White noise of variance 1 with walks of a level and its slope: variances of their steps from cell to cell.

    Attributes:
        level, slope: Variances of the steps.
        cell_s: Length of the cells.
    """

    level: float
    slope: float
    cell_s: float

    def in_cells(self, cell_s: float) -> WalkNoise:
        """The same in cells of another length, over the variance that their white part has."""
        ratio = cell_s / self.cell_s
        return WalkNoise(self.level * ratio**2, self.slope * ratio**4, cell_s)

    def variance(self) -> float:
        """Of what the filter makes of it."""
        return _filter(self.level, self.slope)[2]

    def log_scale(self, cell_s: float) -> float:
        """Logarithm of the factor that makes noise of a run with cells of any length as large as of this one's."""
        return 0.5 * float(np.log(self.variance() / self.in_cells(cell_s).variance() * (cell_s / self.cell_s)))

    def white(self, columns: FloatArray, cell_s: float) -> FloatArray:
        """Columns of a run with cells of any length, filtered so that noise comes out white, as large in every run."""
        own = self.in_cells(cell_s)
        b, a, _ = _filter(own.level, own.slope)
        return np.asarray(_filtered(b, a, columns) * np.exp(self.log_scale(cell_s)))


@lru_cache(maxsize=256)
def _filter(level: float, slope: float) -> tuple[FloatArray, FloatArray, float]:
    moves = np.array([[1.0, 1.0], [0.0, 1.0]])
    p = solve_discrete_are(moves.T, np.array([[1.0], [0.0]]), np.diag([level, max(slope, _LEAST_SLOPE)]), np.eye(1))
    variance = float(p[0, 0]) + 1.0
    gain = moves @ p[:, 0] / variance
    return np.array([1.0, -2.0, 1.0]), np.array([1.0, gain[0] - 2.0, 1.0 - gain[0] + gain[1]]), variance


def _filtered(numerator: FloatArray, denominator: FloatArray, columns: FloatArray) -> FloatArray:
    from scipy.signal import lfilter  # 0.4 s: most recordings have nothing to be looked for with it

    return np.asarray(lfilter(numerator, denominator, columns, axis=0))


@dataclass(frozen=True, slots=True)
class SmoothFit:
    """Runs, made white and fitted.

    Attributes:
        cells: Of the runs.
        noise: Whose filter made them white.
        own: Orthonormal columns of each run, white: its level, trend and changes, shape (n, k).
        shared: Columns of the map beside them, orthonormal over all runs together, shape (n, p).
        rest: What of the white rates is left, shape (n,).
        sigma: Standard deviation of the white part of a cell, deg/h.
    """

    cells: tuple[RunCells, ...]
    noise: WalkNoise
    own: tuple[FloatArray, ...]
    shared: tuple[FloatArray, ...]
    rest: tuple[FloatArray, ...]
    sigma: float
    log_likelihood: float
    curve: tuple[FloatArray, ...]

    @staticmethod
    def of(
        cells: Sequence[RunCells], maps: Sequence[FloatArray], noise: WalkNoise, changes: Sequence[FloatArray | None]
    ) -> SmoothFit:
        """Fits all runs.

        Args:
            maps: Columns of the map at the cells of each run (`maps_of`).
            changes: Columns of what changes in each run, shape (n, k) each; None: nothing.
        """
        own, white, rates, whole = list[FloatArray](), list[FloatArray](), list[FloatArray](), list[FloatArray]()
        for one, of_map, change in zip(cells, maps, changes, strict=True):
            n = len(one)
            columns: list[FloatArray] = [np.ones(n), np.arange(n) / n]
            columns += [np.exp((one.time_s[0] - one.time_s) / tau) for tau in _WARM_UP_S]
            columns += [] if change is None else list(change.T)
            columns += [
                np.asarray(np.arange(n) >= k, dtype=np.float64) for k, gap in one.behind_gap if gap > LONGEST_GAP_S
            ]
            q = orthonormal(noise.white(np.column_stack(columns), one.cell_s))
            own.append(q)
            both = noise.white(np.column_stack([of_map, one.rate_dph - one.rate_dph.mean()]), one.cell_s)
            whole.append(np.sum(both[:, :-1] ** 2, axis=0))
            both -= q @ (q.T @ both)
            white.append(both[:, :-1])
            rates.append(both[:, -1])
        log_scale = sum(len(one) * noise.log_scale(one.cell_s) for one in cells)
        ends = np.cumsum([len(one) for one in cells])[:-1]
        stacked, y = np.concatenate(white), np.concatenate(rates)
        norm = np.sqrt(np.sum(whole, axis=0))  # what is left of a column that the own ones hold is rounding
        stacked[:, np.linalg.norm(stacked, axis=0) <= TOLERANCE * norm] = 0.0
        shared = orthonormal(stacked)
        amplitudes = shared.T @ y
        rest = y - shared @ amplitudes
        free = max(len(y) - shared.shape[1] - sum(q.shape[1] for q in own), 1)
        left = max(float(rest @ rest) / free, 1e-300)
        by_column = np.linalg.lstsq(shared.T @ stacked, amplitudes, rcond=None)[0] if shared.size else amplitudes
        return SmoothFit(
            tuple(cells),
            noise,
            tuple(own),
            tuple(np.split(shared, ends)),
            tuple(np.split(rest, ends)),
            float(np.sqrt(left / noise.variance())),
            -0.5 * len(y) * float(np.log(left)) + log_scale,
            tuple(of_map @ by_column if shared.size else np.zeros(len(of_map)) for of_map in maps),
        )

    def white(self, run: int, columns: FloatArray) -> FloatArray:
        """Columns of a run through its filter."""
        return self.noise.white(columns, self.cells[run].cell_s)

    def amplitudes(self, run: int, columns: FloatArray, beside: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Of each column the inner product with the rates and its energy, both beside all else that is fitted.

        Args:
            columns: Of the run, not yet white, shape (n, k).
            beside: Further columns of the run that are fitted with each, shape (n, j).
        """
        d, o = self.white(run, columns), self.white(run, beside)
        held_d, held_o = (np.concatenate([self.own[run].T @ v, self.shared[run].T @ v]) for v in (d, o))
        inner, raw = d.T @ self.rest[run], np.sum(d * d, axis=0)
        energy = raw - np.sum(held_d * held_d, axis=0)
        if o.shape[1]:
            of_both, of_beside = d.T @ o - held_d.T @ held_o, o.T @ o - held_o.T @ held_o
            solved = np.linalg.lstsq(of_beside, np.column_stack([of_both.T, o.T @ self.rest[run]]), rcond=None)[0]
            inner = inner - of_both @ solved[:, -1]
            energy = energy - np.sum(of_both.T * solved[:, :-1], axis=0)
        return inner, np.maximum(energy, LEAST_ENERGY * raw)


LONGEST_GAP_S = 3000.0  # beyond it a gyro may drift by more than its noise says
LEAST_ENERGY = 1e-3  # of a change's own, below which what is fitted beside it holds it


def maps_of(cells: Sequence[RunCells], knots_c: float) -> list[FloatArray]:
    """Columns of a map over temperature and its rate at the cells of each run, shape (n, p)."""
    from scipy.interpolate import BSpline  # as `_filtered`

    low = min(float(one.temperature_c.min()) for one in cells)
    high = max(float(one.temperature_c.max()) for one in cells)
    if high - low < _LEAST_SPAN_C:
        return [np.zeros((len(one), 0)) for one in cells]
    inner = np.linspace(low, high, max(int(np.ceil((high - low) / knots_c)), 1) + 1)
    knots = np.r_[[low] * 3, inner, [high] * 3]
    found = []
    for one in cells:
        x = np.clip(one.temperature_c, low, high)
        pieces = BSpline.design_matrix(x, knots, 3).toarray()[:, 1:]  # with the first they add up to a level
        slope = running_mean(np.gradient(one.temperature_c, one.time_s), max(round(_SLOPE_S / one.cell_s), 1))
        r, u = 60.0 * slope, (x - 0.5 * (low + high)) / (high - low)
        found.append(np.column_stack([pieces, r, r * u, r * u * u, r * np.abs(r), r * r]))
    return found


def knots_and_noise(cells: Sequence[RunCells]) -> tuple[float, WalkNoise]:
    """Return the distance of the map's knots, C, and the likeliest noise beside that map.

    The distance is that of Schwarz's criterion (BIC): a bend that all passages show is no change.
    """
    found: tuple[float, WalkNoise] | None = None
    least = np.inf
    for knots_c in _KNOTS_C:
        maps = maps_of(cells, knots_c)
        noise, likelihood = likeliest_noise(cells, maps, [None] * len(cells), found and found[1])
        n = sum(len(one) for one in cells)
        criterion = maps[0].shape[1] * float(np.log(n)) - 2.0 * likelihood
        if found and (criterion > least or 2 * maps[0].shape[1] > n):
            break
        found, least = (knots_c, noise), criterion
    assert found is not None
    return found


def likeliest_noise(
    cells: Sequence[RunCells],
    maps: Sequence[FloatArray],
    changes: Sequence[FloatArray | None],
    start: WalkNoise | None = None,
) -> tuple[WalkNoise, float]:
    """Return the walks of the largest likelihood beside changes that are known, and its logarithm.

    Args:
        changes: As for `SmoothFit.of`.
        start: Noise of this function at which the search begins; it ends at the same place from others.
    """
    known: dict[tuple[int, int], float] = {}
    cell_s = min(one.cell_s for one in cells)

    def noise_at(at: tuple[int, int]) -> WalkNoise:
        return WalkNoise(float(_LEVELS[at[0]]), float(_SLOPES[at[1]]), cell_s)

    def likelihood(at: tuple[int, int]) -> float:
        if at not in known:
            known[at] = SmoothFit.of(cells, maps, noise_at(at), changes).log_likelihood
        return known[at]

    best, last = _START, (-1, -1)
    if start is not None:
        best = int(np.searchsorted(_LEVELS, start.level)), int(np.searchsorted(_SLOPES, start.slope))
    while best != last:
        last = best
        around = [(last[0] + i, last[1] + j) for i in (0, -1, 1) for j in (0, -1, 1)]
        inside = [(i, j) for i, j in around if 0 <= i < len(_LEVELS) and 0 <= j < len(_SLOPES)]
        best = max(inside, key=likelihood)
    return noise_at(best), known[best]


_WIDTHS_C = (0.7, 1.5, 3.0, 6.0, 12.0, 24.0)  # of plays: octaves over what `causes.hysteresis` looks through
_LAGS_S = (200.0, 600.0, 1800.0, 5400.0)  # over what its lags look through, by factors of three
_RANK = 1e-3  # of the strongest direction: weaker ones are rounding, or a play that is never pushed


def evidence_beside_memories(
    means: tuple[FloatArray, FloatArray, FloatArray], used: NDArray[np.bool_], change: FloatArray, known: FloatArray
) -> float:
    """How much better a change explains a run than any memory, as a difference of Schwarz's criterion (BIC).

    The memories are plays, lags, and both, each beside a level, the temperature's rate and what is `known`, free in all
    their amplitudes. Twice the logarithm of the odds; 10 is very strong (Kass and Raftery, J. Am. Stat. Assoc. 90
    (1995) 773). Means that resemble their neighbours count for less, as of a first-order process.

    Args:
        means: Time (s), temperature (C) and rate of the run, shape (n,) each, with what came before the means used.
        used: Means that count, shape (n,).
        change: Columns that explain the run by a change, shape (n, k); its place counts as one more.
        known: Columns that the memories stand beside, shape (n, k).
    """
    t, x, y = means
    left, rank, alike = _left(change[used], y[used])
    independent = float(used.sum()) * (1.0 - alike) / (1.0 + alike)
    plain = [np.ones_like(t), np.gradient(x, t), *known.T]
    plays = [play(width, x) - x for width in _WIDTHS_C]
    lags = [first_order(tau, t, x) - x for tau in _LAGS_S]
    found = []
    for memories in (plays, lags, plays + lags):
        remains, columns, _ = _left(np.column_stack(plain + memories)[used], y[used])
        better = independent * float(np.log(max(remains, 1e-300) / max(left, 1e-300)))
        found.append(better - (rank + 1 - columns) * float(np.log(max(independent, 1.0))))
    return min(found)


def _left(columns: FloatArray, y: FloatArray) -> tuple[float, int, float]:
    """Squares that a fit leaves, its rank, and the correlation of neighbours in what it leaves, 0 at least."""
    q, size, _ = np.linalg.svd(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300), full_matrices=False)
    q = q[:, size > _RANK * size[0]]
    rest = y - q @ (q.T @ y)
    left = float(rest @ rest)
    return left, q.shape[1], min(max(float(rest[1:] @ rest[:-1]) / max(left, 1e-300), 0.0), 0.95)
