"""Texts that mean something to shells, terminals, pages or file systems, in files that a user writes.

Each file is refused in one line, or taken; what is printed and written obeys the text in neither case.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from conftest import Command
from gyrotc.assess import load_limits
from gyrotc.common import InputError, toml_value
from gyrotc.recordings import load

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


LONG = "x" * 5000
LONG_TEXTS = {
    "a name in dataset.toml": DATA + f"{LONG} = 1\n",
    "a serial": DATA.replace('"G1"', f'"{LONG}"'),
    "the role of a run": DATA + f'role = "{LONG}"\n',
    "a channel of a run": DATA + f'"{LONG}" = "y"\n',
    "a training method": DATA + f'[fit]\nmethod = "{LONG}"\n',
    "a training option": DATA + f"[fit]\n{LONG} = 1\n",
    "a unit": DATA + f'[units]\nrate = "{LONG}"\n',
    "a latitude": DATA + f'latitude_deg = "{LONG}"\n',
    "a day of calibration": DATA + f'[meta]\ncalibrated_on = "{LONG}"\n',
}


@pytest.mark.parametrize("what", LONG_TEXTS)
def test_a_refusal_shows_only_the_beginning_of_a_long_text(what: str, tmp_path: Path) -> None:
    """A message has at most a few lines of a terminal, and names the field."""
    (tmp_path / "dataset.toml").write_text(LONG_TEXTS[what], "utf-8")
    (tmp_path / "a.csv").write_text("time_s,temperature_c,rate_dph\n0,20,1\n10,20,1\n")
    with pytest.raises(InputError) as refused:
        load(tmp_path)
    assert len(str(refused.value).replace(str(tmp_path), "")) < 600
    assert all(len(line) < 400 for line in str(refused.value).splitlines())


WRONG_LIMITS = {
    'schema = "1"\n': "field schema: '1'; expected 1",
    "at_most = 3\n": "field schema: is missing; expected schema = 1",
    "schema = 1\nat_most = 3\n": "field at_most: 3; expected a table of names and values",
    'schema = 1\n[at_most]\nrms_dph = "x"\n': "field at_most.rms_dph: 'x'; expected a number",
    "schema = 1\n[at_most]\nrms_dph = [1.0]\n": "field at_most.rms_dph: a list; expected a number",
    'schema = 1\n[needs]\ntargets = "avr"\n': "field needs.targets: 'avr'; expected a list",
    "schema = 1\nproduct = 3\n": "field product: 3; expected a text",
}


@pytest.mark.parametrize("text", WRONG_LIMITS)
def test_a_wrong_field_of_limits_is_refused_in_words_of_the_file(text: str, tmp_path: Path) -> None:
    path = tmp_path / "limits.toml"
    path.write_text(text, "utf-8")
    with pytest.raises(InputError) as refused:
        load_limits(path)
    assert str(refused.value) == f"{path}, {WRONG_LIMITS[text]}"
