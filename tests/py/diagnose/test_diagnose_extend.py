"""Stage 7 of diagnosis: samples with effects taken off, refits with samples left out, and what is shipped."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from gyrotc.diagnose.blocks import records_of
from gyrotc.diagnose.diagnosis import diagnose
from gyrotc.diagnose.extension import Refitting, extend, folds_of, shipping
from gyrotc.diagnose.gain import gain_of
from gyrotc.diagnose.refit import Effect, known, samples
from gyrotc.recordings.load import load
from gyrotc.recordings.records import Dataset
from gyrotc.target.recursions import first_order
from gyrotc.train.data import joined
from gyrotc.train.fitting import FitOptions
from recordings import toml, write_csv

SEED = 20260405
SIZE_DPH_PER_C, TAU_S = 5e-4, 600.0
GRADIENT = Effect("thermal_gradient", {"tau_s": TAU_S, "amplitude_dph_per_c": SIZE_DPH_PER_C})
OPTIONS = FitOptions(method="mrbf", centers=4)


@dataclass(frozen=True)
class Case:
    dataset: Dataset
    refitting: Refitting


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """Three training runs and an exam run of an hour each, with a thermal gradient."""
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
    plain, less = samples(run, []), samples(run, [GRADIENT])
    taken_off = plain.bias_dph - less.bias_dph
    time, temperature = plain.time_s, plain.temperature_c
    expected = SIZE_DPH_PER_C * (first_order(TAU_S, time, temperature) - temperature)
    late = time > time[0] + 120.0
    assert np.abs(taken_off - expected)[late].max() < 0.15 * np.abs(expected).max()
    assert np.array_equal(plain.temperature_c, less.temperature_c), "a term that adds leaves the map's input"
    both = joined([plain, less])
    assert both.bias_dph.size == 2 * plain.bias_dph.size


def test_every_training_sample_is_left_out_once(case: Case) -> None:
    folds = folds_of(case.refitting)
    for k, run in enumerate(case.refitting.train):
        count = np.sum([fold[k] for fold in folds], axis=0)
        assert (count == 1).all() and count.size == run.data.bias_dph.size
    assert all(any(not m.any() for m in fold) for fold in folds), "each fold leaves something to learn from"


def test_a_fit_on_all_samples_is_made_once(case: Case) -> None:
    assert case.refitting.fit([]) is case.refitting.fit([], case.refitting.everything())
    assert case.refitting.fit([GRADIENT]) is not case.refitting.fit([])


def test_an_exam_run_measures_what_the_true_effect_gains(case: Case) -> None:
    before, after = case.refitting.on_exam([[], [GRADIENT]])
    gain = gain_of(before, after, LEVEL, 100.0)
    assert gain.positive and gain.rms_after == pytest.approx(LEVEL, rel=0.5)


LEVEL = 1e-3 / np.sqrt(10.0)  # of 100-s means of the noise


def test_the_training_runs_alone_say_what_is_shipped(case: Case) -> None:
    """An effect that is there is shipped, a wrong one and one that no table holds are not; the exam is not asked."""
    blind = Refitting(case.dataset, case.refitting.records, OPTIONS, single_cycle=False)
    blind.exam, blind.exam_runs = [], []
    found = shipping(blind, [GRADIENT])
    assert found.shipped == [GRADIENT]
    assert found.before_dph is not None and found.after_dph is not None
    assert found.after_dph < 0.5 * found.before_dph
    wrong = replace(GRADIENT, values={"tau_s": TAU_S, "amplitude_dph_per_c": -SIZE_DPH_PER_C})
    assert shipping(blind, [wrong]).shipped == []
    assert shipping(blind, [GRADIENT, wrong]).shipped == [GRADIENT], "what makes it worse is left"
    offset = replace(GRADIENT, id="turn_on_offset", values={"sigma_dph": 1e-3})
    assert shipping(blind, [offset]).shipped == [], "no table holds it"


def test_where_a_late_record_says_nothing_is_neither_learnt_from_nor_scored(tmp_path: Path) -> None:
    """The temperature of a run's end was held where the record did not have it: the right shift made exams worse."""
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
    assert known(run, [GRADIENT]).all()
    before, after = refitting.on_exam([[], [shift]])
    assert [r.time_s.tolist() for r in before] == [r.time_s.tolist() for r in after], "the same samples"
    gain = gain_of(before, after, LEVEL, 100.0)
    assert gain.positive and gain.rms_after < 1.3 * LEVEL < 0.6 * gain.rms_before


def test_without_causes_there_is_no_extension(case: Case) -> None:
    found = extend(case.dataset, case.refitting.records, (), OPTIONS, lambda _: None)
    assert found.extended is None and found.steps == () and found.measured_on == "exam"
    assert found.baseline_rms > 2.0 * LEVEL, "the plain map leaves the gradient"


def test_recordings_at_one_temperature_cannot_decide(tmp_path: Path) -> None:
    time = 10.0 * np.arange(200)
    rate = 1e-3 * np.random.default_rng(SEED).standard_normal(time.size)
    write_csv(tmp_path / "a.csv", {"time_s": time, "temperature_c": 20.0 + 1e-4 * time, "rate_dph": rate})
    (tmp_path / "dataset.toml").write_text(toml('file = "a.csv"'), "utf-8")
    found = diagnose(load(tmp_path))
    assert found.result.verdict == "not_testable" and found.analysis is None
