"""One comparison of runs by their curves over temperature: sign, axes, gain, unit, contradictions.

Every way in which the columns of a file can stand for its axes is tried (exchanged, reversed, both) against the other
runs, Earth's rate and an earlier calibration. Of one axis the factor on the mean curve of the others is fitted: a run
has another gain, or its sign reversed, where that curve with a factor is its own, the others agree with one another,
and no memory of the temperature explains the run as well: in a unit with hysteresis one branch is the curve of the
others with a factor. Two other runs are needed: of two runs nobody knows which one differs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import BoolArray, FloatArray, IntArray, masked
from ..common.metrics import median
from ..common.statistics import NORMAL_95, cell_means
from ..model import Model
from ..recordings.records import Curve, Dataset, Mark, Run
from ..results.base import Finding
from .findings import RunFacts, ValueWithLimits, finding
from .memories import evidence_beside_memories

_NEXT = (
    "Look at mounting and wiring; where only the columns are exchanged or mirrored, write them right or name them "
    "by [columns] in dataset.toml, else leave the run out."
)
_LEAST_OTHERS = 2  # of two runs nobody knows which one differs
_LEAST_PLACES = 12  # temperatures that two curves share: their shape is known
_AGREES = 3.0  # times the scatter of the other runs
_BETTER = 5.0  # how much worse the stated way is
_AS_WELL = 2.0  # ways that leave up to so much more fit as well
_EARTH_DPH = 15.04  # deg/h: Earth's rate, to the digits that a comparison within 3 % needs
_NORM, _DIRECTION = 0.03, 0.05  # three means that are Earth's rate, and its direction
_ALONG, _LEAST_ALONG_DPH = 0.1, 1.0  # one mean that is Earth's component
_EARLIER = 0.1  # of the departure, what may be left against an earlier calibration
_REVERSED, _SWING = -0.9, 2.0  # correlation with an earlier curve, and how much more or less it may swing
_BLOCK_S = 100.0  # of the means: the noise of a row is no yardstick, and a chamber's cycle is longer
_LEAST_CHANGE = 0.1  # of a gain: smaller ones are what terms and temperatures of runs do to a slope
_EVIDENCE = 10.0  # twice the logarithm of the odds against a memory: very strong
_CLEAR_FACTOR = 5.0  # times the largest departure from 1 of the other runs' own factors
_LEAST_SWING = 5.0  # of the curve, in terms of what the runs scatter about one another
_LEFT = 0.25  # of what the run departs by as it stands: the most that the factor may leave,
_ALIKE = 1.5  # unless it is no more than so many times the scatter: a run's own and that of the mean of two others
_UNITS = (1e3, 180.0 / np.pi, 3600.0)  # between units of a rate that are taken for one another
_OF_UNIT = 1.15  # ratio to such a factor: its neighbours lie 17 times away, and noise differs little between runs
_NOISE_ALIKE = 1.1  # ratio of the noises of the other runs, largest to smallest, for the noise to be evidence
_PLACE_C, _PLACE_C_PER_MIN = 1.0, 0.25  # what counts as the same temperature and rate of it
_COMMON_PLACES = 5  # fewer do not make a median
_CONTRADICTION = 5.0  # times the scatter of a minute within such a place
_LEAST_FREEDOM = 10  # degrees of freedom: with fewer a scatter is known to no better than a quarter


def curve_findings(
    dataset: Dataset, facts: Sequence[RunFacts], earlier: Mapping[str, Model] | None = None
) -> list[Finding]:
    """Report runs that differ from the others, one finding a run at most; the whole run is to be left out.

    Args:
        facts: Of the runs, by which their noise is known.
        earlier: Models of an earlier calibration by axis ("" where the recordings have one rate).
    """
    found = {}
    for curve in dataset.curves:
        one = (
            _orientation(dataset, curve, earlier or {})
            or _unit(curve.file, facts)
            or _factor_finding(dataset, curve, facts)
        )
        if one is not None:
            id, text, factor = one
            found[curve.file] = finding(
                id, text, curve, marks=(Mark(curve.file),), size=(factor, "times"), whole_run=True
            )
    return list(found.values())


def open_questions(
    dataset: Dataset, facts: Sequence[RunFacts], earlier: Mapping[str, Model] | None = None
) -> Iterator[Finding]:
    """Report what these recordings cannot tell of their curves, with the reason and what to record.

    The id is that of the finding that stays open.
    """
    training = [c for c in dataset.curves if c.role == "train"]
    series = [_series(c, dataset.axis) for c in training]
    one_axis = all(len(c.axes) <= 1 for c in dataset.curves)
    unknown = (
        ("sign_reversed" if one_axis else "axes_exchanged", [
            c.file for c in dataset.curves if not _orientation_shows(dataset, c, earlier or {})
        ]),
        ("gain_changed", [
            c.file for k, c in enumerate(training) if _shared_swing(series[k], series[:k] + series[k + 1 :]) is None
        ]),
        ("unit_changed", [c.file for c in dataset.curves if _noise_ratio(c.file, facts) is None]),
    )  # fmt: skip
    every = {c.file for c in dataset.curves}
    for id, files in unknown:
        if files:
            which = "any run" if set(files) == every else ", ".join(dict.fromkeys(files))
            question, needs = _OPEN[id]
            text = f"Whether {question.format(which)}, these recordings cannot tell: that takes two other {needs}."
            yield finding(id, text, advice=_RECORD)


_RECORD = "Record three runs at least, over the same temperatures and with the same rows."
_INSTEAD = (
    "runs over the same temperatures, or Earth's rate (earth_rate, latitude_deg), or an earlier result (--previous)"
)
_OPEN = {
    "sign_reversed": ("the sign of {} is reversed", _INSTEAD),
    "axes_exchanged": ("axes of {} are exchanged or reversed", _INSTEAD),
    "gain_changed": (
        "the gain of {} is another",
        "training runs over the same temperatures, and a bias that changes over them",
    ),
    "unit_changed": ("the unit of {} is another", "runs with rows of the same length and noise of the same level"),
}


def _orientation_shows(dataset: Dataset, curve: Curve, earlier: Mapping[str, Model]) -> bool:
    """Test whether a reversed or exchanged axis of the run would show."""
    others = [c for c in dataset.curves if c is not curve and c.axes == curve.axes]
    along = _earth(curve)
    by_earth = len(along) == 3 or (len(along) == 1 and abs(float(along[0])) >= _LEAST_ALONG_DPH)
    return len(curve.cells) > 0 and (
        len(_shared_places(curve, others)[0]) > 0
        or (curve.earth_dph is not None and by_earth)
        or any(axis in earlier for axis in (curve.axes or ("",)))
    )


@dataclass(frozen=True, slots=True)
class _Way:
    """Assignment of columns with signs to axes."""

    column: tuple[int, ...]
    sign: tuple[int, ...]

    @property
    def id(self) -> str:
        return "sign_reversed" if self.column == tuple(range(len(self.column))) else "axes_exchanged"

    @property
    def changed(self) -> list[int]:
        """Axes with another column or sign."""
        return [k for k, (c, sign) in enumerate(zip(self.column, self.sign, strict=True)) if c != k or sign < 0]

    @property
    def changes(self) -> int:
        """Number of exchanged columns and reversed signs."""
        return sum(c != k for k, c in enumerate(self.column)) + sum(s < 0 for s in self.sign)

    def of(self, rates: FloatArray) -> FloatArray:
        return np.asarray(rates[:, list(self.column)] * np.array(self.sign))

    def words(self, axes: Sequence[str]) -> str:
        if len(self.column) == 1:
            return "its sign is reversed"
        parts = [
            f"axis {axes[k]} stands {'with the other sign ' if self.sign[k] < 0 else ''}in the column of "
            f"{axes[self.column[k]]}"
            for k in self.changed
        ]
        return "; ".join(parts)


_Found = tuple[str, str, ValueWithLimits]  # id, text, factor with its limits


def _orientation(dataset: Dataset, curve: Curve, earlier: Mapping[str, Model]) -> _Found | None:
    """The way in which the run's axes are exchanged or reversed."""
    others = [c for c in dataset.curves if c is not curve and c.axes == curve.axes]
    found = _against_others(curve, others) or _against_earth(curve) or _against_earlier(curve, earlier)
    if found is None:
        return None
    way, against = found
    return way.id, f"{curve.file}: against {against}, {way.words(curve.axes)}. {_NEXT}", (-1.0, -1.0, -1.0)


def _against_others(curve: Curve, others: Sequence[Curve]) -> tuple[_Way, str] | None:
    """The way that makes the run one of the others, which agree with one another."""
    mine, rates, there = _shared_places(curve, others)
    if not len(mine):
        return None
    count = np.count_nonzero(there, axis=0)[:, None]
    mean = rates.sum(axis=0) / count
    own, usual = curve.rates_dph[mine], mean + _earth(curve)
    variance = np.sum(np.where(there[..., None], rates - mean, 0.0) ** 2, axis=(0, 1)) / np.sum(count - 1)
    found = _best(own, usual, _AGREES * float(np.sqrt(variance.mean())))
    if found is None:
        return None
    way = found[0]
    changed = way.changed  # axes that stand as they should say nothing of one that does not
    scatter = float(np.sqrt(variance[changed].mean()))
    left, stated = (float(np.sqrt(np.mean((r - usual)[:, changed] ** 2))) for r in (way.of(own), own))
    if left > _AGREES * scatter or stated < _BETTER * max(left, scatter):
        return None
    return way, (
        f"the other runs (off by {stated:.4g} deg/h as it stands, by {left:.2g} so; they agree to {scatter:.2g})"
    )


def _shared_places(curve: Curve, others: Sequence[Curve]) -> tuple[IntArray, FloatArray, BoolArray]:
    """Return indices of the run's temperatures that two others have, and the others' rates there without Earth's.

    The last array is true where another run has a rate.
    """
    grid, rates, there = _on_grid([(other.temperature_c, other.rates_dph - _earth(other)) for other in others])
    shared = np.flatnonzero(np.count_nonzero(there, axis=0) >= _LEAST_OTHERS)
    _, mine, among = np.intersect1d(curve.temperature_c, grid[shared], return_indices=True)
    return mine, rates[:, shared[among]], there[:, shared[among]]


def _on_grid(curves: Sequence[_Series]) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Every temperature of some curves, their values at each (0 where one has none), and which of them have one."""
    grid = np.unique(np.concatenate([np.zeros(0), *(t for t, _ in curves)]))
    shape = len(curves), len(grid)
    values, there = np.zeros((*shape, *(curves[0][1].shape[1:] if curves else ()))), np.zeros(shape, dtype=bool)
    for k, (t, of_curve) in enumerate(curves):
        at = np.searchsorted(grid, t)
        values[k, at], there[k, at] = of_curve, True
    return grid, values, there


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
        return _Way((0,), (-1,)), f"Earth's rate along its axis ({earth[0, 0]:.4g} deg/h; the mean is {mean[0, 0]:.4g})"
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


def _unit(file: str, facts: Sequence[RunFacts]) -> _Found | None:
    """The unit that a run's noise says."""
    ratio = _noise_ratio(file, facts) or 1.0
    unit = next((f for u in _UNITS for f in (u, 1.0 / u) if 1.0 / _OF_UNIT < ratio / f < _OF_UNIT), None)
    if unit is None:
        return None
    text = (
        f"The noise of {file} is that of the other runs times {ratio:.3g}: its rates have another unit (a factor of "
        f"{unit:.6g}). State it, or take the run out of dataset.toml."
    )
    return "unit_changed", text, (unit, unit, unit)


def _noise_ratio(file: str, facts: Sequence[RunFacts]) -> float | None:
    """Noise of a run's rows over that of the others; None where two others at least do not agree on theirs."""
    own = next((f for f in facts if f.file == file), None)
    if own is None:
        return None
    others = [
        f.noise_dph
        for f in facts
        if f.file != file and abs(f.row_period_s / own.row_period_s - 1.0) < 0.01 and f.noise_dph > 0.0
    ]
    if len(others) < _LEAST_OTHERS or max(others) > _NOISE_ALIKE * min(others):
        return None
    return own.noise_dph / float(np.median(others))


def _factor_finding(dataset: Dataset, curve: Curve, facts: Sequence[RunFacts]) -> _Found | None:
    """A run whose curve is the others' with a factor: another gain, or the sign reversed.

    A scale changes curve and noise: where the noise says the same factor, the curve need not be clear of what the other
    runs' own factors are.
    """
    training = [c for c in dataset.curves if c.role == "train"]
    others = [_series(c, dataset.axis) for c in training if c is not curve]
    own = _factor(_series(curve, dataset.axis), others)
    if own is None or abs(own[0] - 1.0) < _LEAST_CHANGE:
        return None
    factor, half = own
    limits = factor, factor - half, factor + half
    if factor < 0.0:
        if not 1.0 / _SWING < -factor < _SWING:
            return None
        text = (
            f"{curve.file} has its sign reversed against the other runs: its mean rate over temperature is theirs "
            f"times {factor:.3g} (95 % {limits[1]:.3g} ... {limits[2]:.3g}). {_NEXT}"
        )
        return "sign_reversed", text, limits
    louder = _noise_ratio(curve.file, facts) or 1.0
    if abs(louder - 1.0) < _LEAST_CHANGE or abs(factor / louder - 1.0) > _LEAST_CHANGE:
        rest = [others[:k] + others[k + 1 :] for k in range(len(others))]
        among = [one for k, of in enumerate(rest) if (one := _factor(others[k], of)) is not None]
        if len(among) < _LEAST_OTHERS or abs(factor - 1.0) <= _CLEAR_FACTOR * max(abs(f - 1.0) for f, _ in among):
            return None
    of_curve = (run for run in dataset.runs if (run.file, run.from_s) == (curve.file, curve.from_s))
    run = next(of_curve, None)
    if run is None or run.role != "train" or not _gain_throughout(run, others):
        return None
    text = (
        f"The rates of {curve.file} are those of the other runs times {factor:.3g} (95 % {limits[1]:.3g} ... "
        f"{limits[2]:.3g}): its scale was another one. Mend it, or take the run out of dataset.toml."
    )
    return "gain_changed", text, limits


def _gain_throughout(run: Run, others: Sequence[_Series]) -> bool:
    """Test whether a factor on the other runs' curve explains a run better than that curve with any memory."""
    known, usual, _ = _usual_curve(others)
    rows = run.rows()
    good = run.in_span(rows.time_s) & np.isfinite(rows.rate_dph) & np.isfinite(rows.temperature_c)
    if not good.any():
        return False
    columns = (masked(column, good) for column in (rows.time_s, rows.temperature_c, rows.rate_dph))
    t, x, y = cell_means(_BLOCK_S, *columns)
    curve = np.interp(x, known, usual)
    used = (x >= known[0]) & (x <= known[-1])
    side = np.column_stack([np.ones_like(t), curve, np.gradient(x, t)])
    return evidence_beside_memories((t, x, y - curve), used, side, side[:, :0]) > _EVIDENCE


_Series = tuple[FloatArray, FloatArray]  # temperatures, each once; rates there, shape (p,) or (p, axes)


def _series(curve: Curve, axis: str | None) -> _Series:
    """Mean rate of the chosen axis at each temperature."""
    return curve.temperature_c, curve.rates_dph[:, curve.axes.index(axis) if axis in curve.axes else 0]


def _factor(own: _Series, others: Sequence[_Series]) -> tuple[float, float] | None:
    """The factor on the others' mean curve that makes this one, beside a constant, and half its 95 % interval.

    None where the runs share too few temperatures, the curve hardly swings, or no factor makes it this one.
    """
    shared = _shared_swing(own, others)
    if shared is None:
        return None
    x, y, scatter = shared
    power = float(x @ x)
    factor = float(x @ y) / power
    left, stated = float(np.mean((y - factor * x) ** 2)), float(np.mean((y - x) ** 2))
    if abs(factor - 1.0) >= _LEAST_CHANGE and left > max(_LEFT**2 * stated, (_ALIKE * scatter) ** 2):
        return None
    error = float(np.sqrt(left / power * len(x) / (len(x) - 2)))
    return factor, NORMAL_95 * error


def _shared_swing(own: _Series, others: Sequence[_Series]) -> tuple[FloatArray, FloatArray, float] | None:
    """The others' mean curve and this one where both are known, about their means, and the scatter of the others.

    None where the runs share too few temperatures, or the curve hardly swings.
    """
    grid, usual, scatter = _usual_curve(others)
    common, mine, at = np.intersect1d(own[0], grid, return_indices=True)
    if len(common) < _LEAST_PLACES:
        return None
    x, y = usual[at] - usual[at].mean(), own[1][mine] - own[1][mine].mean()
    power = float(x @ x)  # 0 of rates of one value, which have no scatter either
    return (x, y, scatter) if power > 0.0 and power >= _LEAST_SWING**2 * len(x) * scatter**2 else None


def _usual_curve(others: Sequence[_Series]) -> tuple[FloatArray, FloatArray, float]:
    """Return temperatures that at least two runs have, the mean of their centred curves there, and the scatter."""
    grid, rates, there = _on_grid(others)
    shared = np.count_nonzero(there, axis=0) >= _LEAST_OTHERS
    grid, rates, there = grid[shared], rates[:, shared], there[:, shared]
    if not len(grid):
        return grid, grid, 0.0
    level = rates.sum(axis=1, keepdims=True) / np.maximum(np.count_nonzero(there, axis=1, keepdims=True), 1)
    count, left = np.count_nonzero(there, axis=0), np.where(there, rates - level, 0.0)
    usual = left.sum(axis=0) / count
    variance = np.sum(np.where(there, left - usual, 0.0) ** 2, axis=0) / (count - 1)
    return grid, usual, float(np.sqrt(variance.mean()))


def contradiction_findings(facts: Sequence[RunFacts]) -> Iterator[Finding]:
    """Training runs that show another rate where others were at the same temperature and rate of it.

    A map gives one answer there; what it then fits is a mean of both, which neither run shows.
    """
    runs = [f for f in facts if f.role == "train" and len(f.rates_dph)]
    if len(runs) < 2:
        return
    run = np.concatenate([np.full(len(f.rates_dph), k) for k, f in enumerate(runs)])
    rate = np.concatenate([f.rates_dph for f in runs])
    at = np.concatenate(
        [np.column_stack([f.temperatures_c / _PLACE_C, f.slopes_c_per_min / _PLACE_C_PER_MIN]).round() for f in runs]
    )
    keys, group = np.unique(np.column_stack([at, run]), axis=0, return_inverse=True)
    group = group.reshape(-1)
    count = np.bincount(group)
    mean = np.bincount(group, rate) / count
    freedom = len(rate) - len(keys)
    if freedom < _LEAST_FREEDOM:
        return
    scatter = float(np.sqrt(np.sum((rate - mean[group]) ** 2) / freedom))
    yield from _contradictions(runs, keys, mean, scatter)


def _contradictions(
    runs: Sequence[RunFacts], keys: NDArray[np.float64], mean: NDArray[np.float64], scatter: float
) -> Iterator[Finding]:
    """One finding for each run that departs from the run, or the middle of the runs, that was in the same places.

    Args:
        keys: Place (two columns) and number of the run, shape (n, 3).
        mean: Mean rate there, deg/h, shape (n,).
        scatter: By how much means over a minute scatter within a place, deg/h.
    """
    _, place = np.unique(keys[:, :2], axis=0, return_inverse=True)
    order = np.argsort(place.reshape(-1), kind="stable")
    departures: dict[int, list[float]] = {}
    for members in np.split(order, np.flatnonzero(np.diff(place.reshape(-1)[order])) + 1):
        if len(members) < 2:
            continue
        other_one = [float(mean[m]) for m in members[::-1]]  # of two
        others = [median(mean[members])] * len(members) if len(members) > 2 else other_one
        for m, other in zip(members, others, strict=True):
            departures.setdefault(int(keys[m, 2]), []).append(float(mean[m]) - other)
    for k, values in departures.items():
        difference = float(np.median(np.abs(values)))
        if len(values) >= _COMMON_PLACES and difference > _CONTRADICTION * scatter:
            text = (
                f"{runs[k].file} contradicts the other training runs: at the same temperature and its rate, it shows "
                f"{difference:.4g} deg/h more or less ({len(values)} places; minutes of a run scatter by "
                f"{scatter:.2g}). A map can follow only one of them."
            )
            yield finding(
                "runs_contradict",
                text,
                runs[k],
                marks=(Mark(runs[k].file),),
                difference_dph=difference,
                scatter_dph=scatter,
                places=len(values),
            )
