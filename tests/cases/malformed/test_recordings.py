"""Recordings and descriptions that are refused: the place in the message, and the edit that goes on."""

from __future__ import annotations

from pathlib import Path

import pytest
from conftest import run_gyrotc
from refused_recordings import EDITS, REFUSED


@pytest.mark.parametrize("case", REFUSED)
def test_a_wrong_recording_or_description_is_refused_by_every_command(case: str, tmp_path: Path) -> None:
    """`check` reports it with other problems; `fit` and `build` say it in one line and write nothing."""
    refused = REFUSED[case]
    folder = tmp_path / refused.folder
    refused.make(folder)
    before = sorted(tmp_path.rglob("*"))
    checked = run_gyrotc("check", folder)
    problems = [line for line in checked.stdout.splitlines() if line.startswith("problem: ")]
    assert checked.returncode == 2
    assert any(all(part in line for part in refused.message) for line in problems), checked.stdout
    for command in ("fit", "build"):
        done = run_gyrotc(command, folder, "--out", tmp_path / "out")
        assert done.returncode == 2, done.stdout
        assert all(part in done.stderr for part in refused.message), done.stderr
        assert done.stderr.count("\n") == 1, done.stderr
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("case", EDITS)
def test_the_edit_for_which_a_message_asks_goes_on(case: str, tmp_path: Path) -> None:
    refused, (text, replacement) = REFUSED[case], EDITS[case]
    folder = tmp_path / refused.folder
    refused.make(folder)
    file = folder / "dataset.toml"
    before = file.read_text("utf-8") if text else ""
    assert text in before
    file.write_text(before.replace(text, replacement, 1) if text else replacement, "utf-8")
    done = run_gyrotc("check", folder)
    assert done.returncode == 0, done.stdout + done.stderr
