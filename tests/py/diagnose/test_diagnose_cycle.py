"""A single chamber cycle: when it counts as one, what is chosen, and that the map beside it has no rate."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from gyrotc.diagnose.blocks import Records, records_of
from gyrotc.diagnose.diagnosis import diagnose
from gyrotc.diagnose.extension import Refitting
from gyrotc.diagnose.refit import Effect
from gyrotc.diagnose.single_cycle import cycle_of, is_single_cycle
from gyrotc.recordings.load import load
from gyrotc.recordings.records import joined_runs
from gyrotc.target.recursions import first_order
from gyrotc.train.fitting import FitOptions
from single_cycles import NOISE, clean_cycle

SEED = 20260321
ROW_S = 5.0
TAUS_S = (120.0, 450.0)
CUT_S = 2850.0  # the end of the second branch


def cycle(branches: int) -> tuple[np.ndarray, np.ndarray]:
    """Time and temperature of ramps between -20 and 70 C, each at another rate."""
    legs = [1500.0 - 150.0 * k for k in range(branches)]
    corners = np.concatenate(([0.0], np.cumsum(legs)))
    time = np.arange(0.0, corners[-1], ROW_S)
    return time, np.interp(time, corners, np.resize([70.0, -20.0], corners.size))


def recorded(folder: Path, temperature: np.ndarray, rate: np.ndarray, exam_from_s: float) -> Path:
    """One recording, its last part for the exam."""
    rows = [f"{ROW_S * k:g},{t:.4f},{y:.6g}" for k, (t, y) in enumerate(zip(temperature, rate, strict=True))]
    (folder / "data.csv").write_text("time_s,temperature_c,rate_dph\n" + "\n".join(rows) + "\n")
    run = '[[run]]\nfile = "data.csv"\npower_on_s = "unknown"\n'
    (folder / "dataset.toml").write_text(
        f'schema = 1\nserial = "C1"\nearth_rate = "none"\n{run}to_s = {exam_from_s}\n'
        f'{run}from_s = {exam_from_s}\nrole = "exam"\n'
    )
    return folder


def records(folder: Path) -> Records:
    return records_of(load(folder), "train", block_s=10.0, average_s=10.0)


def two_states(time: np.ndarray, temperature: np.ndarray) -> np.ndarray:
    """A curved map of T and two first-order states, with noise."""
    print("seed", SEED)
    x = (temperature - 25.0) / 45.0
    states = [first_order(tau, time, temperature) - temperature for tau in TAUS_S]
    noise = np.random.default_rng(SEED).standard_normal(time.size)
    return np.asarray(1000.0 * x + 400.0 * x**3 + 20.0 * states[0] - 15.0 * states[1] + 20.0 * noise)


def test_a_cycle_is_known_by_its_temperatures(tmp_path: Path) -> None:
    for branches, single in ((3, True), (8, False)):
        time, temperature = cycle(branches)
        folder = tmp_path / str(branches)
        folder.mkdir()
        recorded(folder, temperature, np.ones(time.size), float(time[-1]) * 0.99)
        assert is_single_cycle(records(folder)) is single


def test_two_states_are_found(tmp_path: Path) -> None:
    time, temperature = cycle(3)
    found = cycle_of(records(recorded(tmp_path, temperature, two_states(time, temperature), CUT_S)))
    assert [c.candidate.id for c in found.causes] == ["thermal_gradient"] * 2
    for cause, tau in zip(found.causes, TAUS_S, strict=True):
        interval = cause.parameters["tau_s"]
        assert interval.low <= tau <= interval.high
    assert found.p_value < 1e-6


def test_a_map_alone_needs_no_state(tmp_path: Path) -> None:
    _, temperature = cycle(3)
    x = (temperature - 25.0) / 45.0
    noise = np.random.default_rng(SEED).standard_normal(x.size)
    found = cycle_of(records(recorded(tmp_path, temperature, 1000.0 * x + 20.0 * noise, CUT_S)))
    assert found.chosen is None and found.causes == ()
    assert found.rms_dph == pytest.approx(20.0 / np.sqrt(2.0), rel=0.1), "two rows a block"


def test_the_unseen_branch_is_followed_by_a_map_of_t_alone(tmp_path: Path) -> None:
    """The map of (T, dT/dt) fails on the third branch, states beside a map of T do not."""
    time, temperature = cycle(3)
    folder = recorded(tmp_path, temperature, two_states(time, temperature), CUT_S)
    found = diagnose(load(folder), options=FitOptions(average_s=10.0))
    assert found.result.verdict in ("ambiguous", "partial")
    extended = found.result.content()["extended"]
    assert extended["terms"] == ["thermal_gradient", "thermal_gradient"]
    gain = extended["gain"]
    assert gain["exam_rms_after_dph"] < 0.5 * gain["exam_rms_before_dph"]
    assert found.model is not None
    low, high = found.model.envelope.slope_c_per_min
    at = np.array([20.0, 20.0])
    cold, hot = found.model.map_dph(at, np.array([low, high]))
    assert cold == pytest.approx(hot, rel=1e-5), "no dT/dt in the map"


def test_clean_cycles_get_no_memory(tmp_path: Path) -> None:
    """Gyros with a static map of (T, dT/dt); `make cycles` has 100 at four levels of the noise, here are a few."""
    count = int(os.environ.get("GYROTC_CYCLES", "8"))
    named = []
    for seed in range(count):
        found = cycle_of(clean_cycle(tmp_path, seed, NOISE[seed % len(NOISE)]))
        named += [(seed, found.causes[0].candidate.id, found.lead)] if found.causes else []
    print(f"{len(named)} of {count} clean cycles named", named)
    assert len(named) <= 0.02 * count, named


def test_a_correction_hardly_depends_on_the_length_of_a_block(tmp_path: Path) -> None:
    """The same cycle by blocks of 5, 10 and 20 s: the same states, and the same error on the unseen branch."""
    time, temperature = cycle(3)
    folder = recorded(tmp_path, temperature, two_states(time, temperature), CUT_S)
    left = []
    for block_s in (5.0, 10.0, 20.0):
        refitting = Refitting(
            load(folder),
            records_of(load(folder), "train", block_s=block_s, average_s=100.0),
            FitOptions(block_s=block_s),
            single_cycle=True,
        )
        effects = [Effect.of(state) for state in cycle_of(refitting.records).states]
        (chain,) = refitting.on_exam([effects])
        left.append(float(np.sqrt(np.mean(np.concatenate([a.after_dph for a in chain]) ** 2))))
    assert max(left) < 1.05 * min(left), left


def test_spans_that_touch_are_one_run(tmp_path: Path) -> None:
    time, temperature = cycle(3)
    recorded(tmp_path, temperature, two_states(time, temperature), CUT_S)
    whole = load(tmp_path).runs
    text = (tmp_path / "dataset.toml").read_text()
    run = '[[run]]\nfile = "data.csv"\npower_on_s = "unknown"\n'
    cut = f"{run}from_s = 1000.0\nto_s = {CUT_S}\n{run}to_s = 1000.0\n"
    (tmp_path / "dataset.toml").write_text(text.replace(f"{run}to_s = {CUT_S}\n", cut))
    assert len(load(tmp_path).runs) == 3
    assert joined_runs(load(tmp_path).runs) == joined_runs(whole)


def test_a_ramp_that_never_turns_cannot_test_memory(tmp_path: Path) -> None:
    time, temperature = cycle(1)
    found = diagnose(load(recorded(tmp_path, temperature, two_states(time, temperature), 1400.0)))
    result = found.result.content()
    assert result["verdict"] == "not_testable" and result["causes"] == []
    assert result["single_cycle"]["turns"] == 0 and "never turns" in result["text"]
    untestable = {c["id"] for c in result["considered"] if "not_testable" in c}
    assert {"thermal_gradient", "hysteresis"} <= untestable
