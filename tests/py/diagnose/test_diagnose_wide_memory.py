"""Hysteresis of any form is hysteresis: relays of many widths, loops whose strength goes with temperature."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from conftest import quick_and_slow
from gyrotc.causes import CATALOGUE
from gyrotc.causes.base import History
from gyrotc.diagnose.attribution import Attribution, attribute
from gyrotc.diagnose.blocks import Records
from gyrotc.diagnose.candidates import columns_of
from gyrotc.diagnose.gains import Gains
from gyrotc.diagnose.marginal_likelihood import MarginalLikelihood
from gyrotc.diagnose.search import Search
from gyrotc.diagnose.summary import holds, sentence_of, shows_as, verdict_of
from gyrotc.diagnose.wide_memory import WideMemory, outlasts, rate_independent
from gyrotc.target.recursions import first_order, play
from numpy.typing import NDArray
from small_campaign import LEVEL_DPH, Campaign, small_campaign

Array = NDArray[np.float64]
WIDTH_C = 6.0


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    return small_campaign()


def measured(campaign: Campaign, effect: Array, d: float, seed: int) -> Search:
    """An effect in white noise, as large as makes its energy beside the map d²."""
    static = campaign.bank.map
    size = d * LEVEL_DPH / float(np.linalg.norm(effect - static @ (static.T @ effect)))
    noise = LEVEL_DPH * np.random.default_rng(seed).standard_normal(effect.size)
    return campaign.search(1e-4 * campaign.temperature + size * effect + noise)


def relays(records: Records, seed: int) -> Array:
    """The mean of forty relays, each with a place and a width of its own: nothing of it is a play."""
    rng = np.random.default_rng(seed)
    place, half = rng.normal(15.0, 15.0, 40), 4.0 * np.exp(rng.normal(0.0, 0.5, 40))

    def mean(history: History) -> Array:
        state = np.where(history.temperature_c[0] > place, 1.0, -1.0)
        out = np.empty((history.temperature_c.size, 1))
        for k, t in enumerate(history.temperature_c.tolist()):
            state = np.where(t > place + half, 1.0, np.where(t < place - half, -1.0, state))
            out[k] = state.mean()
        return out

    return records.columns(mean)[:, 0]


def local_loop(history: History) -> Array:
    """A play that acts about 40 C and hardly elsewhere."""
    t = history.temperature_c
    return np.asarray(((play(WIDTH_C, t) - t) * np.exp(-(((t - 40.0) / 15.0) ** 2)))[:, None])


def loop(history: History) -> Array:
    return np.asarray((play(WIDTH_C, history.temperature_c) - history.temperature_c)[:, None])


def gradient(history: History) -> Array:
    lag = first_order(600.0, history.time_s, history.temperature_c)
    return np.asarray((lag - history.temperature_c)[:, None])


def local_gradient(history: History) -> Array:
    return np.asarray(gradient(history) * np.exp(-(((history.temperature_c[:, None] - 40.0) / 15.0) ** 2)))


def named(found: Attribution) -> list[str]:
    return [c.candidate.id for c in found.causes] if holds(found) else []


@pytest.mark.parametrize("seed", quick_and_slow([0], [1, 2, 3]))
def test_relays_are_hysteresis(campaign: Campaign, seed: int) -> None:
    """One play leaves what one finds with certainty, and is not four fifths of it: it was told as unexplained."""
    found = attribute(measured(campaign, relays(campaign.records, seed), 40.0, seed))
    assert named(found) == ["hysteresis"] and found.wide is not None
    assert found.left.share > 0.8 and verdict_of(found, ()) in ("explained", "partial")
    assert found.columns.shape[1] > found.wide.columns.shape[1], "the play itself stays in the model"


@pytest.mark.slow
def test_relays_need_no_second_cause(campaign: Campaign) -> None:
    """A lag and a finer map beside a play came as near to these, and stood with it as three causes."""
    found = attribute(measured(campaign, relays(campaign.records, 0), 25.0, 0))
    assert named(found) == ["hysteresis"]


@pytest.mark.slow
def test_a_wave_beside_a_play_stays_a_cause_of_its_own(campaign: Campaign) -> None:
    wave = columns_of(campaign.records, "path_length_periodicity", {"period_c": 9.0})[:, 0]
    effect = campaign.records.columns(loop)[:, 0] / 6.0 + wave
    found = attribute(measured(campaign, effect, 40.0, 3))
    assert set(named(found)) == {"hysteresis", "path_length_periodicity"}


@pytest.mark.parametrize("seed", quick_and_slow([0], [1]))
def test_a_strength_that_goes_with_temperature_is_told(campaign: Campaign, seed: int) -> None:
    found = attribute(measured(campaign, campaign.records.columns(local_loop)[:, 0], 25.0, seed))
    assert named(found) == ["hysteresis"] and found.wide is not None
    assert found.wide.varies and "goes with temperature" in found.wide.text


@pytest.mark.parametrize("seed", quick_and_slow([2], [3]))
def test_a_loop_about_one_temperature_is_no_lag(campaign: Campaign, seed: int) -> None:
    """A lag of the whole map came nearer to it than one play of one strength, and was named."""
    search = measured(campaign, campaign.records.columns(local_loop)[:, 0], 40.0, seed)
    gains = Gains(search)
    assert MarginalLikelihood(gains).preferred(list(gains.single())).members[0].id == "cavity_lag"
    found = attribute(search)
    assert named(found) == ["hysteresis"] and found.left.share > 0.9
    assert "cavity_lag" not in [r.id for r in found.rivals[0]]


@pytest.mark.parametrize("seed", range(2))
def test_a_play_of_one_strength_is_not_told_to_change(campaign: Campaign, seed: int) -> None:
    wide = rate_independent(Gains(measured(campaign, campaign.records.columns(loop)[:, 0], 40.0, seed)), ())
    assert wide is not None and not wide.varies and "goes with" not in wide.text


@pytest.mark.parametrize("shape", [gradient, local_gradient])
@pytest.mark.parametrize("seed", range(2))
def test_memory_that_fades_is_no_hysteresis(
    campaign: Campaign, shape: Callable[[History], Array], seed: int
) -> None:
    """However it acts over temperature: the rival is as wide as the family of plays."""
    gains = Gains(measured(campaign, campaign.records.columns(shape)[:, 0], 40.0, seed))
    assert rate_independent(gains, ()) is None
    assert not outlasts(gains, 0.0, -np.inf), "as good as one play"
    assert not outlasts(gains, 1e3, -np.inf), "far better than one play"


def test_noise_is_no_hysteresis(campaign: Campaign) -> None:
    for seed in range(3):
        gains = Gains(measured(campaign, np.sin(np.arange(campaign.records.size) * 1.7), 0.0, seed))
        assert rate_independent(gains, ()) is None


def test_what_is_beside_is_not_counted_again(campaign: Campaign) -> None:
    """Where another cause holds it already, nothing is left that speaks for hysteresis."""
    column = campaign.records.columns(loop)
    gains = Gains(measured(campaign, column[:, 0], 40.0, 1))
    assert rate_independent(gains, ()) is not None
    assert rate_independent(gains, (column,)) is None


def test_the_page_says_what_a_table_does_not_hold() -> None:
    """In the finding and in how the cause shows; a cause of another family shows as it always does."""
    none = np.zeros((3, 0))
    goes, more = WideMemory(100.0, 50.0, none), WideMemory(100.0, 99.0, none)
    assert "goes with temperature" in shows_as("hysteresis", goes)
    assert "more than a single play" in shows_as("hysteresis", more)
    assert shows_as("warm_up", goes) == CATALOGUE["warm_up"].words.signature
    assert "goes with temperature" in sentence_of("explained", (), None, "", goes)
    assert sentence_of("explained", (), None, "") == sentence_of("explained", (), None, "", None)
