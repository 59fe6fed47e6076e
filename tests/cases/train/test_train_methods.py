"""The methods of the paper, and options of a build: one default and range for all."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import Command
from gyrotc.common import InputError
from gyrotc.fleet import load_manifest
from gyrotc.model import Model
from gyrotc.recordings import load
from gyrotc.train import FitOptions, TrainingData, average_samples, fit, fit_dataset, front_end, predict
from numpy.typing import NDArray
from recordings import columns, toml, write_csv
from training_data import NOISE_DPH, rms, samples, true_bias


def error_of(found: object, seed: int = 0) -> float:
    """RMS of the map's error over the samples, in units of the paper's noise of 100-s means."""
    data = samples(seed)
    truth = true_bias(data.temperature_c, data.slope_c_per_min)
    return rms(predict(found, data.temperature_c, data.slope_c_per_min) - truth) / NOISE_DPH  # type: ignore[arg-type]


@pytest.mark.parametrize(("method", "options"), [("rbf_ols", {}), ("rbf_ols", {"rho": 0.01}), ("mrbf_paper", {})])
def test_bic_and_rho_give_a_map(method: str, options: dict[str, float]) -> None:
    found = fit(samples(0), method=method, **options)
    assert found.n_centers >= 1
    assert error_of(found) < 0.8


def test_the_size_by_bic_is_the_smallest_near_the_least() -> None:
    """Against orthogonal least squares on the whole grid in plain numpy."""
    data = samples(2)
    found = fit(data, method="rbf_ols")
    means, width = average_samples(data, 100.0), found.curves["width"]
    x = np.column_stack(found.scaling.normalise(means.temperature_c, means.slope_c_per_min))
    grid = [np.linspace(*np.quantile(column, [0.0, 1.0]), n) for column, n in zip(x.T, (21, 13), strict=True)]
    centers = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1).reshape(-1, 2)
    columns = np.exp(-np.sum((x[:, None] - centers[None]) ** 2, axis=2) / width**2)
    bic, chosen, n = [], np.ones((len(x), 1)), len(x)
    for _ in range(12):
        basis = np.linalg.qr(chosen)[0]
        residual = means.bias_dph - basis @ (basis.T @ means.bias_dph)
        bic.append(n * np.log(residual @ residual / n) + chosen.shape[1] * np.log(n))
        own = columns - basis @ (basis.T @ columns)
        share = np.sum(own**2, axis=0) / np.sum(columns**2, axis=0)
        gain = np.where(share > 1e-7, (own.T @ residual) ** 2 / np.sum(own**2, axis=0), 0.0)
        chosen = np.column_stack([chosen, columns[:, int(gain.argmax())]])
    within = np.array(bic) <= min(bic) + n * np.log1p(1e-3)
    assert found.n_centers == int(np.argmax(within))


def test_the_default_beats_what_it_is_compared_with() -> None:
    """At a fifth of the paper's noise, where the shape of the map decides; the same samples for every method."""
    errors = {
        method: np.median([error_of(fit(samples(k, noise_dph=1.4e-4), method=method), k) for k in range(5)])
        for method in ("mlr", "rbf_random", "mrbf_paper", "mrbf")
    }
    best = errors.pop("mrbf")
    assert all(best < e for e in errors.values()), (best, errors)


def test_rho_counts_down_to_the_threshold() -> None:
    """Eq. (16): the chosen size is the first at which 1 − Σ [err] is below ρ."""
    found = fit(samples(1), method="mrbf_paper", rho=0.0127)
    reductions = np.array(found.curves["error_reduction"])
    rest = 1.0 - np.cumsum(reductions)
    assert rest[-1] < 0.0127
    assert np.all(rest[:-1] >= 0.0127)
    assert found.n_centers == len(reductions) - 1
    assert fit(samples(1), method="mrbf_paper", rho=0.5).n_centers == 0


@pytest.mark.parametrize("method", ["rbf_random", "rbf_ols", "mrbf_paper"])
def test_a_number_of_centers_asked_for_is_given(method: str) -> None:
    found = fit(samples(2), method=method, centers=9)
    assert found.n_centers == 9
    assert len({w for pair in found.networks[0]["widths"] for w in pair}) == 1


def test_candidates_are_what_the_method_says() -> None:
    data = samples(3)
    random = fit(data, method="rbf_random", centers=12, average_s=10.0)
    points = {(round(t, 6), round(r, 6)) for t, r in zip(data.temperature_c, data.slope_c_per_min, strict=True)}
    assert all((round(t, 6), round(r, 6)) in points for t, r in random.networks[0]["centers"])
    grid = fit(data, method="rbf_ols", centers=12)
    t, r = np.array(grid.networks[0]["centers"]).T
    means = average_samples(data, 100.0)
    for places, inputs, steps in ((t, means.temperature_c, 20), (r, means.slope_c_per_min, 12)):
        at = (places - inputs.min()) / np.ptp(inputs) * steps
        assert np.abs(at - np.round(at)).max() < 1e-6


def with_bias(seed: int, bias_dph: NDArray[np.float64]) -> TrainingData:
    return replace(samples(seed), bias_dph=bias_dph)


@pytest.mark.parametrize(
    ("of_t", "of_r", "kept"),
    [
        (0.0, 0.0, [[0, 0]]),
        (5e-4, 0.0, [[0, 0], [1, 0]]),
        (0.0, 5e-4, [[0, 0], [0, 1]]),
        (5e-4, 5e-4, [[0, 0], [1, 0], [0, 1]]),
    ],
)
def test_linear_regression_drops_what_does_nothing(of_t: float, of_r: float, kept: list[list[int]]) -> None:
    """Of ten draws of the noise at most one keeps a variable without effect, all keep one with an effect."""
    found = []
    for seed in range(10):
        data = samples(seed)
        noise = data.bias_dph - true_bias(data.temperature_c, data.slope_c_per_min)
        t, r = (data.temperature_c - 10.0) / 50.0, data.slope_c_per_min / 4.0
        fitted = fit(with_bias(seed, 7e-3 + of_t * t + of_r * r + noise), method="mlr")
        found.append(fitted.curves["powers"])
        assert np.all(np.diff(fitted.curves["bic"]) < 0.0)
        assert fitted.n_centers == 0
        assert fitted.parameter_bytes == 24
        for used, weight in zip(([1, 0], [0, 1]), fitted.networks[0]["linear"], strict=True):
            assert (weight != 0.0) == (used in fitted.curves["powers"])
    assert found.count(kept) >= 9, found


def test_linear_regression_minimises_bic_over_its_subsets() -> None:
    """Against least squares of every subset in plain numpy, on means over 100 s."""
    for seed in range(5):
        data = samples(seed)
        fitted = fit(data, method="mlr")
        n = len(data) // 10
        t, r, y = (x.reshape(n, 10).mean(axis=1) for x in (data.temperature_c, data.slope_c_per_min, data.bias_dph))
        bic = []
        for inputs in ([], [t], [r], [t, r]):
            x = np.column_stack([np.ones(n), *inputs])
            rest = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
            bic.append(n * np.log(rest @ rest / n) + x.shape[1] * np.log(n))
        assert fitted.curves["bic"][-1] == pytest.approx(min(bic), rel=1e-9)


def test_a_bank_has_three_regions_and_blends_as_the_model_does() -> None:
    data = samples(6)
    found = fit(data, method="bank")
    assert len(found.networks) == 3
    assert error_of(found, 6) < 0.3
    model = Model.from_dict(
        {
            "schema": "gyrotc.model/1",
            "serial": "BANK",
            "axis": None,
            "method": "bank",
            "block_s": 10.0,
            "slope_blocks": 10,
            "scale": found.scale,
            "envelope": found.envelope,
            "coverage": None,
            "networks": [dict(n) for n in found.networks],
            "fallback_dph": found.fallback_dph,
            "hold_blocks": 30,
            "max_step_c": 1.0,
            "max_rate_c_per_min": 30.0,
            "noise_floor_dph": found.noise_floor_dph,
            "noise_floor_source": "estimated",
            "data": [],
            "seed": 0,
            "meta": {},
        }
    )
    rng = np.random.default_rng(6)
    t, r = rng.uniform(-60.0, 80.0, 2000), rng.uniform(-6.0, 6.0, 2000)
    np.testing.assert_allclose(predict(found, t, r), model.map_dph(t, r), rtol=1e-12)


def test_a_bank_without_ramps_is_one_network() -> None:
    data = samples(7)
    slow = data.select(np.abs(data.slope_c_per_min) < 0.1)
    found = fit(slow, method="bank")
    assert len(found.networks) in (1, 3)
    assert fit(data.select(data.slope_c_per_min > -0.1), method="bank").networks[0]["region"] is None


BAD = [
    ("average_s", "1e9"), ("average_s", "0.0"), ("average_s", "nan"), ("rho", "1.0"), ("rho", "-0.1"),
    ("block_s", "0.0"), ("block_s", "3600.1"), ("centers", "513"), ("centers", "-1"), ("seed", "-1"),
    ("method", "magic"),
]  # fmt: skip


def one_run(folder: Path) -> Path:
    """An hour of a small gyro, of which spans are left out in training."""
    rows = columns(360)
    write_csv(folder / "run-01.csv", rows | {"rate_dph": rows["rate_dph"] - 20.0})
    head = 'schema = 1\nserial = "RLG-1"\nearth_rate = "none"'
    (folder / "dataset.toml").write_text(toml('file = "run-01.csv"', head=head))
    return folder


@pytest.mark.parametrize(("name", "value"), BAD)
def test_a_data_set_that_states_a_bad_value_is_refused_in_one_line(
    name: str, value: str, tmp_path: Path, gyrotc: Command
) -> None:
    described = one_run(tmp_path / "RLG-1") / "dataset.toml"
    quoted = f'"{value}"' if name == "method" else value
    described.write_text(f"{described.read_text()}\n[fit]\n{name} = {quoted}\n")
    done = gyrotc("fit", tmp_path / "RLG-1", "--out", tmp_path / "out")
    assert done.returncode == 2 and not (tmp_path / "out").exists()
    assert done.stderr.startswith(f"gyrotc: dataset.toml, field fit.{name}: ")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(("name", "value"), BAD)
def test_a_manifest_refuses_what_the_commands_refuse_and_names_the_field(name: str, value: str, tmp_path: Path) -> None:
    one_run(tmp_path / "RLG-1")
    manifest = tmp_path / "fleet.toml"
    quoted = f'"{value}"' if name == "method" else value
    manifest.write_text(f'schema = 1\ndatasets = ["RLG-*"]\n[options]\n{name} = {quoted}\n')
    with pytest.raises(InputError) as refused:
        load_manifest(manifest)
    assert refused.value.where == f"{manifest}, field options.{name}"
    assert "\n" not in str(refused.value)


def test_a_manifest_without_options_and_one_with_all_of_them(tmp_path: Path) -> None:
    one_run(tmp_path / "RLG-1")
    manifest = tmp_path / "fleet.toml"
    manifest.write_text('schema = 1\ndatasets = ["RLG-*"]\n')
    assert load_manifest(manifest).options == FitOptions()
    manifest.write_text(
        'schema = 1\ndatasets = ["RLG-*"]\n[options]\nmethod = "rbf_ols"\nseed = 3\ncenters = 0\nrho = 0\n'
        "block_s = 3600\naverage_s = 1e6\nchannels = true\n"
    )
    assert load_manifest(manifest).options == FitOptions(
        method="rbf_ols", seed=3, centers=0, rho=0.0, block_s=3600.0, average_s=1e6, channels=True
    )


@pytest.mark.parametrize("line", ['prior = "x"', "lot = 1", "blocks = 1"])
def test_a_manifest_has_no_other_options(line: str, tmp_path: Path) -> None:
    one_run(tmp_path / "RLG-1")
    (tmp_path / "fleet.toml").write_text(f'schema = 1\ndatasets = ["RLG-*"]\n[options]\n{line}\n')
    with pytest.raises(InputError, match=r"field options\.\w+: is not known; expected one of method, "):
        load_manifest(tmp_path / "fleet.toml")


def test_means_shorter_than_a_block_are_the_blocks(tmp_path: Path) -> None:
    """However short: a billionth of a second took a word of memory for each billionth of the run."""
    recordings = load(one_run(tmp_path / "RLG-1"))
    found = [
        fit_dataset(recordings, FitOptions(method="constant", average_s=average_s)).training
        for average_s in (1e-3, 1e-9)
    ]
    assert found[0].left_out is not None
    assert found[0].left_out == found[1].left_out


def test_a_block_that_whole_rows_make_too_long_is_refused(tmp_path: Path) -> None:
    """27.7 rows of 130 s are an hour, 28 are more than a model may have."""
    recordings = load(one_run(tmp_path / "RLG-1"))
    runs = [replace(run, row_period_s=130.0) for run in recordings.runs]
    assert front_end(runs, 3500.0).block_s == 3510.0
    with pytest.raises(InputError, match=r"block_s: 3640\.0; expected"):
        front_end(runs, 3600.0)


def test_blocks_of_a_millisecond_are_held_as_often_as_a_model_may_say(tmp_path: Path) -> None:
    """300 s of them are more than it may."""
    runs = [replace(run, row_period_s=0.001) for run in load(one_run(tmp_path / "RLG-1")).runs]
    assert front_end(runs, 0.001).hold_blocks == 100_000
    assert front_end(runs, 0.01).hold_blocks == 30_000
