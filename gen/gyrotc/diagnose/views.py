"""The data under one noise colour: inner products with all columns, and how likely the colour is.

The likelihood of a colour is the residual one (Patterson and Thompson 1971): everything that may be an effect is
projected out first, so that no effect is taken for noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..common.arrays import FloatArray
from .blocks import Records
from .colours import COLOURS, Colour
from .joined import Joined
from .signature_bank import SignatureBank
from .whitener import Whitener

__all__ = ["Question", "View", "possible_effects", "residual_log_likelihood", "view_of", "view_of_bank"]


_MAIN = 0.1  # share of the strongest direction below which those of other inputs are left to the noise
_FEW_LEFT = (
    30  # degrees of freedom below which noise cannot be told from effects: its level is known to 13 % then
)
_JITTER = 1e-10  # added to the diagonal of inner products of columns of norm 1: dependent columns do not stop Cholesky


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
    """What views need: the data, all columns, and what may be an effect.

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
    keep = strength > _MAIN * max(float(strength[0]), 1e-300)
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
    """The view under a colour of `COLOURS`, of which the bank knows the inner products."""
    bank = question.bank
    return _view(question, COLOURS[number], bank.grams[number], float(bank.log_dets[number]))


def view_of(question: Question, colour: Colour) -> View:
    """The view under a colour that is not in the bank."""
    whiten = Whitener(colour, question.records.kept, question.records.block_s, question.sigma)
    white = whiten(np.column_stack([question.bank.map, question.bank.signatures]))
    return _view(question, colour, white.T @ white, whiten.log_det)


def _view(question: Question, colour: Colour, gram: FloatArray, log_det: float) -> View:
    """Completes the inner products of the bank with those of the other columns and of the data."""
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
    """Projects out what may be an effect; what is left tells level and likelihood of the noise."""
    to = question.effects
    inner = to.T @ gram @ to
    length = np.sqrt(np.diag(inner))
    to, inner = to / length, inner / np.outer(length, length)
    factor = np.linalg.cholesky(inner + _JITTER * np.eye(len(inner)))
    c = np.linalg.solve(factor, to.T @ b)
    freedom = question.y.size - len(inner)
    left = max(yy - float(c @ c), 1e-300)
    logs = log_det + 2.0 * float(np.log(np.diag(factor)).sum() + np.log(length).sum())
    likelihood = float(residual_log_likelihood(left, freedom, logs))
    return View(colour, gram, b, yy, log_det, likelihood, float(np.sqrt(left / freedom)))


def residual_log_likelihood(
    rest: FloatArray | float, freedom: int, log_det: FloatArray | float
) -> FloatArray:
    """Residual log-likelihood with the scale profiled, up to a constant that depends on `freedom` alone.

    Args:
        rest: Whitened energy that the model leaves.
        freedom: Number of data less that of columns.
        log_det: log det of the covariance and of the whitened inner products of the columns.
    """
    return np.asarray(-0.5 * (freedom * np.log(np.maximum(rest, 1e-300) / freedom) + log_det))
