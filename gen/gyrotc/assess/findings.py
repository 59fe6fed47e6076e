"""Findings about a model and the data behind it, computed from the data.

A finding has an id that stays stable, a text, and the numbers behind it. Findings never stop a job. They follow
from figures alone: no name of a file, folder or serial plays a part.

The residual of a run is what compensation leaves of it, in means over `average_s`. Its autocorrelation, and its RMS
over the noise floor, are compared with their distributions for white noise of the same runs, which are drawn: the
noise floor comes from successive differences, so that slow structure raises both. Noise of a gyro that is not white
(bias instability, rate random walk) is more than noise here, too: `gyrotc diagnose` tells it from a cause.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ..common.arrays import FloatArray
from ..common.metrics import MAD_TO_SIGMA
from ..mirror.table import Table
from ..model import Model
from ..quality.findings import RunFacts, finding, temperature_findings
from ..quality.inspection import findings_of_data_set
from ..recordings.records import Dataset
from ..results.base import Finding
from ..results.evaluation import PARTS, RMS_OVER_FLOOR, Evaluation, ResidualTest
from ..results.training import Training
from ..tables.quantisation import rms_growth, rounding_bound_dph
from ..train.noise import robust_sigma

_LAGS = 10  # means: of 100 s a third of the shortest ramp of a chamber's cycle
_SIGMAS = 4.0  # of each figure's distribution: one clean residual in ten thousand
_DRAWS = 400  # which tell a standard deviation to 4 %
_MOST = 2**23  # numbers drawn in all: half a second
_LEAST = 20  # means: fewer have no autocorrelation to speak of
_SEED = 1  # any; the same recordings have the same limits


def residual_test(
    judged: Sequence[FloatArray],
    rms_dph: float | None,
    floor_dph: float | None,
    floor_lengths: Sequence[int] | None = None,
) -> ResidualTest | None:
    """Compare the residual of the judged runs with white noise; None without an RMS or a noise floor.

    Args:
        judged: Means of what remains of these runs, deg/h, each of shape (n,).
        rms_dph: The RMS that they are judged by, deg/h.
        floor_dph: The noise floor, deg/h.
        floor_lengths: Number of means of each run that the floor was estimated from; none: it is known; None: it was
            estimated from the judged runs themselves.
    """
    lengths = tuple(x.size for x in judged if x.size)
    if not lengths or rms_dph is None or not floor_dph:
        return None
    limit, low, high = _limits(lengths, None if floor_lengths is None else tuple(n for n in floor_lengths if n > 1))
    return ResidualTest(
        autocorrelation=_correlation(judged),
        autocorrelation_limit=limit,
        lags=_LAGS,
        rms_over_floor=rms_dph / floor_dph,
        rms_over_floor_band=(low, min(high, RMS_OVER_FLOOR)),
    )


@functools.lru_cache(maxsize=64)
def _limits(lengths: tuple[int, ...], of_floor: tuple[int, ...] | None) -> tuple[float | None, float, float]:
    """Return the limits for white noise in runs of these lengths: autocorrelation, least and most RMS over floor."""
    rng = np.random.default_rng(_SEED)
    draws = max(_DRAWS // 8, min(_DRAWS, _MOST // sum(lengths)))
    correlations, ratios = [], np.empty(draws)
    for k in range(draws):
        series = [rng.normal(size=n) for n in lengths]
        others = series if of_floor is None else [rng.normal(size=n) for n in of_floor]
        differences = np.concatenate([np.zeros(0), *(np.diff(x) for x in others)])
        floor = robust_sigma(differences) / float(np.sqrt(2.0)) if differences.size else 1.0
        ratios[k] = np.sqrt(np.mean(np.concatenate(series) ** 2)) / floor
        correlations.append(_correlation(series))
    logs = np.log(ratios)  # nearer to normal than ratios of few means
    low, high = np.exp(logs.mean() + _SIGMAS * logs.std() * np.array([-1.0, 1.0]))
    known = np.array([c for c in correlations if c is not None])
    limit = float(known.mean() + _SIGMAS * known.std()) if known.size else None
    return limit, float(low), float(high)


def _correlation(judged: Sequence[FloatArray]) -> float | None:
    """Mean autocorrelation at the first lags, about the mean of all runs, which do not touch; None: too short."""
    series = [x for x in judged if x.size > _LAGS]
    total = sum(x.size for x in series)
    if total < _LEAST:
        return None
    mean = np.concatenate(series).mean()
    left = [x - mean for x in series]
    power = sum(float(x @ x) for x in left)
    if power <= 0.0:
        return 0.0
    found = 0.0
    for lag in range(1, _LAGS + 1):
        products = sum(float(x[:-lag] @ x[lag:]) for x in left)
        found += products / sum(x.size - lag for x in left) / (power / total)
    return found / _LAGS


def beyond_noise(result: Evaluation) -> Iterator[Finding]:
    """The RMS that the model is judged by, where noise alone would not give it."""
    judged, test = result.judged(), result.residual
    if judged is None or test is None or result.noise_floor_dph is None:
        return
    low, high = test.rms_over_floor_band
    if low <= test.rms_over_floor <= high:
        return
    more = test.rms_over_floor > high
    rms = test.rms_over_floor * result.noise_floor_dph
    yield finding(
        "residual_above_noise" if more else "residual_below_noise",
        f"RMS {rms:.4g} deg/h on {PARTS[judged[0]]} is {test.rms_over_floor:.3g} times the noise floor, where noise "
        f"alone gives {low:.3g} to {high:.3g}: "
        + (
            "structure is left, or rates, temperatures and times do not belong together. See gyrotc check and "
            "gyrotc diagnose."
            if more
            else "rows were smoothed, or are not independent of those that were trained on."
        ),
        part=judged[0],
        rms_dph=rms,
        noise_floor_dph=result.noise_floor_dph,
        ratio=test.rms_over_floor,
        limits=[low, high],
    )


def coarse_arithmetic(model: Model, table: Table) -> Iterator[Finding]:
    """Report an arithmetic whose rounding alone can bring the RMS to where structure is reported."""
    growth, floor_dph = rms_growth(model, table), model.noise_floor_dph
    if growth is None or floor_dph is None or growth <= RMS_OVER_FLOOR - 1.0:
        return
    error_dph, constant_dph = rounding_bound_dph(model, table), model.fallback_dph
    if table.numeric == "q31":  # its digits are those of a unit that no rate changes
        why = f"the unit of its bias is 2^-{table.bias_frac_bits} deg/h"
        advice = "State a larger q31_bias_frac_bits in the limits file, or take the f32 table, and build again."
    else:
        why = f"a constant of {constant_dph:.6g} deg/h in the rate takes the digits"
        advice = (
            f"Subtract a constant near {constant_dph:.6g} deg/h from the rate, in the recordings and in the firmware, "
            "and build again."
        )
    yield finding(
        "coarse_arithmetic",
        f"Rounding of the {table.numeric} table can be {error_dph:.2g} deg/h, and the noise floor is {floor_dph:.2g} "
        f"deg/h: {why}.",
        advice=advice,
        error_dph=error_dph,
        noise_floor_dph=floor_dph,
        constant_dph=constant_dph,
    )


_UNSEEN_TO_SEEN = 2.0  # RMS of spans not seen over RMS in training
_UNSEEN_TO_FLOOR = 3.0  # below it most of what is left is noise, whatever training left
_WEIGHTS_TO_RANGE = 10.0  # times the swing: a digit of the correction is then lost to cancelling
_LEAST_COVERAGE = 0.25  # below it three quarters of the envelope are interpolation
_OUTLIER_SIGMAS = 6.0  # once in 5e8 normal runs
_OUTLIER_SCATTER = 3.0  # times that of the others; chosen so that chance in short runs is not reported
_LEAST_RUNS = 4  # fewer runs do not say what a usual run is
_OF_TRAINING = ("does_not_generalise", "map_refused", "map_beyond_data", "not_of_its_lot", "prior_does_not_hold")
_POLYNOMIALS = ("cubic", "cubic_slope")


def findings_of(
    dataset: Dataset,
    facts: Sequence[RunFacts],
    of_runs: Sequence[Finding],
    model: Model,
    result: Mapping[str, Any],
    training: Training | None = None,
) -> list[Finding]:
    """All findings, the gravest first.

    Args:
        facts: What was seen in each run that was evaluated.
        of_runs: What its rows show by themselves.
        model: The model that was evaluated.
        result: Figures as in the result of `evaluate`: runs, train, exam, noise_floor_dph.
        training: What `training.json` says, for figures of spans left out of training.
    """
    found = [*temperature_findings(facts)]
    if not found:
        # What the choice of the correction found; `fit` wrote it
        found += [said for said in (training.findings if training else ()) if said.id in _OF_TRAINING]
        found += [*_unseen(result, training), *_coverage(model)]
    return [*found, *of_runs, *findings_of_data_set(dataset, facts), *_weights(model), *_outliers(result)]


def _unseen(result: Mapping[str, Any], training: Training | None) -> Iterator[Finding]:
    """The residual on runs or spans that were not trained on, against that of training and the noise."""
    seen, floor = _rms(result.get("train")), result.get("noise_floor_dph")
    left_out = training.left_out if training else None
    unseen = (
        ("test runs", _rms(result.get("exam"))),
        ("spans left out in turn", left_out.after.rms_dph if left_out else None),
    )
    for name, rms in unseen:
        if rms is None or seen is None or rms <= _UNSEEN_TO_SEEN * seen:
            continue
        if floor is None or rms > _UNSEEN_TO_FLOOR * floor:
            yield finding(
                "fails_on_unseen_span",
                f"A static map of temperature and its rate fails on what it has not seen: RMS {rms:.4g} deg/h on "
                f"{name}, {seen:.4g} deg/h in training. Record more cycles, or see `gyrotc diagnose`.",
                unseen=name,
                unseen_rms_dph=rms,
                train_rms_dph=seen,
                noise_floor_dph=floor,
                spans=[span.after.rms_dph for span in training.left_out_spans] if training else [],
            )
            return


def _rms(pooled: Mapping[str, Any] | None) -> float | None:
    return pooled["after"]["rms_dph"] if pooled else None


def _coverage(model: Model) -> Iterator[Finding]:
    """Share of the envelope in which there was data."""
    if model.coverage is None:
        return
    cells = "".join(model.coverage.rows)
    share = cells.count("1") / len(cells)
    if share < _LEAST_COVERAGE:
        yield finding(
            "sparse_coverage",
            f"Training data lie in {share:.0%} of the envelope of temperature and its rate; between them the map "
            "is interpolation. Record ramps at further rates.",
            share=share,
            required=_LEAST_COVERAGE,
            envelope=model.envelope.model_dump(),
        )


def _weights(model: Model) -> Iterator[Finding]:
    """Report weights that cancel one another: a lever for rounding and for every unusual input.

    Those of a polynomial written as wide Gaussians cancel as they must; it ends at the edge of the envelope.
    """
    if model.method in _POLYNOMIALS:
        return
    swing = float(np.ptp(model.map_dph(*model.trained_inputs())))
    total = model.sum_abs_weights_dph
    if swing > 0.0 and total > _WEIGHTS_TO_RANGE * swing:
        yield finding(
            "large_weights",
            f"The weights add up to {total:.4g} deg/h for a correction that swings by {swing:.4g} deg/h: they cancel "
            "one another, and outside the training data the correction can be anything.",
            sum_abs_weights_dph=total,
            swing_dph=swing,
        )


def _outliers(result: Mapping[str, Any]) -> Iterator[Finding]:
    """Report runs whose mean residual or scatter differs from that of the others."""
    runs = [run for run in result["runs"] if run["after"]["rms_dph"] is not None]
    if len(runs) < _LEAST_RUNS:
        return
    mean = np.array([run["after"]["mean_dph"] for run in runs])
    scatter = np.array([run["after"]["std_dph"] for run in runs])
    samples = np.array([run["samples"] for run in runs])
    floor = result.get("noise_floor_dph") or float(np.median(scatter))
    departure = np.abs(mean - np.median(mean))
    usual = np.maximum(MAD_TO_SIGMA * np.median(departure), floor / np.sqrt(samples))
    off = (departure > _OUTLIER_SIGMAS * usual) & (departure > floor)
    loud = scatter > _OUTLIER_SCATTER * np.maximum(np.median(scatter), floor)
    for k in np.flatnonzero(off | loud):
        what = f"mean {mean[k]:.4g} deg/h" if off[k] else f"standard deviation {scatter[k]:.4g} deg/h"
        usually = f"{np.median(mean):.4g}" if off[k] else f"{np.median(scatter):.4g}"
        yield finding(
            "run_outlier",
            f"{runs[k]['file']} differs from the other runs after compensation: {what}, usually {usually}.",
            runs[k]["file"],
            mean_dph=float(mean[k]),
            std_dph=float(scatter[k]),
            median_mean_dph=float(np.median(mean)),
            median_std_dph=float(np.median(scatter)),
        )
