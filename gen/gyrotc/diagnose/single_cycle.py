"""One or two recordings: memory of the temperature from a single chamber cycle, beside a map of T alone.

Where every temperature is visited only two or three times, each time at another rate, a map of (T, dT/dt)
can imitate any memory in the runs that it is fitted to and fails on the next. So the map has no dT/dt here,
and one or two states stand beside it, by an information criterion that counts independent blocks: first-order
states, which every package has, unless plays are clearly better. What explains the recordings as well is reported.

A static dT/dt, f(T) + g(T) dT/dt and flows that saturate, is a rival like any other: memory is named only where it
is clearly better than every one of them, and never where the temperature does not turn or a branch that was left out
refutes it. Nothing is shipped from a single cycle: its branches do not tell whether states hold on the next one.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.special import chdtrc

from .. import causes
from ..causes.base import Reach, SingleCycle
from ..common.arrays import FloatArray
from ..common.statistics import CHI2_95_ONE, NORMAL_95, TOLERANCE, orthonormal
from ..train.folds import turning_points
from .attribution import Attribution
from .blocks import Records, centred_slope
from .candidates import Candidate, columns_of, diagnosable_causes, price_of, searched, shape_parameter
from .posterior import EQUIVALENT, Rival
from .profile_likelihood import SEPARATION
from .refinement import Interval, Refined, cancelling

_GAUSSIANS, _WIDTH = 6, 1.5  # of the map of T; width in spacings
_ROUNDS, _AROUND, _FINE = 4, 1.5, 1e-4  # of a walk to the optimum: steps of the grid to either side, end in logarithms
_POWERS = ((0, 1), (1, 1), (2, 1), (0, 2), (1, 2), (0, 3))  # of (T, dT/dt): of each set the first ones
POWERS_OF_RATE: tuple[tuple[tuple[int, int], ...], ...] = tuple(_POWERS[:count] for count in (1, 2, 3, 4, 6))
"""Powers of (T, dT/dt) beside a map of T: g(T) dT/dt, and flows that saturate or have no sign (docs/simulation.md)."""


def memories() -> dict[str, SingleCycle]:
    """Causes that are looked for in a single cycle."""
    found = {id: searched(id).cycle for id in diagnosable_causes()}
    return {id: cycle for id, cycle in found.items() if cycle is not None}


class CycleFits:
    """Least squares of map and states; everything less what the map explains."""

    def __init__(self, records: Records) -> None:
        self.records = records
        t = records.columns(lambda h: h.temperature_c)
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
        """Their columns (`_column`) by kind, shape (N, count)."""
        out = {}
        for id, states in self.grid.items():
            out[id] = np.column_stack([self._column(c) for c in states])
        return out

    def energies(self, kinds: tuple[str, ...]) -> FloatArray:
        """Return what every combination of one or two states explains, (deg/h)², shape (count, ...)."""
        a = self.columns[kinds[0]].T @ self.rest
        if len(kinds) == 1:
            return np.asarray(a**2)
        b = self.columns[kinds[1]].T @ self.rest
        c = self.columns[kinds[0]].T @ self.columns[kinds[1]]
        ok = 1.0 - c**2 > TOLERANCE
        if kinds[0] == kinds[1]:
            ok &= self._separate(kinds[0])
        raw = a[:, None] ** 2 + b[None, :] ** 2 - 2.0 * c * a[:, None] * b[None, :]
        out = np.where(ok, raw / np.where(ok, 1.0 - c**2, 1.0), 0.0)
        return np.asarray(np.triu(out, 1) if kinds[0] == kinds[1] else out)

    def _separate(self, kind: str) -> NDArray[np.bool_]:
        """Return a mask of the pairs of states of a kind that are different enough to be two."""
        logs = np.log([next(iter(c.values.values())) for c in self.grid[kind]])
        return np.asarray(np.abs(logs[:, None] - logs[None, :]) > SEPARATION)

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
        t, r = self.records.columns(lambda h: h.temperature_c), self.records.columns(centred_slope)
        return 2.0 * (t - t.min()) / float(np.ptp(t)) - 1.0, r / (float(np.abs(r).max()) or 1.0)

    def _without(self, columns: FloatArray) -> FloatArray:
        q = orthonormal(columns)
        return np.asarray(self.rest - q @ (q.T @ self.rest))

    def _column(self, member: Candidate) -> FloatArray:
        """A state less the map's part, of unit norm; 0 where the map holds it, as where no temperature changes."""
        raw = columns_of(self.records, member.id, member.values)[:, 0]
        rest = self._less_map(raw)
        size = float(np.linalg.norm(rest))
        return np.asarray(rest / size) if size > TOLERANCE * float(np.linalg.norm(raw)) else np.zeros_like(rest)

    def polished(self, members: tuple[Candidate, ...]) -> tuple[Candidate, ...]:
        """The states moved off the grid to the optimum nearby, one after the other; two of a kind stay separate."""
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
            low = max(low, here[0] + SEPARATION)

        def at(value: float) -> tuple[Candidate, ...]:
            moved = [h + value - here[k] if together or j == k else h for j, h in enumerate(here)]
            return tuple(
                replace(m, values={next(iter(m.values)): float(np.exp(v))}) for m, v in zip(members, moved, strict=True)
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
    """Return limits of the first of two parameters that move together, so that both stay on the grid's range."""
    gap = here[1] - here[0]
    return max(low, float(grid[0]) - min(gap, 0.0)), min(high, float(grid[-1]) - max(gap, 0.0))


_FEW_PASSES = 3  # of any temperature, in all runs together
_UNCORRELATED = 0.05  # about what chance makes of a few hundred blocks


@dataclass(frozen=True)
class Tried:
    """A set of states at its best values.

    Attributes:
        members: The states.
        rms_dph: What map and states leave.
        criterion: Information criterion less that of the map alone; smaller is better.
        intervals: 95 % interval of every state's parameter.
        resolved: Whether every interval ends inside what the recordings can show.
    """

    members: tuple[Candidate, ...]
    rms_dph: float
    criterion: float
    intervals: tuple[Interval, ...]
    resolved: bool

    @property
    def kinds(self) -> tuple[str, ...]:
        return tuple(m.id for m in self.members)


@dataclass(frozen=True)
class Static:
    """A map of T with products of T and dT/dt beside it.

    Attributes:
        powers: Of T and dT/dt.
        rms_dph: What it leaves.
        criterion: As of `Tried`.
    """

    powers: tuple[tuple[int, int], ...]
    rms_dph: float
    criterion: float


@dataclass(frozen=True)
class Cycle:
    """Conclusions from a cycle.

    Attributes:
        tried: Every kind of one and of two states at its best, best first.
        static: Every static dependence on dT/dt, best first.
        turns: How often the temperature turns.
        chosen: The best states; None where none is better than the map alone, or the temperature never turns.
        states: What they add.
        rivals: Causes that would explain the recordings as well.
        rms_dph: What the map of T alone leaves.
        p_value: The p-value of the chosen states together.
        residual: What the map of T alone leaves, deg/h, shape (N,).
        explained: The chosen states' part of it, shape (N,).
        refuted: Whether the states make branches that were left out worse.
    """

    tried: tuple[Tried, ...]
    static: tuple[Static, ...]
    turns: int
    chosen: Tried | None
    states: tuple[Refined, ...]
    rivals: tuple[Rival, ...]
    rms_dph: float
    p_value: float
    residual: FloatArray
    explained: FloatArray
    refuted: bool = False

    @property
    def able(self) -> tuple[Refined, ...]:
        """The states, where they are better than the map of T and than any static dT/dt."""
        return self.states if self.chosen is not None and self.lead > 0.0 else ()

    @property
    def causes(self) -> tuple[Refined, ...]:
        """The states, where they are named: clearly better than these, and not refuted by branches left out."""
        clear = self.chosen is not None and self.lead >= EQUIVALENT
        return self.able if clear and not self.refuted and not cancelling(self.states) else ()

    @property
    def lead(self) -> float:
        """Advantage of the criterion of the chosen states over that of the best without memory."""
        assert self.chosen is not None
        return min(0.0, self.static[0].criterion) - self.chosen.criterion

    @property
    def not_testable(self) -> str:
        """Reason why memory can be neither named nor ruled out here; empty if it can."""
        if self.turns == 0:
            return (
                "the temperature never turns, so that a memory of it cannot be distinguished from a map of T: "
                "record the way back, too"
            )
        if self.chosen is None or self.causes:
            return ""
        if cancelling(self.states):
            return "two memories that take each other off explain this cycle: record the same cycle at another rate"
        if self.refuted:
            return "memory that explains this cycle fails on branches left out: record the same cycle at another rate"
        return (
            f"a static dependence on dT/dt explains this cycle as well (memory leads by {self.lead:.1f} in twice the "
            f"log-likelihood, {EQUIVALENT:g} are needed): record the same cycle at another rate"
        )

    def attribution(self, before: Attribution) -> Attribution:
        """The attribution with this cycle's causes in place of those of the search."""
        if self.chosen is None or not self.causes:
            return before.without_causes()
        share = 1.0 - (self.chosen.rms_dph / self.rms_dph) ** 2
        count = len(self.causes)
        return replace(
            before,
            causes=self.causes,
            p_values=(self.p_value,) * count,
            posteriors=(),
            left=replace(before.left, share=share),
            wide=None,
        )


def is_single_cycle(records: Records) -> bool:
    """Test whether no temperature is passed more than three times: a map of both then cannot tell memory from dT/dt."""
    temperatures = [r.history.temperature_c[r.usable] for r in records.runs]
    levels = np.quantile(np.concatenate(temperatures), [0.2, 0.35, 0.5, 0.65, 0.8])
    passes = [sum(np.count_nonzero(np.diff(t > level)) for t in temperatures) for level in levels]
    return len(records.runs) < _FEW_PASSES and bool(max(passes) <= _FEW_PASSES)


def cycle_of(records: Records) -> Cycle:
    """Look for one or two states in a single cycle, and for a static dT/dt in their place."""
    fits = CycleFits(records)
    states = memories()
    kinds = [(k,) for k in states] + list(itertools.combinations_with_replacement(states, 2))
    best = [fits.polished(_members(fits, k)) for k in kinds]
    left = [fits.left(members) for members in best] + [fits.without_rate(powers) for powers in POWERS_OF_RATE]
    effective = _effective_size(records, min(left, key=lambda e: float(e @ e)))
    tried = tuple(sorted((_tried(fits, m, effective) for m in best), key=lambda t: t.criterion))
    static = tuple(sorted((_static(fits, p, effective) for p in POWERS_OF_RATE), key=lambda t: t.criterion))
    rows = [(r.history.time_s[r.usable], r.history.temperature_c[r.usable]) for r in records.runs]
    turns = sum(len(turning_points(*of_run)) for of_run in rows)
    rms = float(np.sqrt(np.mean(fits.rest**2)))
    if tried[0].criterion >= 0.0 or turns == 0:
        return Cycle(tried, static, turns, None, (), (), rms, 1.0, fits.rest, np.zeros_like(fits.rest))
    near = [t for t in tried if t.criterion - tried[0].criterion <= EQUIVALENT]
    chosen = next((t for t in near if not _rare(t)), tried[0])
    others = [t for t in near if t is not chosen and _rare(t) and not _rare(chosen)]
    rivals = (Rival(_rare(others[0])[0], others[0].criterion - chosen.criterion),) if others else ()
    chosen = _averaged(fits, chosen, effective) if chosen.resolved else chosen
    ratio = effective * 2.0 * float(np.log(rms / chosen.rms_dph))
    p_value = max(float(chdtrc(sum(map(price_of, chosen.members)), max(ratio, 0.0))), 1e-300)
    refined = tuple(_refined(fits, chosen, effective))
    explained = fits.rest - fits.left(chosen.members)
    return Cycle(tried, static, turns, chosen, refined, rivals, rms, p_value, fits.rest, explained)


def _static(fits: CycleFits, powers: tuple[tuple[int, int], ...], effective: float) -> Static:
    left = float((fits.without_rate(powers) ** 2).sum())
    total = float(fits.rest @ fits.rest)
    criterion = effective * float(np.log(left / total)) + len(powers) * float(np.log(effective))
    return Static(powers, float(np.sqrt(left / fits.rest.size)), criterion)


def _rare(tried: Tried) -> list[str]:
    """Kinds of a set that not every package has."""
    states = memories()
    return [kind for kind in tried.kinds if not states[kind].usual]


def _members(fits: CycleFits, kinds: tuple[str, ...]) -> tuple[Candidate, ...]:
    energy = fits.energies(kinds)
    at = np.unravel_index(int(energy.argmax()), energy.shape)
    return tuple(fits.grid[k][int(i)] for k, i in zip(kinds, at, strict=True))


def _effective_size(records: Records, residual: FloatArray) -> float:
    """Number of independent blocks: n/(1 + 2 Σ ρ), over the correlations of blocks until they are noise.

    So it hardly depends on how long a block is, as it would were the correlation of neighbours all that counted.
    """
    total, spans = float(residual @ residual), records.spans()
    correlated = 1.0
    for lag in range(1, max(s.stop - s.start for s in spans)):
        rho = sum(float(residual[s][lag:] @ residual[s][:-lag]) for s in spans) / total
        if rho <= _UNCORRELATED:
            break
        correlated += 2.0 * rho
    return float(residual.size / correlated)


def _tried(fits: CycleFits, members: tuple[Candidate, ...], effective: float) -> Tried:
    kinds = tuple(m.id for m in members)
    total = float(fits.rest @ fits.rest)
    energy = fits.energies(kinds)
    if len(kinds) == 2 and kinds[0] == kinds[1]:
        energy = energy + energy.T
    least = max(float((fits.left(members) ** 2).sum()), TOLERANCE**2 * total)
    left = np.maximum(total - energy, least)
    deviance = effective * np.log(left / least)
    intervals, resolved = [], True
    for axis, member in enumerate(members):
        profile = deviance.min(axis=tuple(k for k in range(deviance.ndim) if k != axis))
        inside = np.flatnonzero(profile <= max(CHI2_95_ONE, float(profile.min())))
        resolved = resolved and bool(inside[0] > 0 and inside[-1] < profile.size - 1)
        name = next(iter(member.values))
        values = [c.values[name] for c in fits.grid[member.id]]
        value = member.values[name]
        intervals.append(Interval(value, min(values[inside[0]], value), max(values[inside[-1]], value)))
    price = sum(map(price_of, members)) * float(np.log(effective))
    criterion = effective * float(np.log(least / total)) + price
    return Tried(members, float(np.sqrt(least / fits.rest.size)), criterion, tuple(intervals), resolved)


def _averaged(fits: CycleFits, chosen: Tried, effective: float) -> Tried:
    """The states at the mean of their parameters' logarithms over the likelihood, in place of its top.

    The top wanders over what explains the cycle equally well. Where an interval reaches the end of what the recordings
    can show, the mean hangs on that end, and the top stays.
    """
    energy = fits.energies(chosen.kinds)
    left = np.maximum(float(fits.rest @ fits.rest) - energy, 1e-300)
    weight = np.where(energy > 0.0, np.exp(-0.5 * effective * np.log(left / left.min())), 0.0)
    members, intervals = [], []
    for axis, (member, interval) in enumerate(zip(chosen.members, chosen.intervals, strict=True)):
        name = next(iter(member.values))
        over = weight.sum(axis=tuple(k for k in range(weight.ndim) if k != axis))
        logs = np.log([c.values[name] for c in fits.grid[member.id]])
        value = float(np.exp(over @ logs / over.sum()))
        members.append(replace(member, values={name: value}))
        intervals.append(Interval(value, min(interval.low, value), max(interval.high, value)))
    rms = float(np.sqrt(np.mean(fits.left(tuple(members)) ** 2)))
    return replace(chosen, members=tuple(members), intervals=tuple(intervals), rms_dph=rms)


def _refined(fits: CycleFits, chosen: Tried, effective: float) -> Iterator[Refined]:
    """The states with amplitudes, whose intervals hold at the states' best parameters."""
    raw = [columns_of(fits.records, m.id, m.values) for m in chosen.members]
    design = np.column_stack([fits.static, *raw])
    size = np.linalg.norm(design, axis=0)
    inverse = np.linalg.pinv(design / size)
    weights = inverse @ fits.y / size
    spread = np.sqrt((inverse**2).sum(axis=1) * fits.y.size / effective) * chosen.rms_dph / size
    first = fits.static.shape[1]
    for k, (member, interval) in enumerate(zip(chosen.members, chosen.intervals, strict=True)):
        rule = causes.CATALOGUE[member.id].amplitudes
        assert rule is not None
        weight, half = float(weights[first + k]), NORMAL_95 * float(spread[first + k])
        parameters = {next(iter(member.values)): interval}
        for name, value in rule(np.array([weight])).items():
            parameters[name] = Interval(value, value - half, value + half)
        yield Refined(member, raw[k], None, parameters, raw[k][:, 0] * weight, None, None)
