"""Scales of charts: from a number to its place on an axis, and round numbers to write there."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..common.arrays import FloatArray
from .display import is_plain, power

_ROUND = (
    1.0,
    2.0,
    5.0,
    10.0,
    20.0,
)  # steps whose multiples people read at a glance; 10 begins the next decade


@dataclass(frozen=True, slots=True)
class AxisScale:
    """An axis from `low` to `high`; `exponent`: the power of ten that its numbers are written without.

    `linear_to`: 0: a linear axis; infinite: a logarithmic one; else linear up to there on both sides of zero.
    """

    low: float
    high: float
    linear_to: float = 0.0
    whole: bool = False

    @property
    def exponent(self) -> int:
        largest = max(abs(self.low), abs(self.high))
        if self.linear_to or largest == 0.0:
            return 0
        found = math.floor(math.log10(largest))
        return 0 if is_plain(found) else found

    def _stretched(self, values: FloatArray) -> FloatArray:
        if not self.linear_to:
            return values
        if math.isinf(self.linear_to):
            with np.errstate(divide="ignore", invalid="ignore"):
                return np.asarray(np.where(values > 0.0, np.log10(np.abs(values)), np.nan))
        edge, size = self.linear_to, np.abs(values)
        far = edge * (1.0 + np.log10(np.maximum(size, edge) / edge))
        return np.asarray(np.sign(values) * np.where(size > edge, far, size))

    def place(self, values: FloatArray) -> FloatArray:
        """Places of numbers: 0 at `low`, 1 at `high`; NaN where a logarithmic axis has none."""
        a, b = self._stretched(np.array([self.low, self.high]))
        return np.asarray((self._stretched(np.asarray(values, dtype=np.float64)) - a) / (b - a))

    def ticks(self, most: int) -> list[tuple[float, str]]:
        """At most about so many round numbers and how they are written."""
        if math.isinf(self.linear_to):
            return self._powers(most)
        if self.linear_to:
            return self._both(most)
        step = _step(self.low, self.high, most)
        if self.whole:
            step = max(round(step), 1.0)
        first, last = math.ceil(self.low / step - 1e-9), math.floor(self.high / step + 1e-9)
        scaled = step / 10.0**self.exponent
        digits = max(0, -math.floor(math.log10(scaled) + 1e-9))
        return [(k * step, _minus(f"{k * scaled:.{digits}f}")) for k in range(first, last + 1)]

    def _powers(self, most: int) -> list[tuple[float, str]]:
        a, b = math.log10(self.low), math.log10(self.high)
        decades = range(math.ceil(a - 1e-9), math.floor(b + 1e-9) + 1)
        if len(decades) > 2:
            every = max(math.ceil(len(decades) / most), 1)
            return [(10.0**k, _plain(10.0**k)) for k in decades if k % every == 0]
        numbers = [f * 10.0**k for k in range(math.floor(a), math.ceil(b) + 1) for f in _ROUND[:3]]
        return [(v, _plain(v)) for v in numbers if self.low * (1 - 1e-9) <= v <= self.high * (1 + 1e-9)]

    def _both(self, most: int) -> list[tuple[float, str]]:
        step = _step(0.0, self.linear_to, max(most // 2, 2))
        inner = [k * step for k in range(int(self.linear_to / step + 1e-9) + 1)]
        decades = range(math.ceil(math.log10(self.linear_to) + 1e-9), math.floor(math.log10(self.high)) + 1)
        return [(v, f"{v:g}") for v in (*inner, *(10.0**k for k in decades)) if self.low <= v <= self.high]


def _step(low: float, high: float, most: int) -> float:
    """The least round step of which at most one more than `most` lie in a range."""
    unit = 10.0 ** math.floor(math.log10((high - low) / (most + 1)))
    return next(
        f * unit for f in _ROUND if math.floor(high / (f * unit) + 1e-9) - math.ceil(low / (f * unit) - 1e-9) <= most
    )


def _minus(text: str) -> str:
    zero = not text.strip("-0.")
    return text.lstrip("-") if zero else text.replace("-", "−")


def _plain(value: float) -> str:
    exponent = math.floor(math.log10(value) + 1e-9)
    if is_plain(exponent):
        return f"{value:g}"
    mantissa = round(value / 10.0**exponent)
    return power(exponent) if mantissa == 1 else f"{mantissa}·{power(exponent)}"


def scale_of(
    numbers: FloatArray,
    limits: tuple[float | None, float | None],
    log: bool | float,
    margin: float,
    *,
    whole: bool = False,
) -> AxisScale:
    """The scale of an axis that has to hold these numbers.

    Args:
        numbers: Finite, shape (n,); n may be 0.
        limits: From and to, where they are given.
        log: Whether it is logarithmic; a number: linear up to there.
        margin: Room at either side, as a share of the range; none at a given limit.
        whole: Only whole numbers are written.
    """
    logarithmic = log is True
    if logarithmic:
        numbers = numbers[numbers > 0.0]
    low, high = (float(numbers.min()), float(numbers.max())) if numbers.size else (1.0, 10.0)
    low, high = (own if own is not None else found for own, found in zip(limits, (low, high), strict=True))
    if not high > low:
        around = 0.1 * abs(low) or 0.5
        low, high = (low / 2.0, low * 2.0) if logarithmic else (low - around, high + around)
    if logarithmic:
        more = (high / low) ** margin
        return AxisScale(
            low if limits[0] is not None else low / more,
            high if limits[1] is not None else high * more,
            math.inf,
        )
    room = margin * (high - low)
    low, high = low - room * (limits[0] is None), high + room * (limits[1] is None)
    return AxisScale(low, high, 0.0 if isinstance(log, bool) else log, whole)
