"""`python -m gyrotc.paper docs`: every table and figure of docs/paper.md made again, and the run in simulation.md."""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from ..outputs import write_atomically
from ..simulate import read
from ..simulate.campaign import Noise, campaign, with_noise
from .experiment import Experiment, experiment
from .figures import draw, draw_run
from .page import filled, gyros_table, scatter_table, table_1, times_table

_GYROS = range(1, 11)
_RUN = "5 C/min"


def _experiments(noise: Noise) -> list[Experiment]:
    with tempfile.TemporaryDirectory() as folder:
        return [experiment(seed, noise, Path(folder) / "data") for seed in _GYROS]


def _measured(bench: Path) -> list[dict[str, Any]]:
    """Running times of whole methods that `make bench` has left; none where it was never run."""
    if not bench.exists():
        return []
    tables = json.loads(bench.read_text("utf-8"))["speed"]["learning"]
    return next(table["rows"] for table in tables if table["scenario"] == "paper")


def _write_paper(page: Path) -> None:
    paper, ordinary = _experiments("paper"), _experiments("class")
    parts = {
        "table-1": table_1(paper[0], published=True),
        "table-1-class": table_1(ordinary[0], published=False),
        "gyros": gyros_table({"paper": paper, "class": ordinary}),
        "scatter": scatter_table(paper[0]),
        "times": times_table(_measured(page.parent / "results" / "bench.json")),
    }
    write_atomically(page, filled(page.read_text("utf-8"), parts))
    draw(paper[0], page.with_suffix(""))


def main(docs: Path) -> None:
    """Writes tables into `docs/paper.md`, figures into `docs/paper/`, one run into `docs/simulation/`."""
    _write_paper(docs / "paper.md")
    plan = with_noise(read("paper-5C-min")[1], "paper")
    run = next(iter(campaign(plan, _GYROS[0])))
    draw_run(run, f"Chamber at {_RUN}", docs / "simulation" / "run.svg")
    print(f"{docs / 'paper.md'} and the figures beside it")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
