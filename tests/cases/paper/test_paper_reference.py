"""gyrotc against the reference of the paper (paper_reference.py), in six environments: the first gyro, or ten.

`make check` sets GYROTC_PAPER_GYROS=10. Tolerances: both programs do the same sums in another order, so they differ by
rounding (2e-16) times what a step amplifies it by; each constant says by what.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import paper_reference as reference
import pytest
from gyrotc import _core
from gyrotc.pages import ENVIRONMENTS, NEURONS
from gyrotc.simulate import simulate
from gyrotc.train import Outcome, average_samples, scaling_of, trained
from numpy.typing import NDArray

from bench.paper.experiment import LITERAL_RHO, PaperGroup, groups_of
from bench.records import read_record

Floats = NDArray[np.float64]
ROOT = Path(__file__).resolve().parents[3]
SEEDS = range(1, 1 + int(os.environ.get("GYROTC_PAPER_GYROS", "1")))

NODES = 1e-9  # half ranges: 30 passes of a learning that forgets, so rounding is not amplified
REDUCTION = 1e-3  # of all that centers explain: what rounds in one step is divided by what is left in the next
WEIGHTS = 1e-5  # of the largest weight: a ridge of 1e-8 amplifies rounding by up to 1e8, plain least squares by 1e10
RMS = 1e-8  # relative: weights that are uncertain together hardly change the bias; the record has ten digits
INPUT_C = 2e-5  # C: the front end computes in float32, of which 60 C has steps of 4e-6
INPUT_C_PER_MIN = 1e-4  # the same in a slope, 6 blocks a minute

VARIANTS: dict[str, tuple[str, str, dict[str, Any]]] = {
    "rbf_random": ("rbf_random", "random", {}),
    "rbf_random_plain": ("rbf_random", "random", {"ridge": 0.0}),
    "mrbf_paper": ("mrbf_paper", "modified", {}),
    "mrbf_paper_literal": ("mrbf_paper", "modified", {"rho": LITERAL_RHO}),
}
"""Row of Table 1: method of gyrotc, network of the reference, arguments of both."""


@dataclass(frozen=True)
class Both:
    """One method on one environment by both programs."""

    group: PaperGroup
    engine: Outcome
    plain: reference.Network


@pytest.fixture(scope="module", params=SEEDS, ids=lambda seed: f"gyro {seed}")
def gyro(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[int, Path]:
    seed = int(request.param)
    out = tmp_path_factory.mktemp("paper") / "data"
    simulate("paper", seed=seed, out=out)
    return seed, out


@pytest.fixture(scope="module")
def groups(gyro: tuple[int, Path]) -> list[PaperGroup]:
    return groups_of(gyro[1])[0]


@pytest.fixture(scope="module")
def networks(gyro: tuple[int, Path], groups: list[PaperGroup]) -> dict[str, list[Both]]:
    """By row of Table 1, the environments in its order."""
    found: dict[str, list[Both]] = {}
    for row, (method, kind, options) in VARIANTS.items():
        found[row] = []
        for group in groups:
            data, neurons = group.train, NEURONS[group.environment] if kind == "random" else None
            engine = trained(method, data, scaling_of(data), seed=gyro[0], centers=neurons, **options)
            plain = reference.network(
                kind, data.temperature_c, data.slope_c_per_min, data.bias_dph, gyro[0], neurons=neurons, **options
            )
            found[row].append(Both(group, engine, plain))
    return found


def each(networks: dict[str, list[Both]]) -> Iterator[tuple[str, Both]]:
    for row, of in networks.items():
        for both in of:
            yield f"{row}, {both.group.environment}", both


def left(group: PaperGroup, predicted: Floats) -> float:
    """RMS of set 2 after compensation: means over 100 s from the start of the run, the first without two rows."""
    after = np.r_[np.nan, np.nan, group.exam.bias_dph - predicted].reshape(-1, reference.ROWS)
    return float(np.sqrt(np.mean(np.nanmean(after, axis=1) ** 2)))


def test_inputs_and_means_are_the_front_end_s(gyro: tuple[int, Path], groups: list[PaperGroup]) -> None:
    runs = {path.name: np.loadtxt(path, delimiter=",", skiprows=1) for path in sorted(gyro[1].glob("run-*.csv"))}
    by_bias = {rows[2:, 2].tobytes(): rows for rows in runs.values()}
    for group in groups:
        for data in (group.train, group.exam):
            rows = by_bias[data.bias_dph.tobytes()]
            t, slope = reference.inputs(rows[:, 1])
            assert np.abs(t - data.temperature_c).max() < INPUT_C
            assert np.abs(slope - data.slope_c_per_min).max() < INPUT_C_PER_MIN
            gathered = average_samples(data, 100.0)
            assert len(gathered) == 288
            for ours, column in ((gathered.temperature_c, data.temperature_c), (gathered.bias_dph, data.bias_dph)):
                np.testing.assert_allclose(ours, reference.means(column), rtol=1e-12)
            np.testing.assert_array_equal(gathered.weight, reference.rows_of(len(data)))


def test_kohonen_nodes_are_the_same(gyro: tuple[int, Path], groups: list[PaperGroup]) -> None:
    for group in groups:
        gathered, scaling = average_samples(group.train, 100.0), scaling_of(group.train)
        x = np.column_stack(scaling.normalise(gathered.temperature_c, gathered.slope_c_per_min))
        found = _core.kohonen(x, reference.NODES, seed=gyro[0])
        assert np.abs(found.nodes - reference.kohonen(x, gyro[0])).max() < NODES


def test_centers_are_chosen_in_the_same_order_up_to_the_same_stop(networks: dict[str, list[Both]]) -> None:
    for name, both in each(networks):
        curves, plain = both.engine.curves, both.plain
        assert curves["width"] == plain.delta, name
        assert curves["rho"] == pytest.approx(plain.rho, rel=1e-9), name
        assert curves["chosen"] == len(plain.centers), name
        reductions = np.array(curves["error_reduction"])
        assert np.abs(reductions - plain.reductions).max() < REDUCTION * plain.reductions[1:].sum() + 1e-12, name


def test_centers_and_weights_are_the_same(networks: dict[str, list[Both]]) -> None:
    for name, both in each(networks):
        (found,) = both.engine.networks
        c_t, c_r = np.reshape(found["centers"], (-1, 2)).T
        scaling = scaling_of(both.group.train)
        centers = np.column_stack(scaling.normalise(c_t, c_r))
        order = np.lexsort((both.plain.centers[:, 1], both.plain.centers[:, 0]))
        assert np.abs(centers - both.plain.centers[order]).max(initial=0.0) < NODES, name
        weights = np.r_[found["w0"], found["weights"]]
        expected = both.plain.weights[np.r_[0, 1 + order]]
        assert np.abs(weights - expected).max() < WEIGHTS * np.abs(expected).max(), name


def test_the_same_regression_stays(groups: list[PaperGroup]) -> None:
    for group in groups:
        data, scaling = group.train, scaling_of(group.train)
        found = trained("mlr", data, scaling)
        kept, weights = reference.regression(data.temperature_c, data.slope_c_per_min, data.bias_dph)
        assert found.curves["powers"] == [[[0, 0], [1, 0], [0, 1]][k] for k in kept]
        (of_t, of_r), full = found.networks[0]["linear"], np.zeros(3)
        full[kept] = weights
        assert of_t / scaling.half_range_c == pytest.approx(full[1], rel=1e-9, abs=1e-15)
        assert of_r / scaling.half_range_c_per_min == pytest.approx(full[2], rel=1e-9, abs=1e-15)


def test_table_1_is_the_reference_s(
    gyro: tuple[int, Path], groups: list[PaperGroup], networks: dict[str, list[Both]]
) -> None:
    """Every cell of a paper's method that the record of docs/paper.md has of this gyro."""
    record = read_record(ROOT / "docs", "paper")
    after = record["gyros"]["paper"][str(gyro[0])]["after"]
    worst: dict[str, float] = {}
    for number, group in enumerate(groups):
        data, exam = group.train, group.exam
        kept, weights = reference.regression(data.temperature_c, data.slope_c_per_min, data.bias_dph)
        edges = reference.Scale(*np.array([(x.min(), x.max()) for x in (data.temperature_c, data.slope_c_per_min)]).T)
        x = np.clip(np.column_stack([exam.temperature_c, exam.slope_c_per_min]), edges.low, edges.high)
        cells = {
            "constant": np.full(len(exam), data.bias_dph.mean()),
            "mlr": np.column_stack([np.ones(len(exam)), x])[:, kept] @ weights,
            **{row: of[number].plain(exam.temperature_c, exam.slope_c_per_min) for row, of in networks.items()},
        }
        for row, predicted in cells.items():
            printed = after[row][group.environment]["rms_dph"]
            worst[row] = max(worst.get(row, 0.0), abs(left(group, predicted) / printed - 1.0))
    print(f"gyro {gyro[0]}:", ", ".join(f"{row} {share:.1e}" for row, share in worst.items()))
    assert max(worst.values()) < RMS, worst
    assert list(worst) == [row for row in after if row != "mrbf"]
    assert set(after["mlr"]) == set(ENVIRONMENTS)
