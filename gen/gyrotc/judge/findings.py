# long: every finding is told here
"""What a user should know about a model and the data behind it, computed from the data.

A finding has an id that stays stable, a text, and the numbers behind it. Findings never stop a job. They follow
from figures alone: no name of a file, folder or serial plays a part.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..dataset import Dataset, RunFacts, earth_rate_warning
from ..metrics import LEAST_SPAN_C, MAD_TO_SIGMA, median
from ..model import Model
from ..results.training import Training
from .recorded import shared_rows_findings, sign_findings
from .thermometers import thermometer_findings

__all__ = [
    "contradiction_findings",
    "counter_findings",
    "earth_rate_findings",
    "findings_of",
    "jump_findings",
    "outlier_findings",
    "temperature_findings",
]

Finding = dict[str, Any]

_UNSEEN_TO_SEEN = 2.0  # RMS of spans not seen over RMS in training
_UNSEEN_TO_FLOOR = 3.0  # below it most of what is left is noise, whatever training left
_WEIGHTS_TO_RANGE = 10.0  # times the swing: a digit of the correction is then lost to cancelling
_LEAST_COVERAGE = 0.25  # below it three quarters of the envelope are interpolation
_OUTLIER_SIGMAS = 6.0  # once in 5e8 normal runs
_OUTLIER_SCATTER = 3.0  # times that of the others; chosen so that chance in short runs is not told
_LEAST_RUNS = 4  # fewer runs do not say what a usual run is
_GROSS_OUTLIER = 100.0  # times the noise of a row: no noise of a gyro, whatever its tails
_PLACE_C, _PLACE_C_PER_MIN = 1.0, 0.25  # what counts as the same temperature and rate of it
_COMMON_PLACES = 5  # fewer do not make a median
_CONTRADICTION = 5.0  # times the scatter of a minute within such a place
_LEAST_FREEDOM = 10  # degrees of freedom: with fewer a scatter is known to no better than a quarter
_OF_TRAINING = (
    "does_not_generalise",
    "map_refused",
    "map_beyond_data",
    "not_of_its_lot",
    "prior_does_not_hold",
)
_POLYNOMIALS = ("cubic", "cubic_slope")


def findings_of(
    dataset: Dataset,
    facts: Sequence[RunFacts],
    model: Model,
    result: Mapping[str, Any],
    training: Training | None = None,
) -> list[Finding]:
    """All findings, the gravest first.

    Args:
        facts: What was seen in each run that was evaluated.
        model: The model that was evaluated.
        result: Figures as in the result of `evaluate`: runs, train, exam, noise_floor_dph.
        training: What `training.json` says, for figures of spans left out of training.
    """
    found = [*temperature_findings(facts)]
    if not found:
        found += _of_training(training)
        found += _unseen(result, training)
        found += _coverage(model)
    found += jump_findings(facts)
    found += counter_findings(facts)
    found += outlier_findings(facts)
    found += contradiction_findings(facts)
    found += shared_rows_findings(dataset)
    found += sign_findings(facts)
    found += thermometer_findings(dataset)
    found += earth_rate_findings(dataset, facts)
    found += _weights(model)
    found += _outliers(result)
    return found


def temperature_findings(facts: Sequence[RunFacts]) -> Iterator[Finding]:
    """Nothing can be learnt about temperature where it hardly changes over all training runs."""
    runs = [f for f in facts if f.role == "train"]
    if not runs:
        return
    low, high = min(f.temperature_c[0] for f in runs), max(f.temperature_c[1] for f in runs)
    if high - low < LEAST_SPAN_C:
        yield _finding(
            "no_temperature_information",
            f"Temperature spans {high - low:.3g} C in training: nothing can be learnt about temperature, "
            "and the model is a constant.",
            span_c=high - low,
            required_c=LEAST_SPAN_C,
        )


def jump_findings(facts: Sequence[RunFacts]) -> Iterator[Finding]:
    """Changes of temperature from one row to the next that no thermal mass can make."""
    jumps = [(f.file, jump) for f in facts for jump in f.jumps]
    if jumps:
        file, first = jumps[0]
        yield _finding(
            "jump_in_temperature",
            f"Temperature jumps as no thermal mass can ({len(jumps)} places), first in {file} at "
            f"{first.time_s:.6g} s from {first.from_c:.6g} to {first.to_c:.6g} C.",
            jumps=[
                {"file": name, "time_s": j.time_s, "from_c": j.from_c, "to_c": j.to_c} for name, j in jumps
            ],
        )


def counter_findings(facts: Sequence[RunFacts]) -> Iterator[Finding]:
    """Counts of pulses that step by the whole range of a counter: it passed its end, and nobody added that."""
    for f in facts:
        if f.wrapped is not None:
            time_s, bits, places = f.wrapped
            yield _finding(
                "counter_wrapped",
                f"Pulses in {_run(f)} step by 2^{bits}, the range of a counter of {bits} bits ({places} places), first "
                f"at {time_s:.10g} s: it passed its end, or negative counts were stored without their sign.",
                file=f.file,
                from_s=f.from_s,
                time_s=time_s,
                bits=bits,
                places=places,
            )


def outlier_findings(facts: Sequence[RunFacts]) -> Iterator[Finding]:
    """Rows that no noise explains."""
    for f in facts:
        if f.outlier is not None and abs(f.outlier.departure_dph) > _GROSS_OUTLIER * f.noise_dph:
            yield _finding(
                "rate_outliers",
                f"{f.outliers} rows of {_run(f)} depart from those around them, most at {f.outlier.time_s:.10g} s: "
                f"{f.outlier.rate_dph:.4g} deg/h, where a row's noise is {f.noise_dph:.2g} deg/h.",
                file=f.file,
                from_s=f.from_s,
                rows=f.outliers,
                time_s=f.outlier.time_s,
                rate_dph=f.outlier.rate_dph,
                noise_dph=f.noise_dph,
            )


def contradiction_findings(facts: Sequence[RunFacts]) -> Iterator[Finding]:
    """Training runs that show another rate where others were at the same temperature and rate of it.

    A map gives one answer there; what it then fits is a mean of both, which neither run shows.
    """
    runs = [f for f in facts if f.role == "train" and len(f.rates_dph)]
    if len(runs) < 2:
        return
    run = np.concatenate([np.full(len(f.rates_dph), k) for k, f in enumerate(runs)])
    rate = np.concatenate([f.rates_dph for f in runs])
    at = np.concatenate(
        [
            np.column_stack([f.temperatures_c / _PLACE_C, f.slopes_c_per_min / _PLACE_C_PER_MIN]).round()
            for f in runs
        ]
    )
    keys, group = np.unique(np.column_stack([at, run]), axis=0, return_inverse=True)
    group = group.reshape(-1)
    count = np.bincount(group)
    mean = np.bincount(group, rate) / count
    freedom = len(rate) - len(keys)
    if freedom < _LEAST_FREEDOM:
        return
    scatter = float(np.sqrt(np.sum((rate - mean[group]) ** 2) / freedom))
    yield from _contradictions(runs, keys, mean, scatter)


def _contradictions(
    runs: Sequence[RunFacts], keys: NDArray[np.float64], mean: NDArray[np.float64], scatter: float
) -> Iterator[Finding]:
    """One finding for each run that departs from the run, or the middle of the runs, that was in the same places.

    Args:
        keys: Place (two columns) and number of the run, shape (n, 3).
        mean: Mean rate there, deg/h, shape (n,).
        scatter: By how much means over a minute scatter within a place, deg/h.
    """
    _, place = np.unique(keys[:, :2], axis=0, return_inverse=True)
    order = np.argsort(place.reshape(-1), kind="stable")
    departures: dict[int, list[float]] = {}
    for members in np.split(order, np.flatnonzero(np.diff(place.reshape(-1)[order])) + 1):
        if len(members) < 2:
            continue
        other_one = [float(mean[m]) for m in members[::-1]]  # of two
        others = [median(mean[members])] * len(members) if len(members) > 2 else other_one
        for m, other in zip(members, others, strict=True):
            departures.setdefault(int(keys[m, 2]), []).append(float(mean[m]) - other)
    for k, values in departures.items():
        apart = float(np.median(np.abs(values)))
        if len(values) >= _COMMON_PLACES and apart > _CONTRADICTION * scatter:
            yield _finding(
                "runs_contradict",
                f"{_run(runs[k])} contradicts the other training runs: at the same temperature and its rate, it "
                f"shows {apart:.4g} deg/h more or less ({len(values)} places; minutes of a run scatter by "
                f"{scatter:.2g}). "
                "A map can follow only one of them.",
                file=runs[k].file,
                from_s=runs[k].from_s,
                apart_dph=apart,
                scatter_dph=scatter,
                places=len(values),
            )


def _run(f: RunFacts) -> str:
    return f.file if f.from_s is None else f"{f.file} from {f.from_s:.6g} s"


def earth_rate_findings(dataset: Dataset, facts: Sequence[RunFacts]) -> Iterator[Finding]:
    """A mean rate that could be Earth's rate, and no word whether that is still in the data."""
    if not facts:
        return
    mean = float(np.average([f.mean_dph for f in facts], weights=[f.rows for f in facts]))
    warning = earth_rate_warning(dataset.earth_rate, mean)
    if warning:
        yield _finding("earth_rate_not_stated", warning, mean_dph=mean)


def _of_training(training: Training | None) -> Iterator[Finding]:
    """What the choice of the correction found; `fit` wrote it."""
    for finding in training.findings if training else ():
        if finding.id in _OF_TRAINING:
            yield finding.content()


def _unseen(result: Mapping[str, Any], training: Training | None) -> Iterator[Finding]:
    """The residual on runs or spans that were not trained on, against that of training and the noise."""
    seen, floor = _rms(result.get("train")), result.get("noise_floor_dph")
    left_out = training.left_out if training else None
    unseen = (
        ("exam runs", _rms(result.get("exam"))),
        ("spans left out in turn", left_out.after.rms_dph if left_out else None),
    )
    for name, rms in unseen:
        if rms is None or seen is None or rms <= _UNSEEN_TO_SEEN * seen:
            continue
        if floor is None or rms > _UNSEEN_TO_FLOOR * floor:
            yield _finding(
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
        yield _finding(
            "sparse_coverage",
            f"Training data lie in {share:.0%} of the envelope of temperature and its rate; between them the map "
            "is interpolation. Record ramps at further rates.",
            share=share,
            required=_LEAST_COVERAGE,
            envelope=model.envelope.model_dump(),
        )


def _weights(model: Model) -> Iterator[Finding]:
    """Weights that cancel one another are a lever for rounding and for every input out of the ordinary.

    Those of a polynomial written as wide Gaussians cancel as they must; it ends at the edge of the envelope.
    """
    if model.method in _POLYNOMIALS:
        return
    swing = float(np.ptp(model.map_dph(*model.trained_inputs())))
    total = model.sum_abs_weights_dph
    if swing > 0.0 and total > _WEIGHTS_TO_RANGE * swing:
        yield _finding(
            "large_weights",
            f"The weights add up to {total:.4g} deg/h for a correction that swings by {swing:.4g} deg/h: they cancel "
            "one another, and outside the training data the correction can be anything.",
            sum_abs_weights_dph=total,
            swing_dph=swing,
        )


def _outliers(result: Mapping[str, Any]) -> Iterator[Finding]:
    """Runs whose mean residual, or whose scatter, is not that of the others."""
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
        yield _finding(
            "run_outlier",
            f"{runs[k]['file']} differs from the other runs after compensation: {what}, usually {usually}.",
            file=runs[k]["file"],
            from_s=runs[k].get("from_s"),
            mean_dph=float(mean[k]),
            std_dph=float(scatter[k]),
            median_mean_dph=float(np.median(mean)),
            median_std_dph=float(np.median(scatter)),
        )


def _finding(name: str, text: str, **evidence: Any) -> Finding:
    return {"id": name, "text": text, "evidence": evidence}
