"""Lack of fit: do the chosen causes explain the data better than shapes that no cause has, and is anything left?

Three tests: what the causes leave is compared with the whole dictionary, flat and weighted; and every cause must
have one amplitude over all runs, temperatures and directions: a foreign effect that happens to look like a cause in
one run does not in the next. Each under every colour of the noise that the data allow, and on their average by
likelihood, for a colour that is a little too fast makes structure of the noise; and under the declared noise, unless
the data contradict it: what is left of a wrong declaration is no structure.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaincc, ndtr

from ..causes import CATALOGUE
from ..common.arrays import FloatArray
from ..common.statistics import main_directions, orthonormal
from .candidates import price_of, searched
from .detection import project
from .joined import Held
from .noise import Whitener
from .profile_likelihood import Gains
from .refinement import Refined
from .scores import Projection, ratio_of
from .search import Search, View
from .signature_bank import DIRECTION_C, Alternative, direction_of
from .static_map import proportional_map
from .tolerances import INDEPENDENT, MAIN
from .wide_memory import WideMemory

_BENT = "memory that does not act in proportion"
_BEND, _BEND_SHARE = 15.0, 0.1  # energy, and share of the cause's gain, that a map may bend more than before
_LOOSE = 0.02
"""Share of the causes' gain that a smooth function must be ahead by: no gyro is exactly the catalogue's formula. A
warm-up of glass at d = 52 was by 1.4 % of its gain a smooth curve rather than an exponential."""


@dataclass(frozen=True, slots=True)
class Contest:
    """The best other shape and its lead over the causes, as a difference of the information criterion."""

    name: str
    lead: float


def contest(
    gains: Gains, causes: Sequence[Refined], rivals: Sequence[Sequence[str]], wide: WideMemory | None = None
) -> Contest:
    """Each other shape alone and in the place of each of the causes, against all of them together.

    The criterion is that of the search: twice the log-likelihood less log N for every parameter. The causes
    have their parameters at the optimum, the others on their grid. A cause may stand back for one of its
    `rivals` (ids, for each cause): what matters is whether any causes do as well as the other shape. Hysteresis
    stands as the form that it was found in (`wide`): a switch with a gap is one of its kind.
    """
    models = _NestedModels(gains, causes)
    every = range(len(causes))
    own = max(models.criterion(every), *(models.instead(k, ids) for k, ids in enumerate(rivals)))
    if wide is not None:
        beside = [k for k in every if not searched(causes[k].candidate.id).loops]
        own = max(own, models.criterion(beside) + wide.criterion(gains.size))
    local = any(CATALOGUE[c.candidate.id].kind == "static" for c in causes)
    shapes = gains.search.bank.alternative_groups
    loose = _LOOSE * max(own - models.criterion(()), 0.0)
    found = []
    for count in every:
        for kept in itertools.combinations(every, count):
            best = models.strongest(kept, [s for s in shapes if not (local and s.texture)], loose)
            found.append(Contest(best.name, models.criterion(kept) + best.lead - own))
    if local:  # a map that a switch changes imitates a finer map of part of the range, so it has to add to it
        found.append(models.strongest(every, [s for s in shapes if s.texture]))
    found += [models.bent(k) for k in every if causes[k].candidate.role == "input"]
    return max(found, key=lambda c: c.lead)


class _NestedModels:
    """Models made of some of the causes (by number), and what other shapes add to them."""

    def __init__(self, gains: Gains, causes: Sequence[Refined]) -> None:
        self.gains, self.causes = gains, causes
        self.y = gains.target
        self.price = float(np.log(gains.size))
        self.always = [gains.beside, *(gains.whiten(c.edges) for c in causes if c.edges is not None)]
        self.white = [gains.whiten(c.columns) for c in causes]
        self.others = gains.whiten(gains.search.bank.alternatives)

    def held(self, kept: Sequence[int]) -> FloatArray:
        """Orthonormal columns of a model: the map, plain or of another input, and what the causes add."""
        swapped = any(self.causes[k].candidate.role == "input" for k in kept)
        static = [] if swapped else [self.gains.map]
        return orthonormal(*self.always, *static, *(self.white[k] for k in kept))

    def criterion(self, kept: Sequence[int]) -> float:
        """Return the criterion of a set of causes; one with a common variance of many weights is weighed as such."""
        random = [k for k in kept if self.causes[k].candidate.role == "variance"][-1:]
        held = self.held([k for k in kept if k not in random])
        total = _energy(held, self.y) - self.price * sum(price_of(self.causes[k].candidate) for k in kept)
        return total + sum(_common(held, self.white[k], self.y) for k in random)

    def instead(self, k: int, ids: Sequence[str]) -> float:
        """Criterion with the k-th cause replaced by the best of some that add one column."""
        at = [s.start for c, s in self.gains.plain if c.id in ids and s.stop - s.start == 1]
        if not at:
            return -np.inf
        kept = self._without(k)
        columns = self.gains.whole[:, at]
        held = self.held(kept)
        rest = columns - held @ (held.T @ columns)
        power = np.einsum("ij,ij->j", rest, rest)
        own = power > INDEPENDENT * np.einsum("ij,ij->j", columns, columns)
        energy = np.where(own, (rest.T @ self.y) ** 2 / np.where(own, power, 1.0), 0.0)
        return self.criterion(kept) + float(energy.max()) - self.price * max(searched(i).price for i in ids)

    def strongest(self, kept: Sequence[int], shapes: Sequence[Alternative], loose: float = 0.0) -> Contest:
        """The other shape that adds most to a model; one that is any smooth function has to add so much more."""
        held = self.held(kept)
        before = np.einsum("ij,ij->j", self.others, self.others)
        rest = self.others - held @ (held.T @ self.others)
        a = rest.T @ (self.y - held @ (held.T @ self.y))
        best = Contest("", -np.inf)
        for shape in shapes:
            value = _gain(shape, rest[:, shape.columns], a[shape.columns], before[shape.columns])
            free = shape.parameters + (1 if shape.common else shape.columns.stop - shape.columns.start)
            value -= free * self.price + (loose if shape.common and not shape.texture else 0.0)
            best = max(best, Contest(shape.name, value), key=lambda c: c.lead)
        return best

    def bent(self, k: int) -> Contest:
        """Return by how much a map of moved inputs bends over dT/dt more than one of plain inputs, less a tolerance.

        A late map imitates memories that act other than in proportion by bending over dT/dt. The map of a true
        lag is less bent there than the one that stands in for it.
        """
        records, basis = self.gains.search.records, self.gains.search.bank.basis
        beside = [self.white[i] for i in self._without(k)]
        moved = self.gains.whiten(proportional_map(records, basis, self.causes[k].candidate))
        plain = self.gains.whiten(proportional_map(records, basis, None))
        full = _energy(self.held(range(len(self.causes))), self.y)
        static = _energy(self.held(self._without(k)), self.y)
        bend = full - _energy(orthonormal(*self.always, moved, *beside), self.y)
        usual = static - _energy(orthonormal(*self.always, plain, *beside), self.y)
        return Contest(_BENT, bend - usual - max(_BEND, _BEND_SHARE * (full - static)))

    def _without(self, k: int) -> list[int]:
        return [i for i in range(len(self.causes)) if i != k]


def _energy(held: FloatArray, y: FloatArray) -> float:
    return float(((held.T @ y) ** 2).sum())


def _common(held: FloatArray, columns: FloatArray, y: FloatArray) -> float:
    """Likelihood ratio of one variance common to the weights of some columns beside a model."""
    rest = columns - held @ (held.T @ columns)
    left, size, _ = np.linalg.svd(rest, full_matrices=False)
    keep = size**2 > INDEPENDENT * max(float((columns**2).sum(axis=0).max()), 1e-300)
    if not keep.any():
        return 0.0
    return float(ratio_of((left[:, keep].T @ y) ** 2, size[keep] ** 2)[0])


def _gain(other: Alternative, columns: FloatArray, a: FloatArray, before: FloatArray) -> float:
    """Twice the log-likelihood that one shape adds."""
    size, vectors = np.linalg.eigh(columns.T @ columns)
    keep = size > INDEPENDENT * float(before.max())
    if not keep.any() or (not other.common and not keep.all()):
        return 0.0
    energy = (a @ vectors[:, keep]) ** 2 / size[keep]
    return float(ratio_of(energy, size[keep])[0]) if other.common else float(energy.sum())


@dataclass(frozen=True, slots=True)
class Misfit:
    """Structure that causes leave.

    Attributes:
        p_value: p-value of what is left, under the noise that the data allow and that which is declared, unless the
            data contradict it.
        worst: The same with the declared noise in any case.
        share: Share of the structure that the causes explain, under the noise of `p_value`.
    """

    p_value: float
    worst: float
    share: float


def misfit(current: Search, held: Held, causes: Sequence[Refined], chance: int = 0) -> Misfit:
    """Return how significant and how large the structure is that causes leave.

    Args:
        current: The search with the causes taken.
        held: What the model holds: not the map where a cause replaces its input.
        causes: The causes that were taken.
        chance: Energy that the model explains of noise alone, where it has many columns beside the causes' own.
    """
    changed = _changed(current, causes)
    views = [current.views[k] for k in current.allowed]
    weight = np.exp([view.log_likelihood - current.likeliest.log_likelihood for view in views])
    p_value, share = _reported(current, views, weight / weight.sum(), held, changed, chance)
    if current.declared is None:
        return Misfit(p_value, p_value, share)
    view = current.view_of(current.declared)
    declared = replace(view, scale=max(view.scale, 1.0))
    own_p, own_share = _reported(current, [declared], np.ones(1), held, changed, chance)
    worst = min(1.0, 2.0 * min(p_value, own_p))
    if current.contradicts(view):
        return Misfit(p_value, worst, share)
    return Misfit(worst, worst, min(share, own_share))


def _reported(
    current: Search, views: Sequence[View], weight: FloatArray, held: Held, changed: FloatArray, chance: int
) -> tuple[float, float]:
    """Return the result if the noise has one of some colours, each as likely as its weight says."""
    tests = np.array(
        [[*_dictionary(project(current, v, held)), _changes(current, v, held, changed)] for v in views]
    )  # p-value and energy left of each, shape (views, tests, 2)
    p_values, left = np.einsum("v,vtk->kt", weight, tests)
    gain = max(float(weight @ [explained(current, view, held) for view in views]) - chance, 0.0)
    return min(1.0, p_values.size * float(p_values.min())), gain / max(gain + max(float(left.max()), 0.0), 1e-300)


def explained(current: Search, view: View, held: Held) -> float:
    """Energy that the causes of a search explain beyond the map under one colour, over the noise."""
    before = project(current, view, "map")
    after = project(current, view, held)
    return max((before.rest - after.rest) / view.scale**2, 0.0)


def _dictionary(projection: Projection) -> list[tuple[float, float]]:
    """p-value and energy left in the dictionary.

    Flat: the energy in all directions. Weighted: one variance common to all signatures, which weighs
    directions by how many signatures share them.
    """
    directions, size = projection.structure
    energy = (projection.a @ directions) ** 2
    total = float(energy.sum())
    ratio, variance = ratio_of(energy, size)
    held = float(variance) * size / (1.0 + float(variance) * size)
    return [
        (float(gammaincc(0.5 * size.size, 0.5 * total)), total - size.size),
        (float(ndtr(-np.sqrt(float(ratio)))), float(((energy - 1.0) * held).sum())),
    ]


def _changed(current: Search, causes: Sequence[Refined]) -> FloatArray:
    """Every cause with an amplitude that differs by run, temperature and direction, shape (N, k)."""
    records = current.records
    t = records.columns(lambda h: h.temperature_c)
    direction = direction_of(records) / DIRECTION_C
    t = (t - t.mean()) / max(float(np.ptp(t)), 1e-9)
    columns = []
    for cause in causes:
        term = CATALOGUE[cause.candidate.id]
        if term.family == "between_runs" or term.kind == "static":  # nothing of them changes within a run
            continue
        shape = cause.contribution
        columns += [shape * t, shape * direction]
        for span in records.spans():
            part = np.zeros_like(shape)
            part[span] = shape[span]
            columns.append(part)
    return np.column_stack(columns) if columns else np.zeros((records.size, 0))


def _changes(current: Search, view: View, held: Held, changed: FloatArray) -> tuple[float, float]:
    """p-value and energy of what changing amplitudes would explain."""
    if changed.shape[1] == 0:
        return 1.0, 0.0
    whiten = Whitener(view.colour, current.records.kept, current.records.block_s, current.sigma)
    model = current.joined.beside
    if held != "beside":
        model = np.column_stack([current.bank.map, model])
    q = orthonormal(whiten(model))
    white = whiten(np.column_stack([changed, current.y]))
    norm = np.linalg.norm(white[:, :-1], axis=0)
    rest = white - q @ (q.T @ white)
    use = np.linalg.norm(rest[:, :-1], axis=0) ** 2 > INDEPENDENT * norm**2
    left = main_directions(rest[:, :-1][:, use] / norm[use], MAIN)
    if left.shape[1] == 0:
        return 1.0, 0.0
    energy = float(((left.T @ rest[:, -1]) ** 2).sum()) / view.scale**2
    return float(gammaincc(0.5 * left.shape[1], 0.5 * energy)), energy - left.shape[1]
