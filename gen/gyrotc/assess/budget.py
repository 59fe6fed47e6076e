"""The uncertainty budget of a correction (JCGM 100:2008): what the bias that is left may be, and why.

The measurand is true bias less correction, at a moment of use inside the calibrated envelope at which the correction
is neither held nor clamped; noise of the rate is not part of it. What recordings say of the map (noise, fit, power-on)
is the variance that training gave the table, as an average over the recordings that the unit is judged by; the rest
is stated by certificates, proven, or seen in earlier calibrations.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from .. import __version__
from ..model import Model
from ..results.budget import Budget, Contribution
from ..results.changes import Changes
from ..results.evaluation import Evaluation
from ..results.training import Training
from ..results.verification import Verification
from ..train.simple import SIMPLE
from .conformity import coverage_factor
from .instruments import instruments_in, last_day
from .limits import Limits
from .stated import ageing, arithmetic, combined, part, reference, thermometer

__all__ = ["budget_of"]

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
    name = {"exam": "exam runs", "left_out": "spans left out of training"}[judged[0]]
    shown = excess > _SHOWN * error
    return part(
        "unseen",
        "thermal history and rates that were not trained",
        math.sqrt(excess) if shown else 0.0,
        f"{name}, beyond noise floor and map" + ("" if shown else ": nothing is shown"),
        freedom=known.freedom,
        statistical=True,
    )


def _of_floor(training: Training) -> float:
    """Relative standard error of a floor from successive differences (von Neumann): sqrt(3/4n)."""
    means = training.samples * training.block_s / training.average_s
    return math.sqrt(0.75 / max(means, 1.0))
