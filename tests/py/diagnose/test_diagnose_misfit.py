"""Lack of fit under noise that is not known: what noise does is no structure, whatever is declared of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gyrotc.diagnose.attribution import attribute
from gyrotc.diagnose.candidates import Candidate, columns_of
from gyrotc.diagnose.gains import Gains
from gyrotc.diagnose.misfit import Misfit, misfit
from gyrotc.diagnose.noise import Colour, Whitener
from gyrotc.diagnose.refine import model_columns, refine
from gyrotc.diagnose.search import Search
from gyrotc.diagnose.summary import holds, looks_like
from numpy.typing import NDArray
from small_campaign import LEVEL_DPH, Campaign, small_campaign

Array = NDArray[np.float64]

WARM_UP = Candidate("warm_up", {"tau_s": 1500.0}, "columns")
SIZE_DPH = 1.2e-2
WHITE = Colour(white=LEVEL_DPH**2)
FLICKER = Colour(slow=0.5, tau_s=0.0)  # on top of white noise of 1


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    return small_campaign()


def measured(
    campaign: Campaign,
    colour: Colour,
    seed: int,
    declared: Colour | None,
    tau_s: float = 1500.0,
    size_dph: float = SIZE_DPH,
) -> Search:
    """A warm-up in noise of a colour."""
    records = campaign.records
    effect = size_dph * columns_of(records, "warm_up", {"tau_s": tau_s})[:, 0]
    draws = np.random.default_rng(seed).standard_normal((records.size, 1))
    noise = LEVEL_DPH * Whitener(colour, records.kept, records.block_s).colour(draws)[:, 0]
    return campaign.search(1e-4 * campaign.temperature + effect + noise, declared=declared)


def left(search: Search) -> Misfit:
    """What the true cause leaves."""
    causes = refine(search, Gains(search), (WARM_UP,))
    return misfit(search.extended(model_columns(causes)), "map and beside", causes)


@pytest.mark.parametrize("seed", [2, 3, 5, 7])
def test_noise_that_the_declaration_lacks_is_no_structure(campaign: Campaign, seed: int) -> None:
    """The declared white noise, contradicted by the data, made 1e-11 to 1e-47 of what a true cause left."""
    search = measured(campaign, FLICKER, seed, WHITE)
    assert search.contradicts(search.view_of(WHITE))
    found = attribute(search)
    assert [cause.candidate.id for cause in found.causes] == ["warm_up"]
    assert found.left.p_value > 0.01 and found.left.worst < 1e-6
    assert holds(found) == (found.left.share >= 0.8), (
        "beside a contradicted declaration a cause is most or nothing"
    )


def test_a_declaration_that_is_not_contradicted_counts(campaign: Campaign) -> None:
    search = measured(campaign, Colour(), 1, WHITE)
    assert not search.contradicts(search.view_of(WHITE))
    quieter = replace(search, declared=Colour(white=(0.5 * LEVEL_DPH) ** 2))
    louder = replace(search, declared=Colour(white=(2.0 * LEVEL_DPH) ** 2))
    assert left(search).worst == left(search).p_value == left(quieter).p_value, (
        "its level is that of the data"
    )
    assert left(louder).p_value >= left(search).p_value


@pytest.mark.slow
def test_a_likeliest_colour_that_is_too_fast_is_not_believed_alone(campaign: Campaign) -> None:
    """Of twelve recordings of a true cause in a random walk, 5 left less than 1 % by the likeliest colour."""
    p_values = [left(measured(campaign, Colour(walk=0.3), seed, None)).p_value for seed in range(12)]
    assert sum(p < 0.01 for p in p_values) <= 1, p_values


def test_what_never_settles_is_no_warm_up(campaign: Campaign) -> None:
    """The best time constant is several times what gyros have: a drift, which no entry of the catalogue is."""
    search = measured(campaign, Colour(), 1, None, tau_s=60000.0, size_dph=0.1)
    found = attribute(search)
    [cause] = found.causes
    assert cause.candidate.id == "warm_up" and cause.parameters["tau_s"].low > 1.5 * 8000.0
    assert found.left.p_value > 0.05 and not cause.plausible and not holds(found)
    assert (looks_like(found) or "").endswith("where 200 to 8000 s are known")
    [settles] = attribute(measured(campaign, Colour(), 1, None)).causes
    assert settles.plausible
