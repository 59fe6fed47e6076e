"""What a search goes through: causes on a grid of their parameter, and shapes that no cause has.

A flexible cause can imitate much of an effect that is none: a lag of the whole map comes near every memory
of the temperature, however it acts. So causes have to hold their own against general classes of other
mechanisms: memory that acts other than in proportion, memory that differs by direction or changes over T,
switches, creep. Where one of these explains the recordings clearly better, the structure is unexplained.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..causes import CATALOGUE
from ..causes.base import OVERTONES, Cause, History, Parameter, Reach, SearchRule, Values
from ..common.arrays import FloatArray
from ..target.recursions import first_order
from .blocks import Records, centred_slope

_TAUS_S = tuple(np.geomspace(150.0, 4000.0, 8))  # in steps of a factor 1.6: memories nearer than that are alike
_EDGES = (0.6, 1.3)  # thresholds, in standard deviations of T − z
_QUICK_S = tuple(np.geomspace(120.0, 1500.0, 7))  # time constant of the quicker direction
_SLOWER = (3.0, 7.0)  # by which factor the other direction is slower
_PERIODS_C = (12.0, 18.0, 26.0, 36.0, 50.0)  # in steps of a factor 1.4
_MODULATING_S = (300.0, 700.0, 1500.0)  # time constants of memories whose strength changes
_SWITCH_C, _GAPS_C = 6.0, (10.0, 20.0)  # steps of the upper threshold; width between the thresholds
_HAT_C = 3.5  # width of the local functions of a map that a switch changes
_GRAINS_S = (100.0, 300.0, 1000.0)  # times after which creep becomes logarithmic
_TURNING = 0.05  # C/min that count as moving


@dataclass(frozen=True)
class Shape:
    """One alternative.

    Attributes:
        name: In words, for the report.
        parameters: Number of nonlinear parameters.
        columns: Block means, shape (N, k).
        common: Whether the weights have one common variance (many columns) or are free (few).
    """

    name: str
    parameters: int
    columns: FloatArray
    common: bool = False


def shapes_of(records: Records) -> Iterator[Shape]:
    """All alternatives for these recordings."""
    late = {tau: [_late(r.history, tau) for r in records.runs] for tau in {*_TAUS_S, *_MODULATING_S}}
    yield from _nonlinear(records, {tau: late[tau] for tau in _TAUS_S})
    yield from _one_sided(records)
    yield from _modulated(records, {tau: late[tau] for tau in _MODULATING_S})
    yield from _switched(records)
    for grain in _GRAINS_S:
        crept = records.average([_creep(r.history, grain) for r in records.runs])
        yield Shape("creep after turns of the temperature", 1, crept)


def _late(history: History, tau: float) -> FloatArray:
    return np.asarray(first_order(tau, history.time_s, history.temperature_c) - history.temperature_c)


def _nonlinear(records: Records, late: dict[float, list[FloatArray]]) -> Iterator[Shape]:
    """Memory that acts other than in proportion, alone and beside a proportional part."""
    for lags in late.values():
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
                column = records.average([_two_sided_lag(r.history, up, down) for r in records.runs])
                yield Shape("memory that differs between warming and cooling", 2, column)


def _two_sided_lag(history: History, up: float, down: float) -> FloatArray:
    """z − T of a node with one time constant while T > z and another while T < z, shape (n, 1)."""
    t = history.temperature_c
    step = np.diff(history.time_s, prepend=history.time_s[0])
    warm, cool = (-np.expm1(-step / up)).tolist(), (-np.expm1(-step / down)).tolist()
    out = np.empty(len(t))
    z = float(t[0])
    for k, x in enumerate(t.tolist()):
        z += (x - z) * (warm[k] if x > z else cool[k])
        out[k] = z - x
    return out[:, None]


def _modulated(records: Records, late: dict[float, list[FloatArray]]) -> Iterator[Shape]:
    """Memory whose strength changes over T, and changes sign with it or not."""
    for lags in late.values():
        for act in (lags, [np.abs(d) for d in lags]):
            for period in _PERIODS_C:
                waves = [2.0 * np.pi * r.history.temperature_c / period for r in records.runs]
                pair = [np.column_stack([d * np.cos(w), d * np.sin(w)]) for d, w in zip(act, waves, strict=True)]
                yield Shape("memory whose strength changes over temperature", 3, records.average(pair))


def _switched(records: Records) -> Iterator[Shape]:
    """A state that switches on when T rises over a threshold and off below a lower one: alone, with a map."""
    joined = np.concatenate([r.history.temperature_c for r in records.runs])
    low, high = float(joined.min()), float(joined.max())
    nodes = np.arange(low, high + _HAT_C, _HAT_C)
    for gap in _GAPS_C:
        for upper in np.arange(low + gap + _SWITCH_C / 2, high, _SWITCH_C):

            def hats(h: History, on: float = float(upper), off: float = float(upper) - gap) -> FloatArray:
                state = _switch(h.temperature_c, on, off)
                near = np.maximum(0.0, 1.0 - np.abs(h.temperature_c[:, None] - nodes) / _HAT_C)
                return np.asarray(near * state[:, None])

            columns = records.columns(hats)
            used = np.linalg.norm(columns, axis=0) > 1e-6
            if used.any():
                yield Shape("a switch with hysteresis", 2, columns.sum(axis=1)[:, None])
                yield Shape("a map that a switch changes", 2, columns[:, used], common=True)


def _switch(t: FloatArray, on: float, off: float) -> FloatArray:
    """State 0 or 1: the last threshold that was passed, 0 before any."""
    event = np.where(t > on, 1, np.where(t < off, -1, 0))
    last = np.maximum.accumulate(np.where(event != 0, np.arange(len(t)), -1))
    return np.where(last >= 0, event[np.maximum(last, 0)] > 0, False).astype(float)


def _creep(history: History, grain: float) -> FloatArray:
    """Sign of the last direction times log(1 + time since it changed / grain), shape (n, 1)."""
    slope = centred_slope(history)
    sign = np.where(slope > _TURNING, 1, np.where(slope < -_TURNING, -1, 0))
    number = np.arange(len(sign))
    last = np.maximum.accumulate(np.where(sign != 0, number, -1))
    direction = np.where(last >= 0, sign[np.maximum(last, 0)], 0)
    turning = np.maximum.accumulate(np.where(np.diff(direction, prepend=0) != 0, number, 0))
    since = history.time_s - history.time_s[turning]
    return np.asarray(direction * np.log1p(since / grain))[:, None]


Role = Literal["columns", "input", "variance", "structure"]


@dataclass(frozen=True, slots=True)
class Candidate:
    """One point of the search.

    Attributes:
        id: Cause.
        values: Its nonlinear parameters.
        role: columns: added to the map; input: the map of other inputs; variance: weights with one common
            variance; structure: anything in the span of the dictionary, no cause.
        channel: Auxiliary channel, else None.
    """

    id: str
    values: dict[str, float]
    role: Role
    channel: str | None = None


def diagnosed() -> dict[str, Cause]:
    """The causes of the catalogue that diagnosis looks for, in the order in which results list them."""
    return {id: term for id, term in CATALOGUE.items() if term.search is not None}


def planned() -> list[str]:
    """Those of which a profile without rates says something."""
    return [id for id in diagnosed() if searched(id).planned]


def searched(cause: str) -> SearchRule:
    """How diagnosis looks for a cause."""
    search = CATALOGUE[cause].search
    assert search is not None
    return search


def price_of(candidate: Candidate) -> int:
    """Number of its parameters: a sine and a cosine for each overtone of a wave, beside those of its kind."""
    return searched(candidate.id).price + 2 * int(candidate.values.get(OVERTONES, 0))


def shape_parameter(cause: str) -> Parameter | None:
    """The parameter over which a cause is searched, if it has one."""
    over = searched(cause).over
    return next((p for p in CATALOGUE[cause].parameters if p.name == over), None)


def reach_of(records: Records) -> Reach:
    """What these recordings can show of a cause."""
    span = float(np.ptp(np.concatenate([r.history.temperature_c for r in records.runs])))
    return Reach(span, max(float(np.ptp(r.history.time_s)) for r in records.runs))


def columns_of(records: Records, cause: str, values: Values) -> FloatArray:
    """Block means of the columns that a cause adds, shape (N, k)."""
    features = CATALOGUE[cause].features
    assert features is not None

    def rows(history: History) -> FloatArray:
        return features(history, values).columns

    return records.columns(rows)


def testable(records: Records, cause: str) -> str:
    """Why a cause cannot be tested on these recordings; empty if it can."""
    needs = CATALOGUE[cause].needs
    histories = [run.history for run in records.runs]
    if len(histories) < needs.runs:
        return f"needs {needs.runs} runs, there are {len(histories)}"
    dates = {h.day for h in histories if h.day is not None}
    if needs.dates and (len(dates) < needs.dates or any(h.day is None for h in histories)):
        return f"needs runs on {needs.dates} dates"
    if needs.power_on and any(h.on_s is None for h in histories):
        return "needs the time of power-on of every run"
    return ""
