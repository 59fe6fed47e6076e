"""docs/results.md: one table for each record, with the command that makes it again."""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from .records import Record, measured_with, read_record, rounded, write_record

_HEAD = """# Results

Each table is made from one record in [results/](results), by the command in its heading. A figure that does not reach
its aim is marked as missed.
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
class ResultsTable:
    """A table of docs/results.md and the sentences above it; columns whose title ends in a blank are numbers."""

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
            if any(isinstance(cell, Figure) and cell.is_missed for cell in row):
                yield " | ".join(map(str, row))


def figures_table(text: str, figures: Iterable[tuple[str, Figure]]) -> ResultsTable:
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
        "targets": ("make targets", "Every target, bit for bit", "tests.targets.targets_page"),
        "prove": ("make prove", "Every input, run-time errors, rounding", "tests.prove.prove_page"),
        "blind": ("make blind", "Hidden effects of fresh seeds, found and named", "tests.blind.both"),
    }
    parts = [_HEAD]
    for name, (command, title, module) in sources.items():
        record = read_record(docs, name)
        if record is not None:
            table: ResultsTable = importlib.import_module(module).table(record)
            with_ = record["measured"]
            made = f"Measured on {with_['commit']}, {with_['date']}; {with_['machine']}."
            parts.append(f"## {title} (`{command}`)\n\n{table.markdown()}\n{made}\n")
    (docs / "results.md").write_text("\n".join(parts), "utf-8")
