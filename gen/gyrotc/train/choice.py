"""The one decision of training: is a richer candidate better on history that it has not seen?

A candidate's loss on a piece of history is the logarithm of the RMS that is expected there of means that it has not
seen, so all pieces count alike and one gross failure does not outvote the others. A candidate is beaten by a richer one
whose mean loss is smaller by more than its doubt: the standard error of the mean difference over the pieces. The
simplest candidate that no richer one beats is taken.

Two or three pieces may agree by accident, and their scatter then says that there is no doubt. So one more deviation is
added to theirs: that of a piece on which the candidates are equally good, give or take 1.5 %. It counts much with two
pieces and hardly at all with ten.

New means on a piece will show the structure that a candidate leaves and their own noise, so a candidate leaves less
than the noise only by accident. The logarithm of such an accident on a few means would outvote the other pieces;
`expected_square` returns what is to be expected of new means instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr

from ..common.arrays import FloatArray

# Smallest deviation from piece to piece that is believed, in log RMS. With 3 %, two runs of a simulated gyro keep a
# cubic where the map would leave 1 % less; with 1 %, channels get bent shapes by chance. Measured gyros scatter more.
_PRIOR_DEVIATION = 0.015
# Standard errors that a gain must exceed. More keep the constant where a map would help; fewer take maps by chance.
_STANDARD_ERRORS = 1.0
# A mean square that is more than so many times that of the noise is taken as it is: the tail below 0 is nothing there.
_FAR = 1e6
# Least RMS, as a share of the largest: below it lie rates without noise, which differ by rounding.
_LEAST_RMS = 1e-6


@dataclass(frozen=True, slots=True)
class CandidateChoice:
    """Losses of all candidates, and the one that is taken.

    Attributes:
        candidates: Names, the simplest first.
        losses: Log of the RMS expected on each piece left out, shape (pieces, candidates); nan: it could not be fitted.
        chosen: Name of the candidate that is taken.
    """

    candidates: tuple[str, ...]
    losses: FloatArray
    chosen: str

    def gain(self, name: str, other: str) -> tuple[float, float]:
        """Return by how much the mean loss of `name` is below that of `other`, and the doubt of this gain."""
        return gain_over_pieces(self._of(other) - self._of(name))

    def rms(self, name: str) -> float | None:
        """Return the RMS expected over the pieces, all counting alike; None if it is not known."""
        rms = float(np.sqrt(np.mean(np.exp(2.0 * self._of(name))))) if len(self.losses) else np.nan
        return rms if np.isfinite(rms) else None

    def without(self, refused: Sequence[str]) -> CandidateChoice:
        """Return the choice among the candidates that may be used."""
        return CandidateChoice(self.candidates, self.losses, _chosen(self.candidates, self.losses, refused))

    def _of(self, name: str) -> FloatArray:
        return np.asarray(self.losses[:, self.candidates.index(name)])


def expected_square(residual: FloatArray, noise: float) -> float:
    """Return the mean square that new means on a piece are expected to have.

    It is that of the noise and of the structure that is left. The latter is estimated by the mean square beyond that of
    the noise, which scatters by the noise of n means, and is not negative: its mean under a normal distribution that
    ends at 0. With many means, or far above the noise, it is the mean square itself.

    Args:
        residual: What is left on the means of a piece.
        noise: Standard deviation of the noise of a mean; 0: not known.
    """
    square = float(np.mean(residual**2))
    scatter = noise**2 * float(np.sqrt(2.0 / len(residual)))
    if scatter <= 0.0 or square > _FAR * noise**2:
        return square
    beyond = (square - noise**2) / scatter
    tail = float(np.exp(-0.5 * beyond**2 - log_ndtr(beyond)) / np.sqrt(2.0 * np.pi))
    return noise**2 + scatter * (beyond + tail)


def choose(candidates: Sequence[str], mean_squares: FloatArray) -> CandidateChoice:
    """Choose the simplest candidate that no richer one beats by more than its doubt.

    With fewer than two pieces nothing can be said for a richer candidate: the first is taken.

    Args:
        candidates: Names, the simplest first.
        mean_squares: What is expected of each on each piece without having seen it, shape (pieces, candidates); nan if
            it could not be fitted.
    """
    names = tuple(candidates)
    squares = np.asarray(mean_squares, dtype=np.float64).reshape(-1, len(names))
    largest = float(np.nanmax(squares, initial=0.0))
    losses = 0.5 * np.log(np.maximum(squares, max(_LEAST_RMS**2 * largest, np.finfo(np.float64).tiny)))
    return CandidateChoice(names, losses, _chosen(names, losses, ()))


def _chosen(names: Sequence[str], losses: FloatArray, refused: Sequence[str]) -> str:
    able = [k for k, n in enumerate(names) if n not in refused and np.all(np.isfinite(losses[:, k]))]
    for place, k in enumerate(able):
        gains = [gain_over_pieces(losses[:, k] - losses[:, richer]) for richer in able[place + 1 :]]
        if not any(gain > doubt for gain, doubt in gains):
            return names[k]
    return names[0]


def gain_over_pieces(gains: FloatArray) -> tuple[float, float]:
    """Return the mean gain in log RMS over pieces of history, and its doubt; nothing with fewer than two pieces."""
    n = len(gains)
    if n < 2 or not np.all(np.isfinite(gains)):
        return 0.0, float("inf")
    mean = float(gains.mean())
    squares = float(np.sum((gains - mean) ** 2)) + mean**2 + _PRIOR_DEVIATION**2
    return mean, _STANDARD_ERRORS * float(np.sqrt(squares / (n - 1) / n))
