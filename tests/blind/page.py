"""docs/results/blind-SEED.json, one for each run, and the section of docs/results.md made of all of them."""

from __future__ import annotations

import json
import re
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from .effects import FAMILY
from .grade import Row
from .table import markdown, table

__all__ = ["answer_lines", "run_lines", "write_page", "write_section"]

_TITLE = "# Results\n\nFigures that programs wrote; nobody edits them by hand.\n"
_HEAD = """## Hidden effects (`make blind`)

Recordings with an effect that an independent generator hid in them (tests/blind: its own integration, maps,
hysteresis, noise), diagnosed by a process that does not know what it is. k = d / 6, d the matched-filter
signal-to-noise ratio of the effect after the best static map is taken out, under the true noise. Every run
that was started stands here, with what was done of it. Limits: 95 %, binomial (Clopper and Pearson).
"""


def write_page(docs: Path, head: dict[str, Any], rows: Sequence[Row]) -> None:
    """Writes the run's file and the section of the page; everything else on the page stays."""
    told = {"table": table(rows), "named": _confusion(rows)}
    write_section(docs, ("blind", "blind"), head | {"done": len(rows)}, told, _HEAD, _section)


def write_section(
    docs: Path,
    names: tuple[str, str],
    head: dict[str, Any],
    told: dict[str, Any],
    title: str,
    section: Callable[[dict[str, Any]], str],
) -> None:
    """Writes docs/results/NAME-SEED.json, and the section of docs/results.md made of all files of that name.

    Args:
        docs: The folder docs.
        names: Of the files, and of the marks that hold the section on the page.
        head: Seed, records, how many of them are done, code, commit, start of the run.
        told: What is told of it.
        title: Begin of the section.
        section: The text of one run from its file; the newest comes first.
    """
    (name, mark), folder = names, docs / "results"
    folder.mkdir(parents=True, exist_ok=True)
    result = {**head, "written": time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime()), **told}
    own = folder / f"{name}-{head['seed']}.json"
    own.write_text(json.dumps(result, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    runs = [json.loads(p.read_text(encoding="utf-8")) for p in folder.glob(f"{name}-*.json")]
    runs.sort(key=lambda r: str(r["started"]), reverse=True)
    page = docs / "results.md"
    text = page.read_text(encoding="utf-8") if page.exists() else _TITLE
    marks = re.compile(rf"(<!-- {mark} -->\n).*?(<!-- /{mark} -->)", re.DOTALL)
    if not marks.search(text):
        text += f"\n<!-- {mark} -->\n<!-- /{mark} -->\n"
    content = "\n".join([title, *map(section, runs)])
    page.write_text(marks.sub(lambda m: m[1] + content + m[2], text), encoding="utf-8")


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


def answer_lines(answers: dict[str, dict[str, int]], told: str) -> list[str]:
    """The table of what was answered how often, for everything that was hidden."""
    return [
        f"| hidden | recordings | {told} |",
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
