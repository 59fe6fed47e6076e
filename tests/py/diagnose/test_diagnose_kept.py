"""A diagnosis that was made before comes from the cache: the same bytes, nothing computed; another one does not."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from campaigns import GRADIENT, simulated
from gyrotc.diagnose.diagnosis import Diagnosis, diagnose
from gyrotc.jobs import diagnosis
from gyrotc.jobs.build import build
from gyrotc.model import Model
from gyrotc.recordings.load import load
from gyrotc.store import cache
from gyrotc.train.fitting import FitOptions

_LOADED = """
import json, sys
from gyrotc.cli.commands import app
try:
    app(sys.argv[1:], standalone_mode=False)
finally:
    print(json.dumps(sorted(sys.modules)), file=sys.stderr)
"""


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return simulated(tmp_path_factory.mktemp("kept"), GRADIENT)


@pytest.fixture(autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))


def _contents(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def _typed(*arguments: object) -> tuple[str, set[str]]:
    """What the command prints, and the modules that it has loaded."""
    command = [sys.executable, "-c", _LOADED, "diagnose", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout, set(json.loads(done.stderr.splitlines()[-1]))


@pytest.mark.slow
def test_the_second_call_writes_the_same_and_loads_nothing_that_computes_or_draws(
    data: Path, tmp_path: Path
) -> None:
    first, needed = _typed(data, "--out", tmp_path / "out")
    assert {"matplotlib", "scipy.optimize", "gyrotc.diagnose"} <= needed, "the check itself can fail"
    one = _contents(tmp_path / "out")
    assert {"report.html", "diagnose.json", "model-extended.json", ".gyrotc-result.json"} <= set(one)
    second, loaded = _typed(data, "--out", tmp_path / "out")
    assert not {"matplotlib", "scipy.optimize", "gyrotc.diagnose"} & loaded
    assert second == first and _contents(tmp_path / "out") == one
    elsewhere = shutil.copytree(data, tmp_path / "copy")
    _, loaded = _typed(elsewhere, "--out", tmp_path / "new")
    assert "matplotlib" not in loaded, "the same bytes in another folder are the same recordings"
    assert _contents(tmp_path / "new") == one


class _Counted:
    """Stands for the search: gives one result, and counts how often it is asked."""

    def __init__(self, found: Diagnosis) -> None:
        self.found, self.count = found, 0

    def __call__(self, *_: object, **__: object) -> Diagnosis:
        self.count += 1
        return self.found


@pytest.fixture
def counted(data: Path, monkeypatch: pytest.MonkeyPatch) -> _Counted:
    still = load(_still(data.parent / "still"))
    counted = _Counted(diagnose(still))
    monkeypatch.setattr("gyrotc.diagnose.diagnosis.diagnose", counted)
    return counted


def _still(folder: Path) -> Path:
    """Three runs at one temperature, of which nothing can be said: it takes no time."""
    folder.mkdir(exist_ok=True)
    for number in range(3):
        rows = [f"{10 * k},{25 + 0.01 * (k % 3)},{7e-3 + 1e-4 * ((7 * k) % 5)}" for k in range(400)]
        (folder / f"{number}.csv").write_text("time_s,temperature_c,rate_dph\n" + "\n".join(rows) + "\n")
    return folder


def test_whatever_a_diagnosis_depends_on_makes_another_one(
    data: Path,
    tmp_path: Path,
    counted: _Counted,
    model_dict: dict[str, object],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder = shutil.copytree(data, tmp_path / "data")
    file = folder / "run-01.csv"
    description, rows = (folder / "dataset.toml").read_text(), file.read_text()
    options = FitOptions()

    def ask(**more: object) -> None:
        diagnosis.diagnosed(load(folder), **({"options": options} | more))  # type: ignore[arg-type]

    def asked_anew(what: str, call: Callable[[], None]) -> None:
        before = counted.count
        call()
        assert counted.count == before + 1, f"{what} is not told apart"
        call()
        assert counted.count == before + 1, f"{what} is not kept"

    asked_anew("the first call", ask)
    for other in (
        replace(options, seed=1), replace(options, method="cubic"), replace(options, centers=3),
        replace(options, rho=0.5), replace(options, block_s=20.0), replace(options, average_s=50.0),
    ):  # fmt: skip
        asked_anew(repr(other), lambda other=other: ask(options=other))
    asked_anew("events", lambda: ask(accept_events=True))
    asked_anew("a model", lambda: ask(options=None, model=Model.from_dict(model_dict)))
    file.write_text(rows.replace("0.0", "0.1", 1))
    asked_anew("a digit of a recording", ask)
    file.write_text(rows)
    (folder / "dataset.toml").write_text(description.replace("[meta]\n", "[meta]\noperator = 'M. Curie'\n"))
    asked_anew("the description", ask)
    (folder / "dataset.toml").write_text(description)
    monkeypatch.setattr(diagnosis, "_code", lambda: "another version of gyrotc")
    asked_anew("another gyrotc", ask)
    before = counted.count
    ask(fresh=True)
    assert counted.count == before + 1


def test_what_is_damaged_or_holds_foreign_files_is_computed_again(data: Path, counted: _Counted) -> None:
    recordings = load(data)
    diagnosis.diagnosed(recordings)
    [path] = cache.folder().glob("*.diagnosis")
    whole = path.read_bytes()
    content = json.loads(whole[len(cache._packed("", b"")) :])
    for damaged in (
        b"",
        whole[:-1],
        whole[:100] + b"0" + whole[101:],
        cache._packed("0" * 64 + ".diagnosis", whole[len(cache._packed("", b"")) :]),  # of another name
        cache._packed(path.name, b"[]"),
        cache._packed(path.name, json.dumps(content | {"files": {"../report.html": ""}}).encode()),
        cache._packed(
            path.name, json.dumps(content | {"files": {"diagnose.json": "", "report.html": 1}}).encode()
        ),
        cache._packed(path.name, json.dumps(content | {"result": {}}).encode()),
    ):
        path.write_bytes(damaged)
        before = counted.count
        assert diagnosis.diagnosed(recordings).result == counted.found.result
        assert counted.count == before + 1


@pytest.mark.slow
def test_a_build_takes_the_diagnosis_that_was_made_before(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The extended model and what training says of it come with it: the result is the same to the byte."""

    def built(out: Path) -> dict[str, bytes]:
        build(data, out, FitOptions(), numerics=["f32"], targets=["host-gcc-O2"], extend=True)
        names = ("model.json", "training.json", "diagnosis/report.html", "diagnosis/model-extended.json")
        return {name: (out / name).read_bytes() for name in names}

    first = built(tmp_path / "first")
    assert json.loads(first["model.json"])["terms"]

    def again(*_: object, **__: object) -> Diagnosis:
        raise AssertionError("computed again")

    monkeypatch.setattr("gyrotc.diagnose.diagnosis.diagnose", again)
    assert built(tmp_path / "second") == first
