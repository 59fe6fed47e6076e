"""Decide which effects a table gets, and which names left-out training history refutes.

Every piece of thermal history is left out in turn, and what the map with the effects leaves of it is compared with what
would be emitted without them: log RMS at temperatures that the rest has covered, of whole runs about their means, which
a power-on draws anew. Causes and their parameters are those of all training runs, as the parameters of the smooth
map are; the map is fitted anew without each piece. Test runs have no part in it.

An effect is shipped where the posterior odds of its cause times its mean gain exceed the doubt of that gain: what is
certain is shipped for any gain, what is as likely as all else only for one that is beyond doubt.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from ..common.arrays import FloatArray
from ..results.diagnosed import ShippingTrial
from ..train.candidates import CandidateComparison, compare_candidates
from ..train.channels import MOST_TERMS
from ..train.choice import expected_square, gain_over_pieces
from ..train.data import cleaned_samples, scaling_of
from ..train.fitting import power_ons
from .played import Effect
from .refitting import Refitting

# Share of a piece that must be at temperatures that the rest has covered.
_MIN_COVERED = 0.5
_MOST_ODDS = 1e6  # what is certain needs a gain all the same
_LEVEL = 0.975  # one-sided, of the limit above which a gain is not


@dataclass(frozen=True)
class PieceGain:
    """Gain in log RMS on pieces of history that were left out.

    Attributes:
        mean: Over the pieces.
        doubt: Of the mean, as model selection has it (`train.choice`).
        upper: Upper limit of the mean, at 95 % of both limits; infinite with one piece.
    """

    mean: float
    doubt: float
    upper: float

    @staticmethod
    def of(before: FloatArray, after: FloatArray) -> PieceGain | None:
        """Return the gain between two scores of every piece; None where fewer than two have both."""
        gains = (before - after)[np.isfinite(before - after)]
        if len(gains) < 2:
            return None
        error = float(gains.std(ddof=1)) / float(np.sqrt(len(gains)))
        mean, doubt = gain_over_pieces(gains)
        return PieceGain(mean, doubt, mean + float(stdtrit(len(gains) - 1, _LEVEL)) * error)

    def ships(self, probability: float) -> bool:
        """Test whether it is worth a term, whose cause has this probability."""
        odds = min(probability / max(1.0 - probability, 1.0 / _MOST_ODDS), _MOST_ODDS)
        return odds * self.mean > self.doubt

    @property
    def refutes(self) -> bool:
        """Test whether the effect does harm on history that it was not fitted to."""
        return self.upper < 0.0


@dataclass(frozen=True)
class Shipping:
    """Trial of an extension.

    Attributes:
        shipped: Effects of the extended model.
        refuted: Numbers of the effects that make left-out history worse.
        candidate: What model selection would emit without them.
        left_out: What was left out, in words.
        before_dph, after_dph: RMS over these pieces without effects, and with those that are shipped (if none is: with
            those tried last), all pieces that both know counting alike; None if there is no such piece, the RMS with
            effects also if none was tried.
        reason: Why nothing is shipped; empty where something is.
    """

    shipped: list[Effect]
    refuted: list[int]
    candidate: str
    left_out: list[str]
    before_dph: float | None
    after_dph: float | None
    reason: str

    def result(self) -> ShippingTrial:
        """Return what `diagnose.json` has of it."""
        return ShippingTrial(
            ships=bool(self.shipped),
            beside=self.candidate,
            left_out=tuple(self.left_out),
            rms_before_dph=self.before_dph,
            rms_after_dph=self.after_dph,
            reason=self.reason or None,
        )


def choose_shipped(refitting: Refitting, effects: Sequence[Effect], probabilities: Sequence[float]) -> Shipping:
    """Add the effects that a table can hold one after the other, and keep those that are worth it.

    Args:
        refitting: Training runs as the target sees them.
        effects: Of the named causes, the strongest first.
        probabilities: Of each cause in its place; none of a single cycle, whose states are tried together.
    """
    best = _comparison(refitting, [], effects)
    candidate = best.choice.chosen
    without = scores = _covered_scores(best, candidate)
    last: FloatArray | None = None
    able = [k for k, effect in enumerate(effects) if effect.term.table is not None][:MOST_TERMS]
    shipped: list[Effect] = []
    refuted: list[int] = []
    reason = "" if effects else "no cause was named that a map can be refitted beside"
    if effects and not able:
        reason = "no table holds what is named"
    for numbers in [able] if not probabilities and able else [[k] for k in able]:
        tried = [*shipped, *(effects[k] for k in numbers)]
        beside = _comparison(refitting, tried, effects)
        last = new_scores = _covered_scores(beside, "mrbf")
        gain = PieceGain.of(scores, new_scores)
        if gain is None:
            reason = "fewer than two pieces of the training history can be left out and judged"
        elif gain.refutes:
            refuted += numbers
            reason = f"it makes pieces of the training history that were left out worse{_in_words(scores, new_scores)}"
        elif not probabilities:
            reason = "a single cycle cannot tell whether states hold on the next one: record it again at another rate"
        elif gain.ships(probabilities[numbers[0]]):
            shipped, scores = tried, new_scores
        else:
            reason = (
                f"on pieces of the training history that were left out it changes RMS by {np.expm1(-gain.mean):+.1%} "
                f"with a doubt of {gain.doubt:.1%}{_in_words(scores, new_scores)}, which is not enough for a cause "
                f"with a probability of {probabilities[numbers[0]]:.0%}"
            )
    after = scores if shipped else last
    both = np.isfinite(without if after is None else without + after)
    rms = _rms_of(without[both]), None if after is None else _rms_of(after[both])
    return Shipping(shipped, refuted, candidate, [best.pieces()], *rms, "" if shipped else reason)


def _in_words(before: FloatArray, after: FloatArray) -> str:
    """Return what is left on the pieces that both scores know; a gain has two of them at least."""
    both = np.isfinite(before + after)
    return f" (RMS {_rms_of(before[both]):.3g} -> {_rms_of(after[both]):.3g} deg/h)"


def _comparison(refitting: Refitting, effects: Sequence[Effect], every: Sequence[Effect]) -> CandidateComparison:
    """Judge every candidate beside the effects on pieces of history, on samples that `every` effect knows."""
    data = cleaned_samples(refitting.samples_beside(effects, every))
    if effects and refitting.single_cycle:
        data = replace(data, slope_c_per_min=np.zeros(len(data)))
    return compare_candidates(data, scaling_of(data), power_ons(refitting.runs), refitting.average_s)


def _covered_scores(comparison: CandidateComparison, name: str) -> FloatArray:
    """Return the log RMS that a candidate leaves on each piece at temperatures that the rest has covered.

    It is that of training (`train.choice`), of whole runs about their means. A piece of which less than half is covered
    has none (nan): there the ends of the map would be judged.
    """
    history = comparison.history
    if name not in comparison.maps:
        return np.full(len(history.folds), np.nan)
    found = []
    for fold, means in zip(history.folds, comparison.left_out(name), strict=True):
        rest = history.means.temperature_c[~fold.near(history.means)]
        covered = (means.temperature_c >= rest.min()) & (means.temperature_c <= rest.max())
        left = means.after_dph[covered]
        about = left.mean() if left.size and fold.kind in ("run", "power-on") else 0.0
        enough = np.mean(covered) >= _MIN_COVERED
        found.append(0.5 * np.log(expected_square(left - about, comparison.noise_dph)) if enough else np.nan)
    return np.array(found)


def _rms_of(scores: FloatArray) -> float | None:
    return float(np.sqrt(np.nanmean(np.exp(2.0 * scores)))) if np.isfinite(scores).any() else None
