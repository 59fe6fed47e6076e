"""A diagnosis through the installed command: named, extended, emitted, verified, shown, reported in words."""

from __future__ import annotations

import json
import shutil
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pandas as pd
import pytest
from campaigns import GRADIENT, simulated
from conftest import HOST, Command
from gyrotc.causes import CATALOGUE
from gyrotc.diagnose import (
    VERDICTS,
    Effect,
    Records,
    Refitting,
    choose_shipped,
    completed,
    diagnose,
    extend,
    gain_of,
    held_out_masks,
    known,
    next_steps,
    not_testable,
    records_of,
    samples,
    series_of,
)
from gyrotc.diagnose import diagnosis as stages
from gyrotc.diagnose import refitting as refits
from gyrotc.mirror import first_order
from gyrotc.recordings import Dataset, load
from gyrotc.results import DiagnosisVerdict, NamedCause
from gyrotc.simulate import read, simulate
from gyrotc.train import FitOptions, fitting, joined
from numpy.typing import NDArray
from read_pictures import panels_of, pictures_of
from recordings import ACCEPTED, toml, write_csv


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory, gyrotc: Command) -> Path:
    """A folder with `data` (a gyro with a thermal gradient) and `result` (what build --extend made of it)."""
    folder = tmp_path_factory.mktemp("extended")
    data = simulated(folder, GRADIENT)
    done = gyrotc("build", data, "--out", folder / "result", "--extend", *HOST)
    assert done.returncode == 0, done.stderr
    return folder


def read_json(path: Path) -> dict[str, Any]:
    return dict(json.loads(path.read_text("utf-8")))


def test_the_cause_is_named_with_its_size(built: Path) -> None:
    result = read_json(built / "result" / "diagnosis" / "diagnose.json")
    assert result["verdict"] in ("explained", "ambiguous"), result["text"]
    (cause,) = [c for c in result["causes"] if c["family"] != "noise"]
    assert cause["id"] == "thermal_gradient"
    assert cause["parameters"]["tau_s"]["low"] < 900.0 < cause["parameters"]["tau_s"]["high"]
    amplitude = cause["parameters"]["amplitude_dph_per_c"]
    assert amplitude["low"] < 3e-4 < amplitude["high"]


def test_the_extended_model_is_emitted_and_verified(built: Path) -> None:
    folder = built / "result"
    assert [t["id"] for t in read_json(folder / "model.json")["terms"]] == ["thermal_gradient"]
    verification = read_json(folder / "verify.json")
    assert verification["failed"] == 0 and verification["passed"] > 0
    assert read_json(folder / "evaluate.json")["mismatches"] == 0
    (table,) = [path for path in (folder / "c").glob("gtc_*.c") if path.stem not in ("gtc_f32", "gtc_q31")]
    assert "/* thermal_gradient */" in table.read_text("ascii")


def test_the_compiled_code_gains_what_the_diagnosis_promises(built: Path) -> None:
    promised = read_json(built / "result" / "diagnosis" / "diagnose.json")["extended"]
    found = read_json(built / "result" / "evaluate.json")["exam"]["after"]["rms_dph"]
    assert found == pytest.approx(promised["exam_rms_dph"], rel=1e-9), "bit for bit, on the same samples"
    gain = promised["gain"]
    assert gain["exam_rms_after_dph"] < 0.8 * gain["exam_rms_before_dph"]
    assert 0.0 < gain["rms_removed_dph"]["low"] <= gain["rms_removed_dph"]["value"]
    assert gain["angle_1h_removed_arcsec"]["low"] > 0.0
    other_rate = promised["rate_left_out"]  # measured on training runs, not on test runs
    assert other_rate["environment"] in ("loops", "slow", "steps")
    assert other_rate["rms_removed_dph"]["value"] > 0.0
    assert other_rate["rms_removed_dph"]["value"] != gain["rms_removed_dph"]["value"]
    assert promised["forward_in_time"] is not None, "the test runs are later than all training runs"


def test_the_report_tells_what_was_added(built: Path) -> None:
    page = (built / "result" / "report.html").read_text("utf-8")
    assert "What was added, and what it gains" in page and 'href="diagnosis/report.html"' in page


def test_the_page_shows_verdict_pictures_and_limits(built: Path) -> None:
    folder = built / "result" / "diagnosis"
    page = (folder / "report.html").read_text("utf-8")
    for text in (
        "What the simulation gets wrong",
        "What could still hide",
        "What else was considered",
        "next",
    ):
        assert text in page
    names = {p.stem for p in (folder / "pictures").glob("*.svg")}
    assert {
        "residual",
        "statistics",
        "inputs",
        "considered",
        "likelihood-1",
        "before-and-after",
        "posterior",
    } <= names
    assert page.count("<svg") == len(names)


def test_report_draws_the_same_page_again_from_the_two_results_alone(
    built: Path, tmp_path: Path, gyrotc: Command
) -> None:
    folder = built / "result" / "diagnosis"
    for name in ("diagnose.json", "series.json", "SHA256SUMS"):
        if (folder / name).exists():
            shutil.copy(folder / name, tmp_path)
    done = gyrotc("report", tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "report.html").read_bytes() == (folder / "report.html").read_bytes()


def test_the_extended_scenario_simulates_what_was_found(built: Path) -> None:
    _, plan = read(built / "result" / "diagnosis" / "scenario-extended.toml")
    assert [c.id for c in plan.cause] == ["thermal_gradient"]
    assert plan.cause[0].values()["tau_s"] == pytest.approx(900.0, rel=0.5)


def test_the_extended_simulation_does_what_the_plain_one_does_not(built: Path) -> None:
    found = read_json(built / "result" / "diagnosis" / "diagnose.json")["discrepancies"]
    rare = [d for d in found if d["p_value"] < 0.01]
    assert rare, "the plain simulation misses the gradient"
    assert all(d["extended"]["p_value"] > 0.01 for d in rare), "the extended one does not"


def test_the_truth_is_not_looked_at(built: Path, tmp_path: Path, gyrotc: Command) -> None:
    """Without truth.json and truth/ the result is the same."""
    blind = tmp_path / "blind"
    shutil.copytree(built / "data", blind, ignore=shutil.ignore_patterns("truth*"))
    done = gyrotc("diagnose", blind, "--out", tmp_path / "result")
    assert done.returncode == 0, done.stderr
    result, seen = (read_json(p / "diagnose.json") for p in (tmp_path / "result", built / "result" / "diagnosis"))
    assert result == seen


def test_nothing_is_found_in_a_plain_gyro(tmp_path: Path, gyrotc: Command) -> None:
    done = gyrotc("diagnose", simulated(tmp_path, seed=5), "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    result = read_json(tmp_path / "out" / "diagnose.json")
    assert (result["verdict"], result["causes"], result["extended"]) == ("consistent", [], None)
    limits = {c["id"]: c["detection_limit"] for c in result["considered"] if c["detection_limit"]}
    assert {"thermal_gradient", "hysteresis", "warm_up", "cavity_lag"} <= set(limits)
    assert "consistent" in done.stdout
    assert not (tmp_path / "out" / "model-extended.json").exists()


def test_structure_that_no_map_follows_is_named_and_not_corrected(tmp_path: Path, gyrotc: Command) -> None:
    data = simulated(tmp_path, '[[cause]]\nid = "map_too_coarse"\nwidth_c = 2.0\nat_c = 12.0\namplitude_dph = 3e-3\n')
    done = gyrotc("diagnose", data, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    result = read_json(tmp_path / "out" / "diagnose.json")
    (cause,) = [c for c in result["causes"] if c["family"] != "noise"]
    assert (cause["id"], cause["gain"], result["extended"]) == ("map_too_coarse", None, None)
    assert cause["remedy"] in (tmp_path / "out" / "report.html").read_text("utf-8")
    assert "no extension is shipped: no cause was named that a map can be refitted beside" in done.stdout
    assert read_json(tmp_path / "out" / "series.json")["scored"] == []
    assert not (tmp_path / "out" / "model-extended.json").exists()


def test_a_constant_temperature_is_not_testable(tmp_path: Path, gyrotc: Command) -> None:
    data = tmp_path / "RLG-1"
    data.mkdir()
    for number in range(3):
        rows = [f"{10 * k},{25 + 0.01 * (k % 3)},{7e-3 + 1e-4 * ((7 * k) % 5)}" for k in range(400)]
        (data / f"{number}.csv").write_text("time_s,temperature_c,rate_dph\n" + "\n".join(rows) + "\n")
    done = gyrotc("diagnose", data, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "not testable" in done.stdout and "nothing can be learnt about temperature" in done.stdout
    assert read_json(tmp_path / "out" / "diagnose.json")["verdict"] == "not_testable"
    assert "Not testable" in (tmp_path / "out" / "report.html").read_text("utf-8")


def test_a_build_is_not_overwritten(built: Path, gyrotc: Command) -> None:
    done = gyrotc("diagnose", built / "data", "--out", built / "result")
    assert done.returncode == 2
    assert "holds the result of gyrotc build" in done.stderr


def test_a_broken_result_is_reported(tmp_path: Path, gyrotc: Command) -> None:
    (tmp_path / "diagnose.json").write_text('{"schema": "gyrotc.diagnose/1"}')
    done = gyrotc("report", tmp_path)
    assert done.returncode == 2 and "diagnose.json" in done.stderr


SEED = 20260405
SIZE_DPH_PER_C, TAU_S = 5e-4, 600.0
GRADIENT_TO_REMOVE = Effect("thermal_gradient", {"tau_s": TAU_S, "amplitude_dph_per_c": SIZE_DPH_PER_C})
OPTIONS = FitOptions(method="mrbf", centers=4)


@dataclass(frozen=True)
class Case:
    dataset: Dataset
    refitting: Refitting


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """Three training runs and a test run of an hour each, with a thermal gradient."""
    print("seed", SEED)
    folder, rng = tmp_path_factory.mktemp("extend"), np.random.default_rng(SEED)
    time = 10.0 * np.arange(360)
    for k in range(4):
        temperature = 20.0 + 15.0 * np.sin(2.0 * np.pi * time / (1500.0 + 400.0 * k) + k)
        lag = first_order(TAU_S, time, temperature) - temperature
        rate = 0.01 + 1e-4 * temperature + SIZE_DPH_PER_C * lag + 1e-3 * rng.standard_normal(time.size)
        write_csv(folder / f"{k}.csv", {"time_s": time, "temperature_c": temperature, "rate_dph": rate})
    runs = [f'file = "{k}.csv"\nrole = "{"exam" if k == 3 else "train"}"' for k in range(4)]
    (folder / "dataset.toml").write_text(toml(*runs), "utf-8")
    dataset = load(folder)
    records = records_of(dataset, "train", block_s=10.0, average_s=100.0)
    return Case(dataset, Refitting(dataset, records, OPTIONS, single_cycle=False))


def test_an_effect_is_taken_off_the_samples_as_its_equation_says(case: Case) -> None:
    run = case.refitting.train[0]
    plain, less = samples(run, []), samples(run, [GRADIENT_TO_REMOVE])
    taken_off = plain.bias_dph - less.bias_dph
    time, temperature = plain.time_s, plain.temperature_c
    expected = SIZE_DPH_PER_C * (first_order(TAU_S, time, temperature) - temperature)
    late = time > time[0] + 120.0
    assert np.abs(taken_off - expected)[late].max() < 0.15 * np.abs(expected).max()
    assert np.array_equal(plain.temperature_c, less.temperature_c), "a term that adds leaves the map's input"
    both = joined([plain, less])
    assert both.bias_dph.size == 2 * plain.bias_dph.size


def test_every_training_sample_is_left_out_once(case: Case) -> None:
    folds = held_out_masks(case.refitting)
    for k, run in enumerate(case.refitting.train):
        count = np.sum([fold[k] for fold in folds], axis=0)
        assert (count == 1).all() and count.size == run.data.bias_dph.size
    assert all(any(not m.any() for m in fold) for fold in folds), "each fold leaves something to learn from"


def test_rows_that_are_no_samples_are_left_out_with_the_stretch_beside_them(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A first row of which no sample was made stayed, alone, while the rest of its branch was left out."""
    late = copy(case.refitting)
    late.train = [replace(run, data=run.data.select(np.arange(3, len(run.data) - 2))) for run in late.train]
    seen: list[Records] = []

    def searched(records: Records) -> None:
        seen.append(records)

    monkeypatch.setattr(refits, "search_of", searched)
    monkeypatch.setattr(refits, "choose", lambda search, count: ())
    for early in (True, False):
        held = [(run.data.time_s < 1800.0) == early for run in late.train]
        late.chosen_without(held, 1)
        times = np.concatenate([run.history.time_s[run.usable] for run in seen[-1].runs])
        assert times.size and ((times >= 1800.0) == early).all()


def test_a_play_has_one_strength_whatever_constant_the_rate_has(tmp_path: Path) -> None:
    """A part of 1000 deg/h remained beside the smooth map, and gave it a strength that goes with temperature."""
    simulate("hysteresis", seed=1, out=tmp_path)
    dataset = load(tmp_path)
    records = records_of(dataset, "train", block_s=10.0, average_s=100.0)
    refitting = Refitting(dataset, records, FitOptions(), single_cycle=False)
    runs, power_on = refitting.train, refitting.arguments["power_on"]
    raised = [replace(run, data=replace(run.data, bias_dph=run.data.bias_dph + 1000.0)) for run in runs]
    play = Effect("hysteresis", {"width_c": 3.05, "amplitude_dph_per_c": 1.8e-4})
    assert completed(runs, [play], power_on) == completed(raised, [play], power_on) == [play]


def test_a_test_run_without_a_whole_mean_has_no_picture(tmp_path: Path) -> None:
    """A minute of a test run beside others that are scored."""
    simulate("hysteresis", seed=1, out=tmp_path)
    path = tmp_path / "dataset.toml"
    runs = path.read_text("utf-8")
    assert 'file = "run-12.csv"\n' in runs
    path.write_text(runs.replace('file = "run-12.csv"\n', 'file = "run-12.csv"\nto_s = 60.0\n'), "utf-8")
    dataset = load(tmp_path)
    series = series_of(diagnose(dataset))
    assert series is not None
    tests = sum(run.role == "exam" for run in dataset.runs)
    assert len(series.scored) == tests - 1 > 0


def test_a_fit_on_all_samples_is_made_once(case: Case) -> None:
    assert case.refitting.fit([]) is case.refitting.fit([], case.refitting.everything())
    assert case.refitting.fit([GRADIENT_TO_REMOVE]) is not case.refitting.fit([])


def test_a_test_run_measures_what_the_true_effect_gains(case: Case) -> None:
    before, after = case.refitting.on_exam([[], [GRADIENT_TO_REMOVE]])
    gain = gain_of(before, after, LEVEL, 100.0)
    assert gain.shown == "gain" and gain.exam_rms_after_dph == pytest.approx(LEVEL, rel=0.5)


LEVEL = 1e-3 / np.sqrt(10.0)  # of 100-s means of the noise


def test_the_training_runs_alone_say_what_is_shipped(case: Case) -> None:
    """An effect that is there is shipped, a wrong one and one that no table holds are not; test runs are not asked."""
    blind = Refitting(case.dataset, case.refitting.records, OPTIONS, single_cycle=False)
    blind.exam = []
    found = choose_shipped(blind, [GRADIENT_TO_REMOVE], [0.99])
    assert found.shipped == [GRADIENT_TO_REMOVE]
    assert found.before_dph is not None and found.after_dph is not None
    assert found.after_dph < 0.5 * found.before_dph
    assert found.after_dph == pytest.approx(LEVEL, rel=0.2), "noise is left, and counted once"
    wrong = replace(GRADIENT_TO_REMOVE, values={"tau_s": TAU_S, "amplitude_dph_per_c": -SIZE_DPH_PER_C})
    assert choose_shipped(blind, [wrong], [0.99]).shipped == []
    both = choose_shipped(blind, [GRADIENT_TO_REMOVE, wrong], [0.99, 0.99])
    assert both.shipped == [GRADIENT_TO_REMOVE] and both.refuted == [1], "what makes it worse is left"
    assert (both.before_dph, both.after_dph) == (found.before_dph, found.after_dph), "figures are of what is shipped"
    offset = replace(GRADIENT_TO_REMOVE, id="turn_on_offset", values={"sigma_dph": 1e-3})
    alone = choose_shipped(blind, [offset], [0.99])
    assert alone.shipped == [] and alone.refuted == [] and alone.reason == "no table holds what is named"


def test_where_a_late_record_says_nothing_is_neither_learnt_from_nor_scored(tmp_path: Path) -> None:
    """If the last temperature were held where a delayed record has none, the right shift would make test runs worse."""
    print("seed", SEED + 1)
    rng, late, time = np.random.default_rng(SEED + 1), 300.0, 10.0 * np.arange(720)

    def true_c(at: np.ndarray, k: int) -> np.ndarray:
        return 20.0 + 30.0 * np.sin(2.0 * np.pi * at / (3100.0 + 700.0 * k) + k)

    for k in range(4):
        rate = 0.01 + 2e-4 * true_c(time, k) + 1e-3 * rng.standard_normal(time.size)
        columns = {"time_s": time, "temperature_c": true_c(time - late, k), "rate_dph": rate}
        write_csv(tmp_path / f"{k}.csv", columns)
    runs = [f'file = "{k}.csv"\nrole = "{"exam" if k == 3 else "train"}"' for k in range(4)]
    (tmp_path / "dataset.toml").write_text(toml(*runs), "utf-8")
    dataset = load(tmp_path)
    records = records_of(dataset, "train", block_s=10.0, average_s=100.0)
    refitting = Refitting(dataset, records, OPTIONS, single_cycle=False)
    shift = Effect("time_misalignment", {"shift_s": late})
    run = refitting.exam[0]
    mask = known(run, [shift])
    assert np.array_equal(mask, run.data.time_s <= run.data.time_s[-1] - late)
    assert known(run, [GRADIENT_TO_REMOVE]).all()
    before, after = refitting.on_exam([[], [shift]])
    assert [r.time_s.tolist() for r in before] == [r.time_s.tolist() for r in after], "the same samples"
    gain = gain_of(before, after, LEVEL, 100.0)
    assert gain.shown == "gain" and gain.exam_rms_after_dph < 1.3 * LEVEL < 0.6 * gain.exam_rms_before_dph


def test_without_causes_there_is_no_extension(case: Case) -> None:
    found = extend(case.refitting, (), (), 1.0, lambda *_: None)
    assert found.extended is None and found.steps == () and found.measured_on == "exam"
    assert found.baseline_rms > 2.0 * LEVEL, "the plain map leaves the gradient"


def test_every_run_is_followed_once_and_before_the_search(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    """The rows of a long recording and what the search remembers were in memory together: 612 MB of 1e8 rows."""
    order = []
    played, searched = refits.play_runs, stages.analyse

    def playing(dataset: Any, runs: Any, front: Any, judged: Any, **options: Any) -> Any:
        order.extend(run.file for run in runs)
        return played(dataset, runs, front, judged, **options)

    def searching(*arguments: Any) -> Any:
        order.append("search")
        return searched(*arguments)

    monkeypatch.setattr(refits, "play_runs", playing)
    monkeypatch.setattr(stages, "analyse", searching)
    monkeypatch.setattr(fitting, "_read", lambda *_, **__: pytest.fail("the training runs are read again"))
    found = diagnose(case.dataset, options=OPTIONS)
    assert found.extension is not None
    assert found.extension.shipped
    assert order == ["0.csv", "1.csv", "2.csv", "3.csv", "search"]


def test_recordings_at_one_temperature_cannot_decide(tmp_path: Path) -> None:
    time = 10.0 * np.arange(200)
    rate = 1e-3 * np.random.default_rng(SEED).standard_normal(time.size)
    write_csv(tmp_path / "a.csv", {"time_s": time, "temperature_c": 20.0 + 1e-4 * time, "rate_dph": rate})
    (tmp_path / "dataset.toml").write_text(toml('file = "a.csv"'), "utf-8")
    found = diagnose(load(tmp_path))
    assert found.result.verdict == "not_testable" and found.analysis is None


def test_ten_blocks_that_a_map_fits_exactly_are_not_testable(tmp_path: Path) -> None:
    """Rows of five minutes, as bursts give them."""
    time = 305.0 * np.arange(10)
    rate = 100.0 * np.random.default_rng(SEED).standard_normal(time.size)
    write_csv(tmp_path / "a.csv", {"time_s": time, "temperature_c": 24.0 - 0.01 * time, "rate_dph": rate})
    (tmp_path / "dataset.toml").write_text(toml('file = "a.csv"'), "utf-8")
    found = diagnose(load(tmp_path))
    assert found.result.verdict == "not_testable" and found.analysis is None
    assert "10 blocks" in found.result.text


@pytest.mark.parametrize("verdict", get_args(DiagnosisVerdict))
def test_each_verdict_has_a_sentence_and_all_but_ambiguous_a_step(verdict: DiagnosisVerdict) -> None:
    assert VERDICTS[verdict].endswith(".")
    steps = next_steps(verdict, [], [], gain=None)
    assert bool(steps) == (verdict != "ambiguous")


def test_where_temperature_hardly_changes_nothing_is_decided(tmp_path) -> None:  # type: ignore[no-untyped-def]
    ACCEPTED["Parquet"](tmp_path / "RLG-1")
    result = not_testable(load(tmp_path / "RLG-1"), FitOptions(), "Temperature spans only 0.25 C.")
    assert result.verdict == "not_testable"
    assert "0.25 C" in result.text
    assert not result.causes and result.extended is None


@pytest.mark.parametrize("id", ["thermal_gradient", "turn_on_offset"])
def test_a_cause_that_the_fixture_can_imitate_says_so_and_what_tells(id: str) -> None:
    """Tilt and scale factor times Earth's rate: no recording on one axis tells them, another mounting does."""
    words = CATALOGUE[id].words
    cause = NamedCause(
        id=id,
        family=CATALOGUE[id].family,
        name=words.name,
        p_value=1e-4,
        parameters={},
        equivalent=(),
        separate_by=None,
        gain=None,
        signature=words.signature,
        remedy=words.remedy,
    )
    reported = [step for step in next_steps("explained", [cause], [], gain=None) if "Earth's rate" in step]
    assert len(reported) == 1 and (
        "rotated by 180 degrees" in reported[0] or "without touching the fixture" in reported[0]
    )


def running(values: list[float], width: int) -> NDArray[np.float64]:
    """Means over `width` neighbours, fewer at the ends, as pandas rolls them."""
    padded = pd.Series(values)
    means = [padded.iloc[max(k - width // 2, 0) : max(k - width // 2, 0) + width].mean() for k in range(len(padded))]
    return np.array(means)


def test_each_picture_shows_the_series_that_its_legend_names(built: Path) -> None:
    """Found by colour and legend, and compared with `series.json` and `diagnose.json`; gains agree with both."""
    folder = built / "result" / "diagnosis"
    result, series = read_json(folder / "diagnose.json"), read_json(folder / "series.json")
    page = (folder / "report.html").read_text("utf-8")
    panels = [panel for picture in pictures_of(page) for panel in panels_of(picture)]
    near = 0.15  # points: places are rounded to a tenth

    width = round(1800.0 / series["block_s"])
    over_time = [p for p in panels if any(s.label == "simulated, 95 %" and s.kind == "band" for s in p.series)]
    assert len(over_time) == len(series["runs"])
    for panel, run in zip(over_time, series["runs"], strict=True):
        for label, values in (("measured", run["residual_dph"]), ("named causes", run["named_dph"])):
            line = panel.labelled(label)
            assert panel.pixels_off(line, np.array(run["hours"]), running(values, width)) < near, label
        band = panel.labelled("simulated, 95 %", "band")
        low, high = np.array(run["simulated_low_dph"]), np.array(run["simulated_high_dph"])
        around = np.r_[run["hours"], run["hours"][::-1]], np.r_[low, high[::-1]]
        assert panel.pixels_off(band, *map(np.array, around)) < near

    shortest = min(len(run["hours"]) for run in series["scored"])
    width = max(round(min(1800.0, shortest * series["average_s"] / 16.0) / series["average_s"]), 1)
    gained = [p for p in panels if any(s.label == "with the causes" for s in p.series)]
    assert len(gained) == len(series["scored"])
    for panel, run in zip(gained, series["scored"], strict=True):
        for label, key in (("without", "before_dph"), ("with the causes", "after_dph")):
            line = panel.labelled(label)
            assert panel.pixels_off(line, np.array(run["hours"]), running(run[key], width)) < near, label
    for key, name in (("before_dph", "exam_rms_before_dph"), ("after_dph", "exam_rms_after_dph")):
        pooled = np.concatenate([run[key] for run in series["scored"]])
        assert np.sqrt(np.mean(pooled**2)) == pytest.approx(result["extended"]["gain"][name], rel=0.02)

    runs = {key: np.concatenate([run[key] for run in series["runs"]]) for key in ("slope_c_per_min", "residual_dph")}
    (over_rate,) = (p for p in panels if p.x.words == "dT/dt, C/min")
    (dots,) = (s for s in over_rate.series if s.kind == "dots")
    cells = pd.cut(pd.Series(runs["slope_c_per_min"]), 24, labels=False)
    means = pd.DataFrame(runs).groupby(cells).agg(["mean", "size"])
    means = means[means["residual_dph", "size"] >= 4]
    drawn = means["slope_c_per_min", "mean"].to_numpy(), means["residual_dph", "mean"].to_numpy()
    assert over_rate.pixels_off(dots, *drawn) < 0.5, "a row on an edge may be in either cell"

    (scores,) = (p for p in panels if any(s.label == "alone" for s in p.series))
    for label, values in (
        ("alone", series["scores"]["alone"]),
        ("beside the named causes", series["scores"]["beside"]),
    ):
        bars = [s for s in scores.series if s.kind == "bars" and s.label == label]
        assert len(bars) == len(series["scores"]["alone"])
        for bar, id in zip(bars, series["scores"]["alone"], strict=True):
            drawn = scores.places(np.array([values.get(id, 0.0)]), np.array([0.0]))[0, 0]
            linear = values.get(id, 0.0) <= 20.0  # beyond it the axis is logarithmic
            assert not linear or bar.pixels[1, 0] == pytest.approx(drawn, abs=1.0), id
