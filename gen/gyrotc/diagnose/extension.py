"""The compensation model extended with the named causes: terms, overtones, and whether it is shipped.

States beside a map are one candidate more in model selection (`train.selection`), the richest: every piece of thermal
history is left out in turn, and they are taken where pieces agree, at temperatures that the rest has covered, that
they are better than what would be emitted without them. Causes and their parameters are those of all training runs, as
the parameters of the evidence process are; the map beside them is fitted anew without each stretch.

The training runs choose, what is shipped, too (`shipping`). Where there are exam runs, they measure. Where there are
none, runs (or branches of few runs) are left out in turn, and causes and parameters are chosen anew without them.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..causes import CATALOGUE
from ..common.arrays import BoolArray, Progress
from ..common.metrics import Averages
from ..model import Model
from ..recordings.records import Dataset
from ..results.diagnosed import ShippingTrial
from ..results.fleet import LotUse
from ..train.channels import MOST_TERMS, StandIn, stand_in_of
from ..train.data import TrainingData, cleaned_samples, joined, scaling_of, training_spans
from ..train.evidence import TrainingFailed, fit_process
from ..train.fitting import FitOptions, Read, front_end, map_method, power_ons
from ..train.result import Fit
from ..train.selection import CandidateScores, compare_candidates
from .attribution import choose
from .blocks import Records
from .gain import Gain, gain_of
from .pipeline import search_of
from .refinement import Refined
from .refit import (
    Effect,
    Played,
    completed,
    fit_extended,
    known,
    mean_count,
    play_runs,
    samples,
    scored_means,
)
from .single_cycle import cycle_of
from .static_map import fits_exactly


def stand_ins_of(
    plain: Model, samples: TrainingData, runs: Sequence[Played], effects: Sequence[Effect]
) -> dict[str, StandIn]:
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
            added.append(np.where(unknown, np.nan, run.outcome(effect).added)[run.in_force])
        stand_in = stand_in_of(plain, samples, np.concatenate(added))
        if stand_in is not None:
            found[effect.channel] = stand_in
    return found


def is_corrected(cause: Refined) -> bool:
    """Test whether the effect of a cause can be taken off beside the map: not where it is structure of the map."""
    return CATALOGUE[cause.candidate.id].kind != "static"


Chain = list[list[Averages]]
"""Residuals of the scored runs for every set of causes, from none to all."""

_FOLDS = 3  # two thirds remain to learn from, at the cost of three fits; fewer runs cannot be left out whole
_ROUNDING_S = 1e-6  # of times that are compared


class Refitting:
    """Training runs after the front end, and the options of every fit.

    Of a single cycle the map beside any effect is one of T alone (see `cycle`).
    """

    def __init__(self, dataset: Dataset, records: Records, options: FitOptions, *, single_cycle: bool) -> None:
        self.records = records
        self.single_cycle = single_cycle
        self.runs = [r for r in dataset.runs if r.role == "train"]
        self.front = front_end(self.runs, options.block_s)
        self.train = play_runs(dataset, self.runs, self.front, channels=options.channels)
        self.average_s = options.average_s
        exam = play_runs(dataset, [r for r in dataset.runs if r.role == "exam"], self.front)
        self.exam = [run for run in exam if mean_count(run, self.average_s)]
        self._fits: list[tuple[list[Effect], bool, Fit]] = []
        self.arguments: dict[str, Any] = {
            "method": map_method(options.method),
            "power_on": power_ons(self.runs),
            "seed": options.seed,
            "centers": options.centers,
            "rho": options.rho,
            "average_s": options.average_s,
            # Beside effects the map of a single cycle is one of T alone, which no lot knows.
            "prior": None if single_cycle else options.prior,
        }
        self.plain = {"method": options.method, "prior": options.prior}

    def read(self) -> Read:
        """The training runs as `fit_dataset` reads them."""
        return Read(
            joined([run.data for run in self.train]),
            {name: np.concatenate([run.seen[name] for run in self.train]) for name in self.train[0].seen},
            [stretch for run in self.train for stretch in run.left_out],
            max(run.longest_same_s for run in self.train),
        )

    def fit(self, effects: Sequence[Effect], kept: list[BoolArray] | None = None, *, beside: bool | None = None) -> Fit:
        """The map beside the effects (`beside`: as if there were any), without any what would be emitted.

        Fits on all samples are cached.
        """
        whole = kept is None or all(m.all() for m in kept)
        with_map = bool(effects) if beside is None else beside
        for fitted_beside, of_map, fitted in self._fits:
            if whole and fitted_beside == list(effects) and of_map == with_map:
                return fitted
        arguments = self.arguments if with_map else self.arguments | self.plain
        rate = not (self.single_cycle and with_map)
        fitted = fit_extended(self.train, effects, arguments, None if whole else kept, rate=rate)
        if whole:
            self._fits.append((list(effects), with_map, fitted))
        return fitted

    def takes(self, causes: Sequence[Refined]) -> bool:
        """Whether every cause leaves samples whose input is known: a late record of short spans may leave none."""
        effects = [effect for effect in map(Effect.of, causes) if effect.term.mended]
        return all(any(known(run, [effect]).any() for run in self.train) for effect in effects)

    def everything(self) -> list[BoolArray]:
        """All training samples, per run."""
        return [np.ones(len(run.data.bias_dph), dtype=bool) for run in self.train]

    def on_exam(self, stages: Sequence[Sequence[Effect]]) -> Chain:
        """Residuals of the exam runs for each set of effects, of samples whose input is known beside all of them."""
        all_of_them = [effect for stage in stages for effect in stage]
        whole = [known(run, all_of_them) for run in self.exam]
        return [self._residuals(self.everything(), self.exam, whole, e) for e in stages]

    def left_out(self, held: list[BoolArray], causes: Sequence[Refined]) -> Chain:
        """Residuals of held-out training samples; as many causes are chosen anew on the others."""
        kept = [~m for m in held]
        chosen = filter(is_corrected, self._chosen(held, len(causes)))
        effects = completed(self.train, [Effect.of(c) for c in chosen], kept)
        stages = (effects[:k] for k in range(sum(map(is_corrected, causes)) + 1))
        scored = [m & known(run, effects) for run, m in zip(self.train, held, strict=True)]
        return [self._residuals(kept, self.train, scored, stage, beside=k > 0) for k, stage in enumerate(stages)]

    def _residuals(
        self,
        kept: list[BoolArray],
        runs: list[Played],
        scored: list[BoolArray],
        effects: Sequence[Effect],
        *,
        beside: bool | None = None,
    ) -> list[Averages]:
        fitted = self.fit(effects, kept, beside=beside)
        return scored_means(fitted, runs, effects, self.average_s, scored)

    def _chosen(self, held: list[BoolArray], count: int) -> tuple[Refined, ...]:
        """Best `count` causes on the records without the held-out samples; none where these can tell of none."""
        masks = []
        for run, played, out in zip(self.records.runs, self.train, held, strict=True):
            # A row that is no sample's, as before the first, goes with the sample before it, or with the first.
            of = np.searchsorted(played.data.time_s[1:], run.history.time_s + _ROUNDING_S, side="right")
            masks.append(np.asarray(run.usable & ~np.append(out, False)[of], dtype=bool))
        rest = self.records.without_rows(masks)
        if count == 0 or not rest.runs:
            return ()
        if self.single_cycle:
            return cycle_of(rest).states[:count]
        return () if fits_exactly(rest) else choose(search_of(rest), count)


def held_out_masks(refitting: Refitting) -> list[list[BoolArray]]:
    """Held-out masks: groups of runs, or spans of few runs."""
    sizes = [len(run.data.bias_dph) for run in refitting.train]
    if len(refitting.train) >= _FOLDS:
        return [[np.full(n, k % _FOLDS == fold, dtype=bool) for k, n in enumerate(sizes)] for fold in range(_FOLDS)]
    data = joined([run.data for run in refitting.train])
    return [
        [span.contains(run.data.run, run.data.time_s) for run in refitting.train]
        for span in training_spans(refitting.runs, data)
    ]


@dataclass(frozen=True)
class Shipping:
    """What was tried.

    Attributes:
        shipped: Effects of the extended model.
        candidate: What model selection would emit without them.
        left_out: What was left out, in words.
        before_dph, after_dph: RMS over these stretches without and with the effects, all stretches counting alike, at
            temperatures that the rest has seen; None where nothing can be left out, or nothing was to be added.
    """

    shipped: list[Effect]
    candidate: str
    left_out: list[str]
    before_dph: float | None
    after_dph: float | None

    def result(self) -> ShippingTrial:
        """As `diagnose.json` has it."""
        return ShippingTrial(
            ships=bool(self.shipped),
            beside=self.candidate,
            left_out=tuple(self.left_out),
            rms_before_dph=self.before_dph,
            rms_after_dph=self.after_dph,
        )


def shipping(refitting: Refitting, effects: Sequence[Effect]) -> Shipping:
    """Adds the effects that a table can hold one after the other; those of a single cycle all at once."""
    able = [e for e in effects if e.term.table is not None][:MOST_TERMS]
    best = _comparison(refitting, [])
    candidate = best.chosen()
    shipped: list[Effect] = []
    before, after = best.rms_covered(candidate), None
    together = refitting.single_cycle
    for tried in [able] if together and able else [able[: k + 1] for k in range(len(able))]:
        new = tried if together else [*shipped, tried[-1]]
        name = f"{len(new)} states"
        beside = best.with_states(name, _comparison(refitting, new))
        after = beside.rms_covered(name)
        if beside.chosen() == name:
            shipped, best = new, beside
    return Shipping(shipped, candidate, best.stretches(), before, after)


def _comparison(refitting: Refitting, effects: Sequence[Effect]) -> CandidateScores:
    """Every candidate beside the effects, without each piece of history."""
    data: TrainingData = cleaned_samples(joined([samples(run, effects) for run in refitting.train]))
    scaling = scaling_of(data)
    try:
        process = fit_process(data, scaling)
    except TrainingFailed:
        process = None
    rate = not (effects and refitting.single_cycle)
    return compare_candidates(data, scaling, process, power_ons(refitting.runs), refitting.average_s, rate=rate)


_MOVING_C_PER_MIN = 0.3  # nine tenths of a run are slower than this where the chamber holds or drifts
_LEARNT = 0.67  # share of the dates that is learnt from where no exam run is later


@dataclass(frozen=True)
class Extension:
    """What the extension gains.

    Attributes:
        steps: Gain of every cause, taken one after the other; None of one that cannot be corrected.
        total: Gain of all shipped causes together: on an exam that of the emitted tables; None if none is shipped.
        rate_left_out: Gain with one ramp rate left out of everything, and its environment.
        forward: Gain on runs later than everything that was learnt from; None without dates.
        extended: Fit with the shipped causes, None if none is shipped.
        shipped: Effects of the extended model.
        crossed: The cross-validation on the training runs that decided so.
        samples: Training samples as the extended map sees them.
        added: What the effects add to the map at each of them, deg/h.
        floor: Noise floor of means over `average_s`, deg/h.
        lot: What a lot did for the map that is left; None without one.
        baseline_rms, baseline_centers: RMS (deg/h) and number of centers of the model without causes.
        measured_on: "exam" or "left out".
        before, after: Residuals of the scored runs without and with all causes.
    """

    steps: tuple[Gain | None, ...]
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
        return self.extended.n_centers if self.extended is not None else 0


def extend(
    refitting: Refitting, causes: Sequence[Refined], sure: Sequence[bool], floor: float, say: Progress
) -> Extension:
    """Refits the model with the causes that are sure, and measures the gain of all over a noise floor, deg/h."""
    say("measuring the gain")
    single_cycle, average_s = refitting.single_cycle, refitting.average_s
    correctable = [is_corrected(cause) for cause in causes]
    effects = completed(refitting.train, [Effect.of(c) for c in itertools.compress(causes, correctable)])
    stages = [effects[:k] for k in range(len(effects) + 1)]
    chain = refitting.on_exam(stages) if refitting.exam else _crossed(refitting, causes)
    if single_cycle and effects:  # found together: one alone is another model
        chain = [chain[0], *(chain[-1] for _ in effects)]
    pairs = [(chain[0], chain[-1]) for _ in effects] if single_cycle else itertools.pairwise(chain)
    steps = iter([gain_of(a, b, floor, average_s, whole_dph=_rms(chain[0])) for a, b in pairs])
    crossed = shipping(refitting, list(itertools.compress(effects, itertools.compress(sure, correctable))))
    shipped, total = _shipped(refitting, effects, crossed.shipped, chain, floor)
    return Extension(
        steps=tuple(next(steps) if able else None for able in correctable),
        total=total,
        rate_left_out=_rate_left_out(refitting, causes, floor) if effects else None,
        forward=_forward(refitting, chain, causes, floor) if effects else None,
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
    """The effects that are shipped, and what they gain together on parts left out (on an exam, see `diagnosis`)."""
    if not worthy or refitting.exam:
        return worthy, None
    last = 1 + max(k for k, e in enumerate(effects) if e in worthy)
    total = gain_of(chain[0], chain[last], floor, refitting.average_s)
    return (worthy, total) if total.positive else ([], None)


def _crossed(refitting: Refitting, causes: Sequence[Refined]) -> Chain:
    """Every training run (or branch of few runs) left out in turn, in a few groups."""
    chains = [refitting.left_out(held, causes) for held in held_out_masks(refitting)]
    if not any(run.after_dph.size for stages in chains for run in stages[0]):
        return [_score_self(refitting)] * (sum(map(is_corrected, causes)) + 1)
    return [[run for stage in stages for run in stage] for stages in zip(*chains, strict=True)]


def _score_self(refitting: Refitting) -> list[Averages]:
    """Where no mean can be left out (very short runs): the training samples themselves, without gain."""
    return scored_means(refitting.fit([]), refitting.train, [], refitting.average_s, refitting.everything())


def _rate_left_out(refitting: Refitting, causes: Sequence[Refined], floor: float) -> tuple[str, Gain] | None:
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
    return fastest, _gain_without(refitting, held, causes, floor)


def _forward(refitting: Refitting, chain: Chain, causes: Sequence[Refined], floor: float) -> Gain | None:
    """Later runs from earlier ones: the exam where it came last, else the last third of the training runs."""
    days = [run.day for run in refitting.train]
    later = [run.day for run in refitting.exam]
    if any(d is None for d in (*days, *later)) or len(days) < _FOLDS:
        return None
    known = [float(d) for d in days if d is not None]
    if later and min(float(d) for d in later if d is not None) > max(known):
        return gain_of(chain[0], chain[-1], floor, refitting.average_s)
    cut = float(np.quantile(known, _LEARNT))
    held = [np.full(len(r.data.bias_dph), d > cut, dtype=bool) for r, d in zip(refitting.train, known, strict=True)]
    if not any(m.any() for m in held) or sum(not m.any() for m in held) < 2:
        return None
    return _gain_without(refitting, held, causes, floor)


def _gain_without(refitting: Refitting, held: list[BoolArray], causes: Sequence[Refined], floor: float) -> Gain:
    """Gain of all causes on held-out training samples."""
    chain = refitting.left_out(held, causes)
    return gain_of(chain[0], chain[-1], floor, refitting.average_s)
