"""Recorded channels as inputs: what the target would see of each, its shape, and what stands in where it is lost.

A table holds functions of up to four channels: straight lines, and where cross-validation shows it bent ones or a slope
that depends on the temperature. Candidates are the recorded channels as they are, and of thermometers their
differences: to the gyro's own, and between any two of them, for what one thermometer shows the map holds already. Of a
difference the firmware passes the difference. `regressors` chooses.

A shape is the record of one term, whose columns at fixed centers and width are linear in their weights. The centers lie
at a quarter and three quarters of what training showed, 0.9 of its half range wide: of squares, cubes, saturations and
exponentials over the range that leaves one to two hundredths of the variance that a line leaves, of a corner a
twentieth.

A fallback model is fitted to what map and other terms leave of the training samples, so that both together are
the best correction of one thermometer that these samples give. The fit is that of a map, which takes no more Gaussians
than the noise can show.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, Literal

import numpy as np
from numpy.polynomial.chebyshev import chebval
from numpy.typing import NDArray

from ..causes import CATALOGUE
from ..causes.base import Cause, History
from ..common.arrays import FloatArray
from ..mirror.front_end import with_missing
from ..mirror.history import channel_at
from ..mirror.kinds import TableKind
from ..mirror.readings import Guarded
from ..mirror.recursions import F32, CourseChannel
from ..model import Model
from ..recordings.records import Dataset, Rows, Run
from ..recordings.units import channel_kind
from ..results.training import ChannelTried
from .data import Scaling, TrainingData, scaling_of
from .gaussian import TrainingFailed
from .methods import fit
from .networks import rescaled, snapped
from .plausibility import channel_guard
from .regressors import Beside, RegressorChoice, Regressors, choose_regressors, enrich
from .result import predict
from .samples import Blocks

ShapeId = Literal["line", "product", "curve"]

#: The simplest first, and the kind of the record of each.
SHAPES: dict[ShapeId, TableKind] = {"line": TableKind.AUXILIARY, "product": TableKind.PRODUCT, "curve": TableKind.CURVE}
_SHOWN = (0.002, 0.998)  # quantiles of a channel between which its range is taken: spikes are none of it
# In half ranges: least of what is left of bent functions, among 0.25 to 1.2 and 0.4 to 1.5.
_CENTER, _WIDTH = 0.5, 0.9
_NARROWEST = 0.01  # in the unit of the channel: 1.2/width in 2^-24 fits a word of fixed point from 0.0094 on


@dataclass(frozen=True)
class ChannelShape:
    """One of the functions that a channel may add.

    Attributes:
        id: Which.
        cause: Its term.
        values: Parameters of the term that are not weights.
        columns: At every training sample, shape (n, k); of a channel that shows nothing there: of its median.
        lost: The same with the median of the channel in its place everywhere: what a table knows when it is lost.
    """

    id: ShapeId
    cause: Cause
    values: Mapping[str, float]
    columns: FloatArray
    lost: FloatArray

    @property
    def is_held(self) -> bool:
        """True if tables of both arithmetics can hold it."""
        return self.values.get("width", _NARROWEST) >= _NARROWEST

    def parameters(self, weights: FloatArray) -> dict[str, float]:
        """Parameters of the term with these weights."""
        assert self.cause.amplitudes is not None
        return {**self.cause.amplitudes(weights), **self.values}

    def slope(self, added: FloatArray) -> float:
        """Return the slope of the line through what it adds at every training sample, deg/h per unit."""
        line = self.columns[:, 0] - self.columns[:, 0].mean()
        return float(line @ added / (line @ line))

    def sigma_dph(self, weights: FloatArray) -> float:
        """RMS over training of what the correction lacks when the channel is lost."""
        return float(np.sqrt(np.mean(((self.columns - self.lost) @ weights) ** 2)))


def shape_of(id: ShapeId, values: FloatArray, reference: float, samples: TrainingData) -> ChannelShape:
    """A function of a channel.

    Args:
        id: Which.
        values: The channel at every sample, NaN where it shows nothing.
        reference: Mean of the channel.
        samples: The training samples.
    """
    cause = next(c for c in CATALOGUE.values() if c.table is not None and c.table.kind == SHAPES[id])
    fixed = _fixed(id, values, reference, samples)
    median = float(np.nanmedian(values))
    shown = np.where(np.isfinite(values), values, median)
    columns, lost = (_columns(cause, fixed, samples, channel) for channel in (shown, np.full(len(values), median)))
    return ChannelShape(id, cause, fixed, columns, lost)


def _columns(cause: Cause, fixed: Mapping[str, float], samples: TrainingData, channel: FloatArray) -> FloatArray:
    assert cause.features is not None
    found = cause.features(History(samples.time_s, samples.temperature_c, channel=channel), fixed)
    # Of a line alone the reference is no parameter of its column: the constant is the map's.
    return found - fixed["reference"] if found.shape[1] == 1 else found


def _fixed(id: ShapeId, values: FloatArray, reference: float, samples: TrainingData) -> dict[str, float]:
    if id == "product":
        middle_c = 0.5 * float(samples.temperature_c.min() + samples.temperature_c.max())
        return {"reference": reference, "reference_c": middle_c}
    if id == "curve":
        low, high = (float(x) for x in np.nanquantile(values, _SHOWN))
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        return {"reference": middle - _CENTER * half, "second_center": middle + _CENTER * half, "width": _WIDTH * half}
    return {"reference": reference}


_METHODS = ("mrbf", "linear", "constant")  # the first whose map keeps to the samples


@dataclass(frozen=True, slots=True)
class FallbackModel:
    """Substitute of a term whose channel is not known.

    Attributes:
        network: As `model.json` has it, in the scale of the model.
        added: What it adds at every training sample, deg/h, shape (n,).
        sigma_dph: 1 σ of what the term would have added about it, at the next power-on.
    """

    network: dict[str, Any]
    added: FloatArray
    sigma_dph: float


def fallback_model_of(model: Model, samples: TrainingData, effect: FloatArray) -> FallbackModel | None:
    """The fallback model of a term; None where nothing can be fitted.

    Args:
        model: The model with its map.
        samples: Those that the map was trained on, without what the terms add.
        effect: What the term adds at these samples, deg/h; NaN where its channel is not known, shape (n,).
    """
    known = np.isfinite(effect)
    seen = samples.select(known)
    of_map = model.map_dph(seen.temperature_c, seen.slope_c_per_min)
    target = replace(seen, bias_dph=seen.bias_dph - of_map + effect[known])
    scale = model.to_dict()["scale"]
    for method in _METHODS:
        try:
            found = fit(target, method=method, average_s=model.average_s)
        except TrainingFailed:
            continue
        if any(finding["id"] == "map_beyond_data" for finding in found.findings):
            continue
        added = predict(found, samples.temperature_c, samples.slope_c_per_min)
        network = snapped(rescaled(found.networks[0], found.scale, scale), scale)
        return FallbackModel(network, added, _next_rms(effect[known] - added[known], seen.run))
    return None


def _next_rms(left: FloatArray, run: NDArray[np.int64]) -> float:
    """Return the RMS to expect at the next power-on: spread within the runs, and of their means as few runs show it."""
    _, index, count = np.unique(run, return_inverse=True, return_counts=True)
    mean = np.bincount(index, left) / count
    within = float(np.mean((left - mean[index]) ** 2))
    n = len(count)
    # A run more has the variance of Student's t with n - 1 degrees of freedom about a mean of n.
    few = (1.0 + 1.0 / n) * (n - 1.0) / max(n - 3.0, 1.0)
    between = float(np.var(mean, ddof=1)) * few if n > 1 else float(mean[0] ** 2)
    return float(np.sqrt(within + between))


MOST_TERMS = 4  # of a table: GTC_MAX_TERMS of gtc.h
_MOST_MISSING = 0.1  # a channel that is away for longer has not been seen beside what it should explain
_STILL = 1e-9  # change of a channel, of its size, that is rounding
_OWN = 1e-3  # share of its spread: noise and steps of a sensor alone are more
_DEGREE = 10  # in temperature: compensations in firmware have polynomials of a lower one
_CARRIES = 0.25  # correlation of fast changes with those of the rate; below it most of the noise is not in common
_SIGMAS = 6.0  # and it must be no luck: 1/sqrt(n) is one of these
_ALIKE = 0.98  # correlation beside the map: weights of both would be a seventh as well known as that of one


@dataclass(frozen=True)
class ChannelChoice:
    """Choice among the channels.

    Attributes:
        trial: What was tried on history left out.
        shapes: What each chosen channel adds, by its name.
        added: What the chosen ones add at every training sample, deg/h.
        effects: The same of each alone; NaN where the channel is not known.
        rows: Every candidate and every channel that is none.
    """

    trial: RegressorChoice
    shapes: Mapping[str, ChannelShape]
    added: FloatArray
    effects: Mapping[str, FloatArray]
    rows: tuple[ChannelTried, ...]


_OPEN = Guarded(  # as of a channel without a guard: every reading passes
    low=np.float32(-1e9),
    high=np.float32(1e9),
    max_step=np.float32(1e9),
    max_rate=np.float32(0.0),
    agree_us=0,
    stuck_us=0,
    missing_blocks=0,
    takes_edge=True,
)


def channel_shown(blocks: Blocks, column: FloatArray) -> CourseChannel:
    """A channel as the target sees it at every correction; NaN where it shows nothing."""
    readings = with_missing(F32, F32.numbers(column), blocks.stream.placed)
    guard = replace(_OPEN, missing_blocks=blocks.settings.guard.missing_blocks)
    shown = channel_at(F32, readings, guard, np.float32(np.nan), blocks.settings, blocks.steps)
    return replace(shown, mean=shown.mean.astype(np.float64))


def readings_alone(rows: Rows) -> Rows:
    """Drop times and rates from rows: channels do not need them, and in a long recording they fill memory."""
    return replace(rows, time_s=np.zeros(0), rate_dph=np.zeros(0))


def seen_by_target(dataset: Dataset, rows: Rows, blocks: Blocks) -> dict[str, FloatArray]:
    """Recorded channels and differences of thermometers at the training samples of a run, in their units."""
    at = blocks.in_force[blocks.used]
    return {name: channel_shown(blocks, rows.channel(name)).mean[at] for name in _names(dataset)}


def _names(dataset: Dataset) -> list[str]:
    """List the candidates by name: "a" or "a - b"."""
    warm = [name for name in dataset.channels if channel_kind(name, dataset.units) == "temperature"]
    pairs = [(a, "temperature_c") for a in warm] + list(combinations(warm, 2))
    return [n for n in dataset.channels if n not in warm] + [f"{a} - {b}" for a, b in pairs]


def chosen_channels(
    dataset: Dataset,
    samples: TrainingData,
    power_on: NDArray[np.int64] | None,
    columns: Mapping[str, FloatArray],
    average_s: float,
) -> ChannelChoice | None:
    """Choose channels; None if there is no candidate.

    Args:
        dataset: The recordings.
        samples: Training samples in order.
        power_on: Number of the power-on of each run, by its index; None: each run is one.
        columns: Of every candidate at these samples, shape (n,) each.
        average_s: Averaging of what is judged, s.

    Raises:
        TrainingFailed: There is no map to judge them with.
    """
    if not columns:
        return None
    scaling = scaling_of(samples)
    against = {n: _objection(dataset, n, v, samples, scaling) for n, v in columns.items()}
    able = {n: v for n, v in columns.items() if not against[n]}
    known = np.all([np.isfinite(v) for v in able.values()], axis=0) if able else np.ones(len(samples), bool)
    references = {n: float(v[known].mean()) for n, v in able.items()}
    lines = {n: shape_of("line", v, references[n], samples) for n, v in able.items()}
    seen, of = {n: line.columns[known] for n, line in lines.items()}, samples.select(known)
    arguments = of, scaling, power_on
    alike = _alike(Beside.of(*arguments, Regressors(seen), {}, average_s))
    regressors = Regressors(seen, {n: frozenset(others) for n, others in alike.items()})
    trial = choose_regressors(*arguments, regressors, average_s, MOST_TERMS)
    shapes = {n: _shapes(lines[n], able[n], samples) for n in trial.chosen}
    trial, chosen = _bent(trial, shapes, arguments, known, average_s)
    parts = {n: chosen[n].columns @ trial.weights[n] for n in trial.chosen}
    added = np.sum(list(parts.values()), axis=0) if parts else np.zeros(len(samples))
    rows = [_row(n, trial, chosen, parts, samples, against[n], alike.get(n, {})) for n in columns]
    effects = {n: np.where(np.isfinite(columns[n]), part, np.nan) for n, part in parts.items()}
    return ChannelChoice(trial, chosen, added, effects, tuple(rows))


def _shapes(line: ChannelShape, values: FloatArray, samples: TrainingData) -> tuple[ChannelShape, ...]:
    """The line of a channel and what may take its place."""
    reference = line.values["reference"]
    others = [shape_of(id, values, reference, samples) for id in SHAPES if id != line.id]
    return (line, *(shape for shape in others if shape.is_held))


def _bent(
    plain: RegressorChoice,
    shapes: Mapping[str, tuple[ChannelShape, ...]],
    arguments: tuple[TrainingData, Scaling, NDArray[np.int64] | None],
    known: NDArray[np.bool_],
    average_s: float,
) -> tuple[RegressorChoice, dict[str, ChannelShape]]:
    """Return what the taken channels add: lines, or a richer shape where left-out history shows that it is better.

    Every richer shape is the line and columns behind it, so only these are tried.
    """
    found = {name: line for name, (line, *_) in shapes.items()}
    if not found:
        return plain, found
    behind = {f"{s.id} of {name}": (name, s) for name, (_, *others) in shapes.items() for s in others}
    columns = {name: line.columns[known] for name, line in found.items()}
    columns |= {part: shape.columns[known, 1:] for part, (_, shape) in behind.items()}
    richer = {name: [part for part, (n, _) in behind.items() if n == name] for name in shapes}
    trial = enrich(*arguments, Regressors(columns), plain, richer, average_s)
    weights, rms = dict(trial.weights), list(trial.left_out_rms_dph)
    for part in (p for p in trial.chosen if p in behind):
        name, found[name] = behind[part]
        weights[name] = np.concatenate([weights[name], weights.pop(part)])
        rms[trial.chosen.index(part)] = np.nan  # between the line and what stands behind it
    path = tuple(x for x in rms if not np.isnan(x))
    return replace(trial, chosen=plain.chosen, weights=weights, left_out_rms_dph=path), found


def _objection(dataset: Dataset, name: str, values: FloatArray, samples: TrainingData, scaling: Scaling) -> str:
    """Return the reason why a channel must not be an input; empty if it may."""
    if channel_kind(name, dataset.units) == "rate":
        return "it is a rate: it would compensate the gyro with what it measures"
    known = np.isfinite(values)
    if np.mean(~known) > _MOST_MISSING:
        return f"no reading in {np.mean(~known):.0%} of the training samples"
    own = values[known]
    if np.ptp(own) <= _STILL * (1.0 + float(np.abs(own).max())):
        return "it does not change in the training runs"
    common = _common_noise(values, samples)
    if common > 0.0:
        return f"it carries the rate: their fast changes are correlated by {common:.2f}"
    left = _less_smooth(own, samples.select(known), scaling)
    if float(np.std(left)) < _OWN * float(np.std(own)):
        return "temperature and its rate say it to a thousandth: the map holds it, or it is a compensation's output"
    return ""


def _common_noise(values: FloatArray, samples: TrainingData) -> float:
    """Correlation of second differences with those of the rate where it is more than luck; else 0."""
    next_to = (np.diff(samples.run) == 0) & (np.diff(samples.time_s) < 1.5 * float(np.median(samples.duration_s)))
    both = next_to[1:] & next_to[:-1] & np.isfinite(np.diff(values, 2))
    x, y = np.diff(values, 2)[both], np.diff(samples.bias_dph, 2)[both]
    if len(x) < 3 or not x.std() or not y.std():
        return 0.0
    found = abs(float(np.corrcoef(x, y)[0, 1]))
    return found if found > max(_CARRIES, _SIGMAS / np.sqrt(len(x))) else 0.0


def _less_smooth(values: FloatArray, samples: TrainingData, scaling: Scaling) -> FloatArray:
    """Return the part of a channel that no polynomial of T and dT/dt holds, whatever the noise of the bias is."""
    t, r = scaling.normalise(samples.temperature_c, samples.slope_c_per_min)
    columns = [chebval(t, np.eye(k + 1)[k]) * r**power for k in range(_DEGREE + 1) for power in range(3)]
    design = np.stack(columns, axis=1)
    return np.asarray(values - design @ np.linalg.lstsq(design, values, rcond=1e-9)[0])


def _alike(beside: Beside) -> dict[str, dict[str, float]]:
    """Return for every candidate those that say beside the map what it says, and their correlation."""
    residuals = beside.residuals()
    left = {name: residuals[:, place[0]] for name, place in beside.place.items()}
    found: dict[str, dict[str, float]] = {name: {} for name in left}
    for a, b in combinations(left, 2):
        same = abs(float(np.corrcoef(left[a], left[b])[0, 1]))
        if same > _ALIKE:
            found[a][b] = found[b][a] = same
    return found


def _row(
    name: str,
    trial: RegressorChoice,
    shapes: Mapping[str, ChannelShape],
    parts: Mapping[str, FloatArray],
    samples: TrainingData,
    against: str,
    alike: Mapping[str, float],
) -> ChannelTried:
    if against:
        return ChannelTried(name=name, verdict="refused", reason=against)
    if name not in parts:
        for chosen in (n for n in trial.chosen if n in alike):
            same = f"beside the map it says what {chosen} says (correlation {alike[chosen]:.3f})"
            return ChannelTried(name=name, verdict="collinear", reason=same)
        reason = "it does not lessen what is left on history left out by more than the doubt of that"
        return ChannelTried(name=name, verdict="not earned", reason=reason)
    place = trial.chosen.index(name)
    before, after = trial.left_out_rms_dph[place : place + 2]
    return ChannelTried(
        name=name,
        verdict="taken",
        reason="it earns its place on history left out",
        shape=shapes[name].id,
        slope_dph_per_unit=shapes[name].slope(parts[name]),
        left_out_rms_before_dph=before,
        left_out_rms_after_dph=after,
        share_of_variance=float(np.var(parts[name]) / np.var(samples.bias_dph)),
    )


def with_channels(
    model: Model, choice: ChannelChoice, runs: Sequence[Run], samples: TrainingData, missing_s: float
) -> Model:
    """The model with a term, a fallback model for it, a guard and an uncertainty for every chosen channel.

    `samples`: those that the map was trained on, without what the channels add.
    """
    terms: list[dict[str, Any]] = []
    sigmas, stood = [], np.zeros(len(samples))
    content = model.to_dict()
    for name in choice.trial.chosen:
        shape, weights = choice.shapes[name], choice.trial.weights[name]
        terms.append({"id": shape.cause.id, "parameters": shape.parameters(weights), "channel": name})
        fallback_model = fallback_model_of(model, samples, choice.effects[name])
        if fallback_model is None:
            sigmas.append(shape.sigma_dph(weights))
            continue
        terms[-1]["stand_in"] = fallback_model.network
        sigmas.append(fallback_model.sigma_dph)
        stood += fallback_model.added
    content["uncertainty_dph"]["rules"]["terms"] = sigmas
    guards = {name: channel_guard(runs, name, missing_s) for name in sorted(choice.trial.chosen)}
    both = np.concatenate([choice.added, stood])
    effects = [min(0.0, float(both.min())), max(0.0, float(both.max()))]
    return Model.from_dict({**content, "terms": terms, "guards": guards, "effects_dph": effects})
