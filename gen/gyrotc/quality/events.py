"""List what happened to the training runs, before any cause is searched for.

Each event has its run, its time and size with 95 % limits where they can be known, what it means, and the `exclude`
line that leaves it out. A step or a burst that is left in looks like several causes.
"""

from __future__ import annotations

from collections.abc import Iterator

from ..recordings.records import Dataset, joined_runs
from ..results.base import Finding
from .curves import curve_findings
from .event_findings import row_findings
from .findings import finding, run_facts
from .judgement import Judged, Judgement, judge


def found_events(dataset: Dataset, judged: Judged | None = None) -> list[Finding]:
    """Return the events of the training runs, those of whole runs first; of such a run nothing else is said.

    Args:
        judged: Judgement of the rows of the runs; None: they are judged here.
    """
    judged = judged or judge(dataset)
    runs = [run for run in joined_runs(dataset.runs) if run.role == "train"]
    facts = [run_facts(run, run.rows()) for run in runs]
    training = {run.file for run in runs}
    of_runs = [found for found in curve_findings(dataset, facts) if found.file in training]
    files = {found.file for found in of_runs}
    return of_runs + [event for run in runs if run.file not in files for event in _events(judged.of(run))]


def _events(judgement: Judgement) -> list[Finding]:
    """Return the events of a run, in order of time."""
    return sorted([*row_findings(judgement), *_gaps(judgement)], key=_at)


def _at(event: Finding) -> float:
    """Return when an event happened."""
    assert event.time_s is not None
    return event.time_s.value


def _gaps(judgement: Judgement) -> Iterator[Finding]:
    """Yield the times without rows, other than those after which the gyro was restarted."""
    run = judgement.run
    restarts = [change for change in judgement.changes if change.restarts]
    for event in judgement.events:
        start, length = event.time_s[0], event.size
        if event.kind == "gap" and not any(change.falls_into(event.time_s) for change in restarts):
            text = f"{run.file} has no rows for {length:g} s from {start:g} s on."
            limits = (start, start, start + run.row_period_s)
            yield finding("dropout", text, run, time_s=limits, size=((length,) * 3, "s"))
