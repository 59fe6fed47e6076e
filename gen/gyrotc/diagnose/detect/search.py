"""One data set under all noise colours: inner products with the bank, the colours allowed, the detection.

Everything that is asked of the data afterwards is algebra on these inner products.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from ..noise_colour.colours import COLOURS, Colour, Whitener
from ..screen.blocks import Records
from ..signatures.candidates import Candidate
from ..signatures.signature_bank import Bank
from .scores import Columns, Projection, draw_null, score

__all__ = ["Found", "Search", "View"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_SET_95 = 5.99  # chi-square with two degrees of freedom (ratio and correlation time)
_MAIN = 0.1  # share of the strongest direction below which those of other inputs are left to the noise
_FEW_LEFT = 30  # degrees of freedom below which noise cannot be told from effects
_SEED = 20140916


@dataclass(frozen=True)
class View:
    """Inner products under one colour: of the columns, with the data, of the data; log det; REML log-likelihood."""

    colour: Colour
    gram: Array
    b: Array
    yy: float
    log_det: float
    log_likelihood: float
    scale: float


@dataclass(frozen=True)
class Found:
    """A candidate with its p-values: of its own, and adjusted for the whole search (worst colour)."""

    candidate: Candidate
    log_p: float
    p_value: float


class Search:
    """Binds a bank to one record of rates.

    Args:
        records: The runs.
        bank: Their bank.
        y: Block means of the rate, deg/h, shape (N,).
        extras: Further candidate columns, shape (N, e), and their candidates.
        nuisance: Columns that are in every model beside the map (blocks left out, causes taken), shape (N, d).
        sigma: Factor of the noise of every block, shape (N,); None: even.
        declared: Covariance of block means that is declared, (deg/h)²; None: nothing is.
        colours: Numbers of the colours that are looked at; None: all, and the declared one as the last.
    """

    def __init__(
        self,
        records: Records,
        bank: Bank,
        y: Array,
        extras: tuple[Array, list[Candidate]] | None = None,
        nuisance: Array | None = None,
        sigma: Array | None = None,
        declared: Colour | None = None,
        colours: Sequence[int] | None = None,
    ) -> None:
        self.records, self.bank, self.sigma = records, bank, sigma
        self.declared = declared
        self.cautious = False  # whether a cause must be significant under every colour, or on their average
        self._given = extras
        self._nuisance = nuisance
        size = records.size
        self.y = y
        added, names = extras if extras is not None else (np.zeros((size, 0)), [])
        dropped = nuisance if nuisance is not None else np.zeros((size, 0))
        first = self.baseline_weights(y)
        moved = [r @ first - bank.map @ first for r in bank.replaced]
        moved = [np.where(k, m, 0.0) for k, m in zip(bank.known, moved, strict=True)]
        columns = np.column_stack([added, *moved])
        on_map = bank.map.T @ columns
        rest = columns - bank.map @ on_map
        norm = np.linalg.norm(rest, axis=0)
        norm = np.where(norm > 1e-9 * np.linalg.norm(columns, axis=0) + 1e-300, norm, np.inf)
        self.extra_on_map = on_map / norm
        self.extra_norm = norm
        length = np.linalg.norm(dropped, axis=0)
        self.extra = np.column_stack([rest / norm, dropped / np.where(length > 0.0, length, 1.0)])
        m, k = bank.map.shape[1], bank.signatures.shape[1]
        self.n_map, self.n_bank = m, k
        self.base = np.arange(m)
        self.base = np.concatenate(
            [self.base, m + k + added.shape[1] + len(moved) + np.arange(dropped.shape[1])]
        )
        self.extra_candidates = [*names, *bank.inputs]
        self._index()
        self._held = self._all_effects()
        if size - self._held.shape[1] < _FEW_LEFT:  # a short recording: what is left may be effect and noise
            self._held = np.eye(len(self._held))[:, self.base]
        known = (*COLOURS, *(() if declared is None else (declared,)))
        numbers = range(len(known)) if colours is None else colours
        self.views = {k: self._known_view(k) if k < len(COLOURS) else self.view_of(known[k]) for k in numbers}
        top = max(v.log_likelihood for v in self.views.values())
        self.best = next(k for k, v in self.views.items() if v.log_likelihood == top)
        self.allowed = [k for k, v in self.views.items() if 2.0 * (top - v.log_likelihood) <= _SET_95]

    def extended(self, columns: Array) -> Search:
        """The same search with further columns in every model; `base` lists them after the map.

        Only the colours that the data allow are looked at again.
        """
        held = columns if self._nuisance is None else np.column_stack([self._nuisance, columns])
        wider = Search(
            self.records,
            self.bank,
            self.y,
            self._given,
            held,
            self.sigma,
            self.declared,
            self.allowed,
        )
        wider.cautious = self.cautious
        return wider

    @property
    def likeliest(self) -> View:
        """The view under the likeliest colour."""
        return self.views[self.best]

    def _known_view(self, number: int) -> View:
        return self._view(COLOURS[number], self.bank.grams[number], float(self.bank.log_dets[number]))

    def baseline_weights(self, y: Array) -> Array:
        """Least-squares weights of the map."""
        return np.asarray(self.bank.map.T @ y)

    def _all_effects(self) -> Array:
        """Map, common directions, channels, other inputs' main directions and nuisance, in joined columns."""
        m, k = self.n_map, self.n_bank
        total = m + k + self.extra.shape[1]
        own = len(self.extra_candidates) - len(self.bank.inputs)
        moved = self.extra[:, own : len(self.extra_candidates)]
        _, size, right = np.linalg.svd(moved, full_matrices=False)
        keep = size > _MAIN * max(float(size[0]), 1e-300)
        common = np.zeros((total, self.bank.common.shape[1]))
        common[m : m + k] = self.bank.common
        inputs = np.zeros((total, int(keep.sum())))
        inputs[m + k + own : m + k + len(self.extra_candidates)] = right[keep].T
        exact = np.eye(total)
        return np.column_stack(
            [
                exact[:, :m],
                common,
                exact[:, m + k : m + k + own],
                inputs,
                exact[:, m + k + len(self.extra_candidates) :],
            ]
        )

    def _index(self) -> None:
        """Where single columns, pairs and variance groups stand among the joined columns."""
        single: list[int] = []
        pairs: list[tuple[int, int]] = []
        variance: list[Index] = []
        owners: list[Candidate] = []
        pair_owners: list[Candidate] = []
        variance_owners: list[Candidate] = []
        for group in self.bank.groups:
            at = np.arange(group.columns.start, group.columns.stop) + self.n_map
            role = group.candidate.role
            if role == "columns" and at.size == 1:
                single.append(int(at[0]))
                owners.append(group.candidate)
            elif role == "columns":
                pairs.append((int(at[0]), int(at[1])))
                pair_owners.append(group.candidate)
            elif role == "variance":
                variance.append(at)
                variance_owners.append(group.candidate)
        start = self.n_map + self.n_bank
        single += [start + k for k in range(len(self.extra_candidates))]
        owners += self.extra_candidates
        self.columns = Columns(
            np.array(single), np.array(pairs, dtype=np.int64).reshape(-1, 2), tuple(variance)
        )
        self.owners = [*owners, *pair_owners, *variance_owners, Candidate("structure", {}, "structure")]

    def view_of(self, colour: Colour) -> View:
        """The view under a colour that is not in the bank."""
        whiten = Whitener(colour, self.records.kept, self.records.block_s, self.sigma)
        white = whiten(np.column_stack([self.bank.map, self.bank.signatures]))
        return self._view(colour, white.T @ white, whiten.log_det)

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the residual likelihood."""
        return int(self.y.size - self._held.shape[1])

    def _view(self, colour: Colour, gram: Array, log_det: float) -> View:
        whiten = Whitener(colour, self.records.kept, self.records.block_s, self.sigma)
        both = np.column_stack([self.extra, self.y])
        white = whiten(both)
        inverse = whiten.back(white)
        cross_map = self.bank.map.T @ inverse
        cross_bank = self.bank.signatures.T @ inverse
        e = self.extra.shape[1]
        inner = white.T @ white
        p = len(gram)
        full = np.empty((p + e, p + e))
        full[:p, :p] = gram
        full[:p, p:] = np.concatenate([cross_map, cross_bank])[:, :e]
        full[p:, :p] = full[:p, p:].T
        full[p:, p:] = inner[:e, :e]
        b = np.concatenate([cross_map[:, e], cross_bank[:, e], inner[:e, e]])
        return self._reml(colour, full, b, float(inner[e, e]), log_det)

    def _reml(self, colour: Colour, gram: Array, b: Array, yy: float, log_det: float) -> View:
        """Residual likelihood with everything that may be an effect projected out; the scale profiled."""
        to = self._held
        inner = to.T @ gram @ to
        length = np.sqrt(np.diag(inner))
        to, inner = to / length, inner / np.outer(length, length)
        factor = np.linalg.cholesky(inner + 1e-10 * np.eye(len(inner)))
        c = np.linalg.solve(factor, to.T @ b)
        freedom = self.y.size - len(inner)
        left = max(yy - float(c @ c), 1e-300)
        logs = log_det + 2.0 * float(np.log(np.diag(factor)).sum() + np.log(length).sum())
        likelihood = -0.5 * (freedom * np.log(left / freedom) + logs)
        return View(colour, gram, b, yy, log_det, likelihood, float(np.sqrt(left / freedom)))

    def project(self, view: View, out: Index) -> Projection:
        """Everything after the columns `out` are projected out.

        Where the map itself is not among them (its input is replaced), candidates get back what the map had
        taken of them, and other inputs are no candidates any more.
        """
        if out.size and out[0] == 0:
            return self._project(view, view.gram, view.b, out)
        mix = np.eye(len(view.gram))
        m, k, own = self.n_map, self.n_bank, len(self.extra_candidates) - len(self.bank.inputs)
        mix[:m, m : m + k] = self.bank.on_map
        mix[:m, m + k : m + k + own] = self.extra_on_map[:, :own]
        for i in range(m + k + own, m + k + len(self.extra_candidates)):
            mix[i, i] = 0.0
        return self._project(view, mix.T @ view.gram @ mix, mix.T @ view.b, out)

    def _project(self, view: View, full: Array, b: Array, out: Index) -> Projection:
        inner = full[np.ix_(out, out)]
        size, vectors = np.linalg.eigh(inner)
        keep = size > 1e-10 * size[-1]
        half = vectors[:, keep] / np.sqrt(size[keep])
        cross = half.T @ full[out]
        taken = half.T @ b[out]
        a = (b - cross.T @ taken) / view.scale
        common = np.zeros((len(full), self.bank.common.shape[1]))
        common[self.n_map : self.n_map + self.n_bank] = self.bank.common
        rest = view.yy - float(taken @ taken)
        log_det = view.log_det + float(np.log(size[keep]).sum())
        before = np.maximum(np.diag(full), 1e-12)
        return Projection(a, full - cross.T @ cross, before, common, rest, log_det, int(keep.sum()))

    def detect(self, out: Index) -> list[Found]:
        """Candidates by adjusted p-value, best first.

        The p-value of a candidate is the mean over the colours that the data allow, each weighted by its
        likelihood with map and candidate projected out; where the data contradict the declared noise, the
        largest over the colours within the 95 % set. The null distribution is that of the likeliest colour:
        between colours its 1 % point moves by less than 0.2 in ln p.
        """
        projections = [self.project(self.views[k], out) for k in self.allowed]
        own = np.array([score(p, self.columns, p.a).joined() for p in projections])
        fits = [
            _refitted(p, self.columns, self.views[k], self.y.size)
            for k, p in zip(self.allowed, projections, strict=True)
        ]
        behind = np.max(fits, axis=0) - np.array(fits)
        weight = np.exp(-behind)
        weight /= weight.sum(axis=0)
        null = np.sort(draw_null(projections[self.allowed.index(self.best)], self.columns, _SEED))
        tail = (null.size - np.searchsorted(null, own) + 1.0) / (null.size + 1.0)
        adjusted = (weight * tail).sum(axis=0)
        log_p = -logsumexp(np.log(weight + 1e-300) - own, axis=0)
        if self.cautious:
            inside = 2.0 * behind <= _SET_95
            adjusted = np.where(inside, tail, 0.0).max(axis=0)
            log_p = np.where(inside, own, np.inf).min(axis=0)
        order = np.lexsort((-log_p, adjusted))
        return [Found(self.owners[i], float(log_p[i]), float(adjusted[i])) for i in order]


def _refitted(projection: Projection, columns: Columns, view: View, size: int) -> Array:
    """Residual log-likelihood of a colour with map and candidate projected out, for every candidate."""
    gram, a = projection.gram, projection.a * view.scale
    alive, diagonal = projection.alive, np.diag(projection.gram)
    index = columns.single
    parts: list[Array] = []
    safe = np.where(alive[index], diagonal[index], 1.0)
    energy = np.where(alive[index], a[index] ** 2 / safe, 0.0)
    freedom = size - projection.rank - 1
    parts.append(_reml(projection.rest - energy, freedom, projection.log_det + np.log(safe)))
    for group in (*columns.pairs, *columns.variance):
        values, vectors = np.linalg.eigh(gram[np.ix_(group, group)])
        keep = values > 1e-4 * values[-1]
        c = vectors[:, keep].T @ a[group]
        left = projection.rest - float((c**2 / values[keep]).sum())
        own = projection.log_det + float(np.log(values[keep]).sum())
        parts.append(np.array([_reml(left, size - projection.rank - int(keep.sum()), own)]))
    parts.append(np.array([view.log_likelihood]))
    return np.concatenate(parts)


def _reml(rest: Array | float, freedom: int, log_det: Array | float) -> Array:
    """Residual log-likelihood with the scale profiled."""
    return np.asarray(-0.5 * (freedom * np.log(np.maximum(rest, 1e-300) / freedom) + log_det))
