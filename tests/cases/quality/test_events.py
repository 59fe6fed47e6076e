"""Events, spikes, bursts and loose thermometers are found with time and size, and none where there are none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gyrotc.mirror import first_order
from gyrotc.quality import (
    check,
    curve_findings,
    found_events,
    judge,
    run_facts,
    thermometer_findings,
)
from gyrotc.recordings import Dataset, load
from gyrotc.results import Finding
from gyrotc.simulate import simulate
from gyrotc.train import FitOptions, Fitted, fit_dataset
from numpy.typing import NDArray
from recordings import Columns, changes_in, state, toml, write_csv

from bench.rows.events import scores

SEED, ROW_S, HOURS = 20261122, 10.0, 8
NOISE_DPH = 2.2e-3  # of a row: 7e-4 deg/h of 100-s means
EventColumns = dict[str, np.ndarray]


def recording(rng: np.random.Generator, kind: int) -> EventColumns:
    """Eight hours at a constant temperature, or with ramps, of a bias that follows temperature and its rate."""
    time = np.arange(0.0, 3600.0 * HOURS, ROW_S)
    corners = ([0, 8], [20, 20]) if kind % 3 == 0 else ([0, 1, 2, 4, 6, 8], [0, 0, 60, 60, -30, -30])
    temperature = np.interp(time / 3600.0, *corners) + 0.01 * np.sin(time / 300.0)
    rate = 2e-4 * temperature + 1e-6 * temperature**2 + 0.06 * np.gradient(temperature, time)
    walk = np.cumsum(rng.standard_normal(time.size)) * NOISE_DPH * (0.002 if kind % 2 else 0.0)
    noise = NOISE_DPH * rng.standard_normal(time.size)
    return {"time_s": time, "temperature_c": temperature, "rate_dph": 0.01 + rate + walk + noise}


def written(folder: Path, change: EventColumns | None = None, run: int = 1, kept: np.ndarray | None = None) -> Path:
    """Three runs; one, the second, has the rates of `change` added, and of its rows those that are `kept`."""
    rng = np.random.default_rng(SEED)
    print("seed", SEED)
    for k in range(3):
        columns = recording(rng, k)
        if k == run and change is not None:
            columns["rate_dph"] = columns["rate_dph"] + change["rate_dph"]
        if k == run and kept is not None:
            columns = {name: values[kept] for name, values in columns.items()}
        write_csv(folder / f"{k}.csv", columns)
    (folder / "dataset.toml").write_text(toml(*(f'file = "{k}.csv"' for k in range(3))), "utf-8")
    return folder


def only(dataset: Dataset) -> tuple[Finding, tuple[float, float], tuple[float, float]]:
    """The only event of a data set, and the intervals of its time and size."""
    (event,) = found_events(dataset)
    assert event.time_s is not None or event.whole_run
    assert event.size is not None
    limits = [(e.low, e.high) for e in (event.time_s or event.size, event.size)]
    return event, limits[0], limits[1]  # type: ignore[return-value]


def of_curves(dataset: Dataset) -> list[Finding]:
    """Runs that are not as the others."""
    return curve_findings(dataset, [run_facts(run, run.rows()) for run in dataset.runs])


def test_a_narrow_feature_of_the_map_that_is_passed_quickly_is_no_step(tmp_path: Path) -> None:
    """Six passages over 2 C in half a minute. A step in the same place of one passage alone is reported."""
    rng = np.random.default_rng(SEED + 3)
    time = np.arange(0.0, 3600.0 * HOURS, ROW_S)
    temperature = np.interp(time / 3600.0, [0, 1, 1.25, 3, 3.25, 6, 6.25, 8], [0, 0, 60, 60, 0, 0, 60, 60])
    feature = np.tanh((temperature - 30.0) / 1.0)
    at = float(time[np.searchsorted(temperature[time < 7200.0], 30.0)])
    for size, lasting, expected in ((0.01, 0.0, 0), (0.0, 0.02, 1)):
        rates = [size * feature + NOISE_DPH * rng.standard_normal(time.size) for _ in range(2)]
        rates[1] = rates[1] + lasting * (time >= at)
        runs = [{"time_s": time, "temperature_c": temperature, "rate_dph": rate} for rate in rates]
        found = changes_in(tmp_path / str(expected), *runs)
        assert len(found) == expected, (size, found)
        assert all(step.run == 1 and step.time_s[1] <= at <= step.time_s[2] for step in found)


def test_a_transition_carries_its_duration(tmp_path: Path) -> None:
    """Five minutes, in a hold: no step of seconds."""
    rng = np.random.default_rng(SEED + 6)
    run = recording(rng, 0)
    run["rate_dph"] = run["rate_dph"] + 0.02 * np.clip((run["time_s"] - 15_000.0) / 300.0, 0.0, 1.0)
    (found,) = changes_in(tmp_path, run)
    assert found.kind == "transition" and 180.0 <= found.duration_s <= 450.0
    assert found.time_s[1] <= 15_000.0 and found.time_s[2] >= 15_300.0
    assert found.size[0] == pytest.approx(0.02, rel=0.1)


def test_recordings_without_changes_have_none_though_temperatures_are_followed_late(tmp_path: Path) -> None:
    """Six sets of six runs with random walks, warm-up and a slow memory: kinks, but no beginning."""
    rng = np.random.default_rng(SEED + 1)
    alarms = 0
    for number in range(6):
        runs = [recording(rng, k) for k in range(6)]
        for r in runs:
            tau = rng.uniform(300.0, 3000.0)
            late = first_order(tau, r["time_s"], r["temperature_c"])
            r["rate_dph"] = r["rate_dph"] + 5e-4 * (late - r["temperature_c"]) + 0.01 * np.exp(-r["time_s"] / tau)
        alarms += bool(changes_in(tmp_path / str(number), *runs))
    print(f"{alarms} of 6 sets with a change")
    assert alarms == 0


@pytest.mark.parametrize(
    "habit",
    [
        lambda t, c: 0.02 * np.exp(-t / 600.0),  # warm-up after each power-on
        lambda t, c: 0.012 * (c > 30.0),  # a step of the map
        lambda t, c: 0.006 * np.sign(np.gradient(c, t)) * (np.abs(np.gradient(c, t)) > 1e-3),  # of heating and cooling
    ],
    ids=["warm-up", "step of the map", "sign of the slope"],
)
def test_what_a_gyro_does_in_every_run_is_no_event(
    habit: Callable[[NDArray[Any], NDArray[Any]], NDArray[Any]], tmp_path: Path
) -> None:
    rng = np.random.default_rng(SEED + 4)
    runs = [recording(rng, k) for k in (1, 2, 4)]
    for run in runs:
        run["rate_dph"] = run["rate_dph"] + habit(run["time_s"], run["temperature_c"])
    assert changes_in(tmp_path, *runs) == []


def test_noise_makes_hardly_any_event(tmp_path: Path) -> None:
    """The search has a level of one set in two hundred; of thirty at most one may have a change."""
    rng = np.random.default_rng(SEED + 5)
    time = np.arange(0.0, 3.0 * 3600.0, ROW_S)
    ramps = np.interp(time, [0.0, 3600.0, 7200.0, 10800.0], [0.0, 0.0, 50.0, 20.0])
    alarms = 0
    for k in range(30):
        rates = [0.01 + 2e-4 * ramps + NOISE_DPH * rng.standard_normal(time.size) for _ in range(2)]
        runs = [{"time_s": time, "temperature_c": ramps, "rate_dph": rate} for rate in rates]
        alarms += bool(changes_in(tmp_path / str(k), *runs))
    assert alarms <= 1


def test_a_drift_that_begins_has_its_run_time_and_slope(tmp_path: Path) -> None:
    """At a constant temperature, after five of eight hours; it is left out to the end."""
    time = np.arange(0.0, 3600.0 * HOURS, ROW_S)
    slope, at = 0.02, 5.0 * 3600.0
    folder = written(tmp_path, {"rate_dph": slope * np.maximum(time - at, 0.0) / 3600.0}, run=0)
    event, when, size = only(load(folder))
    assert event.size is not None
    assert (event.id, event.file, event.size.unit) == ("ramp", "0.csv", "deg/h/h")
    assert when[0] <= at <= when[1] and when[1] - when[0] < 1800.0
    assert size[0] <= slope <= size[1] and event.size.value == pytest.approx(slope, rel=0.1)
    assert event.leave_out_s[0][1] > time[-1]


def test_a_run_that_goes_on_at_another_level_after_a_gap_was_restarted(tmp_path: Path) -> None:
    """Seven minutes without rows. The same gap without another level is a dropout."""
    time = np.arange(0.0, 3600.0 * HOURS, ROW_S)
    kept = (time < 10_000.0) | (time > 10_400.0)
    for size, id in ((0.012, "restart"), (0.0, "dropout")):
        folder = written(tmp_path / id, {"rate_dph": size * (time > 10_200.0)}, run=0, kept=kept)
        event, when, sizes = only(load(folder))
        assert (event.id, event.file) == (id, "0.csv")
        if id == "restart":
            assert when == (9990.0, 10_410.0) and sizes[0] <= size <= sizes[1]
            assert event.leave_out_s[0][1] <= 10_410.0, "the shorter side"
            assert "power_on_s" in event.text


def test_a_step_that_stays_has_its_run_time_and_size(tmp_path: Path) -> None:
    time = np.arange(0.0, 3600.0 * HOURS, ROW_S)
    size, at = 0.01, 5.0 * 3600.0
    event, when, sizes = only(load(written(tmp_path, {"rate_dph": size * (time >= at)})))
    assert event.size is not None
    assert (event.id, event.file) == ("step", "1.csv")
    assert when[0] <= at <= when[1] and when[1] - when[0] < 600.0
    assert sizes[0] <= size <= sizes[1] and event.size.value == pytest.approx(size, rel=0.3)
    assert event.leave_out_s[0][1] > time[-1], "the shorter side"
    assert (event.exclude or "").startswith("exclude = [{from_s = ")


def test_a_step_that_comes_back_is_one_event_and_what_is_accepted_is_left_out(tmp_path: Path) -> None:
    time = np.arange(0.0, 3600.0 * HOURS, ROW_S)
    begin, end = 4.0 * 3600.0, 5.5 * 3600.0
    folder = written(tmp_path, {"rate_dph": -0.012 * ((time >= begin) & (time < end))})
    event, _, _ = only(load(folder))
    assert event.id == "step_and_recover"
    assert event.leave_out_s[0][0] <= begin and event.leave_out_s[0][1] >= end
    [judgement] = [one for one in judge(load(folder)).runs if one.run.file == "1.csv"]
    assert 500 <= judgement.count()["rate displaced"] <= 600


def test_a_burst_a_gap_and_a_lost_thermometer_are_reported(tmp_path: Path) -> None:
    """An hour of rows of a second: bursts are reported where a block has several rows."""
    rng = np.random.default_rng(SEED)
    time = np.arange(3600.0)
    temperature = 20.0 + time / 600.0 + 0.01 * rng.standard_normal(time.size)
    rate = 7e-3 * rng.standard_normal(time.size)
    rate[900:915] += 3.0 * np.sin(time[900:915])
    temperature[1500:1800] = temperature[1500]
    kept = (time < 2400.0) | (time > 2700.0)
    columns = {"time_s": time, "temperature_c": temperature, "rate_dph": rate}
    write_csv(tmp_path / "a.csv", {name: values[kept] for name, values in columns.items()})
    (tmp_path / "dataset.toml").write_text(toml('file = "a.csv"'), "utf-8")
    found = {e.id: e for e in found_events(load(tmp_path))}
    assert {"rate_outliers", "dropout", "stuck_temperature"} <= set(found) and "step" not in found
    assert found["rate_outliers"].leave_out_s[0] == pytest.approx((900.0, 915.0), abs=10.0)
    length = found["dropout"].size
    assert length is not None and length.value == pytest.approx(301.0, abs=2.0)
    assert found["stuck_temperature"].leave_out_s == (pytest.approx((1500.0, 1800.0), abs=2.0),)


def ramps(folder: Path, change: Callable[[EventColumns], None] | None = None) -> Path:
    """Four runs with ramps, an hour later in the programme each; the third is changed."""
    folder.mkdir(exist_ok=True)
    rng = np.random.default_rng(SEED)
    print("seed", SEED)
    for k in range(4):
        columns = recording(rng, 1)
        if k == 2 and change is not None:
            change(columns)
        write_csv(folder / f"{k}.csv", columns)
    head = 'schema = 1\nserial = "A"\nearth_rate = "removed"'
    (folder / "dataset.toml").write_text(toml(*(f'file = "{k}.csv"' for k in range(4)), head=head), "utf-8")
    return folder


@pytest.mark.parametrize("factor", [0.8, 1.15, 1.3])
def test_a_run_with_another_gain_is_reported_with_its_factor(tmp_path: Path, factor: float) -> None:
    def louder(columns: EventColumns) -> None:
        columns["rate_dph"] = factor * columns["rate_dph"]

    dataset = load(ramps(tmp_path, louder))
    event, _, size = only(dataset)
    assert event.size is not None
    assert (event.id, event.file, event.size.unit) == ("gain_changed", "2.csv", "times")
    assert size[0] <= factor <= size[1] and event.size.value == pytest.approx(factor, abs=0.03)
    assert event.exclude is None and event.whole_run, "the whole run goes, by its entry"


def test_a_gain_that_changes_within_a_run_has_its_time_and_factor(tmp_path: Path) -> None:
    """In the midst of four hours of ramps; a level that changes is a step, no gain."""
    at = 3.2 * 3600.0

    def louder(columns: EventColumns) -> None:
        columns["rate_dph"] = columns["rate_dph"] * np.where(columns["time_s"] >= at, 1.4, 1.0)

    def higher(columns: EventColumns) -> None:
        columns["rate_dph"] = columns["rate_dph"] + 0.02 * (columns["time_s"] >= at)

    event, when, size = only(load(ramps(tmp_path / "gain", louder)))
    assert event.size is not None
    assert (event.id, event.file, event.whole_run) == ("gain_changed", "2.csv", False)
    assert when[0] <= at <= when[1] and when[1] - when[0] < 1800.0
    assert size[0] <= 1.4 <= size[1] and event.size.value == pytest.approx(1.4, abs=0.1)
    assert (event.exclude or "").startswith("exclude = [{from_s = ")
    assert found_events(load(ramps(tmp_path / "none"))) == []
    assert [e.id for e in found_events(load(ramps(tmp_path / "level", higher)))] == ["step"]


def test_a_gain_is_placed_at_the_step_that_it_makes() -> None:
    """Before: a step at its place, and a gain more than half an hour from it."""
    (score,) = scores("gain within 1.5", 20261126, 1)
    assert score.named and score.holds and score.other == ()


def test_a_run_with_its_sign_reversed_is_reported(tmp_path: Path) -> None:
    def mirrored(columns: EventColumns) -> None:
        columns["rate_dph"] = -columns["rate_dph"]

    (event,) = of_curves(load(ramps(tmp_path, mirrored)))
    assert (event.id, event.file) == ("sign_reversed", "2.csv")


def test_runs_that_agree_are_reported_nothing_of(tmp_path: Path) -> None:
    def shifted(columns: EventColumns) -> None:
        columns["rate_dph"] = columns["rate_dph"] + 0.01

    assert of_curves(load(ramps(tmp_path))) == []
    assert of_curves(load(ramps(tmp_path, shifted))) == [], "an offset is no gain"


Floats = NDArray[np.float64]
ROWS = 28_800
RUN = 'file = "a.csv"'


def cycle(seed: int = 1) -> Columns:
    """Eight hours of rows of a second: two cycles of temperature, a smooth bias, white noise of 0.1 deg/h a row."""
    g = np.random.default_rng(seed)
    t = np.arange(ROWS) * 1.0
    temperature = 20.0 + 30.0 * np.sin(t * (4.0 * np.pi / ROWS))
    rate = 0.02 * np.sin(temperature / 12.0) + g.normal(0.0, 0.1, ROWS)
    return {"time_s": t, "temperature_c": np.round(temperature + g.normal(0.0, 0.005, ROWS), 4), "rate_dph": rate}


def fitted(folder: Path, table: Columns, run: str = RUN) -> Fitted:
    write_csv(folder / "a.csv", table)
    (folder / "dataset.toml").write_text(toml(run), "utf-8")
    return fit_dataset(load(folder), FitOptions())


def departure(one: Fitted, other: Fitted) -> float:
    """RMS between two maps over the temperatures and rates of the runs, deg/h."""
    t, r = np.meshgrid(np.linspace(-9.0, 49.0, 60), np.linspace(-0.7, 0.7, 9))
    return float(np.sqrt(np.mean((one.model.map_dph(t, r) - other.model.map_dph(t, r)) ** 2)))


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Fitted:
    return fitted(tmp_path_factory.mktemp("clean") / "R", cycle())


def test_ten_spikes_cost_less_than_a_hundredth_of_the_floor(tmp_path: Path, clean: Fitted) -> None:
    """Before: the RMS departure of the map was several noise floors, without a finding."""
    table = cycle()
    at = np.arange(1, 11) * 2600
    table["rate_dph"][at] += 5.0
    spiked = fitted(tmp_path / "R", table)
    floor = clean.training.noise_floor_dph
    print("departure in floors", departure(spiked, clean) / floor, "centers", spiked.training.centers)
    assert departure(spiked, clean) < 0.01 * floor
    assert abs(spiked.training.noise_floor_dph / floor - 1.0) < 0.01
    assert spiked.training.centers == clean.training.centers
    reported = spiked.training.content()["rows"]
    assert reported["left_out"] == {"rate outlier": 10} and reported["kept"] == ROWS - 10
    assert [s["from_s"] for s in reported["stretches"]] == at.tolist()
    [warning] = [d for d in check(tmp_path / "R").warnings if d.id == "rate_outliers"]
    again = fitted(tmp_path / "R", table, f"{RUN}\n{warning.exclude}")  # pasted as it is offered
    assert again.training.content()["rows"]["left_out"] == {"excluded": 10}
    assert "rate_outliers" not in {d.id for d in check(tmp_path / "R").warnings}


def test_a_burst_is_left_out_whole(tmp_path: Path, clean: Fitted) -> None:
    table = cycle()
    table["rate_dph"][9000:9015] += np.random.default_rng(3).normal(0.0, 20.0, 15)
    burst = fitted(tmp_path / "R", table)
    assert 14 <= burst.training.content()["rows"]["left_out"]["rate outlier"] <= 30
    assert departure(burst, clean) < 0.1 * clean.training.noise_floor_dph


def test_a_clean_recording_loses_nothing(clean: Fitted) -> None:
    assert clean.training.content()["rows"] == {"read": ROWS, "kept": ROWS, "left_out": {}, "stretches": []}


def test_nan_cells_are_missing_samples_also_inside_exclude(tmp_path: Path, clean: Fitted) -> None:
    """Before: refused, even inside `exclude`."""
    table = cycle()
    table["rate_dph"][100:130] = np.nan
    table["rate_dph"][20_000] = np.nan
    table["temperature_c"][15_000:15_004] = np.nan
    run = f'{RUN}\nexclude = [{{from_s = 90.0, to_s = 140.0, reason = "no lock"}}]'
    result = fitted(tmp_path / "R", table, run)
    assert departure(result, clean) < 0.2 * clean.training.noise_floor_dph
    assert check(tmp_path / "R").problems == ()
    [run_of] = load(tmp_path / "R").runs
    assert len(run_of.rows()) == ROWS - 4


def test_the_report_lists_what_was_left_out_with_the_line_to_paste(tmp_path: Path) -> None:
    from gyrotc.jobs import BuildRequest, build

    table = cycle()
    table["rate_dph"][[5000, 9100]] += 5.0
    write_csv(tmp_path / "R" / "a.csv", table)
    (tmp_path / "R" / "dataset.toml").write_text(toml(RUN), "utf-8")
    build(tmp_path / "R", tmp_path / "out", BuildRequest(numerics=["f32"], targets=["host-gcc-O2"]))
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    assert "Rows left out of training" in page
    lines = (
        "exclude = [{from_s = 5000.0, to_s = 5000.5, reason = &#34;left out&#34;}, "
        "{from_s = 9100.0, to_s = 9100.5, reason = &#34;left out&#34;}]"
    )
    assert lines in page


RUNS = """
extends = "signals"
[profile."up and down"]
start_c = 10.0
record_min = 240
steps = [{hold_min = 80}, {ramp_to_c = 40.0, c_per_min = 2.0}, {hold_min = 20}, {ramp_to_c = 0.0, c_per_min = 2.0},
  {hold_min = 30}, {ramp_to_c = 20.0, c_per_min = 2.0}, {hold_min = 30}]
[profile."down and up"]
start_c = 30.0
record_min = 240
steps = [{hold_min = 70}, {ramp_to_c = 0.0, c_per_min = 3.0}, {hold_min = 20}, {ramp_to_c = 40.0, c_per_min = 1.0},
  {hold_min = 30}, {ramp_to_c = 20.0, c_per_min = 2.0}, {hold_min = 30}]
[[set]]
started = 2026-01-01T00:00:00Z
profiles = ["up and down", "down and up", "up and down", "down and up"]
"""
LOOSE = """[[thermometer]]
name = "mirror_c"
node = "mirror"
loose_from_day = 2.5
[[thermometer]]
name = "case_c"
node = "case"
"""


def made(folder: Path, text: str) -> Dataset:
    (folder / "runs.toml").write_text(text, "utf-8")
    simulate(folder / "runs.toml", seed=9, out=folder / "data")
    return load(folder / "data")


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return made(tmp_path_factory.mktemp("sound"), RUNS)


def test_thermometers_at_their_places_are_not_accused(sound: Dataset) -> None:
    assert list(thermometer_findings(sound)) == []


def test_a_thermometer_that_lost_contact_is_named_with_its_run(tmp_path: Path) -> None:
    dataset = made(tmp_path, RUNS + LOOSE)
    found = list(thermometer_findings(dataset))
    assert [(f.evidence["channel"], f.file) for f in found] == [("mirror_c", "run-04.csv")]
    assert "shows" in found[0].text
    assert "less" in found[0].text


def test_one_that_answers_later_is_named_and_by_how_much(sound: Dataset) -> None:
    """The third run's mirror, delayed by ten minutes in the file itself."""

    def late(k: int) -> object:
        run = sound.runs[k]
        rows = run.rows()
        shifted = np.concatenate([np.full(60, rows.channels["mirror_c"][0]), rows.channels["mirror_c"][:-60]])
        changed = replace(rows, channels={**rows.channels, "mirror_c": shifted})
        return replace(run, reader=lambda: changed)

    runs = tuple(late(k) if k == 2 else run for k, run in enumerate(sound.runs))
    (found,) = thermometer_findings(replace(sound, runs=runs))  # type: ignore[arg-type]
    assert found.file == "run-03.csv"
    assert "s later" in found.text


def test_two_runs_say_nothing(sound: Dataset) -> None:
    assert list(thermometer_findings(replace(sound, runs=sound.runs[:2]))) == []


@pytest.mark.parametrize("factor", [1e-3, 57.29578])
def test_a_run_in_another_unit_is_named_by_its_noise(tmp_path: Path, factor: float) -> None:
    def in_unit(columns: EventColumns) -> None:
        columns["rate_dph"] = factor * columns["rate_dph"]

    dataset = load(state(ramps(tmp_path, in_unit), "trust_units = true"))
    assert [(e.id, e.file) for e in of_curves(dataset)] == [("unit_changed", "2.csv")]
