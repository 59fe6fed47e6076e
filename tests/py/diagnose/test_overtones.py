"""Overtones of a wave over temperature: those of a wave that is no sine are found, a sine gets none."""

from __future__ import annotations

import numpy as np
import pytest
from gyrotc.causes import CATALOGUE
from gyrotc.diagnose.blocks import records_of
from gyrotc.diagnose.diagnosis import _entries
from gyrotc.diagnose.extension import Refitting
from gyrotc.diagnose.refit import MOST_TERMS, Effect, completed, overtones_of, samples, terms_of
from gyrotc.recordings.load import load
from gyrotc.train.data import TrainingData, cleaned
from gyrotc.train.fitting import FitOptions
from recordings import toml, write_csv

SEED = 20261124
PERIOD_C, SIZE_DPH, NOISE_DPH = 14.0, 4e-3, 2e-3
WAVE = CATALOGUE["path_length_periodicity"]
OPTIONS = FitOptions(method="mrbf")


def airy(t: np.ndarray, finesse: float = 4.0) -> np.ndarray:
    """What a plate reflects that reflects more than once (Airy 1833): each overtone is 0.38 of the one before."""
    return np.asarray(1.0 / (1.0 + finesse * np.sin(np.pi * t / PERIOD_C + 0.4) ** 2))


def overtone(number: int) -> complex:
    """Amplitude and phase of a part of `SIZE_DPH` · `airy`."""
    t = np.linspace(0.0, PERIOD_C, 4000, endpoint=False)
    return complex(2.0 * np.mean(SIZE_DPH * airy(t) * np.exp(-2j * np.pi * number * t / PERIOD_C)))


def sine(t: np.ndarray) -> np.ndarray:
    return np.asarray(0.3 * np.cos(2.0 * np.pi * t / PERIOD_C + 1.0))


def course(run: int) -> tuple[np.ndarray, np.ndarray]:
    """Times, s, and temperatures, C, of a run of eight hours between −30 and 60 C."""
    time = 10.0 * np.arange(2880)
    phase = (1.0 + 0.7 * run) * time / 60.0 % 180.0
    return time, -30.0 + np.where(phase < 90.0, phase, 180.0 - phase)


def recorded(rng: np.random.Generator, wave: object) -> TrainingData:
    """Four runs with a smooth map, a wave and white noise."""
    parts = []
    for run in range(4):
        time, t = course(run)
        r = np.gradient(t, time) * 60.0
        y = 0.01 + 1e-4 * t + 2e-4 * r + SIZE_DPH * wave(t) + NOISE_DPH * rng.standard_normal(t.size)  # type: ignore[operator]
        one = np.ones(t.size)
        parts.append(TrainingData(t, r, y, one, np.full(t.size, run), time, 10.0 * one))
    names = TrainingData.__slots__
    return cleaned(TrainingData(**{n: np.concatenate([getattr(p, n) for p in parts]) for n in names}))


def test_overtones_have_the_size_and_phase_that_the_wave_has() -> None:
    print("seed", SEED)
    found = overtones_of(recorded(np.random.default_rng(SEED), airy), WAVE, {"period_c": PERIOD_C})
    assert [one["period_c"] for one in found] == [PERIOD_C / 2.0, PERIOD_C / 3.0]
    for number, one in zip((2, 3), found, strict=True):
        got = one["amplitude_dph"] * np.exp(1j * one["phase_rad"])
        assert abs(got - overtone(number)) < 6.0 * NOISE_DPH * np.sqrt(2.0 / 11520.0), (number, got)


def test_a_sine_gets_no_overtone_and_what_is_no_wave_is_not_asked() -> None:
    print("seed", SEED + 1)
    rng = np.random.default_rng(SEED + 1)
    found = [overtones_of(recorded(rng, sine), WAVE, {"period_c": PERIOD_C}) for _ in range(8)]
    assert sum(map(len, found)) <= 1, "BIC lets one in a thousand pass"
    assert overtones_of(recorded(rng, sine), CATALOGUE["hysteresis"], {"width_c": 3.0}) == ()


@pytest.fixture(scope="module")
def refitting(tmp_path_factory: pytest.TempPathFactory) -> Refitting:
    """Three runs of three hours with a wave that is no sine."""
    print("seed", SEED + 2)
    rng, folder = np.random.default_rng(SEED + 2), tmp_path_factory.mktemp("overtones")
    for run in range(3):
        time, t = (x[:1080] for x in course(run))
        rate = 0.01 + 1e-4 * t + SIZE_DPH * airy(t) + 0.25 * NOISE_DPH * rng.standard_normal(t.size)
        write_csv(folder / f"{run}.csv", {"time_s": time, "temperature_c": t, "rate_dph": rate})
    (folder / "dataset.toml").write_text(toml(*(f'file = "{k}.csv"' for k in range(3))), "utf-8")
    dataset = load(folder)
    records = records_of(dataset, "train", block_s=10.0, average_s=100.0)
    return Refitting(dataset, records, OPTIONS, single_cycle=False)


def wave() -> Effect:
    """The wave without its overtones."""
    part = overtone(1)
    values = {"period_c": PERIOD_C, "amplitude_dph": abs(part), "phase_rad": float(np.angle(part))}
    return Effect(WAVE.id, values)


def test_a_wave_and_its_overtones_are_taken_off_and_stand_in_the_model(refitting: Refitting) -> None:
    [whole] = completed(refitting.train, [wave()])
    assert len(whole.overtones) == 2
    run = refitting.train[0]
    plain, left = samples(run, []), samples(run, [whole])
    parts = [plain.bias_dph - samples(run, [one]).bias_dph for one in (wave(), *whole.overtones)]
    assert np.allclose(plain.bias_dph - left.bias_dph, sum(parts), atol=1e-12)
    t = plain.temperature_c
    rest = [SIZE_DPH * airy(t) - taken for taken in (parts[0], sum(parts))]
    assert np.std(rest[1]) < 0.5 * np.std(rest[0]), "they are the wave's own"
    entries = _entries([whole], {})
    assert [e["id"] for e in entries] == [WAVE.id] * 3
    assert [e["parameters"]["period_c"] for e in entries] == [PERIOD_C, PERIOD_C / 2.0, PERIOD_C / 3.0]
    assert {p.name for p in WAVE.parameters} == set(entries[1]["parameters"])


def test_overtones_take_no_place_in_a_table_from_another_cause(refitting: Refitting) -> None:
    others = [Effect("hysteresis", {"width_c": w, "amplitude_dph_per_c": 1e-9}) for w in (2.0, 6.0)]
    whole = completed(refitting.train, [wave(), *others])
    assert len(terms_of(whole)) == MOST_TERMS and len(whole[0].overtones) == 1
