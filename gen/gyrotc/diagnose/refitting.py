"""Fit the map beside effects, with or without some of the samples, and measure what it leaves.

Where there are no test runs, training runs (or branches of few runs) are left out in turn, and causes and parameters
are chosen anew without them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..causes import CATALOGUE
from ..common.arrays import BoolArray, FloatArray
from ..common.metrics import Averages, average_rows
from ..quality.event_findings import rows_used
from ..quality.judgement import Judged, judge
from ..recordings.records import Dataset
from ..train.data import TrainingData, joined
from ..train.fitting import FitOptions, Read, front_end, map_method, power_ons
from ..train.folds import folds
from ..train.methods import fit
from ..train.result import Fit, predict
from ..train.simple import without_rate
from .attribution import choose
from .blocks import Records
from .map_choice import search_of
from .optional_parts import completed
from .played import Effect, Played, chosen_samples, known, play_runs, samples, samples_beside
from .refinement import Refined
from .single_cycle import cycle_of
from .static_map import fits_exactly

Chain = list[list[Averages]]
"""Residuals of the scored runs for every set of causes, from none to all."""
FOLDS = 3  # two thirds remain to learn from, at the cost of three fits; fewer runs cannot be left out whole
_ROUNDING_S = 1e-6  # of times that are compared
_RE_ZERO_S = 600.0  # a gyro is re-zeroed in its first ten minutes at rest


def is_corrected(cause: Refined) -> bool:
    """Test whether the effect of a cause can be taken off beside the map: not where it is structure of the map."""
    return CATALOGUE[cause.candidate.id].kind != "static"


class Refitting:
    """Training runs after the front end, and the options of every fit.

    The runs of the data set are those that `Judged.cut` returns. For a single cycle the map that is fitted with any
    effect depends on T alone (see `single_cycle`).
    """

    def __init__(
        self,
        dataset: Dataset,
        records: Records,
        options: FitOptions,
        *,
        judged: Judged | None = None,
        single_cycle: bool,
    ) -> None:
        self.records = records
        self.single_cycle = single_cycle
        self.runs = [r for r in dataset.runs if r.role == "train"]
        self.front = front_end(self.runs, options.block_s)
        self._judged = judged or judge(dataset)
        self.train = play_runs(dataset, self.runs, self.front, self._judged, channels=options.channels, bridged=True)
        self.average_s = options.average_s
        exam = play_runs(dataset, [r for r in dataset.runs if r.role == "exam"], self.front, self._judged)
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
            tuple(self.runs),
            joined([run.data for run in self.train]),
            {name: np.concatenate([run.seen[name] for run in self.train]) for name in self.train[0].seen},
            rows_used(self._judged, self.runs),
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

    def samples_beside(self, effects: Sequence[Effect], whole: Sequence[Effect] = ()) -> TrainingData:
        """Return samples beside effects, without intercepts, whose input is known beside the `whole` set too."""
        masks = [known(run, whole) for run in self.train]
        return samples_beside(self.train, effects, self.arguments["power_on"], masks)

    def takes(self, causes: Sequence[Refined]) -> bool:
        """Test whether every cause leaves samples whose input is known: a late record of short spans may leave none."""
        effects = [effect for effect in map(Effect.of, causes) if effect.term.mended]
        return all(any(known(run, [effect]).any() for run in self.train) for effect in effects)

    def everything(self) -> list[BoolArray]:
        """All training samples, per run."""
        return [np.ones(len(run.data.bias_dph), dtype=bool) for run in self.train]

    def on_exam(self, stages: Sequence[Sequence[Effect]]) -> Chain:
        """Return residuals of the test runs for each set of effects, on samples whose input is known beside all."""
        all_of_them = [effect for stage in stages for effect in stage]
        whole = [known(run, all_of_them) for run in self.exam]
        return [self._residuals(self.everything(), self.exam, whole, e) for e in stages]

    def left_out(self, held: list[BoolArray], causes: Sequence[Refined]) -> Chain:
        """Return residuals of held-out training samples; as many causes are chosen anew on the others."""
        kept = [~m for m in held]
        chosen = filter(is_corrected, self.chosen_without(held, len(causes)))
        effects = completed(self.train, [Effect.of(c) for c in chosen], self.arguments["power_on"], kept)
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

    def chosen_without(self, held: list[BoolArray], count: int) -> tuple[Refined, ...]:
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
    if len(refitting.train) >= FOLDS:
        return [[np.full(n, k % FOLDS == fold, dtype=bool) for k, n in enumerate(sizes)] for fold in range(FOLDS)]
    data = joined([run.data for run in refitting.train])
    return [[fold.held(run.data) for run in refitting.train] for fold in folds(data, power_ons(refitting.runs))]


def fit_extended(
    runs: Sequence[Played],
    effects: Sequence[Effect],
    arguments: dict[str, Any],
    kept: Sequence[NDArray[np.bool_]] | None = None,
    *,
    rate: bool = True,
) -> Fit:
    """The map refitted beside the effects, on the samples `kept` (default: all); without `rate` a map of T alone."""
    data = chosen_samples(runs, effects, kept)
    return fit(data, **arguments) if rate else _over_any_rate(data, arguments)


def _over_any_rate(data: TrainingData, arguments: dict[str, Any]) -> Fit:
    """A map of T alone, valid over the rates of the samples."""
    slope = data.slope_c_per_min
    fitted = fit(replace(data, slope_c_per_min=np.zeros_like(slope)), **arguments)
    flat = [without_rate(one) for one in fitted.networks]
    scaling = replace(
        fitted.scaling,
        half_range_c_per_min=max(float(np.abs(slope).max()), fitted.scaling.half_range_c_per_min),
        slope_c_per_min=(float(slope.min()), float(slope.max())),
    )
    return replace(fitted, outcome=replace(fitted.outcome, networks=flat), scaling=scaling)


def mean_count(run: Played, average_s: float) -> int:
    """Return the number of means over `average_s` that the samples of a run have."""
    nothing = np.zeros(run.data.time_s.size)
    whole = np.ones(nothing.size, dtype=bool)
    return _means(run, nothing, whole, average_s).time_s.size


def scored_means(
    fitted: Fit,
    runs: Sequence[Played],
    effects: Sequence[Effect],
    average_s: float,
    scored: Sequence[NDArray[np.bool_]],
) -> list[Averages]:
    """Return residuals of the scored samples of every run as means over `average_s`; runs without any drop out.

    Samples whose input is not known beside the effects are not scored.
    """
    out = []
    for run, asked in zip(runs, scored, strict=True):
        seen = known(run, effects)
        chosen = asked & seen
        if not chosen.any():
            continue
        data, rest = samples(run, effects).select(seen), np.zeros(seen.size)
        left = data.bias_dph - predict(fitted, data.temperature_c, data.slope_c_per_min)
        if any(e.term.kind == "random" for e in effects):  # a new draw for every run: re-zeroed
            left = _re_zeroed(left, data.time_s, effects)
        rest[seen] = left
        out.append(_means(run, rest, chosen, average_s))
    return out


def _re_zeroed(rest: FloatArray, time_s: FloatArray, effects: Sequence[Effect]) -> FloatArray:
    """Return residuals after a rest at their start: its mean counts as far as the offsets exceed its noise."""
    variance = max(e.values["std_dph"] for e in effects if e.term.kind == "random") ** 2
    first = rest[time_s < time_s[0] + _RE_ZERO_S]
    noise = float(np.mean(np.diff(rest) ** 2)) / 2.0 / len(first) if len(rest) > 1 else 0.0
    return np.asarray(rest - first.mean() * variance / (variance + noise))


def _means(run: Played, left_dph: FloatArray, scored: NDArray[np.bool_], average_s: float) -> Averages:
    return average_rows(
        run.data.time_s,
        run.data.temperature_c,
        run.data.bias_dph,
        left_dph,
        scored=scored,
        average_s=max(average_s, run.block_s),
        from_s=run.begins_s,
    )
