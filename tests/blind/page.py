"""The section of docs/results.md on blind runs: every run that was started."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from results import recorded, write

from .effects import FAMILY
from .grade import Row
from .table import markdown, table

_HEAD = """## Hidden effects (`make blind`)

Recordings with an effect that an independent generator hid in them (tests/blind: its own integration, maps,
hysteresis, noise), diagnosed by a process that does not know what it is. k = d / 6, d the matched-filter
signal-to-noise ratio of the effect after the best static map is taken out, under the true noise. Every run
that was started stands here, with what was done of it. Limits: 95 %, binomial (Clopper and Pearson).
"""


def write_page(docs: Path, head: dict[str, Any], rows: Sequence[Row]) -> None:
    """Writes the run's file and the section of the page; everything else on the page stays."""
    reported = {"table": table(rows), "named": _confusion(rows)}
    write_section(docs, "blind", head | {"done": len(rows)}, reported, section)


def write_section(
    docs: Path,
    name: str,
    head: dict[str, Any],
    reported: dict[str, Any],
    section: Callable[[dict[str, Any]], str],
) -> None:
    """Keeps the run, and makes the section of docs/results.md of all runs of that name.

    Args:
        docs: The folder docs.
        name: Of the record, and of the marks that hold the section on the page.
        head: Seed, records, how many of them are done, code, commit, start of the run.
        reported: What the page states of the campaign.
        section: Its text, from all runs, the newest first.
    """
    result = {**head, "written": time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime()), **reported}
    before = (recorded(docs, name) or {"runs": []})["runs"]
    runs = [result, *(run for run in before if run["seed"] != head["seed"])]
    runs.sort(key=lambda run: str(run["started"]), reverse=True)
    write(docs, name, {"runs": runs}, section)


def section(record: dict[str, Any]) -> str:
    """The section as text."""
    return "\n".join([_HEAD, *map(_section, record["runs"])])


def _section(run: dict[str, Any]) -> str:
    lead = "What was named, of recordings with one cause at k ≥ 1.7 and of foreign effects:"
    return "\n".join([*run_lines(run), lead, "", *answer_lines(run["named"], "named"), "", ""])


def run_lines(run: dict[str, Any], world: str = "") -> list[str]:
    """Which run it was, and its table."""
    ended = "complete" if run["done"] >= run["records"] else f"stopped of {run['records']}"
    name = f"{world}, seed" if world else "Seed"
    return [
        f"### {name} {run['seed']}: {run['done']} recordings, {ended}",
        "",
        f"Started {run['started']}, written {run['written']}, commit {run['commit']}, code {run['code']}.",
        "",
        markdown(run["table"]),
        "",
    ]


def answer_lines(answers: dict[str, dict[str, int]], reported: str) -> list[str]:
    """The table of what was answered how often, for everything that was hidden."""
    return [
        f"| hidden | recordings | {reported} |",
        "| --- | --- | --- |",
        *(
            f"| {name} | {sum(found.values())} | {', '.join(f'{k} {v}' for k, v in found.items())} |"
            for name, found in answers.items()
        ),
    ]


def _confusion(rows: Sequence[Row]) -> dict[str, dict[str, int]]:
    """For every hidden effect, how often which answer was given, the commonest first."""
    found: dict[str, Counter[str]] = {}
    for row in rows:
        if row["stratum"] not in ("one", "foreign") or (row["stratum"] == "one" and row["k"][0] < 1.7):
            continue
        answer = " + ".join(row["named"]) or row["verdict"]
        found.setdefault(row["truth"][0], Counter())[answer] += 1
    order = [*FAMILY, *sorted(set(found) - set(FAMILY))]
    return {name: dict(found[name].most_common()) for name in order if name in found}
