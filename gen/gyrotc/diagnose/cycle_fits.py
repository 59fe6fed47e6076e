"""Least squares of a map of T alone, and beside it of states, all combinations of one or two at once, or of dT/dt."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from ..causes.search import Reach, SingleCycle
from ..common.arrays import FloatArray
from ..common.orthonormal import orthonormal
from .blocks import Records, centred_slope
from .candidates import Candidate, columns_of, diagnosed, searched, shape_parameter
from .pairs import APART

__all__ = ["CycleFits", "memories"]


_GAUSSIANS, _WIDTH = 6, 1.5  # of the map of T; width in spacings
_MOST_ALIKE = 1.0 - 1e-9  # correlation of two states that differ by rounding alone
_ROUNDS, _AROUND, _FINE = (
    4,
    1.5,
    1e-4,
)  # of a walk to the optimum: steps of the grid to either side, end in logarithms
RATES: tuple[tuple[tuple[int, int], ...], ...] = (
    ((0, 1),),
    ((0, 1), (1, 1)),
    ((0, 1), (1, 1), (2, 1)),
    ((0, 1), (1, 1), (2, 1), (0, 2)),
    ((0, 1), (1, 1), (2, 1), (0, 2), (1, 2), (0, 3)),
)
"""Powers of (T, dT/dt) beside a map of T: g(T) dT/dt, and flows that saturate or have no sign (docs/simulation.md)."""


def memories() -> dict[str, SingleCycle]:
    """Causes that are looked for in a single cycle."""
    found = {id: searched(id).cycle for id in diagnosed()}
    return {id: cycle for id, cycle in found.items() if cycle is not None}


class CycleFits:
    """Least squares of map and states; everything less what the map explains."""

    def __init__(self, records: Records) -> None:
        self.records = records
        t = records.columns(lambda h: h.temperature_c[:, None])[:, 0]
        nodes = np.linspace(t.min(), t.max(), _GAUSSIANS)
        width = _WIDTH * (nodes[1] - nodes[0])
        static = records.columns(
            lambda h: np.column_stack(
                [
                    np.ones_like(h.temperature_c),
                    h.temperature_c - t.mean(),
                    np.exp(-(((h.temperature_c[:, None] - nodes) / width) ** 2)),
                ]
            )
        )
        self.static = orthonormal(static / np.linalg.norm(static, axis=0))
        self.y = records.target()
        self.rest = self._less_map(self.y)
        longest_s = max(float(np.ptp(r.history.time_s[r.usable])) for r in records.runs)
        self.reach = Reach(float(np.ptp(t)), longest_s)

    def _less_map(self, x: FloatArray) -> FloatArray:
        return np.asarray(x - self.static @ (self.static.T @ x))

    @cached_property
    def grid(self) -> dict[str, list[Candidate]]:
        """States by kind, by ascending parameter."""
        found = {}
        for id, cycle in memories().items():
            parameter = shape_parameter(id)
            assert parameter is not None
            top = min(parameter.high, self.reach.most(parameter.unit))
            values = np.geomspace(parameter.low, top, cycle.points)
            found[id] = [Candidate(id, {parameter.name: float(v)}, "columns") for v in values]
        return found

    @cached_property
    def columns(self) -> dict[str, FloatArray]:
        """Their columns less the map's part, unit norm, by kind, shape (N, count)."""
        out = {}
        for id, states in self.grid.items():
            raw = np.column_stack([columns_of(self.records, id, c.values)[:, 0] for c in states])
            rest = self._less_map(raw)
            out[id] = rest / np.linalg.norm(rest, axis=0)
        return out

    def energies(self, kinds: tuple[str, ...]) -> FloatArray:
        """What every combination of one or two states explains, (deg/h)², shape (count, ...)."""
        a = self.columns[kinds[0]].T @ self.rest
        if len(kinds) == 1:
            return np.asarray(a**2)
        b = self.columns[kinds[1]].T @ self.rest
        c = self.columns[kinds[0]].T @ self.columns[kinds[1]]
        ok = np.abs(c) < _MOST_ALIKE
        if kinds[0] == kinds[1]:
            ok &= self._apart(kinds[0])
        raw = a[:, None] ** 2 + b[None, :] ** 2 - 2.0 * c * a[:, None] * b[None, :]
        out = np.where(ok, raw / np.where(ok, 1.0 - c**2, 1.0), 0.0)
        return np.asarray(np.triu(out, 1) if kinds[0] == kinds[1] else out)

    def _apart(self, kind: str) -> NDArray[np.bool_]:
        """Which two states of a kind are far enough apart to be two, as in `pairs`."""
        logs = np.log([next(iter(c.values.values())) for c in self.grid[kind]])
        return np.asarray(np.abs(logs[:, None] - logs[None, :]) > APART)

    def left(self, members: tuple[Candidate, ...]) -> FloatArray:
        """Residual of map and states."""
        return self._without(np.column_stack([self._column(m) for m in members]))

    def without_rate(self, powers: tuple[tuple[int, int], ...]) -> FloatArray:
        """Residual of the map and of products of T and dT/dt."""
        t, r = self._inputs
        return self._without(self._less_map(np.column_stack([t**a * r**b for a, b in powers])))

    @cached_property
    def _inputs(self) -> tuple[FloatArray, FloatArray]:
        """Block means of T and centred dT/dt, scaled to -1 ... 1."""
        runs = self.records.runs
        t = self.records.average([run.history.temperature_c for run in runs])
        r = self.records.average([centred_slope(run.history) for run in runs])
        return 2.0 * (t - t.min()) / float(np.ptp(t)) - 1.0, r / float(np.abs(r).max())

    def _without(self, columns: FloatArray) -> FloatArray:
        q = orthonormal(columns)
        return np.asarray(self.rest - q @ (q.T @ self.rest))

    def _column(self, member: Candidate) -> FloatArray:
        rest = self._less_map(columns_of(self.records, member.id, member.values)[:, 0])
        return np.asarray(rest / np.linalg.norm(rest))

    def polished(self, members: tuple[Candidate, ...]) -> tuple[Candidate, ...]:
        """The states moved off the grid to the optimum nearby, one after the other; two of a kind stay apart."""
        best, least = members, float((self.left(members) ** 2).sum())
        for k in [k for _ in range(_ROUNDS) for k in range(len(members))]:
            moved, sum_of_squares = self._along(best, k)
            if sum_of_squares < least:
                best, least = moved, sum_of_squares
        return best

    def _along(self, members: tuple[Candidate, ...], k: int) -> tuple[tuple[Candidate, ...], float]:
        """The best place of one state, the others held; of two of a kind the first moves both, their ratio held."""
        grid = np.log([next(iter(c.values.values())) for c in self.grid[members[k].id]])
        here = [float(np.log(next(iter(m.values.values())))) for m in members]
        twins = len(members) == 2 and members[0].id == members[1].id
        together = twins and k == 0
        reach = _AROUND * float(grid[1] - grid[0])
        low, high = max(here[k] - reach, grid[0]), min(here[k] + reach, grid[-1])
        if together:
            low, high = _shared(here, low, high, grid)
        elif twins:
            low = max(low, here[0] + APART)

        def at(value: float) -> tuple[Candidate, ...]:
            moved = [h + value - here[k] if together or j == k else h for j, h in enumerate(here)]
            return tuple(
                replace(m, values={next(iter(m.values)): float(np.exp(v))})
                for m, v in zip(members, moved, strict=True)
            )

        if high - low <= _FINE:
            return members, np.inf
        found = minimize_scalar(
            lambda v: float((self.left(at(v)) ** 2).sum()),
            bounds=(low, high),
            method="bounded",
            options={"xatol": _FINE},
        )
        return at(float(found.x)), float(found.fun)


def _shared(here: list[float], low: float, high: float, grid: FloatArray) -> tuple[float, float]:
    """Limits of the first of two parameters that move together, so that both stay on the grid's range."""
    gap = here[1] - here[0]
    return max(low, float(grid[0]) - min(gap, 0.0)), min(high, float(grid[-1]) - max(gap, 0.0))
