"""Decide what the recordings of a unit allow to be said of it, before any limit is looked at.

A figure can be within its limit because the map is good, or because the recordings could not show that it is bad: the
chamber stood still, the logger had died, the gyro was beyond its range, or it was switched on once. What is missing
bounds the verdict, whatever the figures are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import binary_dilation

from ..common.arrays import BoolArray
from ..common.metrics import LEAST_SPAN_C, Averages
from ..model import Model
from ..quality.findings import RunFacts
from ..recordings.records import Run
from ..results.evaluation import Requirement
from ..results.release import Verdict
from ..results.rows import RowsCount

LEAST_FREEDOM = 5.0
"""Degrees of freedom below which U is unknown by a third: 1/sqrt(2 freedom), JCGM 100:2008, E.4.3."""

LEAST_POWER_ONS = int(LEAST_FREEDOM) + 1
"""Power-ons of a PASS: the scatter from power-on to power-on then has five degrees of freedom."""

# Share of the trained cells of the envelope that test runs must visit. Cells at the edge of the envelope hold the few
# means at which a chamber overshoots, and another run of the same programme may miss them.
_MIN_VISITED = 0.9

# Share of the rows of the test runs that must be usable for a PASS. The figures are of all rows, and a row of a dead
# logger has no noise: more of them would lower RMS and uncertainty.
_MIN_USABLE = 0.9
# If the usable rows are fewer than the others, the figures are not those of a gyro.
_MIN_TESTABLE = 0.5


def requirements_of(
    model: Model,
    runs: Sequence[Run],
    facts: Sequence[RunFacts],
    test_means: Sequence[Averages],
    test_rows: Sequence[RowsCount],
) -> tuple[Requirement, ...]:
    """Return what a PASS needs of the recordings, and what they allow.

    Args:
        model: The model that is judged.
        runs: All runs that were evaluated.
        facts: Facts of each of them.
        test_means: Means of the usable rows of the test runs; empty if folds or the training runs themselves are
            judged: their temperatures are those that are certified.
        test_rows: Counts of the rows of the test runs.
    """
    requirements = [_rows(facts, test_rows), _power_ons(runs)]
    return (_coverage(model, test_means), *requirements) if test_means else tuple(requirements)


def _coverage(model: Model, test_means: Sequence[Averages]) -> Requirement:
    (low, high), share = model.envelope.temperature_c, _visited(model, test_means)
    temperature = np.concatenate([a.temperature_c for a in test_means])
    t0, t1 = (float(temperature.min()), float(temperature.max())) if temperature.size else (0.0, 0.0)
    text = (
        f"The test runs visit {t0:.1f} to {t1:.1f} C and {share:.0%} of the temperatures and rates of temperature that "
        f"the map was trained on, of {low:.1f} to {high:.1f} C; a PASS needs {_MIN_VISITED:.0%} of these"
    )
    if share >= _MIN_VISITED:
        return Requirement(id="exam_covers_envelope", verdict="PASS", text=text)
    verdict: Verdict = "NOT TESTABLE" if t1 - t0 < LEAST_SPAN_C else "CONDITIONAL PASS"
    advice = f"Record test runs over {low:.1f} to {high:.1f} C at the rates of temperature of the training runs."
    return Requirement(id="exam_covers_envelope", verdict=verdict, text=text, next=advice)


def _visited(model: Model, test_means: Sequence[Averages]) -> float:
    """Return the share of trained cells with a mean of a test run in them or in a neighbour."""
    coverage = model.coverage
    cells = coverage.cells if coverage else (32, 12)
    trained = coverage.trained if coverage else np.ones(cells[::-1], bool)
    visited: BoolArray = np.zeros(trained.shape, dtype=bool)
    for a in test_means:
        if a.time_s.size:
            t = a.temperature_c
            rate = np.gradient(t, a.time_s / 60.0) if t.size > 1 else np.zeros(1)
            row, column = model.envelope.cells_at(cells, t, rate)
            # Means just outside the envelope count at its edge, not farther than the neighbour of a cell.
            near = (np.abs(column - np.clip(column, 0, cells[0] - 1)) <= 1) & (
                np.abs(row - np.clip(row, 0, cells[1] - 1)) <= 1
            )
            visited[np.clip(row[near], 0, cells[1] - 1), np.clip(column[near], 0, cells[0] - 1)] = True
    near_visited = binary_dilation(visited, structure=np.ones((3, 3), dtype=bool))
    return float(np.mean(near_visited[trained])) if trained.any() else 0.0


def _rows(facts: Sequence[RunFacts], test_rows: Sequence[RowsCount]) -> Requirement:
    """Refuse rates that do not come from a gyro at work, and figures of rows that may not be used."""
    reasons = [
        *(f"{f.file}: the rate has one value in all rows" for f in facts if "rate" in f.constant),
        *(
            f"{f.file}: {f.saturated_rows} rows repeat the largest or the smallest rate, the end of a range"
            for f in facts
            if f.saturated_rows
        ),
    ]
    kept, bad = sum(rows.kept for rows in test_rows), sum(rows.bad for rows in test_rows)
    share = kept / (kept + bad) if kept + bad else 1.0
    usable = f"{share:.0%} of the rows of the test runs may be used" if test_rows else ""
    if reasons or share < _MIN_TESTABLE:
        verdict: Verdict = "NOT TESTABLE"
    else:
        verdict = "PASS" if share >= _MIN_USABLE else "CONDITIONAL PASS"
    if share < _MIN_USABLE:
        reasons.append(f"{usable}; a PASS needs {_MIN_USABLE:.0%}")
    if verdict == "PASS":
        text = "No run is constant or cut at the end of a range"
        return Requirement(id="rows", verdict=verdict, text=f"{text}; {usable}" if usable else text)
    return Requirement(
        id="rows",
        verdict=verdict,
        text="; ".join(reasons),
        next="Look at logger, wiring and range of the gyro, and record these runs again.",
    )


def _power_ons(runs: Sequence[Run]) -> Requirement:
    count = power_ons_of(runs)
    text = f"{count} power-on{'s were' if count != 1 else ' was'} recorded; a PASS needs {LEAST_POWER_ONS}"
    if count >= LEAST_POWER_ONS:
        return Requirement(id="power_ons", verdict="PASS", text=text)
    missing = LEAST_POWER_ONS - count
    return Requirement(
        id="power_ons",
        verdict="CONDITIONAL PASS",
        text=f"{text}: fewer do not tell how far the bias differs from one to the next",
        next=f"Record {missing} more run{'s, each' if missing != 1 else ''} after switching the gyro off and on.",
    )


def power_ons_of(runs: Sequence[Run]) -> int:
    """Return how often the gyro was switched on, as far as the recordings tell it.

    Spans of one file share a power-on. So do files whose stated start and power-on agree to within a row.
    """
    stated: list[tuple[float, float]] = []
    files: set[str] = set()
    for run in runs:
        if run.started is not None and run.power_on_s is not None:
            on_s = run.started.timestamp() + run.power_on_s
            if all(abs(on_s - other) > max(period, run.row_period_s) for other, period in stated):
                stated.append((on_s, run.row_period_s))
        else:
            files.add(run.sha256)
    return len(stated) + len(files)
