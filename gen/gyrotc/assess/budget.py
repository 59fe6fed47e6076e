"""The uncertainty budget of a correction (JCGM 100:2008), with what is stated and the instruments.

The measurand is true bias less correction, at a moment of use inside the calibrated envelope at which the correction
is neither held nor clamped; noise of the rate is not part of it. What recordings say of the map (noise, fit, power-on)
is the variance that training gave the table, as an average over the recordings that the unit is judged by; the rest
is stated by certificates, proven, or seen in earlier calibrations.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from datetime import date
from itertools import pairwise
from typing import Final, Literal

import numpy as np

from .. import __version__
from ..model import Model
from ..results.evaluation import PARTS, Calibration, Changes, Evaluation
from ..results.release import Budget, Contribution, Instrument
from ..results.training import Training
from ..results.verification import Verification
from ..train.options import SIMPLE
from .limits import Limits, coverage_factor, instruments_in, last_day

_STEP = 0.01  # of the range of temperatures, for the map's gradient
DAYS_A_YEAR = 365.25  # the Julian year
AGEING: Final = "ageing"  # the contribution of that name
Known = tuple[float, float | None]
"""A contribution, deg/h, and its degrees of freedom (None: many)."""


def combined(parts: Sequence[Known]) -> Known:
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
    """Of the temperatures, or why it is not known."""
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
    """Of the rate that recordings are referred to, or why it is not known."""
    found = _stated(instruments, "rate")
    if found is None:
        rate = model.meta.get("earth_rate")
        return "reference rate: no uncertainty of it is stated" + (
            f" (Earth's rate: {rate})" if isinstance(rate, str) and rate else ""
        )
    u, freedom, names, certificates = found
    return part(
        "reference",
        "rate that the recordings are referred to",
        u,
        names,
        freedom=freedom,
        certificate=certificates,
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
    """Of rounding, or why it is not known."""
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
    """To the end of the interval, or why it is not known."""
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
_SHOWN = 2.0  # standard errors beyond which spans left out say more than the map's own uncertainty does
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
    stated = model.meta.get("calibrated_on")
    day = None if stated is None else str(stated)
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
        runs = sum(run.role == "train" for run in evaluation.runs)
        yield from _of_map(total, of_noise, rules.between_dph if rules else 0.0, runs)
    yield _unseen(evaluation, training, total if total is not None else of_noise)


def _of_map(total: float, of_noise: float, between: float, runs: int) -> Iterator[Contribution | str]:
    rest = math.sqrt(max(0.0, total**2 - between**2 - of_noise**2))
    yield part(
        "fit",
        "departure of the map from the bias, beyond noise",
        rest,
        "evidence of the training runs, scaled by runs left out in turn",
        freedom=_FIT_FREEDOM,
        statistical=True,
    )
    if runs < 2:
        yield "scatter from power-on to power-on: a single run cannot tell it"
    else:
        yield part(
            "turn_on",
            "constant from power-on to power-on",
            between,
            f"{runs} runs" + ("" if between else ", which do not differ by more than their noise"),
            freedom=float(runs - 1),
            statistical=True,
        )


def _unseen(evaluation: Evaluation, training: Training, explained: float) -> Contribution | str:
    """What recordings that were left out show beyond floor and map; 0 where it is within two standard errors."""
    judged = evaluation.judged()
    known = (evaluation.uncertainty or {}).get("rms_dph")
    floor = evaluation.noise_floor_dph
    rms = judged[1].after.rms_dph if judged and judged[0] != "train" else None
    if judged is None or rms is None or known is None or not floor:
        return "thermal history that was not trained: no recordings were left out to tell it"
    of_floor = 0.0 if evaluation.noise_floor_source == "simulated" else _of_floor(training)
    excess = rms**2 - floor**2 - explained**2
    error = 2.0 * math.hypot(rms * known.standard, floor**2 * of_floor)
    shown = excess > _SHOWN * error
    return part(
        "unseen",
        "thermal history and rates that were not trained",
        math.sqrt(excess) if shown else 0.0,
        f"{PARTS[judged[0]]}, beyond noise floor and map" + ("" if shown else ": nothing is shown"),
        freedom=known.freedom,
        statistical=True,
    )


def _of_floor(training: Training) -> float:
    """Relative standard error of a floor from successive differences (von Neumann): sqrt(3/4n)."""
    means = training.samples * training.block_s / training.average_s
    return math.sqrt(0.75 / max(means, 1.0))
