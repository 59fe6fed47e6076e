"""Model selection: which correction is emitted, by what each candidate leaves on history that it has not seen.

Candidates are a constant, a cubic in T with a slope in dT/dt, and a smooth map of T and dT/dt: leading columns of one
Gaussian model (`gaussian`). Each is fitted once; whole pieces of history (`folds`) are left out by subtraction, with
the variances of the whole history; `choice` decides. The map that is emitted as a network follows the smooth map to
within a tenth of its own expected error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..common.metrics import Averages
from .choice import CandidateChoice, choose, expected_square
from .data import Scaling, TrainingData
from .folds import Fold
from .gaussian import COLUMNS, FEW, GaussianMap, Structure, TrainingFailed
from .mrbf import fit_mrbf
from .objection import objection_to
from .process import Process, TrainingHistory, smooth
from .result import Outcome
from .simple import fit_simple, outcome_of

_COLUMNS = {"constant": 1, "cubic_slope": FEW, "mrbf": COLUMNS}
CANDIDATES = tuple(_COLUMNS)
"""From the simplest to the richest."""
# A constant that leaves no more than this many times the noise has nothing to miss.
_STRUCTURE = 1.5
_IN_WORDS = {
    "constant": "a constant",
    "cubic_slope": "a cubic in T with a slope in dT/dt",
    "mrbf": "a map of T and dT/dt",
}


def structure_of(name: str, power_ons: int) -> Structure:
    """Return what a candidate is made of: beside the map, two power-ons or more have as many columns of their own."""
    return Structure(_COLUMNS[name], min(_COLUMNS[name], FEW) if power_ons > 1 else 0)


@dataclass(frozen=True)
class CandidateComparison:
    """All candidates on one history.

    Attributes:
        history: The means, without outliers.
        maps: Every candidate that could be fitted, by name.
        failed: Why others could not be.
        unseen: What each of `maps` leaves on each piece without having seen it, in their order.
        choice: The decision.
        average_s: Averaging of what is judged, s.
        noise_dph: Noise of an average over `average_s`, deg/h.
    """

    history: TrainingHistory
    maps: Mapping[str, GaussianMap]
    failed: Mapping[str, str]
    unseen: Sequence[Sequence[Averages]]
    choice: CandidateChoice
    average_s: float
    noise_dph: float

    @property
    def process(self) -> Process:
        """The smooth map."""
        return Process.of(self.history, self.maps["mrbf"])

    def left_out(self, name: str) -> list[Averages]:
        """Return what a candidate leaves on each piece."""
        at = list(self.maps).index(name)
        return [piece[at] for piece in self.unseen]

    def rows(self, chosen: str, refused: Mapping[str, str]) -> list[dict[str, Any]]:
        """Return `candidates` of `training.json`."""
        return [self._row(name, chosen, refused) for name in CANDIDATES]

    def _row(self, name: str, chosen: str, refused: Mapping[str, str]) -> dict[str, Any]:
        c = self.choice
        known = [n for n in CANDIDATES if c.rms(n) is not None]
        row: dict[str, Any] = {"id": name, "left_out_rms_dph": c.rms(name), "chosen": name == chosen}
        if name in known and len(c.losses) > 1:
            best = max(known, key=lambda n: c.gain(n, "constant")[0])
            loss, doubt = c.gain(best, name)
            row |= {"loss": loss, "doubt": doubt if name != best else None}
        return row | ({"refused": refused[name]} if name in refused else {})

    def pieces(self) -> str:
        """Return what was left out, in words: "4 whole runs", "3 branches"."""
        kinds = [fold.kind for fold in self.history.folds]
        counts = [f"{kinds.count(k)} {_words(k, kinds.count(k))}" for k in dict.fromkeys(kinds)]
        return ", ".join(counts) or "nothing, there is too little"


def _words(kind: str, count: int) -> str:
    one, many = {
        "power-on": ("power-on", "power-ons"),
        "run": ("whole run", "whole runs"),
        "branch": ("branch", "branches"),
        "part": ("part", "parts"),
    }[kind]
    return one if count == 1 else many


def compare_candidates(
    samples: TrainingData, scaling: Scaling, power_on: NDArray[np.int64] | None, average_s: float
) -> CandidateComparison:
    """Fit every candidate and judge it on pieces of history that it has not seen.

    Args:
        samples: Cleaned samples.
        scaling: Their scaling.
        power_on: Number of the power-on of each run, by its index; None: each run is one.
        average_s: Averaging of what is judged, s.

    Raises:
        TrainingFailed: The smooth map cannot be fitted, so nothing states the noise and what a correction leaves.
    """
    history = TrainingHistory.of(samples, scaling, power_on)
    history, smooth_map = history.without_outliers(smooth(history.count))
    maps = {"mrbf": smooth_map}
    failed: dict[str, str] = {}
    for name in CANDIDATES[:2]:
        try:
            structure = structure_of(name, history.count)
            maps[name] = history.fit(structure, smooth_map.logarithms_of(structure))
        except TrainingFailed as failure:
            failed[name] = str(failure)
    maps = {name: maps[name] for name in CANDIDATES if name in maps}
    unseen = history.unseen(list(maps.values()), average_s)
    squares = np.full((len(unseen), len(CANDIDATES)), np.nan)
    noise_dph = history.noise_dph(smooth_map, average_s)
    for at, name in enumerate(maps):
        squares[:, CANDIDATES.index(name)] = [expected_square(piece[at].after_dph, noise_dph) for piece in unseen]
    return CandidateComparison(history, maps, failed, unseen, choose(CANDIDATES, squares), average_s, noise_dph)


@dataclass(frozen=True, slots=True)
class Selected:
    """The candidate that is emitted.

    Attributes:
        method: Its name.
        outcome: Its networks.
        rows: All candidates, as in `training.json`.
        reason: Why this one, in words.
        findings: What a user should know.
        process: The smooth map of all samples.
        folds: Pieces that were left out.
        left_out: What it leaves on each of them without having seen it.
    """

    method: str
    outcome: Outcome
    rows: list[dict[str, Any]]
    reason: str
    findings: list[dict[str, Any]]
    process: Process
    folds: tuple[Fold, ...]
    left_out: list[Averages]


def select(
    samples: TrainingData, scaling: Scaling, power_on: NDArray[np.int64] | None, *, seed: int, average_s: float
) -> Selected:
    """Return the candidate that is chosen; if it fails or must not be used, the next choice.

    Args:
        samples: Cleaned samples whose temperatures span at least 2 C.
        scaling: Their scaling.
        power_on: Number of the power-on of each run, by its index; None: each run is one.
        seed: Seed of the Kohonen network.
        average_s: Averaging of RMS figures, s.

    Raises:
        TrainingFailed: The smooth map cannot be fitted.
    """
    comparison = compare_candidates(samples, scaling, power_on, average_s)
    refused = dict(comparison.failed)
    while True:
        name = comparison.choice.without(tuple(refused)).chosen
        try:
            outcome = _trained(name, comparison, samples, seed)
            against = objection_to(outcome, samples, scaling, average_s) if name != "constant" else ""
        except TrainingFailed as failure:
            against = str(failure)
        if not against:
            break
        refused[name] = against
    findings = [_refusal(one, text) for one, text in refused.items()]
    misses = name == "constant" and _misses(comparison)
    if misses:
        findings.insert(0, _does_not_generalise(comparison))
    left_out = comparison.left_out(name) if name in comparison.maps else []
    rows, reason = comparison.rows(name, refused), _reason(comparison, name, misses=misses)
    folds = comparison.history.folds
    return Selected(name, outcome, rows, reason, findings, comparison.process, folds, left_out)


def _trained(name: str, comparison: CandidateComparison, samples: TrainingData, seed: int) -> Outcome:
    scaling, average_s = comparison.history.scaling, comparison.average_s
    if name == "mrbf":
        return fit_mrbf(samples, scaling, seed=seed, centers=None, average_s=average_s, process=comparison.process)
    found = comparison.maps.get(name)
    if found is None:
        return fit_simple("constant", samples, scaling, average_s)
    return outcome_of(powers_of_map(comparison.history, found), samples, scaling, average_s)


def powers_of_map(history: TrainingHistory, found: GaussianMap) -> FloatArray:
    """Return the weights of 1, T, T^2, T^3 and dT/dt, normalised, of a map of few columns; deg/h."""
    one, line, square, cube, slope = np.r_[found.coefficients, np.zeros(FEW - found.structure.columns)]
    slope /= history.basis.rate
    weights = np.array([one - 0.5 * square, line - 0.75 * cube, 1.5 * square, 1.25 * cube, slope])
    weights *= history.spread
    weights[0] += history.center
    return weights


def _misses(comparison: CandidateComparison) -> bool:
    """Test whether a constant leaves more than noise on what it has not seen."""
    rms = comparison.choice.rms("constant")
    return rms is None or rms > _STRUCTURE * comparison.noise_dph


def _reason(comparison: CandidateComparison, name: str, *, misses: bool) -> str:
    left_out = f"left out in turn: {comparison.pieces()}"
    if misses:
        return f"nothing is shown to be better than a constant on history that was not seen ({left_out})"
    if name == "constant":
        return f"what varies is hardly more than noise ({left_out})"
    gain, doubt = comparison.choice.gain(name, "constant")
    return (
        f"no richer correction is better on history that was not seen by more than the doubt of that; it leaves "
        f"{np.exp(-gain):.3g} times what a constant leaves, within a factor of {np.exp(doubt):.3g} ({left_out})"
    )


def _does_not_generalise(comparison: CandidateComparison) -> dict[str, Any]:
    choice = comparison.choice
    text = "No correction is shown to hold on thermal history that it has not seen, so the model is a constant."
    evidence: dict[str, Any] = {"noise_dph": comparison.noise_dph, "left_out": comparison.pieces()}
    others = [name for name in CANDIDATES[1:] if choice.rms(name) is not None]
    if others and len(choice.losses) > 1:
        best = max(others, key=lambda name: choice.gain(name, "constant")[0])
        gain, doubt = choice.gain(best, "constant")
        text += (
            f" Left out in turn ({comparison.pieces()}), {_IN_WORDS[best]} leaves {np.exp(-gain):.3g} times what a "
            f"constant leaves, within a factor of {np.exp(doubt):.3g}."
        )
        evidence |= {"best": best, "gain": gain, "doubt": doubt}
        evidence |= {"best_rms_dph": choice.rms(best), "constant_rms_dph": choice.rms("constant")}
    return {"id": "does_not_generalise", "text": f"{text} {_advice(comparison)}", "evidence": evidence}


def _advice(comparison: CandidateComparison) -> str:
    """Return which recordings would help."""
    kinds = {fold.kind for fold in comparison.history.folds}
    if kinds & {"run", "power-on"}:
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
        "text": f"Model selection goes on without {_IN_WORDS[name]} ({name}): {text}.",
        "evidence": {"method": name, "reason": text},
    }
