"""Foreign mechanisms from a grammar: operators drawn upon signals, so that nobody can have learnt a list of them.

    kind    = operator(kind) | kind * kind | signal
    operator = integrate | saturate | threshold | delay | relax
    signal  = temperature of sensor, mirror, middle, case; rate of the sensor; time since power-on

A kind that depends on the sensor's temperature and rate alone is no discrepancy, and one that a cause of the
catalogue can imitate is no foreign one: `record` measures both and draws again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .heat import STEP_S, Array, Heat
from .mechanisms import rate_of

Signals = list[Array]

_SOURCES: dict[str, Callable[[Heat], Array]] = {
    "sensor": lambda h: h.sensor,
    "mirror": lambda h: h.mirror,
    "middle": lambda h: h.deep - h.sensor,
    "case": lambda h: h.case - h.sensor,
    "rate": lambda h: rate_of(h.sensor),
    "on": lambda h: np.log1p(h.on_s / 600.0),
}


@dataclass(frozen=True)
class Kind:
    """A mechanism: its text, and its values for each run."""

    text: str
    values: Signals


def draw_kind(heat: list[Heat], rng: np.random.Generator) -> Kind:
    """Two to four operators upon drawn signals."""
    kind = _source(heat, rng)
    for _ in range(int(rng.integers(2, 5))):
        kind = _OPERATORS[int(rng.integers(len(_OPERATORS)))](kind, heat, rng)
        kind = Kind(kind.text, _even(kind.values))
    return kind


def _source(heat: list[Heat], rng: np.random.Generator) -> Kind:
    name = str(rng.choice(list(_SOURCES)))
    return Kind(name, _even([_SOURCES[name](h) for h in heat]))


def _even(values: Signals) -> Signals:
    """Mean 0 and standard deviation 1 over all runs, where they change at all."""
    whole = np.concatenate(values)
    spread = float(whole.std())
    return [(v - whole.mean()) / (spread if spread > 1e-9 else 1.0) for v in values]


def _integrate(kind: Kind, heat: list[Heat], rng: np.random.Generator) -> Kind:
    forgets = float(np.exp(rng.uniform(np.log(3e3), np.log(1e5))))
    keep = 1.0 - STEP_S / forgets
    out = []
    for v in kind.values:
        total, trace = 0.0, np.empty(v.size)
        for k, x in enumerate(v.tolist()):
            total = keep * total + x
            trace[k] = total
        out.append(trace)
    return Kind(f"integrate({kind.text}, {forgets:.0f} s)", out)


def _saturate(kind: Kind, heat: list[Heat], rng: np.random.Generator) -> Kind:
    at = float(rng.uniform(0.2, 0.8))
    return Kind(f"saturate({kind.text}, {at:.2f})", [np.tanh(v / at) for v in kind.values])


def _threshold(kind: Kind, heat: list[Heat], rng: np.random.Generator) -> Kind:
    """A switch with a gap, that lets its input through or not."""
    up = float(rng.uniform(-0.5, 1.0))
    gap = float(rng.uniform(0.1, 1.2))
    out = []
    for v in kind.values:
        state, trace = 0.0, np.empty(v.size)
        for k, x in enumerate(v.tolist()):
            state = 1.0 if x > up else 0.0 if x < up - gap else state
            trace[k] = state * (x - up)
        out.append(trace)
    return Kind(f"threshold({kind.text}, {up:.2f}, {gap:.2f})", out)


def _delay(kind: Kind, heat: list[Heat], rng: np.random.Generator) -> Kind:
    late = round(float(np.exp(rng.uniform(np.log(120), np.log(3000)))) / STEP_S)
    moved = [np.r_[np.full(min(late, v.size), v[0]), v[: max(v.size - late, 0)]] for v in kind.values]
    return Kind(f"delay({kind.text}, {late * STEP_S:.0f} s)", moved)


def _relax(kind: Kind, heat: list[Heat], rng: np.random.Generator) -> Kind:
    """Follows upwards and downwards with time constants of its own."""
    rise = float(np.exp(rng.uniform(np.log(120), np.log(3000))))
    fall = rise * float(np.exp(rng.uniform(np.log(0.15), np.log(7.0))))
    out = []
    for v in kind.values:
        z, trace = float(v[0]), np.empty(v.size)
        for k, x in enumerate(v.tolist()):
            z += (x - z) * STEP_S / (rise if x > z else fall)
            trace[k] = z
        out.append(trace)
    return Kind(f"relax({kind.text}, {rise:.0f} s, {fall:.0f} s)", out)


def _multiply(kind: Kind, heat: list[Heat], rng: np.random.Generator) -> Kind:
    other = _source(heat, rng)
    values = [a * b for a, b in zip(kind.values, other.values, strict=True)]
    return Kind(f"{kind.text} * {other.text}", values)


_OPERATORS = (_integrate, _saturate, _threshold, _delay, _relax, _multiply)
