"""One or two recordings: memory of the temperature from a single chamber cycle, beside a map of T alone.

Where every temperature is visited only two or three times, each time at another rate, a map of (T, dT/dt)
can imitate any memory in the runs that it is fitted to and fails on the next. So the map has no dT/dt here,
and one or two states stand beside it, by an information criterion that counts independent blocks: first-order
states, which every package has, unless plays are clearly better. What explains the recordings as well is told.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from ... import terms
from ..quantiles import CHI2_95_ONE, NORMAL_95
from ..screen.blocks import Records
from ..signatures.candidates import Candidate, columns_of
from .attribution import Attribution
from .cycle_fits import CycleFits, memories
from .intervals import Interval
from .refine import Refined
from .rivals import EQUIVALENT, Rival

__all__ = ["Cycle", "cycle_of", "is_single_cycle"]

Array = NDArray[np.float64]

_FEW_PASSES = 3  # of any temperature, in all runs together
_PRICE = 2  # parameters of a state: time constant (or width) and amplitude


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
class Cycle:
    """What a cycle tells.

    Attributes:
        tried: Every kind of one and of two states at its best, best first.
        chosen: The one that is named; None where none is better than the map alone.
        causes: Its states.
        rivals: Causes that would explain the recordings as well.
        rms_dph: What the map of T alone leaves.
        p_value: Of the chosen states together.
        residual: What the map of T alone leaves, deg/h, shape (N,).
        explained: The chosen states' part of it, shape (N,).
    """

    tried: tuple[Tried, ...]
    chosen: Tried | None
    causes: tuple[Refined, ...]
    rivals: tuple[Rival, ...]
    rms_dph: float
    p_value: float
    residual: Array
    explained: Array

    def attribution(self, before: Attribution) -> Attribution:
        """The attribution with this cycle's causes in place of those of the search."""
        if self.chosen is None:
            return replace(before, causes=(), p_values=(), rivals=())
        share = 1.0 - (self.chosen.rms_dph / self.rms_dph) ** 2
        count = len(self.causes)
        return replace(
            before,
            causes=self.causes,
            p_values=(self.p_value,) * count,
            rivals=(self.rivals, *((),) * (count - 1)),
            share=share,
        )


def is_single_cycle(records: Records) -> bool:
    """Whether no temperature is passed more than three times: memory and dT/dt are then one in a map of both."""
    temperatures = [r.history.temperature_c[r.usable] for r in records.runs]
    levels = np.quantile(np.concatenate(temperatures), [0.2, 0.35, 0.5, 0.65, 0.8])
    passes = [sum(np.count_nonzero(np.diff(t > level)) for t in temperatures) for level in levels]
    return len(records.runs) < _FEW_PASSES and bool(max(passes) <= _FEW_PASSES)


def cycle_of(records: Records) -> Cycle:
    """Looks for one or two states in a single cycle."""
    fits = CycleFits(records)
    states = memories()
    kinds = [(k,) for k in states] + list(itertools.combinations_with_replacement(states, 2))
    best = {k: _members(fits, k) for k in kinds}
    least = min((fits.left(m) for m in best.values()), key=lambda e: float(e @ e))
    effective = _effective_size(records, least)
    tried = tuple(sorted((_tried(fits, m, effective) for m in best.values()), key=lambda t: t.criterion))
    rms = float(np.sqrt(np.mean(fits.rest**2)))
    if tried[0].criterion >= 0.0:
        return Cycle(tried, None, (), (), rms, 1.0, fits.rest, np.zeros_like(fits.rest))
    near = [t for t in tried if t.criterion - tried[0].criterion <= EQUIVALENT]
    chosen = next((t for t in near if not _rare(t)), tried[0])
    others = [t for t in near if t is not chosen and _rare(t) and not _rare(chosen)]
    rivals = (Rival(_rare(others[0])[0], others[0].criterion - chosen.criterion),) if others else ()
    ratio = effective * 2.0 * float(np.log(rms / chosen.rms_dph))
    p_value = max(float(chi2.sf(ratio, _PRICE * len(chosen.members))), 1e-300)
    causes = tuple(_refined(fits, chosen, effective))
    explained = fits.rest - fits.left(chosen.members)
    return Cycle(tried, chosen, causes, rivals, rms, p_value, fits.rest, explained)


def _rare(tried: Tried) -> list[str]:
    """Kinds of a set that not every package has."""
    states = memories()
    return [kind for kind in tried.kinds if not states[kind].usual]


def _members(fits: CycleFits, kinds: tuple[str, ...]) -> tuple[Candidate, ...]:
    energy = fits.energies(kinds)
    at = np.unravel_index(int(energy.argmax()), energy.shape)
    return tuple(fits.grid[k][int(i)] for k, i in zip(kinds, at, strict=True))


def _effective_size(records: Records, residual: Array) -> float:
    """Number of independent blocks: n (1 − ρ)/(1 + ρ), ρ the correlation of neighbours."""
    pairs = [(residual[s][1:], residual[s][:-1]) for s in records.spans()]
    top = sum(float(a @ b) for a, b in pairs)
    rho = float(np.clip(top / float(residual @ residual), 0.0, 0.99))
    return residual.size * (1.0 - rho) / (1.0 + rho)


def _tried(fits: CycleFits, members: tuple[Candidate, ...], effective: float) -> Tried:
    kinds = tuple(m.id for m in members)
    total = float(fits.rest @ fits.rest)
    energy = fits.energies(kinds)
    if len(kinds) == 2 and kinds[0] == kinds[1]:
        energy = energy + energy.T
    left = np.maximum(total - energy, 1e-12 * total)
    deviance = effective * np.log(left / left.min())
    intervals, resolved = [], True
    for axis, member in enumerate(members):
        profile = deviance.min(axis=tuple(k for k in range(deviance.ndim) if k != axis))
        inside = np.flatnonzero(profile <= CHI2_95_ONE)
        resolved = resolved and bool(inside[0] > 0 and inside[-1] < profile.size - 1)
        name = next(iter(member.values))
        values = [c.values[name] for c in fits.grid[member.id]]
        intervals.append(Interval(member.values[name], values[inside[0]], values[inside[-1]]))
    price = _PRICE * len(members) * float(np.log(effective))
    criterion = effective * float(np.log(left.min() / total)) + price
    return Tried(members, float(np.sqrt(left.min() / fits.rest.size)), criterion, tuple(intervals), resolved)


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
        rule = terms.CATALOGUE[member.id].amplitudes
        assert rule is not None
        weight, half = float(weights[first + k]), NORMAL_95 * float(spread[first + k])
        parameters = {next(iter(member.values)): interval}
        for name, value in rule(np.array([weight])).items():
            parameters[name] = Interval(value, value - half, value + half)
        yield Refined(member, raw[k], None, parameters, raw[k][:, 0] * weight, None, None)
