"""Rates of all runs as one regression with coloured noise: what a change is judged against.

A rate is a smooth function of temperature and its rate that all runs share, a level, a trend and a warm-up of each
run, and noise: white, with a level and a slope that walk (a local linear trend; Harvey, Forecasting, Structural Time
Series Models and the Kalman Filter, 1989, 2.3). Its steady Kalman filter is the recursive filter by which rates and
columns become white; least squares of what it leaves is generalised least squares. The two walks are those of the
largest likelihood.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_are
from scipy.linalg.lapack import dtbtrs

from ..common.arrays import FloatArray, IntArray
from ..common.metrics import median_step
from ..common.splines import cubic_splines
from ..common.statistics import cell_means, running_mean

RowArrays = tuple[FloatArray, FloatArray, FloatArray]
"""Time in s, temperature in C, rate in deg/h of a run, shape (n,) each."""

_KNOTS_C = (5.0, 2.5, 1.25)  # between knots of the map: finer ones only where the recordings say so
_LEAST_SPAN_C = 1.0  # the temperature moves less: a level and a trend say all of it
_SLOPE_S = 300.0  # over which dT/dt is taken: a resolution of 0.1 C makes 0.01 C/min of it
_WARM_UP_S = (300.0, 1000.0, 3000.0)  # time constants of a level that settles after power-on
_GAP_CELLS = 3.0  # without rows: the next cell comes behind a gap
LONGEST_GAP_S = 3000.0  # beyond it a gyro may drift by more than its noise says
_LEVELS = 10.0 ** np.arange(-7.0, 0.5)  # variance of the level's walk over the white one, in a coarse cell
_SLOPES = 10.0 ** np.arange(-13.0, -2.0, 1.5)  # of the slope's walk; at the lowest it moves nothing in a day
_START = (4, 2)  # where the search over both begins
_LEAST_SLOPE = 1e-14  # below it the equation of the filter has no solution in float64
# Share of a column's energy that must be its own: far above the rounding of sums of products (1e-15), also divided by
# the root of this share.
_RIDGE = 1e-9
# Share of a change's energy that must be its own: below it, what is fitted beside it explains the change.
LEAST_ENERGY = 1e-3


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
        """Return the noise in cells of another length, over the variance of their white part."""
        ratio = cell_s / self.cell_s
        return WalkNoise(self.level * ratio**2, self.slope * ratio**4, cell_s)

    def variance(self) -> float:
        """Variance of the filtered noise."""
        return _filter(self.level, self.slope)[2]

    def log_scale(self, cell_s: float) -> float:
        """Logarithm of the factor that makes noise of a run with cells of any length as large as of this one's."""
        return 0.5 * float(np.log(self.variance() / self.in_cells(cell_s).variance() * (cell_s / self.cell_s)))

    def white(self, columns: FloatArray, cell_s: float) -> FloatArray:
        """Columns of a run with cells of any length, filtered so that noise comes out white, as large in every run.

        Args:
            columns: One for each row, shape (..., n).
        """
        b, a, _ = self.filter_of(cell_s)
        return np.asarray(_filtered(b, a, columns) * np.exp(self.log_scale(cell_s)))

    def filter_of(self, cell_s: float) -> tuple[FloatArray, FloatArray, float]:
        """Return numerator, denominator and variance of what comes out of the filter for cells of a length."""
        own = self.in_cells(cell_s)
        return _filter(own.level, own.slope)


@lru_cache(maxsize=256)
def _filter(level: float, slope: float) -> tuple[FloatArray, FloatArray, float]:
    moves = np.array([[1.0, 1.0], [0.0, 1.0]])
    p = solve_discrete_are(moves.T, np.array([[1.0], [0.0]]), np.diag([level, max(slope, _LEAST_SLOPE)]), np.eye(1))
    variance = float(p[0, 0]) + 1.0
    gain = moves @ p[:, 0] / variance
    return np.array([1.0, -2.0, 1.0]), np.array([1.0, gain[0] - 2.0, 1.0 - gain[0] + gain[1]]), variance


def _filtered(numerator: FloatArray, denominator: FloatArray, columns: FloatArray) -> FloatArray:
    """Filter columns, one for each row, shape (..., n), from rest: a(z) out = b(z) in, with a[0] = 1.

    The filter is a banded triangular system. `scipy.signal.lfilter` solves the same, but the import of its package
    takes a third of a fit.
    """
    forced = numerator[0] * columns
    for k in range(1, min(len(numerator), columns.shape[-1])):
        forced[..., k:] += numerator[k] * columns[..., :-k]
    rows = forced.reshape(-1, columns.shape[-1])
    band = np.repeat(denominator[:, None], columns.shape[-1], axis=1)
    solved, _ = dtbtrs(band, rows.T, uplo="L", diag="U")
    return np.asarray(solved.T.reshape(columns.shape))


class Regression:
    """Rates of all runs and the columns that they are fitted with, one for each row of a matrix.

    The rows of each run are the columns of its own (level, trend, warm-up, levels behind long gaps; zeros where it has
    fewer than others), those of the map, and its rate.

    Attributes:
        cells: Of the runs.
        own: Number of columns that each run has of its own.
    """

    def __init__(self, cells: Sequence[RunCells], maps: Sequence[FloatArray]) -> None:
        """Join runs with the columns of the map at their cells (`maps_of`)."""
        self.cells = tuple(cells)
        own = [_own_columns(one) for one in cells]
        self.own = max(len(of_run) for of_run in own)
        self._rows = [
            np.concatenate([of_run, np.zeros((self.own - len(of_run), len(one))), of_map, one.rate_dph[None, :]])
            for one, of_run, of_map in zip(cells, own, maps, strict=True)
        ]
        for rows, one in zip(self._rows, cells, strict=True):
            rows[-1] -= one.rate_dph.mean()
        # What plain least squares say is taken off first, so that sums of squares keep their digits
        plain = _Solution(np.stack([rows @ rows.T for rows in self._rows]), self.own)
        for k, rows in enumerate(self._rows):
            rows[-1] -= plain.amplitudes(k) @ rows[:-1]
        self._taken = plain.of_map()

    def white(self, noise: WalkNoise) -> WhiteRuns:
        """Return the runs through the filter of a noise."""
        rows = [noise.white(rows, one.cell_s) for rows, one in zip(self._rows, self.cells, strict=True)]
        return WhiteRuns(self, noise, rows)

    def curve(self, run: int, amplitudes: FloatArray) -> FloatArray:
        """Return the map along a run, deg/h; `amplitudes`: of its columns, in what plain least squares have left."""
        return np.asarray((self._taken + amplitudes) @ self._rows[run][self.own : -1])


def _own_columns(cells: RunCells) -> FloatArray:
    """Return level, trend, warm-up, and levels behind long gaps of a run, shape (k, n)."""
    n = len(cells)
    columns: list[FloatArray] = [np.ones(n), np.arange(n) / n]
    columns += [np.exp((cells.time_s[0] - cells.time_s) / tau) for tau in _WARM_UP_S]
    columns += [np.asarray(np.arange(n) >= k, dtype=np.float64) for k, gap in cells.behind_gap if gap > LONGEST_GAP_S]
    return np.stack(columns)


class WhiteRuns:
    """A regression through the filter of one noise; its sums of products are those of every fit with this noise."""

    def __init__(self, regression: Regression, noise: WalkNoise, rows: Sequence[FloatArray]) -> None:
        self.regression, self.noise, self._rows = regression, noise, rows
        self._products = np.stack([of_run @ of_run.T for of_run in rows])

    def fit(self, changes: Sequence[FloatArray | None]) -> SmoothFit:
        """Fit all runs.

        Args:
            changes: Columns of what changes in each run, not yet white, shape (k, n) each; None: nothing.
        """
        cells, own = self.regression.cells, self.regression.own
        more = [
            None if columns is None else self.noise.white(columns, one.cell_s)
            for columns, one in zip(changes, cells, strict=True)
        ]
        extra = max(0 if columns is None else len(columns) for columns in more)
        if extra == 0:
            return SmoothFit(self, self._rows, _Solution(self._products, own))
        rows, products = list[FloatArray](), np.zeros((len(cells), *(extra + np.array(self._products.shape[1:]))))
        products[:, extra:, extra:] = self._products
        for k, (columns, of_run) in enumerate(zip(more, self._rows, strict=True)):
            found = np.zeros((extra, of_run.shape[1]))
            if columns is not None:
                found[: len(columns)] = columns
                products[k, :extra, :extra] = found @ found.T
                products[k, :extra, extra:] = found @ of_run.T
                products[k, extra:, :extra] = products[k, :extra, extra:].T
            rows.append(np.concatenate([found, of_run]))
        return SmoothFit(self, rows, _Solution(products, extra + own))


class _Solution:
    """Least squares of all runs from their sums of products: first each run's own columns, then the map.

    A column of which the others hold all but a billionth of its energy gets next to nothing: what is left of it is
    rounding. Sums of products show no less.

    Attributes:
        own_scale, map_scale: Reciprocal norms of the own columns of each run, shape (runs, k), and of the map's, (p,).
        own_root, map_root: Cholesky factors of the products of the scaled columns, those of the map beside the own
            ones, shape (runs, k, k) and (p, p).
        held: Inner products of map and rate with each run's own columns made orthonormal, shape (runs, k, p + 1).
        map_held: Those of the rate with the map's columns made orthonormal beside the own ones, shape (p,).
        left: Sum of the squares that the fit leaves.
        rank: Number of columns that the others do not hold.
    """

    def __init__(self, products: FloatArray, own: int) -> None:
        """Solve; `products`: of own columns, map and rate of each run, shape (runs, k + p + 1, k + p + 1)."""
        energy = np.diagonal(products, axis1=1, axis2=2)
        self.own_scale = _inverse_root(energy[:, :own])
        self.map_scale = _inverse_root(energy[:, own:-1].sum(axis=0))
        scaled = products[:, :own, :own] * self.own_scale[:, :, None] * self.own_scale[:, None, :]
        self.own_root = np.linalg.cholesky(scaled + _RIDGE * np.eye(own))
        self.held = np.linalg.solve(self.own_root, self.own_scale[:, :, None] * products[:, :own, own:])
        left = (products[:, own:, own:] - self.held.transpose(0, 2, 1) @ self.held).sum(axis=0)
        scaled = left[:-1, :-1] * self.map_scale[:, None] * self.map_scale
        self.map_root = np.linalg.cholesky(scaled + _RIDGE * np.eye(len(self.map_scale)))
        self.map_held = np.linalg.solve(self.map_root, self.map_scale * left[:-1, -1])
        self.left = max(float(left[-1, -1] - self.map_held @ self.map_held), 1e-300)
        pivots = (np.diagonal(root, axis1=-2, axis2=-1) ** 2 for root in (self.own_root, self.map_root))
        self.rank = sum(int(np.count_nonzero(pivot > 2.0 * _RIDGE)) for pivot in pivots)

    def of_map(self) -> FloatArray:
        """Return the amplitudes of the map's columns."""
        return np.asarray(self.map_scale * np.linalg.solve(self.map_root.T, self.map_held))

    def amplitudes(self, run: int) -> FloatArray:
        """Return the amplitudes of a run's own columns and of the map's."""
        held, of_map = self.held[run], self.of_map()
        own = np.linalg.solve(self.own_root[run].T, held[:, -1] - held[:, :-1] @ of_map)
        return np.concatenate([self.own_scale[run] * own, of_map])


def _inverse_root(energy: FloatArray) -> FloatArray:
    """Return 1 / sqrt(energy), 0 where there is none."""
    return np.asarray(np.where(energy > 0.0, 1.0 / np.sqrt(np.where(energy > 0.0, energy, 1.0)), 0.0))


class SmoothFit:
    """Runs, made white and fitted.

    Attributes:
        sigma: Standard deviation of the white part of a cell, deg/h.
        log_likelihood: Logarithm of the likelihood, but for what all noises and changes have in common.
    """

    def __init__(self, runs: WhiteRuns, rows: Sequence[FloatArray], solution: _Solution) -> None:
        self._runs, self._rows, self._solution = runs, rows, solution
        cells, noise = runs.regression.cells, runs.noise
        n = sum(len(one) for one in cells)
        left = solution.left / max(n - solution.rank, 1)
        self.sigma = float(np.sqrt(left / noise.variance()))
        log_scale = sum(len(one) * noise.log_scale(one.cell_s) for one in cells)
        self.log_likelihood = -0.5 * n * float(np.log(left)) + log_scale

    def curve(self, run: int) -> FloatArray:
        """Return the map along a run, deg/h."""
        return self._runs.regression.curve(run, self._solution.of_map())

    def of_run(self, run: int) -> RunFit:
        """Return the fit of one run."""
        s, rows = self._solution, self._rows[run]
        own = len(s.own_root[run])
        fitted = np.linalg.solve(s.own_root[run], np.diag(s.own_scale[run])) @ rows[:own]
        shared = s.map_scale[:, None] * (rows[own:-1] - s.held[run][:, :-1].T @ fitted)
        shared = np.linalg.inv(s.map_root) @ shared
        rest = rows[-1] - s.held[run][:, -1] @ fitted - s.map_held @ shared
        return RunFit(self._runs.regression.cells[run], self._runs.noise, np.concatenate([fitted, shared]), rest)


@dataclass(frozen=True, slots=True)
class RunFit:
    """One run of a fit, white.

    Attributes:
        cells: Of the run.
        noise: Whose filter made it white.
        fitted: Orthonormal rows of what is fitted (those of the map over all runs together), shape (k, n).
        rest: What of the white rates is left, shape (n,).
    """

    cells: RunCells
    noise: WalkNoise
    fitted: FloatArray
    rest: FloatArray

    def white(self, columns: FloatArray) -> FloatArray:
        """Return columns of the run, shape (..., n), through its filter."""
        return self.noise.white(columns, self.cells.cell_s)

    def beside(self, columns: FloatArray) -> RunFit:
        """Return the fit beside further columns of the run, not yet white, shape (k, n)."""
        if not len(columns):
            return self
        white = self.white(columns)
        held = white @ self.fitted.T
        energy = np.einsum("ij,ij->i", white, white)
        left = white @ white.T - held @ held.T
        scale = _inverse_root(energy)
        root = np.linalg.cholesky(left * scale[:, None] * scale + _RIDGE * np.eye(len(energy)))
        more = np.linalg.solve(root, scale[:, None] * (white - held @ self.fitted))
        # Only over all runs together is the rest orthogonal to the map: the columns themselves count
        inner = np.linalg.solve(root, scale * (white @ self.rest))
        return replace(self, fitted=np.concatenate([self.fitted, more]), rest=self.rest - inner @ more)

    def amplitudes(self, columns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return of each column the inner product with the rates and its energy, both beside all that is fitted.

        Args:
            columns: Of the run, not yet white, shape (k, n).
        """
        white = self.white(columns)
        return white @ self.rest, own_energy(np.einsum("ij,ij->i", white, white), self.fitted @ white.T)

    def backwards(self) -> FloatArray:
        """Return the inner products of `fitted` and, last, `rest` with what the filter makes of a 1 in each cell.

        The last cell comes first: the filter transposed is the filter that runs backwards. Sums over cells are then
        the inner products with a step, at each cell.
        """
        return self.white(np.concatenate([self.fitted, self.rest[None, :]])[:, ::-1])

    def gain_products(self, curve: FloatArray, cells: IntArray) -> GainProducts:
        """Return the products of white steps at some cells, not the first, and of the white curve that begins there.

        The filter makes of a curve that begins at a cell the white curve, without what the curve before the cell leaves
        in the two states of the filter: a step, and an impulse through its denominator.
        """
        n = len(self.cells)
        _, a, _ = self.noise.filter_of(self.cells.cell_s)
        step, white = self.white(np.ones(n)), self.white(curve)
        scaled = curve * step[0]  # a value as large as the filter makes it in its own cell
        impulse = _filtered(np.array([0.0, 1.0]), a, np.r_[1.0, np.zeros(n - 1)])
        of_step = (white[cells] - scaled[cells]) / step[0]
        of_impulse = white[cells] - scaled[cells] + scaled[cells - 1] - a[2] * white[cells - 1]

        def until_end(one: FloatArray, other: FloatArray) -> FloatArray:
            return np.asarray(np.cumsum(one * other)[n - 1 - cells])

        steps, mixed, impulses = until_end(step, step), until_end(step, impulse), until_end(impulse, impulse)
        with_step = np.cumsum(self.white(white[::-1]))[n - 1 - cells]
        with_impulse = _filtered(np.array([0.0, 1.0]), a, white[::-1])[n - 1 - cells]
        products = with_step - of_step * steps - of_impulse * mixed
        squares = until_end(white[::-1], white[::-1]) - of_step * with_step - of_impulse * with_impulse
        squares += -of_step * products - of_impulse * (with_impulse - of_step * mixed - of_impulse * impulses)
        return GainProducts(steps, products, squares)

    def step_products(self, first: int, end: int) -> FloatArray:
        """Return the inner products of steps at the cells of a span with one another, shape (cells, cells)."""
        n, count = len(self.cells), end - first
        step = self.white(np.ones(n))
        behind = step[n - end : n - first][::-1]
        products = np.outer(behind, behind)
        products[-1] = np.correlate(step[: n - first], step[: n - end + 1], "valid")[::-1]
        products[:, -1] = products[-1]
        for k in range(count - 2, -1, -1):
            products[k, :-1] += products[k + 1, 1:]
        return np.asarray(products)


class GainProducts(NamedTuple):
    """Squares of steps, their products with the gains that begin with them, and squares of these, shape (k,) each."""

    steps: FloatArray
    mixed: FloatArray
    gains: FloatArray


def gains_of_pairs(step: FloatArray, gain: FloatArray, products: GainProducts) -> tuple[FloatArray, FloatArray]:
    """Return squares of sizes over errors of changes of gain, with their steps and beside them.

    Args:
        step, gain: Inner products of the columns of each with what is fitted and, last, the rates.
    """
    energy = own_energy(products.steps, step[:-1])
    mixed = products.mixed - np.einsum("ij,ij->j", step[:-1], gain[:-1])
    inner = gain[-1] - mixed / energy * step[-1]
    own = products.gains - np.einsum("ij,ij->j", gain[:-1], gain[:-1]) - mixed**2 / energy
    alone = inner**2 / np.maximum(np.maximum(own, LEAST_ENERGY * products.gains), 1e-300)
    return step[-1] ** 2 / energy + alone, alone


def own_energy(raw: FloatArray, held: FloatArray) -> FloatArray:
    """Return the energies of columns beside what holds parts of them; `held`: these parts, shape (k, columns)."""
    return np.asarray(np.maximum(raw - np.einsum("ij,ij->j", held, held), LEAST_ENERGY * raw))


def maps_of(cells: Sequence[RunCells], knots_c: float) -> list[FloatArray]:
    """Return the columns of a map over temperature and its rate at the cells of each run, shape (p, n)."""
    low = min(float(one.temperature_c.min()) for one in cells)
    high = max(float(one.temperature_c.max()) for one in cells)
    if high - low < _LEAST_SPAN_C:
        return [np.zeros((0, len(one))) for one in cells]
    knots = np.linspace(low, high, max(int(np.ceil((high - low) / knots_c)), 1) + 1)
    found = []
    for one in cells:
        x = np.clip(one.temperature_c, low, high)
        pieces = cubic_splines(x, knots)[:, 1:].T  # with the first they add up to a level
        slope = running_mean(np.gradient(one.temperature_c, one.time_s), max(round(_SLOPE_S / one.cell_s), 1))
        r, u = 60.0 * slope, (x - 0.5 * (low + high)) / (high - low)
        found.append(np.concatenate([pieces, [r, r * u, r * u * u, r * np.abs(r), r * r]]))
    return found


def knots_and_noise(cells: Sequence[RunCells]) -> tuple[float, WalkNoise]:
    """Return the distance of the map's knots, C, and the likeliest noise beside that map.

    The distance is that of Schwarz's criterion (BIC), each beside the noise of the coarser map: a bend that all
    passages show is no change.
    """
    n = sum(len(one) for one in cells)
    found: tuple[float, WalkNoise] | None = None
    least = np.inf
    for knots_c in _KNOTS_C:
        maps = maps_of(cells, knots_c)
        price = len(maps[0]) * float(np.log(n))
        regression = Regression(cells, maps)
        nothing = [None] * len(cells)
        if found is None:
            noise, likelihood = likeliest_noise(regression, nothing)
        elif 2 * len(maps[0]) > n or price - 2.0 * regression.white(found[1]).fit(nothing).log_likelihood > least:
            break
        else:
            noise, likelihood = likeliest_noise(regression, nothing, found[1])
        found, least = (knots_c, noise), price - 2.0 * likelihood
    assert found is not None
    return found


def likeliest_noise(
    regression: Regression, changes: Sequence[FloatArray | None], start: WalkNoise | None = None
) -> tuple[WalkNoise, float]:
    """Return the walks of the largest likelihood beside changes that are known, and its logarithm.

    Args:
        changes: As for `WhiteRuns.fit`.
        start: Noise that an earlier call returned, at which the search begins; None: there was none.
    """
    known: dict[tuple[int, int], float] = {}
    cell_s = min(one.cell_s for one in regression.cells)

    def noise_at(at: tuple[int, int]) -> WalkNoise:
        return WalkNoise(float(_LEVELS[at[0]]), float(_SLOPES[at[1]]), cell_s)

    def likelihood(at: tuple[int, int]) -> float:
        if at not in known:
            known[at] = regression.white(noise_at(at)).fit(changes).log_likelihood
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
