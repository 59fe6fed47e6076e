"""Findings follow the data: a new name changes nothing, other numbers do."""

from __future__ import annotations

import copy
import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gyrotc.assess import findings_of
from gyrotc.model import Model
from gyrotc.quality import findings_of_run, judge, run_facts
from gyrotc.recordings import Dataset, load
from gyrotc.results import Finding, Pooled
from recordings import Columns, columns, toml, write_csv


def dataset_of(folder: Path, *tables: Mapping[str, np.ndarray], head: str | None = None) -> Dataset:
    """A data set of training runs."""
    shutil.rmtree(folder, ignore_errors=True)
    for index, table in enumerate(tables):
        write_csv(folder / f"{index}.csv", table)
    if head is not None:
        runs = [f'file = "{index}.csv"' for index in range(len(tables))]
        (folder / "dataset.toml").write_text(toml(*runs, head=head))
    return load(folder)


def statistics(rms: float, mean: float = 0.0) -> dict[str, Any]:
    return {"mean_dph": mean, "std_dph": rms, "rms_dph": rms, "max_abs_dph": 3.0 * rms}


def result_of(*runs: tuple[float, float], train: float = 0.001, exam: float | None = None) -> dict[str, Any]:
    """Figures as `evaluate` makes them; a run is (mean, standard deviation) after compensation."""
    return {
        "noise_floor_dph": 0.001,
        "runs": [
            {"file": f"{k}.csv", "samples": 100, "after": statistics(std, mean)}
            for k, (mean, std) in enumerate(runs or [(0.0, 0.001)])
        ],
        "train": {"after": statistics(train)},
        "exam": {"after": statistics(exam)} if exam is not None else None,
    }


def _left_out(rms: float) -> SimpleNamespace:
    """What of a training says how it did on spans left out."""
    pooled = Pooled.model_validate(
        dict.fromkeys(("before", "constant", "after"), statistics(rms))
        | {"improvement": 1.0, "improvement_about_zero": 1.0, "samples": 100}
    )
    return SimpleNamespace(findings=(), left_out=pooled, left_out_spans=())


def ids(dataset: Dataset, model: dict[str, Any], result: dict[str, Any], training: Any = None) -> set[str]:
    return {f.id for f in found_in(dataset, model, result, training)}


def found_in(dataset: Dataset, model: dict[str, Any], result: dict[str, Any], training: Any = None) -> list[Finding]:
    facts = [run_facts(run, run.rows()) for run in dataset.runs]
    judged = judge(dataset)
    of_runs = [
        found for run, f in zip(dataset.runs, facts, strict=True) for found in findings_of_run(judged.of(run), f)
    ]
    return findings_of(dataset, facts, of_runs, Model.from_dict(model), result, training)


@pytest.fixture
def plain(tmp_path: Path) -> Dataset:
    return dataset_of(tmp_path / "RLG-1", columns(600))


def test_nothing_is_found_where_nothing_is_wrong(plain: Dataset, model_dict: dict[str, Any]) -> None:
    assert ids(plain, model_dict, result_of()) == set()


def test_names_play_no_part(plain: Dataset, model_dict: dict[str, Any]) -> None:
    before = ids(plain, model_dict, result_of(exam=0.5))
    other = plain.folder.parent / "mpu6050-isothermal"
    plain.folder.rename(other)
    (other / "0.csv").rename(other / "isothermal.csv")
    assert ids(load(other), model_dict, result_of(exam=0.5)) == before == {"fails_on_unseen_span"}


def test_constant_temperature(tmp_path: Path, model_dict: dict[str, Any]) -> None:
    def reported(swing: float) -> set[str]:
        table = columns(600)
        table["temperature_c"] = 25.0 + swing * np.linspace(-0.5, 0.5, 600)
        table["rate_dph"] = 20.0 + 1e-3 * np.random.default_rng(7).normal(size=600)
        return ids(dataset_of(tmp_path / "R", table), model_dict, result_of(exam=0.5))

    assert reported(1.9) == {"no_temperature_information"}, "and nothing about a map that is not there"
    assert reported(2.1) == {"fails_on_unseen_span"}


@pytest.mark.parametrize("seed", [5, 6, 26, 36])
def test_an_even_ramp_of_noise_alone_has_no_change(seed: int, tmp_path: Path) -> None:
    """At one rate of the temperature, columns of a map are those of a level and a trend but for rounding."""
    table = columns(600)
    table["temperature_c"] = 25.0 + 2.1 * np.linspace(-0.5, 0.5, 600)
    table["rate_dph"] = 20.0 + 1e-3 * np.random.default_rng(seed).normal(size=600)
    assert [change for run in judge(dataset_of(tmp_path / "R", table)).runs for change in run.changes] == []


def test_what_a_map_has_not_seen(plain: Dataset, model_dict: dict[str, Any]) -> None:
    def reported(exam: float | None, left_out: float | None = None, train: float = 0.001) -> set[str]:
        training = None if left_out is None else _left_out(left_out)
        return ids(plain, model_dict, result_of(exam=exam, train=train), training)

    assert reported(0.0011) == set()
    assert reported(0.004) == {"fails_on_unseen_span"}
    assert reported(None, 0.004) == {"fails_on_unseen_span"}
    assert reported(None, 0.0029) == set(), "within three times the noise floor"
    assert reported(None, 0.0050, train=0.003) == set(), "no worse than what it has seen"


@pytest.mark.parametrize(("factor", "found"), [(1.0, True), (0.2, True), (2.0, False), (1e4, False)])
def test_earth_rate_follows_the_rate(factor: float, found: bool, tmp_path: Path, model_dict: dict[str, Any]) -> None:
    table = columns(600)
    table["rate_dph"] = factor * (table["rate_dph"] - 10.0)
    reported = ids(dataset_of(tmp_path / "R", table), model_dict, result_of())
    assert reported == ({"earth_rate_not_stated"} if found else set())
    for stated in ("removed", "none"):
        head = f'schema = 1\nserial = "A"\nearth_rate = "{stated}"'
        assert ids(dataset_of(tmp_path / "R", table, head=head), model_dict, result_of()) == set()


def _jump(table: Columns, size: float) -> Columns:
    return table | {"temperature_c": table["temperature_c"] + size * (np.arange(600) >= 300)}


def test_jumps_of_temperature(tmp_path: Path, model_dict: dict[str, Any]) -> None:
    for size, found in ((0.0, False), (0.2, False), (0.5, True), (-3.0, True), (10.0, True)):
        reported = ids(dataset_of(tmp_path / "R", _jump(columns(600), size)), model_dict, result_of())
        assert reported == ({"jump_in_temperature"} if found else set())


def test_a_noisy_thermometer_does_not_jump(tmp_path: Path, model_dict: dict[str, Any]) -> None:
    table = columns(600)
    table["temperature_c"] = table["temperature_c"] + np.random.default_rng(6).normal(0.0, 1.0, 600)
    assert ids(dataset_of(tmp_path / "R", table), model_dict, result_of()) == set()
    rounded = columns(600)
    rounded["temperature_c"] = np.round(rounded["temperature_c"])
    assert ids(dataset_of(tmp_path / "R", rounded), model_dict, result_of()) == set()


def test_weights_that_cancel(plain: Dataset, model_dict: dict[str, Any]) -> None:
    large = copy.deepcopy(model_dict)
    large["networks"][0] |= {
        "centers": [[30.0, 0.0], [30.5, 0.0]],
        "widths": [[1.0, None], [1.0, None]],
        "weights": [10.0, -10.0],
    }
    assert ids(plain, large, result_of()) == {"large_weights"}


def test_sparse_coverage(plain: Dataset, model_dict: dict[str, Any]) -> None:
    sparse = model_dict | {"coverage": {"cells": [4, 2], "rows": ["1000", "0000"]}}
    assert ids(plain, sparse, result_of()) == {"sparse_coverage"}
    assert ids(plain, model_dict | {"coverage": None}, result_of()) == set()


def test_a_run_that_differs_from_the_others(plain: Dataset, model_dict: dict[str, Any]) -> None:
    usual = [(1e-5, 0.001), (-1e-5, 0.001), (2e-5, 0.001), (-2e-5, 0.001), (0.0, 0.001)]
    assert ids(plain, model_dict, result_of(*usual)) == set()
    assert ids(plain, model_dict, result_of(*usual, (0.01, 0.001))) == {"run_outlier"}
    assert ids(plain, model_dict, result_of(*usual, (0.0, 0.01))) == {"run_outlier"}
    assert ids(plain, model_dict, result_of((0.0, 0.001), (0.01, 0.001))) == set(), "two runs tell nothing"


def test_findings_are_json(tmp_path: Path, model_dict: dict[str, Any]) -> None:
    table = _jump(columns(600), 10.0) | {"rate_dph": np.full(600, 3.0)}
    dataset = dataset_of(tmp_path / "R", table)
    usual = [(0.0, 0.001)] * 5
    model = model_dict | {"coverage": {"cells": [4, 2], "rows": ["1000", "0000"]}}
    found = found_in(dataset, model, result_of(*usual, (1.0, 0.001), exam=0.5))
    assert len(found) == 5
    for finding in json.loads(json.dumps([f.content() for f in found], allow_nan=False)):
        assert {"id", "text", "evidence"} <= set(finding)
        assert finding["text"].endswith(".")


def test_outliers_that_no_noise_makes(tmp_path: Path, model_dict: dict[str, Any]) -> None:
    def reported(*rows: int, size: float = 7e6) -> list[Finding]:
        table = columns(600)
        table["rate_dph"][list(rows)] += size
        found = found_in(dataset_of(tmp_path / "R", table), model_dict, result_of())
        return [f for f in found if f.id != "earth_rate_not_stated"]

    assert reported() == []
    for rows in ((300,), (0,), (599,), (300, 301), (300, 301, 302), tuple(range(300, 308)), (100, 300, 500)):
        for size in (7e6, -7e6, 1.0):
            [finding] = reported(*rows, size=size)
            assert finding.id == "rate_outliers"
            assert len(rows) <= finding.evidence["rows"] <= len(rows) + 3
            assert finding.time_s is not None and finding.time_s.value in [10.0 * k for k in rows]
            assert finding.size is not None and finding.size.value == pytest.approx(abs(size), rel=0.1)
    [finding] = reported(*range(300, 400))
    assert finding.id == "step_and_recover" and finding.time_s is not None
    assert finding.time_s.value == pytest.approx(3000.0, abs=60.0)


@pytest.mark.parametrize("bits", [8, 16, 24])
@pytest.mark.parametrize("kind", ["unsigned", "cumulative"])
def test_a_counter_that_wraps(bits: int, kind: str, tmp_path: Path, model_dict: dict[str, Any]) -> None:
    rng = np.random.default_rng(bits)
    table = columns(600)
    del table["rate_dph"]
    small = np.round(rng.normal(2.0, 1.5, 600))
    assert (small < 0).any()
    cumulative = np.cumsum(np.round(rng.normal(2.0**bits / 100.0, 1.0, 600)))
    counted = small if kind == "unsigned" else cumulative
    head = 'schema = 1\nserial = "A"\nearth_rate = "none"\npulse_weight_arcsec = 0.01'

    def found(pulses: np.ndarray) -> list[Finding]:
        dataset = dataset_of(tmp_path / "R", table | {"pulses": pulses}, head=head)
        every = found_in(dataset, model_dict, result_of())
        return [f for f in every if f.id == "counter_wrapped"]

    assert found(counted) == []
    [finding] = found(counted % 2**bits)
    assert finding.evidence["bits"] == bits and finding.time_s is not None
    row = int(finding.time_s.value / 10.0)
    assert abs((counted % 2**bits)[row] - (counted % 2**bits)[row - 1]) > 2 ** (bits - 1)


def test_training_runs_that_contradict_one_another(tmp_path: Path, model_dict: dict[str, Any]) -> None:
    def reported(*shifts: float) -> list[str | None]:
        tables = [columns(1800, seed=k) for k in range(len(shifts))]
        for table, shift in zip(tables, shifts, strict=True):
            table["rate_dph"] = table["rate_dph"] + shift
        dataset = dataset_of(tmp_path / "R", *tables)
        found = found_in(dataset, model_dict, result_of())
        return [f.file for f in found if f.id == "runs_contradict"]

    floor = 0.001 / np.sqrt(10.0)  # of 100 s
    assert reported(0.0) == reported(0.0, 0.0) == reported(0.0, 2.0 * floor) == []
    assert reported(0.0, 24.0 * floor) == ["0.csv", "1.csv"], "two runs: nobody knows which"
    assert reported(0.0, 0.0, 24.0 * floor, 0.0) == ["2.csv"]
