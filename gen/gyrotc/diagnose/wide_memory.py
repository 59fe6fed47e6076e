"""Evidence of memory that does not depend on the rate, of whatever form: a hypothesis as wide as the physics.

What is called hysteresis is seldom one play of constant strength: domains, joints and contacts have widths and places
of their own. Any memory of relays of all half-widths h and places c (Preisach) is a sum of functions of plays,

    bias += ∫ G_h(z_h) dh,    z_h the play of width h,

for such a relay has switched up where z_h > c (Brokate and Sprekels 1996, section 2.2). Here G is a straight line, the
catalogue's own play, and soft steps over the envelope, so that the strength of a loop may change over temperature; h
is some widths that are near one another. All weights have one common variance, which is estimated: what the data do
not ask for costs nothing. The rival is as wide: the same functions of lags, for a memory that fades. Where relays are
few, each of them shows: finer functions of the plays follow, with a variance of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import ndtr

from ..causes.base import History, Parameter, SearchRule
from ..common.arrays import FloatArray
from ..common.statistics import TOLERANCE, orthonormal
from ..mirror.recursions import first_order, play
from .blocks import Records, RunRecord
from .candidates import diagnosable_causes, reach_of, searched, shape_parameter
from .posterior import EQUIVALENT
from .profile_likelihood import Gains
from .scores import ratio_of
from .static_map import FINE_C

_STEPS, _SOFT = 7, 0.85
"""Steps of the strength over the envelope, and the width of each in distances: 14 C over an envelope of 100 C. That is
as fine as the coarsest static map, beside which a loop is seen."""

_POINTS = 12  # widths (time constants) that are tried: in steps of a factor 1.4 (1.6)
_NEAR = (0.3, 0.7, 1.0, 0.7, 0.3)  # weights of the widths about one: a factor of two to either side
_ROW_S = 10.0  # rows that are nearer than that are thinned: nothing here is as quick

_ASKED = 1.0  # variance of a direction over that of the noise from which the data say something of it
_AHEAD, _SHARE = 10.0, 0.1
"""What the evidence must be ahead of that of lags, and which share of itself: in 34 recordings of relays of k from 1.5
to 6 it was ahead by 0.15 or more in all but three, in 15 of lags and gradients it was behind."""

_CLEARLY = 1.5
"""What the evidence must be of that of lags where a lag was preferred to one play: a loop about one temperature, which
no lag of the whole map is, has 1.4 to 1.7; of relays, lags and effects that are neither none had more than 1.4."""


@dataclass(frozen=True)
class WideMemory:
    """Evidence of a family of memories beside a model.

    Attributes:
        evidence: Twice the log of the marginal likelihood over that of the model alone.
        constant: The same where the strength is the same at all temperatures.
        columns: Directions of which the data say something, as block means, shape (N, m).
        finer: What finer functions add to the evidence; 0: the data do not ask for them.
    """

    evidence: float
    constant: float
    columns: FloatArray
    finer: float = 0.0

    def criterion(self, blocks: int) -> float:
        """The evidence less log N for the width and for each variance: as that of causes (`profile_likelihood`)."""
        return self.evidence + self.finer - (3 if self.finer else 2) * float(np.log(blocks))

    @property
    def varies(self) -> bool:
        """True if its strength goes with temperature."""
        return self.evidence > self.constant + EQUIVALENT

    @property
    def text(self) -> str:
        """Difference from one play of one strength, in words."""
        if self.varies:
            return "the strength of its loops goes with temperature, of which a table's play holds a straight line"
        return "its loops are more than a single play, such as a table has, holds"


def rate_independent(gains: Gains, beside: Sequence[FloatArray]) -> WideMemory | None:
    """Memory that does not depend on the rate, where the recordings speak for it rather than for one that fades.

    Args:
        gains: Of the measured recordings.
        beside: What other causes add to the model, as block means, shapes (N, k).
    """
    plays, lags = _families(gains, beside)
    found = plays.best()
    ahead = found.evidence - lags.best().evidence
    return plays.finer(found) if ahead > max(_AHEAD, _SHARE * found.evidence) else None


def outlasts(gains: Gains, behind: float, rival: float) -> bool:
    """Test whether memory that does not depend on the rate is likelier than one that fades and was preferred.

    Where one play does as well, the greater evidence decides; where it does not, that has to be clear.

    Args:
        gains: Of the measured recordings.
        behind: How far the criterion of one play is behind that of the preferred one.
        rival: Criterion of that.
    """
    plays, lags = _families(gains, ())
    found, fading = plays.best(), lags.best().evidence
    if behind <= EQUIVALENT:
        return found.evidence > fading
    clear = found.evidence > _CLEARLY * fading
    return clear and found.criterion(gains.size) > rival + EQUIVALENT


def _families(gains: Gains, beside: Sequence[FloatArray]) -> tuple[_Family, _Family]:
    width = _parameter(lambda rule: rule.loops)
    tau = _parameter(lambda rule: rule.cycle is not None and rule.cycle.usual)
    widest = max(reach_of(gains.search.records).most(width.unit), 2.0 * width.low)
    held = orthonormal(gains.beside, gains.map, *(gains.whiten(b) for b in beside))
    widths, taus = np.geomspace(width.low, widest, _POINTS), np.geomspace(tau.low, tau.high, _POINTS)
    plays = _Family(gains, held, widths, lambda h, size: play(size, h.temperature_c))
    return plays, _Family(gains, held, taus, lambda h, size: first_order(size, h.time_s, h.temperature_c))


def _parameter(looked_for: Callable[[SearchRule], bool]) -> Parameter:
    """The parameter of the first cause that is so looked for."""
    return next(p for id in diagnosable_causes() if looked_for(searched(id)) and (p := shape_parameter(id)) is not None)


class _Family:
    """Functions of one operator's states, of each of some sizes (widths, time constants).

    Args:
        held: Whitened orthonormal columns of the model, shape (N, h).
    """

    def __init__(self, gains: Gains, held: FloatArray, sizes: FloatArray, operator: Callable[..., FloatArray]) -> None:
        self.gains, self.held = gains, held
        records = gains.search.records
        nodes = _nodes(records)
        plain = _occupied(records, nodes, lambda h: h.temperature_c)
        self.states = [_occupied(records, nodes, partial(operator, size=size)) for size in sizes.tolist()]
        self.steps = [(state - plain) @ _steps(nodes.size) for state in self.states]
        self.white = [gains.whiten(s) for s in self.steps]
        self._at = 0

    def best(self) -> WideMemory:
        """The one with the greatest evidence, of those about each size."""
        found = [self._weighed(self.held, _about(self.steps, k), _about(self.white, k)) for k in range(_POINTS)]
        self._at = max(range(_POINTS), key=lambda k: found[k].evidence)
        lines = [w[:, :1] for w in self.white]
        constant = max(
            self._weighed(self.held, line, line).evidence for line in (_about(lines, k) for k in range(_POINTS))
        )
        return replace(found[self._at], constant=constant)

    def finer(self, found: WideMemory) -> WideMemory:
        """Return the evidence with functions of the states as fine as the nodes, if the data ask for them."""
        held = orthonormal(self.held, self.gains.whiten(found.columns))
        fine = _about(self.states, self._at)
        more = self._weighed(held, fine, self.gains.whiten(fine))
        if more.evidence < float(np.log(self.gains.size)):  # the price of its variance
            return found
        columns = np.column_stack([found.columns, more.columns])
        return replace(found, columns=columns, finer=more.evidence)

    def _weighed(self, held: FloatArray, plain: FloatArray, white: FloatArray) -> WideMemory:
        """Columns with one common variance, shape (N, k), beside a model."""
        rest = white - held @ (held.T @ white)
        left, size, right = np.linalg.svd(rest, full_matrices=False)
        own = size > TOLERANCE * size[0]
        target = self.gains.target - held @ (held.T @ self.gains.target)
        ratio, variance = ratio_of((left[:, own].T @ target) ** 2, size[own] ** 2)
        asked = own & (float(variance) * size**2 > _ASKED)
        return WideMemory(float(ratio), float(ratio), plain @ (right[asked].T / size[asked]))


def _about(parts: Sequence[FloatArray], k: int) -> FloatArray:
    """Return the columns about the k-th, side by side, each with its weight."""
    first = k - len(_NEAR) // 2
    return np.column_stack([q * parts[first + j] for j, q in enumerate(_NEAR) if 0 <= first + j < len(parts)])


def _nodes(records: Records) -> FloatArray:
    """Temperatures over the envelope, C, at equal distances."""
    ends = [(float(h.min()), float(h.max())) for h in (r.history.temperature_c for r in records.runs)]
    low, high = min(a for a, _ in ends), max(b for _, b in ends)
    return np.linspace(low, high, max(round((high - low) / FINE_C), _STEPS) + 1)


def _steps(count: int) -> FloatArray:
    """A straight line and soft steps at nodes, each from -1 to 1, shape (count, 1 + steps)."""
    x = np.linspace(-1.0, 1.0, count)
    places = np.linspace(-1.0, 1.0, _STEPS)
    soft = _SOFT * float(places[1] - places[0])
    return np.column_stack([x, 2.0 * ndtr((x[:, None] - places) / soft) - 1.0])


def _occupied(records: Records, nodes: FloatArray, state: Callable[[History], FloatArray]) -> FloatArray:
    """Shares of every block that a state spends at each node, linear between two, shape (N, nodes).

    The block means of any function that is linear between the nodes are this times its values there.
    """
    parts = []
    for run, index, kept in zip(records.runs, records.index, records.kept, strict=True):
        every = max(int(_ROW_S / run.row_s), 1)
        place = (state(_thinned(run, every)) - nodes[0]) / (nodes[1] - nodes[0])
        below = np.clip(np.floor(place).astype(np.int64), 0, nodes.size - 2)
        above, use = np.clip(place - below, 0.0, 1.0), run.usable[::every].astype(float)
        cell, size = index[::every] * nodes.size + below, (int(index[-1]) + 1) * nodes.size
        table = np.bincount(cell, use * (1.0 - above), size) + np.bincount(cell + 1, use * above, size)
        table = table.reshape(-1, nodes.size)[kept]
        parts.append(table / np.maximum(table.sum(axis=1, keepdims=True), 1e-9))
    return np.concatenate(parts)


def _thinned(run: RunRecord, every: int) -> History:
    """Every so many rows of a run."""
    h = run.history
    return replace(h, time_s=h.time_s[::every], temperature_c=h.temperature_c[::every])
