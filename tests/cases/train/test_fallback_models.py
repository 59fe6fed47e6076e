"""What stands for a term whose channel is lost: the same bits in C and reference, and what it costs on an exam."""

from __future__ import annotations

import json
import secrets
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gyrotc.mirror import CHANNEL_LOST, Replay, Table, fallback_model, replay
from gyrotc.model import Model, Network, Scale, Term
from gyrotc.recordings import Rows, load
from gyrotc.simulate import simulate
from gyrotc.tables import NUMERICS, channels_of, quantise
from gyrotc.train import FitOptions, fit_dataset, rescaled
from libc_build import runtime
from models import random_fallback_model, random_guards, random_history, random_model, random_uncertainty
from numpy.typing import ArrayLike, NDArray

from bench.signals import rms_of, scenario_of, without

Array = np.ndarray[Any, Any]

_SAMPLES_PER_BLOCK = 4
_SEEDS = [701]  # a world that neither bench nor method was tried on


def _network_dph(model: Model, network: Network, t: ArrayLike, slope: ArrayLike) -> NDArray[np.float64]:
    """Return one network alone, deg/h."""
    return model.model_copy(update={"networks": (network,)}).map_dph(t, slope)


def with_two_channels(seed: int, **changes: Any) -> Model:
    """A random map beside two channels, each with a fallback model, and an uncertainty."""
    slopes = {"supply_v": 0.01, "magnetic_ut": -0.004}
    terms = tuple(
        Term(
            id="auxiliary",
            parameters={"slope_dph_per_unit": slope, "reference": 12.0},
            channel=name,
            fallback_model=random_fallback_model(seed + k, 0.01),
        )
        for k, (name, slope) in enumerate(slopes.items())
    )
    own = {"missing_s": 40.0, "stuck_s": 0.0, "agree_s": 0.0}
    guards = {n: g.model_copy(update=own) for n, g in random_guards(seed).items()}
    sigma = random_uncertainty(seed, len(terms))
    return random_model(seed, terms=terms, guards=guards, uncertainty_dph=sigma, **changes)


def away(rng: np.random.Generator, rows: int) -> Array:
    """Two channels that stay away alone, together, from the start, and come back; shape (rows, 2)."""
    found = 12.0 + np.cumsum(rng.normal(0.0, 0.002, (rows, 2)), axis=0)
    for column in found.T:
        at = int(rng.integers(0, 60))
        column[:at] = np.nan
        while at < rows:
            at += int(rng.integers(20, 200))
            length = int(rng.integers(1, 120))
            column[at : at + length] = np.nan
            at += length
    both = int(rng.integers(rows // 3, rows // 2))
    found[both : both + 100] = np.nan
    return found


def replayed(table: Table, channels: Array, samples_per_block: int) -> Replay:
    nothing = np.zeros(len(channels), dtype=np.int64)
    return replay(table, channels, missed=nothing, samples_per_block=samples_per_block)


@pytest.mark.parametrize("numeric", NUMERICS)
@pytest.mark.parametrize("trial", range(6))
def test_lost_channels_agree_bit_for_bit_with_the_compiled_code(numeric: str, trial: int) -> None:
    seed = secrets.randbelow(2**20)
    print("seed", seed)
    rng = np.random.default_rng(seed)
    model = with_two_channels(seed)
    table = quantise(model, numeric)
    assert table.n_fallback_models == 2
    x, missed = random_history(model, seed, 1500, _SAMPLES_PER_BLOCK)
    channels = table.encode_inputs(np.column_stack([x, away(rng, 1500)]))
    want = replay(table, channels, missed=missed, samples_per_block=_SAMPLES_PER_BLOCK)
    status, bits = runtime().steps(table, channels, missed, _SAMPLES_PER_BLOCK)
    np.testing.assert_array_equal(want.status, status[:, 2])
    np.testing.assert_array_equal(want.bits, bits)
    assert np.any(want.status & CHANNEL_LOST)


@pytest.mark.parametrize("numeric", NUMERICS)
def test_while_channels_are_lost_the_correction_is_that_of_map_and_fallback_models(numeric: str) -> None:
    """Within the bounds of map and fallback models, for one channel and for both; and without them again after."""
    model = with_two_channels(11, lead_blocks=0, stuck_s=0.0)
    table = quantise(model, numeric)
    low, high = model.envelope.temperature_c
    rows, t = 900, 0.3 * low + 0.7 * high
    temperature = np.full(rows, t)
    readings = np.full((rows, 2), 12.0)
    readings[200:400, 0] = np.nan
    readings[500:700] = np.nan
    channels = table.encode_inputs(np.column_stack([temperature, readings]))
    found = table.decode_bias(replayed(table, channels, _SAMPLES_PER_BLOCK).bits)
    of_map = float(model.map_dph(t, 0.0))
    order = [term.fallback_model for term in model.terms if term.channel == "magnetic_ut"]  # channel 1 by its name
    assert order[0] is not None
    first = float(_network_dph(model, order[0], t, 0.0))
    both = sum(float(_network_dph(model, network, t, 0.0)) for network in model.fallback_models)
    low_effect, high_effect = table.decode_bias(table.effect)
    room = 2.0 * (table.error_bound_dph + sum(table.fallback_model_bounds_dph)) + 1e-6
    for at, added in ((199, 0.0), (399, first), (499, 0.0), (699, both), (899, 0.0)):
        assert found[at] == pytest.approx(of_map + np.clip(added, low_effect, high_effect), abs=room), at


def test_sigma_counts_the_channels_that_are_lost_and_no_other() -> None:
    model = with_two_channels(11, lead_blocks=0, stuck_s=0.0)
    table = quantise(model, "f32")
    rows = 900
    readings = np.full((rows, 2), 12.0)
    readings[200:400, 0] = np.nan
    readings[500:700] = np.nan
    low, high = model.envelope.temperature_c
    channels = table.encode_inputs(np.column_stack([np.full(rows, 0.3 * low + 0.7 * high), readings]))
    bits = replayed(table, channels, _SAMPLES_PER_BLOCK).sigma
    assert bits is not None
    variance = table.decode_bias(bits) ** 2
    words = table.decode_bias(table.sigma[-len(model.terms) :]) ** 2
    of_first = words[[k for k, term in enumerate(model.terms) if term.channel == "magnetic_ut"]].sum()
    digits = 4e-7 * variance[199]  # of sigma in float32
    assert variance[399] - variance[199] == pytest.approx(of_first, rel=1e-3, abs=digits)
    assert variance[699] - variance[499] == pytest.approx(words.sum(), rel=1e-3, abs=digits)
    assert variance[899] == variance[499] == variance[199]


@pytest.mark.parametrize("numeric", NUMERICS)
def test_a_fallback_model_keeps_to_its_bound(numeric: str) -> None:
    seed = secrets.randbelow(2**20)
    print("seed", seed)
    model = with_two_channels(seed)
    table = quantise(model, numeric)
    (t0, t1), (r0, r1) = model.envelope.temperature_c, model.envelope.slope_c_per_min
    points = np.random.default_rng(seed).uniform([t0, r0], [t1, r1], (5000, 2))
    inputs = table.encode_inputs(points * [1.0, model.block_s / 60.0])
    t, slope = table.decode_inputs(inputs).T
    for k, (network, bound) in enumerate(zip(model.fallback_models, table.fallback_model_bounds_dph, strict=True)):
        made = fallback_model(table, table.n_networks + 1 + k, *table.numbers(inputs.ravel()).reshape(-1, 2).T)
        wrong = made * 2.0**-table.bias_frac_bits - _network_dph(model, network, t, slope * 60.0 / model.block_s)
        assert np.abs(wrong).max() <= bound


def test_a_network_in_another_scale_is_the_same_function() -> None:
    old = {"temperature_c": [20.0, 30.0], "slope_c_per_min": 2.0}
    model = with_two_channels(5)
    new = model.to_dict()["scale"]
    moved = rescaled(model.fallback_models[0].model_dump(mode="json"), old, new)
    own = model.model_copy(update={"scale": Scale(temperature_c=(20.0, 30.0), slope_c_per_min=2.0)})
    other = Network.model_validate_json(json.dumps(moved))
    t, r = np.linspace(*model.envelope.temperature_c, 50), np.linspace(*model.envelope.slope_c_per_min, 50)
    expected = _network_dph(own, model.fallback_models[0], t, r)
    assert _network_dph(model, other, t, r) == pytest.approx(expected, abs=1e-12)


@dataclass(frozen=True)
class World:
    """A simulated gyro: its table of one thermometer, that with channels, and the exam's rows."""

    plain: Model
    model: Model
    exam: list[Rows]

    @property
    def columns(self) -> list[str]:
        """Recorded channels that the table reads, alone or in a difference."""
        return sorted({c for t in self.model.terms for c in (t.channel or "").split(" - ")} - {"temperature_c"})


@pytest.fixture(scope="module", params=_SEEDS)
def gyro(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> World:
    folder = tmp_path_factory.mktemp("fallback models")
    (folder / "world.toml").write_text(scenario_of(request.param), "utf-8")
    simulate(folder / "world.toml", seed=request.param, out=folder / "data")
    dataset = load(folder / "data")
    plain, model = (fit_dataset(dataset, FitOptions(channels=channels)).model for channels in (False, True))
    return World(plain, model, [run.rows() for run in dataset.runs if run.role == "exam"])


def test_a_channel_lost_in_the_exam_costs_no_more_than_2_percent_over_one_thermometer(
    gyro: World, tmp_path: Path
) -> None:
    """Each channel alone, and all of them at once."""
    assert gyro.columns and all(term.fallback_model is not None for term in gyro.model.terms)
    most = 1.02 * rms_of(gyro.plain, gyro.exam, tmp_path)
    rows = gyro.exam
    for name in gyro.columns:
        assert rms_of(gyro.model, [without(r, name) for r in gyro.exam], tmp_path) <= most, name
        rows = [without(r, name) for r in rows]
    assert rms_of(gyro.model, rows, tmp_path) <= most


def test_the_correction_jumps_within_its_sigma_where_channels_are_lost(gyro: World) -> None:
    """All channels stay away for 40 minutes in every two hours of the exam, and come back."""
    table = quantise(gyro.model, "f32")
    jumps = []
    for rows in gyro.exam:
        channels = channels_of(rows, gyro.model, table)
        away_now = (rows.time_s - rows.time_s[0]) % 7200.0 >= 4800.0
        channels[np.ix_(away_now, range(1, table.n_channels))] = 0x7FC00000
        found = replayed(table, channels, 1)
        assert found.sigma is not None
        bias, sigma = table.decode_bias(found.bits), table.decode_bias(found.sigma)
        is_lost = (found.status & CHANNEL_LOST) != 0
        at = 1 + np.flatnonzero(is_lost[1:] & ~is_lost[:-1])
        assert len(at) >= 3
        assert not is_lost[~away_now & np.roll(~away_now, 10)].any()  # it came back
        jumps += (np.abs(bias[at] - bias[at - 1]) / sigma[at]).tolist()
    assert np.quantile(jumps, 0.95) <= 3.0 and max(jumps) <= 4.0
