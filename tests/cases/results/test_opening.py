"""What stands at a name that a command opens for writing stays as it was, unless gyrotc wrote it."""

from __future__ import annotations

import ast
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import typer
from conftest import ROOT, run_gyrotc
from gyrotc.common import InputError
from gyrotc.results import held, write_atomically
from jobs import units_in_this_process
from recordings import columns, toml, write_csv

PACKAGE = ROOT / "gen" / "gyrotc"
YEARS = b"years of work\n"
MADE = ".gyrotc-part-"  # in names of folders that a job has just made: nobody can know them before

_opened: list[str] = []


def _hook(event: str, arguments: tuple[object, ...]) -> None:
    if event == "open" and isinstance(arguments[0], str | bytes):
        path, mode, flags = arguments
        writes = isinstance(flags, int) and flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC)
        if writes or (isinstance(mode, str) and set(mode) & set("wax+")):
            _opened.append(os.fsdecode(path))  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def traced() -> list[str]:
    """Names that this process has opened for writing, as they come. A hook cannot be taken away again."""
    sys.addaudithook(_hook)
    return _opened


@pytest.fixture(scope="module")
def start(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A gyro's recordings, and a fleet of it."""
    folder = tmp_path_factory.mktemp("start")
    data = folder / "data" / "RLG-1"
    write_csv(data / "run-01.csv", columns(720, seed=1))
    head = 'schema = 1\nserial = "RLG-1"\nearth_rate = "none"\n[meta]\ncalibrated_on = "2026-03-07"'
    (data / "dataset.toml").write_text(toml('file = "run-01.csv"', head=head))
    before = Path.cwd()
    os.chdir(folder)
    try:
        with units_in_this_process():
            assert status("fleet", "data", "--out", "fleet") == 0
    finally:
        os.chdir(before)
    return folder


def status(*arguments: str) -> int:
    """Exit status of a command, with its errors printed."""
    done = run_gyrotc(*arguments)
    print(done.stderr, end="", file=sys.stderr)
    return done.returncode


COMMANDS = {
    "check": ("check", "data/RLG-1", "--json", "c.json"),
    "fit": ("fit", "data/RLG-1", "--out", "R"),
    "emit": ("emit", "fleet/RLG-1/model.json", "--out", "E", "--map", "map.csv"),
    "import": ("import", "data/RLG-1/run-01.csv", "--out", "I", "--serial", "A"),
    "simulate": ("simulate", "paper-20C", "--raw-hz", "0.01", "--out", "S"),
    "certificate": ("certificate", "fleet/RLG-1", "--draft", "--out", "C"),
    "fleet": ("fleet", "data", "--out", "fleet"),  # whose gyro is done before: no process is needed for it
}
WRITE_NOTHING = {"schema"}  # but to standard output
# These take longer: they write a file as check --json does, or a folder as fit does.
AS_OTHERS = {"lot", "report", "verify", "evaluate", "build", "compare", "diagnose"}


@pytest.fixture(params=COMMANDS)
def command(request: pytest.FixtureRequest) -> tuple[str, ...]:
    found: tuple[str, ...] = COMMANDS[request.param]
    return found


def test_every_command_is_tried() -> None:
    from gyrotc.cli.main import application

    every = set(typer.main.get_command(application()).commands)  # type: ignore[attr-defined]
    assert every == {*COMMANDS} | WRITE_NOTHING | AS_OTHERS


def link(path: Path, thesis: Path) -> None:
    path.symlink_to(thesis)


def hard_link(path: Path, thesis: Path) -> None:
    path.hardlink_to(thesis)


def pipe(path: Path, _: Path) -> None:
    os.mkfifo(path)


def folder(path: Path, _: Path) -> None:
    path.mkdir()
    (path / "thesis.tex").write_bytes(YEARS)


def file(path: Path, _: Path) -> None:
    path.write_bytes(YEARS)


def _fresh(start: Path, place: Path) -> Path:
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(start, place)
    os.chdir(place)
    return place


@pytest.fixture
def back() -> Iterator[None]:
    before = Path.cwd()
    yield
    os.chdir(before)


def test_nothing_foreign_is_changed_at_a_name_that_is_opened(
    command: tuple[str, ...], start: Path, tmp_path: Path, traced: list[str], back: None,
    no_browser: None, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Before: a link called `.R.lock` emptied the file that it led to, and the command ended with 0."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    work = _fresh(start, tmp_path / "work")
    there = {path.name for path in work.iterdir()}
    traced.clear()
    assert status(*command) == 0, capfd.readouterr().err
    opened = {os.path.relpath(path, work) for path in map(os.path.abspath, traced)}
    names = {name for name in opened if not name.startswith("..") and MADE not in name}
    assert any(name.endswith(".lock") for name in names)
    names |= {path.name for path in work.iterdir()} - there  # and the outputs, which are renamed into their places
    for name in sorted(names):
        for plant in (link, hard_link, pipe, folder, file):
            _refused_or_replaced(command, _fresh(start, work), name, plant, capfd)


def _refused_or_replaced(
    command: tuple[str, ...],
    work: Path,
    name: str,
    plant: Callable[[Path, Path], None],
    capfd: pytest.CaptureFixture[str],
) -> None:
    what = f"a {plant.__name__} at {name}"
    thesis, place = work.parent / "thesis", work / name
    thesis.unlink(missing_ok=True)
    thesis.write_bytes(YEARS)
    place.parent.mkdir(parents=True, exist_ok=True)
    if place.is_file():
        place.unlink()
    plant(place, thesis)
    capfd.readouterr()
    found = status(*command)
    reported = capfd.readouterr().err
    assert thesis.read_bytes() == YEARS, what
    if plant is folder:
        assert (place / "thesis.tex").read_bytes() == YEARS, what
    elif plant is file:
        assert place.read_bytes() == YEARS, what
    assert found in (0, 2), f"{what}: {reported}"
    assert found == 0 or len(reported.strip().splitlines()) == 1, f"{what}: {reported}"
    if place.name.endswith(".lock") or plant in (file, pipe):
        assert found == 2, what


def test_a_job_that_was_killed_is_no_hindrance(tmp_path: Path) -> None:
    """What it left is known by its name: the next job removes it."""
    path = tmp_path / "c.json"
    for name in (".c.json.gyrotc-part-0123abcd", ".c.json.lock"):
        (tmp_path / name).write_bytes(b"")
    write_atomically(path, "{}")
    assert [p.name for p in tmp_path.iterdir()] == ["c.json"]


def test_what_is_no_lock_is_left_as_it_is(tmp_path: Path) -> None:
    lock = tmp_path / ".R.lock"
    lock.write_bytes(YEARS)
    with pytest.raises(InputError, match="is no lock of gyrotc"), held(tmp_path / "R"):
        pytest.fail("began")
    assert lock.read_bytes() == YEARS
    lock.unlink()
    with held(tmp_path / "R"):
        assert lock.exists()
    assert not lock.exists()


def test_a_link_to_a_device_is_not_written_to(tmp_path: Path) -> None:
    path = tmp_path / "c.json"
    path.symlink_to("/dev/full")
    write_atomically(path, "{}")
    assert not path.is_symlink() and path.read_text() == "{}"


_WRITING = ("write_text", "write_bytes", "touch", "copyfile", "copy2", "copytree", "symlink_to")
_DOOR = {
    "results/files.py",
    "results/folder.py copy2",  # into a folder that the job has just made
    "cli/fleet.py copytree",  # likewise
    "recordings/importers/job.py open",  # into a scratch folder that the job has just made
    "recordings/importers/csv_table.py open",  # likewise
    "recordings/importers/formats/spreadsheet.py open",  # likewise
}


def _writes(tree: ast.AST) -> Iterator[str]:
    """Names of calls that open a file for writing."""
    for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call)):
        name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
        plain = [a.value for a in call.args if isinstance(a, ast.Constant) and isinstance(a.value, str)]
        flags = " ".join(ast.unparse(argument) for argument in call.args[1:])
        if name in _WRITING or (
            name == "open" and (any(set(text) <= set("rwaxbt+") - {"r"} for text in plain) or "O_CREAT" in flags)
        ):
            yield name


def test_files_are_opened_for_writing_in_one_place() -> None:
    found = set()
    for path in PACKAGE.rglob("*.py"):
        name = path.relative_to(PACKAGE).as_posix()
        for call in _writes(ast.parse(path.read_text("utf-8"))):
            found.add(name if name in _DOOR else f"{name} {call}")
    assert found <= _DOOR
    assert set(_writes(ast.parse("open(p, 'wb'); p.open('x'); os.open(p, os.O_CREAT | 1)"))) == {"open"}
