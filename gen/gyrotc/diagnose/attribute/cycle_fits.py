"""Least squares of a map of T alone and of states beside it: all combinations of one or two states at once."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...terms.search import Reach, SingleCycle
from ..orthonormal import orthonormal
from ..screen.blocks import Records
from ..signatures.candidates import Candidate, columns_of, diagnosed, searched, shape_parameter
from .pairs import APART

__all__ = ["CycleFits", "memories"]

Array = NDArray[np.float64]

_GAUSSIANS, _WIDTH = 6, 1.5  # of the map of T; width in spacings
_MOST_ALIKE = 1.0 - 1e-9  # correlation of two states that differ by rounding alone


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

    def _less_map(self, x: Array) -> Array:
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
    def columns(self) -> dict[str, Array]:
        """Their columns less the map's part, unit norm, by kind, shape (N, count)."""
        out = {}
        for id, states in self.grid.items():
            raw = np.column_stack([columns_of(self.records, id, c.values)[:, 0] for c in states])
            rest = self._less_map(raw)
            out[id] = rest / np.linalg.norm(rest, axis=0)
        return out

    def energies(self, kinds: tuple[str, ...]) -> Array:
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

    def left(self, members: tuple[Candidate, ...]) -> Array:
        """Residual of map and states."""
        x = np.column_stack([self.columns[m.id][:, self.grid[m.id].index(m)] for m in members])
        q = orthonormal(x)
        return np.asarray(self.rest - q @ (q.T @ self.rest))
