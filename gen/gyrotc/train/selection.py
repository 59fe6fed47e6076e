"""Model selection: which correction is emitted, by what each leaves on whole pieces of history that it has not seen.

Candidates: a constant, a cubic in T, a cubic with a slope in dT/dt, the same with coefficients shrunk by how much they
scatter between power-ons (`mixed`), and the network. Pieces are whole runs, of a single run its branches (`pieces`):
they do not overlap, so that no stretch of history counts twice. The score of a piece is ½ log(mean square + s²), s the
noise of a mean: a piece on which a candidate fails grossly does not outvote the others, and differences below the noise
count for nothing.

Of the candidates with few coefficients the simplest is taken that is within 2 % of the least mean score; the network,
which can follow anything, only where pieces agree that it is better, by a t test over them. The constant stays unless
it is beaten by 10 % with t of at least 1, or surely: what is no better on other history is a risk without a use.

Where candidates leave no more than white noise on every piece, pieces differ by that noise alone, and what is known
about it says more than they do: of these candidates, the network among them, the simplest is taken whose likelihood on
unseen means is not clearly below that of the best.

The network stands here as the mean of the evidence process with the parameters of the whole record, conditioned anew
without each piece; the network that is emitted follows it to within a tenth of its own expected error. So do the
parameters of `mixed` come from the whole record.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import BoolArray, FloatArray
from ..common.metrics import LEAST_SPAN_C, median
from .data import (
    MIN_LOG_LIKELIHOOD_GAIN,
    Fold,
    Scaling,
    TrainingData,
    average_samples,
    edges_of,
    gather,
    mean_cells,
    pieces,
    surely_above_0,
    t_statistic,
    unseen_log_likelihood,
    weighted_mean,
)
from .evidence import MEAN_S, Process, TrainingFailed, conditioned_on, difference_sigma, fit_process
from .mrbf import fit_mrbf
from .objection import objection_to
from .result import Outcome
from .simple import Mixed, all_solved, fit_mixed_model, fit_simple, outcome_of, powers_of, triangle_of

_FEW_COLUMNS = ("constant", "cubic", "cubic_slope")
_SIMPLE = (*_FEW_COLUMNS, "mixed")
CANDIDATES = ("nothing", *_SIMPLE, "mrbf")
"""From the simplest to the richest."""
_OF_NETWORK = 0.025  # of the t test
_LEAST = 0.02  # share of RMS by which the network has to be better: what "no worse than trivial" allows (docs/real.md)
_COVERED = 0.5  # of a piece at temperatures that the rest has seen: of less it is the map's ends that are judged
_MUCH = 0.10  # share of RMS by which the constant has to be beaten where the t test is silent
_UNDECIDED = 1.0  # t of the gain over a constant below which it is a coin (docs/training.md, section 2)
_LEAST_NOISE = 1e-6  # of the range of the means: rates without any noise differ by rounding only


@dataclass(frozen=True, slots=True)
class CandidateScores:
    """What every candidate leaves on every piece of history, and the choice among them.

    Attributes:
        folds: Pieces that were left out.
        rms_dph: RMS of each piece under each candidate, shape (folds, candidates); nan: it could not be fitted.
        noise_dph: Noise of a mean over `average_s`, from all differences of neighbours.
        white_dph: The same without slopes and outliers.
        means: Number of means in each piece, shape (folds,).
        covered_dph: As `rms_dph`, of means at temperatures that the rest of the history has seen, about the mean of a
            whole run; nan where these are less than half of a piece.
        candidates: Names of the candidates, from the simplest to the richest.
    """

    folds: Sequence[Fold]
    rms_dph: FloatArray
    noise_dph: float
    white_dph: float
    means: FloatArray
    covered_dph: FloatArray
    candidates: tuple[str, ...] = CANDIDATES

    def chosen(self, without: Sequence[str] = ()) -> str:
        """The candidate to emit, with some that must not be."""
        able = [n for n in self.candidates[1:] if n not in without and np.all(np.isfinite(self._rms(n)))]
        if len(self.folds) < 2:
            return "constant"
        likely = {n: unseen_log_likelihood(self._rms(n) ** 2, self.means, self.white_dph) for n in able}
        if noise := {n: found for n, found in likely.items() if found is not None}:
            return next(n for n, found in noise.items() if found >= max(noise.values()) - MIN_LOG_LIKELIHOOD_GAIN)
        mean = {n: float(self._score(n).mean()) for n in able if n in _SIMPLE}
        name = next(n for n, score in mean.items() if score <= min(mean.values()) + _LEAST)
        if "mrbf" in able and self._surely_better("mrbf", name, _OF_NETWORK):
            name = "mrbf"
        name = name if self.beats_constant(name) else "constant"
        return name

    def _surely_better(self, name: str, other: str, level: float) -> bool:
        return _surely(self._score(other) - self._score(name), level)

    def _rms(self, name: str) -> FloatArray:
        return np.asarray(self.rms_dph[:, self.candidates.index(name)])

    def _covered(self, name: str) -> FloatArray:
        return np.asarray(self.covered_dph[:, self.candidates.index(name)])

    def _score(self, name: str) -> FloatArray:
        """½ log(mean square + s²) of every piece."""
        return self._log(self._rms(name))

    def _log(self, rms_dph: FloatArray) -> FloatArray:
        return np.asarray(0.5 * np.log(rms_dph**2 + self.noise_dph**2))

    def beats_constant(self, name: str) -> bool:
        """Whether a candidate is better than a constant on unseen pieces: by 10 % with t of at least 1, or surely."""
        gains = self._score("constant") - self._score(name)
        much = gains.mean() >= _MUCH and t_statistic(gains)[0] >= _UNDECIDED
        return name not in ("nothing", "constant") and bool(much or surely_above_0(gains))

    def gain(self, name: str) -> tuple[float, int]:
        """t of the gain in score over a constant over pieces, and its degrees of freedom; 0 where there is none."""
        return t_statistic(self._score("constant") - self._score(name))

    def covered_scores(self, name: str) -> FloatArray:
        """Return log RMS (with the noise) of what is covered of each piece; nan where too little is."""
        return self._log(self._covered(name))

    def rms_covered(self, name: str) -> float | None:
        """As `rms_of`, over what is covered."""
        square = self._covered(name) ** 2
        return float(np.sqrt(np.nanmean(square))) if np.isfinite(square).any() else None

    def rms_of(self, name: str) -> float | None:
        """RMS of a candidate over the pieces, all counting alike; None where it is not known."""
        square = self._rms(name) ** 2
        return float(np.sqrt(square.mean())) if len(square) and np.all(np.isfinite(square)) else None

    def rows(self, chosen: str) -> list[dict[str, Any]]:
        """`candidates` of `training.json`: RMS over the pieces, all counting alike, with its standard error."""
        return [self._row(name, chosen) for name in self.candidates]

    def _row(self, name: str, chosen: str) -> dict[str, Any]:
        square, rms = self._rms(name) ** 2, self.rms_of(name)
        error = None
        if rms and len(square) > 1:
            error = float(square.std(ddof=1) / np.sqrt(len(square)) / (2.0 * rms))
        t, freedom = self.gain(name)
        return {
            "id": name,
            "left_out_rms_dph": rms,
            "standard_error_dph": error,
            "beats_constant": rms is not None and self.beats_constant(name),
            "t": t if freedom and name not in ("nothing", "constant") else None,
            "chosen": name == chosen,
        }

    def stretches(self) -> list[str]:
        """What was left out, in words: "4 whole runs", "3 branches"."""
        kinds = [fold.kind for fold in self.folds]
        return [
            f"{kinds.count(kind)} {many if kinds.count(kind) > 1 else one}"
            for kind, (one, many) in _COUNTED.items()
            if kind in kinds
        ]


def _surely(gains: FloatArray, level: float) -> bool:
    """Whether gains in score over pieces are above the least one by their mean, and above 0 by a t test."""
    return len(gains) > 1 and bool(gains.mean() > _LEAST) and surely_above_0(gains, significance=level)


_COUNTED = {"run": ("whole run", "whole runs"), "branch": ("branch", "branches"), "part": ("part", "parts")}


def compare_candidates(
    samples: TrainingData,
    scaling: Scaling,
    process: Process | None,
    power_on: NDArray[np.int64] | None,
    average_s: float,
    *,
    rate: bool = True,
) -> CandidateScores:
    """Fits every candidate without every piece of history.

    Args:
        samples: Samples as `cleaned` returns them.
        scaling: Scaling of all samples.
        process: The evidence process of all samples; None: it could not be fitted, and no map is tried.
        power_on: Number of the power-on of each run, by the run's index; None: each run is one.
        average_s: Averaging of what is judged, s.
        rate: Whether the network sees dT/dt.
    """
    means, kept = _means(samples, process)
    folds = pieces(means)
    judged = average_samples(means, average_s)
    white = difference_sigma(judged, judged.bias_dph, judged.weight / median(judged.weight))
    least = max(_LEAST_NOISE * float(np.ptp(judged.bias_dph)), float(np.finfo(np.float64).tiny) ** 0.5)
    noise = max(_difference_rms(judged), least)
    rest = Rest(means, kept, scaling, process, _on(means, power_on), rate=rate)
    square = np.array([_squares(fold, rest, average_s) for fold in folds]).reshape(len(folds), 2, len(CANDIDATES))
    count = np.array([len(average_samples(means.select(fold.held), average_s)) for fold in folds], dtype=np.float64)
    whole, covered = np.sqrt(square).transpose(1, 0, 2)
    return CandidateScores(folds, whole, noise, max(white, least), count, covered)


def _difference_rms(means: TrainingData) -> float:
    """Noise of a mean, from differences of those that follow one another in a run, deg/h."""
    differences = np.diff(means.bias_dph)[np.diff(means.run) == 0]
    return float(np.sqrt(np.mean(differences**2) / 2.0)) if len(differences) else 0.0


def _on(samples: TrainingData, power_on: NDArray[np.int64] | None) -> NDArray[np.int64]:
    """Number of the power-on of every sample."""
    return samples.run if power_on is None else power_on[samples.run]


def _means(samples: TrainingData, process: Process | None) -> tuple[TrainingData, BoolArray]:
    """Means of every run once, however often it was handed over, and which of them the process kept."""
    means = average_samples(samples, MEAN_S)
    kept = np.ones(len(means), dtype=bool) if process is None else process.kept
    seen: set[bytes] = set()
    first = np.ones(len(means), dtype=bool)
    for begin, end in pairwise(edges_of(means.run).tolist()):
        content = means.temperature_c[begin:end].tobytes() + means.bias_dph[begin:end].tobytes()
        first[begin:end] = content not in seen
        seen.add(content)
    return means.select(first), kept[first]


def _squares(fold: Fold, rest: Rest, average_s: float) -> list[list[float]]:
    """Mean square on a piece under each candidate that has not seen it, of all and of what is covered, (deg/h)²."""
    held, (low, high) = rest.means.select(fold.held), rest.ranges(fold.near)
    t, r = rest.scaling.normalise(
        np.clip(held.temperature_c, low[0], high[0]), np.clip(held.slope_c_per_min, low[1], high[1])
    )
    flat = high[0] - low[0] < LEAST_SPAN_C
    cells = mean_cells(held, average_s)
    corrections = rest.corrections(fold.near, t, r, ("constant",) if flat else CANDIDATES[1:])
    at = cells.mean(held.temperature_c)
    seen = (at >= low[0]) & (at <= high[0])
    enough = seen.mean() >= _COVERED
    squares, covered = [], []
    for name in CANDIDATES:
        correction = 0.0 * t if name == "nothing" else corrections["constant" if flat else name]
        left = None if correction is None else cells.mean(held.bias_dph - correction)
        squares.append(np.nan if left is None else weighted_mean(left**2, cells.weight))
        covered.append(np.nan if left is None or not enough else _square(left[seen], cells.weight[seen], fold.kind))
    return [squares, covered]


def _square(left: FloatArray, weight: FloatArray, kind: str) -> float:
    """Mean square of what is left of a piece; of a whole run about its mean, which its power-on has drawn."""
    about = weighted_mean(left, weight) if kind == "run" else 0.0
    return weighted_mean((left - about) ** 2, weight)


class Rest:
    """Every candidate fitted to what remains of the means of all runs without a piece.

    Args:
        means: Means of all runs.
        kept: Which of them the process has kept.
        scaling: Normalisation of the inputs.
        process: Of the whole record; None: there is none.
        power_on: Number of the power-on of each of the means.
        rate: Whether the network sees dT/dt.
    """

    def __init__(
        self,
        means: TrainingData,
        kept: BoolArray,
        scaling: Scaling,
        process: Process | None,
        power_on: NDArray[np.int64],
        *,
        rate: bool = True,
    ) -> None:
        self.means, self.scaling, self._kept, self._process = means, scaling, kept, process
        self._t, self._r = scaling.normalise(means.temperature_c, means.slope_c_per_min)
        self._rate = rate
        self._mixed: Mixed | None = None
        with suppress(TrainingFailed):
            self._mixed = fit_mixed_model(means, scaling, power_on)
        self._center = weighted_mean(means.bias_dph, means.weight)
        root = np.sqrt(means.weight / means.weight.max())
        bias = means.bias_dph - self._center
        self._rows = np.column_stack([powers_of(self._t, self._r), bias]) * root[:, None]
        self._triangles = {
            int(means.run[a]): triangle_of(self._rows[a:b]) for a, b in pairwise(edges_of(means.run).tolist())
        }

    def _without(self, near: NDArray[np.intp]) -> BoolArray:
        left = np.ones(len(self.means), dtype=bool)
        left[near] = False
        return left

    def ranges(self, near: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest T (C) and dT/dt (C/min) of what remains."""
        left = self._without(near)
        inputs = np.stack([self.means.temperature_c[left], self.means.slope_c_per_min[left]])
        return inputs.min(axis=1), inputs.max(axis=1)

    def corrections(
        self, near: NDArray[np.intp], t: FloatArray, r: FloatArray, names: Sequence[str]
    ) -> dict[str, FloatArray | None]:
        """What candidates say at normalised inputs, deg/h; None: it cannot be fitted."""
        powers, simple = powers_of(t, r), self._simple(near)
        found: dict[str, FloatArray | None] = {}
        for name in names:
            if name in simple:
                found[name] = powers @ simple[name]
                continue
            try:
                found[name] = powers @ self._shrunk(near) if name == "mixed" else self._map(near)(t, r)
            except TrainingFailed:
                found[name] = None
        return found

    def _simple(self, near: NDArray[np.intp]) -> dict[str, FloatArray]:
        """Weights of least squares on few columns."""
        left = self._without(near)
        touched = set(self.means.run[near].tolist())
        own = left & np.isin(self.means.run, list(touched))
        others = [triangle for run, triangle in self._triangles.items() if run not in touched]
        triangle = triangle_of(np.concatenate([*others, self._rows[own]]))
        # The first column is that of the constant, so what it explains of the bias alone is the mean that remains:
        # taken off, corrections whose columns depend on one another are the smallest about it.
        mean = float(triangle[0, -1] / triangle[0, 0])
        triangle[0, -1] = 0.0
        solved = all_solved(triangle, int(left.sum()))
        level = np.array([self._center + mean, 0.0, 0.0, 0.0, 0.0])
        return {name: level + solved[name] for name in _FEW_COLUMNS}

    def _shrunk(self, near: NDArray[np.intp]) -> FloatArray:
        if self._mixed is None:
            raise TrainingFailed("the mixed model could not be fitted")
        return self._mixed.powers(near)

    def _map(self, near: NDArray[np.intp]) -> Any:
        left = self._without(near) & self._kept
        if self._process is None or not left.any():
            raise TrainingFailed("there is no evidence process, or it has kept nothing of what remains")
        weight = self.means.weight[left]
        center = weighted_mean(self.means.bias_dph[left], weight)
        y = (self.means.bias_dph[left] - center) / self._process.spread
        seen = 1.0 if self._rate else 0.0
        bins = gather(self._t[left], seen * self._r[left], y, weight / median(weight))
        mean = conditioned_on(self._process, bins, center)
        return lambda t, r: mean(t, seen * r)


def fit_mixed(samples: TrainingData, scaling: Scaling, power_on: NDArray[np.int64] | None, average_s: float) -> Outcome:
    """The cubic with a slope in dT/dt whose coefficients are shrunk, as a network.

    Raises:
        TrainingFailed: The equations cannot be solved.
    """
    means, _ = _means(samples, None)
    weights = fit_mixed_model(means, scaling, _on(means, power_on)).powers()
    return outcome_of(weights, samples, scaling, average_s)


_STRUCTURE = 1.5  # a constant that leaves no more than this many times the noise has nothing to miss
NAMES_OF_CANDIDATES = {
    "nothing": "no correction",
    "constant": "a constant",
    "cubic": "a cubic in T",
    "cubic_slope": "a cubic in T with a slope in dT/dt",
    "mixed": "a cubic in T with a slope in dT/dt, shrunk by how much power-ons differ",
    "mrbf": "a map of T and dT/dt",
}


@dataclass(frozen=True, slots=True)
class Chosen:
    """The candidate that is emitted: name, networks, the table of all candidates, why, and what a user should know.

    `process`: the evidence model of all samples, if it could be solved.
    """

    method: str
    outcome: Outcome
    rows: list[dict[str, Any]]
    reason: str
    findings: list[dict[str, Any]]
    process: Process | None


def chosen_by_cross_validation(
    samples: TrainingData, scaling: Scaling, power_on: NDArray[np.int64] | None, *, seed: int, average_s: float
) -> Chosen:
    """Trains the candidate that model selection chooses; where that fails or must not be used, the next choice.

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
        refused["mrbf"] = str(failure)
    comparison = compare_candidates(samples, scaling, process, power_on, average_s)
    while True:
        name = comparison.chosen(tuple(refused))
        try:
            outcome = _trained(name, samples, scaling, process, power_on, seed, average_s)
            against = objection_to(outcome, samples, scaling, average_s) if name != "constant" else ""
        except TrainingFailed as failure:
            against = str(failure)
        if not against:
            break
        refused[name] = against
    rows = [row | ({"refused": refused[row["id"]]} if row["id"] in refused else {}) for row in comparison.rows(name)]
    findings = [_refusal(one, text) for one, text in refused.items()]
    misses = name == "constant" and _misses(comparison)
    if misses:
        findings.insert(0, _does_not_generalise(comparison))
    return Chosen(name, outcome, rows, _reason(comparison, name, misses), findings, process)


def _trained(
    name: str,
    samples: TrainingData,
    scaling: Scaling,
    process: Process | None,
    power_on: NDArray[np.int64] | None,
    seed: int,
    average_s: float,
) -> Outcome:
    if name == "mrbf":
        return fit_mrbf(samples, scaling, seed=seed, centers=None, average_s=average_s, process=process)
    if name == "mixed":
        return fit_mixed(samples, scaling, power_on, average_s)
    return fit_simple(name, samples, scaling, average_s)


def _misses(comparison: CandidateScores) -> bool:
    """Whether a constant leaves more than noise on what it has not seen."""
    rms = comparison.rms_dph[:, CANDIDATES.index("constant")]
    return len(rms) == 0 or bool(np.sqrt(np.mean(rms**2)) > _STRUCTURE * comparison.noise_dph)


def _reason(comparison: CandidateScores, name: str, misses: bool) -> str:
    """Why this candidate, in words."""
    tried = f"left out in turn: {', '.join(comparison.stretches()) or 'nothing, there is too little'}"
    if misses:
        return f"nothing is shown to be better than a constant on history that was not seen ({tried})"
    if name == "constant":
        return f"what varies is hardly more than noise ({tried})"
    text = (
        "pieces agree that it is better than a cubic"
        if name == "mrbf"
        else "the least mean score of simple corrections"
    )
    return f"{text}; {_gain(*comparison.gain(name))} ({tried})"


def _gain(t: float, freedom: int) -> str:
    """t of a gain over the constant in words; below 1 it is a coin."""
    undecided = ", undecided" if t < _UNDECIDED else ""
    return f"t of the gain over a constant is {t:.2g} with {freedom} degrees of freedom{undecided}"


def _does_not_generalise(comparison: CandidateScores) -> dict[str, Any]:
    """The finding, with its reason and what would help."""
    rms = {name: comparison.rms_of(name) for name in CANDIDATES}
    able = {n: v for n, v in rms.items() if n not in ("nothing", "constant") and v is not None}
    text = "No correction is shown to hold on thermal history that it has not seen, so the model is a constant."
    evidence: dict[str, Any] = {"noise_dph": comparison.noise_dph, "stretches": comparison.stretches()}
    if able:
        best = min(able, key=lambda n: able[n])
        t, freedom = comparison.gain(best)
        text += (
            f" Left out in turn ({', '.join(comparison.stretches())}), a constant leaves {rms['constant']:.4g} deg/h, "
            "and "
            f"{NAMES_OF_CANDIDATES[best]} {able[best]:.4g}; {_gain(t, freedom)}."
        )
        evidence |= {"best": best, "best_rms_dph": able[best], "constant_rms_dph": rms["constant"]}
        evidence |= {"t": t, "degrees_of_freedom": freedom}
    return {"id": "does_not_generalise", "text": f"{text} {_advice(comparison)}", "evidence": evidence}


def _advice(comparison: CandidateScores) -> str:
    """Which recordings would help."""
    kinds = {fold.kind for fold in comparison.folds}
    if "run" in kinds:
        return (
            "Repeat the runs with the same programme, up and down, after a power-on each: what repeats can be "
            "corrected."
        )
    if "branch" in kinds:
        return "One run says nothing about another: record the same cycle at least twice more, after a power-on each."
    return "Record a cycle of temperature, up and down, at least three times, with a power-on before each."


def _refusal(name: str, text: str) -> dict[str, Any]:
    return {
        "id": "map_refused",
        "text": f"Model selection goes on without {NAMES_OF_CANDIDATES[name]} ({name}): {text}.",
        "evidence": {"method": name, "reason": text},
    }
