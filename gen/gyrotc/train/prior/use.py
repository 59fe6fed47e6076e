"""Prior of a unit's map, its update with the runs, and the fit with it.

The posterior over the envelopes of prior and unit takes the place of the process of the unit alone.

The network that a table holds follows the posterior as it follows the process of a unit alone: same compression, same
proofs. What the posterior may be wrong by becomes the table's sigma.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...common.arrays import FloatArray
from ...common.errors import InputError
from ...results.fleet import KnownMap, Lot, LotProcess, LotUse, UnitCurve
from ..data import Bins, Scaling, TrainingData, average_samples
from ..gaussian import TrainingFailed
from ..mrbf import fit_mrbf
from ..objection import objection_to
from ..process import MEAN_S, Asked, Process, fit_process
from ..result import Outcome
from .basis import PARAMETERS, PriorBasis
from .given import Given, UnitSamples
from .learn import FALSE_ALARM, evidence, freedom_of, p_value, scores, student_variance, sums_of
from .unit_means import UnitMeans, means_of_unit

_DIGITS = 7  # of coefficients: 1e-7 of the lot's spread is nothing


@dataclass(frozen=True, slots=True)
class MapPrior:
    """Prior of a unit's map: a mixture of normal distributions of its coefficients.

    Attributes:
        basis: Functions of T and dT/dt.
        center_dph, unit_dph: Zero and unit of the coefficients, deg/h.
        temperature_c, slope_c_per_min: Envelope, C and C/min.
        means, covariances: Of the coefficients, one for each cluster.
        share: Of units in each cluster.
        rest: Log parameters of the smooth process of what is a unit's own (`basis.PARAMETERS`).
        asked: Where corrections are asked for.
        freedom: Degrees of freedom of the spread.
        own: Variances of what a power-on has of its own, of the first coefficients; empty: they are not known.
    """

    basis: PriorBasis
    center_dph: float
    unit_dph: float
    temperature_c: tuple[float, float]
    slope_c_per_min: tuple[float, float]
    means: FloatArray
    covariances: FloatArray
    share: FloatArray
    rest: FloatArray
    asked: Asked
    freedom: float
    own: FloatArray

    def with_runs(self, unit: UnitMeans) -> MapPosterior:
        """Update the prior with recordings of a unit, and test by their p-value whether the unit fits it."""
        sums = sums_of([unit], self.basis, self.center_dph, self.unit_dph, self.own)
        precision, moment = sums.precision[0], sums.moment[0]
        found, likely, p = [], [], []
        for mean, covariance, share in zip(self.means, self.covariances, self.share, strict=True):
            shrunk = np.linalg.inv(np.linalg.inv(covariance) + precision)
            found.append((mean + shrunk @ (moment - precision @ mean), shrunk))
            likely.append(float(evidence(sums, mean, covariance)[0]) + float(np.log(share)))
            # The test allows for the few units by itself.
            factor = np.linalg.cholesky(covariance / student_variance(self.freedom))
            p.append(p_value(*scores(precision, moment, mean, factor), self.freedom))
        weight = np.exp(np.array(likely) - max(likely))
        weight /= weight.sum()
        mean, covariance = _mixed(found, weight)
        return MapPosterior(self, mean, covariance, int(np.argmax(weight)), max(p))

    def alone(self) -> MapPosterior:
        """Return the map before any run."""
        mean, covariance = _mixed([*zip(self.means, self.covariances, strict=True)], self.share)
        return MapPosterior(self, mean, covariance, 0, 1.0)


@dataclass(frozen=True, slots=True)
class MapPosterior:
    """A normal distribution of a unit's coefficients.

    Attributes:
        prior: Where it comes from.
        mean, covariance: Shapes (n,) and (n, n), in units of the prior.
        cluster: Number of the cluster that fits best.
        p_value: Probability that a unit that fits the prior lies as far from it as the recordings do.
    """

    prior: MapPrior
    mean: FloatArray
    covariance: FloatArray
    cluster: int
    p_value: float

    def mean_dph(self, temperature_c: FloatArray, slope_c_per_min: FloatArray) -> FloatArray:
        """Mean map, deg/h."""
        values = self.prior.basis.values(temperature_c, slope_c_per_min)
        return np.asarray(self.prior.center_dph + self.prior.unit_dph * (values @ self.mean))

    def variance_dph2(self, temperature_c: FloatArray, slope_c_per_min: FloatArray) -> FloatArray:
        """Its variance, (deg/h)²."""
        values = self.prior.basis.values(temperature_c, slope_c_per_min)
        return np.asarray(self.prior.unit_dph**2 * np.sum((values @ self.covariance) * values, axis=1))

    def rms_sigma_dph(self) -> float:
        """1 sigma, RMS over where corrections are asked for, deg/h."""
        asked = self.prior.asked
        variance = self.variance_dph2(asked.temperature_c, asked.slope_c_per_min)
        return float(np.sqrt(np.average(variance, weights=asked.share)))


def _mixed(found: list[tuple[FloatArray, FloatArray]], weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance of a mixture."""
    mean = np.einsum("c,ci->i", weight, np.array([m for m, _ in found]))
    spread = [w * (v + np.outer(m - mean, m - mean)) for w, (m, v) in zip(weight, found, strict=True)]
    return np.asarray(mean), np.asarray(np.sum(spread, axis=0))


def processed(process: LotProcess) -> FloatArray:
    """Log parameters of a process as a file holds it."""
    return np.asarray(np.log([getattr(process, name) for name in PARAMETERS]))


def process_result(log_parameters: FloatArray) -> LotProcess:
    """Return the process of these logarithms."""
    return LotProcess(**{n: float(v) for n, v in zip(PARAMETERS, np.exp(log_parameters), strict=True)})


def file_numbers(values: FloatArray) -> tuple[float, ...]:
    """Numbers as a file tells them."""
    return tuple(float(f"{v:.{_DIGITS}g}") for v in values)


def triangle(rows: tuple[tuple[float, ...], ...], n: int, where: str) -> FloatArray:
    """The lower triangle that a field of a file holds row by row, shape (n, n).

    Raises:
        InputError: A row has another length.
    """
    lower = np.zeros((n, n))
    if [len(row) for row in rows] != list(range(1, n + 1)):
        raise InputError(where, "rows of other lengths", f"a lower triangle of {n} rows")
    for k, row in enumerate(rows):
        lower[k, : k + 1] = row
    return lower


def check_positive(covariance: FloatArray, where: str) -> None:
    """Refuse what is no covariance.

    Raises:
        InputError: It is none.
    """
    try:
        np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        raise InputError(f"{where}, covariance", "is not positive definite", "a covariance") from None


_CURVE = 41  # points of the picture
_KEPT_DIGITS = 6  # of its numbers


@dataclass(frozen=True, slots=True)
class _PosteriorMap:
    """A posterior in standardised units of a fit; what the compression and the table's sigma ask of a process."""

    posterior: MapPosterior
    scaling: Scaling
    center: float
    spread: float
    sigma: float
    freedom: float

    @property
    def scales(self) -> tuple[float, float]:
        """Shortest scales of what a unit differs by, which are those of the lot's rest; normalised."""
        _, _, _, _, _, short, _, of_t, of_r = np.exp(self.posterior.prior.rest)
        basis = self.posterior.prior.basis
        by_t = basis.half_range_c / self.scaling.half_range_c
        by_r = basis.half_range_c_per_min / self.scaling.half_range_c_per_min
        return float(min(short, of_t) * by_t), float(of_r * by_r)

    def mean(self, t: FloatArray, r: FloatArray) -> FloatArray:
        return (self.posterior.mean_dph(*self._physical(t, r)) - self.center) / self.spread

    def roots(self, t: FloatArray, r: FloatArray) -> FloatArray:
        prior = self.posterior.prior
        values = prior.basis.values(*self._physical(t, r))
        return np.asarray(prior.unit_dph / self.spread * values @ square_root(self.posterior.covariance))

    def _physical(self, t: FloatArray, r: FloatArray) -> tuple[FloatArray, FloatArray]:
        s = self.scaling
        return s.center_c + s.half_range_c * np.asarray(t), s.half_range_c_per_min * np.asarray(r)


@dataclass(frozen=True, slots=True)
class LotPrior(MapPrior):
    """Prior of an unseen unit from its lot.

    Attributes:
        lot: The file.
    """

    lot: Lot

    @property
    def key(self) -> str:
        return self.lot.checksum

    def check_axis(self, axis: str | None) -> None:
        """Refuse the recordings of another axis.

        Raises:
            InputError: They are of another.
        """
        if self.lot.axis != axis:
            raise InputError("--lot", f"of axis {self.lot.axis}", f"a lot of axis {axis}, as the recordings")

    def with_samples(self, samples: UnitSamples, *, seed: int, average_s: float) -> Given:
        """Test whether a unit belongs to its lot, and fit it with the lot if it does.

        Args:
            samples: Of the unit; if its serial is one of the lot, this is reported.
            seed: Of the Kohonen network.
            average_s: Averaging of RMS figures, s.
        """
        own, serial = samples.scaling, samples.serial
        alone, unit = seen_alone(samples)
        posterior = self.with_runs(unit)
        if posterior.p_value < FALSE_ALARM:
            use = _use(self, posterior, serial, accepted=False, scaling=own)
            text = (
                f"The unit does not fit its lot (p = {use.p_value:.2g}; one in {1.0 / use.false_alarm:.0f} of its "
                "units is refused), so it was calibrated without it, from its own runs alone. Look for what makes it "
                "differ: another design, another batch of mirrors, the wrong lot, a fault."
            )
            evidence = {"p_value": use.p_value, "false_alarm": use.false_alarm, "lot": use.checksum}
            return Given(None, [{"id": "not_of_its_lot", "text": text, "evidence": evidence}], lot=use)
        found = network_of_posterior(samples, alone, unit, posterior, seed=seed, average_s=average_s)
        if isinstance(found, str):
            use = _use(self, posterior, serial, accepted=False, scaling=own)
            text = f"The lot is not used: a map with it is refused: {found}."
            return Given(None, [{"id": "map_refused", "text": text, "evidence": {"method": "lot"}}], lot=use)
        use = _use(self, posterior, serial, accepted=True, scaling=found[1])
        return Given(found, [], "the unit fits its lot", lot=use, known=known_map(posterior))


def prior_of(lot: Lot, where: str = "lot.json") -> LotPrior:
    """The prior that a file holds.

    Raises:
        InputError: The file contradicts itself: lengths that differ, a covariance that is none.
    """
    basis = PriorBasis.read(lot.functions)
    kept = basis.kept
    directions = np.array(lot.directions, dtype=np.float64).reshape(-1, len(kept)) if kept.size else np.zeros((0, 0))
    rest = np.diag(basis.variance(processed(lot.rest))) + directions.T @ directions
    freedom = freedom_of(sum(c.units for c in lot.clusters), len(lot.clusters), len(directions))
    scale = lot.cross_validation.spread_scale * student_variance(freedom)
    means, covariances = _of_clusters(lot, scale, rest, where)
    sizes = np.array([cluster.units for cluster in lot.clusters], dtype=np.float64)
    if not (sizes > 0.0).all():
        raise InputError(f"{where}, clusters", "one without units", "units in each")
    shares = sizes / sizes.sum()
    return LotPrior(
        basis=basis,
        center_dph=lot.center_dph,
        unit_dph=lot.unit_dph,
        temperature_c=lot.temperature_c,
        slope_c_per_min=lot.slope_c_per_min,
        means=means,
        covariances=covariances,
        share=shares,
        rest=processed(lot.rest),
        asked=_asked(lot, where),
        freedom=freedom,
        own=np.array([(lot.between_dph / lot.unit_dph) ** 2]),
        lot=lot,
    )


def _of_clusters(lot: Lot, scale: float, rest: FloatArray, where: str) -> tuple[FloatArray, FloatArray]:
    """Means and covariances of a new unit's coefficients, one for each cluster."""
    n = len(lot.functions.kept)
    means, covariances = [], []
    for number, cluster in enumerate(lot.clusters):
        at = f"{where}, clusters, {number}"
        lower = triangle(cluster.covariance, n, f"{at}, covariance")
        if len(cluster.mean) != n:
            raise InputError(f"{at}, mean", f"{len(cluster.mean)} numbers", f"{n}, one a function")
        covariance = scale * (rest + lower + np.tril(lower, -1).T)
        check_positive(covariance, at)
        means.append(np.array(cluster.mean))
        covariances.append(covariance)
    return np.array(means), np.array(covariances)


def _asked(lot: Lot, where: str) -> Asked:
    """Centers of the cells in which units were."""
    rows = {len(row) for row in lot.occupancy}
    shares = np.array(lot.occupancy, dtype=np.float64) if len(rows) == 1 else np.zeros((0, 0))
    if shares.size == 0 or shares.min() < 0.0 or not shares.sum() > 0.0:
        raise InputError(f"{where}, occupancy", "rows that differ in length, or no shares", "shares of time")
    n_r, n_t = shares.shape
    t, r = np.meshgrid(_centers(lot.temperature_c, n_t), _centers(lot.slope_c_per_min, n_r))
    there = shares > 0.0
    return Asked(t[there], r[there], shares[there] / shares.sum(), lot.between_dph)


def _centers(span: tuple[float, float], n: int) -> FloatArray:
    return np.asarray(span[0] + (np.arange(n) + 0.5) / n * (span[1] - span[0]))


def network_of_posterior(
    samples: UnitSamples,
    alone: Process | None,
    unit: UnitMeans,
    posterior: MapPosterior,
    *,
    seed: int,
    average_s: float,
) -> tuple[Outcome, Scaling] | str:
    """The network that follows a posterior over the envelopes of prior and unit, or why it must not be used.

    Args:
        samples: Of the unit.
        alone: The process of the unit alone, for its outliers.
        unit: The unit's means.
        posterior: What prior and means say together.
        seed, average_s: As for `fit`.
    """
    cleaned, scaling = samples.cleaned, _over_both(samples.scaling, posterior.prior)
    process = _process(cleaned, scaling, alone, unit, posterior)
    try:
        outcome = fit_mrbf(cleaned, scaling, seed=seed, centers=None, average_s=average_s, process=process)
        against = objection_to(outcome, cleaned, scaling, average_s)
    except TrainingFailed as failure:
        return str(failure)
    return against or (outcome, scaling)


def seen_alone(samples: UnitSamples) -> tuple[Process | None, UnitMeans]:
    """The process of a unit alone, None where it cannot be solved, and the unit's means, those of each power-on."""
    cleaned, scaling, power_on = samples.cleaned, samples.scaling, samples.power_on
    number = np.arange(int(cleaned.run.max()) + 1) if power_on is None else power_on
    try:
        alone = fit_process(cleaned, scaling, number)
    except TrainingFailed:
        alone = None
    return alone, means_of_unit(cleaned, scaling, alone, number)[0]


def _over_both(own: Scaling, prior: MapPrior) -> Scaling:
    """Scaling over the envelope of the prior and of the unit's own samples."""
    (a, b), (c, d) = own.temperature_c, prior.temperature_c
    t0, t1 = min(a, c), max(b, d)
    (a, b), (c, d) = own.slope_c_per_min, prior.slope_c_per_min
    r0, r1 = min(a, c), max(b, d)
    half_c, half_r = max(0.5 * (t1 - t0), own.half_range_c), max(-r0, r1, own.half_range_c_per_min)
    return Scaling(0.5 * (t0 + t1), half_c, half_r, (t0, t1), (r0, r1))


def _process(
    samples: TrainingData, scaling: Scaling, alone: Process | None, unit: UnitMeans, posterior: MapPosterior
) -> Process:
    """The posterior in the form of a process that has seen the unit's means, asked where the lot's units were."""
    means = average_samples(samples, MEAN_S)
    weight = means.weight / np.median(means.weight)
    center = float(np.average(means.bias_dph, weights=weight))
    asked = posterior.prior.asked
    variance = posterior.variance_dph2(asked.temperature_c, asked.slope_c_per_min)
    whole = posterior.mean_dph(asked.temperature_c, asked.slope_c_per_min)
    spread = float(np.sqrt(np.average((whole - center) ** 2, weights=asked.share))) or 1.0
    sigma = unit.sigma_dph / spread
    freedom = len(means) * float(np.average(variance, weights=asked.share)) / unit.sigma_dph**2
    model = _PosteriorMap(posterior, scaling, center, spread, sigma, freedom)
    t, r = scaling.normalise(means.temperature_c, means.slope_c_per_min)
    at = scaling.normalise(asked.temperature_c, asked.slope_c_per_min)
    kept = alone.kept if alone is not None and len(alone.kept) == len(means) else np.ones(len(means), dtype=bool)
    return Process(
        model=model,
        bins=Bins(*at, len(means) * asked.share, model.mean(*at), 0.0, float(len(means))),
        t=t,
        r=r,
        y=(means.bias_dph - center) / spread,
        weight=weight,
        run=means.run,
        kept=kept,
        center=center,
        spread=spread,
        seconds=float(np.median(means.duration_s)),
        asked=asked,
    )


def _use(prior: LotPrior, posterior: MapPosterior, serial: str, *, accepted: bool, scaling: Scaling) -> LotUse:
    lot, alone = prior.lot, prior.alone()
    before, after = alone.rms_sigma_dph(), posterior.rms_sigma_dph()
    share = 1.0 - (after / before) ** 2 if before > 0.0 else 0.0
    use = LotUse(
        checksum=lot.checksum,
        units=sum(c.units for c in lot.clusters),
        member=any(unit.serial == serial for unit in lot.units),
        cluster=posterior.cluster,
        p_value=posterior.p_value,
        accepted=accepted,
        false_alarm=FALSE_ALARM,
        text="",
        own_share=share if accepted else None,
        prior_sigma_dph=before,
        sigma_dph=after,
        curve=curve_of(alone, posterior, scaling) if accepted else None,
    )
    return use.model_copy(update={"text": _text(use, len(lot.clusters))})


def _text(use: LotUse, clusters: int) -> str:
    of = f"a lot of {use.units} units" + (f" (cluster {use.cluster + 1} of {clusters})" if clusters > 1 else "")
    if not use.accepted:
        return f"not used: these runs lie farther from {of} than {1.0 - use.p_value:.1%} of its units do"
    seen = "; this unit is one of them" if use.member else ""
    return (
        f"{of} leaves {use.prior_sigma_dph:.2g} deg/h (1 sigma over the envelope), with this unit's own runs "
        f"{use.sigma_dph:.2g}: they removed {use.own_share or 0.0:.0%} of its variance{seen}"
    )


def curve_of(alone: MapPosterior, posterior: MapPosterior, scaling: Scaling) -> UnitCurve:
    """Prior and posterior where temperature stands still, for the picture."""
    t = np.linspace(*scaling.temperature_c, _CURVE)
    still = np.zeros(_CURVE)

    def rounded(values: FloatArray) -> tuple[float, ...]:
        return tuple(float(f"{v:.{_KEPT_DIGITS}g}") for v in values)

    return UnitCurve(
        temperature_c=rounded(t),
        prior_dph=rounded(alone.mean_dph(t, still)),
        prior_sigma_dph=rounded(np.sqrt(alone.variance_dph2(t, still))),
        posterior_dph=rounded(posterior.mean_dph(t, still)),
        posterior_sigma_dph=rounded(np.sqrt(posterior.variance_dph2(t, still))),
    )


def known_map(posterior: MapPosterior) -> KnownMap:
    """A posterior as `training.json` holds it."""
    prior = posterior.prior
    basis, asked = prior.basis, prior.asked
    return KnownMap(
        temperature_c=prior.temperature_c,
        slope_c_per_min=prior.slope_c_per_min,
        center_dph=prior.center_dph,
        unit_dph=prior.unit_dph,
        functions=basis.result(),
        mean=file_numbers(posterior.mean),
        root=tuple(file_numbers(row[: k + 1]) for k, row in enumerate(_lower_root(posterior.covariance))),
        rest=process_result(prior.rest),
        asked_temperature_c=file_numbers(asked.temperature_c),
        asked_slope_c_per_min=file_numbers(asked.slope_c_per_min),
        asked_share=file_numbers(asked.share),
        own=file_numbers(np.sqrt(prior.own)),
        own_freedom=asked.freedom,
    )


def square_root(covariance: FloatArray) -> FloatArray:
    """Return a square root of a covariance, whose smallest variances may be lost in rounding."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _lower_root(covariance: FloatArray) -> FloatArray:
    """Return the square root that is a lower triangle."""
    upper = np.asarray(np.linalg.qr(square_root(covariance).T, mode="r"))
    return np.asarray(upper.T)
