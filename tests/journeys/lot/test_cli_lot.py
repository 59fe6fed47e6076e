"""`gyrotc lot` and `--lot` as a user types them: a fleet of simulated units teaches, a new one has one short run."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from conftest import HOST, run_here
from gyrotc.common import InputError
from gyrotc.diagnose import Refitting, records_of
from gyrotc.jobs import load_lot, lot_of
from gyrotc.model import load_model
from gyrotc.recordings import load
from gyrotc.results import json_text
from gyrotc.train import FitOptions, joined, predict
from gyrotc.train.prior import prior_of
from jobs import units_in_this_process
from recordings import state_fit

RUNS = """
title = "Two short cycles"

[profile.slow]
start_c = 0.0
record_min = 120
steps = [{ramp_to_c = 40.0, c_per_min = 1.0}, {hold_min = 20}, {ramp_to_c = -20.0, c_per_min = 2.0}, {hold_min = 30}]

[profile.fast]
start_c = 0.0
record_min = 90
steps = [{repeat = [
  {ramp_to_c = 40.0, c_per_min = 5.0}, {hold_min = 15}, {ramp_to_c = -20.0, c_per_min = 5.0}, {hold_min = 15},
]}]

[[set]]
started = 2026-01-01T00:00:00Z
profiles = [PROFILES]
"""


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five units with all runs, their fleet and lot; the sixth with a single short one."""
    place = tmp_path_factory.mktemp("lot")
    for name, profiles in (("whole", '"slow", "fast", "slow"'), ("short", '"fast"')):
        (place / f"{name}.toml").write_text(RUNS.replace("PROFILES", profiles), "utf-8")
    lot = ("--seed", "5", "--format", "parquet")
    run_here("simulate", place / "whole.toml", *lot, "--units", "5", "--out", place / "whole")
    run_here("simulate", place / "short.toml", *lot, "--units", "6", "--out", place / "short")
    with units_in_this_process():
        run_here("fleet", place / "whole", "--out", place / "fleet")
    reported = run_here("lot", place / "fleet", "--out", place / "lot.json")
    assert "5 units" in reported and "before any run" in reported
    return place


@pytest.fixture(scope="module")
def new_gyro(world: Path) -> tuple[str, Path]:
    """The sixth unit built with the lot: what the command printed, and the result."""
    unit, out = world / "short" / "LOT-0005-006", world / "with"
    return run_here("build", unit, "--lot", world / "lot.json", *HOST, "--out", out), out


def test_the_file_is_small_and_says_from_what_it_was_made(world: Path) -> None:
    lot = load_lot(world / "lot.json")
    assert (world / "lot.json").stat().st_size < 200_000
    assert [u.serial for u in lot.units] == [f"LOT-0005-00{k}" for k in range(1, 6)]
    assert lot.units[0].model_hash == load_model(world / "fleet" / "LOT-0005-001").hash
    assert lot_of(world / "fleet").content() == lot.content()
    assert lot.at_rest.temperature_c[0] == pytest.approx(lot.temperature_c[0], rel=1e-5)


def test_the_scatter_of_power_ons_is_that_of_all_units(world: Path) -> None:
    between = [load_model(path).between_dph for path in (world / "fleet").glob("LOT-*/model.json")]
    assert len(between) == 5 and max(between) > 1.1 * min(between)
    assert load_lot(world / "lot.json").between_dph == pytest.approx(np.sqrt(np.mean(np.square(between))), rel=1e-5)


def test_how_many_units_were_left_out_is_said_with_the_reasons(
    world: Path, new_gyro: tuple[str, Path], tmp_path: Path
) -> None:
    fleet = Path(shutil.copytree(world / "fleet", tmp_path / "fleet"))
    shutil.copytree(fleet / "LOT-0005-002", fleet / "under another name")
    shutil.copytree(new_gyro[1], fleet / "LOT-0005-006")
    summary = json.loads((fleet / "fleet.json").read_text())
    (barred,) = (one for one in summary["serials"] if one["name"] == "LOT-0005-001")
    barred["findings"] = ["sign_reversed"]
    # A unit whose recordings have left the fleet is not in fleet.json, though its result is still there.
    shutil.copytree(fleet / "LOT-0005-003", fleet / "left")
    summary["serials"] += [barred | {"findings": [], "name": name} for name in ("under another name", "LOT-0005-006")]
    (fleet / "fleet.json").write_text(json.dumps(summary))
    expected = (
        "left out: 1 not in fleet.json, 1 barred by a finding of the fleet, "
        "1 calibrated with a lot or an earlier model, 1 with the serial of another folder"
    )
    assert expected in run_here("lot", fleet, "--out", tmp_path / "lot.json")
    lot = load_lot(tmp_path / "lot.json")
    assert expected in lot.text and [u.serial for u in lot.units] == [f"LOT-0005-00{k}" for k in range(2, 6)]


def test_a_new_unit_takes_the_lots_envelope_and_says_what_came_from_where(
    world: Path, new_gyro: tuple[str, Path]
) -> None:
    reported, built = new_gyro
    apart = Path(shutil.copytree(world / "short" / "LOT-0005-006", world / "apart" / "LOT-0005-006"))
    run_here("fit", state_fit(apart, method="mrbf"), "--out", world / "alone")
    lot, model, alone = load_lot(world / "lot.json"), load_model(built), load_model(world / "alone")
    use = json.loads((built / "training.json").read_text())["lot"]
    assert use["checksum"] == lot.checksum and use["accepted"] and not use["member"]
    assert "lot: a lot of 5 units leaves" in reported and str(model.meta["lot"]).endswith(use["text"])
    assert model.envelope.temperature_c[0] <= lot.temperature_c[0]
    assert model.envelope.temperature_c[1] >= alone.envelope.temperature_c[1]
    assert model.coverage is not None and alone.coverage is not None
    assert "".join(model.coverage.rows).count("1") > 0


def test_header_and_report_show_the_lot(world: Path, new_gyro: tuple[str, Path]) -> None:
    out, unit = new_gyro[1], world / "short" / "LOT-0005-006"
    assert "a lot of 5 units leaves" in next((out / "c").glob("gtc_lot*.h")).read_text()
    page = (out / "report.html").read_text()
    assert "<h3>The lot</h3>" in page and "the lot alone, 5 units" in page
    with pytest.raises(InputError, match="--extend"):
        run_here("build", unit, "--lot", world / "lot.json", "--extend", "--out", world / "no")


@pytest.mark.usefixtures("in_this_process")
def test_a_fleet_with_a_lot_is_done_again_when_the_lot_changes(world: Path) -> None:
    data, out = world / "few", world / "few-out"
    data.mkdir()
    (data / "LOT-0005-006").symlink_to(world / "short" / "LOT-0005-006")
    manifest = world / "few.toml"
    manifest.write_text('schema = 1\ndatasets = ["few/*"]\nlot = "lot.json"\n', "utf-8")
    first = run_here("fleet", manifest, "--out", out, "--jobs", "1")
    again = run_here("fleet", manifest, "--out", out, "--jobs", "1")
    other = run_here("fleet", data, "--out", out, "--jobs", "1")
    assert "done before" not in first and "done before" in again and "done before" not in other


def test_a_diagnosis_starts_from_the_lots_map(world: Path, tmp_path: Path) -> None:
    """The map beside the causes, from one of three runs, has less error on the others; a single cycle goes without."""
    (tmp_path / "fast.toml").write_text(RUNS.replace("PROFILES", '"fast", "slow", "fast"'), "utf-8")
    lot = ("--seed", "5", "--format", "parquet", "--units", "6")
    run_here("simulate", tmp_path / "fast.toml", *lot, "--out", tmp_path / "units")
    dataset, lot = load(tmp_path / "units" / "LOT-0005-006"), load_lot(world / "lot.json")
    records = records_of(dataset, "train", block_s=10.0, average_s=100.0)
    left = []
    for options in (FitOptions(prior=prior_of(lot)), FitOptions()):
        refitting = Refitting(dataset, records, options, single_cycle=False)
        first = [np.full(len(m), k == 0) for k, m in enumerate(refitting.everything())]
        fitted = refitting.fit([], first)
        others = joined([played.data for played in refitting.train[1:]])
        away = others.bias_dph - predict(fitted, others.temperature_c, others.slope_c_per_min)
        left.append(float(np.mean(away**2)))
        assert (fitted.lot is not None and fitted.lot.accepted) == (options.prior is not None)
    assert left[0] < left[1]
    unit, out = world / "short" / "LOT-0005-006", tmp_path / "found"
    reported = run_here("diagnose", unit, "--lot", world / "lot.json", "--out", out)
    assert "lot: not used: " in reported and "single cycle" in json.loads((out / "diagnose.json").read_text())["lot"]


def test_a_lot_that_was_changed_is_refused(world: Path, tmp_path: Path) -> None:
    content = json.loads((world / "lot.json").read_text())
    content["unit_dph"] *= 2.0
    (tmp_path / "lot.json").write_text(json_text(content))
    with pytest.raises(InputError, match=r"lot\.json, field checksum"):
        load_lot(tmp_path / "lot.json")


def test_what_is_no_lot_of_units_is_reported(world: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="0 calibrated units"):
        run_here("lot", tmp_path, "--out", tmp_path / "lot.json")
    with pytest.raises(InputError, match="no folder"):
        run_here("lot", tmp_path / "none", "--out", tmp_path / "lot.json")
    with pytest.raises(InputError, match="0 calibrated units, 5 of another axis"):
        run_here("lot", world / "fleet", "--axis", "x", "--out", tmp_path / "lot.json")
    training = tmp_path / "fleet" / "A" / "training.json"
    training.parent.mkdir(parents=True)
    content = json.loads((world / "fleet" / "LOT-0005-001" / "training.json").read_text())
    content.pop("means")
    training.write_text(json_text(content))
    (training.parent / "model.json").write_bytes((world / "fleet" / "LOT-0005-001" / "model.json").read_bytes())
    with pytest.raises(InputError, match="has no means"):
        run_here("lot", tmp_path / "fleet", "--out", tmp_path / "lot.json")
    assert not (tmp_path / "lot.json").exists()
