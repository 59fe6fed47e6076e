"""How well figures of recordings are known: type A evaluations (JCGM 100:2008, 4.2).

Noise of a gyro is not white: neighbouring means belong together, so that the number of means says too much. RMS,
standard deviation, mean and improvement come from a delete-one-block jackknife (Efron and Stein 1981) over blocks of
an hour, whose scatter holds whatever correlation is shorter. Figures of windows (30 min, 1 h) and of the first ten
minutes are the root mean square of few normal numbers; the largest of many follows the extreme-value distribution of
Gumbel.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np

from ..common.arrays import FloatArray
from ..common.metrics import Averages
from ..results.evaluation import EvaluatedRun, FigureUncertainty

_BLOCK_S = 7200.0  # six correlation times of 20 minutes: hours were too short there, U held 86-90 % instead of 95
_LEAST_BLOCKS = 8  # shorter ones where an hour would give fewer: fewer squares hardly tell a variance
_LEAST_MEANS = 4  # in a block
_HALF_HOUR_S, _HOUR_S, _FIRST_S = 1800.0, 3600.0, 600.0  # the names of the figures say it


def figure_uncertainties(
    judged: Sequence[Averages],
    runs: Sequence[EvaluatedRun],
    average_s: float,
    *,
    scale: float = 1.0,
    floor: tuple[float, int | None] | None = None,
) -> dict[str, FigureUncertainty]:
    """Standard uncertainties by the names of limits; a figure that the recordings are too short for has none.

    Args:
        judged: Means over `average_s` of the runs that the model is judged by.
        runs: These runs as they were evaluated.
        average_s: Averaging, s.
        scale: 1, or the RMS of spans left out over that of `judged`, where these are training runs that stand in for
            them.
        floor: The noise floor (deg/h), and the number of means that it was estimated from (None: of a simulation).
    """
    blocks = _blocks(judged, average_s)
    found = _jackknife(blocks) if len(blocks) >= 2 else {}
    after = np.concatenate([a.after_dph for a in judged]) if judged else np.zeros(0)
    if after.size > 1:
        found["max_abs_dph"] = FigureUncertainty(
            standard=_of_largest(float(after.std()), after.size),
            freedom=None,
            method=f"extreme-value distribution of {after.size} means",
        )
    found = {name: _scaled(one, 1.0 / scale if name == "improvement" else scale) for name, one in found.items()}
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


def _blocks(judged: Sequence[Averages], average_s: float) -> list[tuple[FloatArray, FloatArray]]:
    """Stretches of at most an hour inside the runs: means before and after."""
    total = sum(a.after_dph.size for a in judged)
    length = min(_BLOCK_S / average_s, total / _LEAST_BLOCKS)
    length = max(length, float(_LEAST_MEANS))
    parts = []
    for a in judged:
        pieces = max(1, round(a.after_dph.size / length))
        cut = zip(np.array_split(a.before_dph, pieces), np.array_split(a.after_dph, pieces), strict=True)
        parts += [(before, after) for before, after in cut if after.size]
    return parts


def _jackknife(blocks: Sequence[tuple[FloatArray, FloatArray]]) -> dict[str, FigureUncertainty]:
    sums = np.array([(a.size, a.sum(), (a**2).sum(), (b**2).sum()) for b, a in blocks])
    n, first, second, before = (sums.sum(axis=0) - sums).T
    mean = first / n
    figures = {
        "rms_dph": np.sqrt(second / n),
        "std_dph": np.sqrt(np.maximum(second / n - mean**2, 0.0)),
        "mean_dph": mean,
    }
    if second.all():
        figures["improvement"] = np.sqrt(before / second)
    count = len(blocks)
    method = f"jackknife over {count} blocks of the recordings"
    return {
        name: FigureUncertainty(
            standard=float(np.sqrt((count - 1) * np.var(values))), freedom=float(count - 1), method=method
        )
        for name, values in figures.items()
    }


def _of_largest(sigma: float, count: int) -> float:
    """1 sigma of the largest magnitude of normal numbers: pi/sqrt(6) times Gumbel's scale sigma/sqrt(2 ln 2n)."""
    return float(sigma * np.pi / np.sqrt(6.0) / np.sqrt(2.0 * np.log(2.0 * count)))


def _of_windows(
    judged: Sequence[Averages], runs: Sequence[EvaluatedRun], average_s: float
) -> Iterable[tuple[str, FigureUncertainty]]:
    """Of the worst run's figure: RMS of m normal numbers, of which sqrt(1/2m) is unknown."""
    names: tuple[tuple[Literal["rms_30min_dph", "angle_1h_arcsec", "first_10min_rms_dph"], float], ...] = (
        ("rms_30min_dph", _HALF_HOUR_S),
        ("angle_1h_arcsec", _HOUR_S),
        ("first_10min_rms_dph", average_s),
    )
    for name, window_s in names:
        known = [(value, a) for a, run in zip(judged, runs, strict=True) if (value := getattr(run.after, name))]
        if not known:
            continue
        value, a = max(known, key=lambda pair: pair[0])
        length_s = _FIRST_S if name.startswith("first") else a.after_dph.size * average_s
        windows = max(1, int(length_s / window_s))
        yield (
            name,
            FigureUncertainty(
                standard=value / np.sqrt(2.0 * windows),
                freedom=float(windows),
                method=f"{windows} windows of the worst run, taken as normal",
            ),
        )


def _scaled(one: FigureUncertainty, factor: float) -> FigureUncertainty:
    return one if factor == 1.0 else one.model_copy(update={"standard": one.standard * factor})


def _over_floor(rms: FigureUncertainty, rms_dph: float, floor_dph: float, differences: int | None) -> FigureUncertainty:
    """Of RMS over floor, relative variances added; the floor's is 3/4n of n successive differences (von Neumann)."""
    of_floor = float(np.sqrt(0.75 / differences)) if differences else 0.0
    known = f"floor from {differences} successive differences" if differences else "floor of the simulation"
    relative = float(np.hypot(rms.standard / rms_dph, of_floor)) if rms_dph else 0.0
    return FigureUncertainty(
        standard=relative * rms_dph / floor_dph, freedom=rms.freedom, method=f"{rms.method}; {known}"
    )
