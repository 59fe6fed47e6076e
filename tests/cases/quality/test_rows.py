"""Rows that say nothing of a gyro are found wherever they lie, and a gyro's own effects are not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from gyrotc.quality import Judgement, check, judge_runs
from gyrotc.recordings import Rows, Run
from numpy.typing import NDArray
from recordings import toml, write_csv

Array = NDArray[np.float64]
SEED = 20261128
HOURS = {0.1: 1.0, 1.0: 4.0, 10.0: 12.0, 60.0: 24.0}


def sound(rng: np.random.Generator, row_s: float, *, walk: bool = False) -> tuple[Array, Array, Array]:
    """Times, temperatures and rates of a gyro on ramps and holds, with a curve over temperature and a warm-up."""
    time = np.arange(0.0, 3600.0 * HOURS[row_s], row_s)
    corners = np.cumsum(rng.uniform(1200.0, 4800.0, 64))
    air = np.interp(time, np.r_[0.0, corners], np.repeat(rng.uniform(-40.0, 70.0, 33), 2)[:65])
    lag = np.exp(-np.arange(0.0, 1500.0, max(row_s, 1.0)) / 300.0)
    coarse = np.interp(np.arange(-1500.0, time[-1] + 1.0, max(row_s, 1.0)), time, air)
    block = np.interp(
        time, np.arange(coarse.size) * max(row_s, 1.0) - 1500.0, np.convolve(coarse, lag / lag.sum())[: coarse.size]
    )
    noise = 7e-3 / np.sqrt(row_s)
    rate = 0.01 * np.tanh(block / 30.0) + 2e-3 * np.exp(-time / 1500.0) + noise * rng.standard_normal(time.size)
    if walk:
        rate += 0.003 * np.sqrt(row_s) * noise * np.cumsum(rng.standard_normal(time.size))
    return time, block + 0.01 * rng.standard_normal(time.size), rate


def judged(time: Array, temperature: Array, rate: Array) -> Judgement:
    rows = Rows(time, temperature, rate, {})
    period = float(np.median(np.diff(time)))
    run = Run(
        file="a.csv", path=Path("a.csv"), sha256="", role="train", environment="", started=None, power_on_s=None,
        from_s=None, to_s=None, exclude=(), row_period_s=period, n_rows=len(time), earth=None,
        pulse_weight_arcsec=None, reader=lambda: rows,
    )  # fmt: skip
    return judge_runs([run]).runs[0]


def left_out(judgement: Judgement, count: int) -> NDArray[np.bool_]:
    """Return which of so many rows are left out."""
    mask = np.zeros(count, dtype=bool)
    for one in judgement.left_out:
        mask[one.first : one.end] = True
    return mask


@pytest.mark.parametrize("row_s", HOURS)
@pytest.mark.parametrize("walk", [False, True])
def test_a_sound_run_keeps_its_rows(row_s: float, walk: bool) -> None:
    judgements = [judged(*sound(np.random.default_rng([SEED, k]), row_s, walk=walk)) for k in range(3)]
    print([one.events for one in judgements])
    assert sum(bool(one.events) for one in judgements) <= 1
    assert all(one.kept > 0.99 * one.read for one in judgements)


Plant = Callable[[Array, Array, slice, float, np.random.Generator], None]


def garbage(rate: Array, temperature: Array, at: slice, sigma: float, rng: np.random.Generator) -> None:
    rate[at] = 1e5 * sigma * rng.choice([-1.0, 1.0], at.stop - at.start)


def motion(rate: Array, temperature: Array, at: slice, sigma: float, rng: np.random.Generator) -> None:
    rate[at] += 50.0 * sigma * rng.choice([-1.0, 1.0], at.stop - at.start) * rng.uniform(0.5, 1.0, at.stop - at.start)


def held(rate: Array, temperature: Array, at: slice, sigma: float, rng: np.random.Generator) -> None:
    rate[at] = rate[at.start]


def zero(rate: Array, temperature: Array, at: slice, sigma: float, rng: np.random.Generator) -> None:
    rate[at] = 0.0


def loose(rate: Array, temperature: Array, at: slice, sigma: float, rng: np.random.Generator) -> None:
    temperature[at] += 100.0


FAULTS: dict[str, tuple[Plant, float, int]] = {
    "three rows of garbage": (garbage, 0.0, 3),
    "25 s of motion": (motion, 25.0, 3),
    "ten minutes of motion": (motion, 600.0, 3),
    "a rate that is held for three minutes": (held, 180.0, 5),
    "zero rates": (zero, 30.0, 5),
    "a loose temperature sensor": (loose, 0.0, 2),
}


@pytest.mark.parametrize("row_s", HOURS)
@pytest.mark.parametrize("name", FAULTS)
def test_rows_that_say_nothing_are_left_out_at_both_ends_and_between(name: str, row_s: float) -> None:
    plant, length_s, fewest = FAULTS[name]
    for place in (0.0, 0.37, 1.0):
        rng = np.random.default_rng([SEED, list(FAULTS).index(name)])
        time, temperature, rate = sound(rng, row_s)
        rows = max(round(length_s / row_s), fewest)
        first = round(place * (len(rate) - rows))
        plant(rate, temperature, slice(first, first + rows), 7e-3 / np.sqrt(row_s), rng)
        judgement = judged(time, temperature, rate)
        mask = left_out(judgement, len(rate))
        assert mask[first : first + rows].mean() > 0.9, (place, judgement.events)
        assert mask.sum() < rows + max(0.02 * len(rate), 20)
        assert judgement.read == judgement.kept + sum(judgement.count().values())


@pytest.mark.parametrize("row_s", [1.0, 10.0])
def test_rates_at_an_end_stop_are_left_out(row_s: float) -> None:
    time, temperature, rate = sound(np.random.default_rng(SEED), row_s)
    stop = float(np.quantile(rate, 0.7))
    judgement = judged(time, temperature, np.minimum(rate, stop))
    assert judgement.count()["rate at end stop"] > 0.29 * len(rate)
    assert [one.size for one in judgement.events if one.kind == "end_stop"] == [stop]


def test_few_rows_at_an_end_stop_stay_in_the_fit_and_the_finding_says_so(tmp_path: Path) -> None:
    time, temperature, rate = sound(np.random.default_rng(SEED), 1.0)
    clipped = np.minimum(rate, np.quantile(rate, 0.997))
    write_csv(tmp_path / "a.csv", {"time_s": time, "temperature_c": temperature, "rate_dph": clipped})
    (tmp_path / "dataset.toml").write_text(toml('file = "a.csv"'), "utf-8")
    [found] = [one for one in check(tmp_path).warnings if one.id == "end_stop"]
    assert found.evidence["rows"] == 0
    assert "stay in the fit" in found.text


@pytest.mark.parametrize("row_s", [1.0, 10.0, 60.0])
def test_a_temperature_that_is_stuck_until_the_end_is_left_out(row_s: float) -> None:
    """Beside it the same run with a sensor without noise that is still at the end, which may be a hold."""
    time, temperature, rate = sound(np.random.default_rng(SEED), row_s)
    first = round(0.8 * len(time))
    temperature[first:] = temperature[first]
    judgement = judged(time, np.round(temperature, 3), rate)
    assert left_out(judgement, len(time))[first:].mean() > 0.99
    assert left_out(judgement, len(time))[:first].mean() < 0.01
    ramp = np.round(np.minimum(0.01 * row_s * np.arange(len(time)), 0.01 * row_s * first), 2)
    smooth = np.where(np.arange(len(time)) < first, 30.0 * np.sin(np.pi * np.arange(len(time)) / first), 0.0)
    for exact in (ramp - 30.0, smooth):
        assert judged(time, exact, rate).count().get("temperature stuck", 0) == 0


@pytest.mark.parametrize("share", [0.02, 0.1])
@pytest.mark.parametrize("row_s", [1.0, 10.0])
def test_what_is_kept_between_two_end_stops_has_the_mean_of_the_rate(row_s: float, share: float) -> None:
    """Noise that both stops cut off would bend the curve: in the mean over all, and more so without the cut rows."""
    time, temperature, rate = sound(np.random.default_rng(SEED), row_s)
    smooth = 0.05 * np.tanh(temperature / 30.0)
    rate += smooth - 0.01 * np.tanh(temperature / 30.0)
    smooth += 2e-3 * np.exp(-time / 1500.0)
    clipped = np.clip(rate, *np.quantile(rate, [share, 1.0 - share]))
    kept = ~left_out(judged(time, temperature, clipped), len(rate))
    blocks = len(rate) // round(600.0 / row_s)
    means = [
        float(np.mean((clipped - smooth)[part][kept[part]]))
        for part in np.array_split(np.arange(len(rate)), blocks)
        if kept[part].mean() > 0.5
    ]
    assert len(means) > 3
    noise = 7e-3 / np.sqrt(600.0)
    assert np.sqrt(np.mean(np.square(means))) < 1.5 * noise


def test_the_ends_of_a_coarse_rate_are_no_end_stops() -> None:
    """Sixty levels of which each has as many rows as the next, the highest and the lowest too."""
    time, temperature, _ = sound(np.random.default_rng(SEED), 10.0)
    levels = np.random.default_rng(SEED + 2).permutation(np.resize(np.arange(60), len(time)))
    judgement = judged(time, temperature, 1e-3 * (levels - 30.5))
    assert [one for one in judgement.events if one.kind == "end_stop"] == []


def test_noise_that_is_far_larger_in_half_of_a_run_is_left_out_and_doubled_noise_is_reported() -> None:
    time, temperature, rate = sound(np.random.default_rng(SEED), 10.0)
    half, noise = len(rate) // 2, 7e-3 / np.sqrt(10.0)
    for factor in (400.0, 2.0):
        more = noise * np.sqrt(factor**2 - 1.0) * np.random.default_rng(SEED + 1).standard_normal(half)
        judgement = judged(time, temperature, rate + np.r_[np.zeros(len(rate) - half), more])
        parts = [one for one in judgement.events if one.kind == "noise"]
        event = max(parts, key=lambda one: one.rows[1] - one.rows[0])
        assert event.size == pytest.approx(factor, rel=0.15)
        assert abs(event.rows[0] - (len(rate) - half)) < 250
        assert event.left_out == (factor > 5.0)


def test_a_displaced_rate_is_left_out_in_a_test_run_too() -> None:
    time, temperature, rate = sound(np.random.default_rng(SEED), 10.0)
    rate[2000:2060] += 0.02
    judgement = judged(time, temperature, rate)
    assert left_out(judgement, len(rate))[2002:2058].all()
