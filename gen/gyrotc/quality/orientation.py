"""Axes that were exchanged and signs that were reversed: against Earth's rate, the other runs, an earlier calibration.

Every way in which the columns of a file can stand for its axes is tried (exchanged, reversed, both). A run is
reported where another way than the stated one makes it agree, and the stated one does not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations, product
from typing import Any

import numpy as np

from ..common.arrays import FloatArray
from ..model import Model
from ..recordings.records import Curve, Dataset, Mark

Finding = dict[str, Any]

_NEXT = (
    "Look at mounting and wiring; where only the columns are exchanged or mirrored, write them right or name them "
    "by [columns] in dataset.toml, else leave the run out."
)
_LEAST_OTHERS = 2  # of two runs nobody knows which one is reversed
_LEAST_PLACES = 8  # of which the shape of a curve is known
_AGREES = 3.0  # times the scatter of the other runs
_BETTER = 5.0  # how much worse the stated way is
_AS_WELL = 2.0  # ways that leave up to so much more fit as well
_EARTH_DPH = 15.04  # deg/h: Earth's rate, to the digits that a comparison within 3 % needs
_NORM, _DIRECTION = 0.03, 0.05  # three means that are Earth's rate, and its direction
_ALONG, _LEAST_ALONG_DPH = 0.1, 1.0  # one mean that is Earth's component
_EARLIER = 0.1  # of the departure, what may be left against an earlier calibration
_REVERSED, _SWING = -0.9, 2.0  # correlation with an earlier curve, and how much more or less it may swing


@dataclass(frozen=True, slots=True)
class _Way:
    """Which column holds each axis, and with which sign."""

    column: tuple[int, ...]
    sign: tuple[int, ...]

    @property
    def id(self) -> str:
        return "sign_reversed" if self.column == tuple(range(len(self.column))) else "axes_exchanged"

    @property
    def changes(self) -> int:
        """Columns that are exchanged, and signs that are reversed."""
        return sum(c != k for k, c in enumerate(self.column)) + sum(s < 0 for s in self.sign)

    def of(self, rates: FloatArray) -> FloatArray:
        return np.asarray(rates[:, list(self.column)] * np.array(self.sign))

    def words(self, axes: Sequence[str]) -> str:
        if len(self.column) == 1:
            return "its sign is reversed"
        parts = [
            f"axis {axes[k]} stands {'with the other sign ' if s < 0 else ''}in the column of {axes[c]}"
            for k, (c, s) in enumerate(zip(self.column, self.sign, strict=True))
            if c != k or s < 0
        ]
        return "; ".join(parts)


def orientation_findings(dataset: Dataset, earlier: Mapping[str, Model] | None = None) -> Iterator[Finding]:
    """Runs whose axes are exchanged or reversed; one finding a run at most.

    Args:
        earlier: Models of an earlier calibration by axis ("" where the recordings have one rate).
    """
    for k, curve in enumerate(dataset.curves):
        others = [c for j, c in enumerate(dataset.curves) if j != k and c.axes == curve.axes]
        found = (
            _against_others(curve, others) or _against_earth(curve) or _against_earlier(curve, earlier or {})
        )
        if found is not None:
            way, against = found
            run = dataset.runs[k]
            yield {
                "id": way.id,
                "text": f"{curve.file}: against {against}, {way.words(curve.axes)}. {_NEXT}",
                "evidence": {"file": run.file, "from_s": run.from_s},
                "marks": (Mark(run.file),),
            }


def _against_others(curve: Curve, others: Sequence[Curve]) -> tuple[_Way, str] | None:
    """The way that makes the run one of the others, which agree with one another."""
    if len(others) < _LEAST_OTHERS:
        return None
    known: dict[float, list[FloatArray]] = {}
    for other in others:
        for t, rates in zip(other.temperature_c.tolist(), other.rates_dph - _earth(other), strict=True):
            known.setdefault(t, []).append(rates)
    usable = [k for k, t in enumerate(curve.temperature_c.tolist()) if len(known.get(t, ())) >= _LEAST_OTHERS]
    if not usable:
        return None
    of_others = [np.array(known[t]) for t in curve.temperature_c[usable].tolist()]
    usual = np.array([rates.mean(axis=0) for rates in of_others]) + _earth(curve)
    squares = sum(float(np.sum((rates - rates.mean(axis=0)) ** 2)) for rates in of_others)
    freedom = sum((len(rates) - 1) * rates.shape[1] for rates in of_others)
    scatter = float(np.sqrt(squares / freedom))
    found = _best(curve.rates_dph[usable], usual, _AGREES * scatter)
    if found is None:
        return None
    way, left, stated = found
    if left > _AGREES * scatter or stated < _BETTER * max(left, scatter):
        return None
    return way, (
        f"the other runs (off by {stated:.4g} deg/h as it stands, by {left:.2g} so; they agree to {scatter:.2g})"
    )


def _earth(curve: Curve) -> FloatArray:
    return np.zeros(curve.rates_dph.shape[1]) if curve.earth_dph is None else np.array(curve.earth_dph)


def _against_earth(curve: Curve) -> tuple[_Way, str] | None:
    """The way in which the means are Earth's rate along the stated axes."""
    if curve.earth_dph is None or len(curve.cells) == 0:
        return None
    mean = np.average(curve.rates_dph, axis=0, weights=curve.cells)[None, :]
    earth = _earth(curve)[None, :]
    if mean.shape[1] == 1:
        along = abs(float(earth[0, 0]))
        if along < _LEAST_ALONG_DPH or abs(float(mean[0, 0] + earth[0, 0])) > _ALONG * along:
            return None
        return _Way(
            (0,), (-1,)
        ), f"Earth's rate along its axis ({earth[0, 0]:.4g} deg/h; the mean is {mean[0, 0]:.4g})"
    if mean.shape[1] != 3 or abs(np.linalg.norm(mean) / _EARTH_DPH - 1.0) > _NORM:
        return None
    tolerance = _DIRECTION * _EARTH_DPH / np.sqrt(3.0)
    found = _best(mean, earth, tolerance)
    if found is None or found[1] > tolerance or found[2] < _BETTER * found[1]:
        return None
    shown = [", ".join(f"{v:.4g}" for v in values[0]) for values in (earth, mean)]
    return found[0], f"Earth's rate ({shown[0]} deg/h along the axes; the means are {shown[1]})"


def _against_earlier(curve: Curve, earlier: Mapping[str, Model]) -> tuple[_Way, str] | None:
    """The way in which the run is what an earlier calibration says, in level or, of one axis, in shape."""
    axes = [axis for axis in (curve.axes or ("",)) if axis in earlier]
    if not axes or len(curve.cells) == 0:
        return None
    columns = [list(curve.axes or ("",)).index(axis) for axis in axes]
    rates = (curve.rates_dph - _earth(curve))[:, columns]
    flat = np.zeros(len(curve.temperature_c))
    maps = np.column_stack([earlier[axis].map_dph(curve.temperature_c, flat) for axis in axes])
    shown = len(axes) > 1 or len(flat) < _LEAST_PLACES or min(np.ptp(rates), np.ptp(maps)) == 0.0
    alike = 0.0 if shown else float(np.corrcoef(rates[:, 0], maps[:, 0])[0, 1])
    found = _best(rates, maps)
    if found is not None and found[1] < _EARLIER * found[2] and alike <= 0.0:
        return _within(found[0], columns, _stated(curve)), (
            f"the earlier calibration (off by {found[2]:.4g} deg/h as it stands, by {found[1]:.2g} so)"
        )
    if alike < _REVERSED and 1.0 / _SWING < np.std(rates) / np.std(maps) < _SWING:
        return _within(_Way((0,), (-1,)), columns, _stated(curve)), (
            f"the shape of the earlier calibration (correlation {alike:.3f})"
        )
    return None


def _stated(curve: Curve) -> _Way:
    n = max(len(curve.axes), 1)
    return _Way(tuple(range(n)), (1,) * n)


def _within(way: _Way, columns: Sequence[int], stated: _Way) -> _Way:
    """A way of some columns as one of all of them."""
    column, sign = list(stated.column), list(stated.sign)
    for k, c in enumerate(columns):
        column[c], sign[c] = columns[way.column[k]], way.sign[k]
    return _Way(tuple(column), tuple(sign))


def _best(rates: FloatArray, usual: FloatArray, tolerance: float = 0.0) -> tuple[_Way, float, float] | None:
    """The simplest of the ways that fit best, what it leaves (RMS), and what the stated way leaves; None: the stated.

    Args:
        tolerance: What leaves no more than this fits as well as the best.
    """
    n = rates.shape[1]
    ways = [_Way(c, s) for c in permutations(range(n)) for s in product((1, -1), repeat=n)]
    left = np.array([np.sqrt(np.mean((way.of(rates) - usual) ** 2)) for way in ways])
    fits = left <= max(_AS_WELL * float(left.min()), tolerance)
    k = min(np.flatnonzero(fits).tolist(), key=lambda k: (ways[k].changes, left[k]))
    return None if k == 0 else (ways[k], float(left[k]), float(left[0]))
