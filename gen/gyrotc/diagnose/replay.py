"""Runs as the target would see them, with the states of extension terms in force; fits and scores on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from ..dataset import Dataset, Run
from ..fitting import FrontEnd, samples_of
from ..metrics import Averages, average
from ..terms.operators import play
from ..train import Fit, TrainingData, fit, predict
from .refine import Refined

__all__ = ["Effect", "Played", "fit_extended", "joined", "play_runs", "samples", "score"]

Array = NDArray[np.float64]

_MANY_CENTERS = 24
_RE_ZERO_S = 600.0
_FLAT = 1e3  # width over dT/dt, in half ranges, of a map of T alone


@dataclass(frozen=True, slots=True)
class Effect:
    """A cause with its fitted parameters, as the replay applies it."""

    id: str
    values: dict[str, float]
    channel: str | None = None

    @staticmethod
    def of(cause: Refined) -> Effect:
        """The effect with the middle of every interval."""
        values = {name: interval.value for name, interval in cause.parameters.items()}
        return Effect(cause.candidate.id, cause.candidate.values | values, cause.candidate.channel)


@dataclass(frozen=True)
class Played:
    """One run after the front end, one entry per block.

    Attributes:
        data: Training samples (used blocks only); inputs are those in force.
        used: Which blocks these are, shape (n,).
        mean_c: Mean temperature of every block, bridged, shape (n,).
        on_s: Time since power-on at the start of every block, s, or None.
        day: Days since the first run, or None.
        channels: Channel means of every block.
        block_s: Length of a block, s.
        environment: As in the data set.
    """

    data: TrainingData
    used: NDArray[np.bool_]
    mean_c: Array
    on_s: Array | None
    day: float | None
    channels: dict[str, Array]
    block_s: float
    environment: str


def play_runs(dataset: Dataset, runs: Sequence[Run], front: FrontEnd) -> list[Played]:
    """Front end over all runs."""
    first = min((r.started for r in dataset.runs if r.started is not None), default=None)
    return [_played(dataset, run, k, front, first) for k, run in enumerate(runs)]


def _played(dataset: Dataset, run: Run, number: int, front: FrontEnd, first: datetime | None) -> Played:
    blocks = front.blocks(run)
    used = blocks.valid & (blocks.rows > 0) & np.isfinite(blocks.temperature_c)
    rows = run.rows()
    n = blocks.start_s.size
    mean = np.where(blocks.valid, blocks.mean_c.astype(np.float64), np.nan)
    index = np.clip(np.searchsorted(blocks.start_s, rows.time_s + 1e-6, side="right") - 1, 0, n - 1)
    count = np.maximum(np.bincount(index, minlength=n), 1)
    channels = {
        name: np.bincount(index, weights=np.nan_to_num(rows.channels[name]), minlength=n) / count
        for name in dataset.channels
    }
    day = None
    if run.started is not None and first is not None:
        day = (run.started - first).total_seconds() / 86400.0
    on = None if run.power_on_s is None else blocks.start_s - run.power_on_s
    return Played(
        data=samples_of(blocks, front.block_s, number),
        used=used,
        mean_c=_bridged(mean),
        on_s=on,
        day=day,
        channels=channels,
        block_s=front.block_s,
        environment=run.environment,
    )


def _bridged(values: Array) -> Array:
    good = np.flatnonzero(np.isfinite(values))
    if good.size == 0:
        return np.zeros_like(values)
    return np.interp(np.arange(values.size), good, values[good])


def _in_force(state: Array) -> Array:
    """State after block n−1 for every block n; the first block has the first state."""
    return np.concatenate([state[:1], state[:-1]])


def _memory(tau_s: float, mean_c: Array, block_s: float) -> Array:
    """z after every block: z ← z + a (T − z), at rest on the first block."""
    a = -np.expm1(-block_s / tau_s)
    return np.asarray(lfilter([a], [1.0, a - 1.0], mean_c, zi=[(1.0 - a) * mean_c[0]])[0])


def _added(run: Played, effect: Effect) -> Array:
    """What a term adds in every block, deg/h."""
    v, n = effect.values, run.mean_c.size
    if effect.id == "thermal_gradient":
        z = _memory(v["tau_s"], run.mean_c, run.block_s)
        return _in_force(v["amplitude_dph_per_c"] * (z - run.mean_c))
    if effect.id == "hysteresis":
        z = play(v["width_c"], run.mean_c)
        return _in_force(v["amplitude_dph_per_c"] * (z - run.mean_c))
    if effect.id == "warm_up" and run.on_s is not None:
        return np.asarray(v["amplitude_dph"] * np.exp(-np.maximum(run.on_s, 0.0) / v["tau_s"]))
    if effect.id == "path_length_periodicity":
        angle = 2.0 * np.pi * run.mean_c / v["period_c"] + v["phase_rad"]
        return _in_force(v["amplitude_dph"] * np.cos(angle))
    if effect.id == "auxiliary" and effect.channel is not None:
        return _in_force(v["slope_dph_per_unit"] * (run.channels[effect.channel] - v["reference"]))
    if effect.id == "ageing" and run.day is not None:
        d0 = v["d0_day"]
        passed = run.day if np.isinf(d0) else d0 * np.log1p(run.day / d0)
        return np.full(n, v["slope_dph_per_day"] * passed)
    return np.zeros(n)


def _seen(run: Played, effects: Sequence[Effect]) -> tuple[Array, Array]:
    """Temperature and rate (C/min) that the map sees in the used blocks."""
    temperature, slope = run.data.temperature_c, run.data.slope_c_per_min
    for effect in effects:
        if effect.id == "cavity_lag":
            tau = effect.values["tau_s"]
            z = _memory(tau, run.mean_c, run.block_s)
            rate = _in_force((run.mean_c - z) * (60.0 / tau))
            temperature, slope = _in_force(z)[run.used], rate[run.used]
        elif effect.id == "time_misalignment":
            time = run.data.time_s
            later = time + effect.values["shift_s"]
            temperature = np.interp(later, time, temperature)
            slope = np.interp(later, time, slope)
    return temperature, slope


def samples(run: Played, effects: Sequence[Effect]) -> TrainingData:
    """Training samples with the inputs that the effects give and their additions taken off."""
    temperature, slope = _seen(run, effects)
    total = sum((_added(run, e)[run.used] for e in effects), np.zeros(temperature.size))
    return replace(
        run.data, temperature_c=temperature, slope_c_per_min=slope, bias_dph=run.data.bias_dph - total
    )


def joined(parts: Sequence[TrainingData]) -> TrainingData:
    """Samples of several runs as one."""
    names = TrainingData.__dataclass_fields__
    return TrainingData(**{n: np.concatenate([getattr(p, n) for p in parts]) for n in names})


def fit_extended(
    runs: Sequence[Played],
    effects: Sequence[Effect],
    arguments: dict[str, Any],
    kept: Sequence[NDArray[np.bool_]] | None = None,
    *,
    rate: bool = True,
) -> Fit:
    """The map refitted beside the effects, on the samples `kept` (default: all); without `rate` a map of T alone."""
    parts = [samples(run, effects) for run in runs]
    if kept is not None:
        parts = [p.select(k) for p, k in zip(parts, kept, strict=True) if k.any()]
    if any(e.id == "map_too_coarse" for e in effects):
        arguments = arguments | {"centers": _MANY_CENTERS}
    data = joined(parts)
    return fit(data, **arguments) if rate else _over_any_rate(data, arguments)


def _over_any_rate(data: TrainingData, arguments: dict[str, Any]) -> Fit:
    """A map of T alone, valid over the rates of the samples."""
    slope = data.slope_c_per_min
    fitted = fit(replace(data, slope_c_per_min=np.zeros_like(slope)), **arguments)
    flat = [
        {
            **n,
            "linear": [n["linear"][0], 0.0],
            "centers": [[c[0], 0.0] for c in n["centers"]],
            "widths": [[w[0], _FLAT] for w in n["widths"]],
        }
        for n in fitted.networks
    ]
    scaling = replace(
        fitted.scaling,
        half_range_c_per_min=max(float(np.abs(slope).max()), fitted.scaling.half_range_c_per_min),
        slope_c_per_min=(float(slope.min()), float(slope.max())),
    )
    return replace(fitted, outcome=replace(fitted.outcome, networks=flat), scaling=scaling)


def score(
    fitted: Fit,
    runs: Sequence[Played],
    effects: Sequence[Effect],
    average_s: float,
    scored: Sequence[NDArray[np.bool_]],
) -> list[Averages]:
    """Residuals of the scored samples of every run as means over `average_s`; runs without any drop out."""
    out = []
    for run, chosen in zip(runs, scored, strict=True):
        if not chosen.any():
            continue
        data = samples(run, effects)
        rest = data.bias_dph - predict(fitted, data.temperature_c, data.slope_c_per_min)
        if any(e.id == "turn_on_offset" for e in effects):
            rest = rest - rest[data.time_s < data.time_s[0] + _RE_ZERO_S].mean()
        out.append(
            average(
                data.time_s,
                run.data.temperature_c,
                run.data.bias_dph,
                rest,
                scored=chosen,
                average_s=max(average_s, run.block_s),
            )
        )
    return out
