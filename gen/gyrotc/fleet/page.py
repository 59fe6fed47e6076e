"""The summary of a fleet: `fleet.json`, `fleet.csv`, one HTML page with its pictures, and why gyros are outliers.

A lot of gyros that go through one programme of temperatures shows what is usual; each axis is compared with its own
kind (x with x). A gyro is named where its distance from the median of its kind is beyond five robust standard
deviations; the reason is what takes that distance away.
"""

from __future__ import annotations

import csv
import io
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import permutations
from pathlib import Path
from urllib.parse import quote

import numpy as np
from markupsafe import Markup

from .. import __version__
from ..common.arrays import FloatArray
from ..common.metrics import MAD_TO_SIGMA
from ..common.texts import csv_cell
from ..pages.chart import ACCENT, AFTER, BEFORE, COVERED, HALF, Panel, drawing, side_by_side
from ..pages.report import page_environment
from ..quality.thermometers import lag_of
from ..results.base import NUMERICS
from ..results.files import write_atomically, write_own
from ..results.fleet import ComparedRun, Copy, Facts, FleetEntry, FleetSummary, Reason, ResidualSeries
from ..results.folder import result_folder
from ..results.json_text import json_text
from ..tables.runtime import joint_needs, runtime_texts
from .manifest import RUNTIME, SUMMARY
from .outliers import (
    BIN_C,
    FIGURES,
    FIRST_C,
    NOISY_RUN,
    PROFILE_S,
    copies,
    mirrored_units,
    outlying_units,
    spread,
    with_copies,
)

# Reasons that show over time, not over temperature, beside those that have a time
_IN_TIME = ("outliers", "noise", "warm_up", "run_outlier")
_SMALL_FLEET = 200  # gyros: beyond it dots are drawn smaller
_MOST_CURVES = 400  # of an axis: more make one dark area, which the band shows as well


def rms_of_units(entries: Sequence[FleetEntry], outliers: set[str]) -> Markup | None:
    """RMS of every gyro with a constant and with its map, those that are outliers ringed; None for fewer than two."""
    if len(entries) < 2:
        return None
    ordered = sorted(entries, key=lambda e: e.after_rms_dph or 0.0)
    place = np.arange(1, len(ordered) + 1)
    ringed = [k for k, entry in enumerate(ordered) if entry.name in outliers]
    size = 5.0 if len(ordered) < _SMALL_FLEET else 2.5
    panel = Panel(x="gyros, in the order of what remains", y="RMS, deg/h", y_log=True, whole_x=True)
    for label, color in (("constant", BEFORE), ("after", AFTER)):
        values = np.array([getattr(entry, f"{label}_rms_dph") for entry in ordered], dtype=np.float64)
        panel.dots(place, values, color, label, size=size)
        if ringed:
            panel.dots(place[ringed], values[ringed], ACCENT, "outlier", size=11.0, hollow=True)
    return drawing([panel], width=HALF, height=240.0)


def curves_of_units(entries: Sequence[FleetEntry], outliers: set[str]) -> Markup | None:
    """Bias over temperature of all units of an axis over each other, outliers coloured; None for fewer than two."""
    panels = []
    for axis in sorted({entry.axis or "" for entry in entries}):
        members = [e for e in entries if (e.axis or "") == axis and e.facts]
        if len(members) < 2:
            continue
        plain = [e for e in members if e.name not in outliers]
        panel = Panel(x="temperature, C", y="bias, deg/h", title=f"axis {axis}" if axis else "", zoom=True)
        for k, entry in enumerate(plain[:: -(-len(plain) // _MOST_CURVES) or 1]):
            label = "the others" if k == 0 else ""
            panel.line(_centers(entry), _curve(entry), COVERED, label, width=0.8, title=entry.name)
        for k, entry in enumerate(e for e in members if e.name in outliers):
            label = "outlier" if k == 0 else ""
            panel.line(_centers(entry), _curve(entry), BEFORE, label, width=2.0, title=entry.name)
            panel.dots(_centers(entry), _curve(entry), BEFORE, size=5.0)
        panels.append(panel)
    return side_by_side(*(drawing([panel], width=HALF, height=240.0) for panel in panels))


def why_outlier(known: Mapping[str, FleetEntry], reason: Reason) -> Markup:
    """Draw what shows why a gyro is an outlier; `known` has the entries with facts by name."""
    entry = known[reason.name]
    series = entry.facts.series if entry.facts else None
    over_time = series and reason.file in (None, series.file) and (reason.time_s is not None or reason.id in _IN_TIME)
    panel = _over_time(series, reason) if series and over_time else _over_temperature(known, entry)
    return drawing([panel], width=HALF, height=160.0)


def _over_time(series: ResidualSeries, reason: Reason) -> Panel:
    panel = Panel(x="time, h", y="compensated, deg/h")
    time = np.array(series.time_s)
    panel.line((time - time[0]) / 3600.0, series.rate_dph, AFTER, series.file, width=1.0)
    if reason.time_s is not None and reason.file == series.file:
        panel.vertical((reason.time_s - time[0]) / 3600.0, BEFORE, reason.id, dash="5 3", width=1.2)
    return panel


def _over_temperature(known: Mapping[str, FleetEntry], entry: FleetEntry) -> Panel:
    panel = Panel(x="temperature, C", y="bias, deg/h")
    rows = np.array([_curve(e) for e in known.values() if e.axis == entry.axis and e.facts])
    t = _centers(entry)
    seen = np.isfinite(rows).any(axis=0)
    low, middle, high = np.nanquantile(rows[:, seen], (0.05, 0.5, 0.95), axis=0)
    panel.band(t[seen], low, high, COVERED, "90 % of its kind")
    panel.line(t[seen], middle, COVERED)
    panel.line(t, _curve(entry), BEFORE, entry.name, width=1.4)
    panel.dots(t, _curve(entry), BEFORE, size=5.0)
    return panel


def _centers(entry: FleetEntry) -> FloatArray:
    assert entry.facts is not None
    return np.asarray(FIRST_C + BIN_C * (np.arange(len(entry.facts.curve)) + 0.5))


def _curve(entry: FleetEntry) -> FloatArray:
    assert entry.facts is not None
    return _numbers(entry.facts.curve)


_COLUMNS = (
    "name", "serial", "axis", "status", "verdict", "limits_met", "limits_held", "date", "outlier_reason", "judged_on",
    "constant_rms_dph", "improvement", "after_rms_dph", "expanded_uncertainty_dph", "rms_over_floor",
    "noise_floor_dph", "bias_dph", "centers", "table_bytes", "error_bound_dph", "findings", "model_hash", "reason",
)  # fmt: skip

_PICTURES = 60  # of outliers; of more, the words say enough


def summary_of(entries: Sequence[FleetEntry]) -> FleetSummary:
    """Return the content of `fleet.json`."""
    counts = Counter(entry.status for entry in entries)
    copied = copies(entries)
    entries = with_copies(entries, copied)
    figured = [entry for entry in entries if entry.model_hash is not None]
    named = reasons(figured, copied)
    entries = with_reasons(entries, named)
    return FleetSummary(
        gyrotc_version=__version__,
        serial=None,
        axis=None,
        units=len(entries),
        done=counts["done"],
        failed=counts["failed"],
        unfinished=counts["unfinished"],
        figures={f: spread(figured, f) for f in (*FIGURES, "sum_abs_weights_dph", "centers", "table_bytes")},
        outliers=tuple(outlying_units(figured)),
        reasons=tuple(named),
        copies=tuple(copied),
        serials=tuple(entry.unit() for entry in entries),
    )


def write_summary(out: Path, entries: Sequence[FleetEntry]) -> FleetSummary:
    """Write `fleet.json`, `fleet.csv`, `fleet.html` and the runtime of all gyros; return what the first says.

    Raises:
        InputError: There are files of these names that gyrotc did not write.
    """
    summary = summary_of(entries)
    outliers = {reason.name for reason in summary.reasons} | {outlier.name for outlier in summary.outliers}
    known = {entry.name: entry for entry in entries if entry.facts}
    pictures = {
        reason.name: why_outlier(known, reason)
        for reason in summary.reasons[:_PICTURES]
        if reason.name in known and reason.id != "copy_of_other"  # nothing to be seen in it
    }
    page = (
        page_environment()
        .get_template("fleet.html.j2")
        .render(
            summary=summary,
            outliers=outliers,
            picture=rms_of_units([e for e in entries if e.after_rms_dph], outliers),
            curves=curves_of_units(entries, outliers),
            pictures=pictures,
            links={entry.name: _link(out, entry.name) for entry in summary.serials},
            verdicts=Counter(entry.verdict for entry in summary.serials),
            barred=sum(bool(entry.barred) for entry in summary.serials),
        )
    )
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(_COLUMNS)
    for entry in summary.serials:
        cells = (getattr(entry, column) for column in _COLUMNS)
        writer.writerow(csv_cell(" ".join(c) if isinstance(c, tuple) else "" if c is None else c) for c in cells)
    texts = (json_text(summary.content()), table.getvalue(), page)
    if needs := joint_needs(entry.runtime_options for entry in entries if entry.runtime_options):
        with result_folder(out / RUNTIME, "fleet") as stage:
            for name, data in runtime_texts(needs, NUMERICS).items():
                write_own(stage.folder / name, data)
    for name, text in zip(SUMMARY, texts, strict=True):
        write_atomically(out / name, text)
    return summary


def _link(out: Path, name: str) -> str | None:
    """Return the link of a row: the unit's page, else its folder; None if there is neither."""
    try:
        if (out / name / "report.html").is_file():
            return f"{quote(name)}/report.html"
        return f"{quote(name)}/" if (out / name / "model.json").is_file() else None
    except (OSError, ValueError):  # a name as it is shown may be longer than one that a file may have
        return None


_LEAST = 8  # gyros of a kind; fewer do not say what is usual
_FAR = 5.0  # robust standard deviations beyond which one is an outlier
_NEAR = 3.0  # and within which a supposed fault must bring it back
_LEAST_BINS = 4  # cells of 5 C: a shift of a shorter curve is not distinguished from an offset
_LEAST_SHIFT_C = 1.0  # thermometers of a kind agree to this
_LEAST_SCALE, _LEAST_NOISE = 1.25, 1.5  # of a factor, times the usual noise: less is the scatter of a lot
_LEAST_STEP = 1.6  # times the usual score
_FAR_LOG = 4.0  # for logarithms of scores and factors, beside a least ratio
_LEAST_SPIKES = 5  # rows
_LEAST_PROFILE = 6  # temperatures, an hour: fewer do not tell a lag from an offset
_LEAST_LATE_S = 60.0  # thermometers of a kind are mounted alike
_LEAST_WARM_UP = 1.0  # times the noise of a mean: four standard deviations of the median over six runs
_ALIKE = 0.8  # share of the runs in which a warm-up has one sign
_NOT_CALIBRATED = frozenset({"sign_reversed", "axes_exchanged", "scale", "gain_changed", "warm_up"})
# What a run is as a whole comes before what happened in it
_OF_RUN = ("sign_reversed", "axes_exchanged", "unit_changed", "gain_changed")
_IN_RUN = ("restart", "step", "step_and_recover", "ramp", "transition", "jump_in_temperature", "stuck_temperature")


class _Kind:
    """Gyros of one axis, and what is usual among them."""

    def __init__(self, known: Sequence[tuple[FleetEntry, Facts]]) -> None:
        self.entries = entries = [entry for entry, _ in known]
        self.facts = [facts for _, facts in known]
        self.curves = np.array([_numbers(facts.curve) for facts in self.facts])
        self.seen = seen = np.isfinite(self.curves).sum(axis=0) >= max(_LEAST, len(entries) // 2)
        with np.errstate(all="ignore"):
            self.median = np.where(seen, _median(self.curves), np.nan)
            rows = np.where(seen, self.curves, np.nan)
            means = np.nansum(rows, axis=1) / np.maximum(np.isfinite(rows).sum(axis=1), 1)
            self.shapes = self.curves - means[:, None]
            self.shape = np.where(seen, _median(self.shapes), np.nan)
        self.scatter = _scatter(self.curves, self.median)
        self.shape_scatter = _scatter(self.shapes, self.shape)

    def distance(self, curve: FloatArray) -> float:
        """Return the distance of a curve, as it is or about its mean, from the usual one, in robust sigmas."""
        both = np.isfinite(curve) & self.seen
        if both.sum() < _LEAST_BINS:
            return np.inf
        level = (curve - self.median)[both] / self.scatter[both]
        about = curve - curve[both].mean()
        shape = (about - self.shape)[both] / self.shape_scatter[both]
        return float(max(np.sqrt(np.mean(level**2)), np.sqrt(np.mean(shape**2))))

    def factors(self) -> FloatArray:
        """Least-squares factor of each curve against the usual one; 0 where it cannot be determined."""
        both = np.isfinite(self.curves) & self.seen
        usual = np.where(both, self.median, 0.0)
        power = (usual**2).sum(axis=1)
        product = (np.where(both, self.curves, 0.0) * usual).sum(axis=1)
        return np.asarray(np.where(power > 0.0, product / np.where(power > 0.0, power, 1.0), 0.0))


def reasons(entries: Sequence[FleetEntry], copied: Sequence[Copy] = ()) -> list[Reason]:
    """The likeliest reason of every gyro that is an outlier, in the order of the entries."""
    found: dict[str, Reason] = {}
    by_name, axis = {entry.name: entry for entry in entries}, {entry.name: entry.axis for entry in entries}
    for copy in sorted(copied, key=lambda c: axis.get(c.name) != axis.get(c.other)):  # x with x first
        for name, other in ((copy.name, copy.other), (copy.other, copy.name)):
            if name in by_name:
                text = f"copy of another unit: it has {copy.words} with {other}"
                found.setdefault(name, _reason(by_name[name], "copy_of_other", text))
    by_axis: dict[str | None, list[tuple[FleetEntry, Facts]]] = defaultdict(list)
    for entry in entries:
        if entry.facts is not None:
            by_axis[entry.axis].append((entry, entry.facts))
    kinds = {axis: _Kind(known) for axis, known in by_axis.items() if len(known) >= _LEAST}
    mirrored = set(mirrored_units(entries))
    for reason in (*_exchanged(kinds), *_in_order(entries, list(kinds.values()))):
        found.setdefault(reason.name, reason)
    for entry in entries:
        known = found.get(entry.name)
        if entry.name in mirrored and (known is None or known.id == "bias_outlier"):
            text = "sign reversed: its bias over temperature has the shape of that of its kind mirrored"
            found[entry.name] = _reason(entry, "sign_reversed", text)
    return [found[e.name] for e in entries if e.name in found]


def _reason(entry: FleetEntry, id_: str, text: str, file: str | None = None, time_s: float | None = None) -> Reason:
    return Reason(name=entry.name, id=id_, text=text.removesuffix("."), file=file, time_s=time_s)


def with_reasons(entries: Sequence[FleetEntry], named: Sequence[Reason]) -> list[FleetEntry]:
    """The entries with their reasons' words; that it is not calibrated is a finding too."""
    by_name, found = {reason.name: reason for reason in named}, []
    for entry in entries:
        if reason := by_name.get(entry.name):
            more = _NOT_CALIBRATED & {reason.id} - set(entry.findings)
            known = {"outlier_reason": reason.text, "findings": (*entry.findings, *more)}
            entry = entry.model_copy(update=known)  # noqa: PLW2901
        found.append(entry)
    return found


def _exchanged(kinds: dict[str | None, _Kind]) -> Iterator[Reason]:
    """Yield a reason for each of two axes of a unit that show what the other's kind shows."""
    units: dict[str, dict[str, tuple[FleetEntry, FloatArray]]] = defaultdict(dict)
    for axis, kind in kinds.items():
        for entry, curve in zip(kind.entries, kind.curves, strict=True):
            if axis is not None and entry.dataset is not None:
                units[entry.dataset][axis] = (entry, curve)
    for axes in units.values():
        for a, b in permutations(axes, 2):
            one, other = axes[a][1], axes[b][1]
            far, like_b, like_a = kinds[a].distance(one), kinds[b].distance(one), kinds[a].distance(other)
            if far > _FAR and max(like_b, like_a) < _NEAR:
                text = f"axes exchanged: {a} shows what {b} axes show, and {b} what {a} axes show"
                yield _reason(axes[a][0], "axes_exchanged", text)


def _in_order(entries: Sequence[FleetEntry], kinds: Sequence[_Kind]) -> Iterator[Reason]:
    """Yield reasons, those that explain most first: a later reason of the same gyro follows from an earlier one."""
    for rule in (_late, _thermometers, _mirrored_or_scaled):
        yield from (reason for kind in kinds for reason in rule(kind))
    yield from _own(entries, _OF_RUN)
    for rule in (_spikes, _warm_up):
        yield from (reason for kind in kinds for reason in rule(kind))
    yield from _own(entries, _IN_RUN)
    yield from (reason for kind in kinds for reason in _steps(kind))
    yield from _own(entries, ("run_outlier",))  # a run with a step lies off, too
    for rule in (_noise, _bias_outlier):
        yield from (reason for kind in kinds for reason in rule(kind))


def _own(entries: Sequence[FleetEntry], ids: Sequence[str]) -> Iterator[Reason]:
    """Yield reasons that a gyro's own runs show, by the rules of `check` and `diagnose`."""
    for entry in entries:
        if known := [event for event in (entry.facts.own if entry.facts else ()) if event.id in ids]:
            first = min(known, key=lambda event: ids.index(event.id))
            at = first.time_s.value if first.time_s else None
            yield _reason(entry, first.id, first.text, first.file, at)


def _late(kind: _Kind) -> Iterator[Reason]:
    """The programme is the same for all: a thermometer with a bad contact follows it later."""
    found = _lateness(kind.facts)
    usual, scatter = _usual(found) if np.isfinite(found).any() else (0.0, 0.0)
    for entry, late in zip(kind.entries, found, strict=True):
        if abs(late - usual) > max(_FAR * scatter, _LEAST_LATE_S):
            word = "later" if late > usual else "earlier"
            text = f"lag: its thermometer follows the programme about {abs(late - usual):.0f} s {word} than the others"
            yield _reason(entry, "thermometer_late", text)


def _lateness(facts: Sequence[Facts]) -> FloatArray:
    """Return the delay of each gyro's temperatures behind the median of all, s; NaN if nothing changes.

    It is the median over the runs of the gyro.
    """
    late: list[list[float]] = [[] for _ in facts]
    for k in range(max(len(f.runs) for f in facts)):
        profiles = [(n, f.runs[k].profile_c) for n, f in enumerate(facts) if k < len(f.runs)]
        length = min(len(profile) for _, profile in profiles)
        if length < _LEAST_PROFILE:
            continue
        usual = np.median([profile[:length] for _, profile in profiles], axis=0)
        if float(np.ptp(usual)) <= _LEAST_SHIFT_C:
            continue
        change = np.gradient(usual) / PROFILE_S
        for n, profile in profiles:
            lag = lag_of(change, np.array(profile[:length]) - usual)
            if lag is not None:
                late[n].append(-lag[0])
    return np.array([float(np.median(of_gyro)) if of_gyro else float("nan") for of_gyro in late])


def _warm_up(kind: _Kind) -> Iterator[Reason]:
    amplitudes = _run_figures(kind.facts, lambda run: run.warm_up_dph)
    noise = np.nanmedian(_run_figures(kind.facts, lambda run: run.noise_dph), axis=1)
    levels = np.nanmedian(amplitudes, axis=1)
    usual, scatter = _usual(levels)
    for entry, level, of_runs, sigma in zip(kind.entries, levels, amplitudes, noise, strict=True):
        one_sign = float(np.nanmean(np.sign(of_runs) == np.sign(level)))
        if abs(level - usual) > max(_FAR * scatter, _LEAST_WARM_UP * sigma) and one_sign >= _ALIKE:
            text = (
                f"warm-up: every run begins about {level:+.2g} deg/h away and settles within an hour; "
                "gyrotc diagnose measures it, gyrotc build --extend takes it into the table"
            )
            yield _reason(entry, "warm_up", text)


def _thermometers(kind: _Kind) -> Iterator[Reason]:
    """The programme is the same for all: mean temperatures of the runs say which thermometer is an outlier."""
    temperatures = _run_figures(kind.facts, lambda run: run.mean_c)
    shifts = np.nanmedian(temperatures - np.nanmedian(temperatures, axis=0), axis=1)
    _, scatter = _usual(shifts)
    for entry, shift in zip(kind.entries, shifts, strict=True):
        if abs(shift) > max(_FAR * scatter, _LEAST_SHIFT_C):
            reads = f"{abs(shift):.1f} C {'more' if shift > 0.0 else 'less'}"
            text = f"thermometer differs: it reads {reads} than in the same runs of the others"
            yield _reason(entry, "thermometer_offset", text)


def _steps(kind: _Kind) -> Iterator[Reason]:
    scores = _run_figures(kind.facts, lambda run: run.step.score)
    best = np.log(np.maximum(np.nanmax(scores, axis=1), 1e-9))
    usual, scatter = _usual(best)
    for k, entry in enumerate(kind.entries):
        if best[k] > usual + max(_FAR_LOG * scatter, np.log(_LEAST_STEP)):
            run = kind.facts[k].runs[int(np.nanargmax(scores[k]))]
            hours = run.step.time_s / 3600.0
            text = f"step in {run.file} at {hours:.1f} h: the residual moved by {run.step.size_dph:+.2g} deg/h"
            yield _reason(entry, "step", text, run.file, run.step.time_s)


def _spikes(kind: _Kind) -> Iterator[Reason]:
    rows = np.array([float(entry.rows_left_out or 0) for entry in kind.entries])
    usual, scatter = _usual(rows)
    for entry, count in zip(kind.entries, rows, strict=True):
        if count >= max(_LEAST_SPIKES, usual + _FAR * scatter):
            yield _reason(entry, "outliers", f"spikes or bursts: {count:.0f} rows of training were outliers")


def _noise(kind: _Kind) -> Iterator[Reason]:
    noise = _run_figures(kind.facts, lambda run: run.noise_dph)
    ratios = noise / np.maximum(np.nanmedian(noise, axis=0), 1e-300)  # to the same run of the others
    levels = np.log(np.maximum(np.nanmedian(ratios, axis=1), 1e-9))
    usual, scatter = _usual(levels)
    for entry, facts, level, of_runs in zip(kind.entries, kind.facts, levels, ratios, strict=True):
        file = facts.runs[int(np.nanargmax(of_runs))].file
        if level - usual > max(_FAR * scatter, np.log(_LEAST_NOISE)):
            where = "every run" if np.nanmin(of_runs) > _LEAST_NOISE else "most runs"
            shown = facts.series.file if facts.series else file
            text = f"noise: {np.exp(level - usual):.1f} times that of the others in {where}, such as {shown}"
            yield _reason(entry, "noise", text, shown)
        elif np.nanmax(of_runs) > NOISY_RUN:
            yield _reason(entry, "noise", f"noise: in {file} {np.nanmax(of_runs):.1f} times that of the others", file)


def _mirrored_or_scaled(kind: _Kind) -> Iterator[Reason]:
    """Yield a reason for each curve that a change of sign or a factor brings back to those of its kind."""
    factors = kind.factors()
    logs = np.log(np.maximum(factors, 1e-9))
    usual, scatter = _usual(logs)
    for entry, curve, factor, log in zip(kind.entries, kind.curves, factors, logs, strict=True):
        far, kin = kind.distance(curve), _kin(entry)
        scaled = abs(log - usual) > max(_FAR_LOG * scatter, np.log(_LEAST_SCALE))
        if _FAR < far < np.inf and kind.distance(-curve) < min(_NEAR, far / 2.0):
            text = f"sign reversed: its bias over temperature is the mirror image of that of {kin}"
            yield _reason(entry, "sign_reversed", text)
        elif factor > 0.0 and scaled and kind.distance(curve / factor) < _NEAR:
            yield _reason(entry, "scale", f"scale: its rates are {factor:.3g} times those of {kin}")


def _bias_outlier(kind: _Kind) -> Iterator[Reason]:
    """Yield a reason for each curve that is far from those of its kind."""
    for entry, curve in zip(kind.entries, kind.curves, strict=True):
        if _FAR < (far := kind.distance(curve)) < np.inf:
            text = f"bias over temperature differs from that of {_kin(entry)} ({far:.0f} robust standard deviations)"
            yield _reason(entry, "bias_outlier", text)


def _kin(entry: FleetEntry) -> str:
    return f"the other {entry.axis} axes" if entry.axis else "the others"


def _run_figures(facts: Sequence[Facts], figure: Callable[[ComparedRun], float]) -> FloatArray:
    """A figure of every run by its place, NaN where a gyro has fewer runs than others."""
    most = max(len(of_one.runs) for of_one in facts)
    rows = [[figure(run) for run in of_one.runs] for of_one in facts]
    return np.array([row + [np.nan] * (max(most, 1) - len(row)) for row in rows], dtype=np.float64)


def _usual(values: FloatArray) -> tuple[float, float]:
    """Median and robust standard deviation."""
    center = float(np.nanmedian(values))
    return center, MAD_TO_SIGMA * float(np.nanmedian(np.abs(values - center)))


def _numbers(values: Sequence[float | None]) -> FloatArray:
    return np.array([np.nan if v is None else v for v in values], dtype=np.float64)


def _median(rows: FloatArray) -> FloatArray:
    """Median of each column, NaN for one without a number."""
    empty = ~np.isfinite(rows).any(axis=0)
    return np.asarray(np.where(empty, np.nan, np.nanmedian(np.where(empty, 0.0, rows), axis=0)))


def _scatter(rows: FloatArray, center: FloatArray) -> FloatArray:
    """Robust standard deviation of each column; at least a tenth of the largest, for few gyros may agree by chance."""
    found = MAD_TO_SIGMA * _median(np.abs(rows - center))
    largest = float(np.nanmax(found)) if np.isfinite(found).any() else 0.0
    return np.asarray(np.where(np.isfinite(found), np.maximum(found, 0.1 * largest + 1e-300), np.inf))
