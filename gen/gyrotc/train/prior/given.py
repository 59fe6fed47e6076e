"""The form of prior knowledge of a unit's map, from units of its type or from its earlier model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from ...results.fleet import KnownMap, LotUse
from ...results.training import EarlierUse
from ..data import Scaling, TrainingData
from ..result import Outcome


@dataclass(frozen=True, slots=True)
class Given:
    """What a prior made of a unit's samples.

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
        """Raises InputError where it is not of this axis."""

    def with_samples(self, samples: TrainingData, own: Scaling, serial: str, *, seed: int, average_s: float) -> Given:
        """Tests whether cleaned samples agree with it, and makes a map of both if they do.

        Args:
            own: Scaling of the samples.
            serial: The unit's.
            seed: Of the Kohonen network.
            average_s: Averaging of RMS figures, s.
        """
