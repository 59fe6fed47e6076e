"""A linear Gaussian model of the bias over temperature and its rate, with what each power-on has of its own.

    y = x(T, dT/dt)' (b + b_g) + noise,   b ~ N(0, V),   b_g ~ N(0, D) for every power-on g

The columns x are a constant, a line and a curve in T (Legendre polynomials), a slope in dT/dt, and sines: of T alone,
and of T and dT/dt multiplied (a Hilbert-space Gaussian process; Solin and Sarkka, Statistics and Computing 30, 2020).
The candidates of model selection are leading columns: the constant, the first five, all of them. A power-on has
leading columns of its own: its intercept, or also line, curve and slope (a linear mixed model; Laird and Ware,
Biometrics 38, 1982). Of a single power-on nothing tells these from the map, so it has none.

V, D and the noise are the most probable ones: variances follow from few logarithms of sizes and scales with broad
log-normal priors, b and b_g are integrated out. Inputs are normalised, y is in units of its spread.

All that the model needs of a piece of history are its sums of products (`Sums`); a piece is left out by subtraction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import lapack

from ..common.arrays import FloatArray
from ..common.errors import GyrotcError

FEW = 5
"""The constant, line, two powers of the curve, slope."""
# Sines of T alone, and of T and dT/dt multiplied. The shortest wave is 0.14 half ranges: 7 C over -40 ... 60 C.
_OF_T = 40
_COUPLED = (8, 6)
COLUMNS = FEW + _OF_T + _COUPLED[0] * _COUPLED[1]
# Half length of the domain over the largest input: the sines vanish at its ends.
_REACH = 1.4
_MIN_REACH = 1e-3
_MIN_RATE = 1e-6

FREE = 100.0
"""Variance of the constant, in squares of the spread of the bias: as good as free."""
# A column that is not used keeps the equations solvable.
_MIN_VARIANCE = 1e-10

# Means and standard deviations of the logarithms, in units of the spread and of half ranges. A gyro's line is about the
# spread, its curve and its slope a third and a seventh of it; less is known of the smooth part.
_PRIOR_OF_FEW = ((0.0, 1.0), (-1.0, 1.0), (-2.0, 1.0))  # line, curve, slope
_PRIOR_OF_SMOOTH = (
    (np.log(0.3), 1.5),  # size over T
    (np.log(0.15), 0.7),  # scale over T
    (np.log(0.3), 1.5),  # size of the coupled part
    (np.log(0.8), 0.5),  # its scale over T
    (np.log(0.8), 0.5),  # its scale over dT/dt
)
# What a power-on has of its own, in units of the noise of a mean: a third of it, give or take a factor of seven.
_PRIOR_OF_OWN = (np.log(0.3), 2.0)
# The noise is known from differences of neighbouring means to a factor of e.
_NOISE_SD = 1.0
# Prior standard deviations that are searched to either side.
_SEARCHED = 5.0
# The search for a smooth map has two starts: a short scale and the map as expected; a long scale, less map, more of the
# power-ons' own. That for a candidate of few columns begins where the smooth map ended.
_START_SCALES = (0.08, 0.35)
_LESS_MAP, _MORE_OWN = 1.5, 1.0
_STOP = 1e-3  # of the log posterior
_MAX_STEPS = 80

# Which of the three variances each of the first columns behind the constant has.
_PART = (0, 1, 1, 2)
# The same of what a power-on has of its own, whose constant has a variance, too.
_OWN_PART = np.array([0, *(1 + part for part in _PART)])


class TrainingFailed(GyrotcError):
    """The equations of a fit could not be solved, or what came out must not be used; the text says why."""


@dataclass(frozen=True, slots=True)
class Basis:
    """Units of the columns: RMS of dT/dt for the slope, half lengths of the domain of the sines (all normalised)."""

    rate: float
    reach_t: float
    reach_r: float

    @staticmethod
    def over(t: FloatArray, r: FloatArray) -> Basis:
        """Return the basis over normalised inputs."""
        reach_t, reach_r = (_REACH * max(float(np.abs(x).max()), _MIN_REACH) for x in (t, r))
        return Basis(max(float(np.sqrt(np.mean(r**2))), _MIN_RATE), reach_t, reach_r)

    def columns(self, t: FloatArray, r: FloatArray, n: int = COLUMNS) -> FloatArray:
        """Return the first n columns at normalised inputs, shape (points, n)."""
        x = np.empty((len(t), n))
        x[:, 0] = 1.0
        if n >= FEW:
            x[:, 1], x[:, 4] = t, r / self.rate
            x[:, 2], x[:, 3] = 1.5 * t**2 - 0.5, 0.25 * t * (5.0 * t**2 - 3.0)
        if n > FEW:
            of_t, of_r = _sines(t, self.reach_t, _OF_T), _sines(r, self.reach_r, _COUPLED[1])
            x[:, FEW : FEW + _OF_T] = of_t
            coupled = of_t[:, : _COUPLED[0], None] * of_r[:, None, :]
            x[:, FEW + _OF_T :] = coupled.reshape(len(t), -1)
        return x


def _sines(x: FloatArray, reach: float, n: int) -> FloatArray:
    """Return sines of 1 to n half waves over the domain, by recurrence."""
    angle = 0.5 * np.pi / reach * (x + reach)
    twice_cos = 2.0 * np.cos(angle)
    out = np.empty((n, len(x)))
    before, now = np.zeros(len(x)), np.sin(angle) / np.sqrt(reach)
    for j in range(n):
        out[j] = now
        before, now = now, twice_cos * now - before
    return np.asarray(out.T)


@dataclass(frozen=True, slots=True)
class Sums:
    """Sums of products over the means of a piece of history.

    Attributes:
        products: X' W X, shape (columns, columns).
        moments: X' W y, shape (columns,).
        squares: y' W y.
        samples: Number of independent means.
    """

    products: FloatArray
    moments: FloatArray
    squares: float
    samples: float

    @staticmethod
    def over(x: FloatArray, y: FloatArray, weight: FloatArray) -> Sums:
        """Return the sums over means, one a row of x."""
        weighted = x * weight[:, None]
        return Sums(weighted.T @ x, weighted.T @ y, float(weight @ y**2), float(len(y)))

    def __add__(self, other: Sums) -> Sums:
        return Sums(
            self.products + other.products,
            self.moments + other.moments,
            self.squares + other.squares,
            self.samples + other.samples,
        )

    def __sub__(self, other: Sums) -> Sums:
        return self + other.times(-1.0)

    def times(self, factor: float) -> Sums:
        """Return the sums of a piece that counts so many times."""
        return Sums(factor * self.products, factor * self.moments, factor * self.squares, factor * self.samples)


@dataclass(frozen=True, slots=True)
class Structure:
    """Columns of a candidate.

    Attributes:
        columns: Leading columns of the map: 1, `FEW` or `COLUMNS`.
        own: Leading columns that a power-on has of its own: 0, 1 or `FEW`; no more than the map has.
    """

    columns: int
    own: int

    @property
    def map_parameters(self) -> int:
        return len(_PRIOR_OF_FEW) * (self.columns >= FEW) + len(_PRIOR_OF_SMOOTH) * (self.columns > FEW)

    @property
    def own_parameters(self) -> int:
        return min(self.own, 1) + len(_PRIOR_OF_FEW) * (self.own >= FEW)

    def prior(self, white: float) -> tuple[FloatArray, FloatArray]:
        """Return means and standard deviations of all logarithms; `white`: the noise that differences show."""
        of_map = (*_PRIOR_OF_FEW, *_PRIOR_OF_SMOOTH)[: self.map_parameters]
        mean, sd = _PRIOR_OF_OWN
        of_own = ((mean + np.log(white), sd),) * self.own_parameters
        return tuple(np.array((*of_map, *of_own, (np.log(white), _NOISE_SD)), dtype=np.float64).T)

    def variances(self, p: FloatArray, basis: Basis) -> tuple[FloatArray, FloatArray]:
        """Return the variance of each coefficient of the map, and its derivatives by the logarithms."""
        variance = np.full(self.columns, FREE)
        slope = np.zeros((self.columns, self.map_parameters))
        for k, part in enumerate(_PART[: self.columns - 1], 1):
            variance[k] = np.exp(2.0 * p[part])
            slope[k, part] = 2.0 * variance[k]
        if self.columns > FEW:
            size, scale, both, both_t, both_r = np.exp(p[3:8])
            of_t = slice(FEW, FEW + _OF_T)
            variance[of_t], slope[of_t, 4] = _density(size, scale, _OF_T, basis.reach_t)
            slope[of_t, 3] = 2.0 * variance[of_t]
            a, by_a = _density(both, both_t, _COUPLED[0], basis.reach_t)
            b, by_b = _density(1.0, both_r, _COUPLED[1], basis.reach_r)
            coupled = slice(FEW + _OF_T, COLUMNS)
            variance[coupled] = np.outer(a, b).ravel()
            slope[coupled, 5] = 2.0 * variance[coupled]
            slope[coupled, 6], slope[coupled, 7] = np.outer(by_a, b).ravel(), np.outer(a, by_b).ravel()
        return variance + _MIN_VARIANCE, slope

    def scatter(self, p: FloatArray) -> FloatArray:
        """Return the variances of what a power-on has of its own."""
        of = np.exp(2.0 * p[self.map_parameters : self.map_parameters + self.own_parameters])
        return np.asarray(of[_OWN_PART[: self.own]])


def _density(size: float, scale: float, n: int, reach: float) -> tuple[FloatArray, FloatArray]:
    """Return the spectral density of a squared-exponential process at n sines, and its derivative by log scale."""
    square = (scale * 0.5 * np.pi / reach * np.arange(1, n + 1)) ** 2
    density = size**2 * np.sqrt(2.0 * np.pi) * scale * np.exp(-0.5 * square)
    return density, density * (1.0 - square)


@dataclass(frozen=True)
class GaussianMap:
    """The posterior of a candidate with its most probable variances.

    Attributes:
        structure: What it is made of.
        basis: Its columns.
        power_ons: Sums of every power-on.
        p: Logarithms of sizes and scales; the last is that of the noise.
        value: Negative log posterior of them, up to a constant.
        evaluations: Number of evaluations of the search.
        coefficients: Mean of b, shape (columns,).
        factor: Square root of the covariance of b: covariance = factor factor'.
    """

    structure: Structure
    basis: Basis
    power_ons: tuple[Sums, ...]
    p: FloatArray
    value: float
    evaluations: int
    coefficients: FloatArray = field(init=False)
    factor: FloatArray = field(init=False)
    _whole: tuple[FloatArray, FloatArray] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_whole", self._equations(self.power_ons))
        h, lower, coefficients = self._solved(*self._whole)
        inverse = lapack.dtrtri(lower, lower=1)[0]
        object.__setattr__(self, "coefficients", coefficients)
        object.__setattr__(self, "factor", self.sigma * h[:, None] * inverse.T)

    @property
    def sigma(self) -> float:
        """Noise of a mean of weight 1."""
        return float(np.exp(self.p[-1]))

    def logarithms_of(self, part: Structure) -> FloatArray:
        """Return the sizes and scales of this map that a candidate of fewer columns has, too."""
        of_map, of_own = part.map_parameters, part.own_parameters
        own = self.p[self.structure.map_parameters :]
        return np.concatenate([self.p[:of_map], own[:of_own], self.p[-1:]])

    @property
    def freedom(self) -> float:
        """Effective number of coefficients."""
        variance = self.structure.variances(self.p, self.basis)[0]
        return float(self.structure.columns - np.sum(np.sum(self.factor**2, axis=1) / variance))

    @property
    def scatter(self) -> FloatArray:
        """Variances of the coefficients that a power-on has of its own, shape (own,)."""
        return self.structure.scatter(self.p)

    @property
    def scales(self) -> tuple[float, float]:
        """Shortest scales over T and dT/dt on which the map forgets, normalised; infinite without a smooth part."""
        if self.structure.columns <= FEW:
            return np.inf, np.inf
        _, scale, _, both_t, both_r = np.exp(self.p[3:8])
        return float(min(scale, both_t)), float(both_r)

    def mean(self, t: FloatArray, r: FloatArray) -> FloatArray:
        """Return the mean map at normalised inputs."""
        return self.basis.columns(t, r, self.structure.columns) @ self.coefficients

    def roots(self, t: FloatArray, r: FloatArray) -> FloatArray:
        """Return rows of which the inner products are the covariances of the map at normalised inputs."""
        return self.basis.columns(t, r, self.structure.columns) @ self.factor

    def own(self) -> FloatArray:
        """Return the mean of what each power-on has of its own, shape (power-ons, own)."""
        own, noise = self.structure.own, np.exp(2.0 * self.p[-1])
        found = np.zeros((len(self.power_ons), own))
        for g, sums in enumerate(self.power_ons if own else ()):
            left = sums.moments[:own] - sums.products[:own, : self.structure.columns] @ self.coefficients
            inner = sums.products[:own, :own] / noise + np.diag(1.0 / self.scatter)
            found[g] = np.linalg.solve(inner, left / noise)
        return found

    def without(self, power_on: int, left_out: Sums) -> FloatArray:
        """Return the coefficients without a piece of a power-on, with the variances of the whole history."""
        whole = self.power_ons[power_on]
        rest = whole - left_out
        precision, moment = (a - b for a, b in zip(self._whole, self._equations([whole]), strict=True))
        if rest.samples > 0.5:
            precision, moment = (a + b for a, b in zip((precision, moment), self._equations([rest]), strict=True))
        elif len(self.power_ons) == 1:
            raise TrainingFailed("nothing remains to train on")
        return self._solved(precision, moment)[2]

    def _equations(self, power_ons: Sequence[Sums]) -> tuple[FloatArray, FloatArray]:
        """Return the normal equations of b, times the noise variance, with what power-ons have of their own out."""
        n, own, noise = self.structure.columns, self.structure.own, np.exp(2.0 * self.p[-1])
        precision, moment = _total(power_ons, n)
        if own:
            one = _Integrated.of(power_ons, n, own, self.scatter, noise)
            precision = precision - one.coupling.T @ one.coupling / noise
            moment = moment - one.coupling.T @ one.moment / noise
        return precision, moment

    def _solved(self, precision: FloatArray, moment: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return roots of the prior variances, the Cholesky factor of the scaled equations, and the mean of b."""
        h = np.sqrt(self.structure.variances(self.p, self.basis)[0])
        scaled = h[:, None] * precision * h
        scaled.flat[:: len(h) + 1] += np.exp(2.0 * self.p[-1])
        lower, failed = lapack.dpotrf(scaled, lower=1)
        if failed:
            raise TrainingFailed("the posterior of the map is not positive definite")
        return h, lower, h * lapack.dpotrs(lower, h * moment, lower=1)[0]


def sum_of(pieces: Sequence[Sums]) -> Sums:
    """Return the sums over all pieces."""
    total = pieces[0]
    for other in pieces[1:]:
        total = total + other
    return total


def _total(power_ons: Sequence[Sums], n: int) -> tuple[FloatArray, FloatArray]:
    total = sum_of(power_ons)
    return total.products[:n, :n], total.moments[:n]


@dataclass(frozen=True, slots=True)
class _Integrated:
    """Normal equations with each power-on's own coefficients integrated out, stacked over power-ons.

    Attributes:
        inverse: Inverses of the Cholesky factors of I + root HH root / noise, shape (power-ons, own, own).
        coupling: inverse root HX, shape (power-ons * own, columns).
        moment: inverse root Hy, shape (power-ons * own,).
        root: Roots of the variances, shape (own,).
    """

    inverse: FloatArray
    coupling: FloatArray
    moment: FloatArray
    root: FloatArray

    @staticmethod
    def of(power_ons: Sequence[Sums], n: int, own: int, scatter: FloatArray, noise: float) -> _Integrated:
        joint = np.array([np.column_stack([s.products[:own, :n], s.moments[:own]]) for s in power_ons])
        return _Integrated.stacked(joint, own, scatter, noise)

    @staticmethod
    def stacked(joint: FloatArray, own: int, scatter: FloatArray, noise: float) -> _Integrated:
        """`joint`: HX and Hy of every power-on, shape (power-ons, own, columns + 1)."""
        root = np.sqrt(scatter)
        inner = np.eye(own) + root[:, None] * joint[:, :, :own] * root / noise
        inverse = np.asarray(np.linalg.inv(np.linalg.cholesky(inner)))
        both = np.asarray(inverse @ (root[:, None] * joint)).reshape(-1, joint.shape[2])
        return _Integrated(inverse, both[:, :-1], both[:, -1], root)


class VarianceSearch:
    """The posterior of the logarithms of a candidate's sizes and scales.

    Args:
        structure: What the candidate is made of.
        basis: Its columns.
        power_ons: Sums of every power-on.
        white: Noise of a mean as differences show it.
        least: Bound of the noise from below.
    """

    def __init__(
        self, structure: Structure, basis: Basis, power_ons: Sequence[Sums], white: float, least: float = 0.0
    ) -> None:
        self.structure, self.basis, self.power_ons = structure, basis, tuple(power_ons)
        n, own = structure.columns, structure.own
        self._products, self._moments = _total(power_ons, n)
        self._squares = sum(s.squares for s in power_ons)
        self._samples = sum(s.samples for s in power_ons)
        self._joint = np.array([np.column_stack([s.products[:own, :n], s.moments[:own]]) for s in power_ons])
        self.mean, self.sd = structure.prior(white)
        self.low, self.high = self.mean - _SEARCHED * self.sd, self.mean + _SEARCHED * self.sd
        if least > 0.0:
            self.low[-1] = min(max(self.low[-1], np.log(least)), self.high[-1])

    def objective(self, p: FloatArray) -> tuple[float, FloatArray]:
        """Return the negative log posterior up to a constant, and its gradient; infinite where it cannot be had."""
        s, n, own = self.structure, self.structure.columns, self.structure.own
        noise = float(np.exp(2.0 * p[-1]))
        variance, slope = s.variances(p, self.basis)
        h = np.sqrt(variance)
        precision, moment = self._products, self._moments
        fitted, log_determinant = self._squares, 0.0
        one = None
        if own:
            one = _Integrated.stacked(self._joint, own, s.scatter(p), noise)
            precision = precision - one.coupling.T @ one.coupling / noise
            moment = moment - one.coupling.T @ one.moment / noise
            fitted -= float(one.moment @ one.moment) / noise
            log_determinant = -float(np.log(np.diagonal(one.inverse, axis1=1, axis2=2)).sum())
        scaled = h[:, None] * precision * h
        scaled.flat[:: n + 1] += noise
        lower, failed = lapack.dpotrf(scaled, lower=1)
        if failed:
            return np.inf, np.zeros(len(p))
        hm = h * moment
        alpha = lapack.dpotrs(lower, hm, lower=1)[0]
        beta = h * alpha
        off = (p - self.mean) / self.sd
        value = 0.5 * (fitted - hm @ alpha) / noise + float(np.log(np.diagonal(lower)).sum()) + log_determinant
        value += (self._samples - n) * p[-1] + 0.5 * float(off @ off)
        if not np.isfinite(value):
            return np.inf, np.zeros(len(p))
        inverse = lapack.dtrtri(lower, lower=1)[0]
        share = noise * np.einsum("ij,ij->j", inverse, inverse)
        gradient = off / self.sd
        m = s.map_parameters
        gradient[:m] += (0.5 * (1.0 - share - alpha**2) / variance) @ slope
        used = n - float(share.sum())
        square = self._squares - 2.0 * beta @ self._moments + beta @ self._products @ beta
        if one is not None:
            more, by_own, of_own = self._own_terms(one, beta, h, inverse, noise)
            gradient[m : m + s.own_parameters] += np.bincount(_OWN_PART[:own], by_own, s.own_parameters)
            used += of_own
            square += more
        gradient[-1] += self._samples - used - square / noise
        return value, gradient

    def _own_terms(
        self, one: _Integrated, beta: FloatArray, h: FloatArray, inverse: FloatArray, noise: float
    ) -> tuple[float, FloatArray, float]:
        """Return what b_g changes of the squared residual, derivatives by its variances, and its effective number."""
        groups, own = one.inverse.shape[:2]
        upper = np.swapaxes(one.inverse, 1, 2)
        left = (one.moment - one.coupling @ beta).reshape(groups, own, 1)
        standard = (upper @ left)[:, :, 0] / noise
        by_map = (upper @ one.coupling.reshape(groups, own, -1)).reshape(groups * own, -1) * (h / noise)
        spread = noise * np.sum((inverse @ by_map.T) ** 2, axis=0).reshape(groups, own)
        remaining = np.sum(upper**2, axis=2) + spread
        u = one.root * standard
        hh, hx, hy = self._joint[:, :, :own], self._joint[:, :, :-1], self._joint[:, :, -1]
        more = -2.0 * np.sum(u * hy) + np.einsum("gi,gij,gj->", u, hh, u) + 2.0 * np.sum(u * (hx @ beta))
        by_own = np.sum(1.0 - remaining - standard**2, axis=0)
        return float(more), by_own, float(groups * own - remaining.sum())

    def starts(self) -> list[FloatArray]:
        """Return where the search for a smooth map begins: see `_START_SCALES`."""
        s = self.structure
        usual, less = self.mean.copy(), self.mean.copy()
        if s.own:
            less[: len(_PRIOR_OF_FEW)] -= _LESS_MAP
            less[s.map_parameters : -1] += _MORE_OWN
        usual[4], less[4] = np.log(_START_SCALES)
        return [usual, less]

    def best(self, start: FloatArray | None = None) -> GaussianMap:
        """Return the candidate with its most probable variances.

        Args:
            start: Where to begin; None: at the two starts of a smooth map.

        Raises:
            TrainingFailed: The equations cannot be solved.
        """
        from scipy.optimize import minimize  # 0.1 s to import

        # Steps along which the posterior is about equally curved: n means know the logarithm of their noise to
        # 1/sqrt(2 n), and few coefficients stand behind each of the other logarithms.
        step = np.ones(len(self.mean))
        step[-1] = 1.0 / np.sqrt(1.0 + 2.0 * self._samples)

        def in_steps(z: FloatArray) -> tuple[float, FloatArray]:
            value, gradient = self.objective(z * step)
            return value, gradient * step

        best, evaluations = None, 0
        for free in self.starts() if start is None else [start]:
            begin = np.clip(free, self.low, self.high)
            scale = max(abs(self.objective(begin)[0]), 1.0)
            found = minimize(
                in_steps,
                begin / step,
                jac=True,
                method="L-BFGS-B",
                bounds=list(zip(self.low / step, self.high / step, strict=True)),
                options={"maxiter": _MAX_STEPS, "ftol": _STOP / scale if np.isfinite(scale) else 1e-9},
            )
            evaluations += int(found.nfev)
            if np.isfinite(found.fun) and (best is None or found.fun < best.fun):
                best = found
        if best is None:
            raise TrainingFailed("the model of the map cannot be solved")
        p = np.clip(best.x * step, self.low, self.high)
        return GaussianMap(self.structure, self.basis, self.power_ons, p, float(best.fun), evaluations)
