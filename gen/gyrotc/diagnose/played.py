"""Training and test runs as the target sees them, and what effects of causes do in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..causes import CATALOGUE
from ..causes.base import OVERTONES, Cause, Scene
from ..common.arrays import FloatArray, give_back
from ..common.metrics import LEAST_SPAN_C, MAD_TO_SIGMA
from ..mirror.front_end import blocks_since_power_on
from ..mirror.recursions import Course, CourseChannel, TermOutcome
from ..quality.judgement import Judged
from ..recordings.records import Dataset, Run
from ..train.channels import MOST_TERMS, channel_shown, readings_alone, seen_by_target
from ..train.data import TrainingData, cleaned_samples, joined, scaling_of
from ..train.detrending import INDEPENDENT_S
from ..train.fitting import FrontEnd, samples_of
from ..train.plausibility import longest_same_s
from ..train.process import TrainingHistory, smooth
from .bridged import BridgedCourse
from .refinement import Refined

_CUBIC, _PLACES = 8, 50  # fewest samples for a cubic; temperatures at which its slope is looked at
_KEPT = 2 * MOST_TERMS  # outcomes of terms for each run: those of two full tables


@dataclass(frozen=True, slots=True)
class Effect:
    """A cause with its fitted parameters, as the replay applies it; of a ripple with its overtones."""

    id: str
    values: dict[str, float]
    channel: str | None = None
    overtones: tuple[Effect, ...] = ()

    @staticmethod
    def of(cause: Refined) -> Effect:
        """The effect with the estimate of every parameter."""
        values = {name: interval.value for name, interval in cause.parameters.items()}
        own = {name: v for name, v in (cause.candidate.values | values).items() if name != OVERTONES}
        return Effect(cause.candidate.id, own, cause.candidate.channel)

    @property
    def term(self) -> Cause:
        """Cause of the catalogue."""
        return CATALOGUE[self.id]


@dataclass(frozen=True)
class Played:
    """One run after the front end.

    Attributes:
        data: Training samples (used blocks only); inputs are those in force.
        in_force: For each of them, the correction in force that the map made, shape (n,).
        course: Every correction of the run as terms see it.
        slope: C per block, of every correction.
        begins_s: Where means of the run begin, s.
        on_s: Time since power-on at the start of every training sample, s; on the file's clock where it is not known.
        day: Days since the first run, or None.
        channels: The channels at every correction.
        block_s: Length of a block, s.
        environment: Environment as the data set names it.
        longest_same_s: Longest time for which a reading of the thermometer stayed the same, s.
        seen: Channels and differences at the training samples, where they may be inputs of the map's model.
        bridged: Of a training run with gaps: what its states are learned from; None: `course`.
    """

    data: TrainingData
    in_force: NDArray[np.int64]
    course: Course
    slope: FloatArray
    begins_s: float | None
    on_s: FloatArray
    day: float | None
    channels: Mapping[str, CourseChannel]
    block_s: float
    environment: str
    longest_same_s: float
    seen: Mapping[str, FloatArray]
    bridged: BridgedCourse | None = None
    _outcomes: list[tuple[Effect, TermOutcome]] = field(default_factory=list)

    def outcome(self, effect: Effect) -> TermOutcome:
        """Apply a term to every correction; the last few are cached."""
        for known, outcome in self._outcomes:
            if known == effect:
                return outcome
        table = effect.term.table
        assert table is not None
        recursion = table.recursion(effect.values, self.block_s)
        x = self.course.temperature
        made = TermOutcome(x, self.slope, np.zeros_like(x), np.zeros(x.size, dtype=np.int32))
        channel = None if effect.channel is None else self.channels[effect.channel]
        if self.bridged is None or channel is not None:
            recursion.apply(self.course, channel, made)
        else:
            self.bridged.apply(recursion, made)
        self._outcomes[:0] = [(effect, made)]
        del self._outcomes[_KEPT:]
        return made

    def is_known(self, effect: Effect) -> NDArray[np.bool_]:
        """Test at every training sample whether the state of an effect is known within the noise, shape (n,)."""
        if self.bridged is None or effect.term.table is None or effect.channel is not None:
            return np.ones(self.in_force.size, dtype=bool)
        recursion = effect.term.table.recursion(effect.values, self.block_s)
        of_input, added = self.bridged.uncertainty(recursion)
        unknown_dph = added + of_input * self.steepness_dph_per_c
        return np.asarray(self.bridged.has_slope[self.in_force] & (unknown_dph[self.in_force] <= self.noise_dph))

    @cached_property
    def noise_dph(self) -> float:
        """Noise of a mean over 100 s, from the differences of consecutive samples."""
        differences = np.abs(np.diff(self.data.bias_dph))
        sigma = MAD_TO_SIGMA * float(np.median(differences)) / np.sqrt(2.0) if differences.size else 0.0
        return float(sigma * np.sqrt(self.block_s / INDEPENDENT_S))

    @cached_property
    def steepness_dph_per_c(self) -> float:
        """Largest slope of the bias over temperature, of a cubic through the samples."""
        t = self.data.temperature_c
        if t.size < _CUBIC or float(np.ptp(t)) < LEAST_SPAN_C:
            return 0.0
        cubic = np.polynomial.Polynomial.fit(t, self.data.bias_dph, 3)
        return float(np.abs(cubic.deriv()(np.linspace(t.min(), t.max(), _PLACES))).max())


def play_runs(
    dataset: Dataset,
    runs: Sequence[Run],
    front: FrontEnd,
    judged: Judged,
    *,
    channels: bool = False,
    bridged: bool = False,
) -> list[Played]:
    """Run the front end over all runs.

    Args:
        dataset: Where they belong.
        runs: Training or test runs.
        front: The front end.
        judged: Judgement of the rows of all runs.
        channels: With what training chooses channels by.
        bridged: States are learned from these runs, so they go on over gaps (`BridgedCourse`); else they are those of
            the target, which begins again at rest behind a gap.
    """
    first = min((r.started for r in dataset.runs if r.started is not None), default=None)
    played = []
    for k, run in enumerate(runs):
        played.append(_played(dataset, run, k, front, judged, first, channels=channels, bridged=bridged))
        give_back()  # what the rows of a whole recording took
    return played


def _played(
    dataset: Dataset,
    run: Run,
    number: int,
    front: FrontEnd,
    judged: Judged,
    first: datetime | None,
    *,
    channels: bool,
    bridged: bool,
) -> Played:
    rows = run.rows()
    blocks = front.blocks(run, rows, judged)
    data = samples_of(blocks, front.block_s, number)
    before = blocks_since_power_on(rows, run, front.block_s)
    rows = readings_alone(rows)
    course = blocks.stream.course(blocks.steps, blocks.settings.samples_per_block, before)
    course = replace(course, temperature=course.temperature.astype(np.float64))
    day = None
    if run.started is not None and first is not None:
        day = (run.started - first).total_seconds() / 86400.0
    return Played(
        data=data,
        in_force=blocks.in_force[blocks.used],
        course=course,
        bridged=BridgedCourse.over(course, blocks.steps) if bridged else None,
        slope=blocks.steps.slope.astype(np.float64),
        begins_s=blocks.begins_s,
        on_s=data.time_s - (run.power_on_s or 0.0),
        day=day,
        channels={name: channel_shown(blocks, rows.channels[name]) for name in dataset.channels},
        block_s=front.block_s,
        environment=run.environment,
        longest_same_s=longest_same_s(blocks.stream.samples, run.row_period_s),
        seen=seen_by_target(dataset, rows, blocks) if channels else {},
    )


def samples(run: Played, effects: Sequence[Effect]) -> TrainingData:
    """Training samples with the inputs that the effects give and their additions taken off.

    Where the input of a mended recording is not known (`known`) it is no number.
    """
    data, at = run.data, run.in_force
    temperature, slope = data.temperature_c, data.slope_c_per_min
    added = np.zeros(at.size)
    for effect in terms_of(effects):
        term = effect.term
        if term.table is not None:
            made = run.outcome(effect)
            added = added + made.added[at]
            if term.kind == "input":
                temperature, slope = made.temperature[at], made.slope[at] * (60.0 / run.block_s)
        elif term.mended is not None:
            temperature, slope = term.mended(data.time_s, temperature, slope, effect.values)
        elif term.kind == "add":
            added = added + _simulated(run, effect)
    return replace(data, temperature_c=temperature, slope_c_per_min=slope, bias_dph=data.bias_dph - added)


def known(run: Played, effects: Sequence[Effect]) -> NDArray[np.bool_]:
    """Return a mask of the samples that say something beside the effects, shape (n,).

    Those do not whose input is not known, as at the end of a run that was recorded late, and in training those whose
    states are not, as behind a gap.
    """
    mask = np.ones(run.in_force.size, dtype=bool)
    for effect in terms_of(effects):
        mask &= run.is_known(effect)
    if any(effect.term.mended for effect in effects):
        mask &= np.isfinite(samples(run, effects).temperature_c)
    return mask


def sample_masks(
    runs: Sequence[Played], effects: Sequence[Effect], kept: Sequence[NDArray[np.bool_]] | None
) -> list[NDArray[np.bool_]]:
    """Return masks of the samples of each run: those `kept` (default: all) whose input is known beside the effects."""
    masks = [known(run, effects) for run in runs]
    return masks if kept is None else [mask & k for mask, k in zip(masks, kept, strict=True)]


def chosen_samples(
    runs: Sequence[Played], effects: Sequence[Effect], kept: Sequence[NDArray[np.bool_]] | None
) -> TrainingData:
    """Return samples of all runs beside the effects, as in `sample_masks`."""
    masks = sample_masks(runs, effects, kept)
    return joined([samples(run, effects).select(m) for run, m in zip(runs, masks, strict=True) if m.any()])


def samples_beside(
    runs: Sequence[Played],
    effects: Sequence[Effect],
    power_on: NDArray[np.int64],
    kept: Sequence[NDArray[np.bool_]] | None = None,
) -> TrainingData:
    """Return samples beside the effects, those `kept`, without the intercepts of power-ons.

    Args:
        power_on: Number of the power-on of each run.
    """
    return _without_intercepts(chosen_samples(runs, effects, kept), power_on)


def _without_intercepts(data: TrainingData, power_on: NDArray[np.int64]) -> TrainingData:
    """Return the samples less the intercept of every power-on, as training estimates it jointly with a smooth map.

    Args:
        power_on: Number of the power-on of each run.
    """
    if np.unique(power_on[data.run]).size < 2:
        return data
    samples = cleaned_samples(data)
    history = TrainingHistory.of(samples, scaling_of(samples), power_on)
    history, found = history.without_outliers(smooth(history.count))
    intercept_dph = history.spread * found.own()[:, 0]
    of_power_on = dict(zip(np.unique(power_on[history.means.run]).tolist(), intercept_dph.tolist(), strict=True))
    own = np.array([of_power_on.get(number, 0.0) for number in power_on.tolist()])  # a copy of a run has none
    return replace(data, bias_dph=data.bias_dph - own[data.run])


def terms_of(effects: Sequence[Effect]) -> list[Effect]:
    """The effects, each with its overtones behind it: what stands in a table."""
    return [one for effect in effects for one in (effect, *effect.overtones)]


def added_range(runs: Sequence[Played], effects: Sequence[Effect], beside: FloatArray | float = 0.0) -> list[float]:
    """Smallest and largest that the terms of a table together added in these runs, 0 among them, deg/h.

    Args:
        beside: What else was added at each sample of all runs, shape (n,).
    """
    held = [effect for effect in terms_of(effects) if effect.term.table is not None]
    none = [np.zeros(run.in_force.size) for run in runs]
    added = np.concatenate(
        [sum((run.outcome(e).added[run.in_force] for e in held), n) for run, n in zip(runs, none, strict=True)]
    )
    both = np.append(added + beside, 0.0)
    return [float(both.min()), float(both.max())]


def _simulated(run: Played, effect: Effect) -> FloatArray:
    """Return what a cause that no table holds adds in the simulation, deg/h."""
    seen = run.data.temperature_c
    scene = Scene(run.data.time_s, run.on_s, seen, seen, seen, None, run.day or 0.0)
    assert effect.term.bias is not None
    return effect.term.bias(scene, effect.values, np.random.default_rng(0))
