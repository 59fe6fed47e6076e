"""Decide which effects a table gets, and which names left-out training history refutes.

Every piece of thermal history is left out in turn, and what the map with the effects leaves of it is compared with what
would be emitted without them: log RMS at temperatures that the rest has covered, of whole runs about their means, which
a power-on draws anew. Causes and their parameters are those of all training runs, as the parameters of the evidence
process are; the map is fitted anew without each piece. Test runs have no part in it.

An effect is shipped where the posterior odds of its cause times its mean gain exceed the doubt of that gain: what is
certain is shipped for any gain, what is as likely as all else only for one that is beyond doubt.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from ..common.arrays import FloatArray
from ..results.diagnosed import ShippingTrial
from ..train.channels import MOST_TERMS
from ..train.data import cleaned_samples, scaling_of
from ..train.evidence import TrainingFailed, fit_process
from ..train.fitting import power_ons
from ..train.selection import CandidateScores, compare_candidates
from .refit import Effect
from .refitting import Refitting

# Share of RMS below which a difference decides nothing, however well pieces agree: two pieces agree by chance.
_LEAST = 0.02
_MOST_ODDS = 1e6  # what is certain needs a gain all the same
_LEVEL = 0.975  # one-sided, of the limit above which a gain is not


@dataclass(frozen=True)
class PieceGain:
    """Gain in log RMS on pieces of history that were left out.

    Attributes:
        mean: Over the pieces.
        doubt: Of the mean: standard error over the pieces, and `_LEAST`.
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
        mean = float(gains.mean())
        upper = mean + float(stdtrit(len(gains) - 1, _LEVEL)) * error
        return PieceGain(mean, float(np.hypot(error, _LEAST)), upper)

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
    """What was tried.

    Attributes:
        shipped: Effects of the extended model.
        refuted: Numbers of the effects that make left-out history worse.
        candidate: What model selection would emit without them.
        left_out: What was left out, in words.
        before_dph, after_dph: RMS over these pieces without and with the last effects tried, all pieces counting alike;
            None where nothing can be left out, or nothing was to be added.
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
    candidate = best.chosen()
    before, after = best.rms_covered(candidate), None
    able = [k for k, effect in enumerate(effects) if effect.term.table is not None][:MOST_TERMS]
    shipped: list[Effect] = []
    refuted: list[int] = []
    reason = "" if effects else "no cause was named that a map can be refitted beside"
    if effects and not able:
        reason = "no table holds what is named"
    name, scores = candidate, best
    for numbers in [able] if not probabilities and able else [[k] for k in able]:
        tried = [*shipped, *(effects[k] for k in numbers)]
        beside = _comparison(refitting, tried, effects)
        after = beside.rms_covered("mrbf")
        gain = PieceGain.of(scores.covered_scores(name), beside.covered_scores("mrbf"))
        if gain is None:
            reason = "fewer than two pieces of the training history can be left out and judged"
        elif gain.refutes:
            refuted += numbers
            reason = f"it makes pieces of the training history that were left out worse{_in_words(before, after)}"
        elif not probabilities:
            reason = "a single cycle cannot tell whether states hold on the next one: record it again at another rate"
        elif gain.ships(probabilities[numbers[0]]):
            shipped, name, scores = tried, "mrbf", beside
        else:
            reason = (
                f"on pieces of the training history that were left out it changes RMS by {np.expm1(-gain.mean):+.1%} "
                f"with a doubt of {gain.doubt:.1%}{_in_words(before, after)}, which is not enough for a cause with a "
                f"probability of {probabilities[numbers[0]]:.0%}"
            )
    return Shipping(shipped, refuted, candidate, best.stretches(), before, after, "" if shipped else reason)


def _in_words(before: float | None, after: float | None) -> str:
    return "" if before is None or after is None else f" (RMS {before:.3g} -> {after:.3g} deg/h)"


def _comparison(refitting: Refitting, effects: Sequence[Effect], every: Sequence[Effect]) -> CandidateScores:
    """Fit every candidate beside the effects without each piece of history, on samples that `every` effect knows."""
    data = cleaned_samples(refitting.samples_beside(effects, every))
    scaling = scaling_of(data)
    try:
        process = fit_process(data, scaling)
    except TrainingFailed:
        process = None
    rate = not (effects and refitting.single_cycle)
    return compare_candidates(data, scaling, process, power_ons(refitting.runs), refitting.average_s, rate=rate)
