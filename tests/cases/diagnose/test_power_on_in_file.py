"""A gyro that was switched on anew within a recording warms up anew: in diagnosis and evaluation as on the target."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gyrotc.assess import evaluate
from gyrotc.diagnose import Effect, emitted_means, play_runs, samples
from gyrotc.model import Model
from gyrotc.quality import judge
from gyrotc.recordings import Dataset, load
from gyrotc.tables import emit
from gyrotc.train import front_end
from numpy.typing import NDArray
from recordings import toml, write_csv

ROW_S, BACK_S = 10.0, 7800.0
WARM_UP = {"tau_s": 1000.0, "amplitude_dph": 0.05}
TERM = {"id": "warm_up", "parameters": WARM_UP, "channel": None}


def warm_up(time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    on_s = np.where(time_s < BACK_S, time_s, time_s - BACK_S)
    return np.asarray(WARM_UP["amplitude_dph"] * np.exp(-on_s / WARM_UP["tau_s"]))


def model_of(model_dict: dict[str, Any], dataset: Dataset, *terms: dict[str, Any]) -> Model:
    """A map that is 0 everywhere, with terms."""
    plane = {"w0": 0.0, "linear": [0.0, 0.0], "centers": [], "widths": [], "weights": [], "region": None}
    plain = {"coverage": None, "uncertainty_dph": None, "networks": [plane], "block_s": ROW_S}
    return Model.from_dict({**model_dict, **plain, "serial": dataset.serial, "terms": list(terms)})


@pytest.fixture(params=[60.0, 600.0])
def recorded(request: pytest.FixtureRequest, tmp_path: Path) -> Dataset:
    """Two runs in one file, the second behind a gap with a power-on; rates are nothing but two warm-ups."""
    time = np.r_[np.arange(0.0, BACK_S - request.param, ROW_S), np.arange(BACK_S, 15_000.0, ROW_S)]
    temperature = 20.0 + 5.0 * np.sin(time / 2000.0)
    write_csv(tmp_path / "a.csv", {"time_s": time, "temperature_c": temperature, "rate_dph": warm_up(time)})
    runs = f'file = "a.csv"\nto_s = {BACK_S}', f'file = "a.csv"\nfrom_s = {BACK_S}\npower_on_s = {BACK_S}'
    (tmp_path / "dataset.toml").write_text(toml(*runs), "utf-8")
    return load(tmp_path)


@pytest.mark.parametrize("bridged", [False, True])
def test_the_diagnosis_takes_the_warm_up_off_both_runs(recorded: Dataset, *, bridged: bool) -> None:
    played = play_runs(recorded, recorded.runs, front_end(recorded.runs, ROW_S), judge(recorded), bridged=bridged)
    for run in played:
        left = samples(run, [Effect("warm_up", WARM_UP)]).bias_dph
        assert np.abs(left).max() < 0.01 * WARM_UP["amplitude_dph"]


def test_emitted_tables_are_switched_on_with_the_gyro(recorded: Dataset, model_dict: dict[str, Any]) -> None:
    models = [model_of(model_dict, recorded), model_of(model_dict, recorded, TERM)]
    for without, corrected in zip(*emitted_means(models, recorded.runs, 100.0), strict=True):
        assert len(without.time_s) > 60
        assert np.abs(without.after_dph).max() > 0.5 * WARM_UP["amplitude_dph"]
        assert np.abs(corrected.after_dph).max() < 0.02 * WARM_UP["amplitude_dph"]


def test_evaluation_switches_the_target_on_with_the_gyro(
    recorded: Dataset, model_dict: dict[str, Any], tmp_path: Path
) -> None:
    emit(model_of(model_dict, recorded, TERM), tmp_path / "out")
    found = evaluate(tmp_path / "out", recorded, average_s=100.0, compiled=False)
    for run in found.runs:
        assert run.before.max_abs_dph > 0.5 * WARM_UP["amplitude_dph"]
        assert run.after.max_abs_dph < 0.02 * WARM_UP["amplitude_dph"]
