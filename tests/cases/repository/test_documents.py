"""The tool that runs the blocks of pages, and what a page says of figures that the code or a command has."""

from __future__ import annotations

import re
import sys
from collections import defaultdict
from pathlib import Path

import pytest
from conftest import require
from gyrotc.cli.main import application
from gyrotc.verify import all_targets
from typer.main import get_command

ROOT = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / "tools"), str(ROOT / "tools" / "check_libc")]

import analysers  # noqa: E402
import documents  # noqa: E402


def test_the_readme_shows_what_make_demo_prints(demo: Path) -> None:
    target = all_targets()["cortex-m4f"]
    require(target.missing())
    printed = (demo / "printed.txt").read_text("utf-8")
    for own, shown in (("data", "build/demo-data"), ("result", "build/demo")):
        printed = printed.replace(str(demo / own), shown)
    block = re.search(r"^\$ make demo\n(.*?)^\$ ", (ROOT / "README.md").read_text("utf-8"), re.M | re.S)
    assert block is not None
    shown = block[1]
    assert documents.agrees(_words(printed), _words(shown).splitlines()), printed


def _words(text: str) -> str:
    """Lines with a word in them, as words with one blank between: widths of columns go with what is installed."""
    lines = (" ".join(line.split()) for line in text.splitlines())
    return "".join(f"{line}\n" for line in lines if re.search(r"\w|\.\.\.", line))


def test_commands_output_and_status_of_a_page() -> None:
    text = "x\n```console run\n$ echo a \\\n  b\na b\n$ false\n$? = 1\n```\n```console\n$ rm -rf /\n```\n"
    first, second = documents.steps(text)
    assert (first.command, first.line, first.output) == ("echo a \\\n  b", 3, ["a b"])
    assert (second.command, second.output, second.status) == ("false", [], 1)


HOW_TO = re.compile(r"  - How to:\n((?:      - .*\n)+)")


def test_every_option_is_typed_where_a_user_needs_it() -> None:
    """On README, the tutorial or a page that says how to do something."""
    listed = HOW_TO.search((ROOT / "docs" / "mkdocs.yml").read_text("utf-8"))
    assert listed is not None
    pages = [ROOT / "README.md", *(ROOT / "docs" / name for name in re.findall(r"[\w-]+\.md", listed[1]))]
    pages.append(ROOT / "docs" / "tutorial.md")
    commands = get_command(application()).commands  # type: ignore[attr-defined]
    typed = [words for page in pages for words in documents.typed(page.read_text("utf-8")) if words[:1] == ["gyrotc"]]
    seen: dict[str, set[str]] = defaultdict(set)
    for words in typed:
        seen[next((word for word in words if word in commands), "")].update(words)
    untyped = {
        (name, option.opts[0])
        for name, command in commands.items()
        for option in command.params
        if option.param_type_name == "option" and option.name != "help" and seen[name].isdisjoint(option.opts)
    }
    assert untyped == set()


def test_the_words_of_every_command_of_a_page() -> None:
    text = "```sh not run: x\ngyrotc emit a \\\n  --out 'b' && ls  # all\n```\ngyrotc fit\n"
    assert list(documents.typed(text)) == [["gyrotc", "emit", "a", "--out", "b"], ["ls"]]


def test_a_block_that_is_not_run_says_why() -> None:
    text = "```sh not run: it takes hours\n$ make blind\n```\n\n1. Do it:\n\n   ```\n   make\n   ```\n"
    assert documents.steps(text) == []
    assert documents.shown(text) == [documents.Shown(1, "sh", "it takes hours"), documents.Shown(7, "", "")]


@pytest.mark.parametrize(
    ("change", "after"),
    [(" a\n+x\n b\n", "a\nx\nb\nc\nb\n"), (" b\n+x\n", None), (" d\n+x\n", None)],
)
def test_a_change_is_put_in_where_its_other_lines_stand_once(change: str, after: str | None) -> None:
    assert documents.changed("a\nb\nc\nb\n", change) == after


@pytest.mark.parametrize(
    ("printed", "wanted", "same"),
    [
        ("a\nb\n", ["a", "b"], True),
        ("a\nb\n", ["a"], False),
        ("a 1.5 s\n", ["a ... s"], True),
        ("a\nx\ny\nb\n", ["a", "...", "b"], True),
        ("a\nb\n", ["a", "...", "b"], True),
        ("a.b\n", ["axb"], False),
        ("", [], True),
        ("a\n", [], False),
    ],
)
def test_three_dots_stand_for_anything(printed: str, wanted: list[str], same: bool) -> None:
    assert documents.agrees(printed, wanted) is same


def test_a_page_that_says_something_else_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(documents, "copy_of_sources", lambda folder: folder)
    page = tmp_path / "page.md"
    page.write_text("```console run\n$ echo a\nb\n$ exit 3\n$ echo c\nc\n```\n")
    wrong = list(documents.run(page, tmp_path))
    assert [text.splitlines()[0] for text in wrong] == ["page.md:2: echo a", "page.md:4: exit 3"]


def test_a_block_that_is_a_file_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(documents, "copy_of_sources", lambda folder: folder)
    page = tmp_path / "page.md"
    file = "```c file: a/main.c\nint x;\n```\n"
    page.write_text("```console run\n$ mkdir a\n```\n" + file + "```console run\n$ cat a/main.c\nint x;\n```\n")
    assert list(documents.run(page, tmp_path)) == []
    page.write_text(file.replace("a/", "b/"))
    assert list(documents.run(page, tmp_path)) == ["page.md:1: there is no folder for b/main.c"]


def test_a_change_of_the_folder_holds_as_for_a_reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(documents, "copy_of_sources", lambda folder: folder)
    page = tmp_path / "page.md"
    page.write_text(
        "```console run\n$ mkdir a && cd a\n$ false\n$? = 1\n```\n```c file: main.c\nint x;\n```\n"
        "```console run\n$ cat main.c\nint x;\n$ cd .. && cat a/main.c\nint x;\n```\n"
    )
    assert list(documents.run(page, tmp_path)) == []


def test_the_table_of_deviations_is_what_the_sources_declare() -> None:
    page = (ROOT / "docs" / "proof.md").read_text("utf-8")
    listed = dict(re.findall(r"^\| (\d+\.\d+) \| (?:advisory|required) \| (.+?) \|", page, re.MULTILINE))
    declared: dict[str, set[str]] = {}
    for deviation in analysers.deviations(ROOT):
        where = f"`{deviation.path.name}`" if deviation.lines else "throughout"
        declared.setdefault(deviation.rule, set()).add(where)
    assert {rule: set(where.split(", ")) for rule, where in listed.items()} == declared
