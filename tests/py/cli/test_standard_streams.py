"""What a shell may do to a command: streams that are closed, links in a loop, a format that there is not."""

from __future__ import annotations

import inspect
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import Command
from gyrotc.cli import base
from gyrotc.cli.main import application
from recordings import described


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


def test_every_command_writes_its_json_by_the_same_function() -> None:
    commands = [c.callback for c in application().registered_commands if c.callback]
    found = {c.__name__ for c in commands if "json_file" in inspect.signature(c).parameters}
    assert {"build", "check", "compare", "diagnose", "emit", "fit", "fleet", "plan", "verify"} <= found
    for command in commands:
        parameter = inspect.signature(command, eval_str=True).parameters.get("json_file")
        assert parameter is None or parameter.annotation == base.JsonOption, command.__name__


def test_help_of_the_package_begins_with_commands_that_there_are() -> None:
    import gyrotc

    lines = re.findall(r"^    gyrotc (\S+) ", str(gyrotc.__doc__), re.MULTILINE)
    assert len(lines) >= 5 and str(gyrotc.__doc__).index("    gyrotc ") < 300
    commands = {str(info.name or getattr(info.callback, "__name__", "")) for info in application().registered_commands}
    commands |= {name.replace("_", "-") for name in commands}
    assert set(lines) <= commands
