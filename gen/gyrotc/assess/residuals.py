"""What the residual says of recordings: more, or less, than their noise; a temperature that was recorded late.

The residual of a run is what compensation leaves of it, in means over `average_s`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..common.arrays import FloatArray
from ..common.metrics import Averages, median
from ..quality.recorded import Finding, finding
from ..recordings.records import Run
from ..results.evaluation import RMS_OVER_FLOOR, Evaluation

__all__ = ["residual_findings"]

_SIGMAS = 5.0  # of the band that noise alone gives: once in 3e6 evaluations
_LATE_SIGMAS = 6.0  # of a run among dozens
_LEAST_LATE_S = 10.0  # a block: the front end gives temperature and rate no finer
_LEAST_MEANS = 20  # of a run: fewer do not tell a lag from a curve
_PARTS = {"exam": "exam runs", "left_out": "spans left out in turn", "train": "training runs"}


def residual_findings(result: Evaluation, runs: Sequence[tuple[Run, Averages]]) -> Iterator[Finding]:
    """Findings about the residual of the runs that were evaluated."""
    yield from _beyond_noise(result)
    yield from _late(result, runs)


def _beyond_noise(result: Evaluation) -> Iterator[Finding]:
    """The RMS that the model is judged by, where noise alone would not give it."""
    judged, floor = result.judged(), result.noise_floor_dph
    rms = judged[1].after.rms_dph if judged else None
    if judged is None or rms is None or not floor:
        return
    known = None if result.noise_floor_source == "simulated" or not result.train else result.train.samples
    ratio, width = rms / floor, _SIGMAS * _spread(judged[1].samples, known)
    high, low = min(1.0 + width, RMS_OVER_FLOOR), 1.0 - width
    if low <= ratio <= high:
        return
    more = ratio > high
    yield finding(
        "residual_above_noise" if more else "residual_below_noise",
        f"RMS {rms:.4g} deg/h on {_PARTS[judged[0]]} is {ratio:.3g} times the noise floor, where noise alone gives "
        f"{max(low, 0.0):.3g} to {high:.3g}: "
        + (
            "structure is left, or rates, temperatures and times do not belong together. See gyrotc check and "
            "gyrotc diagnose."
            if more
            else "rows were smoothed, or are not independent of those that were trained on."
        ),
        part=judged[0],
        rms_dph=rms,
        noise_floor_dph=floor,
        ratio=ratio,
        limits=[max(low, 0.0), high],
    )


def _spread(samples: int, of_floor: int | None) -> float:
    """1 sigma of an RMS over its true value, both of white noise: 1 / (2 n), and that of the floor besides."""
    return float(np.sqrt(0.5 / max(samples, 1) + (0.5 / max(of_floor, 1) if of_floor else 0.0)))


def _late(result: Evaluation, runs: Sequence[tuple[Run, Averages]]) -> Iterator[Finding]:
    """Runs whose residual goes with the change of their correction: T was recorded later, or earlier, than in others.

    A correction at T(t - late) instead of T(t) leaves late times its change. What all runs have in common is no fault
    of one of them, and the model may hold it.
    """
    found = [(run, _lag(averages)) for run, averages in runs]
    lags = [(run, *lag) for run, lag in found if lag is not None]
    if len(lags) < 2:
        return
    usual = median(np.array([lag for _, lag, _ in lags]))
    for run, lag, sigma in lags:
        late = lag - usual
        if abs(late) > max(_LATE_SIGMAS * sigma, _LEAST_LATE_S, run.row_period_s):
            word = "later" if late > 0.0 else "earlier"
            yield finding(
                "temperature_late",
                f"The temperature of {run.file} was recorded {abs(late):.3g} s {word} against the rate than in the "
                f"other runs (1 sigma {sigma:.2g} s): its clock, its wiring, or the pairing of its files.",
                file=run.file,
                from_s=run.from_s,
                late_s=late,
                sigma_s=sigma,
            )


def _lag(averages: Averages) -> tuple[float, float] | None:
    """By how much the temperature of a run is late, s, with its 1 sigma; None where nothing changes."""
    time, after = averages.time_s, averages.after_dph
    if len(time) < _LEAST_MEANS:
        return None
    change = np.gradient(averages.before_dph - after, time)
    power = float(change @ change)
    if power == 0.0:
        return None
    left = after - after.mean()
    lag = float(change @ left) / power
    return lag, _sigma_of(left - lag * change, change, power)


def _sigma_of(left: FloatArray, change: FloatArray, power: float) -> float:
    """1 sigma of a slope; what is left may be correlated, so products of neighbours count (Newey and West 1987)."""
    product = left * change
    depth = int(np.ceil(len(left) ** 0.25)) + 1
    total = float(product @ product)
    for k in range(1, depth):
        total += 2.0 * (1.0 - k / depth) * float(product[k:] @ product[:-k])
    return float(np.sqrt(max(total, float(left @ left) / len(left) * power))) / power
