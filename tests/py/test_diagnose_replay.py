"""What a diagnosis promises and what the target's code does: states and clocks of extension terms agree."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gyrotc.dataset import load
from gyrotc.diagnose.replay import Effect, play_runs, samples
from gyrotc.fitting import front_end
from gyrotc.model import Model
from gyrotc.quantise import quantise
from gyrotc.verify.replay import history_of

TERMS: list[dict[str, Any]] = [
    {"id": "thermal_gradient", "parameters": {"tau_s": 400.0, "amplitude_dph_per_c": 1e-4}},
    {"id": "hysteresis", "parameters": {"width_c": 3.0, "amplitude_dph_per_c": 2e-4}},
    {"id": "warm_up", "parameters": {"tau_s": 900.0, "amplitude_dph": 3e-3}},
    {
        "id": "path_length_periodicity",
        "parameters": {"period_c": 9.0, "amplitude_dph": 5e-4, "phase_rad": 0.4},
    },
]


@pytest.mark.parametrize("term", TERMS, ids=lambda t: t["id"])
@pytest.mark.parametrize("power_on_s", [0.0, -600.0])
def test_a_term_adds_the_same_in_both(
    tmp_path: Path, model_dict: dict[str, Any], term: dict[str, Any], power_on_s: float
) -> None:
    """Reference arithmetic of the emitted table, term by term, against the replay that chooses and scores."""
    time = np.arange(0.0, 4000.0, 10.0)
    temperature = 20.0 + 12.0 * np.sin(time / 500.0)
    rows = [f"{a:g},{b!r},0.0" for a, b in zip(time, temperature.tolist(), strict=True)]
    (tmp_path / "a.csv").write_text("time_s,temperature_c,rate_dph\n" + "\n".join(rows) + "\n")
    (tmp_path / "dataset.toml").write_text(
        f'schema = 1\nserial = "G1"\nearth_rate = "none"\n[[run]]\nfile = "a.csv"\npower_on_s = {power_on_s}\n'
    )
    dataset = load(tmp_path)
    (run,) = dataset.runs
    (played,) = play_runs(dataset, [run], front_end([run], 10.0))
    promised = -samples(played, [Effect(term["id"], term["parameters"])]).bias_dph

    def correction(terms: list[dict[str, Any]]) -> np.ndarray:
        model = Model.from_dict({**model_dict, "terms": terms})
        table = quantise(model, "f32")
        return np.asarray(table.decode_bias(history_of(run.rows(), run, model, table).reference.bits))

    added = correction([{**term, "channel": None}]) - correction([])
    assert added == pytest.approx(promised, abs=2e-6)
