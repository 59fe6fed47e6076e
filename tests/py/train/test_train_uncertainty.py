"""Coverage and uncertainty of a fit: what they say is what the truth does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from gyrotc.train.data import TrainingData
from gyrotc.train.methods import fit
from gyrotc.train.result import predict
from gyrotc.train.uncertainty import _least_deviance, _likeliest, coverage, uncertainty
from numpy.typing import NDArray
from training_data import samples, true_bias


def cells_of(
    data: TrainingData, found: object, cells: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Cell of T and of dT/dt of every sample, by the formula of docs/numerics.md."""
    spans = (found.envelope["temperature_c"], found.envelope["slope_c_per_min"])  # type: ignore[attr-defined]
    values = (data.temperature_c, data.slope_c_per_min)
    index = [
        np.minimum(np.floor((x - low) * n / (high - low)).astype(np.int64), n - 1)
        for x, (low, high), n in zip(values, spans, cells, strict=True)
    ]
    return index[0], index[1]


def test_coverage_marks_the_cells_that_hold_samples() -> None:
    data = samples(0)
    found = fit(data)
    mapped = coverage(data, found, (16, 6))
    assert mapped["cells"] == [16, 6]
    t, r = cells_of(data, found, (16, 6))
    seen = np.zeros((6, 16), dtype=bool)
    seen[r, t] = True
    assert [[c == "1" for c in row] for row in mapped["rows"]] == seen.tolist()
    assert not seen.all()


def test_one_sigma_holds_the_truth_two_times_in_three() -> None:
    """Error of the map at visited cells over 12 gyros' noise: 68 and 95 % expected, cells of a gyro correlated."""
    inside = []
    for seed in range(12):
        data = samples(seed)
        found = fit(data)
        sigma = np.array(uncertainty(data, found, (12, 8))["rows"])
        t, r = cells_of(data, found, (12, 8))
        error = predict(found, data.temperature_c, data.slope_c_per_min)
        error -= true_bias(data.temperature_c, data.slope_c_per_min)
        index = t + 12 * r
        count = np.bincount(index, minlength=96)
        mean = np.bincount(index, error, minlength=96)[count > 5] / count[count > 5]
        inside.append(np.abs(mean) / sigma.ravel()[count > 5])
    ratio = np.concatenate(inside)
    assert 0.58 < np.mean(ratio < 1.0) < 0.88
    assert np.mean(ratio < 2.0) > 0.88


def test_where_no_sample_was_it_is_larger() -> None:
    """A ramp that never cooled: on the other side of dT/dt nothing is known."""
    data = samples(1)
    up = data.select((data.slope_c_per_min > -0.1) | (data.temperature_c < -30.0))
    found = fit(up)
    known = uncertainty(up, found, (12, 8))
    t, r = cells_of(up, found, (12, 8))
    seen = np.zeros((8, 12), dtype=bool)
    seen[r, t] = True
    assert np.median(np.array(known["uncovered"])[~seen]) > 1.1 * np.median(np.array(known["rows"])[seen])


def test_offsets_between_runs_are_part_of_it() -> None:
    """Runs that differ by 3e-4 deg/h: the next run will differ, too."""
    runs = []
    rng = np.random.default_rng(2)
    for k in range(8):
        one = samples(20 + k, hours=2.0)
        one = one.select(one.run == 1 + k % 2)
        offset = rng.normal(0.0, 3e-4)
        runs.append(replace(one, run=np.full(len(one), k), bias_dph=one.bias_dph + offset))
    data = TrainingData(
        **{k: np.concatenate([getattr(x, k) for x in runs]) for k in TrainingData.__dataclass_fields__}
    )
    sigma = np.array(uncertainty(data, fit(data))["rows"])
    assert 1.5e-4 < np.median(sigma) < 8e-4


def test_a_single_run_is_cut_into_spans() -> None:
    data = samples(3)
    one = data.select(data.run == 1)
    sigma = np.array(uncertainty(one, fit(one), (4, 3))["rows"])
    assert sigma.shape == (3, 4)
    assert np.isfinite(sigma).all()
    assert (sigma > 0.0).all()


def test_no_deviance_lies_below_what_leaves_a_level_out() -> None:
    """Levels between runs are left out by a bound: no level that it leaves out may be the likeliest."""
    rng = np.random.default_rng(5)
    for size in (1e-8, 1.0, 1e6):
        squares, variance, noise = size * rng.chisquare(1, (3, 40)) * 10.0 ** rng.uniform(-3.0, 3.0, (3, 40))
        for between in size * 10.0 ** rng.uniform(-6.0, 6.0, 20):
            deviance, _ = _likeliest(squares, variance, noise, float(between))
            assert _least_deviance(squares, float(between)) <= deviance + 1e-9
