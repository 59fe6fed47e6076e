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
_NODE_C = 4.0  # distance of the map's nodes over temperature
_LAGS_S = np.geomspace(60.0, 8000.0, 20)
_SHIFTS_S = tuple(s for s in range(-1800, 1801, 100) if s)


def block_means(x: Array) -> Array:
    """Means over `BLOCK_S` of values at `STEP_S`."""
    n = x.size // _PER_BLOCK * _PER_BLOCK
    return np.asarray(x[:n].reshape(-1, _PER_BLOCK).mean(axis=1))


class Yardstick:
    """Of the training runs of one recording.

    The static map is linear between nodes over T, with a rate term to degree 3 of T, and its square.
    """

    def __init__(self, scene: Scene, train: Sequence[int], noise: PowerLaw) -> None:
        self.scene, self.train = scene, list(train)
        self.lengths = [block_means(scene.heat[k].sensor).size for k in train]
        self.factor = {n: np.linalg.cholesky(covariance(noise, n, BLOCK_S)) for n in set(self.lengths)}
        self.map = self._map_of([scene.heat[k].sensor for k in train])

    def _map_of(self, seen: Sequence[Array]) -> Array:
        """White orthonormal functions of the map over a temperature of each run at `STEP_S`, shape (N, m)."""
        x = np.concatenate([block_means(t) for t in seen])
        rate = np.concatenate([block_means(rate_of(t)) for t in seen])
        rate /= max(float(np.abs(rate).max()), 1e-9)
        nodes = np.linspace(x.min(), x.max(), max(round(float(np.ptp(x)) / _NODE_C), 4) + 1)
        hats = np.maximum(1.0 - np.abs(x[:, None] - nodes) / max(float(nodes[1] - nodes[0]), 1e-9), 0.0)
        low = np.polynomial.chebyshev.chebvander(_unit(x), 3)
        parts = [hats, low * rate[:, None], low * rate[:, None] ** 2]
        left, size, _ = np.linalg.svd(self.white(np.column_stack(parts)), full_matrices=False)
        return np.asarray(left[:, size > _KEPT * size[0]])

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
        column = self._column(effect)
        rest = self.beside_map(column)[:, 0]
        whole = self.white(column - column.mean())[:, 0]
        return rest, float(rest @ rest / max(whole @ whole, 1e-300))

    def _column(self, effect: Sequence[Array]) -> Array:
        return np.concatenate([block_means(effect[k]) for k in self.train])[:, None]

    def imitated(self, effect: Sequence[Array]) -> float:
        """Largest share of an effect beside the map that one cause of the catalogue can have, with any parameter.

        Args:
            effect: Of each run at `STEP_S`, deg/h, at its true size: a cause that changes the map's input has to hold
                the map, too.
        """
        rest, _ = self.seen(effect)
        shares = []
        for columns in self._imitators():
            q, size, _ = np.linalg.svd(self.beside_map(columns), full_matrices=False)
            q = q[:, size > 1e-6 * max(size[0], 1e-300)]
            shares.append(float(((q.T @ rest) ** 2).sum() / (rest @ rest)))
        return max([*shares, self._of_another_input(effect, float(rest @ rest))])

    def _of_another_input(self, effect: Sequence[Array], energy: float) -> float:
        """Share of what map and effect leave of the plain map that the same map of a lagged or shifted T takes."""
        runs = [self.scene.heat[k] for k in self.train]
        static = self.white(self._column([self.scene.map(h.sensor, rate_of(h.sensor)) for h in self.scene.heat]))
        held = (self.map @ (self.map.T @ static))[:, 0]
        own = self.white(self._column(effect))[:, 0]
        moved = [[_follow(h.sensor, tau) for h in runs] for tau in _LAGS_S]
        moved += [[_shifted(h.sensor, shift) for h in runs] for shift in _SHIFTS_S]
        most = 0.0
        for seen in moved:
            q = self._map_of(seen)
            for whole in (held + own, held - own):
                left = whole - q @ (q.T @ whole)
                most = max(most, 1.0 - float(left @ left) / energy)
        return most

    def _imitators(self) -> Iterator[Array]:
        """Columns of lags, plays, power-on, runs and dates, waves."""
        runs = [self.scene.heat[k] for k in self.train]
        for tau in _LAGS_S:
            yield np.concatenate([block_means(_follow(h.sensor, tau) - h.sensor) for h in runs])[:, None]
            yield np.concatenate([block_means(np.exp(-h.on_s / tau)) for h in runs])[:, None]
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


def _shifted(t: Array, shift_s: float) -> Array:
    """Temperature some time before, held at the ends."""
    return np.asarray(t[np.clip(np.arange(t.size) - round(shift_s / STEP_S), 0, t.size - 1)])


def _play(t: Array, width: float) -> Array:
    out, z = np.empty_like(t), float(t[0])
    for k, x in enumerate(t.tolist()):
        z = min(max(z, x - width), x + width)
        out[k] = z
    return out
