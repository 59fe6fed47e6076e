"""`python -m gyrotc.paper docs/paper.md`: every table and figure of the page made again."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from ..simulate.campaign import Noise
from .experiment import Experiment, experiment
from .figures import draw
from .page import filled, gyros_table, scatter_table, table_1, times_table

_GYROS = range(1, 11)


def _experiments(noise: Noise) -> list[Experiment]:
    with tempfile.TemporaryDirectory() as folder:
        return [experiment(seed, noise, Path(folder) / "data") for seed in _GYROS]


def main(page: Path) -> None:
    """Writes the tables into `page` and the figures into the folder of the same name beside it."""
    paper, ordinary = _experiments("paper"), _experiments("class")
    parts = {
        "table-1": table_1(paper[0], published=True),
        "table-1-class": table_1(ordinary[0], published=False),
        "gyros": gyros_table({"paper": paper, "class": ordinary}),
        "scatter": scatter_table(paper[0]),
        "times": times_table(paper[0]),
    }
    page.write_text(filled(page.read_text("utf-8"), parts), "utf-8")
    figures = draw(paper[0], page.with_suffix(""))
    print(f"{page} and {len(figures)} figures in {page.with_suffix('')}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
