"""Describe each kind of term of a table: its words, its state, its channel, its recursion and its bounds.

The mirror, the tables and their bounds read the properties of a kind here, and fail on one that is not described. In C
the words, the kinds with a channel and those with a state are in gtc_private.h, gtc_limits.inl and gtc_config.h, which
tests/cases/tables/test_kinds.py compares with this. A new kind needs its row here, its recursion in both languages, and
its test.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .q31 import GAUSS_ERROR
from .recursions import (
    AuxiliaryRecursion,
    CurveRecursion,
    HarmonicRecursion,
    MemoryRecursion,
    NumberArray,
    Operations,
    PlayRecursion,
    ProductRecursion,
    Recursion,
    WarmUpRecursion,
)

Range = tuple[float, float]
Values = Sequence[float]


class TableKind(IntEnum):
    """Kinds of terms by their number in a table, as in gtc_table.h."""

    MEMORY = 1
    PLAY = 2
    WARM_UP = 3
    HARMONIC = 4
    AUXILIARY = 5
    CURVE = 6
    PRODUCT = 7

    @property
    def description(self) -> KindOfTerm:
        """Description of the kind."""
        return KINDS[self]


@dataclass(frozen=True, slots=True)
class TermWord:
    """One parameter of a term as a word of its record.

    Attributes:
        name: As gtc_limits.inl calls it.
        q31_bits: Fraction bits in fixed point; None: those of the bias.
        f32_factor: What it is multiplied by in float32, whose Gaussian counts in 64ths of an octave.
        is_multiplied: In fixed point it is multiplied by a difference, so that it must stay below 2^30.
        is_phase: It counts turns: fixed point keeps the fraction.
    """

    name: str
    q31_bits: int | None
    f32_factor: float = 1.0
    is_multiplied: bool = False
    is_phase: bool = False


@dataclass(frozen=True, slots=True)
class InputDistances:
    """Largest distances of the inputs of a term from the references of its parameters.

    Attributes:
        reading: Largest distance of a reading from the reference.
        temperature_c: Largest distance of T from its own reference, C.
    """

    reading: float
    temperature_c: float


@dataclass(frozen=True, slots=True)
class Past:
    """Time since the terms began, one entry for each correction.

    Attributes:
        since: Blocks since then.
        low, high: Lowest and highest temperature since then.
    """

    since: NDArray[np.int64]
    low: NumberArray
    high: NumberArray


class PastOperations(Protocol):
    """Operations of sigma, in one arithmetic, on what a state does not know of the time before it began."""

    def remaining(self, word: Any, gain: Any, blocks: NDArray[np.int64]) -> NumberArray:
        """word (1 - gain)^blocks."""

    def unsettled(self, width: Any, low: NumberArray, high: NumberArray, word: Any) -> NumberArray:
        """word (2 width - (high - low)), 0 where that is negative."""


@dataclass(frozen=True, slots=True)
class KindOfTerm:
    """Description of a kind of term.

    Attributes:
        words: Its parameters, in the order of the record.
        recursion: Recursion that computes it.
        effect: Range of what it adds, deg/h, from parameters, range of T (C), and range of the readings of its channel.
        word_size: Largest number that its words or products must hold in fixed point, deg/h (or deg/h per C or per unit
            of the channel), from parameters and range of T (C).
        rounding_error: By arithmetic, largest error of what it adds against float64, deg/h, from parameters, distances
            of the inputs and unit of the bias; None: it is not part of the stated error.
        past_sigma: Sigma of what it does not know of the time before it began, from operations, its word of sigma, its
            first parameter and the time since then; None: it has no state.
        reads_channel: It reads an auxiliary channel, and is unsure while that is not read.
    """

    words: tuple[TermWord, ...]
    recursion: type[Recursion]
    effect: Callable[[Values, Range, Range], Range]
    word_size: Callable[[Values, Range], float]
    rounding_error: Mapping[str, Callable[[Values, InputDistances, float], float]] | None = None
    past_sigma: Callable[[PastOperations, Any, Any, Past], NumberArray] | None = None
    reads_channel: bool = False

    @property
    def has_state(self) -> bool:
        """True if it has a state that is saved and goes on after a time without power."""
        return self.past_sigma is not None


def recursion_of(kind: TableKind, do: Operations, parameters: Sequence[Any]) -> Recursion:
    """Return a term of a kind in an arithmetic."""
    return KINDS[kind].recursion(do, parameters)


def _largest_over(value: float, growth: float, reference_c: float, temperature_c: Range) -> float:
    """Largest magnitude of value + growth (T - reference) over a range of T."""
    return max(abs(value + growth * (t - reference_c)) for t in temperature_c)


# ---- what a term can add


def _either_way(size: float) -> Range:
    return -size, size


def _memory_effect(values: Values, temperature_c: Range, _readings: Range) -> Range:
    return _either_way(_memory_size(values, temperature_c))


def _play_effect(values: Values, temperature_c: Range, _readings: Range) -> Range:
    width, amplitude, growth, reference_c = values
    return _either_way(width * _largest_over(amplitude, growth, reference_c, temperature_c))


def _amplitude_effect(values: Values, temperature_c: Range, _readings: Range) -> Range:
    return _either_way(_amplitude_size(values, temperature_c))


def _line_effect(slopes: Values, reference: float, readings: Range) -> Range:
    ends = [slope * (x - reference) for slope in slopes for x in readings]
    return min(0.0, *ends), max(0.0, *ends)


def _auxiliary_effect(values: Values, _temperature_c: Range, readings: Range) -> Range:
    slope, reference = values
    return _line_effect([slope], reference, readings)


def _curve_effect(values: Values, _temperature_c: Range, readings: Range) -> Range:
    slope, _, reference, first, _, second = values
    low, high = _line_effect([slope], reference, readings)
    return low + math.fsum((min(0.0, first), min(0.0, second))), high + math.fsum((max(0.0, first), max(0.0, second)))


def _product_effect(values: Values, temperature_c: Range, readings: Range) -> Range:
    slope, reference, growth, reference_c = values
    return _line_effect([slope + growth * (t - reference_c) for t in temperature_c], reference, readings)


# ---- what its words must hold in fixed point


def _memory_size(values: Values, temperature_c: Range) -> float:
    return abs(values[1]) * (temperature_c[1] - temperature_c[0])


def _play_size(values: Values, temperature_c: Range) -> float:
    _, amplitude, growth, reference_c = values
    largest = _largest_over(amplitude, growth, reference_c, temperature_c)
    return max(largest * (temperature_c[1] - temperature_c[0]), abs(growth))


def _amplitude_size(values: Values, _temperature_c: Range) -> float:
    return abs(values[-1])


def _no_size(_values: Values, _temperature_c: Range) -> float:
    """The line of a channel has no bound: its unit may be any."""
    return 0.0


def _curve_size(values: Values, _temperature_c: Range) -> float:
    slope, _, _, first, _, second = values
    return max(2.0 * abs(first), 2.0 * abs(second), abs(slope))  # each weight has half a word


def _product_size(values: Values, temperature_c: Range) -> float:
    slope, _, growth, reference_c = values
    return max(abs(slope), abs(growth), _largest_over(slope, growth, reference_c, temperature_c))


# ---- what rounding does to it: docs/numerics.md, section 8

_EPS = 2.0**-24  # largest relative error of one float32 rounding
_F32_GAUSSIAN = 1.9e-7  # of 2^-v in float32, by visiting every argument: docs/numerics.md, section 2
_STEEP = 0.715  # largest |d/da 2^(-a²)|: sqrt(2 ln2 / e)
_SCALED = 0.736  # largest |da²/da a 2^(-a²)|: 2/e
_CUT = 2.0**-32  # what a Gaussian is at 32 octaves, where it ends


def _curve_error_q31(values: Values, reach: InputDistances, unit: float) -> float:
    slope, gain, _, first, _, second = values
    argument = gain * 2.0**-17 + 2.0**-28  # a center is rounded, the product cut off
    gaussian = GAUSS_ERROR + _CUT + _STEEP * argument + _SCALED * 2.0**-25 / gain
    line = 0.5 * unit * reach.reading + abs(slope) * 2.0**-17 + unit
    return line + (abs(first) + abs(second)) * gaussian + 2.0 * unit


def _curve_error_f32(values: Values, reach: InputDistances, _unit: float) -> float:
    slope, gain, reference, first, center, second = values
    line = abs(slope) * (3.0 * reach.reading + abs(reference)) * _EPS
    gaussians = math.fsum(
        abs(w) * (_F32_GAUSSIAN + _CUT + _STEEP * gain * abs(c) * _EPS + (4.0 * _SCALED + 2.0) * _EPS)
        for c, w in ((reference, first), (center, second))
    )
    total = abs(slope) * reach.reading + 2.0 * (abs(first) + abs(second))  # of the two sums
    return 1.01 * (line + gaussians + total * _EPS)


def _product_error_q31(values: Values, reach: InputDistances, unit: float) -> float:
    growth = values[2]
    here = 0.5 * unit + 0.5 * unit * reach.temperature_c + abs(growth) * 2.0**-17 + unit
    return here * reach.reading + _steepest(values, reach) * 2.0**-17 + unit


def _product_error_f32(values: Values, reach: InputDistances, _unit: float) -> float:
    slope, reference, growth, reference_c = values
    here = abs(slope) + abs(growth) * (4.0 * reach.temperature_c + abs(reference_c)) + _steepest(values, reach)
    return 1.01 * _EPS * (here * reach.reading + _steepest(values, reach) * (2.0 * reach.reading + abs(reference)))


def _steepest(values: Values, reach: InputDistances) -> float:
    return abs(values[0]) + abs(values[2]) * reach.temperature_c


# ---- the kinds

_BIAS = None  # fraction bits of the bias

KINDS: Mapping[TableKind, KindOfTerm] = {
    TableKind.MEMORY: KindOfTerm(
        words=(TermWord("gain", 31), TermWord("amplitude", _BIAS), TermWord("rate", 24)),
        recursion=MemoryRecursion,
        effect=_memory_effect,
        word_size=_memory_size,
        past_sigma=lambda do, word, gain, past: do.remaining(word, gain, past.since),
    ),
    TableKind.PLAY: KindOfTerm(
        words=(
            TermWord("width", 16),
            TermWord("amplitude", _BIAS),
            TermWord("slope of the amplitude over T", _BIAS, is_multiplied=True),
            TermWord("reference of T", 16),
        ),
        recursion=PlayRecursion,
        effect=_play_effect,
        word_size=_play_size,
        past_sigma=lambda do, word, width, past: do.unsettled(width, past.low, past.high, word),
    ),
    TableKind.WARM_UP: KindOfTerm(
        words=(TermWord("gain", 28, f32_factor=64.0), TermWord("amplitude", _BIAS)),
        recursion=WarmUpRecursion,
        effect=_amplitude_effect,
        word_size=_amplitude_size,
    ),
    TableKind.HARMONIC: KindOfTerm(
        words=(TermWord("frequency", 32), TermWord("phase", 32, is_phase=True), TermWord("amplitude", _BIAS)),
        recursion=HarmonicRecursion,
        effect=_amplitude_effect,
        word_size=_amplitude_size,
    ),
    TableKind.AUXILIARY: KindOfTerm(
        words=(TermWord("slope", _BIAS, is_multiplied=True), TermWord("reference", 16, is_multiplied=True)),
        recursion=AuxiliaryRecursion,
        effect=_auxiliary_effect,
        word_size=_no_size,
        reads_channel=True,
    ),
    TableKind.CURVE: KindOfTerm(
        words=(
            TermWord("slope", _BIAS, is_multiplied=True),
            TermWord("gain", 24, f32_factor=8.0),
            TermWord("reference, first center", 16, is_multiplied=True),
            TermWord("first weight", _BIAS, is_multiplied=True),
            TermWord("second center", 16, is_multiplied=True),
            TermWord("second weight", _BIAS, is_multiplied=True),
        ),
        recursion=CurveRecursion,
        effect=_curve_effect,
        word_size=_curve_size,
        rounding_error={"f32": _curve_error_f32, "q31": _curve_error_q31},
        reads_channel=True,
    ),
    TableKind.PRODUCT: KindOfTerm(
        words=(
            TermWord("slope", _BIAS, is_multiplied=True),
            TermWord("reference", 16, is_multiplied=True),
            TermWord("slope of the slope over T", _BIAS, is_multiplied=True),
            TermWord("reference of T", 16, is_multiplied=True),
        ),
        recursion=ProductRecursion,
        effect=_product_effect,
        word_size=_product_size,
        rounding_error={"f32": _product_error_f32, "q31": _product_error_q31},
        reads_channel=True,
    ),
}
