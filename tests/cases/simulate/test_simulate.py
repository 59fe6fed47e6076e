"""Simulated campaigns as data sets: contents, reproducibility, refusals; noise against IEEE Std 647 (annex C)."""

from __future__ import annotations

import json
import secrets
from pathlib import Path
from typing import Any

import allantools
import numpy as np
import pytest
from gyrotc.causes import CATALOGUE
from gyrotc.common import InputError
from gyrotc.recordings import load
from gyrotc.simulate import (
    CELL_S,
    NOISE,
    NoiseLevels,
    RowLength,
    SimulatedRecord,
    cell_noise,
    gyro_map,
    names,
    quantised,
    read,
    read_truth,
    rows,
    simulate,
    simulate_campaign,
    simulated_floor,
    white_sigma_arcsec,
)
from middle_values import middle_values
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.stats import chi2

Array = NDArray[np.float64]

SHORT = """
title = "Two short runs"

[noise]
arw_deg_per_sqrt_h = {arw}
quantum_arcsec = {quantum}

[[channel]]
name = "supply_v"
level = 28.0
wander_sigma = 0.1
noise = 0.01

[profile.ramp]
start_c = 0.0
power_on_min = 5
record_from_min = 5
record_min = 20
steps = [{{hold_min = 10}}, {{ramp_to_c = 20.0, c_per_min = 5.0}}]

[[set]]
started = 2026-01-01T00:00:00Z
profiles = ["ramp", "ramp"]
"""


@pytest.fixture
def short(tmp_path: Path) -> Path:
    path = tmp_path / "short.toml"
    path.write_text(SHORT.format(arw=2e-3, quantum=0.3), "utf-8")
    return path


def made(scenario: str | Path, folder: Path, **options: Any) -> Path:
    simulate(scenario, out=folder, **{"seed": 7, **options})
    return folder


def columns(path: Path) -> dict[str, Array]:
    with path.open() as file:
        names_ = file.readline().strip().split(",")
        values = np.loadtxt(file, delimiter=",")
    return dict(zip(names_, values.T, strict=True))


@pytest.fixture(scope="module")
def paper(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made("paper", tmp_path_factory.mktemp("sim") / "paper", seed=11)


def test_the_paper_has_its_six_environments_twice_with_eight_hours_each(paper: Path) -> None:
    dataset = load(paper)
    assert [run.role for run in dataset.runs] == ["train"] * 6 + ["exam"] * 6
    assert [run.environment for run in dataset.runs[:6]] == ["20 C", "-40 C", "60 C", "1 C/min", "3 C/min", "5 C/min"]
    assert [run.power_on_s for run in dataset.runs[:6]] == [-3600.0] * 3 + [0.0] * 3
    assert all(len(run.rows().time_s) == 2880 and run.row_period_s == 10.0 for run in dataset.runs)
    assert len({run.started for run in dataset.runs}) == 12
    assert not dataset.warnings
    assert dataset.noise is not None
    assert dataset.noise.arw_deg_per_sqrt_h == pytest.approx(7e-4 * (100 / 3600) ** 0.5)


def test_the_papers_programme_is_in_the_temperatures(paper: Path) -> None:
    """Self-heating 8 K above the chamber; ramps from 0 C; two hours at each end."""
    means = {run.environment: run.rows().temperature_c for run in load(paper).runs[:6]}
    for environment, chamber_c in (("20 C", 20.0), ("-40 C", -40.0), ("60 C", 60.0)):
        assert means[environment][-500:].mean() == pytest.approx(chamber_c + 8.0, abs=0.5)
    for environment in ("1 C/min", "3 C/min", "5 C/min"):
        assert means[environment][0] == pytest.approx(0.0, abs=0.5)
        assert means[environment].max() == pytest.approx(68.0, abs=1.0)
        assert means[environment].min() == pytest.approx(-32.0, abs=1.5)


def test_the_bias_is_as_large_as_the_papers_and_ten_times_the_noise(paper: Path) -> None:
    truth = read_truth(paper)
    assert truth is not None
    assert all(low >= 5.8e-3 and high <= 8.5e-3 for low, high in (run.bias_dph for run in truth.content.runs))
    files = [run.file for run in load(paper).runs]
    floor = simulated_floor(paper, files, 100.0)
    assert floor == pytest.approx(7e-4, rel=0.05)
    rates = [run.rows().rate_dph.reshape(-1, 10).mean(axis=1) for run in load(paper).runs]
    before = float(np.sqrt(np.mean(np.concatenate(rates) ** 2)))
    assert 8.5 < before / floor < 11.5


def causal_inputs(temperature_c: Array) -> tuple[Array, Array]:
    """Last row and least-squares slope over the ten rows before, C and C/min."""
    k = np.arange(10) - 4.5
    slope = np.zeros_like(temperature_c)
    slope[10:] = (np.convolve(temperature_c, (k / np.sum(k**2))[::-1], "valid") * 6.0)[:-1]
    return np.concatenate((temperature_c[:1], temperature_c[:-1])), slope


def splines(x: Array, count: int) -> Array:
    low, high = float(x.min()), float(x.max()) + 1e-6
    knots = np.concatenate(([low] * 3, np.linspace(low, high, count - 2), [high] * 3))
    return np.asarray(BSpline.design_matrix(np.clip(x, low, high - 1e-9), knots, 3).toarray())


def averaged(values: Array) -> Array:
    return np.asarray(values.reshape(-1, 10, *values.shape[1:]).mean(axis=1))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_temperature_and_its_rate_explain_the_plain_bias_far_below_the_noise(seed: int) -> None:
    """A dense static map of (T, dT/dt) leaves less than 2 % of the noise, whatever gyro was drawn."""
    _, plan = read("paper")
    inputs, bias = [], []
    for record in simulate_campaign(plan, seed):
        inputs.append(causal_inputs(record.reading_c.reshape(-1, 10).mean(axis=1)))
        bias.append(np.diff(record.true_arcsec[::100]) / 100.0)
    temperature, slope = (np.concatenate(parts) for parts in zip(*inputs, strict=True))
    design = splines(temperature, 26)[:, :, None] * splines(slope, 9)[:, None, :]
    x = averaged(design.reshape(len(temperature), -1))
    y = np.concatenate(bias) - 7e-3
    weights = np.linalg.solve(x.T @ x + 1e-4 * np.eye(x.shape[1]), x.T @ y)
    assert np.sqrt(np.mean((y - x @ weights) ** 2)) < 0.02 * 7e-4


def test_the_same_seed_gives_the_same_bytes_and_another_seed_another_gyro(short: Path, tmp_path: Path) -> None:
    first, again, other = (made(short, tmp_path / n, seed=s) for n, s in (("a", 3), ("b", 3), ("c", 4)))
    for file in sorted(path.relative_to(first) for path in first.rglob("*") if path.is_file()):
        assert (first / file).read_bytes() == (again / file).read_bytes(), file
    assert (first / "run-01.csv").read_bytes() != (other / "run-01.csv").read_bytes()
    assert (first / "run-01.csv").read_bytes() != (first / "run-02.csv").read_bytes()


def test_a_cause_changes_nothing_but_its_own_effect() -> None:
    """Noise, temperature and gyro stay as they are when a cause is switched on."""
    plain, warming = (next(iter(simulate_campaign(read(name)[1], 5))) for name in ("separating", "warm-up"))
    assert np.array_equal(plain.reading_c, warming.reading_c)
    on_s = np.arange(len(plain.bias_dph)) - plain.power_on_s
    assert np.allclose(warming.bias_dph - plain.bias_dph, 2e-3 * np.exp(-on_s / 1800.0), atol=1e-12)
    noise = [r.rough_arcsec - r.true_arcsec for r in (plain, warming)]
    assert np.allclose(noise[0], noise[1], atol=1e-9)


@pytest.mark.parametrize("cause", list(CATALOGUE))
def test_every_cause_is_switched_on_from_a_scenario_file(cause: str, short: Path, tmp_path: Path) -> None:
    """In the second run, a day after the first: readings or bias change, and nothing else does."""
    term = CATALOGUE[cause]
    values = "".join(f"{name} = {value!r}\n" for name, value in middle_values(term).items() if np.isfinite(value))
    channel = 'channel = "supply_v"' if term.needs.channel else ""
    path = tmp_path / "with.toml"
    path.write_text(f'extends = "{short}"\n[[cause]]\nid = "{cause}"\n{channel}\n{values}', "utf-8")
    plain, moved = (list(simulate_campaign(read(str(name))[1], 5))[1] for name in (short, path))
    readings = np.abs(moved.reading_c - plain.reading_c).max()
    bias = np.abs(moved.bias_dph - plain.bias_dph).max()
    if term.record:  # these move temperature readings, the others the bias
        assert readings > 0.1
        assert bias == 0.0
    else:
        assert readings == 0.0
        assert bias > 1e-5
    noise = [r.rough_arcsec - r.true_arcsec for r in (plain, moved)]
    rounded = 4.0 * np.finfo(float).eps * np.abs(moved.true_arcsec).max()
    assert np.allclose(noise[0], noise[1], rtol=0.0, atol=1e-9 + rounded)


@pytest.mark.parametrize("raw_hz", [0.05, 0.5, 2.0, 50.0])
def test_rows_of_any_length_show_the_same_angle_and_temperature(short: Path, tmp_path: Path, raw_hz: float) -> None:
    long = columns(made(short, tmp_path / "long", row_s=60.0) / "run-01.csv")
    fine = columns(made(short, tmp_path / "fine", raw_hz=raw_hz) / "run-01.csv")
    each = round(60.0 * raw_hz)
    for name in ("temperature_c", "rate_dph", "supply_v"):
        assert np.allclose(fine[name].reshape(-1, each).mean(axis=1), long[name], atol=2e-6), name
    assert np.allclose(np.diff(fine["time_s"]), 1.0 / raw_hz)


def test_pulses_are_whole_and_add_up_to_the_same_angle(short: Path, tmp_path: Path) -> None:
    rates = columns(made(short, tmp_path / "rates", row_s=10.0) / "run-01.csv")["rate_dph"]
    folder = made(short, tmp_path / "pulses", raw_hz=10.0, pulses=True)
    pulses = columns(folder / "run-01.csv")
    assert pulses["time_s"][0] == 0.0 and pulses["pulses"][0] == 0.0
    assert np.array_equal(pulses["pulses"], np.round(pulses["pulses"]))
    weight = load(folder).runs[0].rows().rate_dph[1] * 0.1 / pulses["pulses"][1]
    angle = weight * np.cumsum(pulses["pulses"])[::100]
    assert np.abs(angle - np.concatenate(([0.0], np.cumsum(10.0 * rates)))).max() <= 1.01 * weight


def test_parquet_holds_the_same_as_csv(short: Path, tmp_path: Path) -> None:
    runs = [load(made(short, tmp_path / f, format=f)).runs[1].rows() for f in ("csv", "parquet")]
    assert np.array_equal(runs[0].rate_dph, runs[1].rate_dph)
    assert np.array_equal(runs[0].temperature_c, runs[1].temperature_c)
    assert np.array_equal(runs[0].channels["supply_v"], runs[1].channels["supply_v"])


def test_the_truth_is_the_noise_in_the_rows(short: Path, tmp_path: Path) -> None:
    """Rate minus true bias, row by row, and pooled over any average."""
    folder = made(short, tmp_path / "data", row_s=10.0, noise="class")
    _, plan = read(short)
    truth = read_truth(folder)
    assert truth is not None
    added = []
    for index, record in enumerate(simulate_campaign(plan, 7)):
        rate = columns(folder / f"run-{index + 1:02d}.csv")["rate_dph"]
        step_s, noise = truth.noise_dph(f"run-{index + 1:02d}.csv")
        assert step_s == 10.0
        true = np.diff(record.true_arcsec[::10]) / 10.0
        added.append(rate - true)
        assert np.allclose(noise, added[-1], atol=2e-9)
    means = np.concatenate([noise.reshape(-1, 6).mean(axis=1) for noise in added])
    floor = simulated_floor(folder, ["run-01.csv", "run-02.csv"], 60.0)
    assert floor == pytest.approx(np.sqrt(np.mean(means**2)), rel=1e-6)
    assert simulated_floor(folder, [], 60.0) is None
    with pytest.raises(InputError, match="run-09"):
        truth.noise_dph("run-09.csv")


def test_a_folder_of_recordings_has_no_truth_and_is_never_overwritten(short: Path, tmp_path: Path) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    (folder / "run.csv").write_text("time_s,temperature_c,rate_dph\n", "utf-8")
    assert read_truth(folder) is None
    with pytest.raises(InputError, match="was not written by gyrotc"):
        made(short, folder)
    assert [path.name for path in folder.iterdir()] == ["run.csv"]


def test_a_simulated_folder_is_replaced_and_an_interrupted_run_leaves_no_trace(short: Path, tmp_path: Path) -> None:
    folder = made(short, tmp_path / "data")
    (folder / "notes.txt").write_text("years of work", "utf-8")
    with pytest.raises(InputError, match=r"notes\.txt"):
        made(short, folder, format="parquet")
    (folder / "notes.txt").rename(tmp_path / "notes.txt")
    made(short, folder, format="parquet")
    assert (folder / "run-01.parquet").exists() and not (folder / "run-01.csv").exists()

    def stop(_stage: str, done: float, total: float) -> None:
        if done > 0.4 * total:
            raise KeyboardInterrupt

    before = sorted(path.name for path in tmp_path.iterdir())
    with pytest.raises(KeyboardInterrupt):
        made(short, folder, progress=stop)
    assert sorted(path.name for path in tmp_path.iterdir()) == before
    assert (folder / "run-01.parquet").exists()


def test_progress_rises_to_one(short: Path, tmp_path: Path) -> None:
    shares: list[float] = []
    made(short, tmp_path / "data", progress=lambda _stage, done, total: shares.append(done / total))
    assert shares == sorted(shares) and shares[-1] == 1.0 and 0.0 < shares[0] < 1.0


@pytest.mark.parametrize(("row_s", "raw_hz"), [(0.3, None), (1.5, None), (0.0, None), (10.0, 2.5), (10.0, -1.0)])
def test_a_row_length_that_does_not_fit_a_second_is_refused(row_s: float, raw_hz: float | None) -> None:
    with pytest.raises(InputError, match="row length"):
        RowLength.of(row_s, raw_hz)


def test_every_scenario_that_is_shipped_runs_and_loads(tmp_path: Path) -> None:
    assert {"paper", "paper-20C", "separating"} <= set(names())
    for name in names():
        dataset = load(made(name, tmp_path / name, row_s=100.0))
        assert {run.role for run in dataset.runs} == {"train", "exam"}, name
        hours = sum(len(run.rows().time_s) for run in dataset.runs) / 36.0
        assert hours == (96.0 if len(dataset.runs) == 12 else 16.0), name


LONG = """
title = "Two days at rest"

[noise]
arw_deg_per_sqrt_h = 1e-3
bias_instability_dph = 1e-3
rate_random_walk_dph_per_sqrt_h = 5e-3
quantum_arcsec = 0.5

[profile.hold]
start_c = 20.0
record_from_min = 240
record_min = 2880
steps = [{hold_min = 60}]

[[set]]
started = 2026-01-01T00:00:00Z
profiles = ["hold", "hold", "hold", "hold"]
"""


def test_allantools_finds_the_declared_noise_in_a_recording(tmp_path: Path) -> None:
    """Allan variance of whole recordings: the sum of the four declared terms, each of which rules somewhere."""
    seed = 20
    print(f"seed {seed}")
    path = tmp_path / "long.toml"
    path.write_text(LONG, "utf-8")
    folder = made(path, tmp_path / "data", seed=seed, row_s=1.0, format="parquet")
    taus = np.array([1.0, 10.0, 100.0, 1000.0, 5000.0])
    rates = [run.rows().rate_dph for run in load(folder).runs]
    found = [allantools.oadev(rate, rate=1.0, data_type="freq", taus=taus)[1] for rate in rates]
    quantum = 0.25 * 0.5**2 / taus**2
    white = 1e-3**2 * 3600.0 / taus
    flicker = 2.0 * np.log(2.0) / np.pi * 1e-3**2
    walk = 5e-3**2 * taus / 3600.0 / 3.0
    expected = np.sqrt(quantum + white + flicker + walk)
    assert np.sqrt(np.mean(np.square(found), axis=0))[:4] == pytest.approx(expected[:4], rel=0.15)
    assert np.sqrt(np.mean(np.square(found), axis=0))[4] == pytest.approx(expected[4], rel=0.5)
    assert (quantum > white)[0] and (white > quantum + flicker + walk)[2] and (walk > white + flicker)[4]


def test_class_noise_is_that_of_an_ordinary_unit() -> None:
    assert NOISE["class"].arw_deg_per_sqrt_h > 10.0 * NOISE["paper"].arw_deg_per_sqrt_h
    _, plan = read("paper")
    assert gyro_map(plan, 3).described() == gyro_map(plan, 3).described() != gyro_map(plan, 4).described()


FAR = 'extends = "paper"\n[[set]]\nstarted = {}\n{}\nprofiles = ["20 C", "20 C"]'
BROKEN = {
    'title = "x"': "profile",
    "title = ": "TOML|value",
    'extends = "nothing"': "no such scenario",
    'extends = "paper"\ntypo = 1': "typo",
    'extends = "paper"\n[[cause]]\nid = "gremlins"': "gremlins",
    'extends = "paper"\n[[cause]]\nid = "warm_up"\ntau_s = 5.0': "amplitude_dph",
    'extends = "paper"\n[[cause]]\nid = "warm_up"\ntau_s = 5.0\namplitude_dph = 1.0\nwidth_c = 1': "width_c",
    'extends = "paper"\n[[cause]]\nid = "auxiliary"\nslope_dph_per_unit = 1.0': "channel",
    'extends = "paper"\n[[channel]]\nname = "rate_dph"': "columns",
    'extends = "paper"\n[sensor]\nnode = "nose"': "nose",
    'extends = "paper"\n[gyro.node.cavity]\nheat_capacity_j_per_k = 1.0\nto = {nose = 1.0}': "nose",
    'extends = "paper"\n[gyro.node.cavity]\nheat_capacity_j_per_k = 1.0': "to the air",
    'extends = "paper"\n[[set]]\nstarted = 2026-01-01T00:00:00Z\nprofiles = ["none"]': "none",
    'extends = "paper"\n[profile."20 C"]\nstart_c = 1e300': "field profile.20 C.start_c: .* less than or equal to 200",
    'extends = "paper"\n[profile."20 C"]\nrecord_min = 0.001': "field profile.20 C.record_min: .* equal to 1",
    'extends = "paper"\n[gyro]\nbias_dph = [1e300, 1.1e300]': "field gyro.bias_dph.0: .* equal to 1000000000",
    'extends = "paper"\n[chamber]\nripple_c = 1e300': "field chamber.ripple_c: .* equal to 1000000000",
    'extends = "paper"\n[chamber]\nlag_s = 1e-300': "field chamber.lag_s: .* equal to 0.000000001",
    'extends = "paper"\n[[cause]]\nid = "warm_up"\ntau_s = 5.0\namplitude_dph = 1e300': "amplitude_dph: .* equal to",
    'extends = "signals"\n[laser]\ngain_ppm = 300.0': "field laser: gain_ppm is not above loss_ppm",
    FAR.format("2026-03-01T08:00:00Z", "every_h = 1e9"): "field set.0: .*every_h: the last run starts after today",
    FAR.format("2026-03-01T08:00:00Z", "every_h = 1e12"): "field set.0.every_h: .* equal to 1000000000",
    FAR.format("9999-12-31T08:00:00Z", ""): "field set.0.started: .* not after today",
}


@pytest.mark.parametrize("content", BROKEN)
def test_a_wrong_scenario_is_reported_with_its_place(content: str, tmp_path: Path) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(content, "utf-8")
    with pytest.raises(InputError, match=BROKEN[content]):
        read(path)


def test_a_start_without_an_offset_is_in_utc(tmp_path: Path) -> None:
    """As in `dataset.toml`; runs with and without an offset can be in one campaign."""
    path = tmp_path / "mixed.toml"
    starts = ["2026-03-01T08:00:00", "2026-03-01T11:00:00+02:00"]
    sets = "".join(f'[[set]]\nstarted = {start}\nprofiles = ["20 C"]\n' for start in starts)
    path.write_text(f'extends = "paper"\n[profile."20 C"]\nrecord_min = 90\n{sets}', "utf-8")
    first, second = (run.started for run in load(made(path, tmp_path / "data", row_s=10.0)).runs)
    assert first and second and (second - first).total_seconds() == 3600.0


def test_scenarios_that_extend_each_other_are_refused(tmp_path: Path) -> None:
    one, two = tmp_path / "one.toml", tmp_path / "two.toml"
    one.write_text(f'extends = "{two}"', "utf-8")
    two.write_text(f'extends = "{one}"', "utf-8")
    with pytest.raises(InputError, match="extends"):
        read(one)


def test_the_truth_names_the_causes(tmp_path: Path) -> None:
    folder = made("hysteresis", tmp_path / "data", row_s=100.0)
    truth = json.loads((folder / "truth.json").read_text("utf-8"))
    assert truth["causes"] == [{"id": "hysteresis", "channel": None, "width_c": 4.0, "amplitude_dph_per_c": 1.2e-4}]
    described = (folder / "dataset.toml").read_text("utf-8")
    assert "truth" not in described and "seed" not in described


def test_the_example_of_the_manual_runs(tmp_path: Path) -> None:
    manual = (Path(__file__).parents[3] / "docs" / "simulation.md").read_text("utf-8")
    example = tmp_path / "example.toml"
    example.write_text(manual.split("```toml\n")[1].split("```")[0], "utf-8")
    dataset = load(made(example, tmp_path / "data", row_s=60.0))
    assert [run.environment for run in dataset.runs] == ["up and down", "nested loops"]
    assert set(dataset.runs[0].rows().channels) == {"supply_v"}
    for name in names():
        assert f"`{name}`" in manual, name


HOUR_S = 3600.0
# Two-sided risk of a false alarm at one averaging time; about twenty are looked at in one run of the tests.
RISK = 1e-7


@pytest.fixture
def seed() -> int:
    drawn = secrets.randbits(32)
    print(f"seed {drawn}")
    return drawn


def noise_of_cells(levels: NoiseLevels, cells: int, seed: int, temperature_c: float = 20.0) -> Array:
    """Angle of each cell, arcsec."""
    flat = np.full(cells, temperature_c)
    return cell_noise(np.random.SeedSequence(seed), levels, flat, np.zeros(cells)).angle_arcsec


def allan(rate_dph: Array, taus_s: list[float], rate_hz: float = 1.0) -> tuple[Array, Array, Array]:
    """Overlapping Allan deviation and, for white frequency noise, its confidence limits."""
    taus, deviation, _, _ = allantools.oadev(rate_dph, rate=rate_hz, data_type="freq", taus=taus_s)
    assert np.allclose(taus, taus_s)
    freedom = np.array([max(1.0, 0.7 * len(rate_dph) / (rate_hz * tau)) for tau in taus])
    low = deviation * np.sqrt(freedom / chi2.ppf(1.0 - RISK / 2.0, freedom))
    high = deviation * np.sqrt(freedom / chi2.ppf(RISK / 2.0, freedom))
    return deviation, low, high


def test_angle_random_walk_falls_as_one_over_the_root_of_tau(seed: int) -> None:
    n = 2e-3
    taus = [1.0, 10.0, 100.0, 1000.0]
    _, low, high = allan(noise_of_cells(NoiseLevels(arw_deg_per_sqrt_h=n), 500_000, seed) / CELL_S, taus)
    expected = n / np.sqrt(np.array(taus) / HOUR_S)
    assert np.all((low < expected) & (expected < high))


def test_bias_instability_stands_at_0_664_b(seed: int) -> None:
    """A sum of Markov processes is flat within a few percent; the spread of one record comes on top."""
    b = 1e-3
    levels = NoiseLevels(bias_instability_dph=b)
    taus = [10.0, 100.0, 1000.0, 10000.0]
    several = [allan(noise_of_cells(levels, 200_000, seed + k) / CELL_S, taus)[0] ** 2 for k in range(8)]
    deviation = np.sqrt(np.mean(several, axis=0))
    expected = np.sqrt(2.0 * np.log(2.0) / np.pi) * b
    assert deviation[:3] == pytest.approx(expected, rel=0.12)
    assert deviation[3] == pytest.approx(expected, rel=0.5)


def test_rate_random_walk_rises_with_the_root_of_tau(seed: int) -> None:
    k = 5e-3
    taus = np.array([30.0, 100.0, 300.0])
    levels = NoiseLevels(rate_random_walk_dph_per_sqrt_h=k)
    several = [allan(noise_of_cells(levels, 100_000, seed + j) / CELL_S, taus.tolist())[0] ** 2 for j in range(4)]
    deviation = np.sqrt(np.mean(several, axis=0))
    # Means over m cells of a walk with one step a cell: K²τ/3 times 1 + 1/(2 m²).
    expected = k * np.sqrt(taus / HOUR_S / 3.0 * (1.0 + 0.5 / taus**2))
    assert deviation == pytest.approx(expected, rel=0.2)


def test_a_quantum_falls_as_one_over_tau(seed: int) -> None:
    """σ = √3 Q/τ with Q = quantum/√12."""
    quantum = 0.5
    rng = np.random.default_rng(seed)
    angle = np.cumsum(rng.normal(0.0, 1e-3, 200_001))
    read = quantised(angle, quantum, rng.random(200_001))
    assert np.abs(read - angle).max() <= 0.5 * quantum * (1.0 + 1e-12)
    taus = [1.0, 4.0, 16.0]
    _, low, high = allan(np.diff(read) / CELL_S, taus)
    expected = np.sqrt(3.0) * quantum / np.sqrt(12.0) / np.array(taus)
    white = 1e-3 / np.sqrt(np.array(taus))
    assert np.all((low < np.hypot(expected, white)) & (np.hypot(expected, white) < high))


def test_noise_grows_with_temperature_and_ramp_as_declared() -> None:
    levels = NoiseLevels(arw_deg_per_sqrt_h=1e-3, arw_growth_per_c=-0.01, arw_growth_per_c_per_min=0.3)
    at = white_sigma_arcsec(levels, np.array([20.0, -30.0, 20.0]), np.array([0.0, 0.0, -2.0]))
    assert at / at[0] == pytest.approx([1.0, 1.5, 1.6])
    assert at[0] == pytest.approx(1e-3 * 60.0)


def test_outliers_come_as_often_and_as_large_as_declared() -> None:
    levels = NoiseLevels(outliers_per_h=20.0, outlier_arcsec=2.0)
    angle = noise_of_cells(levels, 360_000, 5)
    hit = np.abs(angle[angle != 0.0])
    assert len(hit) == pytest.approx(2000, abs=5 * 2000**0.5)
    assert hit.min() >= 1.0 and hit.max() <= 3.0


def plain_record(seed: int, cells: int, levels: NoiseLevels) -> SimulatedRecord:
    """A record without bias."""
    made_noise = cell_noise(np.random.SeedSequence(seed), levels, np.full(cells, 20.0), np.zeros(cells))
    angle = np.concatenate(([0.0], np.cumsum(made_noise.angle_arcsec)))
    zero = np.zeros(cells + 1)
    return SimulatedRecord(
        reading_c=np.zeros(cells),
        channels={},
        states={},
        air_c=zero,
        cavity_c=zero,
        bias_dph=zero,
        true_arcsec=zero,
        rough_arcsec=angle,
        angle_arcsec=angle,
        white_arcsec=made_noise.white_arcsec,
        quantum_arcsec=0.0,
        power_on_s=0.0,
        seeds=np.random.SeedSequence(seed + 1),
    )


def test_rows_shorter_than_a_second_keep_the_random_walk(seed: int) -> None:
    n = 1e-3
    record = plain_record(seed, 4000, NoiseLevels(arw_deg_per_sqrt_h=n))
    edges = np.concatenate([chunk.edge_arcsec[:-1] for chunk in rows(record, RowLength.of(10.0, 100.0))])
    taus = [0.01, 0.05, 0.2, 0.5, 1.0, 5.0]
    _, low, high = allan(np.diff(edges) / 0.01, taus, rate_hz=100.0)
    expected = n / np.sqrt(np.array(taus) / HOUR_S)
    assert np.all((low < expected) & (expected < high))
