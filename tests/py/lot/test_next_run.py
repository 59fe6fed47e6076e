"""`plan --unit`: the proposed run tells more of a unit than others of its price, as measured on units' true maps."""

from __future__ import annotations

import numpy as np
import pytest
from gyrotc.common.errors import InputError
from gyrotc.lot.basis import PRIOR_LOG, LotBasis
from gyrotc.lot.earlier import widened
from gyrotc.lot.planning import HOLDS, RATES, Price, hours_of, inputs_of, next_run, programme_text
from gyrotc.lot.prior import MapPosterior, MapPrior
from gyrotc.results.planned import ChamberStep
from gyrotc.simulate.scenario import read
from gyrotc.train.evidence import Asked
from gyrotc.train.means import UnitMeans
from models import random_model
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ENVELOPE = ((-40.0, 60.0), (-5.0, 5.0))
SEED = 20
NOISE, MEAN_S = 7e-4, 50.0


def bias(own: Floats, t: Floats, r: Floats) -> Floats:
    x = (t - 10.0) / 50.0
    shape = own[0] + own[1] * x + own[2] * np.sin(2.5 * x) + own[3] * np.cos(4.0 * x) + own[4] * r / 5.0
    return np.asarray(7e-3 + 1e-3 * shape)


def before_any_run() -> MapPrior:
    """A smooth process; corrections are asked for all over the envelope."""
    basis = LotBasis.over(*ENVELOPE)
    t, r = (x.ravel() for x in np.meshgrid(np.linspace(-38, 58, 25), np.linspace(-4.5, 4.5, 7)))
    rest = PRIOR_LOG.copy()
    covariance = np.diag(basis.variance(rest))
    n = len(basis.kept)
    asked = Asked(t, r, np.full(len(t), 1.0 / len(t)), 0.0)
    return MapPrior(
        basis, 7e-3, 1e-3, *ENVELOPE, np.zeros((1, n)), covariance[None], np.ones(1), rest, asked, np.inf
    )


def measured(rng: np.random.Generator, own: Floats, steps: list[ChamberStep]) -> UnitMeans:
    t, r = inputs_of(read("paper")[1], 10.0, steps, MEAN_S)
    return UnitMeans(t, r, bias(own, t, r) + NOISE * rng.normal(size=len(t)), np.ones(len(t)), NOISE)


def as_prior(known: MapPosterior) -> MapPrior:
    return widened(known, 0.0, "", "", None)


def known_of(rng: np.random.Generator, own: Floats) -> MapPosterior:
    """After a run that has seen the warm side alone."""
    steps = [ChamberStep(to_c=60.0, c_per_min=3.0, hold_min=60.0)]
    return before_any_run().with_runs(measured(rng, own, steps))


def random_run(rng: np.random.Generator, hours: float) -> list[ChamberStep]:
    """A programme of up to four steps that costs the same within a tenth."""
    while True:
        steps, at = [], 10.0
        for _ in range(int(rng.integers(1, 5))):
            to = float(rng.choice([c for c in (-40.0, -15.0, 10.0, 35.0, 60.0) if c != at]))
            rate, hold = (float(rng.choice(x)) for x in (RATES, HOLDS))
            steps.append(ChamberStep(to_c=to, c_per_min=rate, hold_min=hold))
            at = to
        if 0.9 * hours <= hours_of(10.0, steps) <= 1.1 * hours:
            return steps


def test_the_proposal_tells_more_than_a_random_run_of_its_price() -> None:
    """Squared error of the map over the envelope once the run was measured, of units not drawn from the prior."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    owns = 0.5 * rng.normal(size=(12, 5))
    known = known_of(rng, owns[0])  # its covariance is that of all: the same temperatures
    proposed = next_run(random_model(1), known, NOISE, MEAN_S, "paper", Price())
    best = proposed.proposals[proposed.best].programme
    asked = known.prior.asked
    errors: list[list[float]] = []
    for own in owns:
        mine = as_prior(known_of(rng, own))
        truth = bias(own, asked.temperature_c, asked.slope_c_per_min)
        runs = [list(best.steps), *(random_run(rng, best.hours) for _ in range(4))]
        after = [mine.with_runs(measured(rng, own, steps)) for steps in runs]
        left = [a.mean_dph(asked.temperature_c, asked.slope_c_per_min) - truth for a in after]
        errors.append([float(np.mean(e**2)) for e in left])
    by_proposal, by_chance = np.mean(errors, axis=0)[0], np.mean(np.array(errors)[:, 1:])
    print("squared error, proposal and chance:", by_proposal, by_chance)
    assert by_proposal < by_chance
    assert programme_text(best).count("ramp to") == len(best.steps)


def test_what_is_promised_is_what_the_posterior_has_after_the_run() -> None:
    rng = np.random.default_rng(5)
    own = np.zeros(5)
    known = known_of(rng, own)
    found = next_run(random_model(1), known, NOISE, MEAN_S, "paper", Price(90.0, 150.0, 4.0))
    assert found.before_dph == pytest.approx(known.rms_sigma_dph())
    hours = [p.programme.hours for p in found.proposals]
    assert all(h <= 4.0 for h in hours)
    for one in found.proposals:
        after = as_prior(known).with_runs(measured(rng, own, list(one.programme.steps)))
        assert one.programme.sigma_dph == pytest.approx(after.rms_sigma_dph(), rel=1e-3)
        assert one.removed_share == pytest.approx(
            1.0 - (one.programme.sigma_dph / found.before_dph) ** 2, abs=1e-9
        )
        assert one.price == pytest.approx(150.0 + 90.0 * one.programme.hours)
    worth = [p.removed_share / p.price for p in found.proposals]
    assert found.best == int(np.argmax(worth))


@pytest.mark.parametrize(
    ("price", "option"),
    [
        (Price(0.0), "--price-per-hour"),
        (Price(1.0, -1.0), "--price-per-run"),
        (Price(1.0, 1.0, 0.01), "--hours"),
        (Price(1.0, 1.0, float("nan")), "--hours"),
    ],
)
def test_what_is_no_price_is_told(price: Price, option: str) -> None:
    known = known_of(np.random.default_rng(6), np.zeros(5))
    with pytest.raises(InputError, match=option):
        next_run(random_model(1), known, NOISE, MEAN_S, "paper", price)
