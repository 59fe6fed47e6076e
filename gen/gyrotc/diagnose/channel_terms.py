"""What stands for the channel terms of an extension where their channels are lost, as of those that training takes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..model import Model
from ..train.data import TrainingData
from ..train.stand_ins import StandIn, stand_in_of
from .refit import Effect, Played

__all__ = ["stand_ins_of"]


def stand_ins_of(
    plain: Model, samples: TrainingData, runs: Sequence[Played], effects: Sequence[Effect]
) -> dict[str, StandIn]:
    """A stand-in for the term of each channel, by channel; none where none can be fitted.

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
