"""docs/results/paper.json: every figure that docs/paper.md prints, in full digits, and what it was made with."""

from __future__ import annotations

import math
import platform
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from .. import _core
from ..simulate.campaign import Noise
from .experiment import Experiment, experiment

__all__ = ["SEEDS", "TOLERANCE", "departures", "made_with", "measured"]

SEEDS = range(1, 11)
"""The ten gyros; Table 1 and the figures are of the first."""
TOLERANCE = 1e-6
"""Relative, where libraries, compiler and machine are those of the record. Other kernels of the same BLAS moved figures
by up to 5e-7: where the search for the default's evidence ends depends on rounding."""
_TOLERANCE_ELSEWHERE = 1e-3
"""Relative, elsewhere: other libraries round otherwise, and no choice of a center is near enough to depend on that."""
_DIGITS = 10  # kept of a figure
_SERIES_DIGITS = 7  # decimals of what is drawn, deg/h: a seven-thousandth of the noise
_SERIES = ("mlr", "rbf_random", "mrbf_paper")  # methods that the paper draws
_NOISES: tuple[Noise, ...] = ("paper", "class")


def made_with() -> dict[str, str]:
    """Versions and machine that the last digits depend on."""
    return {
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "compiler": _core.compiler,
        "machine": platform.machine(),
    }


def measured(seeds: Sequence[int] = SEEDS) -> dict[str, Any]:
    """The experiment on the gyros of `seeds` with the paper's noise and that of an ordinary unit."""
    gyros: dict[str, dict[str, Any]] = {noise: {} for noise in _NOISES}
    series: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        for noise in _NOISES:
            for seed in seeds:
                found = experiment(seed, noise, Path(folder) / f"{noise}-{seed}")
                gyros[noise][str(seed)] = found.figures()
                if not series:
                    series = _series(found)
    kept: dict[str, Any] = _rounded({"gyros": gyros})
    return {"made_with": made_with(), **kept, "series": series}


def _series(result: Experiment) -> dict[str, Any]:
    """Means over 100 s that the figures show, deg/h: measured, and what each model says."""
    cells = {"measured": result.cells["constant"], **{name: result.cells[name] for name in _SERIES}}
    return {
        name: {
            environment: np.round(
                cell.before if name == "measured" else cell.predicted, _SERIES_DIGITS
            ).tolist()
            for environment, cell in of.items()
        }
        for name, of in cells.items()
    }


def _rounded(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _rounded(inner) for key, inner in value.items()}
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value


def departures(recorded: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    """Where what was measured now departs from the record by more than is allowed; only gyros measured now count."""
    same = recorded["made_with"] == now["made_with"]
    allowed = TOLERANCE if same else _TOLERANCE_ELSEWHERE
    for noise, gyros in now["gyros"].items():
        for seed, figures in gyros.items():
            there = recorded["gyros"].get(noise, {}).get(seed, {})
            for place, was, found in _pairs(there, figures, f"{noise} noise, gyro {seed}"):
                size = _size(figures) if place.endswith(", mean_dph") else abs(found)
                if was is None or not abs(found - was) <= allowed * size:
                    yield f"{place}: {was} recorded, {found} now; allowed {allowed:g} of it"
    if "series" in now:
        allowed_dph = 10.0 ** -(_SERIES_DIGITS if same else _SERIES_DIGITS - 1)
        for place, was, found in _pairs(recorded["series"], now["series"], "series"):
            apart = (
                math.inf if was is None or len(was) != len(found) else np.abs(np.subtract(was, found)).max()
            )
            if apart > allowed_dph * (1.0 + 1e-9):
                yield f"{place}: {apart:g} deg/h from the record, allowed {allowed_dph:g}"


def _size(figures: Mapping[str, Any]) -> float:
    """What a mean is measured by, which may be 0: the noise of the exam runs."""
    return float(figures["floor_dph"])


def _pairs(was: Any, now: Mapping[str, Any], place: str) -> Iterator[tuple[str, Any, Any]]:
    for key, value in now.items():
        before = was.get(key) if isinstance(was, Mapping) else None
        if isinstance(value, Mapping):
            yield from _pairs(before, value, f"{place}, {key}")
        else:
            yield f"{place}, {key}", before, value
