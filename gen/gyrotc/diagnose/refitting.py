"""The training runs as the target sees them, refitted with causes, with or without some of the samples."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..common.arrays import BoolArray
from ..common.metrics import Averages
from ..recordings.records import Dataset
from ..train.data import joined
from ..train.fitting import FitOptions, front_end, map_method
from ..train.result import Fit
from ..train.spans import training_spans
from .attribution import choose
from .blocks import Records
from .pipeline import search_of
from .refine import Refined
from .refit import Effect, Played, completed, fit_extended, known, play_runs, scored_means
from .single_cycle import cycle_of

__all__ = ["FEW_RUNS", "Chain", "Refitting", "folds_of"]

Chain = list[list[Averages]]
"""Residuals of the scored runs for every set of causes, from none to all."""

FEW_RUNS = 3  # fewer cannot be left out whole: two thirds must remain to learn from
_FOLDS = 3  # two thirds remain to learn from, at the cost of three fits
_ROUNDING_S = 1e-6  # of times that are compared


class Refitting:
    """Training runs after the front end, and the options of every fit.

    Of a single cycle the map beside any effect is one of T alone (see `cycle`).
    """

    def __init__(
        self, dataset: Dataset, records: Records, options: FitOptions, *, single_cycle: bool
    ) -> None:
        self.records = records
        self.single_cycle = single_cycle
        self.runs = [r for r in dataset.runs if r.role == "train"]
        self.exam_runs = [r for r in dataset.runs if r.role == "exam"]
        self.front = front_end(self.runs, options.block_s)
        self.train = play_runs(dataset, self.runs, self.front)
        self.exam = play_runs(dataset, self.exam_runs, self.front)
        self.average_s = options.average_s
        self._fits: list[tuple[list[Effect], bool, Fit]] = []
        self.arguments: dict[str, Any] = {
            "method": map_method(options.method),
            "seed": options.seed,
            "centers": options.centers,
            "rho": options.rho,
            "average_s": options.average_s,
            # Beside effects the map of a single cycle is one of T alone, which no lot knows.
            "prior": None if single_cycle else options.prior,
        }

    def fit(
        self, effects: Sequence[Effect], kept: list[BoolArray] | None = None, *, beside: bool | None = None
    ) -> Fit:
        """The map beside the effects (`beside`: as if there were any); fits on all samples are remembered."""
        whole = kept is None or all(m.all() for m in kept)
        rate = not (self.single_cycle and (bool(effects) if beside is None else beside))
        for fitted_beside, with_rate, fitted in self._fits:
            if whole and fitted_beside == list(effects) and with_rate == rate:
                return fitted
        fitted = fit_extended(self.train, effects, self.arguments, None if whole else kept, rate=rate)
        if whole:
            self._fits.append((list(effects), rate, fitted))
        return fitted

    def everything(self) -> list[BoolArray]:
        """All training samples, per run."""
        return [np.ones(len(run.data.bias_dph), dtype=bool) for run in self.train]

    def on_exam(self, stages: Sequence[Sequence[Effect]]) -> Chain:
        """Residuals of the exam runs for each set of effects, of samples whose input is known beside all of them."""
        all_of_them = [effect for stage in stages for effect in stage]
        whole = [known(run, all_of_them) for run in self.exam]
        return [self._residuals(self.everything(), self.exam, whole, e) for e in stages]

    def on_training(self, effects: Sequence[Effect]) -> list[Averages]:
        """Residuals of the training runs themselves: more first differences for the noise floor."""
        return self._residuals(self.everything(), self.train, self.everything(), effects)

    def left_out(self, held: list[BoolArray], count: int) -> Chain:
        """Residuals of held-out training samples; causes are chosen anew on the others."""
        kept = [~m for m in held]
        effects = completed(self.train, [Effect.of(c) for c in self._chosen(held, count)], kept)
        stages = (effects[:k] for k in range(count + 1))
        scored = [m & known(run, effects) for run, m in zip(self.train, held, strict=True)]
        return [
            self._residuals(kept, self.train, scored, stage, beside=k > 0) for k, stage in enumerate(stages)
        ]

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
        """Best `count` causes on the records without the held-out samples."""
        masks = []
        for run, played, out in zip(self.records.runs, self.train, held, strict=True):
            times = played.data.time_s[out]
            hidden = np.zeros(len(run.history.time_s), dtype=bool)
            if times.size:
                end = times[-1] + played.block_s
                hidden = (run.history.time_s >= times[0] - _ROUNDING_S) & (run.history.time_s < end)
            masks.append(run.usable & ~hidden)
        rest = self.records.without_rows(masks)
        return cycle_of(rest).states[:count] if self.single_cycle else choose(search_of(rest), count)


def folds_of(refitting: Refitting) -> list[list[BoolArray]]:
    """Held-out masks: groups of runs, or spans of few runs."""
    sizes = [len(run.data.bias_dph) for run in refitting.train]
    if len(refitting.train) >= FEW_RUNS:
        return [
            [np.full(n, k % _FOLDS == fold, dtype=bool) for k, n in enumerate(sizes)]
            for fold in range(_FOLDS)
        ]
    data = joined([run.data for run in refitting.train])
    return [
        [span.contains(run.data.run, run.data.time_s) for run in refitting.train]
        for span in training_spans(refitting.runs, data)
    ]
