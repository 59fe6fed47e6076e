"""The shortest chamber programme that reaches an accuracy with a lot: the step that helps most for its hours, again
and again.

What a programme promises does not depend on what will be measured: the posterior's covariance follows from the
temperatures alone, and these from the chamber and the thermal network of the simulated instrument.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import __version__
from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..results.lot import Lot
from ..results.lot_plan import ChamberStep, LotPlan, LotProgramme
from ..simulate import chamber
from ..simulate.instrument import thermal_network
from ..simulate.profile import corners
from ..simulate.scenario import Scenario, read
from .basis import CONSTANT, PRIOR_LOG, LotBasis
from .use import LotPrior, prior_of

__all__ = [
    "AVERAGE_S", "HOLDS", "RATES", "MapQuestion", "extremes_of", "hours_of", "inputs_of", "plan_with_lot",
    "programme_csv", "programme_text",
]  # fmt: skip


_GRID_S = 10.0  # of the simulated temperatures: a hundredth of the instrument's slowest mode
_SLOPE_S = 100.0  # window of dT/dt, as of the front end
AVERAGE_S = 100.0  # the paper's means, as `fit` has it where nothing else is asked for
_MOST_H = 24.0  # what a laboratory calls a day
RATES = (1.0, 3.0, 5.0)  # C/min, the paper's
HOLDS = (0.0, 20.0, 60.0)  # min: pass through, settle (the slowest mode has 23 min), rest


@dataclass(frozen=True)
class MapQuestion:
    """What a programme is judged by: covariance before it, functions, noise of a mean, and where corrections count."""

    basis: LotBasis
    covariance: FloatArray
    sigma: float
    mean_s: float
    asked: FloatArray
    share: FloatArray
    unit_dph: float

    def sigma_dph(self, temperature_c: FloatArray, slope_c_per_min: FloatArray) -> float:
        """1 sigma of the map after these temperatures, RMS over where units are, deg/h."""
        values = self.basis.values(temperature_c, slope_c_per_min)
        precision = values.T @ values / self.sigma**2
        factor = np.linalg.cholesky(self.covariance)
        inner = np.eye(len(factor)) + factor.T @ precision @ factor
        root = np.linalg.solve(np.linalg.cholesky(inner), (self.asked @ factor).T)
        return self.unit_dph * float(np.sqrt(np.sum(root**2, axis=0) @ self.share))


def plan_with_lot(lot: Lot, scenario: str | Path, accuracy_dph: float) -> LotPlan:
    """The shortest programme of at most a day, with the lot and without.

    Args:
        lot: What units of the type share.
        scenario: Its chamber, its instrument and the extremes of its programmes are taken.
        accuracy_dph: 1 sigma of the map that is to be reached, RMS over where units of the lot were, deg/h.

    Raises:
        InputError: The scenario cannot be, or the accuracy is no number above 0.
    """
    if not (np.isfinite(accuracy_dph) and accuracy_dph > 0.0):
        raise InputError("--require accuracy", f"{accuracy_dph:g}", "deg/h above 0")
    name, plan = read(scenario)
    prior = prior_of(lot)
    floor = lot.noise_dph * float(np.sqrt(lot.mean_s / AVERAGE_S))
    ends = extremes_of(plan)
    return LotPlan(
        gyrotc_version=__version__,
        lot=lot.checksum,
        scenario=name,
        accuracy_dph=accuracy_dph,
        before_dph=prior.alone().rms_sigma_dph(),
        with_lot=_searched(plan, ends, _with(prior), accuracy_dph, floor),
        without=_searched(plan, ends, _without(prior), accuracy_dph, floor),
    )


def _with(prior: LotPrior) -> MapQuestion:
    lot, asked = prior.lot, prior.asked
    largest = int(np.argmax(prior.share))
    values = prior.basis.values(asked.temperature_c, asked.slope_c_per_min)
    sigma = lot.noise_dph / lot.unit_dph
    return MapQuestion(
        prior.basis, prior.covariances[largest], sigma, lot.mean_s, values, asked.share, lot.unit_dph
    )


def _without(prior: LotPrior) -> MapQuestion:
    """The process that a unit alone is fitted by, before it has seen anything."""
    lot, asked = prior.lot, prior.asked
    basis = LotBasis.over(lot.temperature_c, lot.slope_c_per_min)
    wide = PRIOR_LOG.copy()
    wide[0] = CONSTANT
    values = basis.values(asked.temperature_c, asked.slope_c_per_min)
    sigma = lot.noise_dph / lot.unit_dph
    return MapQuestion(
        basis, np.diag(basis.variance(wide)), sigma, lot.mean_s, values, asked.share, lot.unit_dph
    )


def _searched(
    plan: Scenario, ends: tuple[float, float], question: MapQuestion, accuracy_dph: float, floor: float
) -> LotProgramme:
    start = 0.5 * (ends[0] + ends[1])
    steps: list[ChamberStep] = []
    now, hours = np.inf, 0.0
    while now > accuracy_dph:
        tried = [
            [*steps, ChamberStep(to_c=to, c_per_min=rate, hold_min=hold)]
            for to in (*ends, start)
            for rate in RATES
            for hold in HOLDS
            if (steps and to != steps[-1].to_c) or (not steps and (to != start or hold))
        ]
        found = [
            (hours_of(start, one), question.sigma_dph(*inputs_of(plan, start, one, question.mean_s)))
            for one in tried
        ]
        best = max(
            range(len(tried)), key=lambda k: _gain(now, found[k][1], accuracy_dph) / (found[k][0] - hours)
        )
        if found[best][0] > _MOST_H or not found[best][1] < now:
            break
        steps, (hours, now) = tried[best], found[best]
    return LotProgramme(
        start_c=start,
        steps=tuple(steps),
        hours=hours,
        sigma_dph=float(now),
        rms_over_floor=float(np.sqrt(1.0 + (now / floor) ** 2)),
        reached=bool(now <= accuracy_dph),
    )


def _gain(before: float, after: float, required: float) -> float:
    """By how much a step lowers the logarithm of what is left to do; the first one starts from a tenfold."""
    start = before if np.isfinite(before) else 10.0 * after
    return float(np.log(start / max(after, required)))


def hours_of(start_c: float, steps: Sequence[ChamberStep]) -> float:
    """Length of a programme, h."""
    return _corners(start_c, steps)[0][-1] / 60.0


def _corners(start_c: float, steps: Sequence[ChamberStep]) -> tuple[list[float], list[float]]:
    """Times (min) and set points (C) between which the chamber goes in lines."""
    minutes, degrees = [0.0], [start_c]
    for step in steps:
        minutes.append(minutes[-1] + abs(step.to_c - degrees[-1]) / step.c_per_min)
        degrees.append(step.to_c)
        if step.hold_min:
            minutes.append(minutes[-1] + step.hold_min)
            degrees.append(step.to_c)
    return minutes, degrees


def inputs_of(
    plan: Scenario, start_c: float, steps: Sequence[ChamberStep], mean_s: float
) -> tuple[FloatArray, FloatArray]:
    """What the sensor will show in means: T in C and dT/dt in C/min."""
    corner_min, corner_c = _corners(start_c, steps)
    time_s = np.arange(0.0, 60.0 * corner_min[-1], _GRID_S)
    programmed = np.interp(time_s, 60.0 * np.array(corner_min), corner_c)
    air = chamber.air(plan.chamber, programmed, _GRID_S, np.random.default_rng(0))
    network = thermal_network(plan.gyro)
    nodes = network.respond(air, np.ones(len(time_s)), _GRID_S)
    t = nodes[network.names.index(plan.sensor.node)]
    back = round(_SLOPE_S / _GRID_S)
    late = np.concatenate([np.full(back, t[0]), t])[: len(t)]
    slope = (t - late) * 60.0 / _SLOPE_S
    block = max(1, round(mean_s / _GRID_S))
    whole = max(len(t) // block * block, block)
    return (
        t[:whole].reshape(-1, block).mean(axis=1) if len(t) >= block else t[-1:],
        slope[:whole].reshape(-1, block).mean(axis=1) if len(t) >= block else slope[-1:],
    )


def extremes_of(plan: Scenario) -> tuple[float, float]:
    """Lowest and highest set point of a scenario's programmes."""
    ends = [
        corners(p.steps, p.start_c, 60.0 * (p.record_from_min + p.record_min), plan.chamber.max_c_per_min)[1]
        for p in plan.profile.values()
    ]
    every = np.concatenate(ends)
    return float(every.min()), float(every.max())


def programme_csv(programme: LotProgramme) -> str:
    """The programme as a chamber takes it: corners of the set point, minutes and C."""
    corners_of = zip(*_corners(programme.start_c, programme.steps), strict=True)
    return "".join(["time_min,set_point_c\n", *(f"{minutes:.6g},{c:g}\n" for minutes, c in corners_of)])


def programme_text(programme: LotProgramme) -> str:
    """The programme in words, a line for each step."""
    lines = [f"start at {programme.start_c:g} C, settled, with power off; power on"]
    for step in programme.steps:
        hold = f", hold {step.hold_min:g} min" if step.hold_min else ""
        lines.append(f"ramp to {step.to_c:g} C at {step.c_per_min:g} C/min{hold}")
    return "".join(f"{k}. {line}\n" for k, line in enumerate(lines, 1))
