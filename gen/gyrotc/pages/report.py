"""`report.html`: one self-contained page from DIR/*.json and DIR/trace/*.csv, with pictures. Computes nothing new.

The first pictures of a lab are bias against temperature, heating and cooling in two colours, and Allan deviation.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import date
from itertools import pairwise
from pathlib import Path

import jinja2
import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
from markupsafe import Markup

from ..causes import CATALOGUE
from ..common.arrays import BoolArray, FloatArray, numpy_of
from ..common.errors import InputError
from ..common.inputs import need_memory, open_input, refuse_above
from ..common.metrics import Averages, average_rows
from ..common.texts import file_stem
from ..mirror.table import HELD
from ..model import Model
from ..recordings.description import exclude_line
from ..results.decision import worst_of
from ..results.evaluation import Calibration, EvaluatedRun
from ..results.files import write_atomically
from ..results.folder import result_folder
from ..results.release import VERDICTS
from ..results.rows import LeftOutRows
from ..results.templates import html_templates
from ..results.training import NoiseTerms, Training
from .chart import ACCENT, AFTER, BEFORE, COVERED, HALF, THIRD, Panel, drawing, side_by_side
from .display import (
    CONSTANT_PASSES,
    COVERAGE,
    bound_words,
    limit_words,
    measured_words,
    plain,
    rounded,
    sci,
    with_uncertainty,
    words,
    words_of_candidate,
)
from .unit import UnitResults, unit_in

_CURVES = (
    ("unexplained", "1 − Σ error-reduction ratio"),
    ("departure", "squared departure from the smooth estimate ÷ noise variance"),
    ("misfit", "cost of the fit"),
)
_LEAST = 1e-12  # of what a logarithmic axis shows: rounding of float64 over the values that are compared
_REST_C_PER_MIN = 0.1  # means at up to this rate are drawn as at rest: a cell of the gathered means
_BAND = 2.0  # sigma that a band reaches, about 95 %


@dataclass(frozen=True, slots=True)
class _Traced:
    """A run of which there is a trace: its means, and times (s) of rows that were left out of training."""

    run: EvaluatedRun
    means: Averages
    left_out_s: list[float]


def _bias_over_time(traced: Sequence[_Traced], constant_dph: float) -> Markup | None:
    """Draw the bias less a constant and less the map, one panel a run, common scales; marks above rows left out."""
    if not traced:
        return None
    rates = np.concatenate([np.r_[one.means.before_dph - constant_dph, one.means.after_dph, 0.0] for one in traced])
    span = (float(rates.min()), float(rates.max()))
    pictures = []
    for k, one in enumerate(traced):
        title = f"{one.run.environment or one.run.file} ({one.run.role})"
        panel = Panel(x="time, h", y="bias, deg/h", title=title, y_range=span)
        first = one.means.time_s[0]
        hours = (one.means.time_s - first) / 3600.0
        panel.horizontal(0.0)
        panel.line(hours, one.means.before_dph - constant_dph, BEFORE, "" if k else "less a constant", width=1.0)
        panel.line(hours, one.means.after_dph, AFTER, "" if k else "compensated", width=1.0)
        if one.left_out_s:
            panel.tops((np.array(one.left_out_s) - first) / 3600.0)
        pictures.append(drawing([panel], width=THIRD, height=110.0))
    return side_by_side(*pictures)


def map_with_centers(model: Model) -> Markup | None:
    """Draw the map less its constant over the envelope, hatched where there was no training data; and cuts through it.

    The constant can be thousands of times the swing of the map, which no scale would show beside it.
    """

    def swing(t: FloatArray, rate: FloatArray) -> FloatArray:
        return np.asarray(model.map_dph(t, rate) - model.fallback_dph)

    (t0, t1), (r0, r1) = _shown(model.envelope.temperature_c), _shown(model.envelope.slope_c_per_min)
    t, r = np.linspace(t0, t1, 160), np.linspace(r0, r1, 80)
    tt, rr = np.meshgrid(t, r)
    seen = model.coverage
    hidden = np.array([[c == "0" for c in row] for row in seen.rows]) if seen is not None else None
    surface = Panel(x="temperature, C", y="dT/dt, C/min", title="dots: centers (rings: beyond); hatched: not trained")
    surface.image(swing(tt, rr), (t0, t1), (r0, r1), "bias less a constant, deg/h", hidden)
    centers = np.array([c for network in model.networks for c in network.centers]).reshape(-1, 2)
    places = np.clip(centers, (t0, r0), (t1, r1))
    within = np.all(places == centers, axis=1)
    for of, hollow in ((within, False), (~within, True)):
        surface.dots(places[of, 0], places[of, 1], ACCENT, size=7.0, hollow=hollow)
    cuts = Panel(x="temperature, C", y="bias less a constant, deg/h", title="cuts through the map")
    for rate, dash, color in zip(np.linspace(r0, r1, 3), ("5 3", "", "1.5 2.5"), (AFTER, COVERED, BEFORE), strict=True):
        label = f"{round(rate, 2) + 0.0:+.2f} C/min".replace("-", "−")  # + 0.0: not "-0.00"
        cuts.line(t, swing(t, np.full_like(t, rate)), color, label, dash=dash, width=1.4)
    return side_by_side(drawing([surface], width=HALF, height=240.0), drawing([cuts], width=HALF, height=220.0))


def _shown(limits: tuple[float, float]) -> tuple[float, float]:
    """Return the limits of an axis: those of the envelope, widened a little if they are one value."""
    low, high = limits
    return limits if high > low else (low - 0.5, high + 0.5)


def curve_by_size(training: Training) -> Markup | None:
    """Draw the gain of each further center: error left over the number of centers, the chosen one marked."""
    sizes = training.curves.get("sizes") or []
    if len(sizes) < 2:
        return None
    panel = Panel(x="number of centers", y_log=True, whole_x=True)
    keys = [(k, label) for k, label in _CURVES if all(s.get(k) is not None for s in sizes)]
    n = [s["centers"] for s in sizes]
    for (key, label), color in zip(keys, (AFTER, BEFORE, COVERED), strict=False):
        values = np.maximum([s[key] for s in sizes], _LEAST)
        panel.line(n, values, color, label)
        panel.dots(n, values, color, size=6.0)
    chosen = training.curves.get("chosen")
    if chosen is not None:
        panel.vertical(chosen, label=f"chosen: {chosen}", dash="5 3")
    return drawing([panel], width=HALF)


_MOST_NAMED = 12  # dates that fit below a panel


def calibrations_over_time(history: Sequence[Calibration]) -> Markup | None:
    """RMS as found and as left, and the map's mean against the first calibration's; None with fewer than two."""
    if len(history) < 2:
        return None
    at, dated = _steps_of_time(history)
    named = dated and len(at) <= _MOST_NAMED
    ticks = [(t, str(one.date)[:10]) for t, one in zip(at, history, strict=True)] if named else None
    words = "" if named else "days since the first calibration" if dated else "number of the calibration"
    left = Panel(x=words, y="RMS of what remains, deg/h", y_range=(0.0, None), x_ticks=ticks, whole_x=True)
    for label, color, values in (
        ("as found: the correction before", BEFORE, [one.as_found_rms_dph for one in history]),
        ("as left: the new one", AFTER, [one.as_left_rms_dph for one in history]),
    ):
        known = np.array([(t, v) for t, v in zip(at, values, strict=True) if v is not None])
        if known.size:
            left.line(known[:, 0], known[:, 1], color, label)
            left.dots(known[:, 0], known[:, 1], color, size=6.0)
    right = Panel(x=words, y="mean of the map, deg/h", x_ticks=ticks, whole_x=True)
    _moved(right, at, history)
    return side_by_side(drawing([left], width=HALF), drawing([right], width=HALF))


def _steps_of_time(history: Sequence[Calibration]) -> tuple[list[float], bool]:
    """Return days since the first if each has a later date than the one before, else the number of each."""
    try:
        days = [float(date.fromisoformat(str(one.date)[:10]).toordinal()) for one in history]
    except ValueError:
        days = []
    if days and all(b > a for a, b in pairwise(days)):
        return [day - days[0] for day in days], True
    return [float(k) for k in range(1, len(history) + 1)], False


def _moved(panel: Panel, at: Sequence[float], history: Sequence[Calibration]) -> None:
    """Draw the summed steps of the map's mean, each with the U of its movement, filled where that is exceeded."""
    steps = [one.moved_mean_dph or 0.0 for one in history]
    total = np.cumsum(steps) - steps[0]
    panel.horizontal(0.0)
    panel.line(at, total, COVERED, "since the first calibration")
    spread = np.array([(one.expanded_uncertainty_dph or np.nan) if k else np.nan for k, one in enumerate(history)])
    panel.errors(at, total - spread, total + spread, AFTER)
    more = np.array([bool(one.significant) for one in history])
    x = np.array(at)
    if more.any():
        panel.dots(x[more], total[more], AFTER, "moved by more than U", size=8.0)
    panel.dots(x[~more], total[~more], AFTER, size=8.0, hollow=True)


def prior_and_posterior(training: Training, constant_dph: float) -> Markup | None:
    """Prior, recordings and posterior where temperature stands still, less a constant; None where nothing was known."""
    if training.lot is not None:
        curve, name = training.lot.curve, f"the lot alone, {training.lot.units} units"
    elif training.prior is not None:
        curve, name = training.prior.curve, "the earlier model after ageing"
    else:
        return None
    if curve is None:
        return None
    t = np.array(curve.temperature_c)
    panel = Panel(x="temperature, C", y="bias at rest less a constant, deg/h")
    for mean, sigma, color, label in (
        (curve.prior_dph, curve.prior_sigma_dph, COVERED, name),
        (curve.posterior_dph, curve.posterior_sigma_dph, AFTER, "with this unit's own runs"),
    ):
        middle, half = np.array(mean) - constant_dph, _BAND * np.array(sigma)
        panel.band(t, middle - half, middle + half, color)
        panel.line(t, middle, color, label, width=1.4)
    if (means := training.means) is not None:
        still = np.abs(means.slope_c_per_min) <= _REST_C_PER_MIN
        at = np.array(means.temperature_c)[still], np.array(means.bias_dph)[still] - constant_dph
        panel.dots(*at, BEFORE, "its recordings at rest")
    return drawing([panel], width=HALF)


_TRACE_COPIES = 3.0 * 8.0 * 5  # bytes a row of its five columns while they are averaged
_LEAST_ROW_BYTES = 12  # six cells and their commas


def write_report(folder: Path) -> Path:
    """Write `folder/report.html` from what stands in the folder, and return its path.

    Raises:
        InputError: `model.json` or `evaluate.json` is missing or broken, or the unit is not known.
    """
    unit = unit_in(folder)
    with page_from(folder):
        pictures = _pictures(folder, unit)
        template = page_environment().get_template("report.html.j2")
        of_file: dict[str, list[LeftOutRows]] = {}
        for stretch in unit.left_out:
            of_file.setdefault(stretch.file, []).append(stretch)
        left_out = [  # files, stretches of them, and the line that leaves these out of all figures
            (name, mine, exclude_line(((s.from_s, s.to_s) for s in mine), "left out")) for name, mine in of_file.items()
        ]
        text = template.render(unit=unit, pictures=pictures, left_out=left_out, **vars(unit))
    return write_page(folder, text)


def axes_page(folder: Path, axes: Sequence[str]) -> str:
    """The page of a unit with several axes, each in a folder of its name: those that failed first.

    Raises:
        InputError: A result of an axis is missing or broken.
    """
    units = [unit_in(folder / axis) for axis in axes]
    with page_from(folder):
        ordered = sorted(units, key=lambda unit: (-VERDICTS.index(unit.decision or "PASS"), -unit.counts["FAIL"]))
        pictures = {u.model.axis: thermal_picture(folder / str(u.model.axis), u) for u in units}
        worst = worst_of(unit.decision for unit in units) or ""
        template = page_environment().get_template("axes.html.j2")
        trends = {unit.model.axis: _trend(unit) for unit in units}
        return template.render(units=ordered, pictures=pictures, trends=trends, verdict=worst)


def write_page(folder: Path, text: str) -> Path:
    """Write `folder/report.html` and return its path.

    Raises:
        InputError: There is one that gyrotc did not write, or that was changed since.
    """
    with result_folder(folder, "report", kind="", entries=("report.html",)) as stage:
        write_atomically(stage.folder / "report.html", text)
    return folder / "report.html"


@functools.cache
def page_environment() -> jinja2.Environment:
    """Return the templates of pages, compiled once in a process.

    Filters print figures and words (`words`); the test `moved_input` tells causes that change what the map sees.
    """
    environment = html_templates(
        sci=sci, times=_times, known=with_uncertainty, plain=plain, rounded=rounded,
        words=words, candidate=words_of_candidate, limit_words=limit_words, bound_words=bound_words,
        measured_words=measured_words,
    )  # fmt: skip
    environment.globals["all_verdicts"] = VERDICTS
    environment.globals["constant_passes"] = CONSTANT_PASSES
    environment.filters["number"] = lambda value, digits=2: "–" if value is None else f"{value:.{digits}f}"
    environment.filters["chance"] = lambda value: "< 0.1 %" if value < 1e-3 else f"{100.0 * value:.2g} %"
    environment.tests["moved_input"] = lambda id: id in CATALOGUE and CATALOGUE[id].kind == "input"
    return environment


@contextmanager
def page_from(source: Path) -> Iterator[None]:
    """Refuse results that cannot be drawn: drawing computes nothing, so they are not as they were written.

    Raises:
        InputError: It stumbled.
    """
    try:
        yield
    except (ArithmeticError, LookupError, TypeError, ValueError, AttributeError, jinja2.TemplateError) as error:
        what = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise InputError(str(source), f"no page can be made of it ({what})", "results as gyrotc wrote them") from error


def _pictures(folder: Path, unit: UnitResults) -> dict[str, Markup | None]:
    traced, training = list(_traced(folder, unit)), unit.training
    return {
        "thermal": bias_against_temperature(unit.model, [one.means for one in traced]),
        "residuals": side_by_side(*residual_pictures([one.means for one in traced])),
        "bias": _bias_over_time(traced, unit.model.fallback_dph),
        "map": map_with_centers(unit.model),
        "curve": curve_by_size(training) if training else None,
        "lot": prior_and_posterior(training, unit.model.fallback_dph) if training else None,
        "allan": allan_deviation(training.noise) if training else None,
        "trend": _trend(unit),
    }


def thermal_picture(folder: Path, unit: UnitResults) -> Markup | None:
    """Draw the bias of one axis and its residual against temperature, from the traces; None without traces."""
    means = [one.means for one in _traced(folder, unit)]
    return side_by_side(bias_against_temperature(unit.model, means), *residual_pictures(means))


def _trend(unit: UnitResults) -> Markup | None:
    return calibrations_over_time(unit.changes.history) if unit.changes else None


def _traced(folder: Path, unit: UnitResults) -> Iterator[_Traced]:
    """Yield the runs of a result that have a trace."""
    for run in unit.evaluation.runs:
        means = trace_means(folder / "trace", run, unit.evaluation.average_s)
        if means is not None and means.time_s.size:
            mine = [s.from_s for s in unit.left_out if s.file == run.file and run.role == "train"]
            first, last = means.time_s[0], means.time_s[-1]
            yield _Traced(run, means, [t for t in mine if first <= t <= last])


def trace_means(folder: Path, run: EvaluatedRun, average_s: float) -> Averages | None:
    """Return the means of a run from its trace; None if the folder has none.

    Raises:
        InputError: The trace cannot be read, or its times do not increase.
    """
    start = f"@{run.from_s or 0.0:g}"
    stems = (file_stem(run.file.replace("/", "_")), file_stem(Path(run.file).stem))
    names = [stem + end + ".csv" for stem in stems for end in (start, "")]
    path = next((folder / n for n in names if (folder / n).is_file()), None)
    if path is None:
        return None
    names = ["time_s", "temperature_c", "rate_dph", "compensated_dph", "status"]
    types = pacsv.ConvertOptions(include_columns=names, column_types=dict.fromkeys(names, pa.float64()))
    file, size = open_input(path, str(path), "a trace")
    refuse_above("recording_mib", size / 2**20, str(path), "MiB")
    need_memory(_TRACE_COPIES * size / _LEAST_ROW_BYTES, str(path), "its rows")
    with file:
        try:
            read = pacsv.read_csv(file, pacsv.ReadOptions(use_threads=False), convert_options=types)
        except pa.ArrowException as error:
            raise InputError(str(path), str(error).splitlines()[0], "a trace as gyrotc wrote it") from error
    columns = [[np.zeros(0), *map(numpy_of, column.chunks)] for column in read.columns]
    del read
    time_s = np.concatenate(columns[0])
    if not (np.isfinite(time_s).all() and np.all(time_s[1:] > time_s[:-1])):
        raise InputError(f"{path}, column time_s", "times that do not increase", "a trace as gyrotc wrote it")
    # Rows without a correction of their own would set the scale: before the first one, the whole bias remains.
    scored = np.concatenate(columns.pop()).astype(np.int64) & HELD == 0
    del time_s
    # Popped, so that a full-rate trace is not in memory twice.
    return average_rows(*(np.concatenate(columns.pop(0)) for _ in names[:-1]), scored=scored, average_s=average_s)


def _times(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.2f}×" if value < 9.995 else f"{value:.1f}×" if value < 99.95 else f"{value:.0f}×"


MOVING_C_PER_MIN = 0.1
"""Slower than that temperature stands still: no chamber's programme asks for less, and a hold drifts by less."""
_DOT = 2.5  # points, across
_FLOOR_OVER_B = float(np.sqrt(2.0 * np.log(2.0) / np.pi))  # IEEE Std 952-2020, annex C
_TAU_OVER_Q = float(np.sqrt(3.0))  # Allan deviation times averaging time over Q: the same annex


def sorted_by_rate(slope: FloatArray) -> tuple[tuple[str, str, BoolArray], ...]:
    """Heating, cooling and held: words, colour and which rows."""
    return (
        ("held", COVERED, np.abs(slope) <= MOVING_C_PER_MIN),
        ("heating", BEFORE, slope > MOVING_C_PER_MIN),
        ("cooling", AFTER, slope < -MOVING_C_PER_MIN),
    )


def bias_against_temperature(model: Model, runs: Sequence[Averages]) -> Markup | None:
    """Draw the bias over temperature, with the map and its U, and below it what remains, on one scale.

    The constant that the table falls back to is taken off above, so that a large one does not flatten both.

    Args:
        runs: Means of every run that has some.
    """
    means = _joined(runs)
    if means is None:
        return None
    t, before, after, slope = means
    kinds = [kind for kind in sorted_by_rate(slope) if kind[2].any()]
    constant = f"{model.fallback_dph:+.4g}".replace("-", "−")
    above = Panel(y="deg/h", title=f"before, less a constant of {constant} deg/h")
    below = Panel(x="temperature, C", y="deg/h", title="after, on the same scale")
    for panel in (above, below):
        panel.horizontal(0.0)
    for label, color, of in kinds:
        above.dots(t[of], before[of] - model.fallback_dph, color, label, size=_DOT)
        below.dots(t[of], after[of], color, size=_DOT)
    _fit(above, model, kinds, slope)
    return drawing([above, below], width=HALF, height=100.0, share_x=True, share_y=True)


def residual_pictures(runs: Sequence[Averages]) -> tuple[Markup, ...]:
    """Draw what remains over temperature and over its rate, each on its own scale; nothing without means."""
    means = _joined(runs)
    if means is None:
        return ()
    t, _, after, slope = means
    over_t = Panel(x="temperature, C", y="residual, deg/h", title="what remains, over temperature")
    over_rate = Panel(x="dT/dt, C/min", y="residual, deg/h", title="what remains, over dT/dt")
    for panel, x in ((over_t, t), (over_rate, slope)):
        panel.horizontal(0.0)
        for label, color, of in sorted_by_rate(slope):
            if of.any():
                panel.dots(x[of], after[of], color, label, size=_DOT)
    return tuple(drawing([panel], width=HALF, height=210.0) for panel in (over_t, over_rate))


def _joined(runs: Sequence[Averages]) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray] | None:
    """Return temperature, rate before and after, and rate of temperature of all means; None where there are none."""
    there = [a for a in runs if a.time_s.size]
    if not there:
        return None
    slope = np.concatenate(  # zero of a single one
        [np.gradient(a.temperature_c, a.time_s / 60.0) if a.time_s.size > 1 else np.zeros(1) for a in there]
    )
    t, before, after = (
        np.concatenate([getattr(a, name) for a in there]) for name in ("temperature_c", "before_dph", "after_dph")
    )
    return t, before, after, slope


def _fit(panel: Panel, model: Model, kinds: Sequence[tuple[str, str, BoolArray]], slope: FloatArray) -> None:
    """Draw the map less its constant: at the median rate of heating and of cooling, and at rest with its band of U."""
    t0, t1 = model.envelope.temperature_c
    t = np.linspace(t0, t1, 160) if t1 > t0 else np.array([t0 - 0.5, t0 + 0.5])
    rest = model.map_dph(t, np.zeros_like(t)) - model.fallback_dph
    sigma = model.sigma_dph(t, np.zeros_like(t))
    if sigma is not None:
        panel.band(t, rest - COVERAGE * sigma, rest + COVERAGE * sigma, ACCENT, "U, k = 2")
    panel.line(t, rest, ACCENT, "map at rest", width=1.4)
    for label, color, of in kinds:
        if label != "held":
            rate = float(np.median(slope[of]))
            words = f"{rate:+.2g} C/min".replace("-", "−")
            panel.line(t, model.map_dph(t, np.full_like(t, rate)) - model.fallback_dph, color, words, dash="5 3")


def allan_deviation(noise: NoiseTerms) -> Markup | None:
    """Allan deviation over averaging time with its uncertainty, and the lines of N, B, K and Q that are resolved.

    N: sigma = N / sqrt(tau); B: sigma = B sqrt(2 ln 2 / pi); K: sigma = K sqrt(tau / 3); Q: sigma = sqrt(3) Q / tau
    (IEEE Std 952-2020, annex C; IEEE Std 647 has the same).
    """
    points = [p for p in noise.allan if p.deviation_dph > 0.0]
    if len(points) < 2:
        return None
    tau, value, freedom = (
        np.array([getattr(p, name) for p in points]) for name in ("tau_s", "deviation_dph", "freedom")
    )
    panel = Panel(x="averaging time, s", y="Allan deviation, deg/h", x_log=True, y_log=True)
    spread = value / np.sqrt(2.0 * freedom)
    low, high = np.maximum(value - spread, 0.1 * value), value + spread
    panel.y_range = (float(low.min()) / 1.5, float(high.max()) * 1.5)
    at = np.geomspace(tau[0], tau[-1], 60)
    n, b = noise.arw_deg_per_sqrt_h, noise.bias_instability_dph
    k, q = noise.rate_random_walk_dph_per_sqrt_h, noise.quantisation_arcsec
    if n:
        panel.line(at, 60.0 * n / np.sqrt(at), BEFORE, f"N = {sci(n)} deg/√h", dash="5 3")
    if b:
        panel.horizontal(b * _FLOOR_OVER_B, COVERED, f"B = {sci(b)} deg/h", dash="5 3", width=1.2)
    if k:
        panel.line(at, k * np.sqrt(at / 3600.0 / 3.0), ACCENT, f"K = {sci(k)} deg/h/√h", dash="2 3")
    if q:
        panel.line(at, _TAU_OVER_Q * q / at, COVERED, f"Q = {sci(q)} arcsec", dash="2 3")
    panel.errors(tau, low, high, AFTER)
    panel.line(tau, value, AFTER, "compensated training records")
    panel.dots(tau, value, AFTER, size=6.0)
    return drawing([panel], width=HALF)
