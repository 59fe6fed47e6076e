"""The catalogue of a fleet: which table a gyro may carry on a day, from which data, and what a finding bars from it."""

from __future__ import annotations

import errno
import os
import re
import shutil
import sqlite3
from pathlib import Path
from types import SimpleNamespace

import pytest
from conftest import ROOT, Command
from gyrotc.common.errors import InputError
from gyrotc.fleet import run
from gyrotc.fleet.catalogue import SCHEMA, catalogued, enter, export, hash_rows, withdraw
from gyrotc.fleet.manifest import load_manifest
from gyrotc.fleet.page import write_summary
from gyrotc.fleet.run import run_fleet
from gyrotc.jobs import lot as job
from gyrotc.results.base import read_result
from gyrotc.results.files import json_text, write_atomically
from gyrotc.results.fleet import FleetEntry, FleetSummary, FleetUnit
from gyrotc.results.folder import result_folder, share_by_hash
from gyrotc.results.marker import MARKER, faults, read_marker, sha256
from gyrotc.results.release import Verification
from gyrotc.results.training import Manifest
from gyrotc.verify.job import verify
from recordings import columns, toml, write_csv

DAYS = ("2026-03-01", "2026-09-01")


def gyro(folder: Path, day: str, *, seed: int, rms_dph: float) -> None:
    write_csv(folder / "d" / "RLG-1" / "run-01.csv", columns(720, seed=seed))
    head = 'schema = 1\nserial = "RLG-1"\nearth_rate = "none"'
    text = toml('file = "run-01.csv"', head=head) + f"\n[meta]\ncalibrated_on = {day}\n"
    (folder / "d" / "RLG-1" / "dataset.toml").write_text(text)
    limits = f"schema = 1\n[at_most]\nrms_dph = {rms_dph}\n[interval]\ndays = 365\n"
    (folder / "limits.toml").write_text(limits)
    (folder / "fleet.toml").write_text('schema = 1\ndatasets = ["d/*"]\nlimits = "limits.toml"\n')


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One gyro, calibrated in March and again in September, when it failed."""
    folder = tmp_path_factory.mktemp("lab")
    for day, seed, rms_dph in ((DAYS[0], 1, 1e3), (DAYS[1], 2, 1e-9)):
        gyro(folder, day, seed=seed, rms_dph=rms_dph)
        run_fleet(load_manifest(folder / "fleet.toml"), folder / "out", jobs=1, tag=f"lot {seed}")
    return folder / "out"


@pytest.mark.slow
def test_the_last_calibration_governs_and_one_that_failed_lets_none_fly(fleet: Path) -> None:
    assert catalogued(fleet, "RLG-1", "2026-02-28").found == ()
    [one] = catalogued(fleet, "RLG-1", "2026-08-31").found
    assert (one.valid_from, one.valid_until, one.tag) == (DAYS[0], "2027-03-01", "lot 1")
    assert one.verdict in ("PASS", "CONDITIONAL PASS")
    assert [file.file for file in one.recordings] == ["run-01.csv"]
    assert catalogued(fleet, "RLG-1", "2026-09-01").found == ()  # failed in September
    assert catalogued(fleet, "RLG-2", "2026-08-31").found == ()
    assert catalogued(fleet, None, None).calibrations == 2


def test_a_failed_job_without_a_model_is_entered_once_and_lets_none_fly(fleet: Path, tmp_path: Path) -> None:
    place = shutil.copytree(fleet, tmp_path / "out")
    failed = FleetEntry(
        name="RLG-1", axis=None, status="failed", serial="RLG-1", date="2026-07-01", key="a" * 64, reason="x"
    )
    assert enter(place, [failed]) == 1 and enter(place, [failed]) == 0
    assert len(catalogued(place, "RLG-1", "2026-06-30").found) == 1
    assert catalogued(place, "RLG-1", "2026-07-01").found == ()


@pytest.mark.slow
def test_a_newer_calibration_that_gives_no_model_lets_the_earlier_one_fly_no_more(tmp_path: Path) -> None:
    """Before: recordings that were refused left no row, and the table of March was valid for ever."""

    def run(name: str) -> int:
        run_fleet(load_manifest(tmp_path / "fleet.toml"), tmp_path / "out", jobs=1, tag=name)
        return catalogued(tmp_path / "out", None, None).calibrations

    gyro(tmp_path, DAYS[0], seed=1, rms_dph=1e3)
    assert run("first") == 1
    gyro(tmp_path, DAYS[1], seed=2, rms_dph=1e3)
    rows = (tmp_path / "d" / "RLG-1" / "run-01.csv").read_text()
    (tmp_path / "d" / "RLG-1" / "run-01.csv").write_text(rows + "abc,def,ghi\n")
    assert run("broken") == 2 and run("once more") == 2
    newest = catalogued(tmp_path / "out", None, None).found[0]
    assert (newest.status, newest.valid_from, newest.model_hash) == ("failed", DAYS[1], None)
    assert len(catalogued(tmp_path / "out", "RLG-1", "2026-08-31").found) == 1
    assert catalogued(tmp_path / "out", "RLG-1", DAYS[1]).found == ()
    (tmp_path / "d" / "RLG-1" / "run-01.csv").write_text(rows)
    assert run("mended") == 3
    [one] = catalogued(tmp_path / "out", "RLG-1", DAYS[1]).found
    assert (one.valid_from, one.tag) == (DAYS[1], "mended")


def test_a_catalogue_of_an_earlier_version_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.sqlite"
    base = sqlite3.connect(path)
    base.executescript(f"PRAGMA application_id = {0x47544331}; PRAGMA user_version = 1; {SCHEMA};")
    base.close()
    with pytest.raises(InputError, match="earlier gyrotc"):
        catalogued(path, "RLG-1", "2026-01-01")


def test_payloads_stay_when_the_result_was_replaced(fleet: Path) -> None:
    [one] = catalogued(fleet, "RLG-1", "2026-08-31").found
    for known in (one.image_sha256, one.model_sha256):
        payload = fleet / "catalogue" / "payloads" / known[:2] / known
        assert sha256(payload) == known
        assert payload.stat().st_mode & 0o222 == 0
    assert sha256(fleet / "RLG-1" / "model.json") != one.model_sha256


def test_what_is_done_before_is_entered_once(fleet: Path) -> None:
    run_fleet(load_manifest(fleet.parent / "fleet.toml"), fleet, jobs=1)
    assert catalogued(fleet, None, None).calibrations == 2


def test_the_documented_sql_answers_the_same_and_its_tables_are_those_of_the_file(fleet: Path) -> None:
    page = (ROOT / "docs" / "fleet.md").read_text("utf-8")
    query, tables = re.findall(r"```sql\n(.*?)```", page, re.DOTALL)
    assert tables.strip() == SCHEMA.strip()
    with sqlite3.connect(fleet / "catalogue" / "catalogue.sqlite") as base:
        rows = base.execute(query, {"serial": "RLG-1", "day": "2026-08-31"}).fetchall()
        assert base.execute(query, {"serial": "RLG-1", "day": "2026-09-01"}).fetchall() == []
    [one] = catalogued(fleet, "RLG-1", "2026-08-31").found
    assert [(row[0], row[1]) for row in rows] == [("", one.image_sha256)]
    assert one.recordings[0].sha256 in rows[0][-1]


def test_a_withdrawn_table_may_not_be_carried(fleet: Path, tmp_path: Path, gyrotc: Command) -> None:
    copy = shutil.copytree(fleet / "catalogue", tmp_path / "catalogue") / "catalogue.sqlite"
    models = {one.status: one.model_hash for one in catalogued(copy, None, None).found}
    assert withdraw(copy, models["failed"] or "") == 1  # then the first one is valid again
    assert len(catalogued(copy, "RLG-1", "2026-09-02").found) == 1
    assert gyrotc("catalogue", copy, "--withdraw", models["done"] or "").returncode == 0
    assert catalogued(copy, "RLG-1", "2026-08-31").found == ()
    assert gyrotc("catalogue", copy, "--withdraw", "0" * 64).returncode == 2


CELLS = {
    "calibration": (
        "id", "serial", "axis", "valid_from", "valid_until", "tag", "status", "verdict", "model_hash", "image_sha256",
        "model_sha256", "input_sha256", "after_rms_dph", "expanded_dph", "folder", "row_sha256",
    ),
    "recording": ("calibration", "file", "role", "sha256"),
    "newest": ("serial", "axis", "sha256"),
}  # fmt: skip


@pytest.mark.parametrize("table", CELLS)
def test_every_cell_of_a_gyros_rows_is_guarded(table: str, fleet: Path, tmp_path: Path) -> None:
    """Before: a failed calibration whose serial, day, status or tag was edited let the one before it fly."""
    place = shutil.copytree(fleet / "catalogue", tmp_path / "catalogue") / "catalogue.sqlite"
    before = place.read_bytes()
    with sqlite3.connect(place) as base:
        assert [row[1] for row in base.execute(f"PRAGMA table_info({table})")] == [*CELLS[table]]
        rows = base.execute(f"SELECT count(*) FROM {table}").fetchone()[0]
    for row in range(rows):
        first, second = CELLS[table][:2]
        where = f"({first}, {second}) IN (SELECT {first}, {second} FROM {table} LIMIT 1 OFFSET {row})"
        for cell in CELLS[table]:
            number = cell in ("id", "calibration") or cell.endswith("_dph")
            changed = f"coalesce({cell}, 0) + 7" if number else f"coalesce({cell}, '') || '1'"
            for what in (f"UPDATE {table} SET {cell} = {changed} WHERE {where}", f"DELETE FROM {table} WHERE {where}"):
                place.write_bytes(before)
                with sqlite3.connect(place) as base:
                    assert base.execute(what).rowcount == 1
                with pytest.raises(InputError, match="RLG-1"):
                    catalogued(place, "RLG-1", "2026-09-02")
    place.write_bytes(before)
    catalogued(place, "RLG-1", "2026-09-02")


@pytest.mark.parametrize("change", ["flip", "missing", "another"])
def test_a_payload_that_is_not_what_its_row_says_is_refused(
    fleet: Path, tmp_path: Path, change: str, gyrotc: Command
) -> None:
    """Before: exit 0 with the hash of an image that was not there, or was another gyro's."""
    place = shutil.copytree(fleet / "catalogue", tmp_path / "catalogue")
    [one] = catalogued(fleet, "RLG-1", "2026-08-31").found
    path = place / "payloads" / one.model_sha256[:2] / one.model_sha256
    if change == "missing":
        path.unlink()
    elif change == "flip":
        path.chmod(0o644)
        path.write_bytes(path.read_bytes()[:-2] + b" \n")
    else:
        with sqlite3.connect(place / "catalogue.sqlite") as base:
            base.execute("UPDATE calibration SET serial = 'RLG-9'")
            hash_rows(base, "RLG-9")  # as who knows of the hashes makes them again
    done = gyrotc(
        "catalogue", place / "catalogue.sqlite", "RLG-9" if change == "another" else "RLG-1", "--on", "2026-08-31"
    )
    assert done.returncode == 2 and str(path) in done.stderr and len(done.stderr.splitlines()) == 1


def test_what_is_no_catalogue_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="has no catalogue"):
        catalogued(tmp_path, "RLG-1", "2026-01-01")
    (tmp_path / "a.sqlite").write_text("not a data base, though long enough to be one" * 100)
    with pytest.raises(InputError, match="is no catalogue"):
        catalogued(tmp_path / "a.sqlite", "RLG-1", "2026-01-01")


@pytest.mark.parametrize(
    "more", ["CREATE VIEW more AS SELECT 1", "CREATE TRIGGER sqlitet AFTER INSERT ON recording BEGIN SELECT 1; END"]
)
def test_a_catalogue_with_other_tables_is_refused_before_it_is_asked(more: str, tmp_path: Path) -> None:
    path = tmp_path / "a.sqlite"
    base = sqlite3.connect(path)
    base.executescript(f"PRAGMA application_id = {0x47544331}; PRAGMA user_version = 2; {SCHEMA}; {more};")
    base.close()
    with pytest.raises(InputError, match="has other tables than a catalogue"):
        catalogued(path, "RLG-1", "2026-01-01")


def test_the_command(fleet: Path, gyrotc: Command) -> None:
    reported = gyrotc("catalogue", fleet, "RLG-1", "--on", "2026-08-31")
    assert (
        reported.returncode == 0 and "2026-03-01 to 2027-03-01" in reported.stdout and "run-01.csv" in reported.stdout
    )
    assert gyrotc("catalogue", fleet, "RLG-1", "--on", "2030-01-01").returncode == 1
    assert gyrotc("catalogue", fleet, "RLG-1", "--on", "soon").returncode == 2


_MOST_BYTES = 150_000  # that a gyro adds to a fleet
IMAGE = "c/gtc_rlg_1.bin"
ANSWERS = "c/vectors_rlg_1.txt"


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fleet of two gyros of one type."""
    folder = tmp_path_factory.mktemp("two")
    for serial in ("RLG-1", "RLG-2"):  # the same rows, so that both have the same arithmetics
        write_csv(folder / "d" / serial / "run-01.csv", columns(720, seed=1))
        head = f'schema = 1\nserial = "{serial}"\nearth_rate = "none"'
        text = toml('file = "run-01.csv"', head=head) + "\n[meta]\ncalibrated_on = 2026-03-01\n"
        (folder / "d" / serial / "dataset.toml").write_text(text)
    run_fleet(load_manifest(folder / "d"), folder / "out", jobs=1, releases={"RLG-1": "copies", "RLG-2": "copies"})
    return folder / "out"


def test_what_all_gyros_have_stands_once_in_a_fleet(two: Path) -> None:
    for name in ("c/gtc.c", "c/gtc.h"):
        known = sha256(two / "RLG-1" / name)
        payload = two / "catalogue" / "payloads" / known[:2] / known
        assert payload.samefile(two / "RLG-1" / name) and payload.samefile(two / "RLG-2" / name)
        assert payload.stat().st_mode & 0o222 == 0, "a change of one would be one of all"
    for name in ("model.json", IMAGE):
        payload = two / "catalogue" / "payloads" / (known := sha256(two / "RLG-1" / name))[:2] / known
        assert payload.samefile(two / "RLG-1" / name), "what the catalogue keeps takes no room beside the result"


def test_a_gyro_of_the_papers_size_adds_no_more_than_is_stated(gyrotc: Command, tmp_path: Path) -> None:
    """Twelve runs of 8 h, rows of 10 s: its result and what the catalogue keeps of it, without the runtime of all."""
    gyrotc("simulate", "paper", "--seed", "1", "--out", tmp_path / "d" / "RLG-1")
    (entry,) = run_fleet(load_manifest(tmp_path / "d"), tmp_path / "out", jobs=1)
    assert entry.status == "done", entry.reason
    files = [*(tmp_path / "out" / "RLG-1").rglob("*"), *(tmp_path / "out" / "catalogue" / "payloads").rglob("*")]
    own = {p.stat().st_ino: (p.name, p.stat().st_size) for p in files if p.is_file()}
    for name in ("c/gtc.c", "c/gtc.h"):
        del own[(tmp_path / "out" / "RLG-1" / name).stat().st_ino]
    assert 100_000 < sum(size for _, size in own.values()) <= _MOST_BYTES, sorted(own.values())


@pytest.mark.parametrize("of", ["RLG-2", "no gyro"])
def test_a_row_with_an_image_that_its_model_does_not_give_is_refused(two: Path, tmp_path: Path, of: str) -> None:
    """Before: another gyro's whole image, under its own hash, was given out for this one."""
    place = shutil.copytree(two / "catalogue", tmp_path / "catalogue")
    day = "2026-03-02"
    assert len(catalogued(place / "catalogue.sqlite", "RLG-1", day).found) == 1
    if of == "RLG-2":
        [other] = catalogued(two, "RLG-2", day).found
        image = other.image_sha256
    else:
        [one] = catalogued(two, "RLG-1", day).found
        image = one.model_sha256
    with sqlite3.connect(place / "catalogue.sqlite") as base:
        base.execute("UPDATE calibration SET image_sha256 = ? WHERE serial = 'RLG-1'", (image,))
        hash_rows(base, "RLG-1")
    with pytest.raises(InputError, match=f"{image}: is not the image that"):
        catalogued(place / "catalogue.sqlite", "RLG-1", day)


def test_a_result_that_a_fleet_keeps_in_part_verifies_as_a_whole(two: Path, tmp_path: Path) -> None:
    assert not (two / "RLG-1" / ANSWERS).exists() and not faults(two / "RLG-1")
    found = verify(two / "RLG-1", compiled=False)
    verdicts = {file.file: file.verdict for file in found.emitted}
    assert verdicts.pop(Path(ANSWERS).name) == "left_out" and set(verdicts.values()) == {"equal"}
    earlier = read_result(two / "RLG-1" / "verify.json", Verification)
    assert found.failed == 0 and found.c_hash == earlier.c_hash
    copy = shutil.copytree(two / "RLG-1", tmp_path / "copy")
    with result_folder(copy, "verify", entries=("verify.json",)) as stage:
        write_atomically(stage.folder / "verify.json", json_text(found.content()))
    assert ANSWERS in read_marker(copy).left_out, "what writes into the folder keeps that"  # type: ignore[union-attr]
    (copy / "c" / "gtc.h").unlink()
    spoilt = {file.file: file.status for file in verify(copy, compiled=False).emitted}
    assert spoilt["gtc.h"] == "fail", "nothing else may be missing"
    text = (copy / MARKER).read_text()
    (copy / MARKER).write_text(re.sub(rf'("{ANSWERS}": ")[0-9a-f]{{64}}', rf"\g<1>{'0' * 64}", text))
    with pytest.raises(InputError, match="as it was"):
        verify(copy, compiled=False)


def test_an_exported_result_is_complete(two: Path, tmp_path: Path, gyrotc: Command) -> None:
    done = gyrotc("catalogue", two, "--export", "RLG-1", "--on", "2026-04-01", "--out", tmp_path / "RLG-1")
    assert done.returncode == 0, done.stderr
    out, kept = tmp_path / "RLG-1", two / "RLG-1"
    assert not faults(out) and not read_marker(out).left_out  # type: ignore[union-attr]
    for path in kept.rglob("*"):
        if path.is_file() and path.name != MARKER:
            assert (out / path.relative_to(kept)).read_bytes() == path.read_bytes()
    assert sha256(out / ANSWERS) == read_marker(kept).left_out[ANSWERS]  # type: ignore[union-attr]
    assert {file.verdict for file in verify(out, compiled=False).emitted} == {"equal"}
    assert all(path.stat().st_nlink == 1 for path in out.rglob("*") if path.is_file()), "a copy, not a link"
    manifest = read_result(out / "manifest.json", Manifest)
    assert all(sha256(out / name) == known for name, known in manifest.files.items())
    none = gyrotc("catalogue", two, "--export", "RLG-9", "--out", tmp_path / "RLG-9")
    assert none.returncode == 1 and not (tmp_path / "RLG-9").exists()
    for wrong in (("--export", "RLG-1"), ("RLG-2", "--export", "RLG-1", "--out", tmp_path / "x")):
        assert gyrotc("catalogue", two, *wrong).returncode == 2


def test_a_result_that_was_replaced_or_changed_is_not_exported(two: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(two, tmp_path / "copy")
    (copy / "RLG-1" / "evaluate.json").write_text("{}")
    with pytest.raises(InputError, match="evaluate"):
        export(copy, "RLG-1", "2026-04-01", tmp_path / "x")
    shutil.rmtree(copy / "RLG-1")
    (copy / "RLG-2").rename(copy / "RLG-1")
    with pytest.raises(InputError, match="another calibration"):
        export(copy, "RLG-1", "2026-04-01", tmp_path / "x")
    assert not (tmp_path / "x").exists()


def test_without_second_names_every_gyro_has_its_own_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EPERM, "no hard links")

    (tmp_path / "gtc.c").write_text("int x;")
    monkeypatch.setattr(os, "link", refuse)
    share_by_hash(tmp_path / "store", tmp_path / "gtc.c")
    assert (tmp_path / "gtc.c").read_text() == "int x;" and len(list((tmp_path / "store").rglob("*"))) == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["gtc.c", "store"]
    monkeypatch.undo()
    share_by_hash(tmp_path / "store", tmp_path / "gtc.c")
    [payload] = (path for path in (tmp_path / "store").rglob("*") if path.is_file())
    assert payload.samefile(tmp_path / "gtc.c")
    payload.chmod(0o644)
    payload.write_text("int y;")
    (tmp_path / "other.c").write_text("int x;")
    with pytest.raises(InputError, match="what its name says"):
        share_by_hash(tmp_path / "store", tmp_path / "other.c")


def test_a_barred_unit_is_not_entered_until_it_is_released(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gyro(tmp_path, "2026-03-01", seed=1, rms_dph=1e3)
    manifest, out = load_manifest(tmp_path / "fleet.toml"), tmp_path / "out"
    summed = run._one_of_each_serial
    monkeypatch.setattr(
        run,
        "_one_of_each_serial",
        lambda entries: [e.model_copy(update={"findings": ("sign_reversed",)}) for e in summed(entries)],
    )
    run.run_fleet(manifest, out, jobs=1)
    assert catalogued(out, None, None).calibrations == 0
    [unit] = read_result(out / "fleet.json", FleetSummary).serials
    assert unit.barred == ("sign_reversed",)
    run.run_fleet(manifest, out, jobs=1, tag="May", releases={"RLG-1": "mounted upside down, see log"})
    [one] = catalogued(out, "RLG-1", "2026-04-01").found
    assert one.tag == "May; released: mounted upside down, see log"
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

    monkeypatch.setattr(job, "_unit", unit)
    monkeypatch.setattr(job, "LEAST_UNITS", 3)
    assert [one.model.serial for one in job._units(tmp_path, None)] == ["b", "c", "d"]
    assert read == ["b", "c", "d"]


@pytest.mark.parametrize("finding", ["axes_exchanged", "does_not_generalise", "copy_of_other"])
def test_findings_that_bar_a_unit(finding: str) -> None:
    unit = FleetUnit(name="a", axis=None, status="done", findings=("rate_outliers", finding))
    assert unit.barred == (finding,)
    assert FleetUnit(name="a", axis=None, status="done", findings=("rate_outliers",)).barred == ()


def test_a_release_needs_its_reason(tmp_path: Path, gyrotc: Command) -> None:
    gyro(tmp_path, "2026-03-01", seed=1, rms_dph=1e3)
    result = gyrotc("fleet", tmp_path / "fleet.toml", "--out", tmp_path / "out", "--release", "RLG-1")
    assert result.returncode == 2
    assert "--reason" in result.stderr
    assert not (tmp_path / "out").exists()
