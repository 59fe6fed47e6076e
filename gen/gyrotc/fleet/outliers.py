"""Serials that differ from the rest of their fleet, reversed signs, and copies of one recording under two serials."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from ..common.arrays import FloatArray
from ..common.inputs import PLAUSIBLE_C
from ..common.metrics import Averages, median
from ..common.statistics import noise_of
from ..results.fleet import (
    ComparedRun,
    Copy,
    Facts,
    FleetEntry,
    FleetOutlier,
    FleetUnit,
    LikelyStep,
    ResidualSeries,
    Spread,
)

BIN_C = 5.0
FIRST_C = PLAUSIBLE_C[0]
BINS = round((PLAUSIBLE_C[1] - PLAUSIBLE_C[0]) / BIN_C)
NOISY_RUN = 3.0  # times the noise of the other runs of the gyro: that run is what is to be looked at
_LEAST_IN_BIN = 3  # means, for a mean of them
_LEAST_MEANS = 16  # a shorter run does not show a step
_EDGE = 0.1  # of a run, on either side of which a step is not sought
_WARM_UP_S, _FADES = (900.0, 4.0)  # a quarter of an hour, as of discharges and electronics; and it is over in an hour
PROFILE_S = 600.0  # s between two temperatures of a run that are compared
_POINTS = 160  # of the residual that a picture shows


def gyro_facts(runs: Sequence[tuple[str, Averages]]) -> Facts:
    """Compute the facts of a gyro from the means of its runs, each with its file."""
    used = [(file, a) for file, a in runs if a.time_s.size]
    steps = [step_in(a.after_dph) for _, a in used]
    compared = [_compared(file, a, step) for (file, a), step in zip(used, steps, strict=True)]
    return Facts(
        curve=_curve([a for _, a in used]),
        runs=tuple(compared),
        series=_series(*used[_shown(compared)]) if used else None,
    )


def _shown(runs: Sequence[ComparedRun]) -> int:
    """The run that is drawn if the gyro is an outlier: one much noisier than its others, else the likeliest step."""
    noise = np.array([run.noise_dph for run in runs])
    if noise.max() > NOISY_RUN * median(noise):
        return int(np.argmax(noise))
    return int(np.argmax([run.step.score for run in runs]))


def _compared(file: str, a: Averages, step: tuple[int, float, float]) -> ComparedRun:
    index, size, score = step
    return ComparedRun(
        file=file,
        mean_c=float(a.temperature_c.mean()),
        warm_up_dph=_warm_up(a),
        profile_c=_profile(a),
        noise_dph=_noise(a.after_dph),
        step=LikelyStep(time_s=_edge_s(a, index), size_dph=size, score=score),
    )


def _warm_up(a: Averages) -> float:
    """Amplitude of what fades from the start of a run, beside a constant, deg/h; 0 of a run too short to show it."""
    age = a.time_s - a.time_s[0]
    if age[-1] < _FADES * _WARM_UP_S:
        return 0.0
    fades = np.exp(-age / _WARM_UP_S)
    fades -= fades.mean()
    return float(fades @ a.after_dph / (fades @ fades))


def _profile(a: Averages) -> tuple[float, ...]:
    """Temperature at equal times from the start of a run, C."""
    at = np.arange(a.time_s[0], a.time_s[-1], PROFILE_S)
    return tuple(round(float(t), 2) for t in np.interp(at, a.time_s, a.temperature_c))


def _series(file: str, a: Averages) -> ResidualSeries:
    every = -(-a.after_dph.size // _POINTS)
    return ResidualSeries(
        file=file,
        time_s=tuple(float(t) for t in a.time_s[::every]),
        rate_dph=tuple(float(f"{r:.4g}") for r in a.after_dph[::every]),
    )


def _edge_s(a: Averages, index: int) -> float:
    """Time between the means before and after a step, s."""
    return float(a.time_s[max(index - 1, 0) : index + 1].mean())


def _curve(runs: Sequence[Averages]) -> tuple[float | None, ...]:
    """Mean bias (deg/h) over cells of `BIN_C` from `FIRST_C` on."""
    t = np.concatenate([a.temperature_c for a in runs]) if runs else np.zeros(0)
    rate = np.concatenate([a.before_dph for a in runs]) if runs else np.zeros(0)
    number = np.clip(((t - FIRST_C) / BIN_C).astype(np.int64), 0, BINS - 1)
    count = np.bincount(number, minlength=BINS)
    total = np.bincount(number, weights=rate, minlength=BINS)
    return tuple(float(s / n) if n >= _LEAST_IN_BIN else None for s, n in zip(total, count, strict=True))


def _noise(residual: FloatArray) -> float:
    """Noise of a mean from successive differences, of their bulk: steps and spikes do not count."""
    if residual.size < 3:
        return 0.0
    return float(noise_of(np.diff(residual)) / np.sqrt(2.0))


def step_in(residual: FloatArray) -> tuple[int, float, float]:
    """The likeliest step of a residual: index of the first mean after it, size (deg/h), and its score.

    The score is the largest difference between the means of what lies before and after, in standard deviations of that
    difference for white noise (Sen and Srivastava 1975). Slow noise has large scores too: they are compared with
    those of the lot.
    """
    n = residual.size
    sigma = _noise(residual)
    if n < _LEAST_MEANS or sigma == 0.0:
        return 0, 0.0, 0.0
    calm = np.clip(residual, *(median(residual) + np.array([-6.0, 6.0]) * max(sigma, float(residual.std()))))
    k = np.arange(1, n)
    before = np.cumsum(calm)[:-1] / k
    after = (calm.sum() - np.cumsum(calm)[:-1]) / (n - k)
    score = np.abs(after - before) * np.sqrt(k * (n - k) / n) / sigma
    edge = max(2, int(_EDGE * n))
    inside = slice(edge - 1, n - edge)
    best = int(np.argmax(score[inside])) + edge - 1
    return best + 1, float(after[best] - before[best]), float(score[best])


#: Figures that are looked at, and whether they are compared by their ratio (logarithm).
FIGURES = {
    "constant_rms_dph": True,
    "after_rms_dph": True,
    "rms_over_floor": True,
    "noise_floor_dph": True,
    "bias_dph": False,
    "after_mean_dph": False,
}
_LEAST_SERIALS = 8  # fewer serials do not say what a usual one is
_SIGMAS = 5.0  # once in two million normal figures: of a thousand gyros with six figures none by chance
_LEAST_OF_RMS = 0.1  # of the others, in shares of what usually remains: means of 1e-9 deg/h say nothing
_LEAST_RATIO = 0.02  # of figures compared by their ratio: closer ones are alike, however close the others are


def spread(entries: Sequence[FleetUnit], figure: str) -> Spread | None:
    """Median, least and largest value of a figure; None where no serial has it."""
    values = [float(value) for entry in entries if (value := getattr(entry, figure)) is not None]
    if not values:
        return None
    return Spread(median=float(np.median(values)), least=min(values), largest=max(values))


def outlying_units(entries: Sequence[FleetUnit]) -> list[FleetOutlier]:
    """Serials that are outliers among those of their axis, each with each figure that does, the farthest first."""
    kinds: dict[str | None, list[FleetUnit]] = defaultdict(list)
    for entry in entries:
        kinds[entry.axis].append(entry)
    found = [outlier for kind in kinds.values() for outlier in _of_kind(kind)]
    return sorted(found, key=lambda o: (-o.sigmas, o.name))


def _of_kind(entries: Sequence[FleetUnit]) -> list[FleetOutlier]:
    found = []
    usual = spread(entries, "after_rms_dph")
    usual_rms = usual.median if usual else 0.0
    for figure, by_ratio in FIGURES.items():
        known = [(e.name, v) for e in entries if (v := getattr(e, figure)) is not None]
        known = [(name, v) for name, v in known if v > 0.0 or not by_ratio]
        if len(known) < _LEAST_SERIALS:
            continue
        values = np.array([value for _, value in known])
        scaled = np.log(values) if by_ratio else values
        distances = np.abs(scaled - np.median(scaled))
        sigma = max(
            noise_of(distances),
            _LEAST_RATIO / _SIGMAS if by_ratio else _LEAST_OF_RMS / _SIGMAS * usual_rms,
        )
        if sigma == 0.0:
            continue
        found += [
            FleetOutlier(
                name=name,
                figure=figure,
                value=float(value),
                median=float(np.median(values)),
                sigmas=float(distance / sigma),
            )
            for (name, value), distance in zip(known, distances, strict=True)
            if distance > _SIGMAS * sigma
        ]
    return found


_LEAST_PLACES = 6  # of a shorter curve a correlation of 0.9 may be chance
_ALIKE = 0.9  # correlation of the usual gyro with the median of the lot, and of a mirrored one with its negative
_SWING = 3.0  # how much more or less than the median it may swing
_KNOWN = 0.8  # share of the lot that knows a temperature


def mirrored_units(entries: Sequence[FleetEntry]) -> list[str]:
    """Names of gyros whose curve is the lot's mirrored, axis by axis; none where the lot has no common one."""
    names: list[str] = []
    for axis in dict.fromkeys(entry.axis for entry in entries):
        lot = [(e.name, e.facts.curve) for e in entries if e.axis == axis and e.facts is not None]
        names += _mirrored_of(lot) if len(lot) >= _LEAST_SERIALS else []
    return names


def _mirrored_of(lot: Sequence[tuple[str, Sequence[float | None]]]) -> list[str]:
    curves = np.array([[np.nan if b is None else b for b in curve] for _, curve in lot], dtype=np.float64)
    known = np.mean(np.isfinite(curves), axis=0) >= _KNOWN
    curves = curves[:, known]
    if curves.shape[1] < _LEAST_PLACES:
        return []
    whole = np.flatnonzero(np.isfinite(curves).all(axis=1))
    shapes = curves[whole] - curves[whole].mean(axis=1, keepdims=True)
    usual = np.median(shapes, axis=0)
    swing = np.sqrt(np.mean(shapes**2, axis=1))
    size = float(np.sqrt(np.mean(usual**2)))
    if len(whole) < _LEAST_SERIALS or size == 0.0:
        return []
    alike = np.mean(shapes * usual, axis=1) / np.maximum(swing * size, np.finfo(float).tiny)
    if float(np.median(alike)) < _ALIKE:
        return []
    even = (swing < _SWING * size) & (swing > size / _SWING)
    return [lot[whole[k]][0] for k in np.flatnonzero((alike < -_ALIKE) & even)]


_DIGITS = 16  # of a hash
_LEAST_COMMON = 2  # hashes; one alone might be chance among 100,000 gyros
_CROWD = 16  # gyros of which one hash is known: enough to name


def copies(entries: Sequence[FleetEntry]) -> list[Copy]:
    """Return pairs of gyros of different serials that share rows, in the order of the entries."""
    words = [[e.sketch[k : k + _DIGITS] for k in range(0, len(e.sketch), _DIGITS)] for e in entries]
    holders: dict[str, list[int]] = defaultdict(list)
    for number, of_one in enumerate(words):
        for word in of_one:
            if len(holders[word]) < _CROWD:
                holders[word].append(number)
    common: Counter[tuple[int, int]] = Counter()
    for numbers in holders.values():
        common.update(combinations(numbers, 2))
    return [
        Copy(
            name=entries[a].name,
            serial=entries[a].serial or "",
            other=entries[b].name,
            other_serial=entries[b].serial or "",
            share=count / min(len(words[a]), len(words[b])),
        )
        for (a, b), count in sorted(common.items())
        if count >= min(_LEAST_COMMON, len(words[a])) and (entries[a].serial or "") != (entries[b].serial or "")
    ]


def with_copies(entries: Sequence[FleetEntry], found: Sequence[Copy]) -> list[FleetEntry]:
    """The entries, each of a pair with the finding `copy_of_other` and the others' names."""
    others: dict[str, list[str]] = defaultdict(list)
    for copy in found:
        others[copy.name].append(copy.other)
        others[copy.other].append(copy.name)
    return [
        entry.model_copy(update={"findings": (*entry.findings, "copy_of_other"), "copy_of": tuple(others[entry.name])})
        if entry.name in others and entry.model_hash is not None
        else entry
        for entry in entries
    ]
