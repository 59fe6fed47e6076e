"""What a channel may add: a straight line, a bent one, or a line whose slope depends on the temperature.

Each is the record of one term, whose columns at fixed centers and width are linear in their weights; `parts` says
which is earned. The centers lie at a quarter and three quarters of what training showed, 0.9 of its half range wide:
of squares, cubes, saturations and exponentials over the range that leaves one to two hundredths of the variance that a
line leaves, of a corner a twentieth.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..causes import CATALOGUE
from ..causes.base import Cause, History
from ..common.arrays import FloatArray
from ..target.recursion import TableKind
from .data import TrainingData

__all__ = ["SHAPES", "ChannelShape", "ShapeId", "shape_of"]

ShapeId = Literal["line", "product", "curve"]

#: The simplest first, and the kind of the record of each.
SHAPES: dict[ShapeId, TableKind] = {
    "line": TableKind.AUXILIARY,
    "product": TableKind.PRODUCT,
    "curve": TableKind.CURVE,
}
_SHOWN = (0.002, 0.998)  # quantiles of a channel between which its range is taken: spikes are none of it
# In half ranges: least of what is left of bent functions, among 0.25 to 1.2 and 0.4 to 1.5.
_CENTER, _WIDTH = 0.5, 0.9
_NARROWEST = 0.01  # in the unit of the channel: 1.2/width in 2^-24 fits a word of fixed point from 0.0094 on


@dataclass(frozen=True)
class ChannelShape:
    """One of the functions that a channel may add.

    Attributes:
        id: Which.
        cause: Its term.
        values: Parameters of the term that are not weights.
        columns: At every training sample, shape (n, k); of a channel that shows nothing there: of its median.
        lost: The same with the median of the channel in its place everywhere: what a table knows when it is lost.
    """

    id: ShapeId
    cause: Cause
    values: Mapping[str, float]
    columns: FloatArray
    lost: FloatArray

    @property
    def is_held(self) -> bool:
        """Whether tables of both arithmetics can hold it."""
        return self.values.get("width", _NARROWEST) >= _NARROWEST

    def parameters(self, weights: FloatArray) -> dict[str, float]:
        """Parameters of the term with these weights."""
        assert self.cause.amplitudes is not None
        return {**self.cause.amplitudes(weights), **self.values}

    def slope(self, added: FloatArray) -> float:
        """Of the straight line through what it adds at every training sample, deg/h per unit."""
        line = self.columns[:, 0] - self.columns[:, 0].mean()
        return float(line @ added / (line @ line))

    def doubt_dph(self, weights: FloatArray) -> float:
        """RMS over training of what the correction lacks when the channel is lost."""
        return float(np.sqrt(np.mean(((self.columns - self.lost) @ weights) ** 2)))


def shape_of(id: ShapeId, values: FloatArray, reference: float, samples: TrainingData) -> ChannelShape:
    """A function of a channel.

    Args:
        id: Which.
        values: The channel at every sample, NaN where it shows nothing.
        reference: Mean of the channel.
        samples: The training samples.
    """
    cause = next(c for c in CATALOGUE.values() if c.table is not None and c.table.kind == SHAPES[id])
    fixed = _fixed(id, values, reference, samples)
    median = float(np.nanmedian(values))
    shown = np.where(np.isfinite(values), values, median)
    columns, lost = (
        _columns(cause, fixed, samples, channel) for channel in (shown, np.full(len(values), median))
    )
    return ChannelShape(id, cause, fixed, columns, lost)


def _columns(
    cause: Cause, fixed: Mapping[str, float], samples: TrainingData, channel: FloatArray
) -> FloatArray:
    assert cause.features is not None
    found = cause.features(History(samples.time_s, samples.temperature_c, channel=channel), fixed).columns
    # Of a line alone the reference is no parameter of its column: the constant is the map's.
    return found - fixed["reference"] if found.shape[1] == 1 else found


def _fixed(id: ShapeId, values: FloatArray, reference: float, samples: TrainingData) -> dict[str, float]:
    if id == "product":
        middle_c = 0.5 * float(samples.temperature_c.min() + samples.temperature_c.max())
        return {"reference": reference, "reference_c": middle_c}
    if id == "curve":
        low, high = (float(x) for x in np.nanquantile(values, _SHOWN))
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        return {
            "reference": middle - _CENTER * half,
            "second_center": middle + _CENTER * half,
            "width": _WIDTH * half,
        }
    return {"reference": reference}
