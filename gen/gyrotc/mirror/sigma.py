"""Compute sigma of every correction of a history, as `gtc_<n>_snapshot` gives it, from numpy alone.

Mirror of libc/gtc_sigma.inl, and of the last part of libc/gtc_num_<n>.h; docs/design.md gives the rules with their
reasons. A square is a float32 number, or an unsigned one of 64 bits in the square of the bias' unit; in fixed point
each part is no larger than 2^30, and sums saturate.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import IntArray
from . import f32, q31
from .front_end import FROM_FALLBACK as FALLEN
from .front_end import FROM_MAP, Steps
from .kinds import Past, TableKind
from .recursions import Course, NumberArray, TermOutcome
from .table import FALLBACK, UNCOVERED, WARMING, Table, Words

#: Words of a table's uncertainty behind its grids, without those of the terms.
RULES = 12

_PART = 2**30  # its square and a few more fit 64 bits
_LARGEST = 2**31 - 1  # of a word
# Half the exponent's bias, less what makes the first guess of a root even
_HALF_EXPONENT = np.uint32(0x1FBB4F2E)
_HALF, _ONE, _TWO = np.float32(0.5), np.float32(1.0), np.float32(2.0)  # in float32, so that nothing widens


class Squares:
    """Operations of float32, element by element, each rounded as on the target; fixed point has its own."""

    def squared(self, x: NumberArray) -> NumberArray:
        x = np.asarray(x, dtype=np.float32)
        return np.asarray(x * x)

    def plus(self, a: NumberArray, b: NumberArray) -> NumberArray:
        return np.asarray(a + b)

    def per_c(self, a: NumberArray, b: Any, word: Any) -> NumberArray:
        return np.asarray(word * (a - b))

    def times(self, k: NDArray[np.int64], x: Any) -> NumberArray:
        """k x, x of magnitude 2^30 at most in fixed point."""
        return np.asarray(np.asarray(k).astype(np.float32) * x)

    def part(self, k: NDArray[np.int64], n: int, x: Any) -> NumberArray:
        """k x / n"""
        return np.asarray(self.times(k, x) / np.float32(n))

    def limited(self, x: NumberArray) -> NumberArray:
        return x

    def estimate(self, mean: NumberArray, start: NumberArray, blocks: NDArray[np.int64]) -> NumberArray:
        """The slope of a front end that began at `start`."""
        return np.asarray((_TWO * (mean - start)) / (2 * blocks - 1).astype(np.float32))

    def root(self, x: NumberArray) -> NumberArray:
        x = np.asarray(x, dtype=np.float32)
        there = x > 0
        safe = np.where(there, x, _ONE)
        y = ((safe.view(np.uint32) >> np.uint32(1)) + _HALF_EXPONENT).view(np.float32)
        for _ in range(4):
            y = _HALF * (y + safe / y)
        return np.asarray(np.where(there, y, np.float32(0.0)))

    def remaining(self, word: Any, gain: Any, blocks: NDArray[np.int64]) -> NumberArray:
        taken = np.array([self._taken(gain, int(n)) for n in np.asarray(blocks).reshape(-1)], dtype=np.float32)
        return np.asarray(word * (_ONE - taken))

    def _taken(self, gain: Any, blocks: int) -> Any:
        """Return the share of a difference that a memory has followed after some blocks."""
        factor, left = _ONE - gain, _ONE
        while blocks:
            if blocks & 1:
                left = left * factor
            factor = factor * factor
            blocks >>= 1
            if left <= np.float32(2.0**-30):
                blocks = 0
        return _ONE - left

    def unsettled(self, width: Any, low: NumberArray, high: NumberArray, word: Any) -> NumberArray:
        left = word * ((width + width) - (high - low))
        return np.asarray(np.where(left > 0, left, np.float32(0.0)))


class _Q31(Squares):
    def squared(self, x: NumberArray) -> NumberArray:
        magnitude = np.abs(self.limited(np.asarray(x, dtype=np.int64))).astype(np.uint64)
        return np.asarray(magnitude * magnitude)

    def plus(self, a: NumberArray, b: NumberArray) -> NumberArray:
        total = np.asarray(a + b)
        return np.where(total >= a, total, np.uint64(2**64 - 1))

    def per_c(self, a: NumberArray, b: Any, word: Any) -> NumberArray:
        return np.asarray(((a - b) * int(word)) >> 16)

    def times(self, k: NDArray[np.int64], x: Any) -> NumberArray:
        return np.asarray(np.asarray(k, dtype=np.int64) * x)

    def part(self, k: NDArray[np.int64], n: int, x: Any) -> NumberArray:
        product = self.times(k, x)
        return np.asarray(np.sign(product) * ((np.abs(product) + n // 2) // n))

    def limited(self, x: NumberArray) -> NumberArray:
        return np.asarray(np.clip(x, -_PART, _PART))

    def estimate(self, mean: NumberArray, start: NumberArray, blocks: NDArray[np.int64]) -> NumberArray:
        num, den = 2 * (mean - start), 2 * blocks - 1
        return np.asarray(np.sign(num) * ((np.abs(num) + den // 2) // den))

    def root(self, x: NumberArray) -> NumberArray:
        rest = np.atleast_1d(np.asarray(x, dtype=np.uint64)).copy()
        root = np.zeros_like(rest)
        for shift in range(62, -1, -2):
            bit = np.uint64(1 << shift)
            more = rest >= root + bit
            rest = np.where(more, rest - (root + bit), rest)
            root = np.where(more, (root >> np.uint64(1)) + bit, root >> np.uint64(1))
        return np.asarray(np.minimum(root, np.uint64(_LARGEST)).astype(np.int64).reshape(np.shape(x)))

    def remaining(self, word: Any, gain: Any, blocks: NDArray[np.int64]) -> NumberArray:
        left = [self._left(int(gain), int(n)) for n in np.asarray(blocks).reshape(-1)]
        return np.asarray((int(word) * np.array(left, dtype=np.int64)) >> 31)

    def _left(self, gain: int, blocks: int) -> int:
        """Return the share of a difference that a memory has not followed after some blocks, in 2^-31."""
        factor, left = _LARGEST - gain, _LARGEST
        while blocks:
            if blocks & 1:
                left = (left * factor) >> 31
            factor = (factor * factor) >> 31
            blocks >>= 1
        return left

    def unsettled(self, width: Any, low: NumberArray, high: NumberArray, word: Any) -> NumberArray:
        left = self.limited(2 * int(width) - (high - low))
        return np.asarray(np.where(left > 0, (left * int(word)) >> 16, 0))


SQUARES: dict[str, Squares] = {"f32": Squares(), "q31": _Q31()}


class Rule:
    """Places of the rules behind the grids, as in gtc_sigma.inl."""

    HOLD, REST, SLOPE, START, TURN, BEYOND, BEYOND_SLOPE, FALLBACK, NONE, BETWEEN, NOISE, CORRELATION = range(RULES)


@dataclass(frozen=True, slots=True)
class SigmaEvidence:
    """Facts that a state holds about its corrections, one entry each, in numbers of the table's arithmetic.

    Attributes:
        status: Of the correction.
        at, slope: Where the map was asked last.
        drift, sure: Slope as far as it is known, and whether it is.
        age: Blocks for which the correction is held.
        missing: Samples without a reading in the block that it was made of.
        samples: In a block.
        since: Blocks since the terms began.
        low, high: Of the temperatures that they saw since then.
        away: Of each term that reads a channel, where that is held, lost or beyond its range.
        edge: What terms add of readings at the edge of their range, beyond what they add without a reading.
    """

    status: NDArray[np.int32]
    at: NumberArray
    slope: NumberArray
    drift: NumberArray
    sure: NDArray[np.bool_]
    age: IntArray
    missing: IntArray
    samples: int
    since: IntArray
    low: NumberArray
    high: NumberArray
    away: tuple[NDArray[np.bool_], ...]
    edge: NumberArray

    def __len__(self) -> int:
        return int(self.status.size)


def evidence_of(
    table: Table, steps: Steps, course: Course, outcome: TermOutcome, status: NDArray[np.int32], samples: int
) -> SigmaEvidence:
    """The evidence of every correction of a history.

    Args:
        table: The table.
        steps: The corrections, at the temperatures of their blocks.
        course, outcome: The corrections as the terms see them, and what these make of them.
        status: Of every correction.
        samples: In a block.
    """
    n = steps.kind.size
    index = np.arange(n)
    is_made = steps.kind == FROM_MAP
    made = np.maximum.accumulate(np.where(is_made, index, 0))
    began = np.maximum.accumulate(np.where(steps.is_restart, index, 0))
    closings = np.cumsum(~steps.is_restart)
    blocks = np.minimum(closings - closings[began], table.slope_blocks)
    sure, drift = _drift(table, steps, began, blocks)
    kept = np.cumsum(~is_made)
    lost = int(table.guards[6]) + 1
    age = np.where(steps.kind == FALLEN, lost, np.minimum(kept - kept[made], lost))
    return SigmaEvidence(
        status=status,
        at=outcome.temperature[made],
        slope=outcome.slope[made],
        drift=drift[made],
        sure=sure[made],
        age=np.where(np.cumsum(is_made) > 0, age, 0),
        missing=np.where(np.cumsum(is_made) > 0, steps.missing[made], 0),
        samples=samples,
        since=course.elapsed - course.elapsed[began],
        low=_extremes(np.minimum, course, steps.is_restart),
        high=_extremes(np.maximum, course, steps.is_restart),
        away=tuple(of_term[made] for of_term in outcome.away),
        edge=outcome.edge[made],
    )


def _extremes(of: np.ufunc, course: Course, is_restart: NDArray[np.bool_]) -> NumberArray:
    """Lowest or highest temperature since the terms began last."""
    starts = np.flatnonzero(is_restart)
    parts = np.split(course.temperature, starts[starts > 0])
    return np.concatenate([of.accumulate(part) for part in parts])


def _drift(table: Table, steps: Steps, began: IntArray, blocks: IntArray) -> tuple[NDArray[np.bool_], NumberArray]:
    """Return a mask of known slopes, and the slopes: of the window, or from the start of the front end on."""
    warming = (steps.remarks & WARMING) != 0
    young = (blocks >= 2) & (blocks < table.slope_blocks)
    start = steps.temperature[began]
    estimate = SQUARES[table.numeric].estimate(steps.temperature, start, np.maximum(blocks, 1))
    return ~warming | young, np.where(warming & young, estimate, steps.slope)


def sigma_bits(table: Table, evidence: SigmaEvidence) -> Words:
    """Bits of 1 σ of every correction, the first one that before any reading is accepted.

    Args:
        table: A table with uncertainties.
        evidence: What is known of every correction.
    """
    do, constant = SQUARES[table.numeric], _rules(table)[Rule.BETWEEN]
    none = do.squared(_rules(table)[Rule.NONE : Rule.NONE + 1])
    squares = do.plus(np.concatenate([none, variances(table, evidence)]), do.squared(np.asarray([constant])))
    return table.bits(do.root(squares))


def variances(table: Table, evidence: SigmaEvidence) -> NumberArray:
    """Variance of every correction without that of the constant of the power-on."""
    do, rules = SQUARES[table.numeric], _rules(table)
    total = do.plus(_of_map(table, evidence), _of_age(table, evidence))
    total = do.plus(total, _of_slope(table, evidence))
    total = do.plus(total, do.plus(*(_beyond(table, evidence, k) for k in (0, 1))))
    terms = do.squared(evidence.edge)
    for part in _of_terms(table, evidence):
        terms = do.plus(terms, part)
    total = do.plus(total, terms)
    fallen = (evidence.status & FALLBACK) != 0
    return np.where(fallen, do.squared(rules[Rule.FALLBACK]), total)


def _rules(table: Table) -> NumberArray:
    """Rules, then the words of the terms."""
    cells = table.sigma_cells[0] * table.sigma_cells[1]
    return table.numbers(table.sigma)[table.sigma_grids * cells :]


def _of_map(table: Table, evidence: SigmaEvidence) -> NumberArray:
    low, high = table.numbers(table.envelope).reshape(2, 2).T
    is_late = ((evidence.status & WARMING) != 0) & evidence.sure
    slope = np.where(is_late, evidence.drift, evidence.slope)
    x = np.clip(np.stack([evidence.at, slope], axis=1), low, high)
    if table.numeric == "f32":
        cell = f32.cells(table, f32.normalise(table, x.astype(np.float32)), table.sigma_cells)
    else:
        cell = q31.cells(q31.normalise(table, x), table.sigma_cells)
    index = cell[:, 1] * table.sigma_cells[0] + cell[:, 0]
    uncovered = (evidence.status & UNCOVERED) != 0
    index = index + np.where(uncovered, table.sigma_cells[0] * table.sigma_cells[1], 0)
    return SQUARES[table.numeric].squared(table.numbers(table.sigma)[index])


def _of_age(table: Table, evidence: SigmaEvidence) -> NumberArray:
    do, rules = SQUARES[table.numeric], _rules(table)
    moved = do.limited(do.per_c(evidence.drift, rules.dtype.type(0), rules[Rule.HOLD]))
    gone = do.squared(_without_readings(do, evidence, moved))
    return np.asarray(do.plus(gone, do.squared(_without_readings(do, evidence, rules[Rule.REST]))))


def _without_readings(do: Squares, evidence: SigmaEvidence, x: Any) -> NumberArray:
    """Scale x, of a block, to the time that the correction is held and that its block lacks readings."""
    return np.asarray(do.times(evidence.age, x) + do.part(evidence.missing, evidence.samples, x))


def _of_slope(table: Table, evidence: SigmaEvidence) -> NumberArray:
    do, rules = SQUARES[table.numeric], _rules(table)
    known = do.squared(do.per_c(evidence.drift, rules.dtype.type(0), rules[Rule.SLOPE]))
    square = np.where(evidence.sure, known, do.squared(rules[Rule.START]))
    square = np.where((evidence.status & WARMING) != 0, square, np.zeros_like(square))
    return np.where(evidence.age != 0, do.squared(rules[Rule.TURN]), square)


def _beyond(table: Table, evidence: SigmaEvidence, k: int) -> NumberArray:
    do, rules = SQUARES[table.numeric], _rules(table)
    x = (evidence.at, evidence.slope)[k]
    low, high = table.numbers(table.envelope)[2 * k : 2 * k + 2]
    return do.squared(do.per_c(x, np.clip(x, low, high), rules[Rule.BEYOND + k]))


def _of_terms(table: Table, evidence: SigmaEvidence) -> Iterator[NumberArray]:
    """Yield the variances of terms: that of the time before one began, or of a channel that is not read."""
    do = SQUARES[table.numeric]
    words, away = _rules(table)[RULES:], iter(evidence.away)
    past = Past(evidence.since, evidence.low, evidence.high)
    for i, record in enumerate(table.records("terms")):
        first, word, kind = table.numbers(record[2:])[0], words[i], TableKind(int(record[0])).description
        if kind.reads_channel:
            yield np.where(next(away), do.squared(word), np.zeros_like(do.squared(word)))
        elif kind.past_sigma is not None:
            yield do.squared(kind.past_sigma(do, word, first, past))
