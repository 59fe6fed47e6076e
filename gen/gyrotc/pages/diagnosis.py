"""`report.html` of a diagnosis and its pictures, from `diagnose.json` and `series.json` alone.

`draw` gives all pictures of a diagnosis by name, each one `<svg>` element.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..common.arrays import FloatArray
from ..common.statistics import CHI2_95_ONE, running_mean
from ..common.texts import picture_text
from ..results.base import read_optional, read_result
from ..results.diagnosed import (
    ComparedStatistic,
    Diagnosed,
    DiagnosisSeries,
    FoundEvent,
    GainOnUnseen,
    ParameterLikelihood,
    RunSeries,
    ScoredRun,
    SearchScores,
    Statistic,
    Values,
)
from .plots import ACCENT, AFTER, BEFORE, COVERED, STYLE, svg
from .report import page_environment, page_from, write_page

__all__ = ["PICTURES", "SERIES", "draw", "is_diagnosis", "write_diagnosis_page"]

PICTURES, SERIES = "pictures", "series.json"


def is_diagnosis(folder: Path) -> bool:
    """Whether a folder holds a diagnosis (and not a build)."""
    return (folder / "diagnose.json").is_file() and not (folder / "evaluate.json").exists()


def write_diagnosis_page(folder: Path) -> Path:
    """Writes `folder/report.html` from what stands in the folder; returns its path.

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
                pictures=draw(result, series) if series is not None else {},
            )
        )
    return write_page(folder, text)


def _gains(result: Diagnosed) -> list[tuple[str, GainOnUnseen]]:
    """Gain of the whole extension where it is shipped, else of every cause, by where it was measured."""
    seen = "exam runs" if result.measured_on == "exam" else "parts left out in turn, causes chosen anew"
    extended = result.extended
    if extended is None:
        return [(f"{seen}: {c.name[0].lower()}{c.name[1:]}", c.gain) for c in result.causes if c.gain]
    rows = [(seen, extended.gain)]
    if extended.rate_left_out:
        rows.append((f"“{extended.rate_left_out.environment}” left out", extended.rate_left_out))
    if extended.forward_in_time:
        rows.append(("forward in time", extended.forward_in_time))
    return rows


_SMOOTH_S = 1800.0  # half an hour, as the simulated band of `series.json`
_MOVING = 0.1  # C/min
_SHOWN = -40.0  # of 2 log likelihood below its top: ten times the fall at 95 %, more would flatten it
_LINEAR = 20.0  # -ln p up to which the axis is linear, so that what was not found is seen
_MOST_PANELS = 6  # runs with events that are drawn


def draw(result: Diagnosed, series: DiagnosisSeries) -> dict[str, Markup]:
    """All pictures of a diagnosis by name."""
    cycle = result.single_cycle is not None
    width = max(round(_SMOOTH_S / series.block_s), 1)
    made: dict[str, Markup | None] = {
        "residual": _cycle_over_time(series.runs) if cycle else _residual_over_time(series.runs, width),
        "statistics": _statistics(result.discrepancies),
        "inputs": None if cycle else _over_inputs(series.runs, width),
        "considered": _considered(series.scores),
        "events": _events(series.runs, result.events),
    }
    for number, likelihood in enumerate(series.likelihoods):
        made[f"likelihood-{number + 1}"] = _likelihood(likelihood) if likelihood is not None else None
    if series.scored:
        made["before-and-after"] = _before_and_after(series.scored, series.average_s)
    return {name: picture for name, picture in made.items() if picture is not None}


def _events(runs: Sequence[RunSeries], events: Sequence[FoundEvent]) -> Markup | None:
    """The rate of every run with an event, as block means, and where the events lie."""
    files = {event.file for event in events}
    shown = [run for run in runs if run.file in files][:_MOST_PANELS]
    if not shown:
        return None
    with mpl.rc_context(STYLE):
        figure, axes = _grid(len(shown))
        for ax, run in zip(axes, shown, strict=False):
            ax.plot(np.array(run.hours) + run.first_s / 3600.0, run.rate_dph, color=BEFORE, linewidth=0.9)
            for event in (e for e in events if e.file == run.file):
                ax.axvline(event.time_s.value / 3600.0, color=AFTER, linewidth=1.2)
            ax.set(title=picture_text(run.name), xlabel="h on the file's clock")
        axes[0].set_ylabel("rate less its mean, deg/h")
        return svg(figure)


def _residual_over_time(runs: Sequence[RunSeries], width: int) -> Markup:
    """Half-hour means of every run's residual over the band of the simulated ones, and the fitted causes."""
    with mpl.rc_context(STYLE):
        figure, axes = _grid(len(runs))
        for ax, run in zip(axes, runs, strict=False):
            band = (run.simulated_low_dph, run.simulated_high_dph)
            ax.fill_between(run.hours, *band, color=COVERED, alpha=0.3, linewidth=0, label="simulated, 95 %")
            ax.plot(
                run.hours, _smooth(run.residual_dph, width), color=BEFORE, linewidth=1.2, label="measured"
            )
            if run.named_dph is not None:
                ax.plot(
                    run.hours, _smooth(run.named_dph, width), color=AFTER, linewidth=1.2, label="named causes"
                )
            title = picture_text(" ".join(dict.fromkeys((run.name, run.environment))))
            ax.set_title(title, fontsize=8, loc="left")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=3, fontsize=8)
        figure.supxlabel("h since the first row", fontsize=9)
        figure.supylabel("residual of the static map, deg/h", fontsize=9)
        return svg(figure)


def _cycle_over_time(runs: Sequence[RunSeries]) -> Markup:
    """Block means of what a map of T alone leaves, and the states' part of it; temperature below."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 4.2), layout="constrained")
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
        at = 0.0
        for run in runs:
            minutes = at + 60.0 * np.array(run.hours)
            upper.plot(minutes, run.residual_dph, color=BEFORE, linewidth=1.2, label="measured")
            if run.named_dph is not None:
                upper.plot(minutes, run.named_dph, color=AFTER, linewidth=1.2, label="named causes")
            lower.plot(minutes, run.temperature_c, color=COVERED, linewidth=1.2)
            at = float(minutes[-1])
        upper.set_ylabel("residual of a map of T, deg/h")
        lower.set(ylabel="T, C", xlabel="min")
        handles, labels = upper.get_legend_handles_labels()
        figure.legend(handles[:2], labels[:2], loc="outside upper right", ncols=2, fontsize=8)
        return svg(figure)


def _grid(count: int) -> tuple[Figure, list[Axes]]:
    columns = min(3, count)
    rows = -(-count // columns)
    figure = Figure(figsize=(10.0, 0.6 + 1.9 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, sharey=True, squeeze=False)
    for ax in axes.flat[count:]:
        ax.set_visible(False)
    return figure, list(axes.flat[:count])


def _smooth(values: Values, width: int) -> FloatArray:
    return running_mean(np.array(values), width)


def _statistics(discrepancies: Sequence[Statistic]) -> Markup:
    """Every statistic of the residuals against the middle 95 % of the plain and of the extended simulation."""
    found = list(reversed(discrepancies))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 0.8 + 0.34 * len(found)), layout="constrained")
        ax = figure.subplots()
        ax.axvspan(-1.0, 1.0, color=COVERED, alpha=0.3, linewidth=0, label="simulated, 95 %")
        rows = np.arange(len(found))
        ax.plot([_place(d) for d in found], rows, "o", color=BEFORE, label="measured, plain simulation")
        after = [(row, _place(d.extended)) for row, d in enumerate(found) if d.extended is not None]
        if after:
            at, places = zip(*after, strict=True)
            ax.plot(places, at, "D", mfc="none", color=AFTER, label="measured, with what was found")
        labels = [d.statistic.removesuffix("_dph").replace("_", " ") for d in found]
        ax.set_yticks(rows, labels)
        ax.set_xlabel("half widths of the simulated 95 % range (beyond 1: square root)")
        ax.set_ylim(-0.7, len(found) - 0.3)
        ax.grid(axis="y", visible=False)
        figure.legend(loc="outside upper right", ncols=3, fontsize=8)
        return svg(figure)


def _place(d: ComparedStatistic) -> float:
    """Where the measured value lies in its simulated range: -1 ... 1 inside."""
    half = max(0.5 * (d.simulated_high - d.simulated_low), 1e-300)
    return _signed_root((d.measured - 0.5 * (d.simulated_high + d.simulated_low)) / half)


def _signed_root(x: float) -> float:
    """The value itself up to 1, its square root beyond."""
    return float(np.sign(x) * min(abs(x), np.sqrt(abs(x))))


def _over_inputs(runs: Sequence[RunSeries], width: int) -> Markup:
    """Residual over T (heating, cooling), dT/dt, time since power-on and date; the causes as lines."""
    t, slope, residual = (
        np.concatenate([np.array(values) for values in of])
        for of in zip(*((r.temperature_c, r.slope_c_per_min, r.residual_dph) for r in runs), strict=True)
    )
    named = [np.zeros(len(r.hours)) if r.named_dph is None else np.array(r.named_dph) for r in runs]
    line = np.concatenate(named)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 5.6), layout="constrained")
        axes = figure.subplots(2, 2, sharey=True)
        for mask, colour, label in (
            (slope > _MOVING, BEFORE, "heating"),
            (slope < -_MOVING, AFTER, "cooling"),
            (np.abs(slope) <= _MOVING, COVERED, "held"),
        ):
            if mask.sum() > 20:
                _binned(axes[0, 0], t[mask], residual[mask], line[mask], colour, label)
        axes[0, 0].set_xlabel("temperature, C")
        axes[0, 0].legend(fontsize=8)
        _binned(axes[0, 1], slope, residual, line, BEFORE, "")
        axes[0, 1].set_xlabel("dT/dt, C/min")
        _over_power_on(axes[1, 0], runs, width)
        _over_date(axes[1, 1], runs)
        figure.supylabel("residual of the static map, deg/h", fontsize=9)
        return svg(figure)


def _binned(ax: Axes, x: FloatArray, y: FloatArray, term: FloatArray, colour: str, label: str) -> None:
    """Means of y in 24 cells with their standard errors, and of the fitted causes as a line."""
    edges = np.linspace(x.min(), x.max() + 1e-9, 25)
    cell = np.digitize(x, edges) - 1
    count = np.bincount(cell, minlength=24)
    use = np.flatnonzero(count >= 4)
    if use.size == 0:
        return
    mean, place, line = (np.bincount(cell, weights=v, minlength=24)[use] / count[use] for v in (y, x, term))
    error = np.array([y[cell == c].std() for c in use]) / np.sqrt(count[use])
    ax.axhline(0.0, color=ACCENT, linewidth=0.6)
    ax.errorbar(place, mean, yerr=error, color=colour, fmt="o", markersize=3, linewidth=1.0, label=label)
    if np.any(term):
        ax.plot(place, line, color=colour, linewidth=1.3)


def _over_power_on(ax: Axes, runs: Sequence[RunSeries], width: int) -> None:
    """Half-hour means of every run, and their mean at equal time since power-on."""
    ax.set_xlabel("h since power-on")
    known = [(np.array(run.on_h), np.array(run.residual_dph)) for run in runs if run.on_h is not None]
    for hours, residual in known:
        ax.plot(hours, running_mean(residual, width), color=COVERED, linewidth=0.7, alpha=0.7)
    if not known:
        ax.text(0.5, 0.5, "power-on is not known", transform=ax.transAxes, ha="center", color=COVERED)
        return
    at, value = (np.concatenate(parts) for parts in zip(*known, strict=True))
    _binned(ax, at, value, np.zeros_like(at), BEFORE, "")


def _over_date(ax: Axes, runs: Sequence[RunSeries]) -> None:
    dated = all(run.day is not None for run in runs)
    ax.set_xlabel("day" if dated else "number of the run (not all are dated)")
    for number, run in enumerate(runs):
        day = run.day if dated and run.day is not None else float(number)
        part = np.array(run.residual_dph)
        error = part.std() / np.sqrt(max(part.size, 1))
        ax.errorbar(day, part.mean(), yerr=error, fmt="o", color=BEFORE, markersize=4)
    ax.axhline(0.0, color=ACCENT, linewidth=0.6)


def _before_and_after(scored: Sequence[ScoredRun], average_s: float) -> Markup:
    """Half-hour means on the scored runs: model without the causes, and with them."""
    smooth_s = min(_SMOOTH_S, min(len(run.hours) for run in scored) * average_s / 16.0)
    width = max(round(smooth_s / average_s), 1)
    with mpl.rc_context(STYLE):
        figure, axes = _grid(len(scored))
        for ax, run in zip(axes, scored, strict=False):
            ax.axhline(0.0, color=ACCENT, linewidth=0.6)
            ax.plot(run.hours, _smooth(run.before_dph, width), color=BEFORE, linewidth=1.1, label="without")
            ax.plot(
                run.hours, _smooth(run.after_dph, width), color=AFTER, linewidth=1.1, label="with the causes"
            )
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=2, fontsize=8)
        figure.supxlabel("h", fontsize=9)
        figure.supylabel("compensated rate, deg/h", fontsize=9)
        return svg(figure)


def _likelihood(likelihood: ParameterLikelihood) -> Markup:
    """Profile likelihood of the parameter of a cause where it is near its top, with its 95 % interval."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(5.0, 2.6), layout="constrained")
        ax = figure.subplots()
        if likelihood.low is not None and likelihood.high is not None:
            ax.axvspan(likelihood.low, likelihood.high, color=AFTER, alpha=0.12, linewidth=0)
        ax.plot(likelihood.values, likelihood.gain, "o-", color=AFTER, markersize=3, linewidth=1.0)
        ax.axhline(-CHI2_95_ONE, color=ACCENT, linewidth=0.6, linestyle="--")
        ax.set_ylim(bottom=max(_SHOWN, 1.05 * min(likelihood.gain)))
        ax.set_xlabel(likelihood.parameter)
        ax.set_ylabel("2 Δ log likelihood")
        ax.set_title(likelihood.cause, fontsize=8, loc="left")
        return svg(figure)


def _considered(scores: SearchScores) -> Markup:
    """Best score of every cause before any was taken, and what is left after the named ones."""
    ids = list(scores.alone)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 0.9 + 0.34 * len(ids)), layout="constrained")
        ax = figure.subplots()
        places = np.arange(len(ids))[::-1]
        ax.barh(places, list(scores.alone.values()), height=0.62, color=BEFORE, alpha=0.85, label="alone")
        if scores.beside is not None:
            left = [scores.beside.get(i, 0.0) for i in ids]
            ax.barh(places, left, height=0.28, color=AFTER, label="beside the named causes")
        ax.axvline(
            scores.limit, color=ACCENT, linewidth=0.8, linestyle="--", label="1 % for the whole search"
        )
        ax.set_yticks(places, [i.replace("_", " ") for i in ids])
        ax.set_xlabel("-ln p of the best candidate")
        if max(scores.alone.values(), default=0.0) > _LINEAR:
            ax.set_xscale("symlog", linthresh=_LINEAR)
        ax.grid(axis="y", visible=False)
        figure.legend(fontsize=8, loc="outside upper right", ncols=3)
        return svg(figure)
