"""Run the blocks of Markdown pages as a reader would, and compare what the commands print with the page.

What is done with a block stands behind the language of its fence:

- ```` ```console run ````: a line that begins with `$ ` is a command of bash (one that ends in a backslash goes on in
  the next line), the lines behind it are what it prints; `...` stands for anything, as a part of a line or, alone in a
  line, for any lines. A command whose exit status is not 0 is wrong unless the page says `$? = N` behind its output.
- ```` ```c file: lab/main.c ```` (any language): the block is that file; its folder has to be there.
- ```` ```diff file: gen/a.py ````: the block is a change of that file. The file must contain the lines without `+`
  exactly once and without others between them.
- ```` ```sh not run: REASON ```` (any language): the block is only shown.

The blocks of a page run in order, from a copy of the sources with `.venv` in it; a `cd` holds for the commands and
files behind it, as it does for a reader. `gyrotc` and `import gyrotc` are those of the copy, so that a page may add to
the package.

    python tools/documents.py docs/tutorial.md    runs a page; exit status 1 and the difference if it is wrong
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import textwrap
import venv
from collections.abc import Iterator
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
_FENCE = re.compile(
    r"^(?P<indent> *)```(?P<language>\w*)(?P<words>[^\n`]*)\n(?P<body>.*?)^(?P=indent)```$", re.MULTILINE | re.DOTALL
)
_GYROTC = """#!{python}
from gyrotc.cli.main import main
if __name__ == "__main__":  # a fleet starts processes that import this
    main()
"""


@dataclass
class Step:
    """A command of a page with what it prints; or a file, with its text; or a change of a file."""

    command: str
    line: int
    output: list[str] = field(default_factory=list)
    status: int = 0
    text: str | None = None
    changes: bool = False


@dataclass(frozen=True)
class Shown:
    """A block that is not run: the line of its fence, its language, and the reason, empty if the page has none."""

    line: int
    language: str
    reason: str


def steps(text: str) -> list[Step]:
    """Return every command of the marked blocks, every file and every change of one, in order."""
    found: list[Step] = []
    for block in _FENCE.finditer(text):
        line, words = text[: block.start("body")].count("\n"), block["words"].strip()
        body = textwrap.dedent(block["body"])
        if words.startswith("file: "):
            found.append(Step(words[6:], line, text=body, changes=block["language"] == "diff"))
        elif words == "run":
            found += _commands(body, line)
    return found


def shown(text: str) -> list[Shown]:
    """Return the blocks of a page that are not run."""
    blocks = [(text[: b.start("body")].count("\n"), b["language"], b["words"].strip()) for b in _FENCE.finditer(text)]
    return [
        Shown(line, language, words.removeprefix("not run:").strip() if words.startswith("not run:") else "")
        for line, language, words in blocks
        if not words.startswith("file: ") and words != "run"
    ]


def typed(text: str) -> Iterator[list[str]]:
    """Yield the words of each command in the blocks of a page, run or only shown, without prompt and quotes.

    Lines that a command prints are not told from commands.
    """
    for block in _FENCE.finditer(text):
        for line in block["body"].replace("\\\n", " ").splitlines():
            for part in re.split(r"&&|[;|]", line.strip().removeprefix("$ ").partition(" #")[0]):
                yield part.replace('"', "").replace("'", "").split()


def _commands(body: str, line: int) -> list[Step]:
    found: list[Step] = []
    open_line = False
    for content in body.splitlines():
        line += 1
        if open_line:
            found[-1].command += "\n" + content
        elif content.startswith("$ "):
            found.append(Step(content[2:], line))
        elif match := re.fullmatch(r"\$\? = (\d+)", content):
            found[-1].status = int(match[1])
        else:
            found[-1].output.append(content)
        open_line = content.endswith("\\") and (open_line or content.startswith("$ "))
    return found


def agrees(printed: str, wanted: list[str]) -> bool:
    """Test whether output is what a page says, `...` standing for anything."""
    parts = [
        r"(?:.*\n)*?" if line.strip() == "..." else ".*?".join(map(re.escape, line.rstrip().split("..."))) + r"[ \t]*\n"
        for line in wanted
    ]
    text = printed if printed.endswith("\n") or not printed else printed + "\n"
    return re.fullmatch("".join(parts), text) is not None


def changed(text: str, change: str) -> str | None:
    """Put the `+` lines of a change into a text; None if the text does not contain the other lines exactly once."""
    lines = change.splitlines(keepends=True)
    before = "".join(line[1:] for line in lines if not line.startswith("+"))
    return text.replace(before, "".join(line[1:] for line in lines)) if text.count(before) == 1 else None


def run(page: Path, folder: Path) -> Iterator[str]:
    """Run a page in `folder`/gyrotc, a copy of the sources; yield a text for each step that is not as the page says."""
    work = copy_of_sources(folder)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")} | {
        "PATH": f"{work / '.venv' / 'bin'}:{Path(sys.executable).parent}:{os.environ['PATH']}",
        "COLUMNS": "120", "LC_ALL": "C.UTF-8",
    }  # fmt: skip
    here, left_in = work, folder / "left_in"
    for step in steps(page.read_text("utf-8")):
        where = f"{page.name}:{step.line}"
        if step.text is not None:
            path = here / step.command
            if not path.parent.is_dir():
                yield f"{where}: there is no folder for {step.command}"
                continue
            text = changed(path.read_text("utf-8"), step.text) if step.changes else step.text
            if text is None:
                yield f"{where}: the lines around the change are not, or not once, in {step.command}"
                continue
            path.write_text(text, "utf-8")
            continue
        done = subprocess.run(
            ["bash", "-c", f"trap 'pwd >\"$0\"' EXIT\n{step.command}", left_in], cwd=here, env=environment, text=True,
            check=False, timeout=600, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        here = Path(left_in.read_text("utf-8").strip())
        if done.returncode != step.status:
            yield f"{where}: {step.command}\n  ends with {done.returncode}, not {step.status}:\n{done.stdout}"
        elif not agrees(done.stdout, step.output):
            yield f"{where}: {step.command}\n  prints\n{done.stdout}  and not\n" + "\n".join(step.output)


def copy_of_sources(folder: Path) -> Path:
    """Return `folder`/gyrotc: the sources without results of builds, with a `.venv` whose gyrotc they are.

    Whatever else is installed is found where it is. An editable installation finds its modules by a line of a `.pth`
    file, which Python does not read in folders that another such file names.
    """
    work = folder / "gyrotc"
    ignored = shutil.ignore_patterns("build", "dist", ".venv", ".git", ".*_cache", "corpus", "*.png")
    shutil.copytree(ROOT, work, ignore=ignored, symlinks=True)
    core = find_spec("gyrotc._core")
    assert core is not None and core.origin is not None, "the C++ core is not built: tools/setup.sh"
    shutil.copy(core.origin, work / "gen" / "gyrotc")
    venv.create(work / ".venv", symlinks=True)
    (own,) = (work / ".venv").glob("lib/python*/site-packages")
    (own / "gyrotc.pth").write_text(f"{work / 'gen'}\n{sysconfig.get_path('platlib')}\n", "utf-8")
    command = work / ".venv" / "bin" / "gyrotc"
    command.write_text(_GYROTC.format(python=command.with_name("python")), "utf-8")
    command.chmod(0o755)
    return work


def pages() -> list[Path]:
    """Return every page of the sources."""
    folders = ("docs", "examples", "libc")
    return sorted([*ROOT.glob("*.md"), *(p for f in folders for p in (ROOT / f).rglob("*.md"))])


def main() -> int:
    """Run the pages that are named, by default all that have something to run; list what is only shown of them."""
    named = [Path(word).resolve() for word in sys.argv[1:]] or [p for p in pages() if steps(p.read_text("utf-8"))]
    wrong = []
    for page in named:
        for one in shown(page.read_text("utf-8")):
            print(f"{page.name}:{one.line}: {one.language} block is not run: {one.reason or 'no reason is given'}")
        with tempfile.TemporaryDirectory() as folder:
            wrong += list(run(page, Path(folder)))
    print("\n".join(wrong) or f"{len(named)} pages are what they say")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
