"""Findings about recordings that follow from the facts of their runs alone, before any model.

A finding has an id that stays stable, a text, and the numbers behind it. It never stops a job. It follows from figures
alone: no name of a file, folder or serial plays a part.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..common.metrics import LEAST_SPAN_C, median
from ..recordings.earth import earth_rate_warning
from ..recordings.records import Dataset
from .facts import RunFacts

__all__ = [
    "Finding",
    "contradiction_findings",
    "counter_findings",
    "earth_rate_findings",
    "finding",
    "jump_findings",
    "outlier_findings",
    "temperature_findings",
]

Finding = dict[str, Any]

_GROSS_OUTLIER = 100.0  # times the noise of a row: no noise of a gyro, whatever its tails
_PLACE_C, _PLACE_C_PER_MIN = 1.0, 0.25  # what counts as the same temperature and rate of it
_COMMON_PLACES = 5  # fewer do not make a median
_CONTRADICTION = 5.0  # times the scatter of a minute within such a place
_LEAST_FREEDOM = 10  # degrees of freedom: with fewer a scatter is known to no better than a quarter


def temperature_findings(facts: Sequence[RunFacts]) -> Iterator[Finding]:
    """Nothing can be learnt about temperature where it hardly changes over all training runs."""
    runs = [f for f in facts if f.role == "train"]
    if not runs:
        return
    low, high = min(f.temperature_c[0] for f in runs), max(f.temperature_c[1] for f in runs)
    if high - low < LEAST_SPAN_C:
        yield finding(
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
        yield finding(
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
            yield finding(
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
            yield finding(
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
            yield finding(
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
        yield finding("earth_rate_not_stated", warning, mean_dph=mean)


def finding(name: str, text: str, **evidence: Any) -> Finding:
    """A finding as results hold it."""
    return {"id": name, "text": text, "evidence": evidence}
