"""Compare a check run with the earlier map of its unit, in parts of the run, and find the shape of a change.

And what may have become of the unit since its earlier calibration. A laboratory tries the simple answers first: the
earlier map as it is, moved by an offset, moved by an offset and a slope over T and dT/dt, or changed in its whole
shape. Each is a normal distribution of the map about the earlier one, with the earlier map's own covariance, so that
their evidences are comparable (MacKay 1992): the more an answer could explain, the better it has to explain the run.
How large the change is nobody knows: its size is equally likely in every decade, and the evidence is the mean over
sizes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from ...common.arrays import FloatArray
from ...common.errors import InputError
from ...common.metrics import LEAST_SPAN_C
from ...results.evaluation import At, MapDifference
from ...results.training import ChangeKind, CheckedCell, MapChange
from .learn import FALSE_ALARM
from .unit_means import UnitMeans
from .use import MapPosterior, MapPrior

TemperatureSpan = tuple[float, float]

_CENTERS = 17  # of regions over the run's temperatures: at half of the narrowest one's width
_WIDTHS = (0.125, 0.25, 0.5)  # of regions, shares of the run's span: narrower ones hold too few means of a short run
_STILL_C_PER_MIN = 0.2  # a chamber that holds: nine tenths of the paper's holds are slower
_LEAST_SHARE = 0.05  # of a run, ramps of one direction: less says nothing of them
_CELLS = 8  # of T, for the table
_COVERAGE = 2.0  # k of U, about 95 % (JCGM 100:2008, G.1)


@dataclass(frozen=True, slots=True)
class _Shape:
    kind: str
    temperature_c: TemperatureSpan
    slope_c_per_min: TemperatureSpan
    values: FloatArray


def within(prior: MapPrior, run: UnitMeans) -> UnitMeans:
    """The means of a run that lie in a prior's envelope: the others say nothing of it.

    Raises:
        InputError: None does.
    """
    (t0, t1), (r0, r1) = prior.temperature_c, prior.slope_c_per_min
    t, r = run.temperature_c, run.slope_c_per_min
    inside = (t >= t0) & (t <= t1) & (r >= r0) & (r <= r1)
    if not inside.any():
        found = f"is nowhere within {t0:.1f} ... {t1:.1f} C and {r0:.2f} ... {r1:.2f} C/min"
        raise InputError("--prior", f"the check run {found}", "a run where the earlier model holds")
    return run.select(inside)


class Departures:
    """Residual of the earlier map on a run, with its covariance for an unchanged unit."""

    def __init__(self, expected: MapPosterior, run: UnitMeans) -> None:
        """Compare a run with a map that has not seen it.

        Args:
            expected: The earlier model with its ageing.
            run: Means of the check run, as `within`.
        """
        self.run = run
        self.left = run.bias_dph - expected.mean_dph(run.temperature_c, run.slope_c_per_min)
        values = expected.prior.basis.values(run.temperature_c, run.slope_c_per_min) * expected.prior.unit_dph
        self.covariance = values @ expected.covariance @ values.T + _scatter_of(run, values, expected.prior.own)

    def cells(self) -> Iterator[CheckedCell]:
        """The run in parts."""
        t, r = self.run.temperature_c, self.run.slope_c_per_min
        low, high = _range(t)
        edges = np.linspace(low, high, _CELLS + 1)
        number = np.clip(((t - low) / max(high - low, 1e-9) * _CELLS).astype(int), 0, _CELLS - 1)
        branch = np.sign(np.where(np.abs(r) > _STILL_C_PER_MIN, r, 0.0))
        parts = [(k, b) for k in range(_CELLS) for b in (-1.0, 0.0, 1.0) if np.any((number == k) & (branch == b))]
        reach = -float(ndtri(0.5 * FALSE_ALARM / len(parts)))  # Bonferroni
        for k, b in parts:
            there = (number == k) & (branch == b)
            weight = np.where(there, self.run.count, 0.0)
            weight = weight / weight.sum()
            found = float(weight @ self.left)
            limit = reach * float(np.sqrt(weight @ self.covariance @ weight))
            yield CheckedCell(
                temperature_c=(float(edges[k]), float(edges[k + 1])),
                slope_c_per_min=_range(r[there]),
                found_dph=found,
                limit_dph=limit,
                within=bool(abs(found) <= limit),
            )

    def change(self, kind: ChangeKind) -> MapChange | None:
        """The change of a kind, by generalised least squares; None where there is none."""
        if kind == "unchanged":
            return None
        if kind == "full":
            return self._regional()
        shapes = list(_lines(self.run))[: 1 if kind == "offset" else None]
        columns = np.array([s.values for s in shapes]).T
        known = np.linalg.solve(self.covariance, columns)
        covariance = np.linalg.inv(columns.T @ known)
        sizes, sigmas = covariance @ (known.T @ self.left), np.sqrt(np.diag(covariance))
        best = int(np.argmax(np.abs(sizes[1:]) / sigmas[1:])) + 1 if len(shapes) > 1 else 0
        parts = [_named(*one) for one in zip(shapes, sizes, sigmas, strict=True)]
        return _change(shapes[best], float(sizes[best]), float(sigmas[best]), ", ".join(parts))

    def _regional(self) -> MapChange:
        """The single shape that explains most; a region pays for being one of many (a scan: Naus 1965)."""
        shapes = [*_lines(self.run), *_regions(self.run)]
        factor = np.linalg.cholesky(self.covariance)
        columns = np.linalg.solve(factor, np.array([s.values for s in shapes]).T)
        length = np.linalg.norm(columns, axis=0)
        size = (columns / length).T @ np.linalg.solve(factor, self.left)
        regions = sum(s.kind == "local" for s in shapes)
        price = [2.0 * np.log(max(regions, 1)) if s.kind == "local" else 0.0 for s in shapes]
        best = int(np.argmax(size**2 - price))
        found = float(size[best] / length[best]), float(1.0 / length[best])
        return _change(shapes[best], *found, _named(shapes[best], *found))


def _lines(run: UnitMeans) -> Iterator[_Shape]:
    """Yield the shapes of a change: constant, in proportion to T, and to dT/dt if that varies."""
    t, r = run.temperature_c, run.slope_c_per_min
    span, rates = _range(t), _range(r)
    yield _Shape("offset", span, rates, np.ones(len(t)))
    if span[1] - span[0] >= LEAST_SPAN_C:
        yield _Shape("slope", span, rates, (t - 0.5 * sum(span)) / (span[1] - span[0]))
    if rates[1] - rates[0] > _STILL_C_PER_MIN:
        yield _Shape("rate", span, rates, r / (rates[1] - rates[0]))


def _regions(run: UnitMeans) -> Iterator[_Shape]:
    t, r = run.temperature_c, run.slope_c_per_min
    low, high = _range(t)
    span = max(high - low, 1e-9)
    for inside in _branches(run):
        for width in _WIDTHS:
            for center in np.linspace(low, high, _CENTERS):
                bump = np.exp(-0.5 * ((t - center) / (0.5 * width * span)) ** 2) * inside
                if float(np.sum(run.count * bump)) > _LEAST_SHARE * width * float(run.count.sum()):
                    ends = max(low, center - 0.5 * width * span), min(high, center + 0.5 * width * span)
                    yield _Shape("local", ends, _range(r[inside]), bump)


def _branches(run: UnitMeans) -> Iterator[NDArray[np.bool_]]:
    """All of a run, and its ramps up, its rests, its ramps down, where it has them."""
    r = run.slope_c_per_min
    yield np.ones(len(r), dtype=bool)
    for part in (r < -_STILL_C_PER_MIN, np.abs(r) <= _STILL_C_PER_MIN, r > _STILL_C_PER_MIN):
        if _LEAST_SHARE <= float(np.sum(run.count[part]) / run.count.sum()) < 1.0:
            yield part


def _range(x: FloatArray) -> TemperatureSpan:
    return float(x.min()), float(x.max())


def _named(shape: _Shape, size: float, sigma: float) -> str:
    (t0, t1), (r0, r1) = shape.temperature_c, shape.slope_c_per_min
    figure = f"{size:+.2g} ± {_COVERAGE * sigma:.2g} deg/h"
    return {
        "offset": f"an offset of {figure}, the same everywhere",
        "slope": f"a slope over temperature of {figure} from {t0:.0f} to {t1:.0f} C",
        "rate": f"a dependence on dT/dt of {figure} from {r0:.1f} to {r1:.1f} C/min",
        "local": f"{figure} in the middle of {t0:.0f} ... {t1:.0f} C and {r0:.1f} ... {r1:.1f} C/min",
    }[shape.kind]


def _change(shape: _Shape, size: float, sigma: float, text: str) -> MapChange:
    return MapChange(
        kind=shape.kind,  # type: ignore[arg-type]
        temperature_c=shape.temperature_c,
        slope_c_per_min=shape.slope_c_per_min,
        size_dph=size,
        standard_uncertainty_dph=sigma,
        text=f"{text} (U, k = {_COVERAGE:g})",
    )


_SIZES = np.logspace(0.0, 5.0, 21)  # of a change, over 1 sigma of the earlier map: five decades, four to each
_GRID = (61, 25)  # points of T and of dT/dt over the envelope, as for the distance of two maps
# A new shape of size 1 is the sum of two processes (`basis.PARAMETERS`): one of short scale over T, with a constant and
# with what couples T and dT/dt, and one of long scale. Line, curve and slope would go on where the run has not been.
_NONE = 1e-6
_NEW_SHAPE = (
    (1.0, _NONE, _NONE, _NONE, 0.3, 0.15, 0.3, 0.8, 0.8),
    (_NONE, _NONE, _NONE, _NONE, 1.0, 0.7, _NONE, 0.8, 0.8),
)
_RIDGE = 1e-9  # of a line written in the functions: their sines nearly repeat one another inside the envelope
# Strong evidence (Kass and Raftery 1995), which more than an offset needs: where the run has not been, an offset is the
# same, and any other change a guess
_STRONG = np.log(20.0)


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """An answer to what became of the unit.

    Attributes:
        kind: Which.
        log_odds: Natural logarithm of its evidence over that of the unchanged map; of more than an offset less that of
            strong evidence.
        prior: What it makes of the earlier map before the run.
        moved: How far the map then moves over the earlier one's envelope. Its U is twice the RMS move that the noise
            of the run and the uncertainty of the earlier map give although the unit has not changed.
        allowed_dph: The same with the ageing that is stated.
    """

    kind: ChangeKind
    log_odds: float
    prior: MapPrior
    moved: MapDifference
    allowed_dph: float

    @property
    def consistent(self) -> bool:
        """True if the map moves by more than U where it has changed, and by no more than allowed elsewhere."""
        if self.kind == "unchanged":
            return self.moved.rms_dph <= self.allowed_dph
        return bool(self.moved.significant)


def _scatter_of(run: UnitMeans, values: FloatArray, own: FloatArray) -> FloatArray:
    """Return the covariance of means about the map of all power-ons: noise, and what each power-on has of its own.

    Args:
        run: The means.
        values: Columns at the means, deg/h.
        own: Variances of what a power-on has of its own, of the first columns.
    """
    of_own = (values[:, : len(own)] * own) @ values[:, : len(own)].T
    if run.power_on is not None:
        of_own = of_own * (run.power_on[:, None] == run.power_on)
    return np.asarray(of_own + np.diag(run.sigma_dph**2 / run.count))


class _Seen:
    """Means of a run against a map that has not seen them, in deg/h.

    Everything is solved among the means, whose noise keeps the equations regular however wide a map's covariance is.
    """

    def __init__(self, prior: MapPrior, run: UnitMeans) -> None:
        inputs = run.temperature_c, run.slope_c_per_min
        self.values = prior.unit_dph * prior.basis.values(*inputs)
        self.noise = _scatter_of(run, self.values, prior.own)
        self.left = run.bias_dph - prior.center_dph - self.values @ prior.means[0]

    def scatter(self, covariance: FloatArray) -> FloatArray:
        """Covariance of what is left under one of the coefficients."""
        return np.asarray(self.values @ covariance @ self.values.T + self.noise)

    def log_odds(self, scatter: FloatArray, root: FloatArray, sizes: FloatArray) -> FloatArray:
        """Log evidence of what is left for changes of some sizes, over that of none.

        Args:
            scatter: Covariance of what is left where nothing has changed.
            root: Of the covariance of the coefficients' change of size 1, shape (n, m).
            sizes: Of the change, in the coefficients' unit.
        """
        white = np.linalg.solve(np.linalg.cholesky(scatter), np.column_stack([self.values @ root, self.left]))
        q, size, _ = np.linalg.svd(white[:, :-1], full_matrices=False)
        more = np.outer(sizes**2, size**2)
        return np.asarray(0.5 * np.sum((q.T @ white[:, -1]) ** 2 * more / (1.0 + more) - np.log1p(more), axis=1))

    def gain(self, covariance: FloatArray) -> FloatArray:
        """Return the movement of the coefficients per unit of the residual, shape (coefficients, means)."""
        return np.asarray(np.linalg.solve(self.scatter(covariance), self.values @ covariance).T)


def updated(prior: MapPrior, run: UnitMeans) -> MapPosterior:
    """Update the map of one cluster with a run."""
    seen, covariance = _Seen(prior, run), prior.covariances[0]
    gain = seen.gain(covariance)
    rest = np.eye(len(covariance)) - gain @ seen.values
    after = rest @ covariance @ rest.T + gain @ seen.noise @ gain.T  # Joseph's form: positive in spite of rounding
    return MapPosterior(prior, prior.means[0] + gain @ seen.left, after, 0, 1.0)


def revised(prior: MapPrior, run: UnitMeans, unaged: FloatArray) -> list[Hypothesis]:
    """All answers, the one to be taken first: the best supported of those that are consistent, then the others.

    Args:
        prior: The earlier map with its ageing.
        run: Means of the check run.
        unaged: Covariance of the earlier map without it, shape (n, n).
    """
    return sorted(_tried(prior, run, unaged), key=lambda one: (not one.consistent, -one.log_odds))


def _tried(prior: MapPrior, run: UnitMeans, unaged: FloatArray) -> Iterator[Hypothesis]:
    covariance, seen = prior.covariances[0], _Seen(prior, run)
    where = prior.unit_dph * prior.basis.values(*_inputs(prior))
    sizes = _SIZES * prior.alone().rms_sigma_dph() / prior.unit_dph
    same = seen.scatter(covariance)
    for kind, root in _changes(prior, run, where):
        values = seen.log_odds(same, root, sizes)
        best = covariance + float(sizes[int(np.argmax(values))]) ** 2 * (root @ root.T)
        mean = float(np.logaddexp.reduce(values) - np.log(len(values)))
        gain = where @ seen.gain(best)
        yield Hypothesis(
            kind,
            mean - (_STRONG if kind in ("slope", "full") else 0.0),
            replace(prior, covariances=best[None]),
            _moved(prior, gain @ seen.left, _expanded(gain, seen.scatter(unaged))),
            _expanded(gain, same),
        )


def _changes(prior: MapPrior, run: UnitMeans, where: FloatArray) -> Iterator[tuple[ChangeKind, FloatArray]]:
    """Root of the covariance of a change of size 1, shape (n, m); beyond what the run has seen no slope goes on."""
    n = len(prior.means[0])
    offset = np.eye(n)[:, :1]
    ends = (run.temperature_c, prior.temperature_c), (run.slope_c_per_min, prior.slope_c_per_min)
    gram, lines = where.T @ where, []
    for place, (seen, (low, high)) in zip(_places(), ends, strict=True):
        a, b = (2.0 * (float(x) - low) / max(high - low, 1e-9) - 1.0 for x in (seen.min(), seen.max()))
        line = where.T @ np.clip(place, a, b)  # in the functions' own unit
        lines.append(prior.unit_dph * np.linalg.solve(gram + _RIDGE * np.trace(gram) * np.eye(len(gram)), line))
    shape = np.sum([prior.basis.variance(np.log(process)) for process in _NEW_SHAPE], axis=0)
    yield "unchanged", np.zeros((n, 1))
    yield "offset", offset
    yield "slope", np.column_stack([offset, *lines])
    yield "full", np.diag(np.sqrt(shape))


def _places() -> tuple[FloatArray, FloatArray]:
    """T and dT/dt over an envelope, each from -1 to 1."""
    t, r = np.meshgrid(*(np.linspace(-1.0, 1.0, n) for n in _GRID))
    return t.ravel(), r.ravel()


def _inputs(prior: MapPrior) -> tuple[FloatArray, FloatArray]:
    """Return the places of a grid over the envelope in C and C/min."""
    spans = prior.temperature_c, prior.slope_c_per_min
    t, r = (0.5 * (a + b) + 0.5 * (b - a) * x for (a, b), x in zip(spans, _places(), strict=True))
    return t, r


def _expanded(gain: FloatArray, scatter: FloatArray) -> float:
    """Twice the RMS by which the map of an unchanged unit moves, deg/h."""
    return _COVERAGE * float(np.sqrt(np.mean(np.sum((gain @ scatter) * gain, axis=1))))


def _moved(prior: MapPrior, moved: FloatArray, expanded_dph: float) -> MapDifference:
    rms_dph, worst = float(np.sqrt(np.mean(moved**2))), int(np.argmax(np.abs(moved)))
    t, r = (float(x[worst]) for x in _inputs(prior))
    return MapDifference(
        rms_dph=rms_dph,
        mean_dph=float(np.mean(moved)),
        max_abs_dph=float(np.abs(moved[worst])),
        at=At(temperature_c=t, slope_c_per_min=r),
        rms_over_floor=None,
        expanded_uncertainty_dph=expanded_dph,
        significant=rms_dph > expanded_dph,
    )
