"""Parts that tables of both arithmetics share: settings, coverage bits, guards, terms, sigma, exact solving.

A table is a pure function of its model, whatever processor makes it; `np.exp`, `@` and LAPACK are not.
Here are the few functions needed, in operations that IEEE 754 defines, in a fixed order.

The sum of the single Gaussians' slopes is far too large a bound where weights of opposite sign stand side
by side; here the slope of the whole map is taken on a grid, plus what it can grow between the grid's points.

A cause says what its record holds (`causes.base`); here are the numbers of both arithmetics.
"""

from __future__ import annotations

import math
import re
import zlib
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from ..common.errors import CheckFailed
from ..common.inputs import MOST_HELD, PLAUSIBLE_C
from ..mirror.kinds import TableKind, TermWord
from ..mirror.table import ARRAYS, SERIAL_WORDS, Words, f32_words
from ..model import Guard, Model, Rules, Term, Uncertainty
from ..results.base import Numeric

_S_PER_MIN = 60.0  # a minute
_S_PER_H = 3600.0  # an hour


def sigma_cells(model: Model) -> tuple[int, int]:
    """Cells of T and of the slope; 0, 0 where the model does not say how uncertain it is."""
    known = model.uncertainty_dph
    return known.cells if known and known.rules else (0, 0)


def sigma_values(model: Model, frac_bits: int | None = None) -> NDArray[np.float64]:
    """The words as numbers, in the units of gtc_sigma.inl; empty where the model does not say.

    Args:
        frac_bits: Fraction bits of a bias in fixed point: numbers are whole then. None: float32.
    """
    known = model.uncertainty_dph
    if known is None or known.rules is None:
        return np.zeros(0)
    grids, rules = _grids(model, known, known.rules), _rules(known.rules, model.block_s)
    values = np.array([*grids, *rules, *known.rules.terms])
    correlation = len(grids) + len(rules) - 1
    if frac_bits is None:
        return values
    scale = np.full(values.size, 2.0**frac_bits)
    scale[correlation] = 1.0
    return np.asarray(np.rint(np.minimum(values * scale, 2.0**31 - 1)))


def _grids(model: Model, known: Uncertainty, rules: Rules) -> list[float]:
    """Covered cells, then uncovered ones if the table says which they are; without the constant of a power-on."""
    uncovered = [] if model.coverage is None else [known.uncovered or known.rows]
    grids = np.array([known.rows, *uncovered])
    separate = np.sqrt(np.maximum(grids**2 - rules.between_dph**2, 0.0))
    return [float(sigma) for sigma in separate.reshape(-1)]


def _rules(rules: Rules, block_s: float) -> list[float]:
    """Return the rules in the order of gtc_sigma.inl; the last one is a time."""
    per_min = block_s / _S_PER_MIN
    return [
        rules.hold_dph_per_c,
        rules.rest_dph_per_min * per_min,
        rules.slope_dph_per_c_per_min / per_min,
        rules.start_dph,
        rules.start_dph if rules.turn_dph is None else rules.turn_dph,
        rules.beyond_dph_per_c,
        rules.beyond_dph_per_c_per_min / per_min,
        rules.fallback_dph,
        rules.none_dph,
        rules.between_dph,
        rules.noise_deg_per_sqrt_h * np.sqrt(_S_PER_H),
        rules.correlation_s,
    ]


#: Largest derivative of exp(-x²): at x = 1/√2.
STEEPEST = 0.8577638849607068


class Shared(TypedDict):
    """Members of a table that are integers in every arithmetic."""

    name: str
    id: int
    calibrated: int
    block_us: int
    slope_blocks: int
    lead_blocks: int
    coverage_cells: tuple[int, int]
    sigma_cells: tuple[int, int]
    serial: Words
    coverage: Words


def shared(model: Model) -> Shared:
    """The members that need no rounding."""
    coverage = model.coverage
    return Shared(
        name=model.id,
        id=zlib.crc32(model.id.encode("ascii")),
        calibrated=_date(model),
        block_us=max(1, round(model.block_s * 1e6)),
        slope_blocks=model.slope_blocks,
        lead_blocks=model.lead_blocks,
        coverage_cells=coverage.cells if coverage else (0, 0),
        sigma_cells=sigma_cells(model),
        serial=_serial_words(model.serial),
        coverage=coverage_words(model),
    )


def coverage_words(model: Model) -> Words:
    """One bit a cell, T fastest, 32 cells a word, low bit first."""
    if model.coverage is None:
        return np.zeros(0, dtype=np.uint32)
    bits = model.coverage.trained.ravel()
    padded = np.zeros(-(-len(bits) // 32) * 32, dtype=np.uint32)
    padded[: len(bits)] = bits
    words: Any = padded.reshape(-1, 32) << np.arange(32, dtype=np.uint32)
    return np.asarray(np.bitwise_or.reduce(words, axis=1), dtype=np.uint32)


def _serial_words(serial: str) -> Words:
    """Four characters a word, the first one lowest; zeros behind the end."""
    octets = serial.encode("ascii").ljust(4 * SERIAL_WORDS, b"\0")
    return np.frombuffer(octets, dtype="<u4").astype(np.uint32)


def _date(model: Model) -> int:
    """Date of calibration as a decimal number yyyymmdd; 0 where `[meta]` has none in ISO 8601."""
    found = re.match(r"(\d{4})-(\d{2})-(\d{2})", model.calibrated_on or "")
    return int("".join(found.groups())) if found else 0


Floats = NDArray[np.floating[Any]]

_LN2 = 0.6931471805599453  # ln 2
LOG2E = 1.4426950408889634  # log2(e)
_DEGREE = 17  # of the series of e^y, |y| < ln 2: what is left out is below 2^-60


def exp2_of_minus(u: Any) -> Floats:
    """2^-u for u >= 0, to about 3e-16; 0 beyond 1000."""
    x = np.minimum(np.asarray(u, dtype=np.float64), 1000.0)
    whole = np.floor(x)
    y = (x - whole) * -_LN2
    total = np.ones_like(y)
    for n in range(_DEGREE, 0, -1):
        total = total * y / n + 1.0
    return np.asarray(np.where(x < 1000.0, np.ldexp(total, -whole.astype(np.int64)), 0.0))


def gram(a: Floats, b: Floats) -> Floats:
    """Σ over rows of a[k, i] · b[k, j], added row after row: shape (a.shape[1], b.shape[1])."""
    total = np.zeros((a.shape[1], b.shape[1]))
    for row_a, row_b in zip(a, b, strict=True):
        total = total + row_a[:, None] * row_b[None, :]
    return total


def solve_cholesky(matrix: Floats, right: Floats) -> Floats:
    """x of matrix · x = right for a symmetric positive definite matrix, by Cholesky.

    Raises:
        ArithmeticError: The matrix is not positive definite to working precision.
    """
    n = len(right)
    left = matrix.copy()
    x = right.copy()
    for j in range(n):
        pivot = left[j, j]
        if not pivot > 0.0:
            raise ArithmeticError("matrix is not positive definite")
        column = left[j:, j] / math.sqrt(pivot)
        left[j:, j] = column
        left[j + 1 :, j + 1 :] -= column[1:, None] * column[None, 1:]
    for j in range(n):
        x[j] = x[j] / left[j, j]
        x[j + 1 :] -= x[j] * left[j + 1 :, j]
    for j in range(n - 1, -1, -1):
        x[j] = x[j] / left[j, j]
        x[:j] -= x[j] * left[j, :j]
    return np.asarray(x)


# Of T and of dT/dt: the bound is loose by what a slope grows between them, the time grows with their number
_POINTS = (513, 257)
_MOST_CURVED = 2.0  # largest |d²/dx² exp(-x²)|


def largest_gradient(
    linear: Floats, centers: Floats, inverse_widths: Floats, weights: Floats, low: Floats, high: Floats
) -> NDArray[np.float64]:
    """Upper bounds of |∂f/∂z_T| and |∂f/∂z_r| over a box of normalised inputs, deg/h, shape (2,).

    The same bits on every machine.

    Args:
        linear: Linear part, shape (2,).
        centers: Normalised centers, shape (n, 2).
        inverse_widths: 1/δ, 0 where a width is infinite, shape (n, 2).
        weights: Weights, deg/h, shape (n,).
        low, high: Corners of the box, shape (2,).
    """
    bounds = np.zeros(2)
    for axis in (0, 1):
        other = 1 - axis
        moving = [np.linspace(low[k], high[k], _POINTS[k]) for k in (0, 1)]
        slope = np.full((_POINTS[axis], _POINTS[other]), linear[axis])
        product = np.empty_like(slope)
        for center, inverse, weight in zip(centers, inverse_widths, weights, strict=True):
            a = (moving[axis] - center[axis]) * inverse[axis]
            b = (moving[other] - center[other]) * inverse[other]
            steep = weight * (-2.0 * a * inverse[axis]) * exp2_of_minus(a * a * LOG2E)
            slope += np.multiply(steep[:, None], exp2_of_minus(b * b * LOG2E), out=product)
        half = (high - low) / (np.array(_POINTS) - 1.0) / 2.0
        size = np.abs(weights) * inverse_widths[:, axis]
        growth = _MOST_CURVED * half[axis] * size * inverse_widths[:, axis]
        growth = growth + STEEPEST**2 * half[other] * size * inverse_widths[:, other]
        bounds[axis] = np.max(np.abs(slope, out=slope)) + math.fsum(growth)
    return bounds


TermRecord = tuple[TableKind, int, list[float]]


def channel_names(model: Model) -> list[str]:
    """Auxiliary channels of a model, in the order in which the target passes them, from channel 1 on."""
    return sorted({t.channel for t in model.terms if t.channel is not None})


def term_size_dph(model: Model) -> float:
    """Return the sum over the terms of the largest number that the words of each must hold in the envelope, deg/h."""
    records = (_term_record(model, term) for term in model.terms)
    return math.fsum(kind.description.word_size(values, model.envelope.temperature_c) for kind, _, values in records)


def f32_terms(model: Model) -> Words:
    """Records in float32."""
    records = [_term_record(model, term) for term in model.terms]
    words = np.zeros((len(records), ARRAYS["terms"]), dtype=np.uint32)
    heads = _heads(model)
    for row, head, (kind, _, values) in zip(words, heads, records, strict=True):
        scaled = [word.f32_factor * value for word, value in zip(kind.description.words, values, strict=True)]
        row[:2] = kind, head
        row[2 : 2 + len(values)] = f32_words(scaled)
    return words.reshape(-1)


def q31_terms(model: Model, frac_bits: int) -> Words:
    """Records in fixed point.

    Raises:
        CheckFailed: A parameter does not fit its word.
    """
    words = np.zeros((len(model.terms), ARRAYS["terms"]), dtype=np.uint32)
    for row, head, term in zip(words, _heads(model), model.terms, strict=True):
        kind, _, values = _term_record(model, term)
        row[:2] = kind, head
        for k, (word, value) in enumerate(zip(kind.description.words, values, strict=True)):
            bits = frac_bits if word.q31_bits is None else word.q31_bits
            row[2 + k] = _whole(word, term.id, value * 2.0**bits)
    return words.reshape(-1)


def _whole(word: TermWord, id: str, value: float) -> int:
    whole = round(value)
    if word.is_phase:
        return whole & 0xFFFFFFFF
    if whole == 2**31:  # a gain of 1
        whole -= 1
    if abs(whole) >= (2**30 if word.is_multiplied else 2**31):
        raise CheckFailed(f"q31: a parameter of term {id} leaves the range of 32 bits")
    return whole & 0xFFFFFFFF


def _heads(model: Model) -> list[int]:
    """Second words of the records: channel, and number of the fallback model among the networks in the upper half."""
    heads, last = [], len(model.networks)
    for term in model.terms:
        last += term.fallback_model is not None
        heads.append(_term_record(model, term)[1] + 65536 * (last if term.fallback_model is not None else 0))
    return heads


def _term_record(model: Model, term: Term) -> TermRecord:
    channel = 0 if term.channel is None else 1 + channel_names(model).index(term.channel)
    return term.table.kind, channel, term.table.parameters(term.parameters, model.block_s)


TEMPERATURE = "temperature_c"
"""Name of the temperature among the guards of a model."""

_US_PER_MIN = 60e6  # microseconds in a minute
_LARGEST = 2**31 - 1  # a signed 32-bit word


def guard_of(model: Model, channel: str | None) -> Guard:
    """The guard of a channel; None: of the temperature. Without one in the model every reading passes."""
    missing_s = model.hold_blocks * model.block_s
    if channel is None:
        if TEMPERATURE in model.guards and TEMPERATURE not in channel_names(model):
            return model.guards[TEMPERATURE]
        low, high = PLAUSIBLE_C
        return Guard(
            low=low,
            high=high,
            max_step=model.max_step_c,
            max_rate_per_min=model.max_rate_c_per_min,
            agree_s=model.agree_s,
            stuck_s=model.stuck_s,
            missing_s=missing_s,
            fallback=0.0,
        )
    if channel in model.guards:
        return model.guards[channel]
    reference = next(t.parameters["reference"] for t in model.terms if t.channel == channel)
    return Guard(
        low=-1e9,
        high=1e9,
        max_step=1e9,
        max_rate_per_min=0.0,
        agree_s=0.0,
        stuck_s=0.0,
        missing_s=missing_s,
        fallback=reference,
    )


def guard_words(model: Model, numeric: Numeric) -> Words:
    """One record for each channel, the temperature first."""
    guards = [guard_of(model, channel) for channel in (None, *channel_names(model))]
    return np.concatenate([_guard_record(guard, numeric, model.block_s) for guard in guards])


def _guard_record(guard: Guard, numeric: Numeric, block_s: float) -> Words:
    values = [guard.low, guard.high, guard.max_step, guard.max_rate_per_min / _US_PER_MIN, guard.fallback]
    if numeric == "f32":
        numbers = f32_words(values)
    else:
        scales = (2.0**16, 2.0**16, 2.0**16, 2.0**40, 2.0**16)
        whole = [_held(value * scale) for value, scale in zip(values, scales, strict=True)]
        numbers = np.array([w & 0xFFFFFFFF for w in whole], dtype=np.uint32)
    blocks = min(max(1, round(guard.missing_s / block_s)), MOST_HELD)
    times = [_microseconds(guard.agree_s), _microseconds(guard.stuck_s), blocks]
    return np.concatenate([numbers[:4], np.array(times, dtype=np.uint32), numbers[4:]])


def _held(value: float) -> int:
    """The nearest number that the word has: a wider range than 32 bits hold is none."""
    return int(math.copysign(min(round(abs(value)), _LARGEST), value))


def _microseconds(seconds: float) -> int:
    return min(round(seconds * 1e6), _LARGEST)
