"""Make docs/results.md: an overview of the records, and the figures of each that answer a question of a reader."""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from .records import Record, measured_with, read_record, rounded, write_record

_HEAD = """# Results

This page answers how accurate gyrotc is, what its code costs on the target, how often its statements are true, and what
was verified. A figure that misses its aim is marked **(missed)**.

Each record is of the sources of its commit and date, not of later ones; `git diff --stat COMMIT -- gen libc include`
shows what has changed since. A `+` marks changes to that commit that were not committed. The command measures it again,
and the record has all that was measured.

RMS is that of compensated means over 100 s, and the noise floor is the RMS of the noise alone. No recording of a laser
gyro is public: the measured gyros are small MEMS gyros ([real.md](real.md)), and all others are simulated.
"""


@dataclass(frozen=True, slots=True)
class Figure:
    """A number of a table, its format, and its aim: the largest or the smallest value that is good enough."""

    value: float
    form: str = "d"
    at_most: float | None = None
    at_least: float | None = None

    @property
    def is_missed(self) -> bool:
        """True if the aim is not reached."""
        above = self.at_most is not None and self.value > self.at_most
        return above or (self.at_least is not None and self.value < self.at_least)

    @property
    def aim(self) -> str:
        """The aim in words; empty if there is none."""
        if self.at_most == 0:
            return "0"
        form = self.form if self.form.endswith("%") else ",g"
        limits = (("≤", self.at_most), ("≥", self.at_least))
        return " and ".join(f"{sign} {limit:{form}}" for sign, limit in limits if limit is not None)

    def __str__(self) -> str:
        text = format(self.value, self.form)
        return f"**{text}** (missed)" if self.is_missed else text


@dataclass(frozen=True, slots=True)
class Count:
    """So many of so many cases, as a share that may have an aim."""

    hits: int
    of: int
    is_missed: bool = False
    aim: str = ""

    def __str__(self) -> str:
        text = f"{self.hits} of {self.of}"
        return f"**{text}** (missed)" if self.is_missed else text


@dataclass(frozen=True, slots=True)
class ResultsTable:
    """A table of docs/results.md and the sentences above it; columns whose title ends in a blank are numbers.

    Attributes:
        text: Sentences above the table.
        head: Titles of the columns.
        rows: Cells of each row.
    """

    text: str
    head: Sequence[str]
    rows: Sequence[Sequence[object]]

    def markdown(self) -> str:
        """Return sentences and table."""
        rule = ["---:" if title.endswith(" ") else "---" for title in self.head]
        lines = [[title.strip() for title in self.head], rule, *([str(cell) for cell in row] for row in self.rows)]
        return f"{self.text.strip()}\n\n" + "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"

    def missed(self) -> Iterator[str]:
        """Yield the rows that have a figure that misses its aim."""
        for row in self.rows:
            if any(isinstance(cell, Figure | Count) and cell.is_missed for cell in row):
                yield " | ".join(map(str, row))


def figures_table(text: str, figures: Iterable[tuple[str, Figure | Count]]) -> ResultsTable:
    """Return a table with a figure, its value and its aim in each row."""
    return ResultsTable(text, ("figure", "measured ", "aim "), [(what, figure, figure.aim) for what, figure in figures])


def keep(docs: Path, name: str, record: Record) -> None:
    """Write the record of a campaign, with where and when it was measured, and docs/results.md."""
    write_record(docs, name, {"measured": measured_with(), **rounded(record)})
    write(docs)


def write(docs: Path) -> None:
    """Make docs/results.md from all records that there are."""
    from .campaigns import CAMPAIGNS

    sources = {name: (f"make bench ONLY={name}", c.title, f"bench.{name}") for name, c in CAMPAIGNS.items()} | {
        "targets": ("make targets", "Targets compared bit for bit", "tests.targets.targets_page"),
        "prove": ("make prove", "Proofs: all inputs, run-time errors, rounding", "tests.prove.prove_page"),
        "blind": ("make blind", "Blind test: hidden effects of fresh seeds", "tests.blind.both"),
    }
    overview, parts = [], []
    for name, (command, title, module) in sources.items():
        record = read_record(docs, name)
        if record is not None:
            table: ResultsTable = importlib.import_module(module).table(record)
            with_ = record["measured"]
            missed = len(list(table.missed())) or "none"
            kept = f"[{name}](results/{name}.json)"
            place = f"[{title}](#{_anchor(title)})"
            overview.append((place, f"`{command}`", kept, with_["commit"], with_["date"], missed))
            parts.append(f"## {title}\n\n{table.markdown()}")
    head = ("what", "command", "record", "commit", "date", "missed ")
    (docs / "results.md").write_text("\n".join([ResultsTable(_HEAD, head, overview).markdown(), *parts]), "utf-8")


def _anchor(title: str) -> str:
    """Return the anchor that GitHub and mkdocs give a heading."""
    return re.sub(r"[^\w\s-]", "", title.lower()).replace(" ", "-")
