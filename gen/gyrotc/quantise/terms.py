"""Records of extension terms: kind, channel, six parameters (docs/numerics.md, section 8).

Exponentials by decimal arithmetic, so that a record is the same on every machine.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from decimal import Context, Decimal

import numpy as np

from ..errors import CheckFailed
from ..model import Model, Term
from ..table import AUXILIARY, HARMONIC, MEMORY, PLAY, WARM_UP, Words, f32_words

__all__ = ["channel_names", "f32_terms", "q31_terms", "term_size_dph"]

_PARAMETERS = 6
_LOG2E = 1.4426950408889634
_TURN = 6.283185307179586
_LIMIT = 2**30  # of parameters in fixed point that are multiplied

Record = tuple[int, int, list[float]]


def channel_names(model: Model) -> list[str]:
    """Auxiliary channels of a model, in the order in which the target passes them, from channel 1 on."""
    return sorted({t.channel for t in model.terms if t.channel is not None})


def term_size_dph(model: Model) -> float:
    """What the terms may add, as far as the envelope bounds it, deg/h."""
    low, high = model.envelope.temperature_c
    sizes = []
    for term in model.terms:
        p = term.parameters
        sizes.append(abs(p.get("amplitude_dph", 0.0)))
        sizes.append(abs(p.get("amplitude_dph_per_c", 0.0)) * (high - low))
    return math.fsum(sizes)


def f32_terms(model: Model) -> Words:
    """Records in float32."""
    records = [_record(model, term) for term in model.terms]
    words = np.zeros((len(records), 2 + _PARAMETERS), dtype=np.uint32)
    for row, (kind, channel, values) in zip(words, records, strict=True):
        scaled = [64.0 * values[0], *values[1:]] if kind == WARM_UP else values
        row[:2] = kind, channel
        row[2 : 2 + len(values)] = f32_words(scaled)
    return words.reshape(-1)


def q31_terms(model: Model, frac_bits: int) -> Words:
    """Records in fixed point.

    Raises:
        CheckFailed: A parameter does not fit its word.
    """
    unit = 2.0**frac_bits
    scales = {
        MEMORY: (2.0**31, unit, 2.0**24),
        PLAY: (2.0**16, unit),
        WARM_UP: (2.0**28, unit),
        HARMONIC: (2.0**32, 2.0**32, unit),
        AUXILIARY: (unit, 2.0**16),
    }
    words = np.zeros((len(model.terms), 2 + _PARAMETERS), dtype=np.uint32)
    for row, term in zip(words, model.terms, strict=True):
        kind, channel, values = _record(model, term)
        row[:2] = kind, channel
        for k, (value, scale) in enumerate(zip(values, scales[kind], strict=True)):
            row[2 + k] = _whole(term, value * scale, wraps=kind == HARMONIC and k == 1)
    return words.reshape(-1)


def _whole(term: Term, value: float, *, wraps: bool) -> int:
    whole = round(value)
    if wraps:
        return whole & 0xFFFFFFFF
    if whole == 2**31:  # a gain of 1
        whole -= 1
    if abs(whole) >= 2**31 or (abs(whole) >= _LIMIT and term.id == "auxiliary"):
        raise CheckFailed(f"q31: a parameter of term {term.id} leaves the range of 32 bits")
    return whole & 0xFFFFFFFF


def _record(model: Model, term: Term) -> Record:
    channel = 0 if term.channel is None else 1 + channel_names(model).index(term.channel)
    kind, values = _VALUES[term.id](term.parameters, model.block_s)
    return kind, channel, values


def _gain(block_s: float, tau_s: float) -> float:
    """1 - exp(-block/tau)."""
    context = Context(prec=40)
    ratio = context.divide(Decimal(-block_s), Decimal(tau_s))
    return float(1 - context.exp(ratio))


def _input(p: dict[str, float], block_s: float) -> tuple[int, list[float]]:
    return MEMORY, [_gain(block_s, p["tau_s"]), 0.0, block_s / p["tau_s"]]


def _gradient(p: dict[str, float], block_s: float) -> tuple[int, list[float]]:
    return MEMORY, [_gain(block_s, p["tau_s"]), p["amplitude_dph_per_c"], 0.0]


def _play(p: dict[str, float], block_s: float) -> tuple[int, list[float]]:
    return PLAY, [p["width_c"], p["amplitude_dph_per_c"]]


def _warm_up(p: dict[str, float], block_s: float) -> tuple[int, list[float]]:
    return WARM_UP, [_LOG2E * block_s / p["tau_s"], p["amplitude_dph"]]


def _harmonic(p: dict[str, float], block_s: float) -> tuple[int, list[float]]:
    turns = p["phase_rad"] / _TURN
    return HARMONIC, [1.0 / p["period_c"], turns - round(turns), p["amplitude_dph"]]


def _auxiliary(p: dict[str, float], block_s: float) -> tuple[int, list[float]]:
    return AUXILIARY, [p["slope_dph_per_unit"], p["reference"]]


_VALUES: dict[str, Callable[[dict[str, float], float], tuple[int, list[float]]]] = {
    "cavity_lag": _input,
    "thermal_gradient": _gradient,
    "hysteresis": _play,
    "warm_up": _warm_up,
    "path_length_periodicity": _harmonic,
    "auxiliary": _auxiliary,
}
