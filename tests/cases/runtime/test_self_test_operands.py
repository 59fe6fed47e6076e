"""What the self-test of the float32 arithmetic can find: each fault that it is for changes the CRC of its results.

The operations are computed here from exact fractions, so that a fault can be put into one rounding or sum at a time.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
import pytest
from conftest import ROOT

TEXT = (ROOT / "libc" / "gtc_selftest_f32.h").read_text(encoding="ascii")
LEAST_NORMAL = Fraction(2) ** -126
ROUND = np.float32(12582912.0)  # F32_ROUND, 1.5 2^23

Float = np.float32
Pair = tuple[Float, Float]
ZERO = Float(0)


def _rows(name: str) -> list[list[Float]]:
    body = re.search(rf"{name}\[.*?\n\}};\n", TEXT, re.DOTALL)
    assert body is not None
    return [[_number(int(w, 16)) for w in re.findall(r"0x([0-9A-F]{8})UL", row)] for row in body[0].split("\n")[1:-2]]


def _number(bits: int) -> Float:
    return Float(struct.unpack("<f", struct.pack("<I", bits))[0])


def _bits(x: Float) -> int:
    return int(np.asarray(x, dtype=np.float32).view(np.uint32))


def to_even(quotient: int, rest: Fraction) -> int:
    """Return which of the two neighbouring whole numbers a magnitude is rounded to."""
    return quotient + (rest > Fraction(1, 2) or (rest == Fraction(1, 2) and quotient % 2 == 1))


def away_on_ties(quotient: int, rest: Fraction) -> int:
    return quotient + (rest >= Fraction(1, 2))


def down_on_ties(quotient: int, rest: Fraction) -> int:
    return quotient + (rest > Fraction(1, 2))


def cut_off(quotient: int, _rest: Fraction) -> int:
    return quotient


@dataclass(frozen=True)
class Arithmetic:
    """A float32 arithmetic, right or with a fault.

    Args:
        rounding: How magnitudes are rounded.
        flushes_results: Subnormal results become 0.
        flushes_operands: So do subnormal operands.
        fused: Places of products that are added without being rounded.
        regrouped: Places of sums that are taken in another order.
        to_integer: Conversion of a positive float to an integer.
    """

    rounding: Callable[[int, Fraction], int] = to_even
    flushes_results: bool = False
    flushes_operands: bool = False
    fused: frozenset[str] = frozenset()
    regrouped: frozenset[str] = frozenset()
    to_integer: Callable[[Float], int] = int

    def rounded(self, exact: Fraction, zero: Float = ZERO) -> Float:
        """Return the float32 of an exact result; `zero` is the one of its sign if that is 0."""
        if exact == 0:
            return zero
        magnitude = abs(exact)
        octave = magnitude.numerator.bit_length() - magnitude.denominator.bit_length()
        unit = Fraction(2) ** max(octave - 24, -149)
        while magnitude >= unit * 2**24:
            unit *= 2
        quotient = magnitude // unit
        whole = self.rounding(int(quotient), magnitude / unit - quotient) * unit
        if self.flushes_results and whole < LEAST_NORMAL:
            whole = Fraction(0)
        return np.copysign(Float(float(whole)), Float(-1 if exact < 0 else 1))

    def operand(self, x: Float) -> Float:
        return np.copysign(ZERO, x) if self.flushes_operands and abs(Fraction(float(x))) < LEAST_NORMAL else x

    def add(self, x: Float, y: Float) -> Float:
        x, y = self.operand(x), self.operand(y)
        return self.rounded(Fraction(float(x)) + Fraction(float(y)), x + y)

    def multiply(self, x: Float, y: Float) -> Float:
        x, y = self.operand(x), self.operand(y)
        return self.rounded(Fraction(float(x)) * Fraction(float(y)), x * y)

    def divide(self, x: Float, y: Float) -> Float:
        x, y = self.operand(x), self.operand(y)
        return self.rounded(Fraction(float(x)) / Fraction(float(y)), x / y)

    def product_sum(self, place: str, x: Float, y: Float, other: Float, sign: int = 1) -> Float:
        """Return sign x y + other, with the product rounded first but at a fused place."""
        if place in self.fused:
            return self.rounded(sign * Fraction(float(x)) * Fraction(float(y)) + Fraction(float(other)))
        return self.add(Float(sign) * self.multiply(x, y), other)

    def sum_of_products(self, first: str, second: str, one: Pair, other: Pair) -> Float:
        """Return the sum of two products; the one that the name of a fused place begins with is not rounded."""
        if second in self.fused:
            one, other, first = other, one, second
        return self.product_sum(first, *one, self.multiply(*other))

    def results(self) -> list[int]:
        """Return the bits of all results in the order of their CRC."""
        found = [
            _bits(self.rounded(Fraction(16777217))),
            _bits(self.rounded(Fraction(16777219))),
            self.to_integer(_number(0x44FFFFFF)),
            self.to_integer(_number(0x3F7FFFFF)),
        ]
        for a, b, c in _rows("operands"):
            values = [self.add(a, b), self.add(a, -b), self.multiply(a, b), self.divide(a, b)]
            values += [self.product_sum("a b + c", a, b, c), self.product_sum("c - a b", a, b, c, -1)]
            found += [_bits(x) for x in values]
        for row in _rows("joined"):
            found += [_bits(x) for x in self._joined(*row)]
        return found

    def _joined(self, a: Float, b: Float, c: Float, d: Float) -> list[Float]:
        eight = Float(8)
        shifted = self.product_sum("a b + 8", a, b, eight)
        back = self.add(self.add(a, ROUND), -ROUND)
        return [
            self.product_sum("row: a b + c", a, b, c),
            self.product_sum("row: a b - c", a, b, -c),
            self.product_sum("row: c - a b", a, b, c, -1),
            self.sum_of_products("a b + c d", "c d + a b", (a, b), (c, d)),
            self.sum_of_products("a^2 + b^2", "b^2 + a^2", (a, a), (b, b)),
            self.multiply(d, self.product_sum("a^2 + c", a, a, c)),
            self.multiply(a, b) if "a b" in self.regrouped else self.add(shifted, -eight),
            ZERO if "a - a" in self.regrouped else self.add(a, -back),
        ]

    def crc(self) -> int:
        words = self.results()
        return zlib.crc32(struct.pack(f"<{len(words)}I", *words))


RIGHT = Arithmetic()
EXPECTED = int(re.findall(r"#define RESULTS_CRC 0x([0-9A-F]{8})UL", TEXT)[0], 16)
PRODUCTS = (
    "a b + c", "c - a b", "row: a b + c", "row: a b - c", "row: c - a b", "a b + c d", "c d + a b", "a^2 + b^2",
    "b^2 + a^2", "a^2 + c", "a b + 8",
)  # fmt: skip
FAULTS = {
    **{f"fused: {place}": replace(RIGHT, fused=frozenset({place})) for place in PRODUCTS},
    **{f"regrouped: {place}": replace(RIGHT, regrouped=frozenset({place})) for place in ("a b", "a - a")},
    "ties away from 0": replace(RIGHT, rounding=away_on_ties),
    "ties towards 0": replace(RIGHT, rounding=down_on_ties),
    "cut off": replace(RIGHT, rounding=cut_off),
    "subnormal results flushed": replace(RIGHT, flushes_results=True),
    "subnormal operands flushed": replace(RIGHT, flushes_operands=True),
    "to integer rounds": replace(RIGHT, to_integer=lambda x: round(float(x))),
}


def test_the_results_of_ieee_float32_have_the_expected_crc() -> None:
    assert RIGHT.crc() == EXPECTED


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_the_arithmetic_has_another_crc(fault: str) -> None:
    assert FAULTS[fault].crc() != EXPECTED
