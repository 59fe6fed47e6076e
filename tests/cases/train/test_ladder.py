"""The candidates of corrections, where its training runs are cut, and what is refused before anything is read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from conftest import MEASURED
from gyrotc.common import InputError
from gyrotc.recordings import SIMPLE, Dataset, Run, load
from gyrotc.train import (
    CANDIDATES,
    Fit,
    FitOptions,
    Fitted,
    Fold,
    TrainingData,
    fit,
    fit_dataset,
    fit_simple,
    folds,
    gather,
    objection_to,
    predict,
    turning_points,
)
from recordings import toml, write_csv
from training_data import NOISE_DPH, rms, samples, true_bias

Change = Callable[[TrainingData], TrainingData]


def auto(data: TrainingData) -> Fit:
    return fit(data, method="auto")


def with_bias(data: TrainingData, bias: np.ndarray, noise_dph: float = NOISE_DPH) -> TrainingData:
    noise = np.random.default_rng(7).normal(0.0, noise_dph * np.sqrt(10.0), len(bias))
    return replace(data, bias_dph=bias + noise)


@pytest.mark.parametrize("seed", range(4))
def test_a_gyro_that_repeats_gets_a_map_that_is_as_good_as_the_default_was(seed: int) -> None:
    data = samples(seed)
    found = auto(data)
    error = predict(found, data.temperature_c, data.slope_c_per_min)
    error -= true_bias(data.temperature_c, data.slope_c_per_min)
    assert rms(error) < 0.25 * NOISE_DPH
    assert not found.findings
    assert [row["id"] for row in found.candidates] == list(CANDIDATES)
    assert [row["id"] for row in found.candidates if row["chosen"]] == [found.method]


@pytest.mark.parametrize(
    ("name", "bias"),
    [
        ("constant", lambda t, r: 0.0 * t + 5.0),
        ("cubic_slope", lambda t, r: 5.0 + 4e-5 * t - 2e-6 * t**2 + 1e-8 * (t - 10.0) ** 3),
        ("cubic_slope", lambda t, r: 5.0 + 4e-5 * t - 2e-6 * t**2 + 8e-4 * r),
    ],
)
def test_the_simplest_correction_that_does_is_taken(name: str, bias: Callable[..., np.ndarray]) -> None:
    data = samples(0)
    data = with_bias(data, bias(data.temperature_c, data.slope_c_per_min))
    found = auto(data)
    assert found.method == name, found.candidates
    assert not found.findings, "a constant that leaves noise only is no failure"


@pytest.mark.parametrize("average_s", [10.0, 20.0, 40.0, 100.0])
def test_white_noise_is_no_failure_over_any_averaging_time(average_s: float) -> None:
    """Averages that are shorter than the means of the model have more noise than these."""
    data = samples(0)
    found = fit(with_bias(data, np.full(len(data), 5.0)), method="auto", average_s=average_s)
    assert found.method == "constant"
    assert not found.findings


def test_a_bias_that_every_run_makes_anew_leaves_the_constant_and_says_why() -> None:
    """Each run has a slope of its own: within a run a map looks good, on another run it does harm."""
    data = samples(0)
    slope = np.array([3e-4, -4e-4, 1e-4])[data.run]
    found = auto(with_bias(data, 5.0 + slope * data.temperature_c + np.array([0.0, 5e-3, -9e-3])[data.run]))
    assert found.method == "constant"
    [finding] = found.findings
    assert finding["id"] == "does_not_generalise"
    assert "3 whole runs" in finding["text"] and "Repeat" in finding["text"]
    assert finding["evidence"]["best"] != "constant", "the best of those that were tried in its place"
    assert "nothing is shown to be better" in found.reason


def repeated(data: TrainingData, times: int) -> TrainingData:
    """The runs so many times, each with a number of its own."""
    parts = [replace(data, run=data.run + 3 * k) for k in range(times)]
    return TrainingData(*(np.concatenate([getattr(p, n) for p in parts]) for n in TrainingData.__dataclass_fields__))


def test_coefficients_that_scatter_between_power_ons_are_shrunk() -> None:
    """Six power-ons with a slope of their own about none: least squares follows their mean, the model less."""
    data = repeated(samples(0), 2)
    slope = np.array([3e-4, -4e-4, 1e-4, 2e-4, -1e-4, 3e-4])[data.run]
    data = with_bias(data, 5.0 + slope * data.temperature_c)
    found = auto(data)
    least_squares = fit(data, method="cubic_slope")
    spans = [np.ptp(predict(f, np.linspace(-30.0, 50.0, 9), 0.0)) for f in (least_squares, found)]
    assert spans[1] < 0.9 * spans[0]


def test_an_offset_of_each_power_on_is_not_taken_for_the_map() -> None:
    """Each run visits other temperatures: without intercepts of power-ons the offsets become structure over T."""
    errors = []
    for seed in range(4):
        data = repeated(samples(seed), 2)
        offset = np.random.default_rng(seed).normal(0.0, 5.0 * NOISE_DPH, 6)
        truth = true_bias(data.temperature_c, data.slope_c_per_min)
        found = auto(with_bias(data, truth + offset[data.run]))
        error = predict(found, data.temperature_c, data.slope_c_per_min) - truth
        errors.append(rms(error[data.run == 2] - error[data.run == 2].mean()))
    assert rms(np.array(errors)) < 0.5 * NOISE_DPH


def times_left_out(data: TrainingData, found: tuple[Fold, ...]) -> np.ndarray:
    return np.asarray(sum(fold.held(data).astype(int) for fold in found))


def test_folds_are_whole_runs_and_do_not_overlap() -> None:
    data = samples(0)
    found = folds(data)
    assert [(fold.kind, fold.spans[0].run) for fold in found] == [("run", 0), ("run", 1), ("run", 2)]
    assert (times_left_out(data, found) == 1).all()


def test_a_power_on_is_left_out_with_all_its_runs() -> None:
    """A run of the same power-on would tell its constant."""
    data = samples(0)
    found = folds(data, np.array([0, 1, 0]))
    assert [(fold.kind, [span.run for span in fold.spans]) for fold in found] == [("power-on", [0, 2]), ("run", [1])]
    assert (times_left_out(data, found) == 1).all()


def test_of_one_power_on_its_runs_are_left_out() -> None:
    assert [fold.kind for fold in folds(samples(0), np.zeros(3, dtype=np.int64))] == ["run"] * 3


def test_of_a_single_run_branches_are_left_out_and_keep_their_distance() -> None:
    one = samples(0).select(samples(0).run == 0)
    data = replace(one, temperature_c=30.0 * np.sin(one.time_s / 1500.0))
    found = folds(data)
    assert {fold.kind for fold in found} == {"branch"} and len(found) > 2
    assert (times_left_out(data, found) == 1).all()
    for fold in found:
        held, free = fold.held(data), ~fold.near(data)
        assert np.abs(data.time_s[held][:, None] - data.time_s[free][None, :]).min() >= 90.0


@pytest.mark.parametrize("name", list(SIMPLE))
def test_a_cubic_as_gaussians_is_the_cubic(name: str) -> None:
    """To far below the noise, with weights that add up to no more than 25 times its coefficients."""
    data = samples(0)
    z = (data.temperature_c - 10.0) / 50.0
    bias = 5.0 + 2e-3 * z - 3e-3 * z**2 + 2e-3 * z**3 + 1e-4 * data.slope_c_per_min
    powers = {p: c for p, c in zip(((2, 0), (3, 0)), (3e-3, 2e-3), strict=True) if p in SIMPLE[name]}
    found = fit(replace(data, bias_dph=bias), method=name)
    if name == "cubic_slope":
        error = predict(found, data.temperature_c, data.slope_c_per_min) - bias
        assert np.abs(error).max() < 5e-4 * 5e-3
    assert found.sum_abs_weights <= 26.0 * sum(powers.values())
    assert found.method == name and not found.candidates


def test_a_map_that_leaves_its_process_or_the_data_is_refused_with_words() -> None:
    data = samples(0)
    found = fit(data)
    arguments = data, found.scaling, 100.0
    assert objection_to(found.outcome, *arguments) == ""
    [good] = found.networks
    far = replace(found.outcome, networks=[{**good, "linear": [good["linear"][0], 0.01]}])
    assert "leaves the process" in objection_to(far, *arguments)
    assert "the means span" in objection_to(replace(far, process=None), *arguments)
    heavy = {**good, "weights": [1e8, *good["weights"][1:]]}
    assert "more than a table holds" in objection_to(replace(far, networks=[heavy]), *arguments)


@pytest.mark.parametrize("average_s", [100.0, 200.0])
@pytest.mark.parametrize(("sigmas", "refused"), [(3.5, False), (5.0, True)])
def test_a_map_may_leave_its_process_by_four_times_the_noise_of_a_mean(
    sigmas: float, refused: bool, average_s: float
) -> None:
    data = samples(0)
    found = fit(data)
    process = found.outcome.process
    assert process is not None and process.seconds < average_s
    noise_dph = process.noise_dph * np.sqrt(process.seconds / average_s)
    [good] = found.networks
    moved = replace(found.outcome, networks=[{**good, "w0": good["w0"] + sigmas * noise_dph}])
    assert ("leaves the process" in objection_to(moved, data, found.scaling, average_s)) == refused


@pytest.mark.parametrize("share", [k / 32.0 for k in range(1, 32, 2)])
def test_a_narrow_spike_of_a_map_is_refused_wherever_it_is(share: float) -> None:
    """A hundredth of the range of T wide, between the places of a grid of sixteenths."""
    data = samples(0)
    found = fit(data)
    [good] = found.networks
    low, high = found.scaling.temperature_c
    spike = {
        "centers": [*good["centers"], [low + share * (high - low), 0.0]],
        "widths": [*good["widths"], [0.02, 100.0]],
        "weights": [*good["weights"], 0.02],
    }
    outcome = replace(found.outcome, networks=[{**good, **spike}])
    assert "leaves the process" in objection_to(outcome, data, found.scaling, 100.0)


def test_a_run_handed_over_twice_is_no_second_witness() -> None:
    """Left out, its copy would still be trained on: every map would look perfect."""
    data = samples(0)
    slope = np.array([3e-4, -4e-4, 1e-4])[data.run]
    data = with_bias(data, 5.0 + slope * data.temperature_c)
    copies = replace(data, run=data.run + 3)
    twice = TrainingData(
        *(np.concatenate([getattr(data, n), getattr(copies, n)]) for n in TrainingData.__dataclass_fields__)
    )
    assert auto(twice).method == auto(data).method == "constant"


def renumbered(data: TrainingData) -> TrainingData:
    return replace(data, run=np.array([2, 0, 1])[data.run])


def doubled(data: TrainingData) -> TrainingData:
    return data.select(np.repeat(np.arange(len(data)), 2))


INVARIANCES: dict[str, tuple[Change, float]] = {
    "order of runs": (renumbered, 0.0),
    "duplicated rows": (doubled, 0.0),
    "constant on the rate": (lambda d: replace(d, bias_dph=d.bias_dph + 12.0), 12.0),
    "constant on the clock": (lambda d: replace(d, time_s=d.time_s + 86400.0), 0.0),
}


@pytest.mark.parametrize("name", INVARIANCES)
@pytest.mark.parametrize("repeats", [True, False])
def test_the_choice_does_not_depend_on(name: str, repeats: bool) -> None:
    change, shift = INVARIANCES[name]
    data = samples(1)
    if not repeats:
        data = replace(data, bias_dph=data.bias_dph + np.array([3e-4, -4e-4, 1e-4])[data.run] * data.temperature_c)
    same(auto(data), auto(change(data)), shift)


def test_what_candidates_leave_does_not_see_a_slope_that_both_can_follow() -> None:
    """Noise is that of what remains: a slope over temperature moves each mean on a ramp by ten times the noise."""
    data = samples(0)
    plain, steep = (auto(replace(data, bias_dph=data.bias_dph + k * data.temperature_c)) for k in (0.0, 1e-3))
    for a, b in zip(plain.candidates, steep.candidates, strict=True):
        assert a["id"] == b["id"]
        assert (b["left_out_rms_dph"] == pytest.approx(a["left_out_rms_dph"], rel=0.1)) == (a["id"] != "constant")


def same(one: Fit, two: Fit, shift: float = 0.0, share: float = 1e-3) -> None:
    """The same candidate, the same table, and maps within a share of the noise."""
    assert two.method == one.method
    for a, b in zip(one.candidates, two.candidates, strict=True):
        assert b["left_out_rms_dph"] == pytest.approx(a["left_out_rms_dph"], rel=max(share, 1e-6))
    t, r = np.meshgrid(np.linspace(*one.scaling.temperature_c, 21), np.linspace(*one.scaling.slope_c_per_min, 11))
    assert np.abs(predict(two, t, r) - shift - predict(one, t, r)).max() < share * one.noise_floor_dph


def cycle(seed: int = 3, n: int = 5400) -> dict[str, np.ndarray]:
    """Three branches in one recording of 2 s rows."""
    rng = np.random.default_rng(seed)
    time = 2.0 * np.arange(n)
    t = np.interp(time, [0.0, 3600.0, 7200.0, 10800.0], [50.0, -20.0, 60.0, 20.0])
    rate = 5.0 + 0.02 * t - 3e-4 * t**2 + 0.05 * np.gradient(t, time / 60.0) + rng.normal(0.0, 0.05, n)
    return {"time_s": time, "temperature_c": np.round(t + rng.normal(0.0, 0.01, n), 4), "rate_dph": rate}


def cut_at(folder: Path, table: dict[str, np.ndarray], cuts: list[float]) -> Fitted:
    write_csv(folder / "a.csv", table)
    edges = [None, *cuts, None]
    runs = []
    for low, high in pairwise(edges):
        span = ([] if low is None else [f"from_s = {low}"]) + ([] if high is None else [f"to_s = {high}"])
        runs.append("\n".join(['file = "a.csv"', *span]))
    (folder / "dataset.toml").write_text(toml(*runs[::-1]), "utf-8")
    return fit_dataset(load(folder), FitOptions())


@pytest.mark.parametrize("cuts", [[5000.0], [1234.0, 5001.0, 9000.0]])
def test_where_touching_spans_are_cut_changes_nothing_that_matters(tmp_path: Path, cuts: list[float]) -> None:
    """Within 2 %; the description names the spans in another order, too."""
    whole, parts = cut_at(tmp_path / "whole", cycle(), []), cut_at(tmp_path / "parts", cycle(), cuts)
    close(whole, parts)


def close(whole: Fitted, parts: Fitted) -> None:
    assert parts.model.method == whole.model.method
    for a, b in zip(*(f.training.content()["candidates"] for f in (whole, parts)), strict=True):
        assert b["left_out_rms_dph"] == pytest.approx(a["left_out_rms_dph"], rel=0.02), a["id"]
    e = whole.model.envelope
    t, r = np.meshgrid(np.linspace(*e.temperature_c, 21), np.linspace(*e.slope_c_per_min, 11))
    one, two = whole.model.map_dph(t, r), parts.model.map_dph(t, r)
    assert np.abs(two - one).max() <= 0.02 * max(float(np.ptp(one)), whole.model.noise_floor_dph or 0.0)


@pytest.mark.measured("mpu6000-chamber-cycle")
@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_where_a_measured_recording_is_cut_changes_nothing_that_matters(tmp_path: Path, axis: str) -> None:
    source = MEASURED / "mpu6000-chamber-cycle" / "data.csv"
    names = source.read_text("utf-8").split("\n", 1)[0].split(",")
    table = dict(zip(names, np.loadtxt(source, delimiter=",", skiprows=1).T, strict=True))
    table = {"time_s": table["time_s"], "temperature_c": table["temperature_c"], "rate_dph": table[f"rate_{axis}_dph"]}
    whole = cut_at(tmp_path / "whole", table, [])
    close(whole, cut_at(tmp_path / "two", table, [2000.0]))
    moved = cut_at(tmp_path / "moved", table | {"rate_dph": table["rate_dph"] + 1e4}, [])
    later = cut_at(tmp_path / "later", table | {"time_s": table["time_s"] + 4096.0}, [])
    assert moved.model.method == later.model.method == whole.model.method
    for row, a, b in zip(*(f.training.content()["candidates"] for f in (whole, moved, later)), strict=True):
        assert a["left_out_rms_dph"] == pytest.approx(row["left_out_rms_dph"], rel=1e-3), row["id"]
        assert b["left_out_rms_dph"] == pytest.approx(row["left_out_rms_dph"], rel=1e-3), row["id"]


def test_simple_corrections_are_least_squares() -> None:
    data = samples(2)
    found = fit(data, method="cubic_slope")
    t, r = found.scaling.normalise(data.temperature_c, data.slope_c_per_min)
    columns = np.stack([t**0, t, r, t**2, t**3], axis=1)
    expected = columns @ np.linalg.lstsq(columns, data.bias_dph, rcond=None)[0]
    np.testing.assert_allclose(
        predict(found, data.temperature_c, data.slope_c_per_min), expected, atol=0.01 * found.noise_floor_dph
    )
    assert fit_simple("linear", data, found.scaling, 100.0).networks[0]["weights"] == []


@pytest.mark.parametrize("reach", [1.0, 30.0])
def test_samples_are_gathered_by_cell_in_order_of_temperature(reach: float) -> None:
    """By a table where cells are few, by sorting where inputs lie far beyond the range."""
    rng = np.random.default_rng(4)
    t, r, y = rng.uniform(-reach, reach, (3, 700))
    bins = gather(t, r, y, np.ones(700))
    cells = np.floor(np.stack([t, r], axis=1) * 50 + 0.5).astype(np.int64)
    keys, index = np.unique(cells, axis=0, return_inverse=True)
    assert len(bins.count) == len(keys) and bins.samples == 700
    np.testing.assert_allclose(bins.t * bins.count, np.bincount(index.reshape(-1), t), atol=1e-12)


@dataclass
class Samples:
    temperature_c: np.ndarray
    time_s: np.ndarray
    run: np.ndarray


def profile(*legs: tuple[float, float], noise: float = 0.05, start: float = 0.0) -> Samples:
    """Temperature along legs of (minutes, change in C), one sample in 10 s, with noise."""
    edges = np.cumsum([0.0, *(60.0 * minutes for minutes, _ in legs)])
    levels = 20.0 + np.cumsum([0.0, *(change for _, change in legs)])
    time = np.arange(0.0, edges[-1], 10.0)
    rng = np.random.default_rng(5)
    temperature = np.interp(time, edges, levels) + rng.normal(0.0, noise, len(time))
    return Samples(temperature, time + start, np.zeros(len(time), dtype=np.int64))


def edges_of(found: tuple[Fold, ...]) -> list[float]:
    spans = [fold.spans[0] for fold in found]
    return [spans[0].from_s, *(s.to_s for s in spans)]


def test_a_cycle_is_cut_at_its_turning_points() -> None:
    found = folds(profile((20, -60.0), (30, 90.0), (20, -40.0)))
    assert [fold.kind for fold in found] == ["branch"] * 3
    assert edges_of(found) == pytest.approx([0.0, 1200.0, 3000.0, 4200.0], abs=60.0)


def test_turning_points_depend_neither_on_where_a_record_begins_nor_on_its_samples() -> None:
    """They followed the phase of cells of 60 s, and samples near an end moved to the next branch."""
    cut = profile((20, -60.0), (30, 90.0), (20, -40.0))
    whole = turning_points(cut.time_s, cut.temperature_c)
    assert len(whole) == 2
    for first in range(1, 12):
        assert turning_points(cut.time_s[first:], cut.temperature_c[first:]) == whole
    time, temperature = (values.reshape(-1, 3).mean(axis=1) for values in (cut.time_s, cut.temperature_c))
    for first in range(3):
        assert turning_points(time[first:], temperature[first:]) == pytest.approx(whole, abs=15.0)


def test_holds_and_steps_on_the_way_are_no_turning_points() -> None:
    found = folds(profile((10, 20.0), (30, 0.0), (10, 20.0), (30, 0.0), (20, -40.0)))
    assert len(found) == 2
    assert edges_of(found)[1] == pytest.approx(4800.0, abs=1900.0)


def test_branches_shorter_than_five_minutes_join_their_neighbour() -> None:
    assert len(folds(profile((20, -60.0), (3, 5.0), (20, -40.0), (20, 60.0)))) == 2
    found = folds(profile((20, -60.0), (20, 60.0), (2, -10.0)))
    assert edges_of(found) == pytest.approx([0.0, 1200.0, 2520.0], abs=60.0)


def test_without_turning_points_there_are_five_equal_parts() -> None:
    found = folds(profile((10, 0.0), noise=0.1))
    assert [fold.kind for fold in found] == ["part"] * 5
    np.testing.assert_allclose(np.diff(edges_of(found)), 120.0)


def test_folds_cover_every_sample_once() -> None:
    for cut in (profile((20, -60.0), (30, 90.0), start=7000.0), profile((60, 30.0))):
        inside = sum(fold.held(cut).astype(int) for fold in folds(cut))
        assert (inside == 1).all()


def test_the_guard_gap_is_on_both_sides() -> None:
    cut = profile((20, -60.0), (30, 90.0), (20, -40.0))
    middle = folds(cut)[1]
    assert (middle.near(cut) & ~middle.held(cut)).sum() == 20, "100 s of 10 s samples on both sides"


def test_a_short_branch_has_a_short_guard_gap() -> None:
    for fold in folds(profile((5, 0.0))):
        [span] = fold.spans
        assert fold.guard_s == pytest.approx(0.25 * (span.to_s - span.from_s))


def test_what_was_left_out_is_recorded() -> None:
    run = object.__new__(Run)
    object.__setattr__(run, "file", "0.csv")
    [span] = folds(profile((50, 30.0)))[1].results([run])
    assert span.content() == {
        "file": "0.csv",
        "from_s": 600.0,
        "to_s": 1200.0,
        "kind": "part",
        "guard_s": 100.0,
    }


def empty() -> Dataset:
    return Dataset(
        folder=Path("recordings"), serial="A-1", axis=None, description="", earth_rate="none", noise=None,
        applied_table=None, meta={}, runs=(), channels=(), warnings=(),
    )  # fmt: skip


def test_a_method_that_is_not_known_makes_no_model() -> None:
    with pytest.raises(InputError, match=r"method: 'magic'; expected .*mrbf_paper"):
        FitOptions(method="magic")


def test_without_training_runs_there_is_no_model() -> None:
    with pytest.raises(InputError, match="no run has the role train"):
        fit_dataset(empty(), FitOptions())
