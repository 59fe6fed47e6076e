"""What must be true of a unit, its axes and its days before a certificate says so."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pytest
from conftest import HOST, run_gyrotc
from gyrotc.common import InputError
from gyrotc.jobs import certificate
from gyrotc.pages import certificate as printing
from recordings import write_csv

DAYS = 365


def recorded(folder: Path, serial: str, calibrated_on: str, seed: int = 1) -> Path:
    """Two runs of two axes."""
    rng = np.random.default_rng(seed)
    text = f'schema = 1\nserial = "{serial}"\nearth_rate = "none"\n'
    for k in range(2):
        t = 10.0 * np.arange(360.0)
        temperature = 20.0 + 15.0 * np.sin(2.0 * np.pi * t / t[-1])
        rates = {f"rate_{axis}_dph": 0.01 * temperature + rng.normal(0.0, 0.02, t.size) for axis in "xy"}
        write_csv(folder / f"run-{k}.csv", {"time_s": t, "temperature_c": temperature} | rates)
        text += f'[[run]]\nfile = "run-{k}.csv"\n'
    (folder / "dataset.toml").write_text(text + f"[meta]\ncalibrated_on = {calibrated_on}\n")
    return folder


def built(place: Path, serial: str, ago: int, *, seed: int = 1, interval: int = DAYS) -> Path:
    day = (date.today() - timedelta(days=ago)).isoformat()
    data = recorded(place / f"{serial}-{seed}-{ago}", serial, day, seed)
    limits = place / f"limits-{interval}.toml"
    limits.write_text(f"schema = 1\n[at_most]\ncenters = 100\n[interval]\ndays = {interval}\n")
    out = place / f"result-{serial}-{seed}-{ago}-{interval}"
    done = run_gyrotc("build", data, *HOST, "--limits", limits, "--out", out)
    assert (out / "x" / "limits.json").is_file(), done.stderr
    return out


@pytest.fixture(scope="module")
def units(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folders of results: one of today's unit, and others of which a part can be taken."""
    place = tmp_path_factory.mktemp("units")
    for name, of in {
        "unit": ("RLG-1", 10, {}),
        "other": ("RLG-2", 10, {}),
        "again": ("RLG-1", 10, {"seed": 2}),
        "later": ("RLG-1", 3, {}),
        "lax": ("RLG-1", 10, {"interval": 900}),
        "expired": ("RLG-1", 400, {}),
    }.items():
        serial, ago, more = of
        built(place, serial, ago, **more).rename(place / name)
    return place


@pytest.fixture(autouse=True)
def paper(monkeypatch: pytest.MonkeyPatch) -> None:
    """No browser: what is printed has tests of its own."""
    monkeypatch.setattr(printing, "_BROWSERS", ())


def draft(folder: Path, tmp_path: Path) -> None:
    certificate(folder, tmp_path / "certificate", draft=True, accept_fail="to see what is refused")


def taken_from(other: str) -> Callable[[Path, Path], None]:
    def change(units: Path, folder: Path) -> None:
        shutil.rmtree(folder / "y")
        shutil.copytree(units / other / "y", folder / "y")

    return change


def swapped(units: Path, folder: Path) -> None:
    (folder / "x").rename(folder / "w")
    (folder / "y").rename(folder / "x")
    (folder / "w").rename(folder / "y")


def twice(units: Path, folder: Path) -> None:
    shutil.rmtree(folder / "y")
    shutil.copytree(folder / "x", folder / "y")


def without_one(units: Path, folder: Path) -> None:
    shutil.rmtree(folder / "y")


def another_name(units: Path, folder: Path) -> None:
    (folder / "x").rename(folder / "X")


PARTS = {
    "an axis of another serial": (taken_from("other"), "differ in serial"),
    "an axis of other recordings": (taken_from("again"), "differ in recordings"),
    "an axis of another day": (taken_from("later"), "differ in day of the calibration"),
    "an axis of other limits": (taken_from("lax"), "different limits"),
    "two axes exchanged": (swapped, "holds axis y"),
    "an axis twice": (twice, "holds axis x"),
    "an axis taken away": (without_one, "y: is missing"),
    "an axis under another name": (another_name, "x: is missing"),
}


@pytest.mark.parametrize("case", PARTS)
def test_parts_of_two_units_are_no_unit(case: str, units: Path, tmp_path: Path) -> None:
    change, message = PARTS[case]
    folder = shutil.copytree(units / "unit", tmp_path / "unit")
    draft(folder, tmp_path)
    change(units, folder)
    with pytest.raises(InputError, match=message):
        draft(folder, tmp_path)
    assert message == "different limits" or run_gyrotc("report", folder).returncode == 2


def test_a_certificate_is_of_the_files_that_go_into_the_firmware(units: Path, tmp_path: Path) -> None:
    """The joint C files of another gyro beside the axes of this one."""
    folder = shutil.copytree(units / "unit", tmp_path / "unit")
    shutil.rmtree(folder / "c")
    shutil.copytree(units / "other" / "c", folder / "c")
    with pytest.raises(InputError, match="is not as gyrotc wrote it"):
        draft(folder, tmp_path)


def test_a_last_day_that_was_put_off_does_not_verify(units: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(units / "expired", tmp_path / "unit")
    budget = folder / "x" / "budget.json"
    text = budget.read_text()
    budget.write_text(text.replace(json.loads(text)["valid_until"], "2999-12-31"))
    done = run_gyrotc("verify", folder, "--target", "host-gcc-O2")
    assert done.returncode == 2 and "budget.json: is not as gyrotc wrote it" in done.stderr, done.stderr


def test_a_calibration_whose_last_day_has_passed_is_not_certified_and_does_not_verify(
    units: Path, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="was valid until"):
        draft(units / "expired", tmp_path)
    folder = shutil.copytree(units / "expired", tmp_path / "unit")
    done = run_gyrotc("verify", folder, "--target", "host-gcc-O2")
    assert done.returncode == 1 and "was valid until" in done.stderr
    valid = shutil.copytree(units / "unit", tmp_path / "valid")
    assert run_gyrotc("verify", valid, "--target", "host-gcc-O2").returncode == 0


def test_a_certificate_is_valid_from_the_day_that_the_laboratory_states(units: Path, tmp_path: Path) -> None:
    """The facts give the day where the recordings do not, and never another than these."""
    facts = tmp_path / "facts.toml"
    facts.write_text(f"schema = 1\ncalibrated_on = {(date.today() - timedelta(days=11)).isoformat()}\n")
    with pytest.raises(InputError, match="and the result was calibrated on"):
        certificate(units / "unit", tmp_path / "certificate", draft=True, facts=facts, accept_fail="refused")
    draft(units / "unit", tmp_path)
    until = date.today() + timedelta(days=DAYS - 10)
    assert until.isoformat() in (tmp_path / "certificate" / "certificate.html").read_text("utf-8")
    assert json.loads((units / "unit" / "x" / "budget.json").read_text())["valid_until"] == until.isoformat()


WRONG_DAYS = {
    "no day of the calendar": "calibrated_on = '2026-13-45'",
    "no year": "calibrated_on = '0000-00-00'",
    "another form": "calibrated_on = '01.03.2020'",
    "a day to come": "calibrated_on = 2999-01-01",
    "no text": "calibrated_on = 20260307",
    "issued before": "calibrated_on = 2024-03-02\nissued = 2024-03-01",
}


@pytest.mark.parametrize("case", WRONG_DAYS)
def test_a_day_that_is_none_is_refused_when_the_description_is_read(case: str, tmp_path: Path) -> None:
    data = recorded(tmp_path / "RLG-1", "RLG-1", "2024-03-02")
    text = (data / "dataset.toml").read_text().replace("calibrated_on = 2024-03-02", WRONG_DAYS[case])
    (data / "dataset.toml").write_text(text)
    done = run_gyrotc("build", data, "--out", tmp_path / "out")
    assert done.returncode == 2 and "dataset.toml, field meta." in done.stderr, done.stderr
    assert not (tmp_path / "out").exists()
