"""`report.html` of a plan: its tables and the temperatures of its runs, from `plan.json`. Computes nothing new."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from .model import write_atomically
from .plan_plots import accuracy_by_hours, separability_matrix, temperatures
from .report import page_environment

__all__ = ["write_plan"]


def write_plan(folder: Path, result: dict[str, Any]) -> Path:
    """Writes `folder/plan.json` and `folder/report.html`; returns the page's path."""
    write_atomically(folder / "plan.json", json.dumps(result, indent=1, allow_nan=False) + "\n")
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
    path = folder / "report.html"
    write_atomically(path, text)
    return path
