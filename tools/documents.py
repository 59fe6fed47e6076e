"""Documents that run: executes the console blocks of Markdown pages that are marked so, and compares what they print.

A block is marked by its fence: ```` ```console run ````. In it a line that begins with `$ ` is a command of bash (one
that ends in a backslash goes on in the next line), the lines behind it are what it prints; `...` stands for anything,
as a part of a line or, alone in a line, for any lines. The blocks of a page run in order in one folder, a copy of the
sources' tracked files, with gyrotc of the environment on the PATH. A command whose exit status is not 0 is wrong unless
the page says `$? = N` in the line behind its output. `needs: program` in the fence skips a block where it is missing.
A block whose fence is ```` ```c file: lab/main.c ```` (any language) is a file: it is written there.

    python tools/documents.py docs/tutorial.md    runs a page; exit status 1 and the difference if it is wrong
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
_FENCE = re.compile(
    r"^```(?:console run(?: needs: (?P<needs>[\w -]+))?|\w+ file: (?P<file>[\w./-]+))\n(?P<body>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)


@dataclass
class Step:
    """A command of a page with what it prints; or a file, with its text as `text`."""

    command: str
    line: int
    needs: tuple[str, ...]
    output: list[str] = field(default_factory=list)
    status: int = 0
    text: str | None = None


def steps(text: str) -> list[Step]:
    """Every command of the marked blocks, and every file, in order."""
    found: list[Step] = []
    for block in _FENCE.finditer(text):
        line = text[: block.start("body")].count("\n")
        needs = tuple((block["needs"] or "").split())
        if block["file"]:
            found.append(Step(block["file"], line, needs, text=block["body"]))
            continue
        open_line = False
        for content in block["body"].splitlines():
            line += 1
            if open_line:
                found[-1].command += "\n" + content
            elif content.startswith("$ "):
                found.append(Step(content[2:], line, needs))
            elif match := re.fullmatch(r"\$\? = (\d+)", content):
                found[-1].status = int(match[1])
            else:
                found[-1].output.append(content)
            open_line = content.endswith("\\") and (open_line or content.startswith("$ "))
    return found


def agrees(printed: str, wanted: list[str]) -> bool:
    """Whether output is what a page says, `...` standing for anything."""
    parts = [
        r"(?:.*\n)*?" if line.strip() == "..." else ".*?".join(map(re.escape, line.rstrip().split("..."))) + r"[ \t]*\n"
        for line in wanted
    ]
    text = printed if printed.endswith("\n") or not printed else printed + "\n"
    return re.fullmatch("".join(parts), text) is not None


def run(page: Path) -> Iterator[str]:
    """What is wrong with a page: one text for each command that prints or ends otherwise.

    Missing programs are reported as `skipped: ...`.
    """
    with tempfile.TemporaryDirectory() as folder:
        work = _copy(Path(folder))
        environment = os.environ | {
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}", "COLUMNS": "120", "LC_ALL": "C.UTF-8",
        }  # fmt: skip
        for step in steps(page.read_text("utf-8")):
            where = f"{page.name}:{step.line}"
            if step.text is not None:
                (work / step.command).parent.mkdir(parents=True, exist_ok=True)
                (work / step.command).write_text(step.text, "utf-8")
                continue
            missing = [name for name in step.needs if shutil.which(name) is None]
            if missing:
                yield f"skipped: {where} needs {', '.join(missing)}"
                continue
            done = subprocess.run(
                ["bash", "-c", step.command], cwd=work, env=environment, text=True, check=False, timeout=600,
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            )  # fmt: skip
            if done.returncode != step.status:
                yield f"{where}: {step.command}\n  ends with {done.returncode}, not {step.status}:\n{done.stdout}"
            elif not agrees(done.stdout, step.output):
                yield f"{where}: {step.command}\n  prints\n{done.stdout}  and not\n" + "\n".join(step.output)


def _copy(folder: Path) -> Path:
    """The sources' files without results of builds, for commands that write beside them."""
    work = folder / "gyrotc"
    ignored = shutil.ignore_patterns("build", "dist", ".venv", ".git", "__pycache__", ".*_cache", "corpus", "*.png")
    shutil.copytree(ROOT, work, ignore=ignored, symlinks=True)
    return work


def pages() -> list[Path]:
    """Every page of the sources."""
    folders = ("docs", "examples", "libc")
    return sorted([*ROOT.glob("*.md"), *(p for f in folders for p in (ROOT / f).rglob("*.md"))])


def main() -> int:
    """Runs the pages that are named, by default all that have something to run."""
    named = [Path(word).resolve() for word in sys.argv[1:]] or [p for p in pages() if steps(p.read_text("utf-8"))]
    wrong = [text for page in named for text in run(page)]
    print("\n".join(wrong) or f"{len(named)} pages are what they say")
    return 1 if any(not text.startswith("skipped") for text in wrong) else 0


if __name__ == "__main__":
    sys.exit(main())
