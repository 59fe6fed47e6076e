"""The same faults where firmware has learned in service: is sigma after learning true?

Thirty power-ons teach each gyro, with stops at temperatures of its exam run; then every class of `bench.faults` begins.
A re-zero of a class is a stop that the learning unit is offered. Firmware keeps three rules: with a status of the table
other than 0 it offers no stop, keeps the shift, and takes the table's sigma; else that of the learning unit.
`python -m bench docs --only faults-learned`.
"""

from __future__ import annotations

import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.assess.product_guards import BuiltUnit, ServiceLearning
from gyrotc.simulate.campaign import campaign, with_noise
from gyrotc.simulate.scenario import read
from gyrotc.tables.emit import service_prior
from gyrotc.mirror.learning import Learner, Stop
from numpy.typing import NDArray
from results import table as markdown

from .faults import (
    CLASSES,
    FIRST_SEED,
    HEALTHY_S,
    INIT,
    MISSED,
    PART,
    PLAN,
    POWER_CYCLE,
    REZERO,
    Calls,
    Fault,
    Floats,
    Say,
    Unit,
    driven,
)  # fmt: skip
from .faults import unit as unit_of

_GYROS = 60
_POWER_ONS, _STOPS = 30, 3  # that have taught: stops of each
_LONGEST_S, _SPAN_C = 600, 1.5  # of a stop; the gate of the learning unit
_EVERY = 10  # samples from one that is looked at to the next
_AUTHORITY_DPH = 0.03
_TURN_ON_DPH = 3e-4  # of these gyros, as their data sheet would state it


@dataclass(frozen=True, slots=True)
class Learned:
    """Errors over sigma without what was learned, with it, and where the prior knows the turn-on as training saw it."""

    before: Floats
    after: Floats
    seen: Floats


def _parked(temp_c: Floats, end: int, longest: int = _LONGEST_S) -> int:
    """First row of the longest stop that ends there and passes the gate of temperature."""
    back = temp_c[max(end - longest, 0) : end][::-1]
    spans = np.maximum.accumulate(back) - np.minimum.accumulate(back)
    return end - max(int(np.sum(spans <= _SPAN_C)), 1)


def turn_on_dph(own: Unit, seed: int) -> float:
    """The exam run's own offset: the same gyro drawn without one."""
    with tempfile.TemporaryDirectory() as place:
        plan = Path(place) / "plan.toml"
        plan.write_text(PLAN.replace("std_dph = 3e-4", "std_dph = 1e-12"), "utf-8")
        record = list(campaign(with_noise(read(plan)[1], "paper"), seed))[-1]
    apart = own.truth_dph - np.diff(record.true_arcsec)[PART]
    assert np.ptp(apart) < 1e-9, "a constant"
    return float(apart.mean())


def _taught(own: Unit, seed: int, stated_dph: float | None) -> Learner:
    """A unit of firmware that has been through power-ons at this gyro's temperatures, its turn-on stated or not."""
    rng = np.random.default_rng([seed, 27])
    learning = ServiceLearning(authority_dph=_AUTHORITY_DPH, turn_on_dph=stated_dph).of(own.model, BuiltUnit(), "bench")
    learner = Learner(service_prior(learning, own.model.envelope.temperature_c))
    left, _, status = driven(own, Calls.of(own.readings))
    left = left - turn_on_dph(own, seed)
    temp_c, noise = own.readings[:, 0], learning.noise_deg_per_sqrt_h
    for _ in range(_POWER_ONS):
        learner.power_on(86400.0, float(temp_c[0]))
        offset = _TURN_ON_DPH * rng.standard_normal()
        for number, end in enumerate(sorted(rng.integers(_LONGEST_S, len(temp_c), _STOPS).tolist())):
            at = slice(_parked(temp_c, end), end)
            if np.any(status[at]):
                continue
            seconds = at.stop - at.start
            rate = left[at].mean() + offset + rng.normal(0.0, noise / np.sqrt(seconds / 3600.0))
            learner.rest(Stop(600.0 + 7200.0 * number, float(temp_c[at].mean()), rate, seconds))
    return learner


def learned(own: Unit, fault: Fault, seed: int, words: list[int], learner: Learner) -> tuple[Floats, Floats]:
    """Error over sigma without and with what was learned, of every tenth second; `words`: what the unit kept before."""
    calls = fault(own, np.random.default_rng(seed), HEALTHY_S)
    rest = calls.kind == REZERO
    plain = Calls(*(part[~rest] for part in (calls.kind, calls.number, calls.values, calls.row, calls.offset_dph)))
    error, sigma, status = driven(own, plain)
    samples = np.flatnonzero(plain.kind <= MISSED)
    by_row = np.full(len(own.readings), samples[-1])
    by_row[plain.row[samples]] = samples
    assert learner.restore(words) == 0
    learner.power_on(86400.0, float(own.readings[0, 0]))
    begun, before, after, shift, own_sigma = 0, [], [], 0.0, 0.0
    events = {
        int(r): (int(n), float(v[0]))
        for r, n, v in zip(*(x[rest] for x in (calls.row, calls.number, calls.values)), strict=True)
    }
    cycles = set(plain.row[(plain.kind == POWER_CYCLE) | (plain.kind == INIT)].tolist())
    for row in range(len(own.readings)):
        k = int(by_row[row])
        temp_c = float(plain.values[k, 0])
        if row in cycles:
            begun = row
            learner.power_on(60.0, temp_c if np.isfinite(temp_c) else 20.0)
        if row in events:
            _offered(own, learner, plain, by_row, row, events[row], begun, error, status)
        if row < HEALTHY_S or row % _EVERY:
            continue
        known = status[k] == 0 and np.isfinite(temp_c)
        if known:
            y, s = learner.shift(float(row - begun), temp_c)
            shift, own_sigma = float(y[0]), float(s[0])
        both = own_sigma if known else float(sigma[k])
        before.append(error[k] / sigma[k])
        after.append((error[k] - shift) / both)
    return np.array(before), np.array(after)


def _offered(
    own: Unit, learner: Learner, calls: Calls, by_row: NDArray[np.int64], end: int, stated: tuple[int, float],
    begun: int, error: Floats, status: NDArray[np.int32],
) -> None:  # fmt: skip
    """A stop that ends at a row: its mean is wrong as that of the class is."""
    seconds, mean = stated
    offset = calls.offset_dph[by_row[end - 1]]
    wrong = mean - float((own.rate_dph[end - seconds : end] + offset).mean())
    at = slice(max(_parked(own.readings[:, 0], end, seconds), begun), end)
    k = by_row[at]
    if at.stop <= at.start or np.any(status[k]):
        return
    correction = own.truth_dph[at] + offset - error[k]
    rate = float(np.mean(own.rate_dph[at] + offset - correction)) + wrong
    readings = calls.values[k, 0]
    learner.rest(Stop(float(end - begun), float(readings.mean()), rate, at.stop - at.start, float(np.ptp(readings))))


def outcomes(seed: int) -> list[Learned]:
    """One of every class; none for a gyro whose supply was not taken as an input."""
    own = unit_of(seed)
    if own.readings.shape[1] < 2:
        return []
    taught = [_taught(own, seed, stated) for stated in (_TURN_ON_DPH, None)]
    words = [learner.save() for learner in taught]
    found = []
    for fault in CLASSES.values():
        stated, seen = (learned(own, fault, seed, kept, unit) for kept, unit in zip(words, taught, strict=True))
        found.append(Learned(*stated, seen[1]))
    return found


def faults_learned(say: Say, gyros: int = _GYROS, workers: int | None = 1) -> dict[str, Any]:
    """RMS of error over sigma of every class without and with what was learned."""
    seeds, found = range(FIRST_SEED, FIRST_SEED + gyros), []
    with ProcessPoolExecutor(workers) as pool:
        for seed, own in zip(seeds, pool.map(outcomes, seeds), strict=True):
            say(f"faults with learned states of gyro {seed}")
            found += [own] if own else []
    return {
        "gyros": len(found),
        "classes": [_figures(name, [each[k] for each in found]) for k, name in enumerate(CLASSES)],
    }


def _figures(name: str, own: list[Learned]) -> dict[str, Any]:
    def rms(parts: list[Floats]) -> float:
        return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))

    return {
        "name": name,
        "before": rms([one.before for one in own]),
        "rms": rms([one.after for one in own]),
        "p95": float(np.quantile(np.abs(np.concatenate([one.after for one in own])), 0.95)),
        "worst_gyro": max(rms([one.after]) for one in own),
        "seen": rms([one.seen for one in own]),
    }


def section(result: dict[str, Any]) -> str:
    """Section of docs/results.md."""
    rows = [
        (row["name"], *(f"{row[key]:.2f}" for key in ("before", "rms", "p95", "worst_gyro", "seen")))
        for row in result["classes"]
    ]
    head = f"## Faults with learned states\n\nError over sigma of {result['gyros']} gyros.\n"
    return (
        head
        + "\n"
        + markdown(
            ("fault", "RMS without ", "RMS with ", "95 % ", "RMS, worst gyro ", "turn-on as five runs showed it "), rows
        )
    )
