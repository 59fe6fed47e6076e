"""The command on a terminal: quiet and verbose anywhere, completion in a shell, closed streams, what is left to do."""

from __future__ import annotations

import inspect
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import get_args

import pytest
from conftest import HOST, Command, invoked, on_terminal
from emitted import GOLDEN, emitted
from gyrotc.cli import progress as stage_module
from gyrotc.cli.application import GROUPS, INSTEAD
from gyrotc.cli.main import application, hoisted, run
from gyrotc.cli.options import JsonOption
from gyrotc.cli.output import folded
from gyrotc.cli.progress import StageLine
from gyrotc.cli.recordings import RunFormat
from gyrotc.common import Progress, Stages
from gyrotc.jobs import BuildRequest
from gyrotc.jobs import build as build_result
from gyrotc.model import load_model
from gyrotc.quality import check
from gyrotc.recordings import FileFormat, load
from gyrotc.results import MARKER, Interrupted
from gyrotc.tables import emit
from gyrotc.train import FitOptions, fit_dataset
from hypothesis import given
from hypothesis import strategies as st
from recordings import columns, described, toml, write_csv

PROGRAM = Path(sys.executable).with_name("gyrotc")


def test_options_of_the_whole_program_stand_anywhere() -> None:
    assert hoisted(["build", "data", "-q", "--out", "x"]) == ["-q", "build", "data", "--out", "x"]
    assert hoisted(["check", "--", "-q"]) == ["check", "--", "-q"]
    assert hoisted(["--verbose", "check"]) == ["--verbose", "check"]
    assert hoisted(["check", "data", "--max"]) == ["--max"]  # and does not take "check" for its value
    assert hoisted(["check", "data", "--max", "columns=2"]) == ["--max", "columns=2", "check", "data"]
    assert hoisted(["check", "--max=columns=2", "data"]) == ["--max=columns=2", "check", "data"]


def test_quiet_tells_only_what_went_wrong_and_verbose_every_stage(tmp_path: Path, gyrotc: Command) -> None:
    described(tmp_path / "R")
    for where in (("-q", "fit"), ("fit", "--quiet")):
        done = gyrotc(*where, tmp_path / "R", "--out", tmp_path / "out")
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    wrong = gyrotc("check", tmp_path / "none", "-q")
    assert wrong.returncode == 2 and "none" in wrong.stdout
    reported = gyrotc("fit", tmp_path / "R", "--out", tmp_path / "out", "-v")
    assert reported.returncode == 0 and reported.stdout
    lines = reported.stderr.splitlines()
    assert lines and all(line.split()[1] == "s" and float(line.split()[0]) >= 0.0 for line in lines)


Report = list[tuple[str, float, float]]


def _of_job(job: str, folder: Path, report: Progress) -> None:
    """Run a job that takes next to no time, and have its progress reported."""
    described(folder / "R")
    if job == "fit":
        fit_dataset(load(folder / "R"), FitOptions(), progress=report)
    elif job == "check":
        check(folder / "R", progress=report)
    elif job == "build":
        build_result(folder / "R", folder / "out", BuildRequest(targets=["host-gcc-O2"]), progress=report)
    else:
        emit(load_model(GOLDEN), folder / "out", progress=report)


@pytest.mark.parametrize("job", ["check", "fit", "emit", "build"])
def test_a_job_reports_its_stages_and_a_share_that_never_falls(job: str, tmp_path: Path) -> None:
    reported: Report = []
    _of_job(job, tmp_path, lambda stage, done, total: reported.append((stage, done, total)))
    shares = [done / total for _, done, total in reported]
    assert shares == sorted(shares) and shares[0] == 0.0 and 0.4 < shares[-1] <= 1.0
    assert len({stage for stage, _, _ in reported}) > 2


@given(
    shares=st.lists(st.floats(0.0, 10.0), min_size=1, max_size=6),
    inside=st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), min_size=6, max_size=6),
)
def test_the_share_of_a_job_is_that_of_its_stages(shares: list[float], inside: list[tuple[int, int]]) -> None:
    reported: Report = []
    stages = Stages(
        lambda stage, done, total: reported.append((stage, done, total)), {str(k): x for k, x in enumerate(shares)}
    )
    for (k, share), (done, total) in zip(enumerate(shares), inside, strict=False):
        stages.within(str(k), "of axis x: ")("reading", done, total)
        stage, known, whole = reported[-1]
        assert stage == "of axis x: reading" and whole == sum(shares)
        part = min(done / total, 1.0) if total else 0.0
        assert known == pytest.approx(sum(shares[:k]) + part * share)


def test_the_time_left_of_a_fleet(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 1000.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    course = StageLine()
    course.say("0 of 20 gyros done", 0, 20)
    assert course.line(now) == "0 of 20 gyros done" and course.line(now + 9.0) == "0 of 20 gyros done, 9 s"
    for done, elapsed, left in ((5, 30.0, "90 s"), (10, 1200.0, "20 min"), (20, 9000.0, "0 s")):
        now = 1000.0 + elapsed
        course.say(f"{done} of 20 gyros done", done, 20)
        assert course.line(now) == f"{done} of 20 gyros done, {5 * done} %, about {left} left"


def test_a_stage_is_shown_with_percent_and_time_left_from_two_seconds_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock that stands still but where it is set."""
    clock = SimpleNamespace(monotonic=lambda: now)
    monkeypatch.setattr(stage_module, "time", clock)
    now = 100.0
    course = StageLine()
    course.say("reading", 0, 4)
    assert course.line(101.0) == "reading" and course.line(104.0) == "reading, 4 s"
    now = 110.0
    course.say("drawing", 1, 4)
    assert course.line(110.0) == "drawing, 25 %, about 30 s left"
    assert course.line(115.0) == "drawing, 25 %, about 25 s left", "the clock goes on"
    assert course.line(200.0).endswith("about 0 s left")
    course.say("reading")
    assert course.line(110.0).startswith("reading, 25 %"), "never less than before"


def _catches(process: int) -> int:
    """Signals that a process has handlers for, as bits (proc(5))."""
    status = Path(f"/proc/{process}/status").read_text()
    return int(next(line for line in status.splitlines() if line.startswith("SigCgt:")).split()[1], 16)


COMMANDS = {
    "fit": ("fit", "RLG-1", "--out", "out"),
    "build": ("build", "RLG-1", "--out", "out"),
    "simulate": ("simulate", "paper", "--out", "out"),
    "compare": ("compare", "RLG-1", "--out", "out"),
    "diagnose": ("diagnose", "RLG-1", "--out", "out"),
    "fleet": ("fleet", "lot", "--out", "out"),
    "verify": ("verify", "made"),
    "emit": ("emit", "made", "--out", "out"),
}


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("desk")
    described(folder / "RLG-1")
    described(folder / "lot" / "RLG-1")
    emitted(folder / "made")
    return folder


def test_a_signal_that_a_library_made_an_error_of_is_a_signal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Modules in C++ say "initialization failed" of whatever ends their import."""

    def importing(*_arguments: object, **_options: object) -> None:
        try:
            raise Interrupted(signal.SIGINT)
        except Interrupted as end:
            raise ImportError("initialization failed") from end

    monkeypatch.setattr("gyrotc.cli.main.application", lambda: importing)
    with pytest.raises(Interrupted):
        run(["check", "data"])


def test_an_error_that_names_itself_as_its_cause_is_an_internal_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(*_arguments: object, **_options: object) -> None:
        error = ValueError("of itself")
        raise error from error

    monkeypatch.setattr("gyrotc.cli.main.application", lambda: failing)
    assert run(["check", "data"]) == 70


@pytest.mark.parametrize("name", COMMANDS)
def test_ctrl_c_is_one_line_and_leaves_nothing(name: str, desk: Path) -> None:
    """At a moment drawn within the first second and a half: imports, work, or its end."""
    seed = random.SystemRandom().randrange(10**6)
    print(f"seed {seed}")
    before = sorted(desk.iterdir())
    # A job in the background of a shell inherits that SIGINT is ignored; env undoes it, and becomes the program.
    command = ["env", "--default-signal", PROGRAM, *COMMANDS[name]]
    job = subprocess.Popen(command, cwd=desk, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    while job.poll() is None and not _catches(job.pid) >> (signal.SIGTERM - 1) & 1:
        time.sleep(0.005)
    time.sleep(random.Random(seed).uniform(0.0, 1.5))
    job.send_signal(signal.SIGINT)
    _, reported = job.communicate()
    if job.returncode == -signal.SIGINT:  # a shell reports 130
        assert reported == "gyrotc: interrupted (SIGINT)\n"
        left = [p for p in desk.iterdir() if p not in before and p.suffix != ".lock"]
        half = [p for p in left if p.name.startswith(".") or (p.is_dir() and not (p / MARKER).is_file())]
        assert name == "fleet" or not half, f"half-written: {half}"  # a signal after the last rename leaves the whole
    else:
        assert job.returncode == 0, f"it had ended: {reported}"
    shutil.rmtree(desk / "out", ignore_errors=True)
    (desk / "out").unlink(missing_ok=True)


def test_ctrl_c_before_anything_is_begun_is_silent() -> None:
    """Before: a traceback out of the middle of an import."""
    early = "import os, signal, gyrotc.cli.main as c; c._quiet_start(); os.kill(os.getpid(), signal.SIGINT)"
    command = ["env", "--default-signal", sys.executable, "-c", early]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")
    light = "import sys, gyrotc.cli.main; sys.exit(bool({'numpy', 'pydantic', 'rich', 'typer'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", light], check=False).returncode == 0


def test_help_loads_none_of_the_libraries_that_compute() -> None:
    heavy = {"numpy", "pyarrow", "pydantic", "scipy", "jinja2"}
    code = f"import sys, gyrotc.cli.main as c; c.application(); sys.exit(' '.join({heavy} & set(sys.modules)) or 0)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_warnings_of_libraries_are_kept_out_unless_asked_for() -> None:
    code = "import warnings, gyrotc.cli.main as c; c.run = lambda _: (warnings.warn('of a library'), 0)[1]; c.main()"
    plain = os.environ | {"PYTHONWARNINGS": ""}
    for options, shown in (((), False), (("-W", "default"), True)):
        command = [sys.executable, *options, "-c", code]
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=plain)
        assert (done.returncode, "of a library" in done.stderr) == (0, shown)


@pytest.mark.parametrize("name", ["", *(name for names in GROUPS.values() for name in names)])
def test_help_keeps_to_80_columns_and_cuts_nothing(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("TERMINAL_WIDTH", "80")
    lines = invoked(*([name] if name else []), "--help").stdout.splitlines()
    assert all(len(line) <= 80 for line in lines)
    examples = [line for line in lines if line.startswith("  Example: ")]
    assert all(lines[lines.index(line) + 1] == "" for line in examples), "an example is one line, to be copied"
    assert bool(examples) == bool(name)
    if not name:
        commands = [line for line in lines if line.startswith("  ") and line.split()[0] in application_names()]
        assert len(commands) == len(application_names())
        assert all(line.endswith(".") and not line.endswith("...") for line in commands)


def application_names() -> list[str]:
    return [name for names in GROUPS.values() for name in names]


@pytest.mark.parametrize("name", INSTEAD)
def test_a_command_that_there_is_not_names_what_does_its_work(name: str) -> None:
    done = invoked(name, "--out", "R")
    assert done.exit_code == 2 and f"There is no command {name}: {INSTEAD[name]}." in done.stderr


def test_long_lines_are_broken_between_words_and_stay_to_be_copied() -> None:
    exclude = 'exclude = [{from_s = 10.0, to_s = 12.0, reason = "thermometer stuck for a while"}]'
    path = "/data/" + "long/" * 20 + "run-01.csv"
    text = f"  finding stuck_temperature: it stays at 20.5 C from 10 to 12 s; look at {path} or write: {exclude}"
    lines = folded(text, 80).split("\n")
    assert " ".join(line.strip() for line in lines) == text.strip(), "no word is lost or cut"
    assert lines[0].startswith("  finding") and all(line.startswith("    ") for line in lines[1:])
    assert all(len(line) <= 80 or line.strip() in (path, exclude) for line in lines)
    assert [line.strip() for line in lines if "exclude" in line] == [exclude], "one piece, to be pasted"
    assert folded("short:  as it is", 80) == "short:  as it is"


def test_a_terminal_of_80_columns_gets_lines_of_80_columns(tmp_path: Path) -> None:
    """A pipe gets each line whole, as scripts expect."""
    described(tmp_path / "R")
    command = [str(PROGRAM), "check", str(tmp_path / "R")]
    whole = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert max(len(line) for line in whole.splitlines()) > 80
    status, reported = on_terminal(command, progress=False)
    assert status == 0
    lines = reported.splitlines()
    assert all(len(line) <= 80 for line in lines if len(line.split()) > 1)
    assert "".join("".join(lines).split()) == "".join(whole.split())


def test_help_has_every_command_once_in_a_group_of_the_work(gyrotc: Command) -> None:
    named = [name for names in GROUPS.values() for name in names]
    callbacks = [c for c in application().registered_commands if c.callback]
    assert sorted(named) == sorted(c.name or c.callback.__name__ for c in callbacks if c.callback)
    shown = gyrotc("--help").stdout
    places = [shown.index(f"\n{title}:") for title in GROUPS]
    assert places == sorted(places) and all(f"\n  {name} " in shown for name in named)


def test_bash_completes_commands_and_options(tmp_path: Path) -> None:
    script = tmp_path / "gyrotc.bash"
    # The shell is the parent process, which a last command would replace.
    shown = ["bash", "-c", f"'{PROGRAM}' --show-completion; true"]
    script.write_text(subprocess.run(shown, capture_output=True, text=True, check=True).stdout)
    for typed, expected in (("ve", "verify"), ("build --lim", "--limits")):
        words = " ".join(f"'{word}'" for word in ("gyrotc", *typed.split()))
        ask = (
            f"source '{script}'; COMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); "
            f"_gyrotc_completion '{PROGRAM}'; echo \"${{COMPREPLY[@]}}\""
        )
        done = subprocess.run(["bash", "-c", ask], capture_output=True, text=True, check=True)
        assert expected in done.stdout.split()


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("simulate paper --format", ["csv", "parquet"]),
        ("build data --numeric f32,", ["f32,q31"]),
        ("build data --axis a", ["all"]),
        ("verify result --target cortex-m4", ["cortex-m4f"]),
    ],
)
def test_a_shell_completes_the_words_that_an_option_takes(
    typed: str, offered: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = typed.rsplit(maxsplit=1)[-1].startswith("-")
    monkeypatch.setenv("_GYROTC_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", f"gyrotc {typed}{' ' if whole else ''}")
    monkeypatch.setenv("COMP_CWORD", str(len(typed.split()) + whole))
    run([])
    assert capsys.readouterr().out.split() == offered


def test_formats_of_the_command_line_are_those_of_recordings() -> None:
    assert {word.value for word in RunFormat} == set(get_args(FileFormat))


def test_a_wrong_format_is_answered_with_the_right_ones() -> None:
    done = invoked("simulate", "paper", "--out", "R", "--format", "xml")
    assert done.exit_code == 2 and all(f"'{word.value}'" in done.stderr for word in RunFormat)


def test_a_build_says_what_one_asks_in_ten_lines(tmp_path: Path, gyrotc: Command) -> None:
    """Verdict, gain, floor, bytes, findings by id, the next step and the page; the rest is on the page."""
    data = tmp_path / "my data"
    for k in range(2):
        write_csv(data / f"run-{k}.csv", columns(720, seed=k))
    head = 'schema = 1\nserial = "RLG-1"\nearth_rate = "none"'
    (data / "dataset.toml").write_text(toml('file = "run-0.csv"', 'file = "run-1.csv"', head=head))
    (tmp_path / "limits.toml").write_text("schema = 1\n[at_most]\nrms_dph = 1.0\ntable_bytes = 20\n")
    build = ("build", data, *HOST, "--limits", tmp_path / "limits.toml")
    gyrotc(*build, "--out", tmp_path / "before")
    done = gyrotc(*build, "--out", tmp_path / "out", "--previous", tmp_path / "before")
    lines = done.stdout.splitlines()
    assert len(lines) <= 10, done.stdout
    assert lines[0].startswith("RLG-1: FAIL; table, bytes ≤ 20: ")
    assert lines[1].startswith("improvement ") and " against a constant on " in lines[1]
    assert lines[2].startswith("RMS ") and " x noise floor (estimated), of means over 100 s" in lines[2]
    assert any(line.startswith("a constant keeps RMS, deg/h ≤ 1") for line in lines)
    assert any(re.match(r"table: \d+ bytes, \d+ centers", line) for line in lines)
    assert lines[-2].startswith("next: ") and lines[-1] == f"report: {tmp_path / 'out' / 'report.html'}"


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&-", ">&- 2>&- <&-"])
def test_closed_streams_are_no_fault(closed: str) -> None:
    line = f"{sys.executable} -m gyrotc --version {closed}"
    done = subprocess.run(["sh", "-c", line], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "Traceback" not in done.stderr, done.stderr


def test_a_loop_of_links_is_one_line(tmp_path: Path, gyrotc: Command) -> None:
    (tmp_path / "a.csv").symlink_to("b.csv")
    (tmp_path / "b.csv").symlink_to("a.csv")
    done = gyrotc("import", tmp_path / "a.csv", "--serial", "a", "--out", tmp_path / "R")
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1, done.stderr


def test_an_unknown_format_is_refused(tmp_path: Path, gyrotc: Command) -> None:
    done = gyrotc("simulate", "paper", "--format", "x", "--out", tmp_path / "R")
    assert done.returncode == 2 and not (tmp_path / "R").exists()


def test_json_on_standard_output_is_alone_there(tmp_path: Path, gyrotc: Command) -> None:
    folder = tmp_path / "RLG-1"
    described(folder)
    done = gyrotc("check", folder, "--json", "-", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["schema"] == "gyrotc.check/1"
    assert "run-01.csv" in done.stderr
    assert not (tmp_path / "-").exists()
    assert gyrotc("check", folder).stdout.strip(), "the next command has its standard output again"


def test_commands_without_a_result_folder_write_their_json_where_it_is_asked_for() -> None:
    commands = [c.callback for c in application().registered_commands if c.callback]
    found = {c.__name__ for c in commands if "json_file" in inspect.signature(c).parameters}
    assert found == {"check", "import_"}
    for command in commands:
        parameter = inspect.signature(command, eval_str=True).parameters.get("json_file")
        assert parameter is None or parameter.annotation == JsonOption, command.__name__


def test_help_of_the_package_begins_with_commands_that_there_are() -> None:
    import gyrotc

    lines = re.findall(r"^    gyrotc (\S+) ", str(gyrotc.__doc__), re.MULTILINE)
    assert len(lines) >= 5 and str(gyrotc.__doc__).index("    gyrotc ") < 300
    commands = {str(info.name or getattr(info.callback, "__name__", "")) for info in application().registered_commands}
    commands |= {name.replace("_", "-") for name in commands}
    assert set(lines) <= commands
