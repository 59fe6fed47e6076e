"""Fifty simulated units that come back, changed in five ways or not at all: what each way to recalibrate them leaves.

Each unit is calibrated from five runs. Then its bias changes, and a check run is recorded: 5 h over the whole range
(0 C → 60 C, two hours there, → −40 C at 5 C/min), or the first 2.5 h of it, which leave out all below 0 C. It is judged
on the exam's six environments, changed in the same way: the RMS of compensated 100-s means over the floor of the noise
that was really added. As found: by the earlier correction. Offset only: the same, moved by the mean of what it leaves
of the check run. Full: the check run alone. Chosen: `--prior`.
"""

from __future__ import annotations

import math
import multiprocessing
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from gyrotc.simulate import LotOrder, SimulatedGyro, draw_lot, read, with_noise
from gyrotc.train import Fit, TrainingData, cleaned_samples, fit, fit_process, predict
from gyrotc.train.prior import EarlierPrior, posterior_of_process, widened
from numpy.typing import NDArray

from ..campaigns import say
from .new_units import Exam, recordings_of

Floats = NDArray[np.float64]
Change = Callable[[Floats, Floats], Floats]

_ANOTHER = "another unit's map"
UNITS, SEED = 50, 36
_EARLIER = 5  # runs of the earlier calibration; the check run is of the sixth
_SIZE_DPH = 2e-3  # of a change: about three sigma of the noise of 100-s means, a fortieth of the bias's own range
_NOISE = 0.02  # an RMS may be larger by this much by noise
_SIGMAS = 2.0  # of the excess's own standard error, beyond which the noise of the exam does not explain it
CHECKS_H = (5.0, 2.5)
WAYS = ("as found", "offset only", "full", "chosen")


def _changes(other: Fit) -> dict[str, Change]:
    """Return the changes of the bias by name; the last one makes a unit another one."""
    return {
        "none": lambda t, _: np.zeros(len(t)),
        "offset": lambda t, _: np.full(len(t), _SIZE_DPH),
        "offset and slope over T": lambda t, _: _SIZE_DPH * (0.5 + (t - 10.0) / 50.0),
        "dependence on the rate of T": lambda _, r: _SIZE_DPH * r,
        "a region of 20 C": lambda t, _: 1.5 * _SIZE_DPH * np.exp(-0.5 * ((t - 20.0) / 10.0) ** 2),
        _ANOTHER: lambda t, r: predict(other, t, r),
    }


def recalibrated(unit: SimulatedGyro, other: SimulatedGyro) -> dict[float, dict[str, dict[str, Any]]]:
    """By the hours of the check run and the kind of change: RMS over the floor for every way, and what was chosen.

    Args:
        other: Whose map the unit takes on in the last kind.
    """
    [(data, exam)] = recordings_of([unit], exam=True)
    [(others, _)] = recordings_of([other], exam=False)
    assert exam is not None
    early = data.select(data.run < _EARLIER)
    known = fit(early, method="auto")
    changes, prior = _changes(fit(others, method="auto")), _prior(early, known)
    last = data.run == _EARLIER
    began = float(data.time_s[last].min())
    checks = {h: data.select(last & (data.time_s < began + 3600.0 * h)) for h in CHECKS_H}
    return {
        h: {kind: _ways(check, exam, known, prior, kind, change) for kind, change in changes.items()}
        for h, check in checks.items()
    }


def _ways(
    check: TrainingData, exam: Exam, known: Fit, prior: EarlierPrior, kind: str, change: Change
) -> dict[str, Any]:
    of_unit = known if kind == _ANOTHER else None  # the other's map takes its place
    run = _changed(check, change, of_unit)
    left = run.bias_dph - predict(known, run.temperature_c, run.slope_c_per_min)
    new = fit(run, method="auto", prior=prior)
    assert new.prior is not None
    there = exam.temperature_c, exam.slope_c_per_min
    before = predict(known, *there)
    by_way = (
        before,
        before + float(np.average(left, weights=run.weight)),
        predict(fit(run, method="auto"), *there),
        predict(new, *there),
    )
    moved = change(*there) - (predict(of_unit, *there) if of_unit else 0.0)
    judged = Exam(*there, exam.bias_dph + moved, exam.truth_dph + moved, exam.mean)
    ratios = dict(zip(WAYS, (judged.judged(one)[0] for one in by_way), strict=True))
    best, chosen = by_way[0 if ratios["as found"] < ratios["offset only"] else 1], by_way[3]
    low, high = float(run.temperature_c.min()), float(run.temperature_c.max())
    seen = (low <= there[0]) & (there[0] <= high)
    return ratios | {
        "answer": new.prior.chosen,
        "significant": new.prior.moved.significant,
        "sigmas": _sigmas(judged, chosen, best),
        "seen": math.sqrt(_mse(judged, chosen, seen) / _mse(judged, best, seen)),
    }


def _mse(judged: Exam, predicted: Floats, kept: NDArray[np.bool_]) -> float:
    """Mean square of what is left of the 100-s means that lie in the temperatures that are kept."""
    return float(np.mean(judged.means(judged.bias_dph - predicted)[judged.means(kept.astype(float)) == 1.0] ** 2))


def _sigmas(judged: Exam, chosen: Floats, best: Floats) -> float:
    """Mean excess of the squares that the chosen map leaves, over its standard error by the noise of the exam."""
    excess = judged.means(judged.bias_dph - chosen) ** 2 - judged.means(judged.bias_dph - best) ** 2
    error = float(np.std(excess)) / math.sqrt(len(excess))
    return float(np.mean(excess)) / error if error else 0.0


def _changed(data: TrainingData, change: Change, replaced: Fit | None) -> TrainingData:
    more = change(data.temperature_c, data.slope_c_per_min)
    if replaced is not None:
        more = more - predict(replaced, data.temperature_c, data.slope_c_per_min)
    return replace(data, bias_dph=data.bias_dph + more)


def _prior(early: TrainingData, known: Fit) -> EarlierPrior:
    """Return the prior that `jobs.recalibration` reads from a result."""
    process = known.process or fit_process(cleaned_samples(early), known.scaling)
    return widened(posterior_of_process(process, known.scaling), 0.0, "none", "0" * 64, None)


def _one(number: int) -> dict[float, dict[str, dict[str, Any]]]:
    plan = with_noise(read("paper")[1], "paper")
    units = draw_lot(plan, LotOrder(UNITS + 1, 0.0), SEED)
    return recalibrated(units[number], units[number + 1])


def returned(workers: int, units: int = UNITS) -> list[dict[str, Any]]:
    """Return, for each length of the check run and kind of change, medians and worst of so many units."""
    rows: dict[tuple[float, str], list[dict[str, Any]]] = {}
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        for number, found in enumerate(pool.imap(_one, range(units)), 1):
            for hours, kinds in found.items():
                for kind, row in kinds.items():
                    rows.setdefault((hours, kind), []).append(row)
            say(f"unit {number} of {units}")
    return [_pooled(hours, kind, found) for (hours, kind), found in rows.items()]


def _pooled(hours: float, kind: str, units: list[dict[str, Any]]) -> dict[str, Any]:
    against = [u["chosen"] / min(u["as found"], u["offset only"]) for u in units]
    answers = Counter(u["answer"] for u in units)
    return {
        "hours": hours,
        "kind": kind,
        **{way.replace(" ", "_"): float(np.median([u[way] for u in units])) for way in WAYS},
        "worst": max(against),
        "beyond": sum(ratio > 1.0 + _NOISE for ratio in against),
        "beyond_noise": sum(r > 1.0 + _NOISE and u["sigmas"] > _SIGMAS for r, u in zip(against, units, strict=True)),
        "beyond_seen": sum(u["seen"] > 1.0 + _NOISE and r > 1.0 + _NOISE for r, u in zip(against, units, strict=True)),
        "answers": {name: answers[name] for name in ("unchanged", "offset", "slope", "full")},
        "significant": sum(bool(u["significant"]) for u in units),
    }
