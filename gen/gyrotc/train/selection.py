"""Model selection: the simplest correction that does on unseen thermal history what the best one does.

Rungs: nothing, constant, linear, cubic in T, cubic with a slope in dT/dt, map of T, map of (T, dT/dt). Each is fitted
with every stretch of history left out in turn (`history_folds`) and judged on that stretch by means over
`average_s`. Two questions decide:

1. *Which rung?* The yardstick is the best of what anyone would fit: a constant, a cubic in T, a cubic with a slope in
   dT/dt. Another candidate has to be clearly better than that, by one standard error (Hastie, Tibshirani, Friedman, The
   Elements of Statistical Learning, 7.10) of paired differences over all stretches, of the score and of the mean
   square: it has to gain on stretches as they come and on what they add up to. The simplest is taken of those that do,
   of equally good ones, and of those that leave no more than noise on any stretch.
2. *Is that one better than a constant?* Paired over independent pieces of history, by a t test at 5 %. Pieces are
   power-ons, runs of one power-on, or, of fewer than three runs, the stretches themselves: a sample beside a sample
   that was seen proves nothing about another day, and three runs have two degrees of freedom. Where the rung leaves
   less than the noise on every piece, pieces differ by noise alone, and all stretches count.

The score of a stretch is ½ log(mean square + s²), s the noise of a mean from first differences: all stretches count
alike, one that fails grossly does not outvote the others, and differences below the noise count for nothing.
Where it is not, the constant is what remains. Only one candidate is asked, so that luck among many has no part in it.

The maps stand here as the mean of the evidence process with the parameters of the whole record, conditioned anew
without each stretch; the network that is emitted follows it to within a tenth of its own expected error.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..common.metrics import LEAST_SPAN_C
from .cross_validation import (
    Fold,
    edges_of,
    history_folds,
    more_than_error_of_pieces,
    more_than_its_error,
    of_pieces,
    surely_above_0,
    t_statistic,
)
from .data import Bins, Scaling, TrainingData, average, bin_of, cells_of, weighted_mean
from .evidence import MEAN_S, Process, TrainingFailed, conditioned_on, fit_process
from .guards import objection
from .mrbf import fit_mrbf, fit_mrbf_t
from .noise import difference_sigma
from .options import SIMPLE
from .result import Outcome
from .simple import all_solved, fit_simple, powers_of, triangle_of

__all__ = [
    "MAPS",
    "RUNGS",
    "YARDSTICKS",
    "Chosen",
    "Ladder",
    "Remaining",
    "RunSums",
    "chosen_by_ladder",
    "climb",
    "pieces_of",
]

MAPS = ("mrbf_t", "mrbf")
RUNGS = ("nothing", *SIMPLE, *MAPS)
"""From the simplest to the richest."""
YARDSTICKS = ("constant", "cubic", "cubic_slope")
"""What anyone would fit: least squares on few columns, the commonest corrections of such gyros."""
_EQUAL = 0.01  # of a score, so 1 % of RMS: half of what "no worse than trivial" allows (docs/real.md)
_LEAST_PIECES = 3  # runs or power-ons: with fewer their scatter says nothing
_LEAST_NOISE = 1e-6  # of the range of the means: rates without any noise differ by rounding only


@dataclass(frozen=True, slots=True)
class Ladder:
    """What every candidate leaves on every stretch of history, and the choice among them.

    Attributes:
        folds: Stretches that were left out.
        rms_dph: RMS of each stretch under each rung, shape (folds, rungs); nan: the rung could not be fitted.
        score: ½ log(mean square + s²), same shape.
        noise_dph: Noise of a mean over `average_s`, from differences of neighbours.
        pieces: Which independent piece each stretch belongs to, −1: to none, shape (folds,).
    """

    folds: Sequence[Fold]
    rms_dph: FloatArray
    score: FloatArray
    noise_dph: float
    pieces: NDArray[np.int64]

    def chosen(self, without: Sequence[str] = ()) -> str:
        """The candidate to emit, with some that must not be."""
        able = [
            k
            for k, name in enumerate(RUNGS)
            if name not in ("nothing", *without) and np.all(np.isfinite(self.score[:, k]))
        ]
        if len(self.folds) < 2 or len(able) < 2:
            return "constant"
        yardstick = self._best([k for k in able if RUNGS[k] in YARDSTICKS])
        better = [k for k in able if RUNGS[k] not in YARDSTICKS and self._clearly_worse(yardstick, k)]
        best = self._best(better) if better else yardstick
        rivals = [k for k in able if k in better or self._leaves_noise(k)]
        name = RUNGS[next(k for k in [*rivals, best] if not self._clearly_worse(k, best))]
        return name if self.beats_constant(name) else "constant"

    def _leaves_noise(self, k: int) -> bool:
        """Whether a candidate leaves less than the noise on every stretch, beside the noise."""
        return bool(np.max(self.rms_dph[:, k] ** 2) < 2.0 * self.noise_dph**2)

    def _best(self, rungs: Sequence[int]) -> int:
        """By the mean score; of those that are equal to within 1 % the simplest."""
        score = {k: float(self.score[:, k].mean()) for k in rungs}
        return next(k for k in rungs if score[k] <= min(score.values()) + _EQUAL)

    def beats_constant(self, name: str) -> bool:
        """Whether a candidate is better than a constant: by a t test at 5 % over independent pieces of history.

        Where it leaves less than the noise on every piece, pieces differ by noise alone: then over all stretches.
        """
        if name in ("nothing", "constant"):
            return False
        used = self.pieces >= 0
        excess = self.rms_dph[used, RUNGS.index(name)] ** 2 - self.noise_dph**2
        tests = [of_pieces(self._gains(name), self.pieces)]
        if len(excess) and excess.max() < self.noise_dph**2:
            tests.append(self._gains(name))
        return any(surely_above_0(gains) for gains in tests)

    def gain(self, name: str) -> tuple[float, int]:
        """t of the gain in score over a constant over pieces, and its degrees of freedom; 0 where there is none."""
        return t_statistic(of_pieces(self._gains(name), self.pieces))

    def _gains(self, name: str) -> FloatArray:
        return np.asarray(self.score[:, RUNGS.index("constant")] - self.score[:, RUNGS.index(name)])

    def _clearly_worse(self, k: int, best: int) -> bool:
        """By more than a standard error of the paired difference, in score and in mean square."""
        return more_than_its_error(*(v[:, k] - v[:, best] for v in (self.score, self.rms_dph**2)))

    def beaten_by(self, name: str, other: Ladder, rung: str) -> bool:
        """Whether a rung of another ladder, over the same stretches, is what this one would choose above `name`.

        It must be better than `name` by more than a standard error of the paired difference, in score and in mean
        square, over all stretches and over those of independent pieces of history alone, and better than this
        ladder's constant as `beats_constant` asks. Pieces alone: the branches of a run resemble each other, and the
        ends of the range of temperature belong to all runs; what gains there and nowhere else has been seen twice,
        not in many runs.
        """
        own, others = RUNGS.index(name), RUNGS.index(rung)
        if len(self.folds) < 2 or not np.all(np.isfinite(other.score[:, others])):
            return False
        score, rms = self.score.copy(), self.rms_dph.copy()
        top = RUNGS.index("mrbf")
        if own == top:
            own = RUNGS.index("mrbf_t")
            score[:, own], rms[:, own] = self.score[:, top], self.rms_dph[:, top]
        score[:, top], rms[:, top] = other.score[:, others], other.rms_dph[:, others]
        both = replace(self, score=score, rms_dph=rms)
        differences = (v[:, own] - v[:, top] for v in (score, rms**2))
        return (
            both._clearly_worse(own, top)
            and more_than_error_of_pieces(self.pieces, *differences)
            and both.beats_constant("mrbf")
        )

    def rows(self, chosen: str) -> list[dict[str, Any]]:
        """`ladder` of `training.json`: RMS over the stretches, all counting alike, with its standard error."""
        return [self._row(k, name, chosen) for k, name in enumerate(RUNGS)]

    def _row(self, k: int, name: str, chosen: str) -> dict[str, Any]:
        square = self.rms_dph[:, k] ** 2
        known = len(square) > 0 and bool(np.all(np.isfinite(square)))
        rms = float(np.sqrt(square.mean())) if known else None
        error = None
        if known and rms and len(square) > 1:
            error = float(square.std(ddof=1) / np.sqrt(len(square)) / (2.0 * rms))
        return {
            "id": name,
            "left_out_rms_dph": rms,
            "standard_error_dph": error,
            "beats_constant": self.beats_constant(name),
            "chosen": name == chosen,
        }

    def stretches(self) -> list[str]:
        """What was left out, in words: "4 runs, 11 branches, the hottest tenth, ..."."""
        kinds = [fold.kind for fold in self.folds]
        words = [
            f"{kinds.count(kind)} {many if kinds.count(kind) > 1 else one}"
            for kind, (one, many) in _COUNTED.items()
            if kind in kinds
        ]
        return words + [text for kind, text in _RANGES.items() if kind in kinds]


_COUNTED = {
    "run": ("whole run", "whole runs"),
    "power_on": ("power-on", "power-ons"),
    "branch": ("branch", "branches"),
    "part": ("part", "parts"),
}
_RANGES = {"hottest": "the hottest tenth", "coldest": "the coldest tenth", "fastest": "the fastest rate"}


def climb(
    samples: TrainingData,
    scaling: Scaling,
    process: Process | None,
    power_on: NDArray[np.int64] | None,
    average_s: float,
    folds: Sequence[Fold] | None = None,
) -> Ladder:
    """Fits every candidate without every stretch of history.

    Args:
        samples: Samples as `cleaned` returns them.
        scaling: Scaling of all samples.
        process: The evidence process of all samples; None: it could not be fitted, and no map is tried.
        power_on: Number of the power-on of each run, by the run's index; None: each run is one.
        average_s: Averaging of what is judged, s.
        folds: Stretches that another selection of the same times has left out; None: those of these samples.
    """
    means, kept = _means(samples, process)
    groups = means.run if power_on is None else power_on[means.run]
    folds = history_folds(means, groups) if folds is None else folds
    judged = average(means, average_s)
    noise = difference_sigma(judged, judged.bias_dph, judged.weight / np.median(judged.weight))
    noise = max(noise, _LEAST_NOISE * float(np.ptp(judged.bias_dph)), float(np.finfo(np.float64).tiny) ** 0.5)
    sums = RunSums(means, kept, scaling, process)
    square = np.array([_squares(fold, sums, average_s) for fold in folds])
    square = square.reshape(len(folds), len(RUNGS))
    return Ladder(folds, np.sqrt(square), 0.5 * np.log(square + noise**2), noise, pieces_of(folds))


def _means(samples: TrainingData, process: Process | None) -> tuple[TrainingData, NDArray[np.bool_]]:
    """Means of every run once, however often it was handed over, and which of them the process kept."""
    means = average(samples, MEAN_S)
    kept = np.ones(len(means), dtype=bool) if process is None else process.kept
    seen: set[bytes] = set()
    first = np.ones(len(means), dtype=bool)
    for begin, end in pairwise(edges_of(means.run).tolist()):
        content = means.temperature_c[begin:end].tobytes() + means.bias_dph[begin:end].tobytes()
        first[begin:end] = content not in seen
        seen.add(content)
    return means.select(first), kept[first]


def pieces_of(folds: Sequence[Fold]) -> NDArray[np.int64]:
    """Power-ons, else runs, where there are three of them; else every stretch is a piece."""
    power_ons = np.array([fold.power_on for fold in folds], dtype=np.int64)
    runs = np.array([fold.run for fold in folds], dtype=np.int64)
    whole = [fold for fold in folds if fold.kind in ("run", "power_on")]
    if len({fold.power_on for fold in whole}) >= _LEAST_PIECES:
        return power_ons
    if len({fold.run for fold in whole if fold.kind == "run"}) >= _LEAST_PIECES:
        return runs
    return np.arange(len(folds))


def _squares(fold: Fold, sums: RunSums, average_s: float) -> list[float]:
    """Mean square on a stretch under each candidate that has not seen it, (deg/h)²."""
    held, rest = sums.means.select(fold.held), Remaining(sums, fold.near)
    t, r = sums.scaling.normalise(
        np.clip(held.temperature_c, *rest.temperature_c), np.clip(held.slope_c_per_min, *rest.slope_c_per_min)
    )
    flat = rest.temperature_c[1] - rest.temperature_c[0] < LEAST_SPAN_C
    cells = cells_of(held, average_s)
    squares = []
    for name in RUNGS:
        try:
            correction = rest.correction("constant" if flat and name != "nothing" else name, t, r)
        except TrainingFailed:
            squares.append(np.nan)
            continue
        squares.append(weighted_mean(cells.mean(held.bias_dph - correction) ** 2, cells.weight))
    return squares


class _SumOfRest:
    """A sum over samples that remain, for the price of those in the runs that a stretch touches.

    Sums are kept from the first run on and from the last run back. What remains is the sum before the touched runs, the
    one behind them, and what is left of them: nothing is subtracted, so no digits are lost however much is left out.

    Args:
        edges: First sample of every run, and the number of samples.
        of: The sum over some samples.
        both: The sum over two sets of them.
        none: The sum over none.
    """

    def __init__(
        self,
        edges: NDArray[np.intp],
        of: Callable[[slice | NDArray[np.intp]], FloatArray],
        both: Callable[[FloatArray, FloatArray], FloatArray],
        none: FloatArray,
    ) -> None:
        runs = [of(slice(begin, end)) for begin, end in pairwise(edges.tolist())]
        self._of, self._both = of, both
        self._before = list(accumulate(runs, both, initial=none))
        self._from = list(accumulate(reversed(runs), both, initial=none))[::-1]

    def __call__(self, first: int, after: int, own: NDArray[np.intp]) -> FloatArray:
        """Over the runs before `first`, the runs from `after` on, and the samples `own` of those between."""
        outside = self._both(self._before[first], self._from[after])
        return self._both(outside, self._of(own)) if len(own) else outside


class RunSums:
    """Means of all runs, and what remains of them without a stretch.

    Args:
        means: Means of all runs.
        kept: Which of them the process has kept.
        scaling: Normalisation of the inputs.
        process: Of the whole record; None: there is none.
    """

    def __init__(
        self, means: TrainingData, kept: NDArray[np.bool_], scaling: Scaling, process: Process | None
    ) -> None:
        self.means, self.scaling, self.process = means, scaling, process
        self.edges = edges_of(means.run)
        self.center = weighted_mean(means.bias_dph, means.weight)
        t, r = scaling.normalise(means.temperature_c, means.slope_c_per_min)
        bias, root = means.bias_dph - self.center, np.sqrt(means.weight / means.weight.max())
        rows = np.column_stack([powers_of(t, r), bias]) * root[:, None]
        ranges = np.stack(
            [x * sign for x in (means.temperature_c, means.slope_c_per_min) for sign in (-1.0, 1.0)]
        )
        self.triangle = _SumOfRest(
            self.edges,
            lambda at: triangle_of(rows[at]),
            lambda one, other: triangle_of(np.concatenate([one, other])),
            np.zeros((0, rows.shape[1])),
        )
        self.ends = _SumOfRest(
            self.edges, lambda at: ranges[:, at].max(axis=1), np.maximum, np.full(4, -np.inf)
        )
        known = np.where(kept, means.weight, 0.0)
        of_rate = {"mrbf_t": 0.0, "mrbf": 1.0} if process is not None else {}
        self.cells = {
            name: _cell_sums(self.edges, t, factor * r, bias, known) for name, factor in of_rate.items()
        }
        order = np.flatnonzero(kept)[np.argsort(means.weight[kept], kind="stable")]
        self._weights = means.weight[order]
        self._place = np.full(len(means), -1)
        self._place[order] = np.arange(len(order))

    def median_weight(self, near: NDArray[np.intp]) -> float:
        """Median weight of what the process has kept and is not left out; 0 where there is none of it.

        The k-th that remains is the k-th of all with as many further as are left out before it.
        """
        out = np.sort(self._place[near])
        out = out[out >= 0]
        left, ahead = len(self._weights) - len(out), out - np.arange(len(out))
        if left == 0:
            return 0.0
        middle = [(left - 1) // 2, left // 2]
        return float(self._weights[middle + np.searchsorted(ahead, middle, side="right")].sum() / 2)


class Remaining:
    """Every candidate fitted to what remains without a stretch.

    Attributes:
        temperature_c, slope_c_per_min: Ranges of what remains.
    """

    def __init__(self, sums: RunSums, near: NDArray[np.intp]) -> None:
        edges = sums.edges
        self._sums, self._near = sums, near
        first = int(np.searchsorted(edges, near[0], side="right")) - 1
        after = int(np.searchsorted(edges, near[-1], side="right"))
        own = np.ones(edges[after] - edges[first], dtype=bool)
        own[near - edges[first]] = False
        self._where = first, after, edges[first] + np.flatnonzero(own)
        t0, t1, r0, r1 = sums.ends(*self._where)
        self.temperature_c, self.slope_c_per_min = (float(-t0), float(t1)), (float(-r0), float(r1))
        triangle = sums.triangle(*self._where)
        # The first column is that of the constant, so what it explains of the bias alone is the mean that remains:
        # taken off, corrections whose columns depend on one another are the smallest about it.
        self._center = sums.center + float(triangle[0, -1] / triangle[0, 0])
        triangle[0, -1] = 0.0
        self._simple = all_solved(triangle, len(sums.means) - len(near))

    def correction(self, name: str, t: FloatArray, r: FloatArray) -> FloatArray:
        """What a candidate says at normalised inputs, deg/h.

        Raises:
            TrainingFailed: The map cannot be fitted.
        """
        if name == "nothing":
            return np.zeros(len(t))
        if name in SIMPLE:
            return np.asarray(self._center + powers_of(t, r) @ self._simple[name])
        process = self._sums.process
        typical = self._sums.median_weight(self._near)
        if process is None or typical == 0.0:
            raise TrainingFailed("there is no evidence process, or it has kept nothing of what remains")
        cells = self._sums.cells[name](*self._where)
        count, of_t, of_r, of_bias = cells[:, cells[0] > 0.0]
        center = float(of_bias.sum() / count.sum())
        mean = (of_bias / count - center) / process.spread
        bins = Bins(of_t / count, of_r / count, count / typical, mean, 0.0, float(len(count)))
        asked = conditioned_on(process, bins, self._sums.center + center)
        return asked(t, r if name == "mrbf" else 0.0 * r)


def _cell_sums(
    edges: NDArray[np.intp], t: FloatArray, r: FloatArray, bias: FloatArray, weight: FloatArray
) -> _SumOfRest:
    """Sums of weight, inputs and bias in the cells that a map is conditioned on, shape (4, cells)."""
    index = bin_of(t, r)
    columns, count = np.stack([weight, weight * t, weight * r, weight * bias]), int(index.max()) + 1
    return _SumOfRest(
        edges,
        lambda at: np.stack([np.bincount(index[at], column, count) for column in columns[:, at]]),
        np.add,
        np.zeros((4, count)),
    )


_STRUCTURE = 1.5  # a constant that leaves no more than this many times the noise has nothing to miss
NAMES = {
    "nothing": "no correction",
    "constant": "a constant",
    "linear": "a line in T",
    "cubic": "a cubic in T",
    "cubic_slope": "a cubic in T with a slope in dT/dt",
    "mrbf_t": "a map of T",
    "mrbf": "a map of T and dT/dt",
}


@dataclass(frozen=True, slots=True)
class Chosen:
    """The rung that is emitted: its name, networks, the table of all rungs, why, and what a user should know."""

    method: str
    outcome: Outcome
    rows: list[dict[str, Any]]
    reason: str
    findings: list[dict[str, Any]]


def chosen_by_ladder(
    samples: TrainingData,
    scaling: Scaling,
    power_on: NDArray[np.int64] | None,
    *,
    seed: int,
    average_s: float,
) -> Chosen:
    """Trains the rung that the ladder chooses; one that fails or must not be used makes way for the next choice.

    Args:
        samples: As `cleaned` returns them; their temperature spans at least 2 C.
        scaling: Scaling of these samples.
        power_on: Number of the power-on of each run, by its index; None: each run is one.
        seed: Seed of the Kohonen network.
        average_s: Averaging of RMS figures, s.
    """
    refused: dict[str, str] = {}
    process = None
    try:
        process = fit_process(samples, scaling)
    except TrainingFailed as failure:
        refused |= dict.fromkeys(MAPS, str(failure))
    ladder = climb(samples, scaling, process, power_on, average_s)
    while True:
        name = ladder.chosen(tuple(refused))
        try:
            outcome = _trained(name, samples, scaling, process, seed, average_s)
            against = objection(outcome, samples, scaling, average_s) if name != "constant" else ""
        except TrainingFailed as failure:
            against = str(failure)
        if not against:
            break
        refused[name] = against
    rows = [
        row | ({"refused": refused[row["id"]]} if row["id"] in refused else {}) for row in ladder.rows(name)
    ]
    findings = [_refusal(one, text) for one, text in refused.items()]
    misses = name == "constant" and _misses(samples, ladder)
    if misses:
        findings.insert(0, _does_not_generalise(ladder))
    return Chosen(name, outcome, rows, _reason(ladder, name, misses), findings)


def _trained(
    name: str, samples: TrainingData, scaling: Scaling, process: Process | None, seed: int, average_s: float
) -> Outcome:
    if name == "mrbf":
        return fit_mrbf(samples, scaling, seed=seed, centers=None, average_s=average_s, process=process)
    if name == "mrbf_t":
        return fit_mrbf_t(samples, scaling, seed=seed, centers=None, average_s=average_s)
    return fit_simple(name, samples, scaling, average_s)


def _misses(samples: TrainingData, ladder: Ladder) -> bool:
    """Whether a constant leaves more than noise on what it has not seen."""
    rms = ladder.rms_dph[:, RUNGS.index("constant")]
    return len(rms) == 0 or bool(np.sqrt(np.mean(rms**2)) > _STRUCTURE * ladder.noise_dph)


def _reason(ladder: Ladder, name: str, misses: bool) -> str:
    """Why this candidate, in words."""
    tried = f"left out in turn: {', '.join(ladder.stretches()) or 'nothing, there is too little'}"
    if misses:
        return f"nothing is shown to be better than a constant on history that was not seen ({tried})"
    if name == "constant":
        return f"what varies is hardly more than noise ({tried})"
    if name in YARDSTICKS:
        text = "the best of a constant and cubics, than which nothing else is better by a standard error"
    else:
        text = "better than a constant and cubics by more than a standard error, or simpler where only noise is left"
    return f"{text} ({tried})"


def _does_not_generalise(ladder: Ladder) -> dict[str, Any]:
    """The finding, with its reason and what would help."""
    rms = (
        dict(zip(RUNGS, np.sqrt(np.mean(ladder.rms_dph**2, axis=0)), strict=True))
        if len(ladder.folds)
        else {}
    )
    able = {n: float(v) for n, v in rms.items() if n not in ("nothing", "constant") and np.isfinite(v)}
    text = (
        "No correction is shown to hold on thermal history that it has not seen, so the model is a constant."
    )
    evidence: dict[str, Any] = {"noise_dph": ladder.noise_dph, "stretches": ladder.stretches()}
    if able:
        best = min(able, key=lambda n: able[n])
        t, freedom = ladder.gain(best)
        text += (
            f" Left out in turn ({', '.join(ladder.stretches())}), a constant leaves {rms['constant']:.4g} deg/h and "
            f"{NAMES[best]} {able[best]:.4g}; t = {t:.2g} with {freedom} degrees of freedom is what chance gives, too."
        )
        evidence |= {"best": best, "best_rms_dph": able[best], "constant_rms_dph": float(rms["constant"])}
        evidence |= {"t": t, "degrees_of_freedom": freedom}
    return {"id": "does_not_generalise", "text": f"{text} {_advice(ladder)}", "evidence": evidence}


def _advice(ladder: Ladder) -> str:
    """Which recordings would help."""
    runs = len({fold.run for fold in ladder.folds if fold.kind == "run"})
    branches = sum(fold.kind == "branch" for fold in ladder.folds)
    if runs == 0 and branches == 0:
        return (
            "Record a cycle of temperature, up and down, at least three times, with a power-on before each."
        )
    if runs == 0:
        return "One run says nothing about another: record the same cycle at least twice more, after a power-on each."
    if branches == 0:
        return (
            "In each run temperature goes one way, so that it, its rate and time cannot be separated: record runs "
            "that come back, and repeat them."
        )
    return "Repeat the runs with the same programme, after a power-on each: what repeats can be corrected."


def _refusal(name: str, text: str) -> dict[str, Any]:
    return {
        "id": "map_refused",
        "text": f"Model selection goes on without {NAMES[name]} ({name}): {text}.",
        "evidence": {"method": name, "reason": text},
    }
