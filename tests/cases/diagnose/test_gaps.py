"""States over gaps: what is learned from a training run with a gap is what the run without it would have taught."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pytest
from gyrotc.diagnose import Effect, Played, known, play_runs
from gyrotc.quality import judge
from gyrotc.recordings import load
from gyrotc.train import front_end
from numpy.typing import NDArray
from recordings import toml, write_csv

Array = NDArray[np.float64]
ROW_S, BLOCK_S, NOISE_DPH = 10.0, 20.0, 1e-3
TIME_S = ROW_S * np.arange(1500)
EFFECTS = {
    "thermal_gradient": {"tau_s": 900.0, "amplitude_dph_per_c": 1e-3},
    "hysteresis": {
        "width_c": 4.0,
        "reference_c": 0.0,
        "amplitude_dph_per_c": 1e-3,
        "amplitude_dph_per_c_per_c": 0.0,
    },
}


def played(temperature_c: Array, there: NDArray[np.bool_], *, bridged: bool) -> Played:
    """A run of which some rows are there, as training has it (`bridged`) or as the target would."""
    noise = NOISE_DPH * np.random.default_rng(1).standard_normal(TIME_S.size)
    columns = {"time_s": TIME_S, "temperature_c": temperature_c, "rate_dph": 0.01 + noise}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_csv(folder / "a.csv", {key: values[there] for key, values in columns.items()})
        (folder / "dataset.toml").write_text(toml('file = "a.csv"'), "utf-8")
        dataset = load(folder)
        front = front_end(list(dataset.runs), BLOCK_S)
        (run,) = play_runs(dataset, dataset.runs, front, judge(dataset), bridged=bridged)
    return run


def added(run: Played, effect: Effect) -> dict[int, float]:
    """What an effect adds at every training sample that is learned from, by the second at which it begins."""
    values = run.outcome(effect).added[run.in_force]
    kept = known(run, [effect])
    return {round(t): v for t, v, keep in zip(run.data.time_s, values, kept, strict=True) if keep}


@pytest.mark.parametrize(
    ("cause", "first", "rows", "turns", "size"),
    [
        ("hysteresis", 870, 168, 2.52, 0.185),
        ("hysteresis", 482, 109, 2.94, 8.91),
        ("thermal_gradient", 348, 199, 2.13, 0.0108),
        ("thermal_gradient", 997, 175, 1.48, 0.148),
        ("thermal_gradient", 481, 151, 1.62, 3.28),
    ],
)
def test_a_state_that_is_learned_from_is_that_of_the_run_without_the_gap_within_the_noise(
    cause: str, first: int, rows: int, turns: float, size: float
) -> None:
    temperature = 20.0 + 25.0 * np.sin(2.0 * np.pi * turns * TIME_S / TIME_S[-1])
    values = EFFECTS[cause] | {"amplitude_dph_per_c": size * EFFECTS[cause]["amplitude_dph_per_c"]}
    effect = Effect(cause, values)
    there = np.ones(TIME_S.size, dtype=bool)
    whole = added(played(temperature, there, bridged=True), effect)
    there[first : first + rows] = False
    gapped = played(temperature, there, bridged=True)
    learned = added(gapped, effect)
    assert learned, "what is before the gap is known"
    away = [abs(learned[t] - whole[t]) for t in learned if t in whole]
    assert max(away) <= 1.25 * gapped.noise_dph, "blocks at the edges of the gap are averages"


def test_the_target_begins_at_rest_behind_a_gap_and_training_does_not() -> None:
    temperature, there = TIME_S / 300.0, np.ones(TIME_S.size, dtype=bool)
    there[700:760] = False
    effect = Effect("thermal_gradient", EFFECTS["thermal_gradient"])
    behind = np.searchsorted(played(temperature, there, bridged=False).data.time_s, TIME_S[770])
    of_target, of_training = (
        run.outcome(effect).added[run.in_force][behind]
        for run in (played(temperature, there, bridged=mode) for mode in (False, True))
    )
    assert of_training == pytest.approx(-900.0 / 300.0 * 1e-3, rel=0.1), "a lag on a ramp of 0.2 C/min"
    assert abs(of_target) < 0.3 * abs(of_training)


def test_what_hangs_on_the_gap_is_not_learned_from() -> None:
    """On a hold an hour long nobody knows where the temperature went meanwhile, if the run shows quick ramps."""
    temperature = np.where(1000.0 * np.pi > TIME_S, 20.0 + 30.0 * np.sin(TIME_S / 200.0), 20.0)
    temperature += 0.002 * np.random.default_rng(2).standard_normal(TIME_S.size)  # no sensor is stuck
    there = (TIME_S < 6000.0) | (TIME_S > 9600.0)
    run = played(temperature, there, bridged=True)
    large = Effect("thermal_gradient", {"tau_s": 900.0, "amplitude_dph_per_c": 1.0})
    small = Effect("thermal_gradient", {"tau_s": 900.0, "amplitude_dph_per_c": 1e-6})
    behind = run.data.time_s > 9600.0
    first = np.flatnonzero(behind)[20]
    assert not known(run, [large])[first] and known(run, [small])[first]
    assert known(run, [large])[~behind].all()
    assert known(run, [])[behind].all(), "a map alone has no state"
