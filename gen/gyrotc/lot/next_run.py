"""Which run to record next for a unit: the programme that removes most of its map's variance for its price.

The posterior's covariance after a run follows from the temperatures alone, so what a run is expected to bring is known
before it is recorded: the mean of the variance over where corrections are asked for, before less after.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import __version__
from ..common.errors import InputError
from ..model import Model
from ..results.lot_plan import ChamberStep, LotProgramme
from ..results.next_run import NextRun, ProposedRun
from ..simulate.scenario import Scenario, read
from .prior import MapPosterior
from .with_lot import AVERAGE_S, HOLDS, RATES, MapQuestion, extremes_of, hours_of, inputs_of

__all__ = ["Price", "next_run"]

_PLACES = 5  # set points between the extremes: a quarter of the span is about as far as a map is smooth
_KEPT = 2  # programmes of each length that are gone on from: the best first step does not always begin the best run
_MOST_STEPS = (
    4  # of a run: each further one multiplies the time of the search, and adds less than the one before
)


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
    model: Model,
    known: MapPosterior,
    noise_dph: float,
    mean_s: float,
    scenario: str | Path,
    price: Price,
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
    proposals = tuple(_proposed(start, one, before, floor, price) for one in found)
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


def _proposed(start_c: float, found: _Found, before: float, floor: float, price: Price) -> ProposedRun:
    share = 1.0 - (found.sigma_dph / before) ** 2 if before > 0.0 else 0.0
    return ProposedRun(
        programme=LotProgramme(
            start_c=start_c,
            steps=found.steps,
            hours=found.hours,
            sigma_dph=found.sigma_dph,
            rms_over_floor=float(np.sqrt(1.0 + (found.sigma_dph / floor) ** 2)),
            reached=True,
        ),
        removed_share=min(max(share, 0.0), 1.0),
        price=price.of(found.hours),
    )
