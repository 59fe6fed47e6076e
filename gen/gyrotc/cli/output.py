"""Print results on standard output and errors on standard error, as loud as the user wants."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from ..common.texts import terminal_line, terminal_text


class Loudness:
    """Amount of reporting of this process."""

    quiet = False
    verbose = False


class _Console(Console):
    """Shows text of users as it is: no markup of rich, no names of emoji, nothing that a terminal would obey."""

    def render_str(self, text: str, **options: Any) -> Text:
        return super().render_str(terminal_text(text), **options | {"markup": False, "emoji": False})


_TO_COPY = re.compile(r"\w+ = \[\{.*?\}\]|\S+")

OUT = _Console(width=None if sys.stdout.isatty() else 120)
ERR = _Console(stderr=True)

STANDARD_OUTPUT = Path("-")
"""As the place of JSON: the JSON alone has standard output, and all text goes to standard error."""


def tell(text: str, *, wrong: bool = False) -> None:
    """A line of the result on stdout, with `--json -` on stderr.

    On a terminal it is broken between words; with --quiet only what went wrong is printed.
    """
    if Loudness.quiet and not wrong:
        return
    line = terminal_line(text)
    OUT.print(folded(line, OUT.width) if OUT.is_terminal else line, highlight=False, soft_wrap=True)


def folded(line: str, width: int) -> str:
    """A line in lines of at most so many characters, the further ones indented by two more.

    A word that is longer stays whole, and so does an entry for dataset.toml: both are there to be copied.
    """
    if len(line) <= width:
        return line
    margin = line[: len(line) - len(line.lstrip())]
    lines, at = [margin], len(margin)
    for word in _TO_COPY.findall(line):
        blank = " " if len(lines[-1]) > at else ""
        if blank and len(lines[-1]) + 1 + len(word) > width:
            at = len(margin) + 2
            lines.append(" " * at)
            blank = ""
        lines[-1] += blank + word
    return "\n".join(lines)


def show(table: Table) -> None:
    """A table of the result on stdout (stderr with `--json -`); none with --quiet."""
    if not Loudness.quiet:
        OUT.print(table)


def write_json(path: Path | None, result: dict[str, Any]) -> None:
    from ..results.folder import write_result
    from ..results.json_text import json_text

    if path == STANDARD_OUTPUT:
        print(json_text(result), end="")
    elif path is not None:
        write_result(path, json_text(result))
