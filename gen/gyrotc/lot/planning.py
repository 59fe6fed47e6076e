"""Which run to record next for a unit, and the shortest programme that reaches an accuracy with a lot.

The posterior's covariance after a run follows from the temperatures alone, and these from the chamber and the thermal
network of the simulated instrument. So what a run or a programme brings is known before it is recorded: the mean of the
variance over where corrections are asked for, before less after.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import __version__
from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..model import Model
from ..results.fleet import Lot
from ..results.recordings import ChamberStep, LotPlan, LotProgramme, NextRun, ProposedRun
from ..simulate.instrument import chamber_air, thermal_network
from ..simulate.profile import corners
from ..simulate.scenario import Scenario, read
from ..train.prior.basis import CONSTANT, PRIOR_LOG, LotBasis
from ..train.prior.use import LotPrior, MapPosterior, prior_of

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
    alone, wide = LotBasis.over(lot.temperature_c, lot.slope_c_per_min), PRIOR_LOG.copy()
    wide[0] = CONSTANT  # the process that a unit alone is fitted by, before it has seen anything
    known = _question(prior, prior.basis, prior.covariances[int(np.argmax(prior.share))])
    unknown = _question(prior, alone, np.diag(alone.variance(wide)))
    return LotPlan(
        gyrotc_version=__version__,
        lot=lot.checksum,
        scenario=name,
        accuracy_dph=accuracy_dph,
        before_dph=prior.alone().rms_sigma_dph(),
        with_lot=_searched(plan, ends, known, accuracy_dph, floor),
        without=_searched(plan, ends, unknown, accuracy_dph, floor),
    )


def _question(prior: LotPrior, basis: LotBasis, covariance: FloatArray) -> MapQuestion:
    lot, asked = prior.lot, prior.asked
    values = basis.values(asked.temperature_c, asked.slope_c_per_min)
    return MapQuestion(basis, covariance, lot.noise_dph / lot.unit_dph, lot.mean_s, values, asked.share, lot.unit_dph)


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
            (hours_of(start, one), question.sigma_dph(*inputs_of(plan, start, one, question.mean_s))) for one in tried
        ]
        best = max(range(len(tried)), key=lambda k: _gain(now, found[k][1], accuracy_dph) / (found[k][0] - hours))
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
    air = chamber_air(plan.chamber, programmed, _GRID_S, np.random.default_rng(0))
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
    return float(np.concatenate(ends).min()), float(np.concatenate(ends).max())


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


_PLACES = 5  # set points between the extremes: a quarter of the span is about as far as a map is smooth
_KEPT = 2  # programmes of each length that are gone on from: the best first step does not always begin the best run
_MOST_STEPS = 4  # of a run: each further one multiplies the time of the search, and adds less than the one before


@dataclass(frozen=True, slots=True)
class Price:
    """What chamber time costs.

    Attributes:
        per_hour: Of an hour, in any currency.
        per_run: Of mounting, settling and powering once, in the same.
        most_h: No run is longer, h.
    """

    per_hour: float = 1.0
    per_run: float = 1.0
    most_h: float = 8.0

    def check(self) -> None:
        """Refuses what is no price.

        Raises:
            InputError: It is none.
        """
        for option, value, least in (
            ("--price-per-hour", self.per_hour, 1e-9),
            ("--price-per-run", self.per_run, 0.0),
            ("--hours", self.most_h, 1e-9),
        ):
            if not (np.isfinite(value) and value >= least):
                raise InputError(option, f"{value:g}", "a number above 0" if least else "a number, 0 or more")

    def of(self, hours: float) -> float:
        return self.per_run + self.per_hour * hours


@dataclass(frozen=True, slots=True)
class _Found:
    steps: tuple[ChamberStep, ...]
    hours: float
    sigma_dph: float


def next_run(
    model: Model, known: MapPosterior, noise_dph: float, mean_s: float, scenario: str | Path, price: Price
) -> NextRun:
    """The runs of growing length that tell most of a unit's map, and the one that is best for its price.

    Args:
        model: Of the unit.
        known: What is known of its map.
        noise_dph: Of a mean over `mean_s`, deg/h.
        mean_s: Length of means, s.
        scenario: Its chamber, its instrument and the extremes of its programmes are taken.
        price: Of chamber time.

    Raises:
        InputError: The scenario cannot be, or a price is none.
    """
    price.check()
    name, plan = read(scenario)
    prior, asked = known.prior, known.prior.asked
    values = prior.basis.values(asked.temperature_c, asked.slope_c_per_min)
    sigma = noise_dph / prior.unit_dph
    share = asked.share / asked.share.sum()
    question = MapQuestion(prior.basis, known.covariance, sigma, mean_s, values, share, prior.unit_dph)
    before = known.rms_sigma_dph()
    start = 0.5 * sum(extremes_of(plan))
    found = list(_growing(plan, question, before, price))
    if not found:
        raise InputError("--hours", f"{price.most_h:g}", "time for a ramp at least")
    floor = noise_dph * float(np.sqrt(mean_s / AVERAGE_S))
    shares = [1.0 - (one.sigma_dph / before) ** 2 if before > 0.0 else 0.0 for one in found]
    proposals = tuple(
        ProposedRun(
            programme=LotProgramme(
                start_c=start,
                steps=one.steps,
                hours=one.hours,
                sigma_dph=one.sigma_dph,
                rms_over_floor=float(np.sqrt(1.0 + (one.sigma_dph / floor) ** 2)),
                reached=True,
            ),
            removed_share=min(max(of, 0.0), 1.0),
            price=price.of(one.hours),
        )
        for one, of in zip(found, shares, strict=True)
    )
    worth = [p.removed_share / max(p.price, 1e-12) for p in proposals]
    return NextRun(
        gyrotc_version=__version__,
        serial=model.serial,
        axis=model.axis,
        model_hash=model.hash,
        scenario=name,
        before_dph=before,
        price_per_hour=price.per_hour,
        price_per_run=price.per_run,
        proposals=proposals,
        best=int(np.argmax(worth)),
    )


def _growing(plan: Scenario, question: MapQuestion, before: float, price: Price) -> Iterator[_Found]:
    """The best programme of each number of steps, each gone on from one of the best of the step before."""
    low, high = extremes_of(plan)
    start = 0.5 * (low + high)
    places = [float(t) for t in np.linspace(low, high, _PLACES)]
    kept = [_Found((), 0.0, before)]
    for _ in range(_MOST_STEPS):
        longer: list[_Found] = []
        for one in kept:
            at = one.steps[-1].to_c if one.steps else start
            for to, rate, hold in ((t, r, h) for t in places for r in RATES for h in HOLDS):
                if to == at and (one.steps or not hold):
                    continue
                steps = (*one.steps, ChamberStep(to_c=to, c_per_min=rate, hold_min=hold))
                if (hours := hours_of(start, steps)) <= price.most_h:
                    sigma = question.sigma_dph(*inputs_of(plan, start, steps, question.mean_s))
                    longer.append(_Found(steps, hours, sigma))
        if not longer:
            return
        kept = sorted(longer, key=lambda f: -(before**2 - f.sigma_dph**2) / price.of(f.hours))[:_KEPT]
        yield kept[0]
