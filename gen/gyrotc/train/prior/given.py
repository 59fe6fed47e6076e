"""The form of prior knowledge of a unit's map, from units of its type or from its earlier model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ...results.fleet import KnownMap, LotUse
from ...results.training import EarlierUse
from ..data import Scaling, TrainingData
from ..result import Outcome


@dataclass(frozen=True, slots=True)
class UnitSamples:
    """Training samples of a unit.

    Attributes:
        cleaned: Its samples.
        scaling: Their scaling.
        power_on: Number of the power-on of each run, by its index; None: each run is one.
        serial: The unit's, to tell whether a lot has seen it.
    """

    cleaned: TrainingData
    scaling: Scaling
    power_on: NDArray[np.int64] | None
    serial: str


@dataclass(frozen=True, slots=True)
class Given:
    """Fit of a unit's samples with a prior.

    Attributes:
        map: Networks and scaling over both envelopes; None: the prior was not used.
        findings: What a user should know.
        reason: Why the map was chosen.
        lot, prior: For `training.json`: what a lot did, or an earlier model.
        known: What the map follows, for `training.json`; None: the prior was not used.
    """

    map: tuple[Outcome, Scaling] | None
    findings: list[dict[str, Any]]
    reason: str = ""
    lot: LotUse | None = None
    prior: EarlierUse | None = None
    known: KnownMap | None = None


class Prior(Protocol):
    """Knowledge of a unit's map that does not come from its own samples."""

    @property
    def key(self) -> str:
        """Hash of what it was made from."""

    def check_axis(self, axis: str | None) -> None:
        """Raise `InputError` if it is not of this axis."""

    def with_samples(self, samples: UnitSamples, *, seed: int, average_s: float) -> Given:
        """Test whether samples agree with it, and fit a map to both if they do.

        Args:
            seed: Of the Kohonen network.
            average_s: Averaging of RMS figures, s.
        """
