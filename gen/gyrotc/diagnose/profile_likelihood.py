"""Profile likelihoods of each cause, and of each pair of causes, on the grid.

Of a signature that the static map imitates all but a trace of, the trace decides the size: texture that is none of
the cause's makes a wave of half a turn over the envelope as large as one likes, and the map takes off again what the
wave adds. Such a model fits, and is no explanation; on other temperatures it goes wrong by its own size.

All at the likeliest noise colour. A gain is twice the difference of log-likelihood to the map alone; for a
change of the map's input the same number of map functions is fitted before and after (equal flexibility),
on the blocks where the changed input is known. A cause that would have to be larger than is accepted (`SizeLimit`)
gains nothing.
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..causes import CATALOGUE
from ..causes.base import MOST_OVERTONES, OVERTONES
from ..common.arrays import FloatArray
from ..common.statistics import orthonormal
from .blocks import singled_out
from .candidates import Candidate, columns_of, price_of, searched
from .noise import Whitener
from .scores import variance_ratio_of
from .search import Search
from .tolerances import INDEPENDENT

_MOST_SPREAD = 2.0  # spread of a cause over that of the rate: the map may take off half of it, and not nearly all


class SizeLimit:
    """The largest effect that is accepted for one search.

    Attributes:
        spread_dph: Largest standard deviation of what a cause adds to the block means, deg/h.
        noise: Scale of the whitened noise, deg/h.
    """

    def __init__(self, search: Search) -> None:
        y = search.y - np.median(search.y)
        left_out = orthonormal(search.joined.beside)  # blocks of which nothing is left have no rate
        self.spread_dph = _MOST_SPREAD * float(np.std(y - left_out @ (left_out.T @ y)))
        self.noise = search.likeliest.scale

    def shares(self, columns: FloatArray) -> FloatArray:
        """Share of the largest effect that a column is for a weight of 1 to whitened data over the noise scale.

        Args:
            columns: As block means, not whitened, shape (N, k).
        """
        return np.asarray(columns.std(axis=0) * self.noise / max(self.spread_dph, 1e-300))

    def allows(self, contribution: FloatArray) -> bool:
        """Test whether a fitted effect, deg/h, shape (N,), is accepted."""
        return bool(contribution.std() <= self.spread_dph)


@dataclass(frozen=True, slots=True)
class Point:
    """A model of one or two candidates and its gain."""

    members: tuple[Candidate, ...]
    gain: float

    def criterion(self, size: int) -> float:
        """Gain less the price of the parameters: half the difference of BIC, times two."""
        return self.gain - sum(map(price_of, self.members)) * float(np.log(size))


CauseSet = tuple[Candidate, ...]


@dataclass(frozen=True)
class _Base:
    """Inner products of columns and data, whitened, with a map (plain or of another input) projected out.

    Attributes:
        candidate: Cause that changes the map's input; None: the plain map.
        gain: Gain of what is projected out over the plain map.
        gram: Inner products of all bank and channel columns, shape (K, K).
        a: Inner products of these columns with the data over the noise scale, shape (K,).
        taken: Columns that are projected out in addition to the map; None: there are none.
    """

    candidate: Candidate | None
    gain: float
    gram: FloatArray
    a: FloatArray
    taken: _Taken | None = None


@dataclass(frozen=True)
class _Taken:
    """Columns that a model holds beside its map.

    Attributes:
        weights: Theirs, shape (k,).
        less: What each other column takes off these weights for a weight of 1, shape (k, K).
        shares: Of the largest effect for a weight of 1, shape (k,).
    """

    weights: FloatArray
    less: FloatArray
    shares: FloatArray

    def allows(self, at: slice, weights: FloatArray) -> bool:
        """Test whether they are still accepted beside other columns with these weights."""
        left = self.weights - self.less[:, at] @ weights
        return float(((self.shares * left) ** 2).sum()) <= 1.0


class Gains:
    """Gains of all candidates and pairs for one search.

    Attributes:
        target: Whitened data over the noise scale, shape (N,).
        map, beside: Whitened map functions, and columns that are in every model beside them.
        whole: Whitened bank and channel columns, nothing projected out.
        limit: How large a cause may be.
        size: Number of blocks.
    """

    def __init__(self, search: Search) -> None:
        self.search = search
        view = search.likeliest
        self.scale = view.scale
        self.whiten = Whitener(view.colour, search.records.kept, search.records.block_s, search.sigma)
        bank, joined = search.bank, search.joined
        own = joined.channels.shape[1]
        columns = np.column_stack([bank.signatures, joined.channels])
        on_map = np.column_stack([bank.on_map, joined.on_map[:, :own]])
        self._columns = self.whiten(columns)
        self.whole = self._columns + self.whiten(bank.map) @ on_map
        self.limit = SizeLimit(search)
        self._shares = self.limit.shares(columns + bank.map @ on_map)
        self.target = self.whiten(search.y) / self.scale
        self.beside = self.whiten(joined.beside)
        self.map = self.whiten(bank.map)
        self.size = search.y.size
        names: list[tuple[Candidate, slice]] = [(g.candidate, g.columns) for g in bank.groups]
        k = bank.signatures.shape[1]
        names += [(joined.added[i], slice(k + i, k + i + 1)) for i in range(own)]
        self.plain = [(c, s) for c, s in names if c.role == "columns"]
        self.random = [(c, s) for c, s in names if c.role == "variance"]
        self.base = self._project(None, self.map, None)
        self._bases: list[_Base] | None = None

    def with_target(self, target: FloatArray, *, limited: bool = True) -> Gains:
        """Return the gains of other whitened data, of the same recordings in the same noise.

        Args:
            target: The data, in standard deviations of the noise, shape (blocks,).
            limited: The size of a cause is limited by the spread of the rate, as `limit` says.
        """
        other = copy.copy(self)
        other.target, other._bases = target, None
        if not limited:
            other._shares = np.zeros_like(self._shares)
        other.base = other._project(None, other.map, None)
        return other

    @cached_property
    def map_q(self) -> FloatArray:
        """Orthonormal columns of the whitened map."""
        return orthonormal(self.map)

    def plain_columns(self, at: slice) -> FloatArray:
        """Whitened bank columns with the map projected out."""
        columns = self._columns[:, at]
        return np.asarray(columns - self.map_q @ (self.map_q.T @ columns))

    def replaced(self, candidate: Candidate) -> FloatArray:
        """Whitened map of a changed input."""
        return self.whiten(self.search.bank.replaced[self.search.bank.inputs.index(candidate)])

    def edges(self, candidate: Candidate) -> list[FloatArray]:
        """Whitened columns of the blocks where a changed input is not known; none where there is no such block."""
        return self._unknown(self.search.bank.known[self.search.bank.inputs.index(candidate)])

    def _unknown(self, known: NDArray[np.bool_]) -> list[FloatArray]:
        return [] if known.all() else [self.whiten(singled_out(~known))]

    def rest_after(self, candidate: Candidate, white: FloatArray) -> float:
        """Energy of whitened data that the map of another input leaves on the blocks where it is known."""
        q = orthonormal(self.replaced(candidate), *self.edges(candidate))
        return float(white @ white - ((q.T @ white) ** 2).sum())

    def bases(self) -> list[_Base]:
        """The map of every changed input, projected out."""
        if self._bases is None:
            bank = self.search.bank
            flat = bank.replaced.transpose(1, 0, 2).reshape(self.size, -1)
            white = self.whiten(flat).reshape(self.size, len(bank.inputs), -1)
            self._bases = [self._project(c, white[:, i], bank.known[i]) for i, c in enumerate(bank.inputs)]
        return self._bases

    def _project(self, candidate: Candidate | None, design: FloatArray, known: NDArray[np.bool_] | None) -> _Base:
        blocks = [self.beside, *([] if known is None else self._unknown(known))]
        q = orthonormal(*blocks, design)
        columns = self._columns if candidate is None else self.whole
        cross, c = q.T @ columns, q.T @ self.target
        energy = float(c @ c)
        gain = 0.0
        if candidate is not None:
            plain = orthonormal(*blocks, self.map)
            gain = energy - float(((plain.T @ self.target) ** 2).sum())
        gram = (self._gram if candidate is None else self._whole_gram) - cross.T @ cross
        return _Base(candidate, gain, gram, columns.T @ self.target - cross.T @ c)

    @cached_property
    def _gram(self) -> FloatArray:
        return np.asarray(self._columns.T @ self._columns)

    @cached_property
    def _whole_gram(self) -> FloatArray:
        return np.asarray(self.whole.T @ self.whole)

    def single(self) -> Iterator[Point]:
        """All models of one candidate."""
        yield from self.added()
        for base in self.bases():
            assert base.candidate is not None
            yield Point((base.candidate,), base.gain)

    def added(self) -> Iterator[Point]:
        """Yield the models of one candidate that leave the map's input as it is."""
        yield from self._on(self.base, ())

    def waves(self) -> Iterator[Point]:
        """Yield models of one wave that is no sine: its columns with the first overtones.

        Fundamentals lie so near one another that the highest overtone, which turns faster, has the grid's distances.
        """
        left_out = orthonormal(self.beside, self.map)
        target = self.target - left_out @ (left_out.T @ self.target)
        grid = [c for c, _ in self.plain if CATALOGUE[c.id].overtone is not None]
        for candidate, number in itertools.product(grid, range(1, MOST_OVERTONES + 1)):
            overtone = CATALOGUE[candidate.id].overtone
            assert overtone is not None
            for values in (candidate.values, overtone(candidate.values, 1.0 / (1 + number))):
                if any(v > max(c.values[name] for c in grid) for name, v in values.items()):
                    continue  # the map has such a wave
                wave = replace(candidate, values={**values, OVERTONES: number})
                columns = columns_of(self.search.records, wave.id, wave.values)
                white = self.whiten(columns)
                rest = white - left_out @ (left_out.T @ white)
                weights = np.linalg.lstsq(rest, target, rcond=INDEPENDENT**0.5)[0]
                if float(((self.limit.shares(columns) * weights) ** 2).sum()) <= 1.0:
                    yield Point((wave,), float(target @ (rest @ weights)))

    def white(self, candidate: Candidate) -> FloatArray:
        """Whitened columns of a candidate that adds some, nothing projected out."""
        if OVERTONES in candidate.values:
            return self.whiten(columns_of(self.search.records, candidate.id, candidate.values))
        return self.whole[:, next(at for c, at in (*self.plain, *self.random) if c == candidate)]

    def pairs(self) -> Iterator[Point]:
        """All models of two candidates of which at most one changes the input."""
        for candidate, at in self.plain:
            taken = _take(self.base, at, self._shares[at])
            if taken is not None:
                yield from self._on(taken, (candidate,))
        for base in self.bases():
            assert base.candidate is not None
            yield from self._on(base, (base.candidate,))

    def _gain(self, base: _Base, at: slice, before: FloatArray) -> float:
        """Return the gain of one column or two; 0 if they have nothing of their own, or no size that is accepted."""
        own, a = base.gram[at, at], base.a[at]
        if a.size == 1:
            if own[0, 0] <= INDEPENDENT * before[0]:
                return 0.0
            weights = a / own[0, 0]
        else:
            det = own[0, 0] * own[1, 1] - own[0, 1] ** 2
            if det <= INDEPENDENT * before[0] * before[1]:
                return 0.0
            weights = np.array([own[1, 1] * a[0] - own[0, 1] * a[1], own[0, 0] * a[1] - own[0, 1] * a[0]]) / det
        if float(((self._shares[at] * weights) ** 2).sum()) > 1.0:
            return 0.0
        if base.taken is not None and not base.taken.allows(at, weights):
            return 0.0
        return float(a @ weights)

    def _on(self, base: _Base, members: CauseSet) -> Iterator[Point]:
        """Every candidate with columns of its own, added to what `base` holds already."""
        before = np.diag(self._gram)
        for candidate, at in self.plain:
            gain = self._gain(base, at, before[at])
            yield Point((*members, candidate), base.gain + gain)
        for candidate, at in self.random:
            gain = float(variance_ratio_of(base.gram[at, at], base.a[at], float(before[at].max()))[0])
            yield Point((*members, candidate), base.gain + gain)


def _take(base: _Base, at: slice, shares: FloatArray) -> _Base | None:
    """`base` with further columns projected out; None if they have nothing of their own."""
    own = base.gram[at, at]
    values, vectors = np.linalg.eigh(own)
    if values[0] <= INDEPENDENT * max(float(values[-1]), 1e-3):
        return None
    half = vectors / np.sqrt(values)
    cross, c = half.T @ base.gram[at], half.T @ base.a[at]
    taken = _Taken(half @ c, half @ cross, shares)
    return _Base(base.candidate, base.gain + float(c @ c), base.gram - cross.T @ cross, base.a - cross.T @ c, taken)


_PAIR = 10.0  # what a pair must gain over the best single cause
_MEMBER = 15.0  # what each of a pair must gain beside the other
# Share of the pair's gain that each must gain beside the other: what is less may be the imperfection of its form. What
# differs between runs alone has no form within them, so it leaves no such rest.
_SMALLEST = 0.03
_LEADING = 0.35  # share of a pair's gain that its best single cause must have
SEPARATION = 0.7
"""Difference of the logarithms of the parameters of two states of one kind: a factor of two. Nearer ones are one
state with another parameter."""


def makes_sense(point: Point) -> bool:
    """Test whether a pair makes sense: one shape of the map; two of a kind only if allowed, and far apart."""
    a, b = point.members
    if a.id != b.id:
        return not all(CATALOGUE[m.id].family == "static_map" for m in point.members)
    if not searched(a.id).twice or a.channel != b.channel:
        return a.channel != b.channel
    x, y = (next(iter(m.values.values())) for m in (a, b))
    return bool(abs(np.log(x / y)) > SEPARATION)


def best_of(points: Sequence[Point], size: int) -> Point:
    return max(points, key=lambda p: p.criterion(size))


def clear_pair(singles: list[Point], best: Point, size: int) -> Point | None:
    """The best pair if it is clearly better than the best single cause and needs both its members."""
    alone = {id: max(p.gain for p in singles if p.members[0].id == id) for id in {m.id for m in best.members}}
    if best.criterion(size) < best_of(singles, size).criterion(size) + _PAIR:
        return None
    families = {id: CATALOGUE[id].family for id in alone}
    for other, gain in alone.items():
        formless = families[other] == "between_runs" and set(families.values()) != {"between_runs"}
        if best.gain - gain < (_MEMBER if formless else max(_MEMBER, _SMALLEST * best.gain)):
            return None
    leading = max(p.gain for p in singles)
    return best if leading >= _LEADING * best.gain else None
