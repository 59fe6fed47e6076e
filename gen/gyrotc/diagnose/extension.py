"""Extension and its gain: the compensation model refitted with the named causes, measured on unseen runs.

The training runs choose, what is shipped, too (`shipping`). Where there are exam runs, they measure. Where there are
none, runs (or branches of few runs) are left out in turn, and causes and parameters are chosen anew without them.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import Progress
from ..common.metrics import Averages
from ..recordings.records import Dataset
from ..results.lot import LotUse
from ..train.bumps import Bumps
from ..train.data import TrainingData, joined
from ..train.fitting import FitOptions
from ..train.result import Fit
from .blocks import Records
from .gain import Gain, floor_of, gain_of
from .refine import Refined
from .refit import Effect, completed, samples, scored_means
from .refitting import FEW_RUNS, Chain, Refitting, folds_of
from .shipping import Shipping, shipping

__all__ = ["Extension", "extend"]


_MOVING_C_PER_MIN = 0.3  # nine tenths of a run are slower than this where the chamber holds or drifts
_LEARNT = 0.67  # share of the dates that is learnt from where no exam run is later


@dataclass(frozen=True)
class Extension:
    """What the extension gains.

    Attributes:
        steps: Gain of every cause, taken one after the other.
        total: Gain of all shipped causes together; None if none is shipped.
        rate_left_out: Gain with one ramp rate left out of everything, and its environment.
        forward: Gain on runs later than everything that was learnt from; None without dates.
        extended: Fit with the shipped causes, None if none is shipped.
        shipped: Effects of the extended model.
        crossed: The cross-validation on the training runs that decided so.
        samples: Training samples as the extended map sees them.
        added: What the effects add to the map at each of them, deg/h.
        floor: Noise floor of the scored samples, deg/h.
        lot: What a lot did for the map that is left; None without one.
        baseline_rms, baseline_centers: RMS (deg/h) and number of centers of the model without causes.
        measured_on: "exam" or "left out".
        before, after: Residuals of the scored runs without and with all causes.
    """

    steps: tuple[Gain, ...]
    total: Gain | None
    rate_left_out: tuple[str, Gain] | None
    forward: Gain | None
    extended: Fit | None
    shipped: tuple[Effect, ...]
    crossed: Shipping
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
        own = len(self.bumps.centers_c) if self.bumps is not None else 0
        return own + (self.extended.n_centers if self.extended is not None else 0)

    @property
    def bumps(self) -> Bumps | None:
        """Those of a finer map, where one is shipped."""
        return next((e.bumps for e in self.shipped if e.bumps is not None), None)


def extend(
    dataset: Dataset,
    records: Records,
    causes: Sequence[Refined],
    options: FitOptions,
    say: Progress,
    *,
    single_cycle: bool = False,
) -> Extension:
    """Refits the model with the causes and measures the gain."""
    say("measuring the gain")
    refitting = Refitting(dataset, records, options, single_cycle=single_cycle)
    effects = completed(refitting.train, [Effect.of(c) for c in causes])
    stages = [effects[:k] for k in range(len(effects) + 1)]
    chain = refitting.on_exam(stages) if refitting.exam else _crossed(refitting, len(effects))
    if single_cycle and effects:  # found together: one alone is another model
        chain = [chain[0], *(chain[-1] for _ in effects)]
    floor = floor_of([*chain[-1], *refitting.on_training(effects)])
    pairs = [(chain[0], chain[-1]) for _ in effects] if single_cycle else itertools.pairwise(chain)
    steps = [gain_of(a, b, floor, options.average_s) for a, b in pairs]
    crossed = shipping(refitting, effects)
    shipped, total = _shipped(refitting, effects, crossed.shipped, chain, floor)
    return Extension(
        steps=tuple(steps),
        total=total,
        rate_left_out=_rate_left_out(refitting, len(effects), floor) if effects else None,
        forward=_forward(refitting, chain, len(effects), floor) if effects else None,
        extended=refitting.fit(shipped) if shipped else None,
        shipped=tuple(shipped),
        crossed=crossed,
        samples=_seen(refitting, shipped),
        added=_seen(refitting, []).bias_dph - _seen(refitting, shipped).bias_dph,
        floor=floor,
        lot=refitting.fit(shipped).lot,
        baseline_rms=_rms(chain[0]),
        baseline_centers=refitting.fit([]).n_centers,
        measured_on="exam" if refitting.exam else "left out",
        before=chain[0],
        after=chain[-1],
    )


def _seen(refitting: Refitting, shipped: Sequence[Effect]) -> TrainingData:
    """Training samples as the map sees them beside effects."""
    return joined([samples(run, list(shipped)) for run in refitting.train])


def _rms(runs: Sequence[Averages]) -> float:
    return float(np.sqrt(np.mean(np.concatenate([r.after_dph for r in runs]) ** 2)))


def _shipped(
    refitting: Refitting, effects: list[Effect], worthy: list[Effect], chain: Chain, floor: float
) -> tuple[list[Effect], Gain | None]:
    """The effects that are shipped, and what they gain together where it is measured."""
    if not worthy:
        return [], None
    if worthy == effects:
        both = [chain[0], chain[-1]]
    elif refitting.exam:
        both = refitting.on_exam([[], worthy])
    else:
        both = [chain[0], chain[1 + max(k for k, e in enumerate(effects) if e in worthy)]]
    total = gain_of(both[0], both[1], floor, refitting.average_s)
    return (worthy, total) if refitting.exam or total.positive else ([], None)


def _crossed(refitting: Refitting, count: int) -> Chain:
    """Every training run (or branch of few runs) left out in turn, in a few groups."""
    folds = folds_of(refitting)
    if not folds:
        return [_score_self(refitting)] * (count + 1)
    chains = [refitting.left_out(held, count) for held in folds]
    return [[a for chain in chains for a in chain[k]] for k in range(count + 1)]


def _score_self(refitting: Refitting) -> list[Averages]:
    """Where nothing can be left out (one very short run): the training samples themselves, without gain."""
    return scored_means(refitting.fit([]), refitting.train, [], refitting.average_s, refitting.everything())


def _rate_left_out(refitting: Refitting, count: int, floor: float) -> tuple[str, Gain] | None:
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
    chain = refitting.left_out(held, count)
    return fastest, gain_of(chain[0], chain[-1], floor, refitting.average_s)


def _forward(refitting: Refitting, chain: Chain, count: int, floor: float) -> Gain | None:
    """Later runs from earlier ones: the exam where it came last, else the last third of the training runs."""
    days = [run.day for run in refitting.train]
    later = [run.day for run in refitting.exam]
    if any(d is None for d in (*days, *later)) or len(days) < FEW_RUNS:
        return None
    known = [float(d) for d in days if d is not None]
    if later and min(float(d) for d in later if d is not None) > max(known):
        return gain_of(chain[0], chain[-1], floor, refitting.average_s)
    cut = float(np.quantile(known, _LEARNT))
    held = [
        np.full(len(r.data.bias_dph), d > cut, dtype=bool)
        for r, d in zip(refitting.train, known, strict=True)
    ]
    if not any(m.any() for m in held) or sum(not m.any() for m in held) < 2:
        return None
    ends = refitting.left_out(held, count)
    return gain_of(ends[0], ends[-1], floor, refitting.average_s)
