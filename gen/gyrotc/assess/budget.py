"""Uncertainty of figures from recordings, and the uncertainty budget of a correction (JCGM 100:2008).

The measurand is true bias less correction, at a moment of use inside the calibrated envelope at which the correction
is neither held nor clamped; noise of the rate is not part of it. What recordings say of the map (noise, fit, power-on)
is the variance that training gave the table, as an average over the recordings that the unit is judged by; the rest
is stated by certificates, proven, or seen in earlier calibrations.

Figures are known by type A evaluations (4.2 there). Noise of a gyro is not white: neighbouring means belong together,
so that the number of means says too much. RMS, standard deviation, mean and improvement come from a delete-one-block
jackknife (Efron and Stein 1981) over blocks of two hours, whose scatter holds whatever correlation is shorter. Figures
of windows (30 min, 1 h) and of the first ten minutes are the root mean square of few normal numbers; the largest of
many follows the extreme-value distribution of Gumbel.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from datetime import date
from itertools import pairwise
from typing import Final, Literal

import numpy as np
from scipy.special import log_ndtr

from .. import __version__
from ..common.arrays import FloatArray
from ..common.metrics import FIRST_S, HALF_HOUR_S, HOUR_S, Averages, jackknife_blocks
from ..common.statistics import coverage_factor
from ..model import Model, Rules
from ..recordings.fit_options import SIMPLE
from ..results.evaluation import PARTS, Calibration, Changes, EvaluatedRun, Evaluation, FigureUncertainty
from ..results.release import Budget, Contribution, Instrument, Verification
from ..results.training import Training
from .limits import Limits, instruments_in, last_day

_STEP = 0.01  # of the range of temperatures, for the map's gradient
DAYS_A_YEAR = 365.25  # the Julian year
AGEING: Final = "ageing"  # the contribution of that name
KnownFigure = tuple[float, float | None]
"""A contribution, deg/h, and its degrees of freedom (None: many)."""


def combined(parts: Sequence[KnownFigure]) -> KnownFigure:
    """Combined standard uncertainty and effective degrees of freedom (JCGM 100:2008, 5.1.2 and G.2b)."""
    variance = math.fsum(u**2 for u, _ in parts)
    few = math.fsum(u**4 / freedom for u, freedom in parts if freedom is not None)
    return math.sqrt(variance), variance**2 / few if few > 0.0 else None


def part(
    id: Literal["noise", "fit", "unseen", "turn_on", "thermometer", "reference", "arithmetic", "ageing"],
    text: str,
    u: float,
    source: str,
    *,
    unit: str = "deg/h",
    sensitivity: float = 1.0,
    freedom: float | None = None,
    statistical: bool = False,
    rectangular: bool = False,
    certificate: str = "",
) -> Contribution:
    """A row of the budget; `u` in `unit`, `sensitivity` in deg/h for one of it."""
    few: Literal["normal", "t"] = "t" if freedom is not None else "normal"
    return Contribution(
        id=id,
        text=text,
        type="A" if statistical else "B",
        distribution="rectangular" if rectangular else few,
        standard_uncertainty=u,
        unit=unit,
        sensitivity=sensitivity,
        contribution_dph=sensitivity * u,
        freedom=freedom,
        source=source,
        certificate=certificate,
    )


def thermometer(model: Model, instruments: Sequence[Instrument]) -> Contribution | str:
    """Return the contribution of the temperatures, or the reason why it is not known."""
    found = _stated(instruments, "temperature")
    if found is None:
        return "thermometer: no uncertainty of its temperatures between calibration and use is stated"
    u, freedom, names, certificates = found
    return part(
        "thermometer",
        "temperature that the table is asked with, against that of the calibration",
        u,
        names,
        unit="C",
        sensitivity=_gradient(model),
        freedom=freedom,
        certificate=certificates,
    )


def reference(model: Model, instruments: Sequence[Instrument]) -> Contribution | str:
    """Return the contribution of the reference rate of the recordings, or the reason why it is not known."""
    found = _stated(instruments, "rate")
    if found is None:
        rate = model.meta.get("earth_rate")
        return "reference rate: no uncertainty of it is stated" + (
            f" (Earth's rate: {rate})" if isinstance(rate, str) and rate else ""
        )
    u, freedom, names, certificates = found
    return part(
        "reference", "rate that the recordings are referred to", u, names, freedom=freedom, certificate=certificates
    )


def _stated(instruments: Sequence[Instrument], quantity: str) -> tuple[float, float | None, str, str] | None:
    """Combined standard uncertainty of all instruments of a quantity, degrees of freedom, names, certificates."""
    mine = [i for i in instruments if i.quantity == quantity and i.expanded_uncertainty is not None]
    if not mine:
        return None
    u, freedom = combined([((i.expanded_uncertainty or 0.0) / i.coverage_factor, i.degrees_of_freedom) for i in mine])
    certificates = ", ".join(i.certificate for i in mine if i.certificate)
    return u, freedom, ", ".join(i.name for i in mine), certificates


def _gradient(model: Model) -> float:
    """RMS of the map's slope over temperature where training was, deg/h/C."""
    t, r = model.trained_inputs()
    t0, t1 = model.envelope.temperature_c
    step = _STEP * (t1 - t0)
    if step <= 0.0:
        return 0.0
    difference = model.map_dph(np.minimum(t + step, t1), r) - model.map_dph(np.maximum(t - step, t0), r)
    across = np.minimum(t + step, t1) - np.maximum(t - step, t0)
    return float(np.sqrt(np.mean((difference / across) ** 2)))


def arithmetic(verification: Verification | None) -> Contribution | str:
    """Return the contribution of rounding, or the reason why it is not known."""
    if verification is None or not verification.errors:
        return "arithmetic of the target: no bound was proven"
    return part(
        "arithmetic",
        "rounding of the table and of its evaluation",
        verification.error_bound_dph / math.sqrt(3.0),
        "proven bound of every input",
        rectangular=True,
    )


def ageing(limits: Limits | None, changes: Changes | None) -> Contribution | str:
    """Return the contribution of ageing to the end of the interval, or the reason why it is not known."""
    interval = limits.interval if limits else None
    if interval is None:
        return "ageing: no interval until the next calibration is stated"
    years = interval.days / DAYS_A_YEAR
    if interval.drift_dph_per_year is not None:
        return part(
            AGEING,
            f"drift of the bias to the end of {interval.days:g} days",
            interval.drift_dph_per_year / math.sqrt(3.0),
            "largest drift of the type, as the limits file states it",
            unit="deg/h a year",
            sensitivity=years,
            rectangular=True,
        )
    drifts = yearly_drifts(changes.history if changes else ())
    if not drifts:
        return "ageing: neither a drift of the type nor an earlier calibration with its date is known"
    return part(
        AGEING,
        f"drift of the bias to the end of {interval.days:g} days",
        math.sqrt(math.fsum(d**2 for d in drifts) / len(drifts)),
        f"{len(drifts) + 1} calibrations",
        unit="deg/h a year",
        sensitivity=years,
        freedom=float(len(drifts)),
        statistical=True,
    )


def yearly_drifts(history: Sequence[Calibration]) -> list[float]:
    """Move of the map's mean between calibrations that have dates, deg/h a year."""
    found = []
    for before, after in pairwise(history):
        if before.date and after.date and after.moved_mean_dph is not None:
            try:
                days = (date.fromisoformat(after.date[:10]) - date.fromisoformat(before.date[:10])).days
            except ValueError:
                continue
            if days > 0:
                found.append(after.moved_mean_dph * DAYS_A_YEAR / days)
    return found


_MEASURAND = (
    "true bias less correction at a moment of use inside the calibrated envelope, the correction neither held nor "
    "clamped, noise of the rate not included"
)
_FIT_FREEDOM = 22.0  # 2/0.3²: training knows the logarithm of this variance to 0.3 (JCGM 100:2008, G.4.2)
_PLANE = 3  # coefficients beside those of the centers


def budget_of(
    model: Model,
    training: Training,
    evaluation: Evaluation,
    verification: Verification | None,
    *,
    limits: Limits | None = None,
    changes: Changes | None = None,
) -> Budget:
    """The budget of a built unit.

    Raises:
        InputError: `[[meta.instrument]]` is wrong.
    """
    instruments = instruments_in(model.meta, limits.instrument if limits else ())
    found = (
        *_of_recordings(model, training, evaluation),
        thermometer(model, instruments),
        reference(model, instruments),
        arithmetic(verification),
        ageing(limits, changes),
    )
    parts = tuple(one for one in found if isinstance(one, Contribution))
    u, freedom = combined([(one.contribution_dph, one.freedom) for one in parts])
    day = model.calibrated_on
    interval = limits.interval.days if limits and limits.interval else None
    k = coverage_factor(freedom)
    return Budget(
        gyrotc_version=__version__,
        serial=model.serial,
        axis=model.axis,
        measurand=_MEASURAND,
        contributions=parts,
        not_known=tuple(one for one in found if isinstance(one, str)),
        combined_dph=u,
        freedom=freedom,
        coverage_factor=k,
        expanded_dph=k * u,
        instruments=instruments,
        calibrated_on=day,
        interval_days=interval,
        valid_until=last_day(day, interval),
    )


def _of_recordings(model: Model, training: Training, evaluation: Evaluation) -> Iterator[Contribution | str]:
    """Noise, fit, power-on and unseen history; the first three together are what the table states."""
    total = evaluation.sigma_rms_dph
    floor = training.noise_floor_dph
    means = training.samples * training.block_s / training.average_s
    simple = SIMPLE.get(model.method)
    free = len(simple) if simple else model.n_centers + _PLANE
    of_noise = 0.0
    if floor is not None and means > free:
        share = math.sqrt(free / means)
        of_noise = floor * share
        yield part(
            "noise",
            f"noise of the recordings, carried into {free} coefficients",
            floor,
            f"{means:.0f} means over {training.average_s:g} s",
            sensitivity=share,
            freedom=means - free,
            statistical=True,
        )
    else:
        yield "noise of the recordings: too few means to tell it"
    if total is None:
        yield "fit of the map and power-on scatter: this method states no uncertainty of its map"
    else:
        rules = model.uncertainty_dph.rules if model.uncertainty_dph else None
        yield from _of_map(total, of_noise, rules)
    yield _unseen(evaluation, total if total is not None else of_noise)


def _of_map(total: float, of_noise: float, rules: Rules | None) -> Iterator[Contribution | str]:
    between = rules.between_dph if rules else 0.0
    rest = math.sqrt(max(0.0, total**2 - between**2 - of_noise**2))
    yield part(
        "fit",
        "departure of the map from the bias, beyond noise",
        rest,
        "posterior of the map over the training runs",
        freedom=_FIT_FREEDOM,
        statistical=True,
    )
    if rules is None or rules.turn_on_dph is None:
        yield "constant from power-on to power-on: a single power-on cannot tell it"
        return
    freedom = rules.turn_on_freedom
    yield part(
        "turn_on",
        "constant from power-on to power-on",
        rules.turn_on_dph,
        "units of the lot" if freedom is None else f"{freedom + 1} power-ons",
        freedom=None if freedom is None else float(freedom),
        statistical=True,
    )


def _unseen(evaluation: Evaluation, explained: float) -> Contribution | str:
    """Return what recordings that were left out show of errors that last, beyond what the table states.

    The excess of their mean square is known with an error, and it cannot be negative. Its expectation under both is
    what counts: it falls to nothing only where many means show that nothing is there.
    """
    name, pooled = evaluation.judged() or ("train", None)
    lasting = pooled.lasting if pooled and name != "train" else None
    if pooled is None or lasting is None:
        # Of held-out recordings it is not known if their means are few, or if the result is of an older gyrotc.
        why = "no recordings were left out" if name == "train" else f"no error that lasts is known of {PARTS[name]}"
        constant = evaluation.train.constant.rms_dph if evaluation.train else None
        if constant is None:
            return f"thermal history that was not trained: {why}"
        return part(
            "unseen",
            "thermal history and rates that were not trained",
            constant,
            f"{why}, so the map is not shown to be better than a constant: what that leaves",
        )
    return part(
        "unseen",
        "thermal history and rates that were not trained",
        math.sqrt(positive_mean(lasting.mean_square_dph2 - explained**2, lasting.standard_dph2)),
        f"{pooled.samples} means of {PARTS[name]}: what lasts for half an hour, beyond what the table states",
        freedom=lasting.freedom,
        statistical=True,
    )


# Standard deviations below zero from which the asymptotic series of a truncated mean is right to 1 %.
_FAR_BELOW = -14.0


def positive_mean(value: float, sigma: float) -> float:
    """Return the mean of a normal distribution about `value` of which only the positive half is possible.

    It rises with `value` and with `sigma`: what is known less well counts more.
    """
    if sigma <= 0.0:
        return max(value, 0.0)
    z = value / sigma
    if z < _FAR_BELOW:  # by its asymptotic series, where the difference below would cancel
        return -sigma / z
    return value + sigma * math.exp(-0.5 * z * z - float(log_ndtr(z))) / math.sqrt(2.0 * math.pi)


def figure_uncertainties(
    judged: Sequence[Averages],
    runs: Sequence[EvaluatedRun],
    average_s: float,
    *,
    constant_dph: float = 0.0,
    scale: float = 1.0,
    floor: tuple[float, int | None] | None = None,
) -> dict[str, FigureUncertainty]:
    """Standard uncertainties by the names of limits; a figure that the recordings are too short for has none.

    Args:
        judged: Means over `average_s` of the runs that the model is judged by.
        runs: These runs as they were evaluated.
        average_s: Averaging, s.
        constant_dph: The constant that `improvement` compares the correction with.
        scale: 1, or the RMS of spans left out over that of `judged`, where these are training runs that stand in for
            them.
        floor: The noise floor (deg/h), and the number of means that it was estimated from (None: of a simulation).
    """
    blocks = [(block.before_dph, block.after_dph) for block in jackknife_blocks(judged, average_s)]
    found = _jackknife(blocks, constant_dph) if len(blocks) >= 2 else {}
    after = np.concatenate([a.after_dph for a in judged]) if judged else np.zeros(0)
    if after.size > 1:
        # Of the largest magnitude of n normal numbers: pi/sqrt(6) times Gumbel's scale sigma/sqrt(2 ln 2n)
        largest = float(after.std() * np.pi / np.sqrt(6.0) / np.sqrt(2.0 * np.log(2.0 * after.size)))
        method = f"extreme-value distribution of {after.size} means"
        found["max_abs_dph"] = FigureUncertainty(standard=largest, freedom=None, method=method)
    if scale != 1.0:
        for name, one in found.items():
            factor = 1.0 / scale if name == "improvement" else scale
            found[name] = one.model_copy(update={"standard": one.standard * factor})
    if "rms_dph" in found and floor is not None and floor[0] > 0.0:
        rms_dph = scale * float(np.sqrt(np.mean(after**2)))
        found["rms_over_floor"] = _over_floor(found["rms_dph"], rms_dph, *floor)
    return found | dict(_of_windows(judged, runs, average_s))


def squares_of(sigma_dph: FloatArray | None) -> tuple[float, int]:
    """Sum of squares and number of the 1 sigma of corrections; nothing where a table states none."""
    return (0.0, 0) if sigma_dph is None else (float(np.sum(sigma_dph**2)), sigma_dph.size)


def squares_in_all(squares: Iterable[tuple[float, int]]) -> tuple[float, int]:
    """Several such sums together."""
    totals, numbers = zip(*squares, strict=True)
    return float(sum(totals)), int(sum(numbers))


def root_mean(squares: Iterable[tuple[float, int]]) -> float | None:
    """RMS of several such sums; None where there is no correction."""
    total, number = np.sum([(0.0, 0), *squares], axis=0)
    return float(np.sqrt(total / number)) if number else None


def _jackknife(blocks: Sequence[tuple[FloatArray, FloatArray]], constant_dph: float) -> dict[str, FigureUncertainty]:
    """Return what deleting one block at a time says of each figure; not less than for independent means.

    Few blocks can agree by chance. Noise of a gyro is white at best, so as many independent normal numbers are the
    least that a figure can be unknown by.
    """
    sums = np.array([(a.size, a.sum(), (a**2).sum(), ((b - constant_dph) ** 2).sum()) for b, a in blocks])
    total = sums.sum(axis=0)
    n, first, second, constant = (total - sums).T
    mean = first / n
    figures = {
        "rms_dph": np.sqrt(second / n),
        "std_dph": np.sqrt(np.maximum(second / n - mean**2, 0.0)),
        "mean_dph": mean,
    }
    rms = math.sqrt(total[2] / total[0])
    least = {"rms_dph": rms / math.sqrt(2.0 * total[0]), "mean_dph": rms / math.sqrt(total[0])}
    least["std_dph"] = least["rms_dph"]
    if second.all():
        figures["improvement"] = np.sqrt(constant / second)
        least["improvement"] = math.sqrt(total[3] / total[2]) / math.sqrt(2.0 * total[0])
    count = len(blocks)
    method = f"jackknife over {count} blocks of the recordings"
    return {
        name: FigureUncertainty(
            standard=max(float(np.sqrt((count - 1) * np.var(values))), least[name]),
            freedom=float(count - 1),
            method=method,
        )
        for name, values in figures.items()
    }


def _of_windows(
    judged: Sequence[Averages], runs: Sequence[EvaluatedRun], average_s: float
) -> Iterable[tuple[str, FigureUncertainty]]:
    """Yield the uncertainty of each figure of the worst run: that of an RMS of m normal numbers is sqrt(1/2m) of it."""
    names: tuple[tuple[Literal["rms_30min_dph", "angle_1h_arcsec", "first_10min_rms_dph"], float], ...] = (
        ("rms_30min_dph", HALF_HOUR_S),
        ("angle_1h_arcsec", HOUR_S),
        ("first_10min_rms_dph", average_s),
    )
    for name, window_s in names:
        known = [(value, a) for a, run in zip(judged, runs, strict=True) if (value := getattr(run.after, name))]
        if not known:
            continue
        value, a = max(known, key=lambda pair: pair[0])
        length_s = FIRST_S if name.startswith("first") else a.after_dph.size * average_s
        windows = max(1, int(length_s / window_s))
        standard, method = value / np.sqrt(2.0 * windows), f"{windows} windows of the worst run, taken as normal"
        yield name, FigureUncertainty(standard=standard, freedom=float(windows), method=method)


def _over_floor(rms: FigureUncertainty, rms_dph: float, floor_dph: float, differences: int | None) -> FigureUncertainty:
    """Return the uncertainty of RMS over floor: relative variances added, 3/4n for n differences (von Neumann)."""
    of_floor = float(np.sqrt(0.75 / differences)) if differences else 0.0
    known = f"floor from {differences} successive differences" if differences else "floor of the simulation"
    relative = float(np.hypot(rms.standard / rms_dph, of_floor)) if rms_dph else 0.0
    return FigureUncertainty(
        standard=relative * rms_dph / floor_dph, freedom=rms.freedom, method=f"{rms.method}; {known}"
    )
