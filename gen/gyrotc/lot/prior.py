"""What is known of a unit's map before its runs and with them, and whether the unit fits its lot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..results.lot import LotProcess
from ..train.evidence import Asked
from ..train.means import UnitMeans
from .basis import PARAMETERS, LotBasis
from .learn import evidence, of_few, p_value, scores, sums_of

_DIGITS = 7  # of coefficients: 1e-7 of the lot's spread is nothing


@dataclass(frozen=True, slots=True)
class MapPrior:
    """What is known of a unit's map before its runs: a mixture of normal distributions of its coefficients.

    Attributes:
        basis: Functions of T and dT/dt.
        center_dph, unit_dph: Zero and unit of the coefficients, deg/h.
        temperature_c, slope_c_per_min: Envelope, C and C/min.
        means, covariances: Of the coefficients, one for each cluster.
        share: Of units in each cluster.
        rest: Log parameters of the smooth process of what is a unit's own (`basis.PARAMETERS`).
        asked: Where corrections are asked for.
        freedom: Degrees of freedom of the spread.
    """

    basis: LotBasis
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

    def with_runs(self, unit: UnitMeans) -> MapPosterior:
        """What prior and recordings of a unit say together, and how far the unit is from the prior."""
        sums = sums_of([unit], self.basis, self.center_dph, self.unit_dph)
        precision, moment = sums.precision[0], sums.moment[0]
        found, likely, p = [], [], []
        for mean, covariance, share in zip(self.means, self.covariances, self.share, strict=True):
            shrunk = np.linalg.inv(np.linalg.inv(covariance) + precision)
            found.append((mean + shrunk @ (moment - precision @ mean), shrunk))
            likely.append(float(evidence(sums, mean, covariance)[0]) + float(np.log(share)))
            factor = np.linalg.cholesky(covariance / of_few(self.freedom))  # the test counts the few by itself
            p.append(p_value(*scores(precision, moment, mean, factor), self.freedom))
        weight = np.exp(np.array(likely) - max(likely))
        weight /= weight.sum()
        mean, covariance = _mixed(found, weight)
        return MapPosterior(self, mean, covariance, int(np.argmax(weight)), max(p))

    def alone(self) -> MapPosterior:
        """What is known before any run."""
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
    """The same the other way round."""
    return LotProcess(**{n: float(v) for n, v in zip(PARAMETERS, np.exp(log_parameters), strict=True)})


def rounded(values: FloatArray) -> tuple[float, ...]:
    """Numbers as a file tells them."""
    return tuple(float(f"{v:.{_DIGITS}g}") for v in values)


def triangle(rows: tuple[tuple[float, ...], ...], n: int, where: str) -> FloatArray:
    """The lower triangle that a file holds row by row, shape (n, n).

    Raises:
        InputError: A row has another length.
    """
    lower = np.zeros((n, n))
    if [len(row) for row in rows] != list(range(1, n + 1)):
        raise InputError(f"{where}, covariance", "rows of other lengths", f"a lower triangle of {n} rows")
    for k, row in enumerate(rows):
        lower[k, : k + 1] = row
    return lower


def check_positive(covariance: FloatArray, where: str) -> None:
    """Refuses what is no covariance.

    Raises:
        InputError: It is none.
    """
    try:
        np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        raise InputError(f"{where}, covariance", "is not positive definite", "a covariance") from None
