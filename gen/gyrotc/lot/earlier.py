"""A unit's earlier model as the prior of its recalibration, and whether it still holds.

A map that has changed has changed by a smooth shape: an offset, something in proportion to T or to dT/dt, or in a
region. Each shape's size is estimated by generalised least squares, with the covariance of what remains of a unit that
has not changed (its map's, ageing's, the noise's); the largest of these sizes over its standard deviation is the
statistic (a scan: Naus 1965). Its distribution is drawn from the same covariance, so the share of false alarms is
what is stated, whatever the run was.

The earlier means give the map's posterior in the lot's functions (or it stands in `training.json`, where a lot or a
still earlier model had a share in it). Since then the bias may have moved: the constant by the stated ageing, what
depends on temperature smoothly by half of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfc, ndtri

from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..results.lot import KnownMap
from ..results.training import CheckedCell, EarlierUse, MapChange
from ..train.data import Scaling, TrainingData
from ..train.evidence import Asked
from ..train.means import UnitMeans
from ..train.prior import Given
from .basis import CONSTANT, PRIOR_LOG, LotBasis, fitted_parameters
from .learn import FALSE_ALARM, Envelope, sums_of, that_count
from .prior import MapPosterior, MapPrior, check_positive, processed, triangle
from .use import curve_of, followed, known_map, seen_alone

__all__ = [
    "EarlierPrior",
    "Held",
    "held",
    "posterior_of_known",
    "posterior_of_means",
    "stated_sigma_dph",
    "widened",
]

Span = tuple[float, float]

_CENTERS = 17  # of regions over the run's temperatures: at half of the narrowest one's width
_WIDTHS = (
    0.125,
    0.25,
    0.5,
)  # of regions, shares of the run's span: narrower ones hold too few means of a short run
_STILL_C_PER_MIN = 0.2  # a chamber that holds: nine tenths of the paper's holds are slower
_LEAST_SHARE = 0.05  # of a run, ramps of one direction: less says nothing of them
_CELLS = 8  # of T, for the table
_DRAWS = 10_000  # of the statistic: a p-value of 1 % then has a standard error of 0.1 %
_SEED = 1  # of these draws: any; the same run gives the same answer


@dataclass(frozen=True, slots=True)
class Held:
    """What a check run says of an earlier model.

    Attributes:
        p_value: Probability that a unit that has not changed lies as far away.
        change: What explains it best, where that is less than `FALSE_ALARM`.
        cells: The run in parts.
    """

    p_value: float
    change: MapChange | None
    cells: tuple[CheckedCell, ...]


@dataclass(frozen=True, slots=True)
class _Shape:
    kind: str
    temperature_c: Span
    slope_c_per_min: Span
    values: FloatArray


def held(expected: MapPosterior, run: UnitMeans) -> Held:
    """Holds the means of a run against a posterior that has not seen them.

    Args:
        expected: The earlier model with its ageing.
        run: Means of the check run; those beyond the earlier model's envelope say nothing of it and do not count.

    Raises:
        InputError: None is within.
    """
    run = _within(expected.prior, run)
    left = run.bias_dph - expected.mean_dph(run.temperature_c, run.slope_c_per_min)
    values = expected.prior.basis.values(run.temperature_c, run.slope_c_per_min) * expected.prior.unit_dph
    covariance = values @ expected.covariance @ values.T + np.diag(run.sigma_dph**2 / run.count)
    factor = np.linalg.cholesky(covariance)
    shapes = list(_shapes(run))
    columns = np.linalg.solve(factor, np.array([s.values for s in shapes]).T)
    length = np.linalg.norm(columns, axis=0)
    columns = columns / length
    size = columns.T @ np.linalg.solve(factor, left)
    price = _prices(shapes)
    best = int(np.argmax(size**2 - price))
    p = _p_value(float(size[best] ** 2 - price[best]), columns, price)
    shape = shapes[best]
    change = _change(shape, float(size[best] / length[best]), float(1.0 / length[best]))
    return Held(p, change if p < FALSE_ALARM else None, tuple(_cells(run, left, covariance)))


def _within(prior: MapPrior, run: UnitMeans) -> UnitMeans:
    (t0, t1), (r0, r1) = prior.temperature_c, prior.slope_c_per_min
    t, r = run.temperature_c, run.slope_c_per_min
    inside = (t >= t0) & (t <= t1) & (r >= r0) & (r <= r1)
    if not inside.any():
        found = f"is nowhere within {t0:.1f} ... {t1:.1f} C and {r0:.2f} ... {r1:.2f} C/min"
        raise InputError("--prior", f"the check run {found}", "a run where the earlier model holds")
    return UnitMeans(t[inside], r[inside], run.bias_dph[inside], run.count[inside], run.sigma_dph)


def _shapes(run: UnitMeans) -> Iterator[_Shape]:
    """Ways in which a map may have changed, the simple ones first."""
    t, r = run.temperature_c, run.slope_c_per_min
    low, high = float(t.min()), float(t.max())
    span, rates = max(high - low, 1e-9), (float(r.min()), float(r.max()))
    yield _Shape("offset", (low, high), rates, np.ones(len(t)))
    yield _Shape("slope", (low, high), rates, (t - 0.5 * (low + high)) / span)
    if rates[1] - rates[0] > _STILL_C_PER_MIN:
        yield _Shape("rate", (low, high), rates, r / (rates[1] - rates[0]))
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


def _range(x: FloatArray) -> Span:
    return float(x.min()), float(x.max())


def _prices(shapes: list[_Shape]) -> FloatArray:
    """What a region has to explain more than a simple shape: there are many to choose from."""
    regions = sum(s.kind == "local" for s in shapes)
    return np.array([2.0 * np.log(max(regions, 1)) if s.kind == "local" else 0.0 for s in shapes])


def _p_value(statistic: float, columns: FloatArray, price: FloatArray) -> float:
    """Share of unchanged units whose largest size, its price paid, is as large."""
    values, vectors = np.linalg.eigh(columns.T @ columns)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    used = values > 1e-9 * values[-1]
    drawn = np.random.default_rng(_SEED).normal(size=(_DRAWS, int(used.sum()))) @ root[:, used].T
    beyond = int(np.sum(np.max(drawn**2 - price, axis=1) >= statistic))
    if beyond:
        return beyond / _DRAWS
    bound = float(np.sum(erfc(np.sqrt(np.maximum(statistic + price, 0.0) / 2.0))))  # Bonferroni
    return min(bound, 1.0 / _DRAWS)


def _cells(run: UnitMeans, left: FloatArray, covariance: FloatArray) -> Iterator[CheckedCell]:
    t, r = run.temperature_c, run.slope_c_per_min
    low, high = float(t.min()), float(t.max())
    edges = np.linspace(low, high, _CELLS + 1)
    number = np.clip(((t - low) / max(high - low, 1e-9) * _CELLS).astype(int), 0, _CELLS - 1)
    branch = np.sign(np.where(np.abs(r) > _STILL_C_PER_MIN, r, 0.0))
    parts = [(k, b) for k in range(_CELLS) for b in (-1.0, 0.0, 1.0) if np.any((number == k) & (branch == b))]
    reach = -float(ndtri(0.5 * FALSE_ALARM / len(parts)))  # Bonferroni
    for k, b in parts:
        there = (number == k) & (branch == b)
        weight = np.where(there, run.count, 0.0)
        weight = weight / weight.sum()
        found, limit = float(weight @ left), reach * float(np.sqrt(weight @ covariance @ weight))
        yield CheckedCell(
            temperature_c=(float(edges[k]), float(edges[k + 1])),
            slope_c_per_min=_range(r[there]),
            found_dph=found,
            limit_dph=limit,
            within=bool(abs(found) <= limit),
        )


def _change(shape: _Shape, size: float, sigma: float) -> MapChange:
    (t0, t1), (r0, r1) = shape.temperature_c, shape.slope_c_per_min
    figure = f"{size:+.2g} ± {sigma:.1g} deg/h (1 sigma)"
    where = f"{t0:.0f} ... {t1:.0f} C and {r0:.1f} ... {r1:.1f} C/min"
    text = {
        "offset": f"an offset of {figure}, the same everywhere",
        "slope": f"the slope over temperature: {figure} from {t0:.0f} to {t1:.0f} C",
        "rate": f"the dependence on dT/dt: {figure} from {r0:.1f} to {r1:.1f} C/min",
        "local": f"the map between {where}: {figure} in the middle",
    }[shape.kind]
    return MapChange(
        kind=shape.kind,  # type: ignore[arg-type]
        temperature_c=shape.temperature_c,
        slope_c_per_min=shape.slope_c_per_min,
        size_dph=size,
        standard_uncertainty_dph=sigma,
        text=text,
    )


_ROUNDS = 20  # of the search for a unit's parameters, as of a lot's
_SHAPE = (
    0.5  # of the constant's ageing, what depends on T: less makes a finding of every slow change of shape
)
_LEAST = 1e-6  # of the unit of coefficients: a process has sizes above 0


@dataclass(frozen=True, slots=True)
class EarlierPrior(MapPrior):
    """What a unit's earlier model says of it after ageing.

    Attributes:
        model_hash, date: Of the earlier model.
        ageing_dph, ageing_from: How far the bias may have moved, 1 sigma, deg/h, and where that comes from.
    """

    model_hash: str
    date: str | None
    ageing_dph: float
    ageing_from: str

    @property
    def key(self) -> str:
        return f"{self.model_hash} {self.ageing_dph!r}"

    def check_axis(self, axis: str | None) -> None:
        """Nothing to refuse: it was read for this axis."""

    def with_samples(
        self, samples: TrainingData, own: Scaling, serial: str, *, seed: int, average_s: float
    ) -> Given:
        """Tests the earlier model against a check run, and fits both together if it still holds.

        Args:
            samples: Cleaned samples of the check run.
            own: Their scaling.
            serial: The unit's.
            seed: Of the Kohonen network.
            average_s: Averaging of RMS figures, s.
        """
        alone, unit = seen_alone(samples, own)
        checked = held(self.alone(), unit)
        posterior = self.with_runs(unit)
        if checked.change is not None:
            use = _use(self, posterior, checked, None)
            return Given(None, [_moved(use)], prior=use)
        found = followed(samples, own, alone, unit, posterior, seed=seed, average_s=average_s)
        if isinstance(found, str):
            use = _use(self, posterior, checked, None)
            text = f"The earlier model is not used: a map with it is refused: {found}."
            finding = {"id": "map_refused", "text": text, "evidence": {"method": "prior"}}
            return Given(None, [finding], prior=use)
        use = _use(self, posterior, checked, found[1])
        return Given(found, [], "the earlier model still holds", prior=use, known=known_map(posterior))


def stated_sigma_dph(rows: FloatArray, envelope: Envelope, between_dph: float, means: UnitMeans) -> float:
    """1 sigma of a map as its table states it, RMS over the means of its calibration, deg/h.

    Args:
        rows: 1 sigma in cells of the envelope, a row for each of dT/dt, T ascending, with the scatter of power-ons.
        envelope: Ranges of T (C) and dT/dt (C/min).
        between_dph: Standard deviation of the constant from power-on to power-on, deg/h, which is taken off.
        means: Of its calibration.
    """
    inputs = (means.temperature_c, means.slope_c_per_min)
    i, j = (
        np.clip(((x - low) / max(high - low, 1e-9) * n).astype(int), 0, n - 1)
        for x, (low, high), n in zip(inputs, envelope, rows.shape[::-1], strict=True)
    )
    variance = float(np.average(rows[j, i] ** 2, weights=means.count)) - between_dph**2
    return float(np.sqrt(max(variance, 0.0)))


def posterior_of_means(
    means: UnitMeans, envelope: Envelope, between_dph: float, stated_dph: float = 0.0
) -> MapPosterior:
    """What recordings of a unit say of its map, the smoothness of which they tell themselves.

    Args:
        means: Of its calibration.
        envelope: Ranges of T (C) and dT/dt (C/min).
        between_dph: Standard deviation of its constant from power-on to power-on, deg/h.
        stated_dph: 1 sigma of the map as its table states it (`stated_sigma_dph`), which runs left out have calibrated:
            a posterior that claims less is widened to it.
    """
    center = float(np.average(means.bias_dph, weights=means.count))
    unit = float(np.sqrt(np.average((means.bias_dph - center) ** 2, weights=means.count))) or 1.0
    basis = LotBasis.over(*envelope)
    sums = sums_of([means], basis, center, unit)
    rest = PRIOR_LOG.copy()
    rest[0] = CONSTANT
    for number in range(_ROUNDS + 1):
        covariance = np.linalg.inv(np.diag(1.0 / basis.variance(rest)) + sums.precision[0])
        mean = covariance @ sums.moment[0]
        if number == 0:
            used = that_count(sums, basis.variance(rest))
            basis, sums = basis.only(used), sums.only(used)
        elif number < _ROUNDS:
            rest = fitted_parameters(basis, mean**2 + np.diag(covariance), 1.0, rest, free=False)
    asked = Asked(means.temperature_c, means.slope_c_per_min, means.count / means.count.sum(), between_dph)
    prior = MapPrior(
        basis, center, unit, *envelope, mean[None], covariance[None], np.ones(1), rest, asked, np.inf
    )
    known = prior.alone()
    wider = max(1.0, (stated_dph / known.rms_sigma_dph()) ** 2)
    return replace(known, covariance=wider * covariance)


def widened(
    posterior: MapPosterior, ageing_dph: float, ageing_from: str, model_hash: str, date: str | None
) -> EarlierPrior:
    """An earlier posterior as the prior of today: ageing is added, and the constant of another power-on."""
    old = posterior.prior
    moved = PRIOR_LOG.copy()
    sizes = np.array([1.0, _LEAST, _SHAPE, _LEAST]) * ageing_dph / old.unit_dph
    moved[[0, 1, 3, 5]] = np.log(np.maximum(sizes, _LEAST))
    covariance = posterior.covariance + np.diag(
        old.basis.variance(moved) if ageing_dph else 0.0 * posterior.mean
    )
    covariance[0, 0] += (old.asked.between_dph / old.unit_dph) ** 2
    return EarlierPrior(
        basis=old.basis,
        center_dph=old.center_dph,
        unit_dph=old.unit_dph,
        temperature_c=old.temperature_c,
        slope_c_per_min=old.slope_c_per_min,
        means=posterior.mean[None],
        covariances=covariance[None],
        share=np.ones(1),
        rest=old.rest,
        asked=old.asked,
        freedom=np.inf,
        model_hash=model_hash,
        date=date,
        ageing_dph=ageing_dph,
        ageing_from=ageing_from,
    )


def posterior_of_known(known: KnownMap, where: str) -> MapPosterior:
    """The posterior that `training.json` holds.

    Raises:
        InputError: The file contradicts itself.
    """
    basis = LotBasis.read(known.functions)
    lower = triangle(known.covariance, len(basis.kept), f"{where}, known")
    covariance = lower + np.tril(lower, -1).T
    asked = [np.array(x) for x in (known.asked_temperature_c, known.asked_slope_c_per_min, known.asked_share)]
    if len({len(x) for x in asked}) != 1 or not (asked[2].size and asked[2].min() >= 0.0 < asked[2].sum()):
        raise InputError(
            f"{where}, known, asked_share", "lists that do not go together", "a share for each place"
        )
    if len(known.mean) != len(basis.kept):
        raise InputError(
            f"{where}, known, mean", f"{len(known.mean)} numbers", f"{len(basis.kept)}, one a function"
        )
    check_positive(covariance, f"{where}, known")
    prior = MapPrior(
        basis=basis,
        center_dph=known.center_dph,
        unit_dph=known.unit_dph,
        temperature_c=known.temperature_c,
        slope_c_per_min=known.slope_c_per_min,
        means=np.array(known.mean)[None],
        covariances=covariance[None],
        share=np.ones(1),
        rest=processed(known.rest),
        asked=Asked(asked[0], asked[1], asked[2], known.between_dph),
        freedom=np.inf,
    )
    return prior.alone()


def _use(prior: EarlierPrior, posterior: MapPosterior, checked: Held, scaling: Scaling | None) -> EarlierUse:
    """`scaling`: of the map that was made with the earlier model; None: there is none."""
    alone = prior.alone()
    before, after = alone.rms_sigma_dph(), posterior.rms_sigma_dph()
    use = EarlierUse(
        model_hash=prior.model_hash,
        date=prior.date,
        ageing_dph=prior.ageing_dph,
        ageing_from=prior.ageing_from,
        p_value=checked.p_value,
        false_alarm=FALSE_ALARM,
        confirmed=checked.change is None,
        accepted=scaling is not None,
        change=checked.change,
        cells=checked.cells,
        own_share=1.0 - (after / before) ** 2 if scaling is not None and before > 0.0 else None,
        prior_sigma_dph=before,
        sigma_dph=after,
        curve=curve_of(alone, posterior, scaling) if scaling is not None else None,
        text="",
    )
    return use.model_copy(update={"text": _text(use)})


def _text(use: EarlierUse) -> str:
    of = f"the model {use.model_hash[:16]}" + (f" of {use.date}" if use.date else "")
    aged = f"ageing of {use.ageing_dph:.2g} deg/h (1 sigma; {use.ageing_from})"
    if use.change is not None:
        return f"{of} no longer holds (p = {use.p_value:.2g}) beyond {aged}: {use.change.text}"
    inside = sum(cell.within for cell in use.cells)
    parts = f"{inside} of {len(use.cells)} parts within limits"
    text = f"{of} is confirmed within its sigma and {aged}: p = {use.p_value:.2g}, {parts}"
    if not use.accepted:
        return text
    return f"{text}; {use.prior_sigma_dph:.2g} deg/h (1 sigma over the envelope) became {use.sigma_dph:.2g}"


def _moved(use: EarlierUse) -> dict[str, Any]:
    change = use.change
    return {
        "id": "prior_does_not_hold",
        "text": f"The earlier model no longer holds: {change.text if change else ''} (p = {use.p_value:.2g}; of one in "
        f"{1.0 / use.false_alarm:.0f} units that have not changed this is said). The correction was made from the new "
        "recordings alone; where they do not reach, nothing is known any more. Record the whole programme again, or "
        "look for what happened to the unit.",
        "evidence": {"p_value": use.p_value, "false_alarm": use.false_alarm, "model": use.model_hash},
    }
