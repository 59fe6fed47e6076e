"""What a command states of a result is what was found: a file or a figure that was changed is refused, not reported."""

from __future__ import annotations

import copy
import hashlib
import json
import random
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from conftest import run_gyrotc
from gyrotc.assess import LEAST_POWER_ONS, load_limits
from gyrotc.common import GyrotcError, InputError
from gyrotc.jobs import calibrated_unit, certificate, unit_of
from gyrotc.pages import certificate as printing
from gyrotc.recordings import load
from gyrotc.results import MARKER
from gyrotc.train import FitOptions
from jobs import built_for_fleet
from recordings import columns, toml, write_csv

from bench.rows.evidence import ABOUT, found
from bench.rows.sets import FAULTS

SEED = 20
FAILS = """schema = 1
product = "NAV"
[at_most]
rms_dph = 30.0
centers = 40
[at_least]
improvement = 1e6
[covers]
temperature_c = [21.0, 40.0]
[needs]
arithmetics = ["f32", "q31"]
no_findings = ["run_outlier", "counter_wrapped"]
[interval]
days = 365
drift_dph_per_year = 1e-4
[[instrument]]
name = "Pt100 SN 71"
certificate = "K-4711"
quantity = "temperature"
expanded_uncertainty = 0.04
"""
PASSES = FAILS.replace("improvement = 1e6", "covered = 0.0").replace('"f32", "q31"', '"q31"')


def _built(folder: Path, limits: str) -> Path:
    data, out = folder / "RLG-1", folder / "out"
    names = [f"run-{k:02d}.csv" for k in range(1, LEAST_POWER_ONS + 1)]
    for seed, name in enumerate(names, 1):
        table = columns(720, seed=seed)
        table["rate_dph"] = 20.0 + 2.0 * (table["rate_dph"] - 20.0)  # noise well above the rounding of float32
        write_csv(data / name, table)
    head = 'schema = 1\nserial = "RLG-1"\nearth_rate = "none"\n[meta]\ncalibrated_on = "2026-03-07"'
    (data / "dataset.toml").write_text(toml(*(f'file = "{name}"' for name in names), head=head))
    (folder / "limits.toml").write_text(limits)
    known = load_limits(folder / "limits.toml")
    built_for_fleet(out, load(data), FitOptions(method="linear"), limits=known)
    return out


@pytest.fixture(scope="module")
def passing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _built(tmp_path_factory.mktemp("passing"), PASSES)


@pytest.fixture(scope="module")
def failing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return _built(tmp_path_factory.mktemp("failing"), FAILS)


@pytest.fixture(autouse=True)
def paper(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(printing, "_BROWSERS", ())


def _status(*arguments: str | Path) -> int:
    """Exit status of a command, with what it prints."""
    done = run_gyrotc(*arguments)
    print(done.stdout, end="")
    print(done.stderr, end="", file=sys.stderr)
    return done.returncode


def _edit(path: Path, change: dict[str, Any]) -> None:
    path.write_text(json.dumps(json.loads(path.read_text()) | change))


def _hash_again(folder: Path, *names: str) -> None:
    """What somebody does who knows of the marker and the manifest."""
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["files"] |= {name: _sha256(folder / name) for name in names if name in manifest["files"]}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    listed = (folder / MARKER).read_text()
    for name in (*names, "manifest.json"):
        listed = re.sub(rf"^[0-9a-f]{{64}}(  {re.escape(name)})$", rf"{_sha256(folder / name)}\1", listed, flags=re.M)
    (folder / MARKER).write_text(listed)


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _passed(folder: Path) -> None:
    """A FAIL made into a PASS by hand, with a small uncertainty."""
    held = json.loads((folder / "limits.json").read_text())
    for limit in held["limits"]:
        limit |= {"met": True, "verdict": "PASS"}
    (folder / "limits.json").write_text(json.dumps(held | {"met": True, "verdict": "PASS"}))
    _edit(folder / "budget.json", {"expanded_dph": 1e-6, "combined_dph": 5e-7})


@pytest.mark.parametrize("hashes", ["as they were", "made again"])
def test_a_fail_that_was_edited_into_a_pass_is_refused(
    failing: Path, tmp_path: Path, hashes: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before: a certificate that said PASS and U = 1e-6, on the page, in the PDF and in the DCC."""
    folder = shutil.copytree(failing, tmp_path / "out")
    _passed(folder)
    if hashes == "made again":
        _hash_again(folder, "limits.json", "budget.json")
    assert _status("certificate", folder, "--draft", "--out", tmp_path / "C") == 2
    reported = capsys.readouterr().err
    assert len(reported.splitlines()) == 1 and ("limits.json" in reported or "budget.json" in reported), reported
    assert not (tmp_path / "C").exists()


@pytest.mark.parametrize(
    ("name", "field"),
    [("expanded_dph", 1e-6), ("coverage_factor", 1.0), ("valid_until", "2099-01-01"), ("interval_days", 9999.0)],
)
def test_a_budget_is_computed_again(passing: Path, tmp_path: Path, name: str, field: object) -> None:
    folder = shutil.copytree(passing, tmp_path / "out")
    unit_of(folder)
    _edit(folder / "budget.json", {name: field})
    _hash_again(folder, "budget.json")
    with pytest.raises(InputError, match=r"budget\.json"):
        unit_of(folder)


def test_a_fail_needs_a_reason_which_is_printed(failing: Path, tmp_path: Path) -> None:
    reason = "bench unit, not for flight"
    with pytest.raises(InputError, match=r"its verdict is FAIL \(.*--accept-fail REASON"):
        certificate(failing, tmp_path / "C", draft=True)
    with pytest.raises(InputError, match="a reason"):
        certificate(failing, tmp_path / "C", draft=True, accept_fail=" \n")
    certificate(failing, tmp_path / "C", draft=True, accept_fail=reason)
    page = (tmp_path / "C" / "certificate.html").read_text("utf-8")
    assert f"Released although the verdict is FAIL:</b> {reason}" in page


def test_a_conditional_pass_needs_a_reason_which_is_printed(passing: Path, tmp_path: Path) -> None:
    [rms] = [limit.measured for limit in unit_of(passing).held if limit.limit == "at_most.rms_dph"]
    assert isinstance(rms, float)
    folder = _built(tmp_path, PASSES.replace("rms_dph = 30.0", f"rms_dph = {rms * 1.0001}"))
    assert unit_of(folder).decision == "CONDITIONAL PASS"
    with pytest.raises(InputError, match=r"its verdict is CONDITIONAL PASS \(.*RMS"):
        certificate(folder, tmp_path / "C", draft=True)
    certificate(folder, tmp_path / "C", draft=True, accept_fail="within its limit")
    page = (tmp_path / "C" / "certificate.html").read_text("utf-8")
    assert "Released although the verdict is CONDITIONAL PASS:</b> within its limit" in page


def test_a_reason_without_a_fail_is_refused(passing: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="the verdict is PASS"):
        certificate(passing, tmp_path / "C", draft=True, accept_fail="why not")


@pytest.mark.usefixtures("in_this_process")
def test_no_limits_are_no_pass(tmp_path: Path) -> None:
    """Before: a limits file of `schema = 1` alone gave "limits: PASS"."""
    from gyrotc.cli.results import verdict_words

    folder = _built(tmp_path, "schema = 1")
    held = json.loads((folder / "limits.json").read_text())
    assert (held["met"], held["verdict"], held["limits"]) == (False, None, [])
    unit = unit_of(folder)
    assert unit.verdict == "" and unit.limits is not None
    assert verdict_words(unit) == "no limits given"
    certificate(folder, tmp_path / "C", draft=True)
    page = (tmp_path / "C" / "certificate.html").read_text("utf-8")
    assert "No limits were given" in page and "PASS" not in page
    assert _status("report", folder) == 0
    assert "<strong>No limits given</strong>" in (folder / "report.html").read_text("utf-8")
    (tmp_path / "fleet.toml").write_text('schema = 1\ndatasets = ["RLG-1"]\nlimits = "limits.toml"\n')
    assert _status("fleet", tmp_path / "fleet.toml", "--out", tmp_path / "F", "--jobs", "1") == 0
    [entry] = json.loads((tmp_path / "F" / "fleet.json").read_text())["serials"]
    assert entry["verdict"] is None and entry["limits_held"] is None


def _leaves(content: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    if isinstance(content, dict | list) and content:
        for name, part in content.items() if isinstance(content, dict) else enumerate(content):
            yield from _leaves(part, (*path, name))
    else:
        yield path


def _mutated(content: Any, path: tuple[str | int, ...]) -> Any:
    content = copy.deepcopy(content)
    place = content
    for name in path[:-1]:
        place = place[name]
    value = place[path[-1]]
    if isinstance(value, bool):
        changed: Any = not value
    elif isinstance(value, int | float):
        changed = value + 1 if isinstance(value, int) else value * 1.01 + 1e-6
    else:
        changed = f"{value}x" if isinstance(value, str) else 1
    place[path[-1]] = changed
    return content


@pytest.mark.parametrize(("of_a_file", "least"), [(12, 80)])
def test_every_leaf_is_guarded(passing: Path, tmp_path: Path, of_a_file: int, least: int) -> None:
    """Certificate and lot refuse whatever of it was changed."""
    print(f"seed {SEED}")
    rng = random.Random(SEED)
    folder = shutil.copytree(passing, tmp_path / "out")
    tried = 0
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        name = path.relative_to(folder).as_posix()
        if name in (MARKER, "c/main.c"):
            continue
        before = path.read_bytes()
        if path.suffix == ".json":
            content = json.loads(before)
            leaves = list(_leaves(content))
            texts = [
                json.dumps(_mutated(content, leaf)).encode() for leaf in rng.sample(leaves, min(of_a_file, len(leaves)))
            ]
        else:
            places = rng.sample(range(len(before)), min(1 + of_a_file // 100, 20, len(before)))
            texts = [before[:at] + bytes([before[at] ^ 1]) + before[at + 1 :] for at in places]
            texts += [before + b"\n", b""]
        for text in texts:
            path.write_bytes(text)
            _refused(folder, tmp_path, name)
            tried += 1
        path.unlink()
        _refused(folder, tmp_path, name)
        path.write_bytes(before)
    print(f"{tried} mutations, all refused")
    assert tried > least
    unit_of(folder)


def _refused(folder: Path, tmp_path: Path, name: str) -> None:
    with pytest.raises(GyrotcError, match=name.rpartition("/")[2].replace(".", r"\.")):
        certificate(folder, tmp_path / "C", draft=True)
    assert not (tmp_path / "C").exists()
    if name in ("model.json", "training.json"):
        with pytest.raises(GyrotcError):
            calibrated_unit(folder)


def test_a_file_that_was_added_is_refused(tmp_path: Path, passing: Path) -> None:
    folder = shutil.copytree(passing, tmp_path / "out")
    (folder / "notes.json").write_text("{}")
    unit_of(folder)
    (folder / "changes.json").write_text("{}")
    with pytest.raises(InputError, match=r"changes\.json"):
        unit_of(folder)


#: Numbers of drawn sets with rows of 20 s, which are read soonest; `make bench ONLY=rows` draws hundreds.
CLEAN, OF_FAULT = (0, 4), {"late": 6, "held": 11, "paired": 1, "reversed": 5, "copied": 9}


@pytest.mark.parametrize("number", CLEAN)
def test_nothing_is_said_of_a_clean_set(number: int) -> None:
    assert not found("clean", 2, number) & ABOUT


@pytest.mark.parametrize("kind", FAULTS)
def test_a_fault_of_one_run_is_named(kind: str) -> None:
    """Before: held rates, a late temperature and a run turned over built at up to 2.78 times the floor in silence."""
    assert found(kind, 2, OF_FAULT[kind]) & ABOUT
