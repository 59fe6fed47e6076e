"""Many serials at once: one that fails does not stop the others, what is done stays done, the odd one is named."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Command, made_once
from gyrotc.fleet import Fleet, Task, Unit, do_unit, load_manifest, outlying_units, run_fleet, write_summary
from gyrotc.results import FleetEntry, Marker, result_faults, write_marker
from gyrotc.tables import needs_of
from gyrotc.train import FitOptions
from gyrotc.verify import verify
from jobs import units_in_this_process
from models import random_model
from recordings import columns, toml, write_csv

HEAD = 'schema = 1\nserial = "{}"\nearth_rate = "none"'


def gyro(folder: Path, serial: str, *, seed: int = 1, factor: float = 1.0) -> None:
    """Two hours of a small gyro; `factor` scales its rate."""
    rows = columns(720, seed=seed)
    write_csv(folder / "run-01.csv", rows | {"rate_dph": factor * (rows["rate_dph"] - 20.0)})
    (folder / "dataset.toml").write_text(toml('file = "run-01.csv"', head=HEAD.format(serial)))


@pytest.fixture
def three(tmp_path: Path) -> Path:
    """Two gyros and one whose recording is no recording."""
    for k in (1, 2):
        gyro(tmp_path / "data" / f"RLG-{k}", f"RLG-{k}", seed=k)
    gyro(tmp_path / "data" / "RLG-3", "RLG-3")
    (tmp_path / "data" / "RLG-3" / "run-01.csv").write_text("time_s,rate_dph\n")
    with (tmp_path / "data" / "RLG-3" / "dataset.toml").open("a") as file:
        file.write("started = 2026-03-02T08:00:00Z\n")
    return tmp_path / "data"


def test_a_fleet_through_the_command(three: Path, tmp_path: Path, gyrotc: Command) -> None:
    out = tmp_path / "out"
    done = gyrotc("fleet", three, "--out", out)
    assert done.returncode == 1
    assert done.stderr == "gyrotc: 1 of 3 gyros failed\n"
    lines = {line.split(":")[0]: line for line in done.stdout.splitlines()}
    assert "done; RMS" in lines["RLG-1"] and "done; RMS" in lines["RLG-2"]
    assert "failed; run-01.csv, line 1: no column temperature_c" in lines["RLG-3"]
    assert lines["next"] == "next: mend what stopped RLG-3 (its line above), and give the command again"
    verified = verify(out / "RLG-1", compiled=False).emitted
    assert {file.verdict for file in verified} == {"equal"}, "the folder of a gyro is complete"
    summary = json.loads((out / "fleet.json").read_text())
    assert (summary["schema"], summary["done"], summary["failed"]) == ("gyrotc.fleet/1", 2, 1)
    rows = list(csv.DictReader((out / "fleet.csv").read_text("utf-8").splitlines()))
    assert [row["status"] for row in rows] == ["done", "done", "failed"]
    assert "RLG-3" in (out / "fleet.html").read_text()

    refused = summary["serials"][2]
    assert (refused["serial"], refused["date"]) == ("RLG-3", "2026-03-02")
    assert refused["reason"].startswith("run-01.csv, line 1: no column temperature_c")
    before = {p: p.stat().st_mtime_ns for p in (out / "RLG-1").rglob("*.c")}
    gyro(three / "RLG-3", "RLG-3", seed=3)
    again = gyrotc("fleet", three, "--out", out, "--jobs", "1")
    assert again.returncode == 0, again.stderr
    assert again.stdout.count("done (done before)") == 2 and "RLG-3: done; RMS" in again.stdout
    assert again.stdout.splitlines()[-1].startswith("next: state limits of the product in a manifest")
    of_all = gyrotc("report", out)
    assert of_all.returncode == 2 and f"expected the folder of a gyro, e.g. {out / 'RLG-1'}" in of_all.stderr
    assert {p: p.stat().st_mtime_ns for p in (out / "RLG-1").rglob("*.c")} == before


def _fleet(folder: Path) -> None:
    for k in (1, 2):
        gyro(folder / "data" / f"RLG-{k}", f"RLG-{k}", seed=k)
    with units_in_this_process():
        run_fleet(load_manifest(folder / "data"), folder / "out")


@pytest.fixture
def fleet(tmp_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The result of a fleet of two gyros, a copy for each test."""
    whole = made_once(tmp_path_factory, "fleet", _fleet)
    return Path(shutil.copytree(whole / "out", tmp_path / "out"))


def test_a_gyro_takes_80_kilobytes_beside_one_runtime_for_all(fleet: Path) -> None:
    for name in ("RLG-1", "RLG-2"):
        files = [path for path in (fleet / name).rglob("*") if path.is_file()]
        assert sum(path.stat().st_size for path in files) <= 80_000
        names = [path.name for path in files]
        assert not [
            name
            for name in names
            if name.startswith(("gtc.", "gtc_f32.", "gtc_q31.")) or name.endswith((".html", ".hex"))
        ]
    assert sorted(path.name for path in (fleet / "runtime").glob("gtc*")) == ["gtc.h", "gtc_f32.c", "gtc_q31.c"]
    assert result_faults(fleet / "runtime") == []


def test_a_gyro_of_a_fleet_is_verified_with_the_shared_runtime(fleet: Path, gyrotc: Command) -> None:
    done = gyrotc("verify", fleet / "RLG-1", "--target", "host-gcc-O2")
    assert done.returncode == 0, done.stdout + done.stderr
    verified = json.loads((fleet / "RLG-1" / "verify.json").read_text())
    assert {entry["status"] for entry in verified["targets"]} == {"pass"}
    assert {"../../runtime/gtc.h", "../../runtime/gtc_f32.c", "../../runtime/gtc_q31.c"} < {
        entry["file"] for entry in verified["emitted"]
    }


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("gtc_f32.c", b"gtc_f32_map(", b"gtc_f32_Map("),
        ("gtc.h", b"GTC_MAX_SLOPE_BLOCKS ", b"GTC_MAX_SLOPE_BLOCKS 0"),
        ("gtc.h", b"#endif", b"#endif\nint x;"),
    ],
)
def test_a_changed_runtime_fails_the_gyros_that_share_it(
    fleet: Path, gyrotc: Command, name: str, old: bytes, new: bytes
) -> None:
    path = fleet / "runtime" / name
    assert old in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(old, new, 1))
    done = gyrotc("verify", fleet / "RLG-1", "--target", "host-gcc-O2")
    assert done.returncode == 1
    assert f"../../runtime/{name}" in done.stdout


def test_a_folder_that_was_taken_out_of_its_fleet_lacks_the_runtime(
    fleet: Path, tmp_path: Path, gyrotc: Command
) -> None:
    shutil.copytree(fleet / "RLG-1", tmp_path / "elsewhere" / "RLG-1")
    done = gyrotc("verify", tmp_path / "elsewhere" / "RLG-1", "--target", "host-gcc-O2")
    assert done.returncode == 1 and "../../runtime/gtc_f32.c: missing" in done.stdout
    emitted = gyrotc("emit", fleet / "RLG-1" / "model.json", "--out", tmp_path / "complete")
    assert emitted.returncode == 0, emitted.stderr
    done = gyrotc("verify", tmp_path / "complete", "--target", "host-gcc-O2")
    assert done.returncode == 0, done.stdout


def test_the_options_of_the_shared_runtime_hold_every_gyro(tmp_path: Path) -> None:
    least = dict.fromkeys(needs_of(random_model(1)), 0) | {"GTC_MAX_SLOPE_BLOCKS": 10, "GTC_BIAS_FRAC_BITS": 24}
    needs = (least | {"GTC_WITH_BANK": 1}, least | {"GTC_MAX_TERMS": 2, "GTC_WITH_PLAY": 1})
    write_summary(
        tmp_path,
        [FleetEntry(name=f"u{k}", axis=None, status="done", runtime_options=one) for k, one in enumerate(needs)],
    )
    header = (tmp_path / "runtime" / "gtc.h").read_text()
    assert "#define GTC_MAX_TERMS 2\n" in header and "bank, play" in header


def test_the_page_of_a_gyro_is_drawn_when_it_is_asked_for(fleet: Path, gyrotc: Command) -> None:
    done = gyrotc("report", fleet / "RLG-1")
    assert done.returncode == 0, done.stderr
    assert "RLG-1" in (fleet / "RLG-1" / "report.html").read_text()


@pytest.mark.usefixtures("in_this_process")
def test_the_same_model_and_figures_as_a_build(three: Path, tmp_path: Path, gyrotc: Command) -> None:
    """What the reference says that the C code does is what the C code does."""
    fleet = Fleet((Unit(three / "RLG-1", None),), FitOptions(), ("f32",), None)
    [entry] = run_fleet(fleet, tmp_path / "quick", jobs=1)
    done = gyrotc("build", three / "RLG-1", "--out", tmp_path / "whole", "--numeric", "f32")
    assert done.returncode == 0, done.stderr
    built = json.loads((tmp_path / "whole" / "evaluate.json").read_text())
    assert entry.after_rms_dph == built["left_out"]["after"]["rms_dph"]
    for name in ("model.json", "c/gtc_rlg_1.bin"):
        assert (tmp_path / "quick" / "RLG-1" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


@pytest.mark.usefixtures("in_this_process")
def test_limits_options_and_axes_of_a_manifest(tmp_path: Path, gyrotc: Command) -> None:
    gyro(tmp_path / "a" / "RLG-1", "RLG-1")
    rows = columns(360)
    table = {name: rows[name] for name in ("time_s", "temperature_c")}
    write_csv(tmp_path / "IMU" / "a.csv", table | {f"rate_{a}_dph": rows["rate_dph"] - 20.0 for a in "xy"})
    (tmp_path / "product.toml").write_text("schema = 1\n[at_most]\ntable_bytes = 8\n")
    manifest = tmp_path / "fleet.toml"
    manifest.write_text(
        'schema = 1\ndatasets = ["a/*"]\nlimits = "product.toml"\nnumeric = ["f32"]\n'
        '[options]\nblock_s = 20.0\n[[unit]]\ndataset = "IMU"\n'
    )
    fleet = load_manifest(manifest)
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "IMU").symlink_to(tmp_path / "IMU")
    assert [unit.name for unit in load_manifest(tmp_path / "b").units] == ["IMU-x", "IMU-y"]
    assert [unit.name for unit in fleet.units] == ["RLG-1", "IMU-x", "IMU-y"]
    entries = run_fleet(fleet, tmp_path / "out", jobs=2)
    assert [entry.status for entry in entries] == ["failed"] * 3
    assert "limit at_most.table_bytes ≤ 8 is not met" in (entries[0].reason or "")
    assert json.loads((tmp_path / "out" / "IMU-x" / "model.json").read_text())["block_s"] == 20.0
    assert json.loads((tmp_path / "out" / "IMU-y" / "limits.json").read_text())["met"] is False
    *_, limits, following = gyrotc("fleet", manifest, "--out", tmp_path / "out").stdout.splitlines()
    assert limits == "limits: 0 PASS, 0 CONDITIONAL PASS, 0 NOT TESTABLE, 3 FAIL"
    assert following == f"next: look at RLG-1, then at 2 more: gyrotc report {tmp_path / 'out' / 'RLG-1'}"


def test_a_missing_manifest_exits_2(tmp_path: Path, gyrotc: Command) -> None:
    done = gyrotc("fleet", tmp_path / "none.toml", "--out", tmp_path / "out")
    assert done.returncode == 2 and "none.toml" in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("in_this_process")
def test_a_folder_without_recordings_and_a_result_without_its_recordings_are_named(
    three: Path, tmp_path: Path, gyrotc: Command
) -> None:
    gyrotc("fleet", three, "--out", tmp_path / "out")
    (three / "empty").mkdir()
    (three / "RLG-1").rename(tmp_path / "elsewhere")
    done = gyrotc("-q", "fleet", three, "--out", tmp_path / "out")
    reported = [line for line in done.stdout.splitlines() if line.startswith((f"{three}/empty: ", "RLG-1: "))]
    assert len(reported) == 2 and all("no recordings" in line for line in reported), done.stdout
    assert (tmp_path / "out" / "RLG-1" / "model.json").is_file()


@pytest.mark.usefixtures("in_this_process")
def test_two_gyros_under_one_serial_have_both_failed(tmp_path: Path) -> None:
    for name in ("first", "second"):
        gyro(tmp_path / "d" / name, "RLG-1")
    entries = run_fleet(load_manifest(tmp_path / "d"), tmp_path / "out")
    assert [entry.status for entry in entries] == ["failed", "failed"]
    assert "serial RLG-1 is also that of another" in (entries[0].reason or "")


def test_a_killed_fleet_goes_on_where_it_was(tmp_path: Path, gyrotc: Command) -> None:
    for k in range(4):
        gyro(tmp_path / "d" / f"RLG-{k}", f"RLG-{k}", seed=k)
    out = tmp_path / "out"
    program = Path(sys.executable).with_name("gyrotc")
    job = subprocess.Popen(
        [program, "fleet", tmp_path / "d", "--out", out, "--jobs", "1"],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    while not (out / "RLG-1" / "entry.json").is_file():
        assert job.poll() is None
        time.sleep(0.01)
    os.killpg(job.pid, signal.SIGKILL)
    job.wait()
    done = gyrotc("fleet", tmp_path / "d", "--out", out)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("done (done before)") >= 2
    assert {p.name for p in out.iterdir() if not p.name.startswith(".")} == {
        *(f"RLG-{k}" for k in range(4)), "fleet.json", "fleet.csv", "fleet.html", "runtime",
    }  # fmt: skip


@pytest.mark.usefixtures("in_this_process")
def test_no_file_of_the_summary_outlives_what_it_says(
    tmp_path: Path, gyrotc: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fleet that is stopped leaves no figures of results that it has replaced."""
    gyro(tmp_path / "d" / "RLG-1", "RLG-1")
    out, manifest = tmp_path / "out", tmp_path / "fleet.toml"
    manifest.write_text('schema = 1\ndatasets = ["d/*"]\n')
    assert gyrotc("fleet", manifest, "--out", out).returncode == 0
    manifest.write_text('schema = 1\ndatasets = ["d/*"]\n[options]\nseed = 1\n')

    def stopped(_jobs: int, tasks: Sequence[Task]) -> Iterator[Any]:
        assert do_unit(tasks[0]).status == "done"
        raise KeyboardInterrupt
        yield

    monkeypatch.setattr("gyrotc.fleet.run.on_processes", stopped)
    with pytest.raises(KeyboardInterrupt):
        run_fleet(load_manifest(manifest), out)
    [row] = csv.DictReader((out / "fleet.csv").read_text("utf-8").splitlines())
    assert row["status"] == "unfinished" and row["model_hash"] == ""
    assert "unfinished" in (out / "fleet.html").read_text()


@pytest.mark.usefixtures("in_this_process")
def test_what_processes_of_a_stopped_fleet_left_goes_with_it_and_with_the_next(tmp_path: Path) -> None:
    """Also beside a result whose gyro is no longer in the manifest; locks of others stay."""
    for k in (1, 2):
        gyro(tmp_path / "d" / f"RLG-{k}", f"RLG-{k}", seed=k)
    out = tmp_path / "out"
    run_fleet(load_manifest(tmp_path / "d"), out)
    left = [out / f".RLG-{k}.gyrotc-part-0123abcd" for k in (1, 2)]
    for path in left:
        path.mkdir()
        write_marker(path, Marker("result", "build", finished=False))
    for name in ("RLG-1", "RLG-2", "thesis"):
        (out / f".{name}.lock").write_text("")
    shutil.rmtree(tmp_path / "d" / "RLG-1")
    run_fleet(load_manifest(tmp_path / "d"), out)
    assert not any(path.exists() for path in left)
    assert sorted(p.name for p in out.glob(".*.lock")) == [".thesis.lock"]


def _entries(n: int, seed: int) -> list[FleetEntry]:
    draw = np.random.default_rng(seed)
    names = ("constant_rms_dph", "after_rms_dph", "noise_floor_dph", "rms_over_floor", "sum_abs_weights_dph")
    return [
        _entry(
            f"RLG-{k}",
            **{name: float(np.exp(0.1 * draw.normal())) for name in names},
            bias_dph=draw.normal(),
            after_mean_dph=1e-5 * draw.normal(),
        )
        for k in range(n)
    ]


def _entry(name: str, **figures: float) -> FleetEntry:
    return FleetEntry(name=name, axis=None, status="done").model_copy(update=figures)


def test_the_odd_gyro_is_named_and_an_even_fleet_has_none() -> None:
    seed = int(np.random.default_rng().integers(2**31))
    print("seed", seed)
    even = _entries(200, seed)
    far = outlying_units(even)
    assert len(far) <= 2, "5 robust standard deviations of 1400 normal figures"
    even[7] = even[7].model_copy(update={"after_rms_dph": 3.0 * (even[7].after_rms_dph or 0.0)})
    even[9] = even[9].model_copy(update={"bias_dph": 30.0})
    assert {(o.name, o.figure) for o in outlying_units(even)} - {(o.name, o.figure) for o in far} == {
        ("RLG-7", "after_rms_dph"),
        ("RLG-9", "bias_dph"),
    }
    assert outlying_units(even[:7]) == [], "a handful does not say what is usual"


def test_alike_gyros_do_not_stand_apart_by_a_hair() -> None:
    """Figures that all agree to the last digits have no scatter to stand out of."""
    entries = [_entry(f"{k}", noise_floor_dph=1e-3, bias_dph=1.0) for k in range(20)]
    entries[3] = _entry("3", noise_floor_dph=1.01e-3, bias_dph=1.0)
    assert outlying_units(entries) == []
    entries[3] = _entry("3", noise_floor_dph=1.1e-3, bias_dph=1.0)
    assert [o.name for o in outlying_units(entries)] == ["3"]


def test_a_scheduler_without_dask_is_refused(tmp_path: Path, gyrotc: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)  # as where it is not installed
    gyro(tmp_path / "d" / "RLG-1", "RLG-1")
    done = gyrotc("fleet", tmp_path / "d", "--out", tmp_path / "out", "--scheduler", "tcp://127.0.0.1:8786")
    assert done.returncode == 2 and "Dask is not installed" in done.stderr


@pytest.mark.usefixtures("in_this_process")
def test_a_copy_of_a_gyro_under_another_serial_is_named(tmp_path: Path, gyrotc: Command) -> None:
    """Before: such a fleet passed without a word."""
    for k in (1, 2):
        gyro(tmp_path / "data" / f"RLG-{k}", f"RLG-{k}", seed=k)
    shutil.copytree(tmp_path / "data" / "RLG-1", tmp_path / "data" / "RLG-3")
    described_as = (tmp_path / "data" / "RLG-3" / "dataset.toml").read_text().replace("RLG-1", "RLG-3")
    (tmp_path / "data" / "RLG-3" / "dataset.toml").write_text(described_as)
    done = gyrotc("fleet", tmp_path / "data", "--out", tmp_path / "out")
    assert done.returncode == 0
    assert "copy of another: RLG-1 (serial RLG-1) has about 100% of its rows in common with RLG-3" in done.stdout
    summary = json.loads((tmp_path / "out" / "fleet.json").read_text())
    assert [(c["name"], c["other"]) for c in summary["copies"]] == [("RLG-1", "RLG-3")]
    found = {e["name"]: "copy_of_other" in e["findings"] for e in summary["serials"]}
    assert found == {"RLG-1": True, "RLG-2": False, "RLG-3": True}
    assert summary["serials"][2]["copy_of"] == ["RLG-1"]
    assert "Gyros with recordings of another serial" in (tmp_path / "out" / "fleet.html").read_text()
