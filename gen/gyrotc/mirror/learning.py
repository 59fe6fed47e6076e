"""Learning in service: the mirror of libc/gtc_learn.c, for many axes at once; docs/numerics.md, section 9.

In float32 one numpy operation for each operation of the C text, in its order, so that the bits are the same; in
float64 the same filter, for the likelihood of a prior (`lot.service`). An array has an element for each axis; all axes
share the instants and temperatures of their stops.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import f32
from .samples import PLAUSIBLE_C
from .sigma import Squares

Numbers = NDArray[Any]  # of the learner's type: float32 or float64

KNOTS, STATES = 8, 13  # of include/gtc_learn.h, as all numbers here
KEPT_WORDS = 48  # id, counters, times, 8 + 36 numbers, CRC
_WARM_UP, _MEMORY, _MEMORY_SLOPE = 10, 11, 12  # places of states behind the knots, the offset and its slope
_DRAWN = 4  # states whose variance at power-on is in the prior
_KNOT_PAIRS, _PAIRS = 36, 91  # packed triangles of 8 and 13 rows
_LAYOUT = 0x47544C32  # where the CRC of kept words starts: libc/gtc_learn.c
_EXP2_UNITS = np.float32(float.fromhex("0x1.715476p+6"))  # 64 / ln 2
_AGREEING = 0.25  # two innovations that agree differ by at most this part of the later one
_LONGEST_S = 3.6e9  # a century in service: libc/gtc_learn.c
OK, DISAGREES, REFUSED, WRONG = 0, 64, -8, -1  # what gtc_learn_rest() returns
E_IMAGE, E_ID = -4, -5  # and gtc_learn_restore()

_ROWS, _COLUMNS = np.tril_indices(STATES)
_PAIR = np.zeros((STATES, STATES), dtype=np.int64)  # place of an element among the packed rows
_PAIR[_ROWS, _COLUMNS] = _PAIR[_COLUMNS, _ROWS] = np.arange(_PAIRS)


def packed(matrix: ArrayLike) -> NDArray[np.float64]:
    """Lower triangle of a symmetric matrix, row by row."""
    square = np.asarray(matrix, dtype=np.float64)
    return square[np.tril_indices(len(square))]


def full(rows: ArrayLike) -> NDArray[np.float64]:
    """The symmetric matrix of packed rows of the knots."""
    return np.asarray(rows, dtype=np.float64)[_PAIR[:KNOTS, :KNOTS]]


@dataclass(frozen=True)
class ServicePrior:
    """What is known of the type before a gyro learns: `gtc_learn_prior_t`, where the units stand."""

    id: int
    low_c: float
    knots_per_c: float
    reference_c: float
    authority_dph: float
    power_on_var: tuple[float, float, float, float]
    memory_per_c: float
    memory_per_s: float
    warm_up_per_s: float
    off_s: float
    noise_var: float
    noise_ratio: float
    span_c: float
    settle_s: float
    gate_square: float
    jump_square: float
    agreeing_rests: int
    agreeing_power_ons: int
    map_var: NDArray[np.float64] = field(repr=False)
    ageing_var: NDArray[np.float64] = field(repr=False)

    def members(self) -> dict[str, int | NDArray[np.float32]]:
        """Members of the struct in order: integers, and numbers as the target holds them."""
        found: dict[str, int | NDArray[np.float32]] = {}
        for one in fields(self):
            value = getattr(self, one.name)
            found[one.name] = value if isinstance(value, int) else np.atleast_1d(np.float32(value))
        return found

    def words(self) -> list[int]:
        """The struct's words in order."""
        found: list[int] = []
        for value in self.members().values():
            found += [value] if isinstance(value, int) else value.view(np.uint32).tolist()
        return found


@dataclass(frozen=True)
class Stop:
    """A stop of the vehicle: `gtc_learn_stop_t`; the rate has an element for each axis, or is the same for all."""

    time_s: float
    temp_c: float
    rate_dph: ArrayLike
    duration_s: float
    span_c: float = 0.0
    mean_var: float = 0.0
    earth_var: float = 0.0
    confirmed: bool = False


@dataclass(frozen=True)
class _Step:
    """From the last stop to an instant; `h` has the two knots, then the states behind the knots, of that instant."""

    elapsed_s: Any
    warm_up: Any
    memory: tuple[Any, Any, Any, Any]
    states: list[int]
    h: list[Any]


class Learner:
    """Axes that learn. `x`, shape (13, n), and packed `p`, shape (91, n); of memory and its slope `p` is less than the
    covariance by that of power-on.

    Attributes:
        innovation, innovation_var: Of the last stop that passed the gates before the innovation's, of each axis.
    """

    def __init__(self, prior: ServicePrior, axes: int = 1, number: Any = np.float32) -> None:
        self.prior, self.axes, self._number = prior, axes, number
        self._numbers = {one.name: number(getattr(prior, one.name)) for one in fields(prior) if one.type != "int"}
        self.x: Numbers = np.zeros((STATES, axes), dtype=number)
        self.p: Numbers = np.zeros((_PAIRS, axes), dtype=number)
        self.p[:_KNOT_PAIRS] = self._numbers["map_var"][:, None]
        self._draw(prior.reference_c)
        self.refused_dph: Numbers = np.zeros(axes, dtype=number)
        self.service_s = number(0.0)
        self.power_ons = 0
        self.since_refused = np.zeros(axes, dtype=np.int64)
        self.refused = np.zeros(axes, dtype=np.int64)
        self.innovation = self.innovation_var = np.zeros(axes, dtype=number)

    def power_on(self, off_s: float, temp_c: float) -> None:
        """After each switching on; `off_s` is NaN where it is not known."""
        known = 0.0 < off_s < _LONGEST_S
        self._age(self._number(off_s) if known else self._numbers["off_s"])
        self._draw(temp_c)
        self.power_ons += 1
        self.since_refused += 1

    def rest(self, stop: Stop) -> NDArray[np.int64]:
        """What `gtc_learn_rest` returns for each axis."""
        known = self._numbers
        noise = self._noise(stop)
        if not 0.0 < noise < np.inf:
            return np.full(self.axes, REFUSED)
        rate = np.broadcast_to(np.asarray(stop.rate_dph, dtype=self._number), (self.axes,))
        step = self._step(stop.time_s, stop.temp_c)
        self._propagate(step)
        self.time_s, self.temp_c = self._number(stop.time_s), self._number(stop.temp_c)
        states = step.states[:-1]
        expected, ph, var = self._expected(states, step.h)
        var = var + noise
        innovation = rate - expected
        square = innovation * innovation
        near = np.abs(rate) <= known["authority_dph"]
        beyond = near & ~(square <= known["gate_square"] * var)
        jump = beyond & (stop.confirmed | (square <= known["jump_square"] * var))
        agreed = self._agrees(innovation, beyond & ~jump)
        accepted = near & (~beyond | jump | agreed)
        if (jump | agreed).any():
            offset = _PAIR[KNOTS, KNOTS]
            self.p[offset] = np.where(jump, self.p[offset] + square, self.p[offset])
            self.p[:_KNOT_PAIRS] = np.where(agreed, self.p[:_KNOT_PAIRS] + square, self.p[:_KNOT_PAIRS])
            ph[KNOTS] = np.where(jump, ph[KNOTS] + square, ph[KNOTS])
            ph[:KNOTS] = np.where(agreed, ph[:KNOTS] + square, ph[:KNOTS])
            var = np.where(jump | agreed, var + square, var)
        self.refused_dph = np.where(accepted, self._number(0.0), self.refused_dph)
        self.innovation, self.innovation_var = innovation, var
        self._update(ph, var, innovation, accepted)
        return np.where(accepted, np.where(agreed, DISAGREES, OK), REFUSED)

    def shift(self, time_s: float, temp_c: float) -> tuple[Numbers, Numbers]:
        """Shift of the correction and its sigma, deg/h, of each axis."""
        step = self._step(time_s, temp_c)
        unlearned = self._unlearned_var(step)
        h = [*step.h[:4], step.warm_up, *step.memory[:2]]
        y, _, var = self._expected(step.states, h)
        lost = ~np.isfinite(y)
        y, var = np.where(lost, self._number(0.0), y), np.where(lost, unlearned, var)
        limit = self._numbers["authority_dph"]
        return self._within(y, -limit, limit), self._root(np.where(var < unlearned, var, unlearned))

    def save(self, axis: int = 0) -> list[int]:
        """The words that `gtc_learn_save` keeps."""
        service, refused = (int(x) for x in np.array([self.service_s, self.refused_dph[axis]]).view(np.uint32))
        counts = (self.power_ons & 0xFFFF) << 16 | (int(self.since_refused[axis]) & 255) << 8
        words = [self.prior.id, counts | int(self.refused[axis]) & 255]
        words.append((service + 0xFFFF) & 0xFFFF0000 | refused >> 16)
        for part in (self.x[:KNOTS, axis], self.p[:_KNOT_PAIRS, axis]):
            words += np.ascontiguousarray(part).view(np.uint32).tolist()
        return [*words, _crc(words)]

    def restore(self, words: Sequence[int]) -> int:
        """What `gtc_learn_restore` returns; every axis has what was kept then."""
        numbers = np.array(words[3:-1], dtype=np.uint32).view(np.float32)
        if words[-1] != _crc(words[:-1]) or not np.isfinite(numbers).all():
            return E_IMAGE
        if words[0] != self.prior.id:
            return E_ID
        self.__init__(self.prior, self.axes, self._number)  # type: ignore[misc]
        self.power_ons = words[1] >> 16
        self.since_refused[:], self.refused[:] = words[1] >> 8 & 255, words[1] & 255
        halves = np.array([words[2] & 0xFFFF0000, words[2] << 16 & 0xFFFFFFFF], dtype=np.uint32).view(np.float32)
        self.service_s, self.refused_dph[:] = halves
        limit = self._numbers["authority_dph"]
        self.x[:KNOTS] = self._within(numbers[:KNOTS, None], -limit, limit)
        self.p[:_KNOT_PAIRS] = numbers[KNOTS:, None]
        return OK

    def _draw(self, temp_c: float) -> None:
        """The states that are drawn at a power-on."""
        self.x[KNOTS:] = 0
        self.p[_KNOT_PAIRS:] = 0
        for state in range(KNOTS, _MEMORY):
            self.p[_PAIR[state, state]] = self._numbers["power_on_var"][state - KNOTS]
        self.time_s, self.temp_c = self._number(0.0), self._number(temp_c)

    def _noise(self, stop: Stop) -> Any:
        """Variance of a rest's mean; 0: it is not one to learn from."""
        known, number = self._numbers, self._number
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            least = known["noise_var"] / number(stop.duration_s)
            mean, earth = number(stop.mean_var), number(stop.earth_var)
            usable = (
                number(stop.time_s) >= known["settle_s"]
                and PLAUSIBLE_C[0] <= number(stop.temp_c) <= PLAUSIBLE_C[1]
                and number(stop.span_c) <= known["span_c"]
                and mean <= known["noise_ratio"] * least
                and earth >= 0.0
            )
            return (mean if mean > least else least) + earth if usable else number(0.0)

    def _age(self, time_s: Any) -> None:
        self.p[:_KNOT_PAIRS] = self.p[:_KNOT_PAIRS] + (self._numbers["ageing_var"] * time_s)[:, None]
        self.service_s = self.service_s + time_s

    def _step(self, time_s: float, temp_c: float) -> _Step:
        known, one = self._numbers, self._number(1.0)
        temp = self._number(temp_c)
        d_temp, length = temp - self.temp_c, known["memory_per_c"]
        way = length * np.abs(d_temp)
        dt = max(self._number(time_s) - self.time_s, self._number(0.0))
        left = self._exp_minus(way + dt * known["memory_per_s"])
        along = left * d_temp
        memory = (left + left * way, along, -(length * length) * along, left + left * -way)
        u = self._within((temp - known["low_c"]) * known["knots_per_c"], self._number(0.0), self._number(KNOTS - 1))
        k = min(int(u), KNOTS - 2)
        u = u - self._number(k)
        h = [one - u, u, one, temp - known["reference_c"], one, one, self._number(0.0)]
        return _Step(dt, self._exp_minus(dt * known["warm_up_per_s"]), memory, [k, k + 1, *range(KNOTS, STATES)], h)

    def _propagate(self, step: _Step) -> None:
        p, f = self.p, step.memory
        self._age(step.elapsed_s)
        warm_up, memory, slope = (_PAIR[state, : _WARM_UP + 1] for state in range(_WARM_UP, STATES))
        p[warm_up] = p[warm_up] * step.warm_up
        p[memory], p[slope] = _transformed(f, p[memory], p[slope])
        again = _PAIR[_WARM_UP:, _WARM_UP]
        p[again] = p[again] * step.warm_up
        own, cross, along = (p[_PAIR[i, j]].copy() for i, j in ((11, 11), (12, 11), (12, 12)))
        transposed, along = _transformed(f, cross, along)
        own, cross = _transformed(f, own, cross)
        own, _ = _transformed(f, own, transposed)
        cross, along = _transformed(f, cross, along)
        p[_PAIR[11, 11]], p[_PAIR[12, 11]], p[_PAIR[12, 12]] = own, cross, along
        self.x[_WARM_UP] = self.x[_WARM_UP] * step.warm_up
        self.x[_MEMORY], self.x[_MEMORY_SLOPE] = _transformed(f, self.x[_MEMORY], self.x[_MEMORY_SLOPE])

    def _expected(self, states: list[int], h: list[Any]) -> tuple[Numbers, Numbers, Numbers]:
        """h x, P h and h P h."""
        memory_var = self._numbers["power_on_var"][_MEMORY - KNOTS]
        ph = np.zeros_like(self.x)
        for state, factor in zip(states, h, strict=False):
            ph = ph + factor * self.p[_PAIR[state]]
        rate = var = np.zeros(self.axes, dtype=self._number)
        for state, factor in zip(states, h, strict=False):
            rate = rate + factor * self.x[state]
            var = var + factor * ph[state]
        ph[_MEMORY] = ph[_MEMORY] + memory_var
        var = var + memory_var
        return rate, ph, np.where(var < 0.0, self._number(0.0), var)

    def _unlearned_var(self, step: _Step) -> Any:
        known, h = self._numbers, step.h
        service_s = self._within(self.service_s + step.elapsed_s, self._number(0.0), self._number(_LONGEST_S))
        var = self._number(0.0)
        for k, (state, factor) in enumerate(zip(step.states[:2], h, strict=False)):
            pair = _PAIR[state, state]
            part = factor * (known["map_var"][pair] + known["ageing_var"][pair] * service_s)
            var = var + part if k else part
        for k in range(_DRAWN):
            var = var + (h[2 + k] * h[2 + k]) * known["power_on_var"][k]
        return var

    def _agrees(self, innovation: Numbers, refused: NDArray[np.bool_]) -> NDArray[np.bool_]:
        limit = self._number(_AGREEING) * np.abs(innovation)
        other = refused & ~(np.abs(innovation - self.refused_dph) <= limit)
        self.refused[other], self.since_refused[other] = 0, 0
        self.refused[refused] += 1
        self.refused_dph = np.where(refused, innovation, self.refused_dph)
        enough = self.refused >= self.prior.agreeing_rests
        return np.asarray(refused & enough & (self.since_refused >= self.prior.agreeing_power_ons))

    def _update(self, ph: Numbers, var: Numbers, innovation: Numbers, accepted: NDArray[np.bool_]) -> None:
        gain = ph / var
        self.p = np.where(accepted, self.p - gain[_ROWS] * ph[_COLUMNS], self.p)
        x = self.x + gain * innovation
        limit = self._numbers["authority_dph"]
        x[:KNOTS] = self._within(x[:KNOTS], -limit, limit)
        self.x = np.where(accepted, x, self.x)

    def _exp_minus(self, x: Any) -> Any:
        if self._number is not np.float32:
            return np.exp(-x)
        with np.errstate(under="ignore", over="ignore"):
            return f32.gauss(np.atleast_1d(x * _EXP2_UNITS))[0]

    def _root(self, x: Numbers) -> Numbers:
        return Squares().root(x) if self._number is np.float32 else np.sqrt(x)

    def _within(self, x: Any, least: Any, most: Any) -> Any:
        """The least for what is no number."""
        return np.where(x > most, most, np.where(x >= least, x, least))[()]


def _transformed(f: tuple[Any, Any, Any, Any], a: Numbers, b: Numbers) -> tuple[Numbers, Numbers]:
    return f[0] * a + f[1] * b, f[2] * a + f[3] * b


def _crc(words: Sequence[int]) -> int:
    data = b"".join(word.to_bytes(4, "little") for word in words)
    return zlib.crc32(data, _LAYOUT ^ 0xFFFFFFFF)
