"""The compensation model extended with the named causes: the map beside their terms, and what it gains.

Training runs decide what is shipped (`shipping`). Where test runs have a mean, they measure the gain; else parts of the
training runs that are left out in turn.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import BoolArray
from ..common.metrics import Averages
from ..common.progress import Progress
from ..model import Model
from ..results.diagnosed import GainOnUnseen
from ..results.fleet import LotUse
from ..train.channels import FallbackModel, fallback_model_of
from ..train.data import TrainingData, joined
from ..train.result import Fit
from .gain import gain_of
from .optional_parts import completed
from .played import Effect, Played, known, samples
from .refinement import Refined
from .refitting import FOLDS, Chain, Refitting, held_out_masks, is_corrected, scored_means
from .shipping import Shipping, choose_shipped


def fallback_models_of(
    plain: Model, samples: TrainingData, runs: Sequence[Played], effects: Sequence[Effect]
) -> dict[str, FallbackModel]:
    """A fallback model for the term of each channel, by channel; none where none can be fitted.

    Args:
        plain: The model with its map, without terms.
        samples: Those that the map was trained on, without what the effects add.
        runs: The same runs as terms see them.
        effects: Those of the extended model.
    """
    found = {}
    for effect in effects:
        if effect.channel is None:
            continue
        added = []
        for run in runs:
            shown = run.channels[effect.channel]
            unknown = shown.is_away | ~np.isfinite(shown.mean)
            there = run.in_force[known(run, effects)]
            added.append(np.where(unknown, np.nan, run.outcome(effect).added)[there])
        fallback_model = fallback_model_of(plain, samples, np.concatenate(added))
        if fallback_model is not None:
            found[effect.channel] = fallback_model
    return found


_MOVING_C_PER_MIN = 0.3  # nine tenths of a run are slower than this where the chamber holds or drifts
_LEARNT = 0.67  # share of the dates that is learnt from where no test run is later


@dataclass(frozen=True)
class Extension:
    """An extension with its gain.

    Attributes:
        steps: Gain of every cause, taken one after the other; None of one that cannot be corrected.
        total: Gain of all shipped causes together: on an exam that of the emitted tables; None if none is shipped.
        rate_left_out: Gain with one ramp rate left out of everything, and its environment; None without a mean of it.
        forward: Gain on runs later than everything that was learnt from; None without dates or a mean of these runs.
        extended: Fit with the shipped causes, None if none is shipped.
        shipped: Effects of the extended model.
        crossed: The cross-validation on the training runs that decided so.
        refuted: Numbers of the causes that make left-out history worse.
        samples: Training samples as the extended map sees them.
        added: What the effects add to the map at each of them, deg/h.
        floor: Noise floor of means over `average_s`, deg/h.
        lot: What a lot did for the map that is left; None without one.
        baseline_rms, baseline_centers: RMS (deg/h) and number of centers of the model without causes.
        measured_on: "exam" or "left out".
        before, after: Residuals of the scored runs without and with all causes.
    """

    steps: tuple[GainOnUnseen | None, ...]
    total: GainOnUnseen | None
    rate_left_out: tuple[str, GainOnUnseen] | None
    forward: GainOnUnseen | None
    extended: Fit | None
    shipped: tuple[Effect, ...]
    crossed: Shipping
    refuted: frozenset[int]
    samples: TrainingData
    added: NDArray[np.float64]
    floor: float
    lot: LotUse | None
    baseline_rms: float
    baseline_centers: int
    measured_on: Literal["exam", "left out"]
    before: list[Averages]
    after: list[Averages]

    @property
    def centers(self) -> int:
        """Number of centers of the extended map; 0 if none is shipped."""
        return self.extended.n_centers if self.extended is not None else 0


def extend(
    refitting: Refitting, causes: Sequence[Refined], probabilities: Sequence[float], floor: float, say: Progress
) -> Extension:
    """Refit the model with the causes that are worth it, and measure the gain of all over a noise floor, deg/h.

    Args:
        refitting: Training and test runs.
        causes: The named ones, the strongest first.
        probabilities: Of each in its place; none of a single cycle, of which nothing is shipped.
        floor: Noise floor of means over the averaging time, deg/h.
        say: Takes note of the stage.
    """
    say("measuring the gain")
    single_cycle, average_s = refitting.single_cycle, refitting.average_s
    correctable = [is_corrected(cause) for cause in causes]
    named = [Effect.of(c) for c in itertools.compress(causes, correctable)]
    effects = completed(refitting.train, named, refitting.arguments["power_on"])
    stages = [effects[:k] for k in range(len(effects) + 1)]
    exam = _on_exam(refitting, stages)
    chain = exam or _crossed(refitting, causes)
    if single_cycle and effects:  # found together: one alone is another model
        chain = [chain[0], *(chain[-1] for _ in effects)]
    pairs = [(chain[0], chain[-1]) for _ in effects] if single_cycle else itertools.pairwise(chain)
    steps = iter([gain_of(a, b, floor, average_s, whole_dph=rms_of(chain[0])) for a, b in pairs])
    crossed = choose_shipped(refitting, effects, list(itertools.compress(probabilities, correctable)))
    shipped = crossed.shipped
    last = max((k for k, effect in enumerate(effects) if effect in shipped), default=-1)
    total = gain_of(chain[0], chain[last + 1], floor, average_s) if shipped and not exam else None
    numbers = [k for k, able in enumerate(correctable) if able]
    return Extension(
        steps=tuple(next(steps) if able else None for able in correctable),
        total=total,
        rate_left_out=_rate_left_out(refitting, causes, floor) if effects else None,
        forward=_forward(refitting, exam, causes, floor) if effects else None,
        extended=refitting.fit(shipped) if shipped else None,
        shipped=tuple(shipped),
        crossed=crossed,
        refuted=frozenset(numbers[k] for k in crossed.refuted),
        samples=_seen(refitting, shipped, shipped),
        added=_seen(refitting, [], shipped).bias_dph - _seen(refitting, shipped, shipped).bias_dph,
        floor=floor,
        lot=refitting.fit(shipped).lot,
        baseline_rms=rms_of(chain[0]),
        baseline_centers=refitting.fit([]).n_centers,
        measured_on="exam" if exam else "left out",
        before=chain[0],
        after=chain[-1],
    )


def _seen(refitting: Refitting, effects: Sequence[Effect], shipped: Sequence[Effect]) -> TrainingData:
    """Training samples as the map sees them beside effects, of those that the shipped model is learned from."""
    return joined([samples(run, list(effects)).select(known(run, shipped)) for run in refitting.train])


def rms_of(runs: Sequence[Averages]) -> float:
    """Return the RMS of the residuals of all runs, deg/h."""
    return float(np.sqrt(np.mean(np.concatenate([r.after_dph for r in runs]) ** 2)))


def _on_exam(refitting: Refitting, stages: Sequence[Sequence[Effect]]) -> Chain | None:
    """Return residuals of the test runs; None if no mean of them has a known input beside all effects."""
    chain = refitting.on_exam(stages) if refitting.exam else [[]]
    return chain if _has_means(chain) else None


def _has_means(chain: Chain) -> bool:
    return any(run.after_dph.size for run in chain[0])


def _crossed(refitting: Refitting, causes: Sequence[Refined]) -> Chain:
    """Every training run (or branch of few runs) left out in turn, in a few groups."""
    chains = [refitting.left_out(held, causes) for held in held_out_masks(refitting)]
    if not any(map(_has_means, chains)):
        return [_score_self(refitting)] * (sum(map(is_corrected, causes)) + 1)
    return [[run for stage in stages for run in stage] for stages in zip(*chains, strict=True)]


def _score_self(refitting: Refitting) -> list[Averages]:
    """Score the training samples themselves, without gain, if no mean can be left out (very short runs)."""
    return scored_means(refitting.fit([]), refitting.train, [], refitting.average_s, refitting.everything())


def _rate_left_out(refitting: Refitting, causes: Sequence[Refined], floor: float) -> tuple[str, GainOnUnseen] | None:
    """All runs of the fastest environment left out of everything, where another moving one remains."""
    speeds: dict[str, float] = {}
    for run in refitting.train:
        speed = float(np.quantile(np.abs(run.data.slope_c_per_min), 0.9))
        speeds[run.environment] = max(speeds.get(run.environment, 0.0), speed)
    moving = [e for e, s in speeds.items() if s > _MOVING_C_PER_MIN]
    if len(moving) < 2:
        return None
    fastest = max(moving, key=lambda e: speeds[e])
    held = [np.full(len(r.data.bias_dph), r.environment == fastest, dtype=bool) for r in refitting.train]
    gain = _gain_without(refitting, held, causes, floor)
    return (fastest, gain) if gain else None


def _forward(refitting: Refitting, exam: Chain | None, causes: Sequence[Refined], floor: float) -> GainOnUnseen | None:
    """Later runs from earlier ones: the exam where it came last, else the last third of the training runs.

    Args:
        exam: Residuals of the test runs; None where these have no mean.
    """
    days = [run.day for run in refitting.train]
    later = [run.day for run in refitting.exam] if exam else []
    if any(d is None for d in (*days, *later)) or len(days) < FOLDS:
        return None
    known = [float(d) for d in days if d is not None]
    if exam and min(float(d) for d in later if d is not None) > max(known):
        return gain_of(exam[0], exam[-1], floor, refitting.average_s)
    cut = float(np.quantile(known, _LEARNT))
    held = [np.full(len(r.data.bias_dph), d > cut, dtype=bool) for r, d in zip(refitting.train, known, strict=True)]
    if not any(m.any() for m in held) or sum(not m.any() for m in held) < 2:
        return None
    return _gain_without(refitting, held, causes, floor)


def _gain_without(
    refitting: Refitting, held: list[BoolArray], causes: Sequence[Refined], floor: float
) -> GainOnUnseen | None:
    """Gain of all causes on held-out training samples; None where these have no whole mean."""
    chain = refitting.left_out(held, causes)
    if not _has_means(chain):
        return None
    return gain_of(chain[0], chain[-1], floor, refitting.average_s)
