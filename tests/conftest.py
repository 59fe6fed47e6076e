"""Fixtures shared by the tests: a small model, a simulated data set, a built result."""

from __future__ import annotations

import contextlib
import fcntl
import gc
import hashlib
import io
import os
import re
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest import mock

import pytest

if TYPE_CHECKING:
    from click.testing import Result

# As `make test` does: matrices of a few hundred rows are ten times slower on two threads that wait for each other.
# Whoever imports numpy first decides, so it stands above everything else.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
os.environ["COLUMNS"] = "200"  # rich asks once, when the command line is imported
# Tests start the program some hundred times, in this tree and in copies of it: bytecode is compiled once in each.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

ROOT = Path(__file__).resolve().parents[1]
GOLDEN = Path(__file__).resolve().parent / "cases" / "golden"
EXAMPLE = ROOT / "examples" / "minimal"
#: Measured recordings, a folder each; they are no part of the sources.
MEASURED = Path(os.environ.get("GYROTC_REAL_DATA", ROOT / ".." / "shared" / "data" / "real"))
#: Options of a build whose targets are not the point: one arithmetic, one compiler.
HOST = ("--numeric", "f32", "--target", "host-gcc-O2")

Command = Callable[..., "subprocess.CompletedProcess[str]"]


# Files that have taken longer than this, s, begin first, so that no worker is left alone with one at the end.
_LONG_S = 8.0
_SECONDS_KEPT = "gyrotc/seconds_of_files"
_seconds: dict[str, float] = {}


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Add up how long the tests of each file take."""
    file = report.nodeid.partition("::")[0]
    _seconds[file] = _seconds.get(file, 0.0) + report.duration


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Keep how long each file took, at most, for the order of the next run."""
    cache = getattr(session.config, "cache", None)
    if cache is not None and "PYTEST_XDIST_WORKER" not in os.environ:
        known = cache.get(_SECONDS_KEPT, {})
        cache.set(_SECONDS_KEPT, known | {file: max(s, known.get(file, 0.0)) for file, s in _seconds.items()})


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put long files first, and leave out tests of measured recordings that this machine does not have."""
    cache = getattr(config, "cache", None)
    seconds = {} if cache is None else cache.get(_SECONDS_KEPT, {})
    items.sort(key=lambda item: min(-seconds.get(item.nodeid.partition("::")[0], 0.0), -_LONG_S))
    needed = {item: mark.args[0] for item in items if (mark := item.get_closest_marker("measured"))}
    absent = [item for item, name in needed.items() if not (MEASURED / name).is_dir()]
    config.hook.pytest_deselected(items=absent)
    items[:] = [item for item in items if item not in set(absent)]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Print the seed of the order, also with `-q`."""
    seed = config.getoption("randomly_seed", None)
    terminalreporter.write_line("" if seed is None else f"the same order again: --randomly-seed={seed}")


def require(missing: str | None) -> None:
    """Fail where something is missing that `make test` installs."""
    if missing is not None:
        pytest.fail(f"{missing} is not installed: tools/setup.sh test installs it", pytrace=False)


def program(name: str) -> str:
    """Return the path of a program of this machine."""
    path = shutil.which(name)
    require(None if path else name)
    return str(path)


# Modules and tests stay to the end: no collection of garbage looks at them. Later ones are seldom, as they cost a
# thirtieth of the time.
gc.disable()


def pytest_collection_finish() -> None:
    """Begin to collect garbage."""
    gc.freeze()
    gc.set_threshold(20_000)
    gc.enable()


def run_gyrotc(*args: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """The command as a user types it, run in this process: its exit status and what it prints."""
    from gyrotc.cli import main

    words, out, err = [str(a) for a in args], io.StringIO(), io.StringIO()
    before = Path.cwd()
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        warnings.catch_warnings(),
        mock.patch.dict(os.environ),  # --max is set for the rest of a process
    ):
        warnings.simplefilter("ignore")  # as the program does; those of our own code fail the tests of that code
        os.chdir(cwd or before)
        try:
            status = main.run(words)
        finally:
            os.chdir(before)
    return subprocess.CompletedProcess(["gyrotc", *words], status, out.getvalue(), err.getvalue())


def on_terminal(command: Sequence[str | Path], cwd: Path | None = None, *, progress: bool = True) -> tuple[int, str]:
    """Exit status of a command on a terminal of 80 columns, and all that it has shown there, colours left out.

    Without `progress` only its stdout is a terminal.
    """
    environment = os.environ | {"COLUMNS": "80", "TERM": "xterm"}
    reader, writer = os.openpty()
    places: Any = {"stdin": subprocess.DEVNULL, "stdout": writer, "stderr": writer if progress else None}
    with subprocess.Popen(command, env=environment, cwd=cwd, **places) as process:
        os.close(writer)
        shown = b""
        with contextlib.suppress(OSError):  # Linux says so when the other side has gone
            while part := os.read(reader, 4096):
                shown += part
        os.close(reader)
    return process.returncode, re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown.decode())


def invoked(*args: object) -> Result:
    """The command in this process, which has all modules already."""
    from gyrotc.cli.main import application
    from typer.testing import CliRunner

    return CliRunner().invoke(application(), [str(a) for a in args])


def run_here(*args: str | Path) -> str:
    """What the command prints, in this process; what it raises is raised."""
    done = invoked(*args)
    if isinstance(done.exception, Exception):
        raise done.exception
    assert done.exit_code == 0, done.output
    return done.output


@pytest.fixture
def few_vectors(monkeypatch: pytest.MonkeyPatch) -> None:
    """Emit few known answers: where they follow a planted fault, few show it as well as all."""
    from gyrotc.tables import vectors

    monkeypatch.setattr(vectors, "N_RANDOM", 200)


@pytest.fixture
def no_browser(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no browser be found: a certificate then has no PDF, which takes longest."""
    which = shutil.which
    monkeypatch.setattr(shutil, "which", lambda name, *more: None if "chrom" in str(name) else which(name, *more))


@pytest.fixture
def in_this_process() -> Iterator[None]:
    """Do the units of fleets in this process, where processes are not what a test is about."""
    from jobs import units_in_this_process

    with units_in_this_process():
        yield


@pytest.fixture(scope="session")
def gyrotc() -> Command:
    return run_gyrotc


@pytest.fixture
def model_dict() -> dict[str, Any]:
    """A small hand-made model: two centers over 100 C and ±1 C/min."""
    return {
        "schema": "gyrotc.model/1",
        "serial": "RLG-0042",
        "axis": None,
        "method": "mrbf",
        "block_s": 10.0,
        "slope_blocks": 10,
        "lead_blocks": 0,
        "scale": {"temperature_c": [10.0, 50.0], "slope_c_per_min": 1.0},
        "envelope": {"temperature_c": [-40.0, 60.0], "slope_c_per_min": [-1.0, 1.0]},
        "coverage": {"cells": [4, 2], "rows": ["1111", "1011"]},
        "networks": [
            {
                "w0": 0.007,
                "linear": [0.0003, -0.0001],
                "centers": [[-20.0, 0.2], [30.0, -0.4]],
                "widths": [[0.5, 1.0], [0.8, None]],
                "weights": [0.001, -0.0005],
                "region": None,
            }
        ],
        "terms": [],
        "fallback_dph": 0.007,
        "effects_dph": None,
        "rezero_dph": 0.0,
        "hold_blocks": 30,
        "stuck_s": 0.0,
        "agree_s": 1.0,
        "max_step_c": 1.0,
        "max_rate_c_per_min": 30.0,
        "guards": {},
        "noise_floor_dph": 0.0007,
        "noise_floor_source": "estimated",
        "average_s": 100.0,
        "uncertainty_dph": None,
        "data": [{"file": "run-01.csv", "sha256": "0" * 64, "span": None, "role": "train"}],
        "seed": 0,
        "meta": {"calibrated_on": "2026-03-01", "operator": "M. Curie"},
    }


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object]) -> Path:
    """A folder that `make` fills once, for all processes of a run of pytest. It is read only: copy what you change."""
    base = factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / name
    folder.mkdir(exist_ok=True)
    with (folder / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / ".made").exists():
            make(folder)
            (folder / ".made").touch()
    return folder


def _read_by(command: list[str]) -> str:
    """Hash of what a compiler reads: itself, its options, the source, the headers that it finds beside it."""
    folders = [Path(word[2:]) for word in command if word.startswith("-I")]
    source = Path(command[command.index("-c") + 1])
    program = Path(shutil.which(command[0]) or command[0]).resolve()
    options = [word for word in command[1:-1] if not word.startswith("-I") and word != str(source)]
    digest = hashlib.sha256(repr((program, options)).encode())
    files = [source]
    for path in files:  # grows as headers are found
        content = path.read_bytes()
        digest.update(f"\0{path.name} {len(content)}\0".encode() + content)
        names = re.findall(rb'^[ \t]*#[ \t]*include[ \t]*["<]([^">]+)', content, re.MULTILINE)
        found = [folder / os.fsdecode(name) for folder in (path.parent, *folders) for name in names]
        files += [header for header in found if header.is_file() and header not in files]
    return digest.hexdigest()


@pytest.fixture(scope="session", autouse=True)
def objects_compiled_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What this process compiles twice from the same bytes with the same command is compiled once.

    These are programs of board tests, and runtimes of joint tables. Objects with a list of headers are kept by gyrotc.
    """
    from gyrotc.verify import toolchain

    compiled = toolchain.run_compiler
    kept = made_once(tmp_path_factory, "objects", lambda folder: None)

    def command(target: toolchain.Target, words: list[str], folder: Path) -> None:
        if "-c" not in words or "-MD" in words:  # links, or writes more than an object
            return compiled(target, words, folder)
        known = kept / f"{_read_by(words)}.o"
        if not known.exists():
            compiled(target, words, folder)
            part = known.with_suffix(f".{os.getpid()}")
            shutil.copyfile(words[-1], part)
            part.replace(known)
        shutil.copyfile(known, words[-1])
        return None

    with mock.patch.object(toolchain, "run_compiler", command):
        yield


def _demo(folder: Path) -> None:
    printed = ""
    for arguments in (
        ("simulate", "paper", "--seed", "1", "--out", folder / "data"),
        ("build", folder / "data", "--out", folder / "result"),
    ):
        done = run_gyrotc(*arguments)
        assert done.returncode == 0, done.stderr
        printed += done.stdout
    (folder / "printed.txt").write_text(printed)


@pytest.fixture(scope="session")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with `data` (the simulated paper scenario), `result` (what build made of it), `printed.txt` (both)."""
    return made_once(tmp_path_factory, "demo", _demo)
