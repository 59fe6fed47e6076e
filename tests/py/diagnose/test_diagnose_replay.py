"""What a diagnosis promises and what the target's code does: states and clocks of extension terms agree."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gyrotc.causes import CATALOGUE
from gyrotc.diagnose.diagnosis import diagnose
from gyrotc.diagnose.extension import stand_ins_of
from gyrotc.diagnose.refit import Effect, Played, added_range, play_runs, samples
from gyrotc.model import Model
from gyrotc.recordings.load import load
from gyrotc.recordings.records import Rows, Run
from gyrotc.simulate.campaign import simulate
from gyrotc.tables.quantise import quantise
from gyrotc.target.maps import evaluate_map
from gyrotc.train.data import joined
from gyrotc.train.fitting import FitOptions, FrontEnd, fit_dataset, front_end
from gyrotc.train.samples import missed_before
from gyrotc.verify.replay import history_of
from libc_build import ROOT
from numpy.typing import NDArray

sys.path.insert(0, str(ROOT))
from bench.signals import rms_of, without

Array = NDArray[np.float64]

VALUES: dict[str, dict[str, float]] = {
    "cavity_lag": {"tau_s": 300.0},
    "thermal_gradient": {"tau_s": 400.0, "amplitude_dph_per_c": 1e-4},
    "hysteresis": {"width_c": 3.0, "amplitude_dph_per_c": 2e-4},
    "warm_up": {"tau_s": 900.0, "amplitude_dph": 3e-3},
    "path_length_periodicity": {"period_c": 9.0, "amplitude_dph": 5e-4, "phase_rad": 0.4},
    "auxiliary": {"slope_dph_per_unit": 1e-2, "reference": 27.9},
}
HELD = [id for id, term in CATALOGUE.items() if term.table is not None and term.search is not None]
BLOCK_S, ROW_S = 40.0, 10.0
TIME = np.arange(0.0, 8000.0, ROW_S)
ERROR_DPH = 2e-8  # float32 of the target: 2^-23 of 60 C, kept by a memory of 10 blocks, at 2e-4 deg/h/C


def _wave(time_s: Array) -> Array:
    return np.asarray(20.0 + 12.0 * np.sin(time_s / 500.0))


def _no_gap() -> tuple[Array, Array, Array]:
    return TIME, _wave(TIME), 28.0 + 0.1 * np.cos(TIME / 300.0)


def _gap() -> tuple[Array, Array, Array]:
    """200 s without rows, and later 600 s, after which the target has fallen back to its constant."""
    time, temperature, channel = _no_gap()
    there = ~((time >= 3010.0) & (time < 3210.0)) & ~((time >= 5020.0) & (time < 5620.0))
    return time[there], temperature[there], channel[there]


def _restart() -> tuple[Array, Array, Array]:
    """A step that no gyro makes: the target holds its last mean until three samples agree, then starts anew."""
    time, temperature, channel = _no_gap()
    return time, temperature + np.where(time > 3010.0, 9.0, 0.0), channel


def _missing_channel() -> tuple[Array, Array, Array]:
    """A channel that is away for one row, then for several blocks, and that comes late."""
    time, temperature, channel = _no_gap()
    away = (time < 95.0) | (time == 1000.0) | ((time >= 3010.0) & (time < 3210.0))
    return time, temperature, np.where(away, np.nan, channel)


def _first_block() -> tuple[Array, Array, Array]:
    """Nothing believable in the first block and a half, then a quick ramp."""
    time, temperature, channel = _no_gap()
    temperature = temperature + 0.02 * time
    return time, np.where(time < 55.0, np.nan, temperature), channel


CASES = {
    "no gap": _no_gap,
    "gap": _gap,
    "restart": _restart,
    "missing channel": _missing_channel,
    "first block": _first_block,
}


@pytest.fixture
def recorded(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> tuple[Run, FrontEnd, Played]:
    """A recording of a case, with samples that did not arrive as NaN, after the front end."""
    case, power_on_s = request.param
    folder, (time, temperature, channel) = tmp_path, CASES[case]()
    (folder / "a.csv").write_text(
        "time_s,temperature_c,supply_v,rate_dph\n" + "".join(f"{t:g},20.0,28.0,0.0\n" for t in time)
    )
    (folder / "dataset.toml").write_text(
        f'schema = 1\nserial = "G1"\nearth_rate = "none"\n[[run]]\nfile = "a.csv"\npower_on_s = {power_on_s}\n'
    )
    dataset = load(folder)
    rows = Rows(time, temperature, np.zeros_like(time), {"supply_v": channel})
    monkeypatch.setattr(Run, "rows", lambda _: rows)
    (run,) = dataset.runs
    front = front_end([run], BLOCK_S)
    (played,) = play_runs(dataset, [run], front)
    return run, front, played


def _model(model_dict: dict[str, Any], front: FrontEnd, terms: list[dict[str, Any]]) -> Model:
    """A map that is a plane over everything that occurs, with the front end of the diagnosis."""
    plane = {"w0": 0.007, "linear": [2e-3, 1e-3], "centers": [], "widths": [], "weights": [], "region": None}
    wide = {"temperature_c": [-80.0, 180.0], "slope_c_per_min": [-30.0, 30.0]}
    return Model.from_dict(
        {
            **model_dict,
            "scale": {"temperature_c": [50.0, 130.0], "slope_c_per_min": 30.0},
            "envelope": wide,
            "coverage": None,
            "uncertainty_dph": None,
            "networks": [plane],
            "block_s": front.block_s,
            "slope_blocks": front.slope_blocks,
            "lead_blocks": front.lead_blocks,
            "hold_blocks": front.hold_blocks,
            "max_step_c": front.max_step_c,
            "max_rate_c_per_min": front.max_rate_c_per_min,
            "terms": terms,
        }
    )


@pytest.mark.parametrize(
    "recorded",
    [(case, on_s) for case in CASES for on_s in (0.0, -600.0)],
    indirect=True,
    ids=lambda p: f"{p[0]}, on at {p[1]:g} s",
)
@pytest.mark.parametrize("cause", HELD)
def test_the_replay_is_what_the_target_does(
    recorded: tuple[Run, FrontEnd, Played], model_dict: dict[str, Any], cause: str
) -> None:
    """Every used block: the map at the replay's inputs plus the replay's additions is the reference's correction."""
    run, front, played = recorded
    channel = "supply_v" if cause == "auxiliary" else None
    term = {"id": cause, "parameters": VALUES[cause], "channel": channel}
    model = _model(model_dict, front, [term])
    table = quantise(model, "f32")
    data = samples(played, [Effect(cause, VALUES[cause], channel)])
    inputs = np.column_stack([data.temperature_c, data.slope_c_per_min * (front.block_s / 60.0)])
    plane = table.decode_bias(evaluate_map(table, table.encode_inputs(inputs))[1])
    promised = plane + (played.data.bias_dph - data.bias_dph)

    rows = run.rows()
    history = history_of(rows, run, model, table)
    # A correction in force during a block is the one after the block's last row.
    missed = missed_before(rows.time_s, run.row_period_s)
    position = np.arange(len(rows)) + np.cumsum(missed)
    per_block = history.samples_per_block
    last = np.searchsorted(position, per_block * (_numbers(data.time_s, rows.time_s[0], front) + 1) - 1)
    there = position[np.minimum(last, len(rows) - 1)] % per_block == per_block - 1
    done = table.decode_bias(history.reference.bits[last[there]])
    assert there.sum() > 0.9 * data.bias_dph.size
    assert promised[there] == pytest.approx(done, abs=ERROR_DPH, rel=0.0)


def _numbers(time_s: Array, first_s: float, front: FrontEnd) -> NDArray[np.int64]:
    """Numbers of the blocks that begin at these times."""
    return np.rint((time_s - first_s) / front.block_s).astype(np.int64)


SCENARIO = """
extends = "supply-voltage"
[[set]]
role = "train"
started = 2026-03-02T08:00:00Z
profiles = ["cold start 60 C", "slow staircase", "fast full range"]
[[set]]
role = "exam"
started = 2026-03-16T08:00:00Z
profiles = ["nested loops"]
"""


@pytest.mark.slow
def test_a_gap_in_every_run_costs_an_extension_next_to_nothing(tmp_path: Path) -> None:
    """200 s without rows: with a channel of 0 in their place the extension made five times its gain of new error."""
    (tmp_path / "short.toml").write_text(SCENARIO)
    simulate(tmp_path / "short.toml", seed=3, out=tmp_path / "data")
    left = []
    for gap in (0, 20):
        for path in (tmp_path / "data").glob("run-*.csv"):
            lines = path.read_text().splitlines(keepends=True)
            middle = len(lines) // 2
            path.write_text("".join(lines[:middle] + lines[middle + gap :]))
        result = diagnose(load(tmp_path / "data")).result.content()
        assert (result["verdict"], result["extended"]["terms"]) == ("explained", ["auxiliary"])
        left.append(result["extended"]["gain"]["exam_rms_after_dph"])
    assert left[1] < 1.02 * left[0]


@pytest.mark.slow
def test_a_lost_channel_costs_an_extension_no_more_than_2_percent_over_one_thermometer(
    tmp_path: Path,
) -> None:
    (tmp_path / "short.toml").write_text(SCENARIO)
    simulate(tmp_path / "short.toml", seed=3, out=tmp_path / "data")
    dataset = load(tmp_path / "data")
    model = diagnose(dataset).model
    assert model is not None and [t.channel for t in model.terms] == ["supply_v"]
    assert model.terms[0].stand_in is not None
    plain = fit_dataset(dataset, FitOptions(method="mrbf", centers=model.n_centers)).model
    exam = [run.rows() for run in dataset.runs if run.role == "exam"]
    lost = rms_of(model, [without(rows, "supply_v") for rows in exam], tmp_path)
    assert rms_of(model, exam, tmp_path) < lost <= 1.02 * rms_of(plain, exam, tmp_path)


def test_a_stand_in_takes_what_map_and_other_terms_leave_and_is_of_channels_alone(tmp_path: Path) -> None:
    (tmp_path / "short.toml").write_text(SCENARIO)
    simulate(tmp_path / "short.toml", seed=4, out=tmp_path / "data")
    dataset = load(tmp_path / "data")
    runs = [run for run in dataset.runs if run.role == "train"]
    played = play_runs(dataset, runs, front_end(runs, 10.0))
    effects = [Effect(id, VALUES[id], "supply_v" if id == "auxiliary" else None) for id in VALUES]
    effects = [e for e in effects if e.id in ("hysteresis", "auxiliary")]
    plain = fit_dataset(dataset, FitOptions(method="linear")).model
    found = stand_ins_of(plain, joined([samples(run, effects) for run in played]), played, effects)
    assert list(found) == ["supply_v"]
    stand_in = found["supply_v"]
    beside = joined([samples(run, effects[:1]) for run in played])
    left = beside.bias_dph - plain.map_dph(beside.temperature_c, beside.slope_c_per_min)
    assert stand_in.sigma_dph > 0.0 and np.ptp(stand_in.added) > 0.0
    assert np.sqrt(np.mean((left - stand_in.added) ** 2)) < left.std(), "better than any constant"
    low, high = added_range(played, effects[:1], stand_in.added)
    alone = added_range(played, effects[:1])
    assert low >= alone[0] + stand_in.added.min() - 1e-12 and high <= alone[1] + stand_in.added.max() + 1e-12
