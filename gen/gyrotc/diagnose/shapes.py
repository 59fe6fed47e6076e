"""Shapes that no cause has, against which causes have to hold their own.

A flexible cause can imitate much of an effect that is none: a lag of the whole map comes near every memory
of the temperature, however it acts. So causes have to hold their own against general classes of other
mechanisms: memory that acts other than in proportion or differs by direction, switches, any smooth function of T and
of a state that the temperatures so far have left (a memory, gathered heat, creep, the time since power-on), a course
of time in each run. The weights of a wide class have one common variance, which is estimated: what the data do not
ask for costs nothing. Where one of these explains the recordings better, the structure is unexplained.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..causes.base import History
from ..common.arrays import FloatArray
from ..mirror.recursions import first_order
from .blocks import Records, centred_slope

_LAGS_S = (300.0, 900.0, 2700.0, 8000.0)  # in steps of a factor 3: functions of these hold those between
_HEATS_S = (2e4, 8e4)  # as long as a day: what heat has done so far
_TWO_SIDED_S = ((300.0, 1800.0), (1800.0, 300.0), (3000.0, 900.0), (900.0, 5000.0))  # up, down
_TAUS_S = tuple(np.geomspace(150.0, 4000.0, 8))  # in steps of a factor 1.6: memories nearer than that are alike
_EDGES = (0.6, 1.3)  # thresholds, in standard deviations of T − z
_QUICK_S = tuple(np.geomspace(120.0, 1500.0, 7))  # time constant of the quicker direction
_SLOWER = (3.0, 7.0)  # by which factor the other direction is slower
_MOVED_S, _RATE_S, _SETTLING_S = (1200.0, 4000.0), 600.0, 600.0  # between those of lags
_PLACES, _OVER_T = 6, 5  # of smooth functions of a state, and of T
_COURSES_S = (1800.0, 4500.0)  # distances of smooth functions of time
_SWITCH_C, _GAPS_C = 6.0, (10.0, 20.0)  # steps of the upper threshold; width between the thresholds
_HAT_C = 3.5  # width of the local functions of a map that a switch changes
_GRAIN_S = 200.0  # time after which creep becomes logarithmic
_TURNING = 0.05  # C/min that count as moving


@dataclass(frozen=True)
class Shape:
    """One alternative.

    Attributes:
        name: In words, for the report.
        parameters: Number of nonlinear parameters.
        columns: Block means, shape (N, k).
        common: Whether the weights have one common variance (many columns) or are free (few).
        texture: Whether functions of T as fine as those of a finer map are among them.
    """

    name: str
    parameters: int
    columns: FloatArray
    common: bool = False
    texture: bool = False


def shapes_of(records: Records) -> Iterator[Shape]:
    """All alternatives for these recordings."""
    t = records.columns(lambda h: h.temperature_c)
    over_t = np.column_stack([np.ones_like(t), _smooth(t, _OVER_T)])
    for name, values in _states(records):
        state = records.average(values)
        spread = float(state.std())
        if spread > 1e-9 * float(np.abs(state).max() + 1e-300):
            state = (state - state.mean()) / spread
            own = np.column_stack([state, _smooth(state, _PLACES)])
            yield Shape(name, 1, (own[:, :, None] * over_t[:, None, :]).reshape(t.size, -1), common=True)
    yield from _nonlinear(records)
    yield from _one_sided(records)
    for distance in _COURSES_S:
        yield Shape("a course of time of each run of its own", 1, _courses(records, distance), common=True)
    yield from _switched(records)


def _states(records: Records) -> Iterator[tuple[str, list[FloatArray]]]:
    """Yield states that temperatures so far may have left, by row of each run; each acts by a smooth function."""
    runs = [run.history for run in records.runs]
    rates = [centred_slope(h) for h in runs]
    low = min(float(h.temperature_c.min()) for h in runs)
    for tau in _LAGS_S:
        yield "another memory of the temperature", [late(h, tau) for h in runs]
    for up, down in _TWO_SIDED_S:
        yield "memory that differs between warming and cooling", [two_sided_lag(h, up, down) for h in runs]
    yield "a memory of dT/dt", [first_order(_RATE_S, h.time_s, r) for h, r in zip(runs, rates, strict=True)]
    for tau in _HEATS_S:
        yield "what heat has done so far", [_gathered(h, h.temperature_c - low, tau) for h in runs]
    for tau in _MOVED_S:
        moved = [_gathered(h, np.abs(r), tau) for h, r in zip(runs, rates, strict=True)]
        yield "what moving has done so far", moved
    yield "creep after turns of the temperature", [_creep(h) for h in runs]
    since = [h.time_s - h.time_s[0] if h.on_s is None else np.asarray(h.on_s) for h in runs]
    yield "a course of time since power-on", [np.log1p(np.maximum(s, 0.0) / _SETTLING_S) for s in since]


def late(history: History, tau: float) -> FloatArray:
    """Return by how much a first-order memory of the temperature differs from it, C, shape (n,)."""
    return np.asarray(first_order(tau, history.time_s, history.temperature_c) - history.temperature_c)


def _gathered(history: History, x: FloatArray, tau: float) -> FloatArray:
    """Gather what came in since the start, of which a memory loses some."""
    since = history.time_s - history.time_s[0]
    return np.asarray(first_order(tau, history.time_s, x) - x[0] * np.exp(-since / tau))


def _smooth(x: FloatArray, count: int) -> FloatArray:
    """Gaussians over the range, shape (N, count)."""
    places = np.linspace(float(np.quantile(x, 0.01)), float(np.quantile(x, 0.99)), count)
    width = 0.8 * max(float(places[1] - places[0]), 1e-12)
    return np.asarray(np.exp(-0.5 * ((x[:, None] - places) / width) ** 2))


def _courses(records: Records, distance_s: float) -> FloatArray:
    """Gaussians over the time of each run, shape (N, k)."""
    columns = []
    for number, span in zip(records.kept, records.spans(), strict=True):
        time = number * records.block_s
        places = np.arange(time[0], time[-1] + distance_s, distance_s)
        own = np.zeros((records.size, places.size))
        own[span] = np.exp(-0.5 * ((time[:, None] - places) / (0.7 * distance_s)) ** 2)
        columns.append(own)
    return np.column_stack(columns)


def _nonlinear(records: Records) -> Iterator[Shape]:
    """Memory that acts other than in proportion, alone and beside a proportional part."""
    for tau in _TAUS_S:
        lags = [late(run.history, tau) for run in records.runs]
        size = float(np.std(np.concatenate(lags))) + 1e-12
        scaled = [d / size for d in lags]
        linear = records.average(scaled)
        acts = [[np.abs(d) for d in scaled], [d * np.abs(d) for d in scaled]]
        for edge in _EDGES:
            beyond = [np.maximum(np.abs(d) - edge, 0.0) for d in scaled]
            for power in (1, 2):
                acts.append([np.sign(d) * b**power for d, b in zip(scaled, beyond, strict=True)])
        for act in acts:
            column = records.average(act)
            yield Shape("memory that does not act in proportion", 2, column[:, None])
            yield Shape("memory that does not act in proportion", 2, np.column_stack([linear, column]))


def _one_sided(records: Records) -> Iterator[Shape]:
    """A node that warms faster than it cools, or the reverse."""
    for quick in _QUICK_S:
        for slower in _SLOWER:
            for up, down in ((quick, slower * quick), (slower * quick, quick)):
                column = records.average([two_sided_lag(r.history, up, down) for r in records.runs])
                yield Shape("memory that differs between warming and cooling", 2, column[:, None])


def two_sided_lag(history: History, up: float, down: float) -> FloatArray:
    """z − T of a node with one time constant while T > z and another while T < z, shape (n,)."""
    t = history.temperature_c
    step = np.diff(history.time_s, prepend=history.time_s[0])
    warm, cool = (-np.expm1(-step / up)).tolist(), (-np.expm1(-step / down)).tolist()
    out = np.empty(len(t))
    z = float(t[0])
    for k, x in enumerate(t.tolist()):
        z += (x - z) * (warm[k] if x > z else cool[k])
        out[k] = z - x
    return out


def _switched(records: Records) -> Iterator[Shape]:
    """A state that switches on when T rises over a threshold and off below a lower one: alone, with a map."""
    joined = np.concatenate([r.history.temperature_c for r in records.runs])
    low, high = float(joined.min()), float(joined.max())
    nodes = np.arange(low, high + _HAT_C, _HAT_C)
    for gap in _GAPS_C:
        for upper in np.arange(low + gap + _SWITCH_C / 2, high, _SWITCH_C):

            def hats(h: History, on: float = float(upper), off: float = float(upper) - gap) -> FloatArray:
                state = switch_state(h.temperature_c, on, off)
                near = np.maximum(0.0, 1.0 - np.abs(h.temperature_c[:, None] - nodes) / _HAT_C)
                return np.asarray(near * state[:, None])

            columns = records.columns(hats)
            used = np.linalg.norm(columns, axis=0) > 1e-6
            if used.any():
                yield Shape("a switch with hysteresis", 2, columns.sum(axis=1)[:, None])
                yield Shape("a map that a switch changes", 2, columns[:, used], common=True, texture=True)


def switch_state(t: FloatArray, on: float, off: float) -> FloatArray:
    """State 0 or 1: the last threshold that was passed, 0 before any."""
    event = np.where(t > on, 1, np.where(t < off, -1, 0))
    last = np.maximum.accumulate(np.where(event != 0, np.arange(len(t)), -1))
    return np.where(last >= 0, event[np.maximum(last, 0)] > 0, False).astype(float)


def _creep(history: History) -> FloatArray:
    """Sign of the last direction times log(1 + time since it changed / `_GRAIN_S`), shape (n,)."""
    slope = centred_slope(history)
    sign = np.where(slope > _TURNING, 1, np.where(slope < -_TURNING, -1, 0))
    number = np.arange(len(sign))
    last = np.maximum.accumulate(np.where(sign != 0, number, -1))
    direction = np.where(last >= 0, sign[np.maximum(last, 0)], 0)
    turning = np.maximum.accumulate(np.where(np.diff(direction, prepend=0) != 0, number, 0))
    since = history.time_s - history.time_s[turning]
    return np.asarray(direction * np.log1p(since / _GRAIN_S))
