"""`report.html` of a plan: its tables and the temperatures of its runs, from `plan.json`. Computes nothing new."""

from __future__ import annotations

from pathlib import Path

from ..results.base import read_result
from ..results.planned import Plan
from ..store.files import write_atomically
from ..store.folder import result_folder
from ..store.jsontext import json_text
from .plan_plots import accuracy_by_hours, separability_matrix, temperatures
from .report import page_environment, page_from, write_page

__all__ = ["is_plan", "write_plan", "write_plan_page"]


def is_plan(folder: Path) -> bool:
    """Whether a folder holds a plan (and not a build)."""
    return (folder / "plan.json").is_file() and not (folder / "evaluate.json").exists()


def write_plan(folder: Path, result: Plan) -> Path:
    """Writes `folder/plan.json` and `folder/report.html`; returns the page's path."""
    with result_folder(folder, "plan") as stage:
        write_atomically(stage.folder / "plan.json", json_text(result.content()))
        write_plan_page(stage.folder)
    return folder / "report.html"


def write_plan_page(folder: Path) -> Path:
    """Writes `folder/report.html` from `folder/plan.json`; returns its path.

    Raises:
        InputError: `plan.json` is missing or broken.
    """
    result = read_result(folder / "plan.json", Plan)
    with page_from(folder / "plan.json"):
        text = (
            page_environment()
            .get_template("plan.html.j2")
            .render(
                p=result,
                temperatures=temperatures(result),
                matrix=separability_matrix(result),
                accuracy=accuracy_by_hours(result),
            )
        )
    return write_page(folder, text)
