"""Learning in service: the mirror of libc/gtc_learn.c, for many axes at once; docs/numerics.md, section 9.

One numpy operation for each operation of float32, in the order of the C text, so that the bits are the same. An array
has an element for each axis; all axes share the instants and temperatures of their stops.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import f32

__all__ = ["KEPT_WORDS", "KNOTS", "Learner", "ServicePrior", "Stop", "packed"]

Floats = NDArray[np.float32]

KNOTS, STATES = 8, 13  # of include/gtc_learn.h, as all numbers here
KEPT_WORDS = 48  # id, counters, 8 + 36 numbers, CRC
_OFFSET, _SLOPE, _WARM, _MEMORY, _ALONG = 8, 9, 10, 11, 12  # places of the states behind the knots
_KNOT_PAIRS, _PAIRS = 36, 91  # packed triangles of 8 and 13 rows
_LAYOUT = 0x47544C31  # of kept words: libc/gtc_learn.c
_EXP_UNITS = np.float32(float.fromhex("0x1.715476p+6"))  # 64 / ln 2
_ALIKE = np.float32(1.25)  # ratio of two innovations that agree
_ONE, _TWO, _HALF = np.float32(1.0), np.float32(2.0), np.float32(0.5)  # in float32, so that nothing widens
_SERIES = [
    np.float32(float.fromhex(c)) for c in ("0x1.24924ap-3", "0x1.555556p-3", "0x1.99999ap-3", "0x1p-2")
]
_THIRD = np.float32(float.fromhex("0x1.555556p-2"))  # of the series of 1 - exp(-x)
OK, DISAGREES, REFUSED, WRONG = 0, 64, -8, -1  # what gtc_learn_rest() returns


def _place(i: int, j: int) -> int:
    row, column = max(i, j), min(i, j)
    return row * (row + 1) // 2 + column


def packed(matrix: ArrayLike) -> Floats:
    """Lower triangle of a symmetric matrix, row by row, in float32."""
    full = np.asarray(matrix, dtype=np.float64)
    return full[np.tril_indices(len(full))].astype(np.float32)


@dataclass(frozen=True)
class ServicePrior:
    """What is known of the type before a gyro learns: `gtc_learn_prior_t`, where the units stand."""

    id: int
    low_c: float
    per_knot: float
    center_c: float
    authority_dph: float
    offset_var: float
    slope_var: float
    warm_var: float
    memory_var: float
    memory_per_c: float
    forget_per_s: float
    warm_per_s: float
    off_h: float
    noise_var: float
    noisy: float
    span_c: float
    settle_s: float
    gate: float
    open_gate: float
    agreeing: int
    power_ons: int
    map_var: Floats = field(repr=False)
    ageing_var: Floats = field(repr=False)

    def number(self, name: str) -> np.float32:
        value: np.float32 = np.float32(getattr(self, name))
        return value

    def words(self) -> list[int]:
        """The struct's words in order."""
        found: list[int] = []
        for one in fields(self):
            value = getattr(self, one.name)
            if isinstance(value, int):
                found.append(value)
            else:
                found += np.atleast_1d(np.asarray(value, dtype=np.float32)).view(np.uint32).tolist()
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
    sure: bool = False


def _decay(x: Any) -> Floats:
    with np.errstate(under="ignore", over="ignore"):
        return f32.gauss(np.atleast_1d(np.asarray(x * _EXP_UNITS, dtype=np.float32)))


def _root(x: Floats) -> Floats:
    from .sigma import Squares

    return Squares().root(x)


def _saturated(x: Floats, limit: np.float32) -> Floats:
    y = np.where(x > limit, limit, x)
    return np.asarray(np.where(y < -limit, -limit, y))


def _risen(x: np.float32) -> np.float32:
    if x < np.float32(0.0625):
        y = (_ONE - x * np.float32(0.25)) * _THIRD
        y = (_ONE - x * y) * _HALF
        risen: np.float32 = x * (_ONE - x * y)
    else:
        risen = _ONE - _decay(x)[0]
    return risen


@dataclass(frozen=True)
class _Step:
    hours: np.float32
    warm: np.float32
    f: tuple[np.float32, np.float32, np.float32, np.float32]
    q: tuple[np.float32, np.float32, np.float32]
    seen: tuple[int, ...]
    h: list[np.float32]


def _memory(prior: ServicePrior, dt: np.float32, d_temp: np.float32) -> tuple[Any, Any]:
    length = prior.number("memory_per_c")
    way = length * np.abs(d_temp)
    kept = _decay(way)[0]
    forgotten = dt * prior.number("forget_per_s")
    both = _decay(forgotten)[0] * kept
    u = way + way
    kept2 = kept * kept
    lost2 = _risen(forgotten + forgotten)
    left2 = _ONE - lost2
    var, l2 = prior.number("memory_var"), length * length
    f01 = both * d_temp
    f = (both * (_ONE + way), f01, -l2 * f01, both * (_ONE - way))
    if u < _ONE:
        s = _ONE + u * np.float32(0.125)
        for part in _SERIES:
            s = _ONE + (u * part) * s
        s = (((u * u) * u) * _SERIES[1]) * s
        own, along = kept2 * s, kept2 * ((u + u) + s)
    else:
        half = (u * u) * _HALF
        own = _ONE - kept2 * ((_ONE + u) + half)
        along = _ONE - kept2 * ((_ONE - u) + half)
    cross = (kept2 * u) * (l2 * d_temp)
    q = (var * (lost2 + left2 * own), var * (left2 * cross), (var * l2) * (lost2 + left2 * along))
    return f, q


class Learner:
    """Axes that learn. `x`, shape (13, n), and packed `p`, shape (91, n), are float32."""

    def __init__(self, prior: ServicePrior, axes: int = 1) -> None:
        self.prior, self.axes = prior, axes
        self.x: Floats = np.zeros((STATES, axes), dtype=np.float32)
        self.p: Floats = np.zeros((_PAIRS, axes), dtype=np.float32)
        self.p[:_KNOT_PAIRS] = prior.map_var[:, None]
        self.time_s, self.temp_c = np.float32(0.0), prior.number("center_c")
        self.refused_dph: Floats = np.zeros(axes, dtype=np.float32)
        self.hours = np.float32(0.0)
        self.power_ons = 0
        self.first_refused = np.zeros(axes, dtype=np.int64)
        self.refused = np.zeros(axes, dtype=np.int64)

    def power_on(self, off_h: float, temp_c: float) -> None:
        """After each switching on; `off_h` is NaN where it is not known."""
        prior = self.prior
        self._age(np.float32(off_h) if np.isfinite(off_h) and off_h > 0 else prior.number("off_h"))
        self.x[KNOTS:] = 0
        self.p[_KNOT_PAIRS:] = 0
        var, length = prior.number("memory_var"), prior.number("memory_per_c")
        for state, value in (
            (_OFFSET, prior.number("offset_var")), (_SLOPE, prior.number("slope_var")),
            (_WARM, prior.number("warm_var")), (_MEMORY, var), (_ALONG, (var * length) * length),
        ):  # fmt: skip
            self.p[_place(state, state)] = value
        self.time_s, self.temp_c = np.float32(0.0), np.float32(temp_c)
        self.power_ons = (self.power_ons + 1) & 0xFFFF

    def rest(self, stop: Stop) -> NDArray[np.int64]:
        """What `gtc_learn_rest` returns for each axis."""
        prior = self.prior
        noise = self._noise(stop)
        if noise is None:
            return np.full(self.axes, REFUSED)
        rate = np.broadcast_to(np.asarray(stop.rate_dph, dtype=np.float32), (self.axes,))
        gate, opened = prior.number("gate"), prior.number("open_gate")
        limit = prior.number("authority_dph") + gate * _root(np.atleast_1d(noise))[0]
        step = self._step(np.float32(stop.time_s), np.float32(stop.temp_c))
        self._propagate(step)
        self.time_s, self.temp_c = np.float32(stop.time_s), np.float32(stop.temp_c)
        near = ~(np.abs(rate) > limit)
        h = [*step.h[:4], _ONE, _ONE]
        ph, var = self._spread(step.seen[:6], h)
        var = var + noise
        innovation = rate - self._expected(step.seen[:6], h)
        square = innovation * innovation
        big = near & (square > (gate * gate) * var)
        soft = big & (stop.sure | ~(square > (opened * opened) * var))
        agreed = self._agrees(innovation, big & ~soft)
        accepted = near & (~big | soft | agreed)
        self._open(innovation, soft | agreed, agreed)
        if (soft | agreed).any():
            ph, var = self._spread(step.seen[:6], h)
            var = var + noise
        self.refused[accepted] = 0
        self._update(ph, var, innovation, accepted)
        return np.where(accepted, np.where(agreed, DISAGREES, OK), REFUSED)

    def shift(self, time_s: float, temp_c: float) -> tuple[Floats, Floats]:
        """Shift of the correction and its sigma, deg/h, of each axis."""
        step = self._step(np.float32(time_s), np.float32(temp_c))
        y = self._expected(step.seen, step.h)
        var = self._spread(step.seen, step.h)[1] + step.q[0]
        before = self._prior_variance(step, np.float32(time_s))
        var = np.where(var < before, var, before)
        lost = ~np.isfinite(y)
        y, var = np.where(lost, np.float32(0.0), y), np.where(lost, before, var)
        return _saturated(y, self.prior.number("authority_dph")), _root(np.asarray(var, dtype=np.float32))

    def save(self, axis: int = 0) -> list[int]:
        """The words that `gtc_learn_save` keeps."""
        since = min((self.power_ons - int(self.first_refused[axis])) & 0xFFFF, 255)
        refused = int(self.refused_dph[axis : axis + 1].view(np.uint32)[0])
        days = min(int(np.ceil(self.hours / np.float32(24.0))), 65535)
        counts = since << 24 | int(self.refused[axis]) << 16 | days
        words = [self.prior.id, self.power_ons << 16 | refused >> 16, counts]
        for part in (self.x[:KNOTS, axis], self.p[:_KNOT_PAIRS, axis]):
            words += np.ascontiguousarray(part).view(np.uint32).tolist()
        data = b"".join(word.to_bytes(4, "little") for word in [_LAYOUT, *words])
        return [*words, zlib.crc32(data)]

    def _noise(self, stop: Stop) -> np.float32 | None:
        prior = self.prior
        var = prior.number("noise_var") / np.float32(stop.duration_s)
        mean = np.float32(stop.mean_var)
        if (
            np.float32(stop.time_s) < prior.number("settle_s")
            or np.float32(stop.span_c) > prior.number("span_c")
            or not np.isfinite(stop.earth_var)
            or mean > prior.number("noisy") * var
        ):
            return None
        total: np.float32 = max(mean, var) + np.float32(stop.earth_var)
        return total

    def _age(self, hours: np.float32) -> None:
        self.p[:_KNOT_PAIRS] = self.p[:_KNOT_PAIRS] + (self.prior.ageing_var * hours)[:, None]
        self.hours = np.float32(self.hours + hours)

    def _step(self, time_s: np.float32, temp_c: np.float32) -> _Step:
        prior = self.prior
        dt = max(np.float32(time_s - self.time_s), np.float32(0.0))
        warm = _decay(dt * prior.number("warm_per_s"))[0]
        f, q = _memory(prior, dt, np.float32(temp_c - self.temp_c))
        u = (temp_c - prior.number("low_c")) * prior.number("per_knot")
        u = min(max(u, np.float32(0.0)), np.float32(KNOTS - 1))
        k = min(int(u), KNOTS - 2)
        u = np.float32(u - np.float32(k))
        seen = (k, k + 1, _OFFSET, _SLOPE, _WARM, _MEMORY, _ALONG)
        h = [_ONE - u, u, _ONE, np.float32(temp_c - prior.number("center_c")), warm, f[0], f[1]]
        return _Step(np.float32(dt / np.float32(3600.0)), warm, f, q, seen, h)

    def _propagate(self, step: _Step) -> None:
        p, (f00, f01, f10, f11) = self.p, step.f
        self._age(step.hours)
        for j in range(STATES):
            p[_place(_WARM, j)] = p[_place(_WARM, j)] * step.warm
        p[_place(_WARM, _WARM)] = p[_place(_WARM, _WARM)] * step.warm
        self.x[_WARM] = self.x[_WARM] * step.warm
        for j in range(_MEMORY):
            a, b = p[_place(_MEMORY, j)].copy(), p[_place(_ALONG, j)].copy()
            p[_place(_MEMORY, j)] = f00 * a + f01 * b
            p[_place(_ALONG, j)] = f10 * a + f11 * b
        own, cross, along = (p[_place(*ij)].copy() for ij in ((11, 11), (12, 11), (12, 12)))
        a, b = f00 * own + f01 * cross, f00 * cross + f01 * along
        c, d = f10 * own + f11 * cross, f10 * cross + f11 * along
        p[_place(_MEMORY, _MEMORY)] = (a * f00 + b * f01) + step.q[0]
        p[_place(_ALONG, _MEMORY)] = (c * f00 + d * f01) + step.q[1]
        p[_place(_ALONG, _ALONG)] = (c * f10 + d * f11) + step.q[2]
        a, b = self.x[_MEMORY].copy(), self.x[_ALONG].copy()
        self.x[_MEMORY] = f00 * a + f01 * b
        self.x[_ALONG] = f10 * a + f11 * b

    def _spread(self, seen: tuple[int, ...], h: list[np.float32]) -> tuple[Floats, Floats]:
        ph = np.zeros((STATES, self.axes), dtype=np.float32)
        for j in range(STATES):
            for factor, k in zip(h, seen, strict=True):
                ph[j] = ph[j] + factor * self.p[_place(j, k)]
        var = np.zeros(self.axes, dtype=np.float32)
        for factor, k in zip(h, seen, strict=True):
            var = var + factor * ph[k]
        return ph, var

    def _expected(self, seen: tuple[int, ...], h: list[np.float32]) -> Floats:
        y = np.zeros(self.axes, dtype=np.float32)
        for factor, k in zip(h, seen, strict=True):
            y = y + factor * self.x[k]
        return y

    def _prior_variance(self, step: _Step, time_s: np.float32) -> np.float32:
        prior, k = self.prior, step.seen[0]
        warm = _decay(time_s * prior.number("warm_per_s"))[0]
        h, pairs = step.h, prior.map_var + prior.ageing_var * (self.hours + step.hours)
        var = (h[0] * h[0]) * pairs[_place(k, k)]
        var = var + ((h[0] * h[1]) * _TWO) * pairs[_place(k + 1, k)]
        var = var + (h[1] * h[1]) * pairs[_place(k + 1, k + 1)]
        var = var + prior.number("offset_var")
        var = var + (h[3] * h[3]) * prior.number("slope_var")
        var = var + (warm * warm) * prior.number("warm_var")
        total: np.float32 = var + prior.number("memory_var")
        return total

    def _agrees(self, innovation: Floats, refused: NDArray[np.bool_]) -> NDArray[np.bool_]:
        now, before = np.abs(innovation), np.abs(self.refused_dph)
        with np.errstate(under="ignore"):
            alike = (self.refused != 0) & (innovation * self.refused_dph > 0)
        alike &= (now < before * _ALIKE) & (before < now * _ALIKE)
        fresh = refused & ~alike
        self.refused[fresh], self.first_refused[fresh] = 0, self.power_ons
        self.refused[refused] = np.minimum(self.refused[refused] + 1, 255)
        self.refused_dph[refused] = innovation[refused]
        spread = (self.power_ons - self.first_refused) & 0xFFFF
        needed = self.prior.agreeing
        enough = (needed != 0) & (self.refused >= needed) & (spread + 1 >= self.prior.power_ons)
        return np.asarray(refused & enough)

    def _open(self, innovation: Floats, opened: NDArray[np.bool_], level: NDArray[np.bool_]) -> None:
        length = self.prior.number("memory_per_c")
        square = innovation * innovation
        for state, value in ((_MEMORY, square), (_ALONG, (square * length) * length)):
            k = _place(state, state)
            self.p[k] = np.where(opened, self.p[k] + value, self.p[k])
        self.p[:_KNOT_PAIRS] = np.where(level, self.p[:_KNOT_PAIRS] + square, self.p[:_KNOT_PAIRS])

    def _update(self, ph: Floats, var: Floats, innovation: Floats, accepted: NDArray[np.bool_]) -> None:
        inverse = _ONE / var
        for i in range(STATES):
            gain = ph[i] * inverse
            self.x[i] = np.where(accepted, self.x[i] + gain * innovation, self.x[i])
            for j in range(i + 1):
                k = _place(i, j)
                self.p[k] = np.where(accepted, self.p[k] - gain * ph[j], self.p[k])
            k = _place(i, i)
            self.p[k] = np.where(accepted & ~(self.p[k] > 0), np.float32(0.0), self.p[k])
        knots = _saturated(self.x[:KNOTS], self.prior.number("authority_dph"))
        self.x[:KNOTS] = np.where(accepted, knots, self.x[:KNOTS])
