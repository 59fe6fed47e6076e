"""Spikes, bursts and NaN do not reach the fit, are listed, and cost a clean recording nothing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from gyrotc.quality.check import check
from gyrotc.quality.outliers import departing
from gyrotc.recordings.load import load
from gyrotc.train.fitting import FitOptions, Fitted, fit_dataset
from numpy.typing import NDArray
from recordings import Columns, toml, write_csv

Floats = NDArray[np.float64]
ROWS = 28_800
RUN = 'file = "a.csv"'


def cycle(seed: int = 1) -> Columns:
    """Eight hours of rows of a second: two cycles of temperature, a smooth bias, white noise of 0.1 deg/h a row."""
    g = np.random.default_rng(seed)
    t = np.arange(ROWS) * 1.0
    temperature = 20.0 + 30.0 * np.sin(t * (4.0 * np.pi / ROWS))
    rate = 0.02 * np.sin(temperature / 12.0) + g.normal(0.0, 0.1, ROWS)
    return {
        "time_s": t,
        "temperature_c": np.round(temperature + g.normal(0.0, 0.005, ROWS), 4),
        "rate_dph": rate,
    }


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
    told = spiked.training.content()["outliers"]
    assert told["rows"] == 10
    assert [s["from_s"] for s in told["stretches"]] == at.tolist()
    [doubt] = [d for d in check(tmp_path / "R").doubts if d.id == "rate_outliers"]
    line = doubt.text[doubt.text.index("exclude = ") :]
    again = fitted(tmp_path / "R", table, f"{RUN}\n{line}")  # pasted as it is offered
    assert again.training.content()["outliers"]["rows"] == 0
    assert "rate_outliers" not in {d.id for d in check(tmp_path / "R").doubts}


def test_a_burst_is_left_out_whole(tmp_path: Path, clean: Fitted) -> None:
    table = cycle()
    table["rate_dph"][9000:9015] += np.random.default_rng(3).normal(0.0, 20.0, 15)
    burst = fitted(tmp_path / "R", table)
    assert 14 <= burst.training.content()["outliers"]["rows"] <= 30
    assert departure(burst, clean) < 0.1 * clean.training.noise_floor_dph


def test_a_clean_recording_loses_nothing(clean: Fitted) -> None:
    assert clean.training.content()["outliers"] == {"rows": 0, "share": 0.0, "stretches": []}


NOISES: dict[str, Callable[[np.random.Generator, int], Floats]] = {
    "white": lambda g, n: g.normal(0.0, 1.0, n),
    "quantised": lambda g, n: np.round(g.normal(0.0, 0.3, n)),
    "rare counts": lambda g, n: (g.random(n) < 0.002) * 1.0,
    "low pass": lambda g, n: np.convolve(g.normal(0.0, 1.0, n + 99), np.ones(100) / 100.0, "valid"),
    "Laplace": lambda g, n: g.laplace(0.0, 1.0, n),
    "louder from the middle on": lambda g, n: (
        g.normal(0.0, 1.0, n) * np.where(np.arange(n) < n // 2, 1.0, 10.0)
    ),
    "a lasting step": lambda g, n: g.normal(0.0, 1.0, n) + np.where(np.arange(n) < n // 2, 0.0, 40.0),
    "ramps": lambda g, n: np.abs(np.arange(n) - n / 2) / 60.0 + g.normal(0.0, 0.1, n),
    "constant": lambda g, n: np.zeros(n),
}


@pytest.mark.parametrize("rows_per_block", [1, 10, 100])
@pytest.mark.parametrize("name", NOISES)
def test_less_than_a_thousandth_of_a_clean_recording_is_left_out(name: str, rows_per_block: int) -> None:
    rate = NOISES[name](np.random.default_rng(11), 200_000)
    assert departing(rate, rows_per_block).sum() < 200


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


@pytest.mark.slow
def test_the_report_lists_what_was_left_out_with_the_line_to_paste(
    tmp_path: Path,
) -> None:
    from gyrotc.jobs.build import build

    table = cycle()
    table["rate_dph"][[5000, 9000]] += 5.0
    write_csv(tmp_path / "R" / "a.csv", table)
    (tmp_path / "R" / "dataset.toml").write_text(toml(RUN), "utf-8")
    build(tmp_path / "R", tmp_path / "out", FitOptions(), numerics=["f32"], targets=["host-gcc-O2"])
    page = (tmp_path / "out" / "report.html").read_text("utf-8")
    assert "Rows left out of training" in page
    lines = (
        "exclude = [{from_s = 5000.0, to_s = 5000.5, reason = &#34;outlier&#34;}, "
        "{from_s = 9000.0, to_s = 9000.5, reason = &#34;outlier&#34;}]"
    )
    assert lines in page
