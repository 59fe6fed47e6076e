"""docs/results/blind-SEED.json, one for each run, and the section of docs/results.md made of all of them."""

from __future__ import annotations

import json
import re
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .effects import FAMILY
from .grade import Row
from .table import markdown, table

__all__ = ["write_page"]

_MARKS = re.compile(r"(<!-- blind -->\n).*?(<!-- /blind -->)", re.DOTALL)
_EMPTY = "\n<!-- blind -->\n<!-- /blind -->\n"
_TITLE = "# Results\n\nFigures that programs wrote; nobody edits them by hand.\n"
_HEAD = """## Hidden effects (`make blind`)

Recordings with an effect that an independent generator hid in them (tests/blind: its own integration, maps,
hysteresis, noise), diagnosed by a process that does not know what it is. k = d / 6, d the matched-filter
signal-to-noise ratio of the effect after the best static map is taken out, under the true noise. Every run
that was started stands here, with what was done of it. Limits: 95 %, binomial (Clopper and Pearson).
"""


def write_page(docs: Path, head: dict[str, Any], rows: Sequence[Row]) -> None:
    """Writes the run's file and the section of the page; everything else on the page stays."""
    folder = docs / "results"
    folder.mkdir(parents=True, exist_ok=True)
    result = {
        **head,
        "done": len(rows),
        "written": time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime()),
        "table": table(rows),
        "named": _confusion(rows),
    }
    own = folder / f"blind-{head['seed']}.json"
    own.write_text(json.dumps(result, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    runs = [json.loads(p.read_text(encoding="utf-8")) for p in folder.glob("blind-*.json")]
    runs.sort(key=lambda r: str(r["started"]), reverse=True)
    page = docs / "results.md"
    text = page.read_text(encoding="utf-8") if page.exists() else _TITLE
    if not _MARKS.search(text):
        text += _EMPTY
    section = "\n".join([_HEAD, *(_section(r) for r in runs)])
    page.write_text(_MARKS.sub(lambda m: m[1] + section + m[2], text), encoding="utf-8")


def _section(run: dict[str, Any]) -> str:
    ended = "complete" if run["done"] >= run["records"] else f"stopped of {run['records']}"
    lines = [
        f"### Seed {run['seed']}: {run['done']} recordings, {ended}",
        "",
        f"Started {run['started']}, written {run['written']}, commit {run['commit']}, code {run['code']}.",
        "",
        markdown(run["table"]),
        "",
        "What was named, of recordings with one cause at k ≥ 1.7 and of foreign effects:",
        "",
        "| hidden | recordings | named |",
        "| --- | --- | --- |",
    ]
    lines += [
        f"| {name} | {sum(found.values())} | {', '.join(f'{k} {v}' for k, v in found.items())} |"
        for name, found in run["named"].items()
    ]
    return "\n".join([*lines, "", ""])


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
