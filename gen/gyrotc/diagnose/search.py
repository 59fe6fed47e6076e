"""One data set under all noise colours: the colours that it allows, and its inner products under each.

The likelihood of a colour is the residual one (Patterson and Thompson 1971): everything that may be an effect is
projected out first, so that no effect is taken for noise.

Everything that is asked of the data afterwards (`detection`) is algebra on these inner products.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..common.arrays import FloatArray
from ..common.statistics import CHI2_95_TWO, TOLERANCE
from .blocks import Records
from .joined import Channels, Joined, join
from .noise import NOISE_COLOURS, Colour, Whitener
from .signature_bank import SignatureBank
from .tolerances import MAIN

_FEW_LEFT = 30  # degrees of freedom that noise needs beside effects: its level is known to 13 % then


@dataclass(frozen=True)
class View:
    """Inner products under one colour.

    Attributes:
        colour: The noise.
        gram: Inner products of the joined columns, shape (P, P).
        b: Of the joined columns with the data, shape (P,).
        yy: Inner product of the data with themselves, (deg/h)².
        log_det: log det of the covariance of the noise.
        log_likelihood: Residual log-likelihood, the scale profiled.
        scale: Estimated factor of the noise, deg/h where the colour's white part is 1.
    """

    colour: Colour
    gram: FloatArray
    b: FloatArray
    yy: float
    log_det: float
    log_likelihood: float
    scale: float


@dataclass(frozen=True)
class Question:
    """Input of views: the data, all columns, and what may be an effect.

    Attributes:
        records, bank: The runs and the signatures on their temperatures.
        y: Block means of the rate, deg/h, shape (N,).
        sigma: Factor of the noise of every block, shape (N,); None: even.
        joined: All columns.
        effects: From the joined columns to everything that may be an effect, shape (P, h).
    """

    records: Records
    bank: SignatureBank
    y: FloatArray
    sigma: FloatArray | None
    joined: Joined
    effects: FloatArray


def possible_effects(bank: SignatureBank, joined: Joined, size: int) -> FloatArray:
    """Map, common directions, channels, main directions of other inputs, and what is beside, in joined columns.

    In a short recording (`size` blocks), where too little would be left of the data, map and beside alone: the rest
    may be effect and noise.
    """
    layout = joined.layout
    exact = np.eye(layout.total)
    _, strength, right = np.linalg.svd(joined.inputs, full_matrices=False)
    keep = strength > MAIN * max(float(strength[0]), 1e-300)
    common = np.zeros((layout.total, bank.common.shape[1]))
    common[layout.signatures] = bank.common
    inputs = np.zeros((layout.total, int(keep.sum())))
    inputs[layout.inputs] = right[keep].T
    all_of_them = np.column_stack(
        [exact[:, layout.static], common, exact[:, layout.channels], inputs, exact[:, layout.beside]]
    )
    if size - all_of_them.shape[1] < _FEW_LEFT:
        return exact[:, layout.held("map and beside")]
    return all_of_them


def view_of_bank(question: Question, number: int) -> View:
    """The view under a colour of `NOISE_COLOURS`, of which the bank knows the inner products."""
    bank = question.bank
    return _view(question, NOISE_COLOURS[number], bank.grams[number], float(bank.log_dets[number]))


def view_of(question: Question, colour: Colour) -> View:
    """The view under a colour that is not in the bank."""
    whiten = Whitener(colour, question.records.kept, question.records.block_s, question.sigma)
    white = whiten(np.column_stack([question.bank.map, question.bank.signatures]))
    return _view(question, colour, white.T @ white, whiten.log_det)


def _view(question: Question, colour: Colour, gram: FloatArray, log_det: float) -> View:
    """Complete the inner products of the bank with those of the other columns and of the data."""
    whiten = Whitener(colour, question.records.kept, question.records.block_s, question.sigma)
    outside = question.joined.outside
    white = whiten(np.column_stack([outside, question.y]))
    inverse = whiten.back(white)
    cross = np.concatenate([question.bank.map.T @ inverse, question.bank.signatures.T @ inverse])
    inner = white.T @ white
    e, p = outside.shape[1], len(gram)
    full = np.empty((p + e, p + e))
    full[:p, :p] = gram
    full[:p, p:] = cross[:, :e]
    full[p:, :p] = full[:p, p:].T
    full[p:, p:] = inner[:e, :e]
    b = np.concatenate([cross[:, e], inner[:e, e]])
    return _with_likelihood(question, colour, full, b, float(inner[e, e]), log_det)


def _with_likelihood(
    question: Question, colour: Colour, gram: FloatArray, b: FloatArray, yy: float, log_det: float
) -> View:
    """Project out what may be an effect; the rest tells level and likelihood of the noise."""
    to = question.effects
    inner = to.T @ gram @ to
    length = np.sqrt(np.diag(inner))
    to, inner = to / length, inner / np.outer(length, length)
    factor = np.linalg.cholesky(inner + TOLERANCE * np.eye(len(inner)))  # dependent columns do not stop it
    c = np.linalg.solve(factor, to.T @ b)
    freedom = question.y.size - len(inner)
    left = max(yy - float(c @ c), 1e-300)
    logs = log_det + 2.0 * float(np.log(np.diag(factor)).sum() + np.log(length).sum())
    likelihood = float(residual_log_likelihood(left, freedom, logs))
    return View(colour, gram, b, yy, log_det, likelihood, float(np.sqrt(left / freedom)))


def residual_log_likelihood(rest: FloatArray | float, freedom: int, log_det: FloatArray | float) -> FloatArray:
    """Residual log-likelihood with the scale profiled, up to a constant that depends on `freedom` alone.

    Args:
        rest: Whitened energy that the model leaves.
        freedom: Number of data less that of columns.
        log_det: log det of the covariance and of the whitened inner products of the columns.
    """
    return np.asarray(-0.5 * (freedom * np.log(np.maximum(rest, 1e-300) / freedom) + log_det))


_COLOUR_RATIO = 16.0  # twice the log-likelihood ratio between the best colour and one that is contradicted


@dataclass(frozen=True)
class Search(Question):
    """A data set, the signatures it is compared with, and its views.

    Attributes:
        channels: Columns of the auxiliary channels, as they were given.
        beside: Columns that are in every model beside the map (blocks left out, causes found), shape (N, b).
        declared: Covariance of block means that is declared, (deg/h)²; None: nothing is.
        views: Of the colours that the data allow, by number in `NOISE_COLOURS`; the declared one comes after the last.
        best: Number of the likeliest colour.
        allowed: Numbers of the colours that the data allow (95 %: ratio and correlation time are free).
        cautious: Whether a cause must be significant under every colour, not on their average.
    """

    channels: Channels | None
    beside: FloatArray | None
    declared: Colour | None
    views: Mapping[int, View]
    best: int
    allowed: tuple[int, ...]
    cautious: bool = False

    @property
    def likeliest(self) -> View:
        """The view under the likeliest colour."""
        return self.views[self.best]

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the residual likelihood."""
        return int(self.y.size - self.effects.shape[1])

    def view_of(self, colour: Colour) -> View:
        """The view under any colour."""
        return view_of(self, colour)

    def contradicts(self, view: View) -> bool:
        """Test whether the data are so much likelier under another colour that the view's cannot be theirs."""
        return 2.0 * (self.likeliest.log_likelihood - view.log_likelihood) > _COLOUR_RATIO

    def extended(self, columns: FloatArray) -> Search:
        """Return the search with further columns, shape (N, k), in every model; columns of zeros have no part in any.

        Only the colours that the data allow are looked at again.
        """
        shown = columns[:, columns.any(axis=0)]
        held = shown if self.beside is None else np.column_stack([self.beside, shown])
        wider = open_search(
            self.records,
            self.bank,
            self.y,
            channels=self.channels,
            beside=held,
            sigma=self.sigma,
            declared=self.declared,
            colours=self.allowed,
        )
        return replace(wider, cautious=self.cautious)


def open_search(
    records: Records,
    bank: SignatureBank,
    y: FloatArray,
    *,
    channels: Channels | None = None,
    beside: FloatArray | None = None,
    sigma: FloatArray | None = None,
    declared: Colour | None = None,
    colours: Sequence[int] | None = None,
) -> Search:
    """Bind a bank to one record of rates.

    Args:
        records: The runs.
        bank: Their bank.
        y: Block means of the rate, deg/h, shape (N,).
        channels: Columns of the auxiliary channels and their candidates.
        beside: Columns that are in every model beside the map, shape (N, b).
        sigma: Factor of the noise of every block, shape (N,); None: even.
        declared: Covariance of block means that is declared, (deg/h)²; None: nothing is.
        colours: Numbers of the colours that are looked at; None: all, and the declared one as the last.
    """
    joined = join(bank, y, channels, beside)
    question = Question(records, bank, y, sigma, joined, possible_effects(bank, joined, records.size))
    count = len(NOISE_COLOURS)
    numbers = range(count + (declared is not None)) if colours is None else colours
    views = {
        k: view_of_bank(question, k) if k < count or declared is None else view_of(question, declared) for k in numbers
    }
    top = max(view.log_likelihood for view in views.values())
    best = next(k for k, view in views.items() if view.log_likelihood == top)
    allowed = tuple(k for k, view in views.items() if 2.0 * (top - view.log_likelihood) <= CHI2_95_TWO)
    kept = {k: views[k] for k in allowed}  # each holds the inner products of all columns
    return Search(
        **vars(question), channels=channels, beside=beside, declared=declared, views=kept, best=best, allowed=allowed
    )
