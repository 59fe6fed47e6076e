"""Whatever is typed behind a command, and whatever a file is called: exit status 0, 1 of a failed check, or 2."""

from __future__ import annotations

import os
import random
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from conftest import run_gyrotc
from emitted import emitted
from gyrotc.cli.main import application
from hostile import hostile_strings
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st
from recordings import columns, toml, write_csv

SEED = 26
COMMANDS: dict[str, Any] = typer.main.get_command(application()).commands  # type: ignore[attr-defined]
LEFT_OUT = {"scheduler", "help", "install_completion", "show_completion", "wait"}  # a host, a shell, a minute
SLOW = {"build", "compare", "diagnose", "evaluate", "fleet", "verify"}  # seconds each where all is in order
MAY_FAIL = re.compile(r"exit status 1|fail|differ|not met|1 where", re.IGNORECASE)
NUMBERS = [
    "0", "-0", "1", "2", "-1", "0.5", "1e-320", "1e7", "1e308", "-1e308", "nan", "inf", "-inf", "1e999", "9" * 30,
    "0x10", "1_000", "1,5", "", " ", "a", "1/2", "1/0", "2/1", "\u0661",
]  # fmt: skip
TEXTS = [text for text in hostile_strings(300) if "\x00" not in text]
GOOD = ["data", "data/run-01.csv", "result", "result/model.json", "out", "new", "limits.toml", "fleet.toml"]
BAD = ["missing", "broken", "broken/dataset.toml", "pipe", "loop", "/dev/null", "/proc/self/mem", ".", "..", "/", ""]


@pytest.fixture(scope="module")
def start(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set, an emitted folder, and what is neither."""
    folder = tmp_path_factory.mktemp("arguments")
    write_csv(folder / "data" / "run-01.csv", columns())
    (folder / "data" / "dataset.toml").write_text(toml('file = "run-01.csv"'), "utf-8")
    emitted(folder / "result")
    (folder / "limits.toml").write_text("schema = 1\n[at_most]\nrms_dph = 1.0\n", "utf-8")
    (folder / "fleet.toml").write_text('schema = 1\ndatasets = ["missing"]\n', "utf-8")
    (folder / "broken").mkdir()
    (folder / "broken" / "dataset.toml").write_text("schema = [", "utf-8")
    (folder / "loop").symlink_to("loop")
    return folder


@pytest.fixture
def place(start: Path, tmp_path: Path, no_browser: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    work = tmp_path / "work"
    shutil.copytree(start, work, symlinks=True)
    os.mkfifo(work / "pipe")
    for name in ("HOME", "XDG_CACHE_HOME", "XDG_STATE_HOME"):
        monkeypatch.setenv(name, str(tmp_path / "home"))
    before = Path.cwd()
    os.chdir(work)
    yield work
    os.chdir(before)


WORDS = ["f32", "q31", "csv", "parquet", "paper", "lot", "x", "y", "z", "all", "linear", "cubic", "host-gcc-O2", "PASS"]
OTHERS = st.sampled_from(NUMBERS) | st.sampled_from(WORDS) | st.sampled_from(TEXTS)


def _values(slow: bool) -> st.SearchStrategy[str]:
    """What may stand for a value; not by its type, which releases of typer tell in other ways."""
    return st.sampled_from((["result/model.json"] if slow else GOOD) + BAD) | OTHERS


@st.composite
def typed(draw: st.DrawFn) -> list[str]:
    """A command with some of its options and arguments."""
    name = draw(st.sampled_from(sorted(COMMANDS)))
    slow = name in SLOW
    words = [name]
    for parameter in COMMANDS[name].params:
        if parameter.name in LEFT_OUT:
            continue
        if parameter.param_type_name == "argument":
            if draw(st.integers(0, 9)):
                words.append(draw(_values(slow)))
        elif draw(st.integers(0, 9)) < (8 if parameter.name == "out" else 2):
            words.append(draw(st.sampled_from([*parameter.opts, *parameter.secondary_opts])))
            if not getattr(parameter, "is_flag", False):
                words.append(draw(_values(slow)))
    if draw(st.integers(0, 9)) == 0:
        words.insert(draw(st.integers(0, len(words))), draw(st.sampled_from(TEXTS)))
    return words


def _right(words: list[str]) -> None:
    done = run_gyrotc(*words)
    reported = f"{words!r}\n{done.stderr}"
    assert done.returncode in (0, 1, 2), reported
    assert "internal fault" not in done.stderr and "Traceback" not in done.stderr, reported
    if done.returncode == 1:
        command = COMMANDS.get(words[0])
        assert command is None or MAY_FAIL.search(command.help or "") or "failed" in done.stderr, reported


@pytest.mark.parametrize("calls", [200])
def test_any_arguments_end_by_a_known_status(calls: int, place: Path) -> None:
    """Before: `--seed -1`, `--average-s 1e7` and a loop of links ended with 70."""

    @seed(SEED)
    @settings(
        max_examples=calls, deadline=None, database=None, suppress_health_check=list(HealthCheck), print_blob=True
    )
    @given(typed())
    def check(words: list[str]) -> None:
        _right(words)

    check()


@pytest.mark.parametrize("option", ["--out", "--json"])
def test_a_loop_of_links_is_one_message(option: str, place: Path) -> None:
    """Before: exit status 70; the drawn calls found it."""
    words = ("emit", "result") if option == "--out" else ("check", "data")
    done = run_gyrotc(*words, option, "loop")
    assert done.returncode in (0, 2) and "internal fault" not in done.stderr, done.stderr


def test_an_empty_unit_is_one_message(place: Path) -> None:
    """Before: exit status 70; the drawn calls found it."""
    done = run_gyrotc("import", "data/run-01.csv", "--out", "I", "--rate-unit", "", "--dry-run")
    assert done.returncode == 2 and "options, field units.rate: ''" in done.stderr, done.stderr


def _names(count: int) -> list[bytes]:
    names = {text.encode("utf-8", "surrogatepass").replace(b"/", b"|").replace(b"\x00", b"")[:200] for text in TEXTS}
    names |= {b"\xff\xfe", b"a\\b", b"-rf", b"--help", b" ", b"\xe4\xb8", b"a\nb", b"a\x1b[2J", b"%s", b"con", b"nul."}
    return sorted(names - {b"", b".", b".."})[:: max(1, len(names) // count)]


@pytest.mark.parametrize("count", [4])
def test_any_name_of_a_file_ends_by_a_known_status(count: int, place: Path) -> None:
    """Before: `a\\b.csv` and names that are no UTF-8 ended with 70."""
    print(f"seed {SEED}")
    rng = random.Random(SEED)
    content = (place / "data" / "run-01.csv").read_bytes()
    for number, name in enumerate(_names(count)):
        folder = place / f"names-{number}"
        folder.mkdir()
        file = os.fsencode(folder) + b"/" + name + rng.choice([b".csv", b".CSV", b".parquet", b".mat", b""])
        with open(file, "wb") as stream:  # noqa: PTH123 bytes are no Path
            stream.write(content)
        shown = os.fsdecode(file)
        _right(["check", str(folder)])
        _right(["import", shown, "--out", str(folder / "I")])
        (folder / "dataset.toml").write_text(toml(f"file = {_toml_text(Path(shown).name)}"), "utf-8", "replace")
        _right(["fit", str(folder), "--out", str(folder / "R")])


def _toml_text(name: str) -> str:
    escaped = "".join(c if c.isprintable() and c not in '"\\' else f"\\u{ord(c):04x}" for c in name)
    return f'"{escaped}"'


def test_every_command_is_among_them() -> None:
    assert {"check", "build", "import", "verify", "fleet"} <= set(COMMANDS)
