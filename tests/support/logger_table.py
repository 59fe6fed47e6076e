"""The table of docs/import.md, every file that the tests import: `python tests/support/logger_table.py` makes it."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from logger_analysis import ANALYSIS_CASES
from logger_binaries import BINARY_CASES
from logger_files import CSV_CASES, Case
from logger_foreign import FOREIGN

PAGE = Path(__file__).resolve().parents[2] / "docs" / "import.md"
_MARKS = re.compile(r"(<!-- files -->\n).*?(<!-- /files -->)", re.DOTALL)


def table() -> str:
    """The table as text."""
    rows = "\n".join(f"| {k} | {_cell(case.id)} | {_command(case)} |" for k, case in enumerate(cases(), start=1))
    return f"| | file | command, with `--out RLG-1` |\n| ---: | --- | --- |\n{rows}\n"


def cases() -> list[Case]:
    """Every file, in the order of the table."""
    return [*CSV_CASES, *FOREIGN, *BINARY_CASES, *ANALYSIS_CASES]


def filled(page: str) -> str:
    """A page with the table between its marks."""
    return _MARKS.sub(lambda marks: marks[1] + table() + marks[2], page)


def _command(case: Case) -> str:
    return f"`{_cell(shlex.join(['gyrotc', 'import', case.file, *case.options]))}`"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


if __name__ == "__main__":
    PAGE.write_text(filled(PAGE.read_text("utf-8")), "utf-8")
