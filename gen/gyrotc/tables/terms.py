"""Records of extension terms: kind, channel, six parameters (docs/numerics.md, section 8).

A cause says what its record holds (`terms.tabled`); here are the numbers of both arithmetics.
"""

from __future__ import annotations

import math

import numpy as np

from ..common.errors import CheckFailed
from ..model import Model, Term
from ..target.recursion import TableKind
from ..target.table import Words, f32_words

__all__ = ["channel_names", "f32_terms", "q31_terms", "term_size_dph"]

_PARAMETERS = 6  # words of a term's record beside its head: docs/FORMAT.md, section 3
_LIMIT = 2**30  # of parameters in fixed point that are multiplied

_PER_C = {TableKind.MEMORY: 1, TableKind.PLAY: 1}  # which parameter is an amplitude in deg/h/C
_ALONE = {TableKind.WARM_UP: 1, TableKind.HARMONIC: 2}  # ... in deg/h; the line of a channel has no bound
_BY = {(TableKind.WARM_UP, 0): 64.0, (TableKind.CURVE, 1): 8.0}
"""What a parameter is multiplied by for float32, whose Gaussian counts in 64ths of an octave."""

Record = tuple[TableKind, int, list[float]]


def channel_names(model: Model) -> list[str]:
    """Auxiliary channels of a model, in the order in which the target passes them, from channel 1 on."""
    return sorted({t.channel for t in model.terms if t.channel is not None})


def term_size_dph(model: Model) -> float:
    """What the terms may add, as far as the envelope bounds it, deg/h."""
    low, high = model.envelope.temperature_c
    sizes = []
    for kind, _, values in (_record(model, term) for term in model.terms):
        if kind in _PER_C:
            sizes.append(abs(values[_PER_C[kind]]) * (high - low))
        elif kind in _ALONE:
            sizes.append(abs(values[_ALONE[kind]]))
        elif kind == TableKind.CURVE:  # each weight has half a word; a slope, whatever the unit, one
            sizes.append(max(2.0 * abs(values[3]), 2.0 * abs(values[5]), abs(values[0])))
        elif kind == TableKind.PRODUCT:
            slopes = [values[0] + values[2] * (t - values[3]) for t in (low, high)]
            sizes.append(max(map(abs, (values[0], values[2], *slopes))))
    return math.fsum(sizes)


def f32_terms(model: Model) -> Words:
    """Records in float32."""
    records = [_record(model, term) for term in model.terms]
    words = np.zeros((len(records), 2 + _PARAMETERS), dtype=np.uint32)
    heads = _heads(model)
    for row, head, (kind, _, values) in zip(words, heads, records, strict=True):
        scaled = [_BY.get((kind, k), 1.0) * value for k, value in enumerate(values)]
        row[:2] = kind, head
        row[2 : 2 + len(values)] = f32_words(scaled)
    return words.reshape(-1)


def q31_terms(model: Model, frac_bits: int) -> Words:
    """Records in fixed point.

    Raises:
        CheckFailed: A parameter does not fit its word.
    """
    unit = 2.0**frac_bits
    scales = {
        TableKind.MEMORY: (2.0**31, unit, 2.0**24),
        TableKind.PLAY: (2.0**16, unit),
        TableKind.WARM_UP: (2.0**28, unit),
        TableKind.HARMONIC: (2.0**32, 2.0**32, unit),
        TableKind.AUXILIARY: (unit, 2.0**16),
        TableKind.CURVE: (unit, 2.0**24, 2.0**16, unit, 2.0**16, unit),
        TableKind.PRODUCT: (unit, 2.0**16, unit, 2.0**16),
    }
    words = np.zeros((len(model.terms), 2 + _PARAMETERS), dtype=np.uint32)
    for row, head, term in zip(words, _heads(model), model.terms, strict=True):
        kind, _, values = _record(model, term)
        row[:2] = kind, head
        for k, (value, scale) in enumerate(zip(values, scales[kind], strict=True)):
            row[2 + k] = _whole(kind, k, term.id, value * scale)
    return words.reshape(-1)


def _whole(kind: TableKind, k: int, id: str, value: float) -> int:
    whole = round(value)
    if (kind, k) == (TableKind.HARMONIC, 1):
        return whole & 0xFFFFFFFF
    if whole == 2**31:  # a gain of 1
        whole -= 1
    half = kind.reads_channel and (kind, k) != (TableKind.CURVE, 1)
    if abs(whole) >= (_LIMIT if half else 2**31):
        raise CheckFailed(f"q31: a parameter of term {id} leaves the range of 32 bits")
    return whole & 0xFFFFFFFF


def _heads(model: Model) -> list[int]:
    """Second words of the records: channel, and number of the stand-in among the networks in the upper half."""
    heads, last = [], len(model.networks)
    for term in model.terms:
        last += term.stand_in is not None
        heads.append(_record(model, term)[1] + 65536 * (last if term.stand_in is not None else 0))
    return heads


def _record(model: Model, term: Term) -> Record:
    channel = 0 if term.channel is None else 1 + channel_names(model).index(term.channel)
    return term.table.kind, channel, term.table.parameters(term.parameters, model.block_s)
