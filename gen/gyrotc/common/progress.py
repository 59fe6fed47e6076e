"""Progress of a job, as data: what is being done, and how much of the job is done."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol


class Progress(Protocol):
    """Function of a job's caller that the job calls as it goes on."""

    def __call__(self, stage: str, done: float = 0.0, total: float = 0.0, /) -> None:
        """Take note of a stage.

        Args:
            stage: What is being done, in words.
            done, total: How much of the whole job is done, and how much there is, in any unit; total 0: not known.
        """


def silent(_stage: str, _done: float = 0.0, _total: float = 0.0, /) -> None:
    """Take no note."""


class Stages:
    """The stages of a job, each with its share of the time: a `Progress` in terms of the stage that is being done.

    Args:
        progress: Takes note of the job.
        shares: Time of every stage as it was measured, in any unit, in the order of the stages.
    """

    def __init__(self, progress: Progress, shares: Mapping[str, float]) -> None:
        self._progress = progress
        self._shares = shares
        self._total = sum(shares.values())

    def __call__(self, stage: str, done: float = 0.0, total: float = 0.0, /) -> None:
        """Report a stage by its name, of which `done` of `total` is done."""
        self._report(stage, stage, done, total)

    def within(self, stage: str, words: str = "") -> Progress:
        """Return the progress of a job that is a stage of this one.

        Args:
            stage: Name of the stage.
            words: Come before whatever that job reports.
        """
        return lambda text, done=0.0, total=0.0: self._report(stage, f"{words}{text}", done, total)

    def _report(self, stage: str, text: str, done: float, total: float) -> None:
        before = 0.0
        for name, share in self._shares.items():
            if name == stage:
                inside = share * min(done / total, 1.0) if total > 0.0 else 0.0
                self._progress(text, before + inside, self._total)
                return
            before += share
        raise KeyError(stage)
