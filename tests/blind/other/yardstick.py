"""How much of an effect can be seen, and how much of it a named cause could imitate, under the true noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.linalg import solve_triangular
from scipy.signal import lfilter

from .heat import STEP_S, Array
from .mechanisms import Scene, rate_of
from .noise import PowerLaw, covariance

BLOCK_S = 100
_PER_BLOCK = round(BLOCK_S / STEP_S)
_KEPT = 1e-3  # of the strongest direction of the map's functions


def block_means(x: Array) -> Array:
    """Means over `BLOCK_S` of values at `STEP_S`."""
    n = x.size // _PER_BLOCK * _PER_BLOCK
    return np.asarray(x[:n].reshape(-1, _PER_BLOCK).mean(axis=1))


class Yardstick:
    """Of the training runs of one recording.

    The static map is a polynomial of T to degree 9 with a rate term to degree 3, and its square.
    """

    def __init__(self, scene: Scene, train: Sequence[int], noise: PowerLaw) -> None:
        self.scene, self.train = scene, list(train)
        t = [block_means(scene.heat[k].sensor) for k in train]
        r = [block_means(rate_of(scene.heat[k].sensor)) for k in train]
        self.lengths = [x.size for x in t]
        self.factor = {n: np.linalg.cholesky(covariance(noise, n, BLOCK_S)) for n in set(self.lengths)}
        x, rate = (
            _unit(np.concatenate(t)),
            np.concatenate(r) / max(float(np.abs(np.concatenate(r)).max()), 1e-9),
        )
        low = np.polynomial.chebyshev.chebvander(x, 3)
        parts = [np.polynomial.chebyshev.chebvander(x, 9), low * rate[:, None], low * rate[:, None] ** 2]
        left, size, _ = np.linalg.svd(self.white(np.column_stack(parts)), full_matrices=False)
        self.map = left[:, size > _KEPT * size[0]]

    def white(self, columns: Array) -> Array:
        """Columns of block means, shape (N, k), with noise of unit variance and no correlation."""
        out, at = np.empty_like(columns), 0
        for n in self.lengths:
            out[at : at + n] = solve_triangular(self.factor[n], columns[at : at + n], lower=True)
            at += n
        return out

    def beside_map(self, columns: Array) -> Array:
        """What the map does not hold."""
        white = self.white(columns)
        return np.asarray(white - self.map @ (self.map.T @ white))

    def seen(self, effect: Sequence[Array]) -> tuple[Array, float]:
        """An effect beside the map, shape (N,), and the share of its energy that the map has left."""
        column = np.concatenate([block_means(effect[k]) for k in self.train])[:, None]
        rest = self.beside_map(column)[:, 0]
        whole = self.white(column - column.mean())[:, 0]
        return rest, float(rest @ rest / max(whole @ whole, 1e-300))

    def imitated(self, rest: Array) -> float:
        """Largest share of an effect that one cause of the catalogue can have, with any parameter."""
        shares = []
        for columns in self._imitators():
            q, size, _ = np.linalg.svd(self.beside_map(columns), full_matrices=False)
            q = q[:, size > 1e-6 * max(size[0], 1e-300)]
            shares.append(float(((q.T @ rest) ** 2).sum() / (rest @ rest)))
        return max(shares)

    def _imitators(self) -> Iterator[Array]:
        """Columns of lags, shifts, plays, power-on, runs and dates, waves."""
        runs = [self.scene.heat[k] for k in self.train]
        for tau in np.geomspace(60.0, 8000.0, 14):
            late = [_follow(h.sensor, tau) for h in runs]
            lag = np.concatenate([block_means(z) for z in late])
            own = np.concatenate([block_means(h.sensor) for h in runs])
            yield (lag - own)[:, None]
            yield np.polynomial.chebyshev.chebvander(_unit(lag), 6)[:, 1:]
            yield np.concatenate([block_means(np.exp(-h.on_s / tau)) for h in runs])[:, None]
        for shift in (-1200, -600, -300, 300, 600, 1200):
            moved = [np.roll(h.sensor, round(shift / STEP_S)) for h in runs]
            yield np.polynomial.chebyshev.chebvander(
                _unit(np.concatenate([block_means(m) for m in moved])), 6
            )[:, 1:]
        for width in np.geomspace(0.5, 30.0, 9):
            yield np.concatenate([_play(block_means(h.sensor), width) for h in runs])[:, None]
        yield np.concatenate([np.eye(len(runs))[np.full(n, k)] for k, n in enumerate(self.lengths)])
        sensor = np.concatenate([block_means(h.sensor) for h in runs])
        for period in np.geomspace(4.0, 40.0, 24):
            angle = 2.0 * np.pi * sensor / period
            yield np.column_stack([np.cos(angle), np.sin(angle)])


def _unit(x: Array) -> Array:
    span = max(float(np.ptp(x)), 1e-6)
    return np.asarray(2.0 * (x - x.min()) / span - 1.0)


def _follow(t: Array, tau: float) -> Array:
    keep = float(np.exp(-STEP_S / tau))
    return np.asarray(t[0] + lfilter([1.0 - keep], [1.0, -keep], t - t[0]))


def _play(t: Array, width: float) -> Array:
    out, z = np.empty_like(t), float(t[0])
    for k, x in enumerate(t.tolist()):
        z = min(max(z, x - width), x + width)
        out[k] = z
    return out
