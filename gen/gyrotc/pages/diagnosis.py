"""`report.html` of a diagnosis and its pictures, from `diagnose.json`. Computes nothing new.

Draws; computes nothing but running means. `draw` gives all pictures of a diagnosis by name, each one `<svg>` element.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.special import chdtri

from ..causes import CATALOGUE
from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..common.inputs import read_input
from ..common.metrics import Averages
from ..common.texts import checked_svg, picture_text
from ..diagnose.attribution import Attribution
from ..diagnose.blocks import Records, centred_slope
from ..diagnose.candidates import diagnosed
from ..diagnose.detection import Found
from ..diagnose.diagnosis import Diagnosis
from ..diagnose.discrepancy import Discrepancy, Ensemble
from ..diagnose.refine import Refined
from ..diagnose.single_cycle import Cycle
from ..results.base import read_result
from ..results.diagnosed import Diagnosed, FoundEvent, GainOnUnseen
from .plots import ACCENT, AFTER, BEFORE, COVERED, STYLE, svg
from .report import page_environment, page_from, write_page

__all__ = ["PICTURES", "draw", "is_diagnosis", "write_diagnosis_page"]

PICTURES = "pictures"


def is_diagnosis(folder: Path) -> bool:
    """Whether a folder holds a diagnosis (and not a build)."""
    return (folder / "diagnose.json").is_file() and not (folder / "evaluate.json").exists()


def write_diagnosis_page(folder: Path) -> Path:
    """Writes `folder/report.html` from what stands in the folder; returns its path.

    Raises:
        InputError: `diagnose.json` is missing, broken or of another kind.
    """
    result = read_result(folder / "diagnose.json", Diagnosed)
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
                pictures=_pictures(folder, result),
            )
        )
    return write_page(folder, text)


def _pictures(folder: Path, result: Diagnosed) -> dict[str, Markup]:
    """Pictures by name; one that is missing is left out.

    Raises:
        InputError: One is more than a drawing.
    """
    here = {path.name: path for path in (folder / PICTURES).glob("*") if path.is_file()}
    found = {}
    names = (Path(name).name for name in result.pictures or ())
    for path in (here[name] for name in names if name in here):
        try:
            found[path.stem] = checked_svg(read_input(path, "result_mib", "a picture").decode("utf-8"))
        except ValueError as error:
            raise InputError(str(path), str(error), "a picture that diagnose drew") from error
    return found


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


_SMOOTH_S = 1800.0  # half an hour, as `rms_30min_dph` of `metrics`
_LEVEL = 0.01  # familywise level of the search (docs/diagnosis.md)
_MOVING = 0.1  # C/min
_TYPICAL_LIMIT = 10.0  # -ln p of 1 % for the whole search where nothing reaches it
_WITHIN_95 = float(chdtri(1, 0.05))  # fall of 2 log likelihood of one parameter at 95 % (Wilks 1938)
_SHOWN = -40.0  # of 2 log likelihood below its top: ten times the fall at 95 %, more would flatten it
_LINEAR = 20.0  # -ln p up to which the axis is linear, so that what was not found is seen
_MOST_PANELS = 6  # runs with events that are drawn


def draw(found: Diagnosis) -> dict[str, str]:
    """All pictures of a diagnosis by name; none where the recordings could not decide."""
    analysis, extension = found.analysis, found.extension
    if analysis is None or extension is None:
        return {}
    causes = analysis.attribution.causes[: len(found.result.physical)]
    term = _beyond_the_map(analysis.search.bank.map, causes) if causes else None
    made: dict[str, str | None] = {
        "residual": _residual_over_time(analysis.records, analysis.ensemble, term)
        if found.cycle is None
        else _cycle_over_time(analysis.records, found.cycle),
        "statistics": _statistics(analysis.ensemble, analysis.extended),
        "inputs": _over_inputs(analysis.records, analysis.ensemble, term) if found.cycle is None else None,
        "considered": _considered(analysis.attribution, named=bool(causes)),
        "events": _events(analysis.records, found.result.events),
    }
    for number, cause in enumerate(causes):
        made[f"likelihood-{number + 1}"] = _likelihood(cause)
    if extension.steps:
        made["before-and-after"] = _before_and_after(
            extension.before, extension.after, found.result.average_s
        )
    return {name: svg for name, svg in made.items() if svg is not None}


def _events(records: Records, events: Sequence[FoundEvent]) -> str | None:
    """The rate of every run with an event, as block means, and where the events lie."""
    files = {event.file for event in events}
    shown = [(run, k) for k, run in enumerate(records.runs) if run.name.partition("@")[0] in files][
        :_MOST_PANELS
    ]
    if not shown:
        return None
    with mpl.rc_context(STYLE):
        figure, axes = _grid(len(shown))
        for ax, (run, number) in zip(axes, shown, strict=False):
            hours = (records.kept[number] + 0.5) * records.block_s / 3600.0 + run.history.time_s[0] / 3600.0
            ax.plot(hours, records.average_run(number, run.rate_dph), color=BEFORE, linewidth=0.9)
            for event in (e for e in events if e.file == run.name.partition("@")[0]):
                ax.axvline(event.time_s.value / 3600.0, color=AFTER, linewidth=1.2)
            ax.set(title=picture_text(run.name), xlabel="h on the file's clock")
        axes[0].set_ylabel("rate, deg/h")
        return svg(figure)


def _residual_over_time(records: Records, ensemble: Ensemble, term: FloatArray | None) -> str:
    """Half-hour means of every run's residual over the band of the simulated ones, and the fitted causes."""
    width = max(round(_SMOOTH_S / records.block_s), 1)
    with mpl.rc_context(STYLE):
        figure, axes = _grid(len(records.runs))
        for ax, run, span, kept in zip(axes, records.runs, records.spans(), records.kept, strict=False):
            hours = (kept + 0.5) * records.block_s / 3600.0
            band = _smooth(ensemble.simulated[span], width)
            low, high = np.quantile(band, [0.025, 0.975], axis=1)
            ax.fill_between(hours, low, high, color=COVERED, alpha=0.3, linewidth=0, label="simulated, 95 %")
            ax.plot(
                hours, _smooth(ensemble.residual[span], width), color=BEFORE, linewidth=1.2, label="measured"
            )
            if term is not None:
                ax.plot(hours, _smooth(term[span], width), color=AFTER, linewidth=1.2, label="named causes")
            title = picture_text(" ".join(dict.fromkeys((run.name, run.environment))))
            ax.set_title(title, fontsize=8, loc="left")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=3, fontsize=8)
        figure.supxlabel("h since the first row", fontsize=9)
        figure.supylabel("residual of the static map, deg/h", fontsize=9)
        return svg(figure)


def _cycle_over_time(records: Records, cycle: Cycle) -> str:
    """Block means of what a map of T alone leaves, and the states' part of it; temperature below."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 4.2), layout="constrained")
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
        at = 0.0
        for number, (run, span, kept) in enumerate(
            zip(records.runs, records.spans(), records.kept, strict=True)
        ):
            minutes = at + (kept + 0.5) * records.block_s / 60.0
            upper.plot(minutes, cycle.residual[span], color=BEFORE, linewidth=1.2, label="measured")
            if cycle.chosen is not None:
                upper.plot(minutes, cycle.explained[span], color=AFTER, linewidth=1.2, label="named causes")
            lower.plot(
                minutes, records.average_run(number, run.history.temperature_c), color=COVERED, linewidth=1.2
            )
            at = float(minutes[-1])
        upper.set_ylabel("residual of a map of T, deg/h")
        lower.set(ylabel="T, C", xlabel="min")
        handles, labels = upper.get_legend_handles_labels()
        figure.legend(handles[:2], labels[:2], loc="outside upper right", ncols=2, fontsize=8)
        return svg(figure)


def _beyond_the_map(static: FloatArray, causes: Sequence[Refined]) -> FloatArray:
    """What the causes add that no map holds: what a residual of the map shows of them, deg/h, shape (N,)."""
    total = np.sum([c.contribution for c in causes], axis=0)
    return np.asarray(total - static @ (static.T @ total))


def _grid(count: int) -> tuple[Figure, list[Axes]]:
    columns = min(3, count)
    rows = -(-count // columns)
    figure = Figure(figsize=(10.0, 0.6 + 1.9 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, sharey=True, squeeze=False)
    for ax in axes.flat[count:]:
        ax.set_visible(False)
    return figure, list(axes.flat[:count])


def _smooth(values: FloatArray, width: int) -> FloatArray:
    """Running mean over `width` blocks, shorter at the ends."""
    total = np.cumsum(np.concatenate([np.zeros((1, *values.shape[1:])), values]), axis=0)
    n = len(values)
    low = np.maximum(np.arange(n) - width // 2, 0)
    high = np.minimum(low + width, n)
    count = (high - low).reshape(-1, *([1] * (values.ndim - 1)))
    return np.asarray((total[high] - total[low]) / count)


def _statistics(ensemble: Ensemble, extended: Ensemble | None) -> str:
    """Every statistic of the residuals against the middle 95 % of the plain and of the extended simulation."""
    found = list(reversed(ensemble.discrepancies))
    after = {d.statistic: d for d in extended.discrepancies} if extended is not None else {}
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 0.8 + 0.34 * len(found)), layout="constrained")
        ax = figure.subplots()
        ax.axvspan(-1.0, 1.0, color=COVERED, alpha=0.3, linewidth=0, label="simulated, 95 %")
        rows = np.arange(len(found))
        ax.plot([_place(d) for d in found], rows, "o", color=BEFORE, label="measured, plain simulation")
        if after:
            places = [_place(after[d.statistic]) for d in found if d.statistic in after]
            ax.plot(places, rows, "D", mfc="none", color=AFTER, label="measured, with what was found")
        labels = [d.statistic.removesuffix("_dph").replace("_", " ") for d in found]
        ax.set_yticks(rows, labels)
        ax.set_xlabel("half widths of the simulated 95 % range (beyond 1: square root)")
        ax.set_ylim(-0.7, len(found) - 0.3)
        ax.grid(axis="y", visible=False)
        figure.legend(loc="outside upper right", ncols=3, fontsize=8)
        return svg(figure)


def _place(d: Discrepancy) -> float:
    """Where the measured value lies in its simulated range: -1 ... 1 inside."""
    half = max(0.5 * (d.simulated_high - d.simulated_low), 1e-300)
    return _signed_root((d.measured - 0.5 * (d.simulated_high + d.simulated_low)) / half)


def _signed_root(x: float) -> float:
    """The value itself up to 1, its square root beyond."""
    return float(np.sign(x) * min(abs(x), np.sqrt(abs(x))))


def _over_inputs(records: Records, ensemble: Ensemble, term: FloatArray | None) -> str:
    """Residual over T (heating, cooling), dT/dt, time since power-on and date; the causes as lines."""
    residual = ensemble.residual
    line = np.zeros(records.size) if term is None else term
    t = records.average([r.history.temperature_c for r in records.runs])
    slope = records.average([centred_slope(r.history) for r in records.runs])
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
        _over_power_on(axes[1, 0], records, residual)
        _over_date(axes[1, 1], records, residual)
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


def _over_power_on(ax: Axes, records: Records, residual: FloatArray) -> None:
    """Half-hour means of every run, and their mean at equal time since power-on."""
    ax.set_xlabel("h since power-on")
    width = max(round(_SMOOTH_S / records.block_s), 1)
    known = []
    for number, (run, span) in enumerate(zip(records.runs, records.spans(), strict=True)):
        if run.history.on_s is None:
            continue
        hours = records.average_run(number, np.asarray(run.history.on_s)) / 3600.0
        ax.plot(hours, _smooth(residual[span], width), color=COVERED, linewidth=0.7, alpha=0.7)
        known.append((hours, residual[span]))
    if not known:
        ax.text(0.5, 0.5, "power-on is not known", transform=ax.transAxes, ha="center", color=COVERED)
        return
    at, value = (np.concatenate(parts) for parts in zip(*known, strict=True))
    _binned(ax, at, value, np.zeros_like(at), BEFORE, "")


def _over_date(ax: Axes, records: Records, residual: FloatArray) -> None:
    dated = all(run.history.day is not None for run in records.runs)
    ax.set_xlabel("day" if dated else "number of the run (not all are dated)")
    for number, (run, span) in enumerate(zip(records.runs, records.spans(), strict=True)):
        day = run.history.day if dated and run.history.day is not None else float(number)
        part = residual[span]
        error = part.std() / np.sqrt(max(part.size, 1))
        ax.errorbar(day, part.mean(), yerr=error, fmt="o", color=BEFORE, markersize=4)
    ax.axhline(0.0, color=ACCENT, linewidth=0.6)


def _before_and_after(before: Sequence[Averages], after: Sequence[Averages], average_s: float) -> str:
    """Half-hour means on the scored runs: model without the causes, and with them."""
    smooth_s = min(_SMOOTH_S, min(b.after_dph.size for b in before) * average_s / 16.0)
    width = max(round(smooth_s / average_s), 1)
    with mpl.rc_context(STYLE):
        figure, axes = _grid(len(before))
        for ax, b, a in zip(axes, before, after, strict=False):
            hours = (b.time_s - b.time_s[0]) / 3600.0
            ax.axhline(0.0, color=ACCENT, linewidth=0.6)
            ax.plot(hours, _smooth(b.after_dph, width), color=BEFORE, linewidth=1.1, label="without")
            ax.plot(hours, _smooth(a.after_dph, width), color=AFTER, linewidth=1.1, label="with the causes")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=2, fontsize=8)
        figure.supxlabel("h", fontsize=9)
        figure.supylabel("compensated rate, deg/h", fontsize=9)
        return svg(figure)


def _likelihood(cause: Refined) -> str | None:
    """Profile likelihood of the parameter of a cause where it is near its top, with its 95 % interval."""
    if cause.profile is None:
        return None
    x, gain = cause.profile
    near = np.flatnonzero(gain - gain.max() >= _SHOWN)
    some = slice(max(int(near[0]) - 1, 0), int(near[-1]) + 2)
    x, gain = x[some], gain[some]
    name = next(n for n in cause.parameters if n in cause.candidate.values)
    interval = cause.parameters[name]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(5.0, 2.6), layout="constrained")
        ax = figure.subplots()
        ax.axvspan(interval.low, interval.high, color=AFTER, alpha=0.12, linewidth=0)
        ax.plot(x, gain - gain.max(), "o-", color=AFTER, markersize=3, linewidth=1.0)
        ax.axhline(-_WITHIN_95, color=ACCENT, linewidth=0.6, linestyle="--")
        ax.set_ylim(bottom=max(_SHOWN, float((gain - gain.max()).min()) * 1.05))
        ax.set_xlabel(name)
        ax.set_ylabel("2 Δ log likelihood")
        ax.set_title(CATALOGUE[cause.candidate.id].words.name, fontsize=8, loc="left")
        return svg(figure)


def _considered(attribution: Attribution, *, named: bool) -> str:
    """Best score of every cause before any was taken, and what is left after the named ones."""
    first, last = _best_scores(attribution.first), _best_scores(attribution.last)
    ids = [i for i in diagnosed() if i in first]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 0.9 + 0.34 * len(ids)), layout="constrained")
        ax = figure.subplots()
        places = np.arange(len(ids))[::-1]
        ax.barh(places, [first[i] for i in ids], height=0.62, color=BEFORE, alpha=0.85, label="alone")
        if named:
            left = [last.get(i, 0.0) for i in ids]
            ax.barh(places, left, height=0.28, color=AFTER, label="beside the named causes")
        significant = [f.log_p for f in attribution.first if f.p_value <= _LEVEL]
        missed = [f.log_p for f in attribution.first if f.p_value > _LEVEL]
        limit = 0.5 * (min(significant) + max(missed)) if significant and missed else _TYPICAL_LIMIT
        ax.axvline(limit, color=ACCENT, linewidth=0.8, linestyle="--", label="1 % for the whole search")
        ax.set_yticks(places, [i.replace("_", " ") for i in ids])
        ax.set_xlabel("-ln p of the best candidate")
        if max(first.values(), default=0.0) > _LINEAR:
            ax.set_xscale("symlog", linthresh=_LINEAR)
        ax.grid(axis="y", visible=False)
        figure.legend(fontsize=8, loc="outside upper right", ncols=3)
        return svg(figure)


def _best_scores(found: Sequence[Found]) -> dict[str, float]:
    """Largest -ln p of each cause."""
    out: dict[str, float] = {}
    for f in found:
        if np.isfinite(f.log_p):
            out[f.candidate.id] = max(out.get(f.candidate.id, 0.0), f.log_p)
    return out
