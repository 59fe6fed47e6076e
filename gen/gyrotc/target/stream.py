"""Samples as the front end counts them: rows, and the missing samples between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .follow import Settings, Steps, expand_missed, positions, with_missing
from .numbers import Arithmetic, Numbers
from .recursion import Course

__all__ = ["Stream"]

_MAX_ELAPSED = 0xFFFFFF  # blocks since power-on that a target counts


@dataclass(frozen=True, slots=True)
class Stream:
    """Samples, missing ones among them.

    `samples`: temperatures; `position[k]`: sample number of row k; `missed[k]`: samples missed before it,
    shortened, and `dropped[k]`: whole blocks that were left out of them.
    """

    samples: Numbers
    position: NDArray[np.int64]
    missed: NDArray[np.int64]
    dropped: NDArray[np.int64]

    @staticmethod
    def of_rows(
        arithmetic: Arithmetic,
        settings: Settings,
        temperature: Numbers,
        missed: NDArray[np.int64],
        where: str = "the recording",
    ) -> Stream:
        """Samples of rows, shape (n,), with `missed` samples before each.

        Raises:
            InputError: Rows and gaps of `where` together are more samples than memory is granted for.
        """
        shortened = expand_missed(missed, settings)
        position = positions(shortened, where)
        samples = with_missing(arithmetic, temperature, position)
        dropped = (missed - shortened) // settings.samples_per_block
        return Stream(samples, position, shortened, dropped)

    def course(self, steps: Steps, samples_per_block: int, blocks_before: int = 0) -> Course:
        """The corrections as terms see them, `blocks_before` blocks after power-on at the first sample."""
        return Course(
            temperature=steps.temperature,
            closes=~steps.is_restart,
            elapsed=np.minimum(self._elapsed(steps.at, samples_per_block) + blocks_before, _MAX_ELAPSED),
        )

    def _elapsed(self, at: NDArray[np.int64], samples_per_block: int) -> NDArray[np.int64]:
        """Blocks since the start at each sample number, with those that were left out."""
        if not self.dropped.any():
            return np.asarray(at // samples_per_block)
        total = np.concatenate([[0], np.cumsum(self.dropped)])
        runs = self.position - self.missed  # where the missing samples before each row begin
        return np.asarray(at // samples_per_block + total[np.searchsorted(runs, at, side="right")])
