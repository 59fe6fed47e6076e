"""Whether an extension is shipped: by the ladder's own cross-validation on the training runs; an exam only grades.

States beside a map are one rung more on the ladder of corrections (`train.ladder`): every stretch of thermal history
is left out in turn, and the rung is taken where it is clearly better than the rung that the ladder would emit
without states, and better than a constant. Causes and their parameters are those of all training runs, as the
parameters of the evidence process are; the map beside them is fitted anew without each stretch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..results.diagnosed import ShippingTrial
from ..train.data import TrainingData, cleaned, joined, scaling_of
from ..train.evidence import TrainingFailed, fit_process
from ..train.fitting import power_ons
from ..train.ladder import RUNGS, Ladder, climb
from .refit import MOST_TERMS, Effect, samples
from .refitting import Refitting

__all__ = ["Shipping", "shipping"]


@dataclass(frozen=True)
class Shipping:
    """What was tried.

    Attributes:
        shipped: Effects of the extended model.
        rung: What the ladder would emit without them.
        left_out: What was left out, in words.
        before_dph, after_dph: RMS over these stretches without and with the effects, all stretches counting alike;
            None where nothing can be left out, or nothing was to be added.
    """

    shipped: list[Effect]
    rung: str
    left_out: list[str]
    before_dph: float | None
    after_dph: float | None

    def result(self) -> ShippingTrial:
        """As `diagnose.json` has it."""
        return ShippingTrial(
            ships=bool(self.shipped),
            beside=self.rung,
            left_out=tuple(self.left_out),
            rms_before_dph=self.before_dph,
            rms_after_dph=self.after_dph,
        )


def shipping(refitting: Refitting, effects: Sequence[Effect]) -> Shipping:
    """Adds the effects that a table can hold one after the other; those of a single cycle all at once."""
    able = [e for e in effects if e.term.shipped][:MOST_TERMS]
    plain = _ladder(refitting, [], None)
    rung = plain.chosen()
    shipped: list[Effect] = []
    best, last = (plain, rung), None
    together = refitting.single_cycle
    for tried in [able] if together and able else [able[: k + 1] for k in range(len(able))]:
        new = tried if together else [*shipped, tried[-1]]
        name = "mrbf_t" if together else "mrbf"
        last = _ladder(refitting, new, plain)
        if best[0].beaten_by(best[1], last, name) and plain.beaten_by(rung, last, name):
            shipped, best = new, (last, name)
    after = None if last is None else _rms(last, "mrbf_t" if together else "mrbf")
    return Shipping(shipped, rung, plain.stretches(), _rms(plain, rung), after)


def _ladder(refitting: Refitting, effects: Sequence[Effect], like: Ladder | None) -> Ladder:
    """Every rung beside the effects, without each stretch of history (those of `like`, where it is given)."""
    data: TrainingData = cleaned(joined([samples(run, effects) for run in refitting.train]))
    scaling = scaling_of(data)
    try:
        process = fit_process(data, scaling)
    except TrainingFailed:
        process = None
    folds = None if like is None else like.folds
    return climb(data, scaling, process, power_ons(refitting.runs), refitting.average_s, folds)


def _rms(ladder: Ladder, rung: str) -> float | None:
    square = ladder.rms_dph[:, RUNGS.index(rung)] ** 2
    return float(np.sqrt(square.mean())) if len(square) and np.all(np.isfinite(square)) else None
