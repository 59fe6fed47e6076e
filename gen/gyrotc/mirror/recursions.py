"""Arithmetic and terms of the target: operations of front end and terms in float64, float32 and fixed point; the one
text of each recursion, and the operators with memory that they share.

`diagnose` runs it in float64 on training and test runs, `mirror.history` in float32 and in fixed point against the
compiled code. libc/gtc_terms.inl is the same in C; docs/numerics.md, section 8, says it in words.

A term sees the corrections of a history (`Course`) and changes what the map gets or adds to it (`Outcome`).
Only what depends on the order is done one correction after the other. Operations go element by element: `np.sum`, `@`
and the like may add in any order and are not used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..common.arrays import FloatArray
from .table import CLAMPED

Number = TypeVar("Number", bound=np.generic)

_UNIFORM = 1e-6  # largest departure of a row period from their mean that still counts as even, relative


def first_order(tau_s: float, time_s: FloatArray, driven: FloatArray) -> FloatArray:
    """tau dz/dt = driven − z, exact for an input linear between the samples; starts at rest on the first one.

    Args:
        tau_s: Time constant, s; 0 gives the input itself.
        time_s: Ascending times, s, shape (n,).
        driven: Input, shape (n,).

    Returns:
        z, shape (n,).
    """
    if tau_s == 0.0 or len(driven) < 2:
        return np.array(driven)
    x = np.diff(time_s) / tau_s
    lost = -np.expm1(-x)
    late = 1.0 - lost / x  # weight of an interval's end point
    forced = late * driven[1:] + (lost - late) * driven[:-1]
    if np.ptp(x) <= _UNIFORM * float(x.mean()):
        return _even_lag(1.0 - float(lost.mean()), np.concatenate((driven[:1], forced)))
    return _affine_scan(np.concatenate(([0.0], 1.0 - lost)), np.concatenate((driven[:1], forced)))


def _even_lag(decay: float, offset: FloatArray) -> FloatArray:
    """z_k = decay z_(k−1) + offset_k, as a triangular band of equations: `scipy.signal` takes 0.7 s to import."""
    from scipy.linalg.lapack import dtbtrs  # which commands that filter nothing need not spend time on

    band = np.empty((2, len(offset)))
    band[0], band[1] = 1.0, -decay
    return np.asarray(dtbtrs(band, offset[:, None], uplo="L", diag="U")[0][:, 0])


def _affine_scan(factor: FloatArray, offset: FloatArray) -> FloatArray:
    """z_k = factor_k z_(k−1) + offset_k for all k: affine maps composed over distances 1, 2, 4, ..."""
    step = 1
    while step < len(factor):
        offset = np.concatenate((offset[:step], offset[step:] + factor[step:] * offset[:-step]))
        factor = np.concatenate((factor[:step], factor[step:] * factor[:-step]))
        step *= 2
    return offset


def play(width: Any, temperature: NDArray[Number]) -> NDArray[Number]:
    """Play (backlash) operator z ← max(T − w, min(T + w, z)), from z = T on, shape (n,), in the type of T.

    A step clamps z to T ± w. Clamps composed are a clamp again, so they are composed over 1, 2, 4, ... steps:
    nothing is rounded but T ± w.
    """
    low, high = temperature - width, temperature + width
    step = 1
    while step < len(low):
        after_low, after_high = low[step:], high[step:]
        low = np.concatenate((low[:step], np.clip(low[:-step], after_low, after_high)))
        high = np.concatenate((high[:step], np.clip(high[:-step], after_low, after_high)))
        step *= 2
    return np.asarray(np.clip(temperature[0], low, high))


def delayed(shift_s: float, time_s: FloatArray, values: FloatArray) -> FloatArray:
    """values(t − shift), linear between samples; beyond the record its first and last value."""
    return np.interp(time_s - shift_s, time_s, values)


@dataclass(frozen=True, slots=True)
class Course:
    """The corrections of a history as terms see them, one entry each, in numbers of one arithmetic.

    Attributes:
        temperature: Mean of the block that ended (of the last valid block where it is not valid itself), or the
            sample that started the front end, shape (n,).
        closes: Whether a block ended; False: a sample started the front end, first or anew, shape (n,).
        elapsed: Blocks since power-on, negative before it, shape (n,).
    """

    temperature: NumberArray
    closes: NDArray[np.bool_]
    elapsed: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class CourseChannel:
    """An auxiliary channel at the corrections of a history, one entry each.

    Attributes:
        mean: Mean of its last block with enough readings, or what stands for it; NaN where nothing does, shape (n,).
        remarks: Status bits: held, lost, clamped, shape (n,).
        is_away: Where nothing of it is accepted, so that something stands for it, shape (n,).
        fallback_model: What its term adds then, shape (n,), needed there and where a reading is at the edge of its
            range; None: the effect of `mean`.
    """

    mean: NumberArray
    remarks: NDArray[np.int32]
    is_away: NDArray[np.bool_]
    fallback_model: NumberArray | None = None


@dataclass(slots=True)
class TermOutcome:
    """Inputs of the map for every correction (slope per block), additions to its result, and remarks as status bits.

    `away`: of each term that reads a channel, where that is held, lost or beyond its range. `edge`: what terms add of
    readings at the edge of their range, beyond what they add without a reading, as magnitudes.
    """

    temperature: NumberArray
    slope: NumberArray
    added: NumberArray
    remarks: NDArray[np.int32]
    away: list[NDArray[np.bool_]] = field(default_factory=list)
    edge: NumberArray = field(init=False)

    def __post_init__(self) -> None:
        self.edge = np.zeros_like(self.added)


class Recursion:
    """A term of one kind with its parameters, numbers of an arithmetic as docs/FORMAT.md, section 3, lists them."""

    def __init__(self, do: Operations, parameters: Sequence[Any]) -> None:
        self.do = do
        self.p = parameters

    def apply(self, course: Course, channel: CourseChannel | None, outcome: TermOutcome) -> None:
        """Change the outcome of every correction; `channel` is that of the term."""
        raise NotImplementedError


class MemoryRecursion(Recursion):
    """z <- z + gain (T - z) once a block, at rest on T where the front end starts; adds amplitude (z - T).

    Where rate is not 0 the map sees z and (T - z) rate instead of T and its slope.
    """

    def apply(self, course: Course, channel: CourseChannel | None, outcome: TermOutcome) -> None:
        _, amplitude, rate = self.p[:3]
        x, z = course.temperature, self.do.reading(self._states(course))
        if rate != 0:
            outcome.temperature, outcome.slope = z, self.do.slope_of(x, z, rate)
        outcome.added = outcome.added + self.do.scaled_difference(z, x, amplitude)

    def _states(self, course: Course) -> NumberArray:
        follow, gain, z = self.do.follow, self.p[0], None
        states = []
        for x, closes in zip(self.do.scalars(course.temperature), course.closes.tolist(), strict=True):
            z = follow(z, x, gain) if closes and z is not None else self.do.settle(x)
            states.append(z)
        return self.do.array(states)


class PlayRecursion(Recursion):
    """z <- max(T - width, min(T + width, z)) once a block, from T at a start.

    Adds (amplitude + growth (T - middle)) (z - T).
    """

    def apply(self, course: Course, channel: CourseChannel | None, outcome: TermOutcome) -> None:
        starts = np.union1d(np.flatnonzero(~course.closes), [0])[: course.closes.size]
        parts = np.split(course.temperature, starts[1:])
        width, amplitude, growth, middle = self.p[:4]
        z = np.concatenate([play(width, part) for part in parts])
        if growth != 0:
            amplitude = self.do.over_temperature(amplitude, growth, course.temperature, middle)
        outcome.added = outcome.added + self.do.scaled_difference(z, course.temperature, amplitude)


class WarmUpRecursion(Recursion):
    """Adds amplitude exp(-t/tau), t since power-on; gain is log2(e) blocks/tau."""

    def apply(self, course: Course, channel: CourseChannel | None, outcome: TermOutcome) -> None:
        outcome.added = outcome.added + self.do.fading(np.maximum(course.elapsed, 0), self.p[0], self.p[1])


class HarmonicRecursion(Recursion):
    """Adds amplitude cos(2 pi (T frequency + phase)), phase in turns."""

    def apply(self, course: Course, channel: CourseChannel | None, outcome: TermOutcome) -> None:
        outcome.added = outcome.added + self.do.wave(course.temperature, *self.p[:3])


class _OfChannel(Recursion):
    """Adds a function of what a channel shows, and of the temperature."""

    def apply(self, course: Course, channel: CourseChannel | None, outcome: TermOutcome) -> None:
        if channel is None:
            raise ValueError("a term of a channel without its channel")
        added = self._added(channel.mean, course.temperature)
        added = np.where(np.isnan(added), added.dtype.type(0), added)
        usual = np.zeros_like(added) if channel.fallback_model is None else channel.fallback_model
        beyond = np.where((channel.remarks & CLAMPED) != 0, np.abs(added - usual), np.zeros_like(added))
        outcome.edge = self.do.limited(outcome.edge + beyond)
        outcome.added = outcome.added + (
            added if channel.fallback_model is None else np.where(channel.is_away, channel.fallback_model, added)
        )
        outcome.remarks = outcome.remarks | channel.remarks
        outcome.away.append(channel.remarks != 0)

    def _added(self, mean: NumberArray, temperature: NumberArray) -> NumberArray:
        raise NotImplementedError


class AuxiliaryRecursion(_OfChannel):
    """Adds slope (mean - reference)."""

    def _added(self, mean: NumberArray, temperature: NumberArray) -> NumberArray:
        slope, reference = self.p[:2]
        return self.do.scaled_difference(mean, reference, slope)


class CurveRecursion(_OfChannel):
    """Adds slope (mean - reference) and two Gaussians of one gain, the first of them at the reference."""

    def _added(self, mean: NumberArray, temperature: NumberArray) -> NumberArray:
        slope, gain, reference, first, center, second = self.p[:6]
        x = self.do.limited(mean)
        line = self.do.scaled_difference(x, reference, slope)
        return np.asarray(line + self.do.bells(x, gain, ((reference, first), (center, second))))


class ProductRecursion(_OfChannel):
    """Adds (slope + growth (T - middle)) (mean - reference)."""

    def _added(self, mean: NumberArray, temperature: NumberArray) -> NumberArray:
        slope, reference, growth, middle = self.p[:4]
        return self.do.scaled_difference(mean, reference, self.do.over_temperature(slope, growth, temperature, middle))


NumberArray = NDArray[Any]
Bells = tuple[tuple[Any, Any], tuple[Any, Any]]


class Operations:
    """Operations of float64, one by one; those of the target, each rounded as there, are its subclasses."""

    def scalars(self, x: NumberArray) -> Sequence[Any]:
        """Numbers one by one, of the type that `follow` takes."""
        return list(x.tolist())

    def array(self, x: Sequence[Any]) -> NumberArray:
        return np.array(x, dtype=np.float64)

    def settle(self, x: Any) -> Any:
        """A memory at rest at x."""
        return x

    def follow(self, z: Any, x: Any, gain: Any) -> Any:
        """A memory after a block of mean x."""
        return z + gain * (x - z)

    def reading(self, z: NumberArray) -> NumberArray:
        """The numbers that a memory shows."""
        return z

    def scaled_difference(self, a: NumberArray, b: Any, factor: Any) -> NumberArray:
        return np.asarray(factor * (a - b))

    def over_temperature(self, value: Any, growth: Any, temperature: NumberArray, middle: Any) -> NumberArray:
        """A parameter that goes with the temperature: value + growth (T - middle)."""
        return self.limited(value + self.scaled_difference(temperature, middle, growth))

    def slope_of(self, a: NumberArray, b: NumberArray, rate: Any) -> NumberArray:
        """(a - b) rate, per block."""
        return self.scaled_difference(a, b, rate)

    def fading(self, blocks: NDArray[np.int64], gain: Any, amplitude: Any) -> NumberArray:
        """amplitude 2^-(blocks gain)."""
        return np.asarray(amplitude * np.exp2(-gain * blocks))

    def wave(self, x: NumberArray, frequency: Any, phase: Any, amplitude: Any) -> NumberArray:
        return np.asarray(amplitude * np.cos(2.0 * np.pi * (x * frequency + phase)))

    def limited(self, x: NumberArray) -> NumberArray:
        """The nearest number that may be multiplied."""
        return x

    def bells(self, x: NumberArray, gain: Any, bells: Bells) -> NumberArray:
        """Sum of weight 2^-((x - center) gain)^2 over two (center, weight)."""
        first, second = (weight * np.exp2(-(((x - center) * gain) ** 2)) for center, weight in bells)
        return np.asarray(first + second)


FLOAT64 = Operations()


_MISSING_Q31 = -(2**31)  # the word that fixed point has for no value (docs/FORMAT.md)


class Arithmetic:
    """Operations of float32 on temperatures; arrays broadcast, and every result is rounded as on the target.

    Fixed point has its own.
    """

    def numbers(self, x: ArrayLike) -> NumberArray:
        return np.asarray(x, dtype=np.float32)

    def missing(self, n: int) -> NumberArray:
        """n samples that did not arrive."""
        return np.full(n, np.nan, dtype=np.float32)

    def is_missing(self, x: NumberArray) -> NDArray[np.bool_]:
        return ~np.isfinite(x)

    def limit(self, max_step: Any, max_rate: Any, us: int) -> Any:
        """max_step + max_rate * time, in microseconds."""
        change = np.float32(max_rate) * np.float32(us)
        return np.float32(max_step) + change

    def is_near(self, a: Any, b: Any, limit: Any) -> Any:
        return np.abs(a - b) <= limit

    def running_sum(self, d: NumberArray) -> NumberArray:
        """Last of the running sums along axis 1, added from left to right."""
        # accumulate is sequential by definition: r[i] = r[i-1] + d[i]
        return np.asarray(np.add.accumulate(d, axis=1, dtype=np.float32)[:, -1])

    def mean(self, base: NumberArray, total: NumberArray, n: NDArray[np.int64]) -> NumberArray:
        quotient = total / n.astype(np.float32)
        return np.asarray(base + quotient)

    def slope(self, d: NumberArray, used: NDArray[np.bool_]) -> NumberArray:
        """Least-squares slope of differences d at abscissae 0, 1, ... where `used`; 0 where under two are.

        Args:
            d: Shape (abscissae, n).
            used: The same shape.
        """
        sum_d, sum_kd = np.zeros_like(d[0]), np.zeros_like(d[0])
        everywhere = used.all()
        for abscissa, one in enumerate(d):
            product = np.float32(abscissa) * one
            there = True if everywhere else used[abscissa]
            np.add(sum_d, one, out=sum_d, where=there)
            np.add(sum_kd, product, out=sum_kd, where=there)
        n, sum_k, sum_kk = moments(used)
        den = n * sum_kk - sum_k * sum_k
        first = n.astype(np.float32) * sum_kd
        second = sum_k.astype(np.float32) * sum_d
        num = first - second
        return np.asarray(num / np.where(den > 0, den, 1).astype(np.float32))


def moments(used: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """n, Σk, Σk² over the abscissae k = 0, 1, ... in use, shape (n,) each."""
    k = np.arange(len(used), dtype=np.int64)
    if used.all():  # as almost everywhere
        n, sum_k, sum_kk = (np.full(used.shape[1], total) for total in (k.size, k.sum(), (k * k).sum()))
        return n, sum_k, sum_kk
    return np.count_nonzero(used, axis=0), k @ used, (k * k) @ used


class _Q31(Arithmetic):
    """Temperatures in 2^-16 C, held in int64; every result fits 32 bits, sums and products 64."""

    def numbers(self, x: ArrayLike) -> NumberArray:
        return np.asarray(x, dtype=np.int64)

    def missing(self, n: int) -> NumberArray:
        return np.full(n, _MISSING_Q31, dtype=np.int64)

    def is_missing(self, x: NumberArray) -> NDArray[np.bool_]:
        return np.asarray(x == _MISSING_Q31)

    def limit(self, max_step: Any, max_rate: Any, us: int) -> Any:
        return min(int(max_step) + ((int(max_rate) * us) >> 24), 2**32 - 1)

    def running_sum(self, d: NumberArray) -> NumberArray:
        return np.asarray(np.add.accumulate(d, axis=1)[:, -1])

    def mean(self, base: NumberArray, total: NumberArray, n: NDArray[np.int64]) -> NumberArray:
        return np.asarray(base + divided(total, n))

    def slope(self, d: NumberArray, used: NDArray[np.bool_]) -> NumberArray:
        sum_d, sum_kd = np.zeros_like(d[0]), np.zeros_like(d[0])
        for abscissa, one in enumerate(d * used):
            sum_d += one
            sum_kd += abscissa * one
        n, sum_k, sum_kk = moments(used)
        den = n * sum_kk - sum_k * sum_k
        return divided(n * sum_kd - sum_k * sum_d, np.where(den > 0, den, 1))


def divided(num: Any, den: Any) -> NDArray[np.int64]:
    """num/den rounded to nearest, halves away from zero; den > 0."""
    magnitude = np.abs(num) + np.asarray(den) // 2
    return np.asarray(np.sign(num) * (magnitude // den))


F32 = Arithmetic()
Q31: Arithmetic = _Q31()
