"""Learning in service: how biases differ by the power-ons of a unit, and a simulated service (docs/numerics.md, 9)."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize, nnls

from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..common.inputs import read_input
from ..mirror.learning import KEPT_WORDS, KNOTS, Learner, ServicePrior, Stop, full
from ..model import BiasSpread, Learning, Model, load_model
from ..results.files import write_atomically
from ..results.fleet import LotAgeing
from ..results.folder import result_folder
from ..results.recordings import Parking
from ..tables.emit import MONTH_H, emitted_tables, prior_of, service_prior, walk
from ..train.data import TrainingData, scaling_of
from ..train.evidence import TrainingFailed
from ..train.methods import fit
from ..train.prior.unit_means import unit_means
from ..train.prior.use import MapPosterior
from ..train.result import predict

if TYPE_CHECKING:
    from typing_extensions import Self

_LOG_SPREAD = 0.5  # standard deviation of a logarithm about its start: an order of magnitude is 4.6 of them
_FARTHEST = 4.6  # of a logarithm from its start: two orders of magnitude
_STEPS = 40  # of the search: it ends before
_STEP_S = 300.0  # of a simulated service: a row
_MOST_POWER_ONS = 10_000  # of a simulated service: a day each in 27 years
_LEAST_POWER_ONS = 3  # with two, each tells of the other alone
_STOPS = 240  # of past power-ons, in all: the likelihood is asked for hundreds of times
_PARKINGS_MIN = (1.0, 10.0, 60.0, 480.0)  # a stop, a break, an hour, a night


@dataclass(frozen=True)
class PowerOn:
    """Stops after one switching on: time since then in s, shape (n,), temperature in C, mean rates (n, axes) in deg/h,
    the table's bias taken off."""

    time_s: FloatArray
    temp_c: FloatArray
    rate_dph: FloatArray


def _innovations(
    spread: BiasSpread, past: Sequence[Sequence[PowerOn]], envelope_c: tuple[float, float], center_c: float, var: float
) -> tuple[FloatArray, FloatArray]:
    """Innovations of all stops, (n, axes), and their variances for a scale of 1, by the filter in float64."""
    known = Learning(spread=spread, reference_c=center_c, authority_dph=1.0, noise_deg_per_sqrt_h=1.0)
    prior = replace(
        service_prior(known, envelope_c), noise_var=var, authority_dph=np.inf, span_c=np.inf, gate_square=np.inf
    )
    found, variances = [], []
    for runs in past:
        learner = Learner(prior, runs[0].rate_dph.shape[1], np.float64)
        for run in runs:
            learner.power_on(np.nan, run.temp_c[0])
            for time_s, temp_c, rate in zip(run.time_s, run.temp_c, run.rate_dph, strict=True):
                learner.rest(Stop(time_s, temp_c, rate, 1.0))
                found.append(learner.innovation)
                variances.append(learner.innovation_var[0])
    return np.array(found), np.array(variances)


def fitted_spread(
    start: BiasSpread,
    past: Sequence[Sequence[PowerOn]],
    envelope_c: tuple[float, float],
    center_c: float,
    noise_dph: float,
) -> tuple[BiasSpread, FloatArray]:
    """Maximum likelihood of the innovations of past power-ons, all axes together, about `start`.

    Ageing stays as it was: power-ons of one day do not show it.

    Args:
        start: A guess within an order of magnitude.
        past: Power-ons that have one table, for each table.
        envelope_c: Where the knots lie, C.
        center_c: Where the table was made level, C.
        noise_dph: Of the mean of a stop, deg/h.

    Returns:
        The spread for a scale of 1, and each axis' scale, shape (axes,).
    """
    names = [n for n, f in BiasSpread.model_fields.items() if f.is_required() and getattr(start, n) > 0.0]
    begin = np.log([getattr(start, name) for name in names])

    def spread_at(x: FloatArray) -> BiasSpread:
        return start.model_copy(update={name: float(np.exp(v)) for name, v in zip(names, x, strict=True)})

    def scales(spread: BiasSpread) -> tuple[FloatArray, FloatArray]:
        nu, s = _innovations(spread, past, envelope_c, center_c, noise_dph**2)
        return np.mean(nu**2 / s[:, None], axis=0), s

    def cost(x: FloatArray) -> float:
        square, s = scales(spread_at(x))
        data = 0.5 * len(square) * np.log(s).sum() + 0.5 * len(s) * np.log(square).sum()
        return float(data + 0.5 * np.sum(((x - begin) / _LOG_SPREAD) ** 2))

    bounds = [(x - _FARTHEST, x + _FARTHEST) for x in begin]
    best = minimize(cost, begin, method="L-BFGS-B", bounds=bounds, options={"maxiter": _STEPS})
    spread = spread_at(best.x)
    return spread, np.sqrt(scales(spread)[0])


def spread_of_power_ons(
    start: BiasSpread, means: TrainingData, method: str, envelope_c: tuple[float, float], center_c: float, where: str
) -> BiasSpread:
    """As a unit's own power-ons show it: what the map of the others leaves of each, by maximum likelihood.

    Args:
        start: A guess within an order of magnitude; what is 0 in it stays so.
        means: Of training, `run` being the power-on.
        method: By which the map is made.
        envelope_c: Where the knots lie, C.
        center_c: Where the table is known best.
        where: Of the limits file.

    Raises:
        InputError: There are fewer than three power-ons, or no map without one of them.
    """
    numbers = np.unique(means.run)
    if len(numbers) < _LEAST_POWER_ONS:
        raise InputError(where, f"{len(numbers)} training runs", f"{_LEAST_POWER_ONS} at least: each is a power-on")
    step, past = -(-len(means) // _STOPS), []
    for number in numbers:
        one = means.select(means.run == number)
        try:
            others = fit(means.select(means.run != number), method=method)
        except TrainingFailed as failure:
            raise InputError(
                where, f"no map of the others without run {number + 1}: {failure}", "another prior"
            ) from failure
        left = one.bias_dph - predict(others, one.temperature_c, one.slope_c_per_min)
        past.append([PowerOn(one.time_s[::step], one.temperature_c[::step], left[::step, None])])
    noise = unit_means(means, scaling_of(means), None)[0].sigma_dph
    spread, scale = fitted_spread(start, past, envelope_c, center_c, noise)
    return spread.scaled(float(scale[0]))


def spread_of_lot(
    stated: BiasSpread, known: MapPosterior, ageing: LotAgeing | None, envelope_c: tuple[float, float], center_c: float
) -> BiasSpread:
    """As lot and own runs leave a unit's map open where temperature stands still, and as units of the lot age.

    Args:
        stated: All else.
        known: The unit's map.
        ageing: None: as stated.
        envelope_c: Where the knots lie, C.
        center_c: Where the table is known best, C.
    """
    knots = np.linspace(*envelope_c, KNOTS)
    z = knots - center_c
    pairs = np.stack([one.ravel() for one in (np.ones((KNOTS, KNOTS)), np.outer(z, z), walk(z))], axis=1)
    left = covariance_at(known, knots)
    parts = nnls(pairs, left.ravel())[0]
    parts *= np.trace(left) / np.trace((pairs @ parts).reshape(KNOTS, KNOTS))  # as much variance as there is
    found = dict(zip(("level", "slope", "shape"), np.sqrt(parts).tolist(), strict=True))
    if ageing is not None:
        hourly = float(np.sqrt(MONTH_H))
        found["ageing"] = ageing.level_dph_per_sqrt_month / hourly
        found["ageing_shape"] = ageing.shape_dph_per_sqrt_month_c / hourly
    return stated.model_copy(update=found)


def covariance_at(known: MapPosterior, temperature_c: FloatArray) -> FloatArray:
    """Covariance of a map where temperature stands still, (deg/h)²."""
    values = known.prior.basis.values(temperature_c, np.zeros(len(temperature_c))) * known.prior.unit_dph
    return np.asarray(values @ known.covariance @ values.T)


@dataclass(frozen=True)
class Moved:
    """How far the map of a unit moved between two calibrations: at temperatures, with covariance, in months."""

    temperature_c: FloatArray
    moved_dph: FloatArray
    covariance: FloatArray
    months: float


def fitted_ageing(moves: Sequence[Moved], center_c: float) -> tuple[float, float]:
    """Ageing of the level and along T by maximum likelihood, deg/h/√month and deg/h/√(month C)."""
    size = float(np.sqrt(np.mean([np.mean(one.moved_dph**2) / one.months for one in moves]))) or 1e-12

    def cost(x: FloatArray) -> float:
        level, shape = (size * x) ** 2
        total = 0.0
        for one in moves:
            of_time = level + shape * walk(one.temperature_c - center_c)
            factor = np.linalg.cholesky(one.covariance + one.months * of_time)
            total += 0.5 * float(np.sum(np.linalg.solve(factor, one.moved_dph) ** 2))
            total += float(np.log(np.diag(factor)).sum())
        return total

    span = float(np.ptp(np.concatenate([one.temperature_c for one in moves])))
    starts = [(a, b / np.sqrt(span)) for a in (0.03, 0.7) for b in (0.03, 0.7)]
    found = [minimize(cost, x, method="L-BFGS-B", bounds=[(0.0, None)] * 2) for x in starts]
    level, shape = size * min(found, key=lambda one: one.fun).x
    return float(level), float(shape)


class Corrector(Protocol):
    """What corrects the table, of all axes at once. Times in s: of the clock, since power-on."""

    def power_on(self, clock_s: float, temp_c: float) -> None: ...

    def rest(
        self, clock_s: float, time_s: float, temp_c: float, rate: FloatArray, var: float, last_s: float
    ) -> None: ...

    def shift(self, clock_s: float, time_s: float, temp_c: float) -> tuple[FloatArray, FloatArray]: ...


class LearningUnit:
    """The unit of the runtime."""

    def __init__(self, prior: ServicePrior, axes: int) -> None:
        self.unit, self.off_s = Learner(prior, axes), float(np.nan)
        self.refused, self.status = 0, np.zeros(axes, dtype=np.int64)

    def power_on(self, clock_s: float, temp_c: float) -> None:
        self.unit.power_on(clock_s - self.off_s, temp_c)
        self.off_s = clock_s

    def rest(self, clock_s: float, time_s: float, temp_c: float, rate: FloatArray, var: float, last_s: float) -> None:
        noise = float(self.unit.prior.noise_var) / last_s
        self.status = self.unit.rest(Stop(time_s, temp_c, rate, last_s, mean_var=var if var > noise else 0.0))
        self.refused += int((self.status < 0).sum())
        self.off_s = clock_s

    def shift(self, clock_s: float, time_s: float, temp_c: float) -> tuple[FloatArray, FloatArray]:
        y, sigma = self.unit.shift(time_s, temp_c)
        return y.astype(np.float64), sigma.astype(np.float64)


@dataclass(frozen=True)
class Mission:
    """A power-on: instants since then, temperatures, number of the stop (-1: under way), true biases (n, axes)."""

    clock_s: float
    time_s: FloatArray
    temp_c: FloatArray
    stop: NDArray[np.int64]
    bias: FloatArray


@dataclass(frozen=True)
class Service:
    """What a gyro goes through: deg/h, 1 sigma; ageing in a month of the constant, half of it in the map's shape.

    Attributes:
        mounted: Numbers of power-ons before which it was mounted anew: its level and shape are drawn again.
    """

    table_dph: float
    turn_on_dph: float
    ageing_dph: float
    power_ons: int = 100
    envelope_c: tuple[float, float] = (-40.0, 60.0)
    mounted: tuple[int, ...] = ()

    @classmethod
    def of(cls, learning: Learning, envelope_c: tuple[float, float], power_ons: int, mounted: tuple[int, ...]) -> Self:
        """Of a gyro as its prior expects it."""
        spread = learning.spread
        level = np.sqrt(np.mean(np.diag(full(service_prior(learning, envelope_c).map_var))))
        ageing = spread.ageing * float(np.sqrt(MONTH_H))
        return cls(float(level), spread.turn_on, ageing, power_ons, envelope_c, mounted)


def missions(draw: np.random.Generator, axes: int, service: Service) -> list[Mission]:
    """A gyro's power-ons, a day to three apart: what its table leaves, its turn-on offsets and its ageing."""
    low, high = service.envelope_c
    span = high - low
    center, width = draw.uniform(low, high, (axes, 4)), draw.uniform(0.15 * span, 0.3 * span, (axes, 4))

    def shape(temp_c: FloatArray, height: FloatArray) -> FloatArray:
        z = (temp_c[:, None, None] - center) / width
        return np.asarray((height * np.exp(-0.5 * z**2)).sum(axis=2))

    def table_error() -> FloatArray:
        height = draw.normal(size=(axes, 4))
        rms = np.sqrt(np.mean(shape(np.linspace(low, high, 60), height) ** 2, axis=0))
        return np.asarray(height * (service.table_dph / rms)[:, None])

    height, aged, level = table_error(), np.zeros((axes, 4)), np.zeros(axes)
    found, clock_s = [], 0.0
    for number in range(service.power_ons):
        gap_s = draw.uniform(1, 3) * 86400.0
        clock_s += gap_s
        months = np.sqrt(gap_s / 3600.0 / MONTH_H)
        level = level + draw.normal(0, service.ageing_dph, axes) * months
        aged = aged + draw.normal(0, service.ageing_dph / 2, (axes, 4)) * months
        if number in service.mounted:
            height = table_error()
        time_s, temp_c, stop = _mission(draw, low, span)
        bias = shape(temp_c, height + aged) + level + draw.normal(0, service.turn_on_dph, axes)
        found.append(Mission(clock_s, time_s, temp_c, stop, bias))
        clock_s += time_s[-1]
    return found


def _mission(draw: np.random.Generator, low: float, span: float) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Hours of driving and stops of minutes: times, temperatures, number of the stop (-1: under way)."""
    n = int(draw.uniform(4, 10) * 3600 / _STEP_S)
    time_s = np.arange(n) * _STEP_S
    wander, speed = np.zeros(n), 0.0
    for i in range(1, n):
        speed = speed * np.exp(-_STEP_S / 2400.0) + draw.normal(0, 0.0045 * span * np.sqrt(_STEP_S / 120.0))
        wander[i] = wander[i - 1] * np.exp(-_STEP_S / 7200.0) + speed
    warm = draw.uniform(0.15 * span, 0.25 * span) * (1 - np.exp(-time_s / 2400.0))
    temp_c = np.clip(draw.uniform(low + 0.05 * span, low + 0.7 * span) + warm + wander, low, low + span)
    stop, i, number = np.full(n, -1), 0, 0
    while i < n:
        length = max(1, round(draw.uniform(60, 1800) / _STEP_S))
        stop[i : i + length] = number
        number, i = number + 1, i + length + int(draw.uniform(1, 4) * 3600 / _STEP_S)
    return np.asarray(time_s, dtype=np.float64), np.asarray(temp_c), stop


Spoil = Callable[[int, FloatArray, float], FloatArray]


def served(
    service: Sequence[Mission], method: Corrector, draw: np.random.Generator, arw: float, spoil: Spoil | None = None
) -> tuple[FloatArray, FloatArray]:
    """Errors under way and stated sigmas, (n, axes)."""
    errors, sigmas = [], []
    for number, mission in enumerate(service):
        method.power_on(mission.clock_s, float(mission.temp_c[0]))
        i, n = 0, len(mission.time_s)
        while i < n:
            clock_s = mission.clock_s + mission.time_s[i]
            if mission.stop[i] < 0:
                y, sigma = method.shift(clock_s, mission.time_s[i], float(mission.temp_c[i]))
                errors.append(mission.bias[i] - y)
                sigmas.append(sigma)
                i += 1
                continue
            j = i + int(np.argmin(np.append(mission.stop[i:] == mission.stop[i], False)))
            last_s = (j - i) * _STEP_S
            var = arw**2 / (last_s / 3600.0)
            rate = mission.bias[i:j].mean(axis=0) + draw.normal(0, np.sqrt(var), mission.bias.shape[1])
            if spoil is not None:
                rate = spoil(number, rate, var)
            temp_c = float(mission.temp_c[i:j].mean())
            method.rest(clock_s + last_s - _STEP_S, float(mission.time_s[j - 1]), temp_c, rate, var, last_s)
            i = j
    return np.array(errors), np.array(sigmas)


class _Recorded(LearningUnit):
    """Keeps a row of each stop: power-on, h on the clock, s since power-on, C, s, deg/h, status, shift and sigma."""

    def __init__(self, prior: ServicePrior) -> None:
        super().__init__(prior, 1)
        self.rows: list[str] = []

    def rest(self, clock_s: float, time_s: float, temp_c: float, rate: FloatArray, var: float, last_s: float) -> None:
        super().rest(clock_s, time_s, temp_c, rate, var, last_s)
        y, sigma = self.shift(clock_s, time_s, temp_c)
        self.rows.append(
            f"{self.unit.power_ons},{clock_s / 3600.0:.3f},{time_s:.1f},{temp_c:.3f},{last_s:.1f},{rate[0]:.9g},"
            f"{self.status[0]},{y[0]:.9g},{sigma[0]:.9g}"
        )


_HEAD = "power_on,clock_h,time_s,temperature_c,duration_s,rate_dph,status,shift_dph,sigma_dph"
_WORDS_A_ROW = 6  # of the text: 53 characters a line


@dataclass(frozen=True)
class Simulated:
    """RMS under way, deg/h, of the table alone and of what was learned; RMS of error over stated sigma."""

    table_dph: float
    learned_dph: float
    over_sigma: float


def learning_in(unit: Path) -> tuple[Model, Learning, ServicePrior]:
    """A unit's model, what its firmware may learn, and the prior that was emitted with its table.

    Raises:
        InputError: There is no result, or its table has no `learning`.
    """
    model = load_model(unit / "model.json")
    prior = prior_of(model, emitted_tables(unit / "c", model))
    if model.learning is None or prior is None:
        raise InputError(str(unit / "model.json"), "has no learning", "a build with [learning] in its limits file")
    return model, model.learning, prior


def simulate_service(unit: Path, out: Path, seed: int, power_ons: int, mounted: Sequence[int]) -> Simulated:
    """Power-ons of a unit with hours of driving, parkings and ageing: writes the stops, and the words that it keeps.

    Raises:
        InputError: As `learning_in`, or a number cannot be.
    """
    if not 1 <= power_ons <= _MOST_POWER_ONS:
        raise InputError("--power-ons", str(power_ons), f"1 ... {_MOST_POWER_ONS}")
    model, learning, prior = learning_in(unit)
    service = Service.of(learning, model.envelope.temperature_c, power_ons, tuple(mounted))
    found, method = missions(np.random.default_rng(seed), 1, service), _Recorded(prior)
    of_noise = np.random.default_rng([seed, 1])
    errors, sigmas = served(found, method, of_noise, learning.noise_deg_per_sqrt_h)
    plain = np.concatenate([one.bias[one.stop < 0] for one in found])
    with result_folder(out, "simulate") as stage:
        stage.of(model.serial, model.axis)
        write_atomically(stage.folder / "stops.csv", "\n".join([_HEAD, *method.rows]) + "\n")
        write_atomically(stage.folder / "learned.txt", words_text(method.unit.save()))
    return Simulated(*(float(np.sqrt(np.mean(x**2))) for x in (plain, errors, errors / sigmas)))


def words_text(words: Sequence[int]) -> str:
    """Kept words as firmware prints them: hexadecimal."""
    shown = [f"{word:08x}" for word in words]
    return "".join(" ".join(shown[k : k + _WORDS_A_ROW]) + "\n" for k in range(0, len(shown), _WORDS_A_ROW))


def words_in(path: Path) -> list[int]:
    """The kept words of an axis.

    Raises:
        InputError: They are not 48 hexadecimal words of 32 bits.
    """
    words = read_input(path, "text_mib", "words of learning in service").decode("ascii", "replace").split()
    found = [int(word, 16) for word in words if re.fullmatch(r"(0[xX])?[0-9a-fA-F]{1,8}", word)]
    if len(found) != len(words) or len(found) != KEPT_WORDS:
        raise InputError(str(path), f"{len(found)} of {len(words)}", f"{KEPT_WORDS} hexadecimal words of 32 bits")
    return found


def parkings(learning: Learning, envelope_c: tuple[float, float]) -> tuple[Parking, ...]:
    """What a first parking is worth by its length: sigma of the correction right after it, where the table is level."""
    prior, found = service_prior(learning, envelope_c), []
    for minutes in _PARKINGS_MIN:
        learner = Learner(prior)
        time_s, temp_c = learning.settle_s + 60.0 * minutes, learning.reference_c
        learner.power_on(np.nan, temp_c)
        before = learner.shift(time_s, temp_c)[1][0]
        learner.rest(Stop(time_s, temp_c, 0.0, 60.0 * minutes))
        after = learner.shift(time_s, temp_c)[1][0]
        found.append(Parking(minutes=minutes, before_dph=float(before), after_dph=float(after)))
    return tuple(found)
