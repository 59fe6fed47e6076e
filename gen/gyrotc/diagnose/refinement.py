"""Parameters of chosen causes: the optimum between the grid's points, amplitudes, 95 % intervals."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from .. import causes as terms
from ..common.arrays import FloatArray
from ..common.statistics import CHI2_95_ONE, NORMAL_95, TOLERANCE, orthonormal
from .blocks import singled_out
from .candidates import Candidate, CandidateKey, columns_of, reach_of, searched, shape_parameter
from .profile_likelihood import Gains
from .search import Search
from .static_map import fine_columns, replaced_map


@dataclass(frozen=True, slots=True)
class Interval:
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float


def parabola_top(energy: Callable[[float], float], here: float, width: float, low: float) -> tuple[float, float]:
    """One step to the top of a parabola through three points, and its curvature."""
    left, right = max(here - width, 0.5 * (here + low) if np.isfinite(low) else here - width), here + width
    x = np.array([left, here, right]) - here
    c2, c1, _ = np.polyfit(x, [energy(left), energy(here), energy(right)], 2)
    if c2 >= 0.0:
        values = {v: energy(v) for v in (left, here, right)}
        return max(values, key=lambda v: values[v]), 0.0
    move = float(np.clip(-c1 / (2.0 * c2), x[0], x[2]))
    energy(here + move)
    return here + move, float(-c2)


def profile_interval(profile: FloatArray) -> tuple[float, float]:
    """The least interval with every value whose likelihood is not below the 95 % quantile of one parameter.

    A profile may have several tops, as that of a wave's period has; what lies between two of them belongs to it.

    Args:
        profile: Parameter values, ascending, and twice the log-likelihoods, shape (2, n); linear between. Its ends are
            those of the interval where it has not fallen.
    """
    x, e = profile
    drop = float(e.max()) - CHI2_95_ONE
    inside = np.flatnonzero(e >= drop)
    first, last = int(inside[0]), int(inside[-1])
    low, high = float(x[first]), float(x[last])
    if first > 0:
        low = float(np.interp(drop, e[first - 1 : first + 1], x[first - 1 : first + 1]))
    if last < x.size - 1:
        high = float(np.interp(drop, e[[last + 1, last]], x[[last + 1, last]]))
    return low, high


def random_size(weights: FloatArray, spread: FloatArray) -> Interval:
    """Standard deviation of normal offsets from their estimates: chi-square limits, noise taken off."""
    n = weights.size
    centred = weights - weights.mean()
    middle = np.eye(n) - 1.0 / n
    noise = float(np.trace(np.asarray(middle @ spread @ middle))) / max(n - 1, 1)
    raw = float(centred @ centred)
    value = float(np.sqrt(max(raw / max(n - 1, 1) - noise, 0.0)))
    low = float(np.sqrt(max(raw / chdtri(max(n - 1, 1), 0.025) - noise, 0.0)))
    high = float(np.sqrt(max(raw / chdtri(max(n - 1, 1), 0.975) - noise, 0.0)))
    return Interval(value, low, high)


_ROUNDS = 2  # several parameters are moved one after the other, twice
_STEP = 0.02  # relative step of the derivative to a parameter
_BEYOND = 1.5  # how far beyond the catalogue's range a parameter may lie: that range is of the order of what gyros have
_FINEST_C = 1.25  # spacing of the map's local functions once it is named too coarse


@dataclass(frozen=True)
class Refined:
    """A chosen cause.

    Attributes:
        candidate: With refined nonlinear parameters.
        columns: What it adds to the model, shape (N, k); for kind "input" the whole map of the new input.
        tangent: Derivative of its contribution to the nonlinear parameter, shape (N, k) or None.
        parameters: All parameters by name.
        contribution: Its part of the fitted rate, deg/h, shape (N,).
        edges: One column for every block where the changed input is not known, or None.
        profile: Parameter values and gains of the profile likelihood, shape (2, n); None without a parameter.
    """

    candidate: Candidate
    columns: FloatArray
    tangent: FloatArray | None
    parameters: dict[str, Interval]
    contribution: FloatArray
    edges: FloatArray | None
    profile: FloatArray | None

    @property
    def plausible(self) -> bool:
        """True if its nonlinear parameter may lie in the catalogue's range, or not far beyond."""
        parameter = shape_parameter(self.candidate.id)
        interval = self.parameters.get(parameter.name) if parameter is not None else None
        if parameter is None or interval is None:
            return True
        ends = abs(interval.low), abs(interval.high)
        return max(ends) >= parameter.low / _BEYOND and min(ends) <= parameter.high * _BEYOND


def model_columns(causes: Sequence[Refined]) -> FloatArray:
    """All columns that stand in the model when the causes are named: theirs, their tangents, masked edges."""
    return np.column_stack([b for c in causes for b in (c.columns, c.tangent, c.edges) if b is not None])


def cancelling(causes: Sequence[Refined]) -> bool:
    """Test whether two of the causes together do less than either alone: each is then there to take off the other."""
    pairs = itertools.combinations([c.contribution for c in causes if sized(c.candidate)], 2)
    return any(float((a + b).std()) < min(float(a.std()), float(b.std())) for a, b in pairs)


def _columns(search: Search, candidate: Candidate) -> FloatArray:
    records = search.records
    if candidate.role == "input":
        return replaced_map(records, search.bank.basis, candidate)[0]
    if terms.CATALOGUE[candidate.id].kind == "static":
        return fine_columns(records, _FINEST_C)
    if candidate.channel is not None:
        return records.average([r.channels[candidate.channel] for r in records.runs])[:, None]
    return columns_of(records, candidate.id, candidate.values)


def _moved(candidate: Candidate, value: float) -> Candidate:
    parameter = shape_parameter(candidate.id)
    assert parameter is not None
    return replace(candidate, values={**candidate.values, parameter.name: value})


def sized(candidate: Candidate) -> bool:
    """Test whether a cause has amplitudes, which are accepted up to a size."""
    return candidate.role == "columns" and terms.CATALOGUE[candidate.id].kind != "static"


class _Fit:
    """Generalised least squares at the likeliest colour for models made of whole candidates."""

    def __init__(self, search: Search, gains: Gains, members: tuple[Candidate, ...]) -> None:
        self.search, self.gains = search, gains
        unseen = max(map(_unseen_s, members))
        known = np.concatenate([_inside(search, k, unseen) for k in range(len(search.records.runs))])
        edges = singled_out(~known) if unseen else np.zeros((search.y.size, 0))
        self.edges = edges
        static = [] if any(m.role == "input" for m in members) else [gains.map]
        self.q = orthonormal(gains.whiten(edges), *static)
        self.y = gains.target - self.q @ (self.q.T @ gains.target)
        self._made: dict[CandidateKey, tuple[FloatArray, FloatArray]] = {}

    def made(self, candidate: Candidate) -> tuple[FloatArray, FloatArray]:
        """Whitened columns of a candidate less what the map (or the masked edges) explain, and their `shares`."""
        if candidate.key not in self._made:
            plain = _columns(self.search, candidate)
            columns = self.gains.whiten(plain)
            rest = columns - self.q @ (self.q.T @ columns)
            self._made[candidate.key] = rest, self.gains.limit.shares(plain)
        return self._made[candidate.key]

    def energy(self, members: list[Candidate]) -> float:
        """Energy of the data that the members explain beyond the map; 0 where one would be larger than is accepted."""
        white = [self.made(m)[0] for m in members]
        weights = np.linalg.lstsq(np.column_stack(white), self.y, rcond=TOLERANCE)[0]
        parts = np.split(weights, np.cumsum([own.shape[1] for own in white])[:-1])
        for member, part in zip(members, parts, strict=True):
            if sized(member) and np.linalg.norm(self.made(member)[1] * part) > 1.0:
                return 0.0
        return float(((orthonormal(*white).T @ self.y) ** 2).sum())


def _unseen_s(candidate: Candidate) -> float:
    """Return the time at either end of a run that a candidate hides, s."""
    rule = terms.CATALOGUE[candidate.id].unseen_s
    return 0.0 if rule is None else rule(candidate.values)


def _inside(search: Search, k: int, margin_s: float) -> NDArray[np.bool_]:
    """Blocks of a run that are farther than a margin from its ends."""
    number = search.records.kept[k]
    at = (number + 0.5) * search.records.block_s
    length = (float(search.records.index[k][-1]) + 1.0) * search.records.block_s
    return np.asarray((at > margin_s) & (at < length - margin_s))


def refine(search: Search, gains: Gains, members: tuple[Candidate, ...]) -> tuple[Refined, ...]:
    """Move the nonlinear parameters of all members to their optimum, one after the other, in two rounds."""
    fit = _Fit(search, gains, members)
    current = list(members)
    profiles: list[FloatArray | None] = [None] * len(current)
    for _ in range(_ROUNDS if len(current) > 1 else 1):
        for k, member in enumerate(current):
            if shape_parameter(member.id) is None or member.channel is not None:
                continue
            profiles[k], best = _profile(fit, current, k)
            current[k] = _moved(member, best)
    return tuple(_result(search, fit, current, k, profiles[k]) for k in range(len(current)))


def _profile(fit: _Fit, members: list[Candidate], k: int) -> tuple[FloatArray, float]:
    """Profile likelihood of the k-th member's parameter over the search's grid and about its optimum, and the optimum.

    Only about the optimum where the cause changes the map's input: a point of its grid is a map of its own.
    """
    parameter = shape_parameter(members[k].id)
    assert parameter is not None
    rule, shown = searched(members[k].id), reach_of(fit.search.records)
    points: dict[float, float] = {}

    def energy(value: float) -> float:
        if value not in points:
            points[value] = fit.energy([*members[:k], _moved(members[k], value), *members[k + 1 :]])
        return points[value]

    energy(members[k].values[parameter.name])
    if members[k].role == "columns":
        for values in rule.grid(shown):
            energy(values[parameter.name])
    here = max(points, key=lambda v: points[v])
    width = rule.width(here, shown.span_c)  # about one point of the search's grid
    low = -np.inf if parameter.signed else 0.05 * here
    for shrink in (1.0, 0.35):
        here, curve = parabola_top(energy, here, shrink * width, low)
    half = float(np.sqrt(CHI2_95_ONE / curve)) if curve > 0 else width
    for sign in (-1.0, 1.0):
        for reach in (0.6, 1.0, 1.4, 2.2, 3.5, 6.0):
            value = here + sign * reach * half
            if value <= low or energy(value) < energy(here) - 1.5 * CHI2_95_ONE:
                break
    best = max(points, key=lambda v: points[v])
    return np.array(sorted(points.items())).T, best


def _result(search: Search, fit: _Fit, members: list[Candidate], k: int, profile: FloatArray | None) -> Refined:
    """Amplitudes with intervals that allow for the uncertainty of the nonlinear parameters."""
    swapped = [m for m in members if m.role == "input"]
    blocks = [fit.edges] if swapped else [fit.edges, search.bank.map]
    plain = [_columns(search, m) for m in members]
    start = sum(b.shape[1] for b in blocks) + sum(p.shape[1] for p in plain[:k])
    own = plain[k]
    design = np.column_stack([*blocks, *plain])
    white = fit.gains.whiten(design)
    size = np.linalg.norm(white, axis=0)
    norm = np.where(size > 0.0, size, 1.0)  # what runs show nothing of, as of a local function, gets a weight of 0
    y = fit.gains.whiten(search.y)
    weights = np.linalg.lstsq(white / norm, y, rcond=TOLERANCE)[0] / norm
    mine = weights[start : start + own.shape[1]]
    tangent = _tangent(search, members[k], mine)
    contribution = own @ mine
    if members[k].role == "input":
        contribution = contribution - search.bank.map @ (search.bank.map.T @ contribution)
    parameters: dict[str, Interval] = {}
    parameter = shape_parameter(members[k].id)
    if parameter is not None and profile is not None:
        low, high = profile_interval(profile)
        parameters[parameter.name] = Interval(members[k].values[parameter.name], low, high)
    tangents = [_tangent(search, m, None) if m is not members[k] else tangent for m in members]
    spread = _spread(fit, design, [t for t in tangents if t is not None], start, own.shape[1])
    parameters |= _amplitudes(members[k], mine, spread, own)
    edges = fit.edges if _unseen_s(members[k]) else None
    return Refined(members[k], own, tangent, parameters, np.asarray(contribution), edges, profile)


def _tangent(search: Search, candidate: Candidate, weights: FloatArray | None) -> FloatArray | None:
    """Derivative to the nonlinear parameter: of the columns, or of their weighted sum for a map."""
    parameter = shape_parameter(candidate.id)
    if parameter is None or candidate.channel is not None:
        return None
    here = candidate.values[parameter.name]
    step = searched(candidate.id).step or _STEP * here
    upper = _columns(search, _moved(candidate, here + step))
    lower = _columns(search, _moved(candidate, here - step))
    slope = (upper - lower) / (2.0 * step)
    if candidate.role != "input":
        return np.asarray(slope)
    if weights is None:
        return None
    return np.asarray(slope @ weights)[:, None]


def _spread(fit: _Fit, design: FloatArray, tangents: list[FloatArray], start: int, count: int) -> FloatArray:
    """Covariance of the weights `start` ... when everything is free, shape (count, count)."""
    white = fit.gains.whiten(np.column_stack([design, *tangents]))
    norm = np.where(np.linalg.norm(white, axis=0) > 0, np.linalg.norm(white, axis=0), 1.0)
    inverse = np.linalg.pinv(white / norm, rcond=TOLERANCE)[start : start + count]
    inverse = inverse / norm[start : start + count, None]
    return np.asarray(inverse @ inverse.T * fit.gains.scale**2)


def _amplitudes(
    candidate: Candidate, weights: FloatArray, spread: FloatArray, columns: FloatArray
) -> dict[str, Interval]:
    """Linear parameters by the term's own rule, with intervals."""
    term = terms.CATALOGUE[candidate.id]
    rule = term.amplitudes
    if candidate.role == "input" or term.kind == "static" or rule is None:
        return {}
    if term.kind == "random":
        return {name: random_size(weights, spread) for name in rule(weights)}
    centre = rule(weights)
    out = {}
    for name, value in centre.items():
        gradient = np.zeros(weights.size)
        for i in range(weights.size):
            step = 1e-4 * float(np.linalg.norm(weights)) + 1e-300
            moved = weights.copy()
            moved[i] += step
            gradient[i] = (rule(moved)[name] - value) / step
        half = NORMAL_95 * float(np.sqrt(max(float(gradient @ spread @ gradient), 0.0)))
        out[name] = Interval(value, value - half, value + half)
    if candidate.channel is not None:
        out["reference"] = Interval(float(np.mean(columns)), float(np.mean(columns)), float(np.mean(columns)))
    return out
