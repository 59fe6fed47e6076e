"""The command on a terminal: quiet and verbose anywhere, completion in a real shell, the cache, what is left to do."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import Command
from gyrotc.cli import _hoisted
from gyrotc.commands.base import time_left
from gyrotc.diagnose.signatures import cache
from recordings import described

PROGRAM = Path(sys.executable).with_name("gyrotc")


def test_options_of_the_whole_program_stand_anywhere() -> None:
    assert _hoisted(["build", "data", "-q", "--out", "x"]) == ["-q", "build", "data", "--out", "x"]
    assert _hoisted(["check", "--", "-q"]) == ["check", "--", "-q"]
    assert _hoisted(["--verbose", "check"]) == ["--verbose", "check"]


def test_quiet_tells_only_what_went_wrong_and_verbose_every_stage(tmp_path: Path, gyrotc: Command) -> None:
    described(tmp_path / "R")
    for where in (("-q", "fit"), ("fit", "--quiet")):
        done = gyrotc(*where, tmp_path / "R", "--out", tmp_path / "out")
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    wrong = gyrotc("check", tmp_path / "none", "-q")
    assert wrong.returncode == 2 and "none" in wrong.stdout
    told = gyrotc("fit", tmp_path / "R", "--out", tmp_path / "out", "-v")
    assert told.returncode == 0 and told.stdout
    lines = told.stderr.splitlines()
    assert lines and all(line.split()[1] == "s" and float(line.split()[0]) >= 0.0 for line in lines)


def test_the_time_left() -> None:
    assert time_left(1, 10, 1.9) == "" and time_left(0, 10, 60.0) == ""
    assert time_left(5, 20, 30.0) == ", 25 %, about 90 s left"
    assert time_left(10, 1000, 60.0) == ", 1 %, about 99 min left"
    assert time_left(1, 1000, 60.0) == ", 0 %, about 16.6 h left"


def test_bash_completes_commands_and_options(tmp_path: Path, gyrotc: Command) -> None:
    script = tmp_path / "gyrotc.bash"
    script.write_text(gyrotc("completion", "bash").stdout)
    for typed, expected in (("ve", "verify"), ("build --lim", "--limits")):
        words = " ".join(f"'{word}'" for word in ("gyrotc", *typed.split()))
        ask = (
            f"source '{script}'; COMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); "
            f"_gyrotc_completion '{PROGRAM}'; echo \"${{COMPREPLY[@]}}\""
        )
        done = subprocess.run(["bash", "-c", ask], capture_output=True, text=True, check=True)
        assert expected in done.stdout.split()
    for shell in ("zsh", "fish"):
        assert "_GYROTC_COMPLETE" in gyrotc("completion", shell).stdout
    assert gyrotc("completion", "csh").returncode == 2


def test_the_cache_is_told_cleared_and_kept_to_a_limit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    cache.set_limit(2500)
    for k in range(4):
        (cache.folder() / f"{k}.bank").write_bytes(bytes(1000))
        os.utime(cache.folder() / f"{k}.bank", (k, k))
    cache.set_limit(2500)
    assert sorted(p.name for p in cache.folder().glob("*.bank")) == ["2.bank", "3.bank"], "the oldest go"
    assert cache.held() == (2, 2000) and cache.limit() == 2500
    told = subprocess.run([PROGRAM, "cache", "--clear"], capture_output=True, text=True, check=True)
    assert "0 banks, 0.000 GB of at most 2.5e-06 GB" in told.stdout and cache.held() == (0, 0)
    (cache.folder() / "limit_bytes").write_text("much")
    assert cache.limit() == 2 * 10**9
