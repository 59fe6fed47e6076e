"""Units of a fleet that a finding bars: the page names them and no lot takes them until they are released."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
from conftest import Command
from gyrotc.fleet import load_manifest, run, write_summary
from gyrotc.jobs import lot as job
from gyrotc.results import FleetEntry, FleetSummary, FleetUnit, read_result
from recordings import columns, toml, write_csv

MANIFEST = 'schema = 1\ndatasets = ["d/*"]\n'


def gyro(folder: Path) -> None:
    write_csv(folder / "d" / "RLG-1" / "run-01.csv", columns(720, seed=1))
    head = 'schema = 1\nserial = "RLG-1"\nearth_rate = "none"'
    (folder / "d" / "RLG-1" / "dataset.toml").write_text(toml('file = "run-01.csv"', head=head))
    (folder / "fleet.toml").write_text(MANIFEST)


@pytest.mark.usefixtures("in_this_process")
def test_a_barred_unit_stays_so_until_it_is_released(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gyro(tmp_path)
    out = tmp_path / "out"
    summed = run.one_of_each_serial
    monkeypatch.setattr(
        run,
        "one_of_each_serial",
        lambda entries: [e.model_copy(update={"findings": ("sign_reversed",)}) for e in summed(entries)],
    )
    run.run_fleet(load_manifest(tmp_path / "fleet.toml"), out, jobs=1)
    [unit] = read_result(out / "fleet.json", FleetSummary).serials
    assert unit.barred == ("sign_reversed",)
    released = MANIFEST + '[release]\nRLG-1 = "mounted upside down,  see log"\n'
    (tmp_path / "fleet.toml").write_text(released)
    run.run_fleet(load_manifest(tmp_path / "fleet.toml"), out, jobs=1)
    [unit] = read_result(out / "fleet.json", FleetSummary).serials
    assert (unit.barred, unit.released) == ((), "mounted upside down, see log")


@pytest.mark.parametrize("released", [None, "mounted upside down"])
def test_the_page_of_a_fleet_names_a_barred_unit_and_its_finding(tmp_path: Path, released: str | None) -> None:
    unit = FleetEntry(
        name="a", axis=None, status="done", findings=("sign_reversed",), verdict="PASS", released=released
    )
    write_summary(tmp_path, [unit])
    page = (tmp_path / "fleet.html").read_text("utf-8")
    assert ("not released: sign reversed" in page) == (released is None)
    assert ("Not released: 1" in page) == (released is None)


def test_a_lot_leaves_out_a_barred_unit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("a", "b", "c", "d")
    for name in names:
        (tmp_path / name).mkdir()
        (tmp_path / name / "training.json").touch()
    write_summary(
        tmp_path,
        [
            FleetEntry(name="a", axis=None, status="done", findings=("sign_reversed",)),
            FleetEntry(name="b", axis=None, status="done", findings=("sign_reversed",), released="see log"),
            *(FleetEntry(name=name, axis=None, status="done") for name in names[2:]),
        ],
    )
    read: list[str] = []

    def unit(place: Path) -> SimpleNamespace:
        read.append(place.name)
        return SimpleNamespace(model=SimpleNamespace(serial=place.name, axis=None), by_itself=True)

    monkeypatch.setattr(job, "calibrated_unit", unit)
    monkeypatch.setattr(job, "LEAST_UNITS", 3)
    units, left_out = job.calibrated_units(tmp_path, None)
    assert [one.model.serial for one in units] == ["b", "c", "d"]
    assert read == ["b", "c", "d"] and left_out == "1 barred by a finding of the fleet"


@pytest.mark.parametrize("finding", ["axes_exchanged", "does_not_generalise", "copy_of_other"])
def test_findings_that_bar_a_unit(finding: str) -> None:
    unit = FleetUnit(name="a", axis=None, status="done", findings=("rate_outliers", finding))
    assert unit.barred == (finding,)
    assert FleetUnit(name="a", axis=None, status="done", findings=("rate_outliers",)).barred == ()


def test_a_release_needs_its_reason(tmp_path: Path, gyrotc: Command) -> None:
    gyro(tmp_path)
    (tmp_path / "fleet.toml").write_text(MANIFEST + '[release]\nRLG-1 = " "\n')
    result = gyrotc("fleet", tmp_path / "fleet.toml", "--out", tmp_path / "out")
    assert result.returncode == 2
    assert "release.RLG-1" in result.stderr
    assert not (tmp_path / "out").exists()
