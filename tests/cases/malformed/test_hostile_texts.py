"""Texts that mean something to shells, terminals, pages or file systems, in files that a user writes.

Each file is refused in one line, or taken; what is printed and written obeys the text in neither case.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from conftest import Command
from gyrotc.common import toml_value

TEXTS = {
    "path": "../../../outside",
    "root": "/outside",
    "comment of C": "*/ int outside; /*",
    "page": "<script>alert(1)</script>",
    "terminal": "a\x1b[2J\x1b]0;outside\x07",
    "lines": "a\ngyrotc: all is well",
    "right to left": "\u202etxt.exe",
    "markup": "[red]a[/red] :smile:",
    "long": "x" * 5000,
    "nothing": "",
}
DATA = 'schema = 1\nserial = "G1"\n[[run]]\nfile = "a.csv"\n'
FILES = {
    "datasets of a fleet": ("fleet", "schema = 1\ndatasets = [{0}]\n"),
    "axes of a fleet": ("fleet", 'schema = 1\ndatasets = ["gyros/*"]\naxes = [{0}]\n'),
    "release of a fleet": ("fleet", 'schema = 1\ndatasets = ["gyros/*"]\n[release]\n{0} = {0}\n'),
    "product of limits": ("limits", "schema = 1\nproduct = {0}\n"),
    "finding of limits": ("limits", "schema = 1\n[needs]\nno_findings = [{0}]\n"),
    "target of limits": ("limits", "schema = 1\n[needs]\ntargets = [{0}]\n"),
    "guard of limits": ("limits", "schema = 1\n[guards.{0}]\nlow = 1.0\nhigh = 2.0\n"),
    "title of a scenario": ("scenario", "title = {0}\n[[set]]\nprofiles = []\n"),
    "base of a scenario": ("scenario", "extends = {0}\n"),
    "cause of a scenario": ("scenario", 'extends = "paper"\n[[cause]]\nid = {0}\n'),
    "profile of a scenario": ("scenario", 'extends = "paper"\n[[set]]\nrole = "train"\nprofiles = [{0}]\n'),
}
CASES = [(file, text) for file in FILES for text in TEXTS]
COMMANDS = {
    "fleet": ("fleet", "file.toml", "--out", "out"),
    "limits": ("build", "data", "--limits", "file.toml", "--out", "out"),
    "scenario": ("simulate", "file.toml", "--out", "out"),
}


def files_in(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}


@pytest.mark.usefixtures("in_this_process")
@pytest.mark.parametrize(("file", "text"), CASES)
def test_a_text_is_refused_in_one_line_or_obeyed_by_nothing(
    file: str, text: str, tmp_path: Path, gyrotc: Command
) -> None:
    command, content = FILES[file]
    here = tmp_path / "one" / "two" / "here"
    for folder in ("data", "gyros/G1"):  # without rows: whatever the file is, there is little to do
        (here / folder).mkdir(parents=True)
        (here / folder / "dataset.toml").write_text(DATA)
        (here / folder / "a.csv").write_text("time_s,temperature_c,rate_dph\n")
    (here / "file.toml").write_text(content.format(toml_value(TEXTS[text])), "utf-8")
    before = files_in(tmp_path)
    done = gyrotc(*COMMANDS[command], cwd=here)
    assert done.returncode in (1, 2), done.stdout
    assert done.returncode == 1 or done.stderr.count("\n") == 1, done.stderr
    said = done.stdout + done.stderr
    assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u202e]|\ngyrotc: all", said), said
    written = files_in(tmp_path) - before
    assert all(name.startswith("one/two/here/out") for name in written), written
    assert done.returncode == 1 or not any(name.endswith(".json") for name in written)
    for page in here.glob("out/*.html"):
        assert "<script>alert" not in page.read_text("utf-8")
