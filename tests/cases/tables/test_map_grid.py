"""The map of a model as a table (`emit --map`): its points, its error, and the files."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT, Command
from gyrotc.model import Model, load_model
from gyrotc.tables import csv_text, grid_of_map
from scipy.interpolate import RegularGridInterpolator

MODEL = ROOT / "tests" / "c" / "model.json"


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model(MODEL)


@pytest.mark.parametrize("points", [(61, 25), (8, 4), (2, 2)])
def test_the_grid_holds_the_envelope_its_edges_and_rest(model: Model, points: tuple[int, int]) -> None:
    grid = grid_of_map(model, points)
    assert grid.bias_dph.shape == points
    for axis, span in (
        (grid.temperature_c, model.envelope.temperature_c),
        (grid.slope_c_per_min, model.envelope.slope_c_per_min),
    ):
        assert np.all(np.diff(axis) > 0) and np.allclose(axis[[0, -1]], span, rtol=1e-7)
        assert np.array_equal(axis, axis.astype(np.float32))
    assert 0.0 in grid.slope_c_per_min or points[1] == 2


def test_an_envelope_without_width_has_one_point(model: Model) -> None:
    still = model.model_copy(update={"envelope": model.envelope.model_copy(update={"slope_c_per_min": (0.0, 0.0)})})
    grid = grid_of_map(still)
    assert grid.bias_dph.shape == (61, 1) and np.isfinite(grid.max_abs_dph)


def test_the_error_of_interpolation_is_the_one_that_is_stated(model: Model) -> None:
    errors = []
    for points in ((9, 5), (61, 25)):
        grid = grid_of_map(model, points)
        between = RegularGridInterpolator((grid.temperature_c, grid.slope_c_per_min), grid.bias_dph)
        draw = np.random.default_rng(7)
        t, r = (draw.uniform(*span, 4000) for span in (model.envelope.temperature_c, model.envelope.slope_c_per_min))
        error = between(np.stack([t, r], axis=1)) - model.map_dph(t, r)
        assert 0.7 < np.sqrt(np.mean(error**2)) / grid.rms_dph < 1.4
        assert np.abs(error).max() < 1.1 * grid.max_abs_dph
        errors.append(grid.rms_dph)
    assert errors[1] < errors[0] / 5.0


def test_each_row_of_the_csv_is_the_map(model: Model) -> None:
    rows = list(csv.DictReader(csv_text(grid_of_map(model)).splitlines()))
    assert len(rows) == 61 * 25
    for row in rows[:: 61 * 5]:
        bias = model.map_dph(float(row["temperature_c"]), float(row["slope_c_per_min"]))
        assert float(row["bias_dph"]) == float(bias)


def test_the_json_is_the_map_that_the_tables_compute(model: Model, tmp_path: Path, gyrotc: Command) -> None:
    """It is shifted as they are by `--zero-at`."""
    for shift in ((), ("--zero-at", "20")):
        done = gyrotc("emit", MODEL, "--out", tmp_path / "r", "--map", tmp_path / "r" / "map.json", *shift)
        assert done.returncode == 0 and "61 x 25 points; bilinear interpolation departs" in done.stdout, done.stderr
        content = json.loads((tmp_path / "r" / "map.json").read_text("utf-8"))
        tables = model.zeroed_at(20.0) if shift else model
        assert (content["schema"], content["model_hash"]) == ("gyrotc.map/1", tables.hash)
        assert content["units"]["bias_dph"] == "deg/h" and content["terms"] == [term.id for term in model.terms]
        t, r = np.meshgrid(content["temperature_c"], content["slope_c_per_min"], indexing="ij")
        assert np.array_equal(np.array(content["bias_dph"]), tables.map_dph(t, r))


@pytest.mark.parametrize("name", ["map.csv", "map.json"])
def test_a_map_is_replaced_and_a_foreign_file_stays(name: str, tmp_path: Path, gyrotc: Command) -> None:
    for _ in range(2):
        assert gyrotc("emit", MODEL, "--out", tmp_path / "r", "--map", tmp_path / name).returncode == 0
    (tmp_path / name).write_text("mine")
    done = gyrotc("emit", MODEL, "--out", tmp_path / "s", "--map", tmp_path / name)
    assert done.returncode == 2 and "not written by gyrotc" in done.stderr
    assert (tmp_path / name).read_text() == "mine" and not (tmp_path / "s").exists()


def test_a_map_of_another_form_is_refused_before_the_work(tmp_path: Path, gyrotc: Command) -> None:
    done = gyrotc("emit", MODEL, "--out", tmp_path / "r", "--map", tmp_path / "map.a2l")
    assert done.returncode == 2 and "--map" in done.stderr and ".csv or .json" in done.stderr
    assert not (tmp_path / "r").exists()
