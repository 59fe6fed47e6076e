"""`report.html` of a diagnosis and its pictures, from `diagnose.json` and `series.json` alone.

`draw` gives all pictures of a diagnosis by name, each one `<svg>` element.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from markupsafe import Markup

from ..common.arrays import FloatArray
from ..common.metrics import HALF_HOUR_S
from ..common.statistics import CHI2_95_ONE, running_mean
from ..results.base import Finding, read_optional, read_result
from ..results.diagnosed import (
    ComparedStatistic,
    Diagnosed,
    DiagnosisSeries,
    GainOnUnseen,
    NamedCause,
    ParameterLikelihood,
    RunSeries,
    ScoredRun,
    SearchScores,
    SeriesValues,
    Statistic,
)
from .chart import AFTER, BEFORE, COVERED, HALF, Panel, drawing
from .display import words
from .report import page_environment, page_from, sorted_by_rate, write_page

PICTURES, SERIES = "pictures", "series.json"


def is_diagnosis(folder: Path) -> bool:
    """Test whether a folder holds a diagnosis (and not a build)."""
    return (folder / "diagnose.json").is_file() and not (folder / "evaluate.json").exists()


def write_diagnosis_page(folder: Path) -> Path:
    """Write `folder/report.html` from what stands in the folder, and return its path.

    Raises:
        InputError: `diagnose.json` is missing, or it or `series.json` is broken or of another kind.
    """
    result = read_result(folder / "diagnose.json", Diagnosed)
    series = read_optional(folder / SERIES, DiagnosisSeries)
    with page_from(folder / "diagnose.json"):
        text = (
            page_environment()
            .get_template("diagnosis.html.j2")
            .render(
                d=result,
                physical=result.physical,
                noise=result.noise,
                gains=list(_gains(result)),
                limits=[c for c in result.considered if c.detection_limit],
                pictures=diagnosis_pictures(result, series) if series is not None else {},
            )
        )
    return write_page(folder, text)


def _gains(result: Diagnosed) -> list[tuple[str, GainOnUnseen]]:
    """Gain of the whole extension where it is shipped, else of every cause, by where it was measured."""
    seen = "test runs" if result.measured_on == "exam" else "parts left out in turn, causes chosen anew"
    extended = result.extended
    if extended is None:
        return [(f"{seen}: {c.name[0].lower()}{c.name[1:]}", c.gain) for c in result.causes if c.gain]
    rows = [(seen, extended.gain)]
    if extended.rate_left_out:
        rows.append((f"“{extended.rate_left_out.environment}” left out", extended.rate_left_out))
    if extended.forward_in_time:
        rows.append(("forward in time", extended.forward_in_time))
    return rows


_SIGNATURE_MEANS = 16  # dots of the picture of residual against signature
_LEAST_SHOWN = 20  # blocks at a kind of rate: fewer give no mean to speak of
_SHOWN = -40.0  # of 2 log likelihood below its top: ten times the fall at 95 %, more would flatten it
_LINEAR = 20.0  # -ln p up to which the axis is linear, so that what was not found is seen
_MOST_PANELS = 6  # runs with events that are drawn


def diagnosis_pictures(result: Diagnosed, series: DiagnosisSeries) -> dict[str, Markup]:
    """All pictures of a diagnosis by name."""
    cycle = result.single_cycle is not None
    width = max(round(HALF_HOUR_S / series.block_s), 1)
    made: dict[str, Markup | None] = {
        "signature": None if cycle else _against_signature(series.runs),
        "residual": _cycle_over_time(series.runs) if cycle else _residual_over_time(series.runs, width),
        "statistics": _statistics(result.discrepancies),
        "inputs": None if cycle else _over_inputs(series.runs, width),
        "posterior": _posterior(result.physical),
        "considered": _considered(series.scores),
        "events": _events(series.runs, result.events),
    }
    for number, likelihood in enumerate(series.likelihoods):
        made[f"likelihood-{number + 1}"] = _likelihood(likelihood) if likelihood is not None else None
    if series.scored:
        made["before-and-after"] = _before_and_after(series.scored, series.average_s)
    return {name: picture for name, picture in made.items() if picture is not None}


def _panels(count: int, x: str, y: str) -> list[Panel]:
    """Panels of runs in rows of three, with words at the left ones only."""
    columns = min(3, count)
    return [Panel(x=x, y="" if k % columns else y) for k in range(count)]


def _drawn(panels: Sequence[Panel]) -> Markup:
    return drawing(panels, columns=min(3, len(panels)), height=115.0, share_y=True)


def _events(runs: Sequence[RunSeries], events: Sequence[Finding]) -> Markup | None:
    """The rate of every run with an event, as block means, and where the events lie."""
    files = {event.file for event in events}
    shown = [run for run in runs if run.file in files][:_MOST_PANELS]
    if not shown:
        return None
    panels = _panels(len(shown), "h on the file's clock", "rate − mean, deg/h")
    for panel, run in zip(panels, shown, strict=True):
        panel.title = run.name
        panel.line(np.array(run.hours) + run.first_s / 3600.0, np.array(run.rate_dph), BEFORE)
        for event in events:
            if event.file == run.file and event.time_s is not None:
                panel.vertical(event.time_s.value / 3600.0, AFTER, width=1.2)
    return _drawn(panels)


def _against_signature(runs: Sequence[RunSeries]) -> Markup | None:
    """Draw what the map leaves against what the named causes make of it; None where no cause is named.

    Means of equal numbers of blocks, with their standard errors. On the dashed line the causes are the whole of it.
    """
    known = [run for run in runs if run.named_dph is not None]
    if not known:
        return None
    named, residual = (
        np.concatenate([np.array(values) for values in of])
        for of in zip(*((run.named_dph, run.residual_dph) for run in known), strict=True)
    )
    order = np.argsort(named, kind="stable")
    parts = [part for part in np.array_split(order, _SIGNATURE_MEANS) if part.size >= _LEAST_SHOWN]
    if len(parts) < 2:
        return None
    x, y = (np.array([values[part].mean() for part in parts]) for values in (named, residual))
    error = np.array([residual[part].std() / np.sqrt(part.size) for part in parts])
    panel = Panel(x="bias by the named causes, deg/h", y="what the map leaves, deg/h")
    ends = np.array([x.min(), x.max()])
    panel.horizontal(0.0)
    panel.line(ends, ends, AFTER, "as the causes say", dash="5 3", width=1.4)
    panel.errors(x, y - error, y + error, BEFORE)
    panel.dots(x, y, BEFORE, "measured, with standard error", size=6.0)
    return drawing([panel], width=HALF, height=220.0)


def _residual_over_time(runs: Sequence[RunSeries], width: int) -> Markup:
    """Half-hour means of every run's residual over the band of the simulated ones, and the fitted causes."""
    panels = _panels(len(runs), "h since the first row", "residual, deg/h")
    for panel, run in zip(panels, runs, strict=True):
        panel.title = " ".join(dict.fromkeys((run.name, run.environment)))
        panel.band(run.hours, run.simulated_low_dph, run.simulated_high_dph, COVERED, "simulated, 95 %")
        panel.line(run.hours, _smooth(run.residual_dph, width), BEFORE, "measured")
        if run.named_dph is not None:
            panel.line(run.hours, _smooth(run.named_dph, width), AFTER, "named causes")
    return _drawn(panels)


def _cycle_over_time(runs: Sequence[RunSeries]) -> Markup:
    """Block means of what a map of T alone leaves, and the states' part of it; temperature below."""
    upper = Panel(y="residual, deg/h")
    lower = Panel(x="time, min", y="temperature, C")
    at = 0.0
    for run in runs:
        minutes = at + 60.0 * np.array(run.hours)
        upper.line(minutes, run.residual_dph, BEFORE, "measured")
        if run.named_dph is not None:
            upper.line(minutes, run.named_dph, AFTER, "named causes")
        lower.line(minutes, run.temperature_c, COVERED)
        at = float(minutes[-1])
    return drawing([upper, lower], heights=(190.0, 95.0), share_x=True)


def _smooth(values: SeriesValues, width: int) -> FloatArray:
    return running_mean(np.array(values), width)


def _statistics(discrepancies: Sequence[Statistic]) -> Markup:
    """Every statistic of the residuals against the middle 95 % of the plain and of the extended simulation."""
    found = list(reversed(discrepancies))
    names = [d.statistic.removesuffix("_dph").replace("_", " ") for d in found]
    panel = Panel(
        x="half widths of the 95 % range (beyond 1: square root)",
        y_range=(-0.7, len(found) - 0.3),
        y_ticks=list(enumerate(names)),
    )
    panel.span(-1.0, 1.0, COVERED, "simulated, 95 %")
    panel.dots([_place(d) for d in found], range(len(found)), BEFORE, "measured, plain simulation", size=7.0)
    after = [(row, _place(d.extended)) for row, d in enumerate(found) if d.extended is not None]
    if after:
        at, places = zip(*after, strict=True)
        panel.dots(places, at, AFTER, "measured, with what was found", size=9.0, hollow=True)
    return drawing([panel], width=HALF, height=16.0 + 25.0 * len(found))


def _place(d: ComparedStatistic) -> float:
    """Return the place of the measured value in its simulated range: -1 ... 1 inside."""
    half = max(0.5 * (d.simulated_high - d.simulated_low), 1e-300)
    x = (d.measured - 0.5 * (d.simulated_high + d.simulated_low)) / half
    return float(np.sign(x) * min(abs(x), np.sqrt(abs(x))))  # the value itself up to 1, its square root beyond


def _over_inputs(runs: Sequence[RunSeries], width: int) -> Markup:
    """Residual over T (heating, cooling), dT/dt, time since power-on and date; the causes as lines."""
    t, slope, residual = (
        np.concatenate([np.array(values) for values in of])
        for of in zip(*((r.temperature_c, r.slope_c_per_min, r.residual_dph) for r in runs), strict=True)
    )
    line = np.concatenate([np.zeros(len(r.hours)) if r.named_dph is None else np.array(r.named_dph) for r in runs])
    words = "residual, deg/h"
    over_t = Panel(x="temperature, C", y=words)
    for label, color, mask in sorted_by_rate(slope):
        if mask.sum() > _LEAST_SHOWN:
            _binned(over_t, t[mask], residual[mask], line[mask], color, label)
    over_rate = Panel(x="dT/dt, C/min")
    _binned(over_rate, slope, residual, line, BEFORE, "")
    panels = [over_t, over_rate, _over_power_on(words, runs, width), _over_date(runs)]
    return drawing(panels, columns=2, height=190.0, share_y=True)


def _binned(panel: Panel, x: FloatArray, y: FloatArray, term: FloatArray, color: str, label: str) -> None:
    """Draw means of y in 24 cells with their standard errors, and those of the fitted causes as a line."""
    edges = np.linspace(x.min(), x.max() + 1e-9, 25)
    cell = np.digitize(x, edges) - 1
    count = np.bincount(cell, minlength=24)
    use = np.flatnonzero(count >= 4)
    if use.size == 0:
        return
    mean, place, line = (np.bincount(cell, weights=v, minlength=24)[use] / count[use] for v in (y, x, term))
    error = np.array([y[cell == c].std() for c in use]) / np.sqrt(count[use])
    panel.horizontal(0.0)
    panel.errors(place, mean - error, mean + error, color)
    panel.dots(place, mean, color, label, size=6.0)
    if np.any(term):
        panel.line(place, line, color, width=1.4)


def _over_power_on(y: str, runs: Sequence[RunSeries], width: int) -> Panel:
    """Half-hour means of every run, and their mean at equal time since power-on."""
    known = [(np.array(run.on_h), np.array(run.residual_dph)) for run in runs if run.on_h is not None]
    panel = Panel(x="h since power-on" if known else "power-on is not known", y=y)
    for hours, residual in known:
        panel.line(hours, running_mean(residual, width), COVERED, width=0.8)
    if known:
        at, value = (np.concatenate(parts) for parts in zip(*known, strict=True))
        _binned(panel, at, value, np.zeros_like(at), BEFORE, "")
    return panel


def _over_date(runs: Sequence[RunSeries]) -> Panel:
    dated = all(run.day is not None for run in runs)
    panel = Panel(x="day" if dated else "number of the run (not all are dated)", whole_x=True)
    parts = [np.array(run.residual_dph) for run in runs]
    day = [run.day if dated and run.day is not None else float(k) for k, run in enumerate(runs)]
    mean = np.array([part.mean() for part in parts])
    error = np.array([part.std() / np.sqrt(max(part.size, 1)) for part in parts])
    panel.horizontal(0.0)
    panel.errors(day, mean - error, mean + error, BEFORE)
    panel.dots(day, mean, BEFORE, size=7.0)
    return panel


def _before_and_after(scored: Sequence[ScoredRun], average_s: float) -> Markup:
    """Half-hour means on the scored runs: model without the causes, and with them."""
    smooth_s = min(HALF_HOUR_S, min(len(run.hours) for run in scored) * average_s / 16.0)
    width = max(round(smooth_s / average_s), 1)
    panels = _panels(len(scored), "time, h", "remains, deg/h")
    for panel, run in zip(panels, scored, strict=True):
        panel.horizontal(0.0)
        panel.line(run.hours, _smooth(run.before_dph, width), BEFORE, "without")
        panel.line(run.hours, _smooth(run.after_dph, width), AFTER, "with the causes")
    return _drawn(panels)


def _likelihood(likelihood: ParameterLikelihood) -> Markup:
    """Profile likelihood of the parameter of a cause where it is near its top, with its 95 % interval."""
    panel = Panel(x=words(likelihood.parameter), y="2 Δ log likelihood", title=likelihood.cause)
    panel.y_range = (max(_SHOWN, 1.05 * min(likelihood.gain)), None)
    if likelihood.low is not None and likelihood.high is not None:
        panel.span(likelihood.low, likelihood.high, AFTER)
    panel.line(likelihood.values, likelihood.gain, AFTER)
    panel.dots(likelihood.values, likelihood.gain, AFTER, size=5.0)
    panel.horizontal(-CHI2_95_ONE, dash="5 3")
    return drawing([panel], width=HALF)


def _posterior(causes: Sequence[NamedCause]) -> Markup | None:
    """Posterior probability of every cause, one panel for each named one."""
    panels, rows = [], 0
    for cause in causes:
        if cause.probabilities is None:
            continue
        ids = list(cause.probabilities)
        places = list(range(len(ids)))[::-1]
        panel = Panel(
            x="posterior probability",
            title=cause.name,
            x_range=(0.0, 1.0),
            y_range=(-0.6, len(ids) - 0.4),
            y_ticks=[(place, id.replace("_", " ")) for place, id in zip(places, ids, strict=True)],
        )
        panel.bars(list(cause.probabilities.values()), places, AFTER)
        panels.append(panel)
        rows = max(rows, len(ids))
    return drawing(panels, columns=1, width=HALF, height=40.0 + 20.0 * rows) if panels else None


def _considered(scores: SearchScores) -> Markup:
    """Best score of every cause before any was taken, and what is left after the named ones."""
    ids = list(scores.alone)
    places = np.arange(len(ids))[::-1]
    panel = Panel(
        x="−ln p of the best candidate",
        x_log=_LINEAR if max(scores.alone.values(), default=0.0) > _LINEAR else False,
        y_range=(-0.6, len(ids) - 0.4),
        y_ticks=[(int(place), id.replace("_", " ")) for place, id in zip(places, ids, strict=True)],
    )
    panel.bars(list(scores.alone.values()), places, BEFORE, "alone", height=0.62)
    if scores.beside is not None:
        panel.bars([scores.beside.get(i, 0.0) for i in ids], places, AFTER, "beside the named causes", height=0.28)
    panel.vertical(scores.limit, label="1 % for the whole search", dash="5 3")
    return drawing([panel], height=16.0 + 25.0 * len(ids))
