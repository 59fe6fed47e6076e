"""What a look at the recordings themselves tells, before any model: rows that count twice.

Each finding says what to do next. Findings follow from figures alone, as all of `findings`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from ..dataset import Dataset, SharedRows

__all__ = ["exclude_line", "shared_rows_findings"]

Finding = dict[str, Any]


def exclude_line(from_s: float, to_s: float, reason: str) -> str:
    """A line for the run's entry in dataset.toml, ready to paste."""
    return f'exclude = [{{from_s = {from_s!r}, to_s = {to_s!r}, reason = "{reason}"}}]'


def shared_rows_findings(dataset: Dataset) -> Iterator[Finding]:
    """Rows that several training runs, or several exams, hold, or one run twice: they count twice."""
    for shared in dataset.shared:
        rows = shared.rows[1] - shared.rows[0] + 1
        text = (
            f"Rows {shared.rows[0]} to {shared.rows[1]} of {shared.file} are also rows {shared.other_rows[0]} to "
            f"{shared.other_rows[1]} of {_other(shared)}: {rows} rows count twice. Keep one of them; to leave the "
            f"former out: {exclude_line(*shared.span_s, f'also in {shared.other_file}')}"
        )
        yield {"id": "shared_rows", "text": text, "evidence": asdict(shared)}


def _other(shared: SharedRows) -> str:
    return "the same file" if shared.other_file == shared.file else shared.other_file
