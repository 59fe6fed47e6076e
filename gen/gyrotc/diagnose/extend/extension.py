"""Extension and its gain: the compensation model refitted with the named causes, measured on unseen runs.

Where there are exam runs, the training runs choose and the exam runs measure. Where there are none, runs
(or branches of few runs) are left out in turn, and causes and parameters are chosen anew without them.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...dataset import Dataset
from ...metrics import Averages
from ...train import Fit, TrainingData
from ...train.fitting import FitOptions, front_end
from ...train.spans import training_spans
from ..attribute.attribution import choose
from ..attribute.refine import Refined
from ..attribute.single_cycle import cycle_of
from ..pipeline import search_of
from ..screen.blocks import Records
from .gain import Gain, floor_of, gain_of
from .refit import Effect, Played, fit_extended, joined, play_runs, samples, score

__all__ = ["Extension", "extend"]

Mask = NDArray[np.bool_]
Progress = Callable[[str], None]
Chain = list[list[Averages]]

_FOLDS = 3
_FEW_RUNS = 3
_MOVING_C_PER_MIN = 0.3
_MOST_TERMS = 4


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
        samples: Training samples as the extended map sees them.
        floor: Noise floor of the scored samples, deg/h.
        baseline_rms, baseline_centers: Of the model without causes.
        measured_on: "exam" or "left out".
        before, after: Residuals of the scored runs without and with all causes.
    """

    steps: tuple[Gain, ...]
    total: Gain | None
    rate_left_out: tuple[str, Gain] | None
    forward: Gain | None
    extended: Fit | None
    shipped: tuple[Effect, ...]
    samples: TrainingData
    floor: float
    baseline_rms: float
    baseline_centers: int
    measured_on: str
    before: list[Averages]
    after: list[Averages]


class _Bench:
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
            "method": options.method,
            "seed": options.seed,
            "centers": options.centers,
            "rho": options.rho,
            "average_s": options.average_s,
        }

    def fit(
        self, effects: Sequence[Effect], kept: list[Mask] | None = None, *, beside: bool | None = None
    ) -> Fit:
        """The map beside the effects (`beside`: as if there were any); fits on all samples are remembered."""
        whole = kept is None or all(m.all() for m in kept)
        rate = not (self.single_cycle and (bool(effects) if beside is None else beside))
        for known, with_rate, fitted in self._fits:
            if whole and known == list(effects) and with_rate == rate:
                return fitted
        fitted = fit_extended(self.train, effects, self.arguments, None if whole else kept, rate=rate)
        if whole:
            self._fits.append((list(effects), rate, fitted))
        return fitted

    def everything(self) -> list[Mask]:
        return [np.ones(len(run.data.bias_dph), dtype=bool) for run in self.train]

    def on_exam(self, stages: Sequence[Sequence[Effect]]) -> Chain:
        """Residuals of the exam runs for each set of effects."""
        whole = [np.ones(len(run.data.bias_dph), dtype=bool) for run in self.exam]
        return [self._residuals(self.everything(), self.exam, whole, e) for e in stages]

    def on_training(self, effects: Sequence[Effect]) -> list[Averages]:
        """Residuals of the training runs themselves: more first differences for the noise floor."""
        return self._residuals(self.everything(), self.train, self.everything(), effects)

    def left_out(self, held: list[Mask], count: int) -> Chain:
        """Residuals of held-out training samples; causes are chosen anew on the others."""
        kept = [~m for m in held]
        effects = [Effect.of(c) for c in self._chosen(held, count)]
        stages = (effects[:k] for k in range(count + 1))
        return [
            self._residuals(kept, self.train, held, stage, beside=k > 0) for k, stage in enumerate(stages)
        ]

    def _residuals(
        self,
        kept: list[Mask],
        runs: list[Played],
        scored: list[Mask],
        effects: Sequence[Effect],
        *,
        beside: bool | None = None,
    ) -> list[Averages]:
        fitted = self.fit(effects, kept, beside=beside)
        return score(fitted, runs, effects, self.average_s, scored)

    def _chosen(self, held: list[Mask], count: int) -> tuple[Refined, ...]:
        """Best `count` causes on the records without the held-out samples."""
        masks = []
        for run, played, out in zip(self.records.runs, self.train, held, strict=True):
            times = played.data.time_s[out]
            hidden = np.zeros(len(run.history.time_s), dtype=bool)
            if times.size:
                end = times[-1] + played.block_s
                hidden = (run.history.time_s >= times[0] - 1e-6) & (run.history.time_s < end)
            masks.append(run.usable & ~hidden)
        rest = self.records.without_rows(masks)
        return cycle_of(rest).causes[:count] if self.single_cycle else choose(search_of(rest), count)


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
    bench = _Bench(dataset, records, options, single_cycle=single_cycle)
    effects = [Effect.of(c) for c in causes]
    stages = [effects[:k] for k in range(len(effects) + 1)]
    chain = bench.on_exam(stages) if bench.exam else _crossed(bench, len(effects))
    if single_cycle and effects:  # found together: one alone is another model
        chain = [chain[0], *(chain[-1] for _ in effects)]
    floor = floor_of([*chain[-1], *bench.on_training(effects)])
    pairs = [(chain[0], chain[-1]) for _ in effects] if single_cycle else itertools.pairwise(chain)
    steps = [gain_of(a, b, floor, options.average_s) for a, b in pairs]
    shipped, total = _shipped(bench, effects, steps, chain, floor)
    extended = bench.fit(shipped) if shipped else None
    return Extension(
        steps=tuple(steps),
        total=total,
        rate_left_out=_rate_left_out(bench, len(effects), floor) if effects else None,
        forward=_forward(bench, chain, len(effects), floor) if effects else None,
        extended=extended,
        shipped=tuple(shipped),
        samples=joined([samples(run, shipped) for run in bench.train]),
        floor=floor,
        baseline_rms=_rms(chain[0]),
        baseline_centers=bench.fit([]).n_centers,
        measured_on="exam" if bench.exam else "left out",
        before=chain[0],
        after=chain[-1],
    )


def _rms(runs: Sequence[Averages]) -> float:
    return float(np.sqrt(np.mean(np.concatenate([r.after_dph for r in runs]) ** 2)))


def _shipped(
    bench: _Bench, effects: list[Effect], steps: list[Gain], chain: Chain, floor: float
) -> tuple[list[Effect], Gain | None]:
    """Effects that a table can hold and that gain with confidence on unseen runs."""
    able = [e for e, g in zip(effects, steps, strict=True) if e.term.shipped and g.positive][:_MOST_TERMS]
    if not able:
        return [], None
    if able == effects:
        both = [chain[0], chain[-1]]
    elif bench.exam:
        both = bench.on_exam([[], able])
    else:
        return able, next(g for e, g in zip(effects, steps, strict=True) if e in able)
    total = gain_of(both[0], both[1], floor, bench.average_s)
    return (able, total) if total.positive else ([], None)


def _crossed(bench: _Bench, count: int) -> Chain:
    """Every training run (or branch of few runs) left out in turn, in a few groups."""
    folds = _folds(bench)
    if not folds:
        return [_score_self(bench)] * (count + 1)
    chains = [bench.left_out(held, count) for held in folds]
    return [[a for chain in chains for a in chain[k]] for k in range(count + 1)]


def _score_self(bench: _Bench) -> list[Averages]:
    """Where nothing can be left out (one very short run): the training samples themselves, without gain."""
    return score(bench.fit([]), bench.train, [], bench.average_s, bench.everything())


def _folds(bench: _Bench) -> list[list[Mask]]:
    """Held-out masks: groups of runs, or spans of few runs."""
    sizes = [len(run.data.bias_dph) for run in bench.train]
    if len(bench.train) >= _FEW_RUNS:
        return [
            [np.full(n, k % _FOLDS == fold, dtype=bool) for k, n in enumerate(sizes)]
            for fold in range(_FOLDS)
        ]
    data = joined([run.data for run in bench.train])
    return [
        [span.contains(run.data.run, run.data.time_s) for run in bench.train]
        for span in training_spans(bench.runs, data)
    ]


def _rate_left_out(bench: _Bench, count: int, floor: float) -> tuple[str, Gain] | None:
    """All runs of the fastest environment left out of everything, where another moving one remains."""
    speeds: dict[str, float] = {}
    for run in bench.train:
        speed = float(np.quantile(np.abs(run.data.slope_c_per_min), 0.9))
        speeds[run.environment] = max(speeds.get(run.environment, 0.0), speed)
    moving = [e for e, s in speeds.items() if s > _MOVING_C_PER_MIN]
    if len(moving) < 2:
        return None
    fastest = max(moving, key=lambda e: speeds[e])
    held = [np.full(len(r.data.bias_dph), r.environment == fastest, dtype=bool) for r in bench.train]
    chain = bench.left_out(held, count)
    return fastest, gain_of(chain[0], chain[-1], floor, bench.average_s)


def _forward(bench: _Bench, chain: Chain, count: int, floor: float) -> Gain | None:
    """Later runs from earlier ones: the exam where it came last, else the last third of the training runs."""
    days = [run.day for run in bench.train]
    later = [run.day for run in bench.exam]
    if any(d is None for d in (*days, *later)) or len(days) < _FEW_RUNS:
        return None
    known = [float(d) for d in days if d is not None]
    if later and min(float(d) for d in later if d is not None) > max(known):
        return gain_of(chain[0], chain[-1], floor, bench.average_s)
    cut = float(np.quantile(known, 0.67))
    held = [
        np.full(len(r.data.bias_dph), d > cut, dtype=bool) for r, d in zip(bench.train, known, strict=True)
    ]
    if not any(m.any() for m in held) or sum(not m.any() for m in held) < 2:
        return None
    ends = bench.left_out(held, count)
    return gain_of(ends[0], ends[-1], floor, bench.average_s)
