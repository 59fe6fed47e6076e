"""A campaign (temperature records shared by many recordings) and the recordings drawn from it."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.linalg import solve_triangular

from . import chamber, effects, noise
from .effects import Scene
from .noise import Noise

Array = NDArray[np.float64]
ROW_S = 10
BLOCK_S = 100
_SENSOR_C = 0.003  # noise of one 10-s temperature row
_OF_MAP = ("cavity_lag", "time_misalignment", "thermometer_drift")
_CONTRAST = 30.0
_TRIES = 30
_EPOCH = datetime(2026, 3, 1, 8, tzinfo=timezone.utc)


@dataclass(frozen=True)
class Campaign:
    """Runs of one gyro: what the chamber did and what the thermometer recorded."""

    runs: list[chamber.Exposure]
    roles: list[str]
    days: list[float]
    recorded_c: list[Array]
    channel: list[Array]
    design: str


def mean_of(x: Array, seconds: int) -> Array:
    return np.asarray(x[: x.size // seconds * seconds].reshape(-1, seconds).mean(axis=1))


def draw_campaign(
    rng: np.random.Generator, design: str, *, hours: float = 8.0, exam: int = 2, drop: int = 0
) -> Campaign:
    """One or two sets of runs: the first for training (less `drop` runs), the second, cut short, for the exam."""
    make = chamber.paper_programmes if design == "paper" else chamber.separating_programmes
    unit = chamber.draw_unit(rng)
    runs, roles = [], []
    first = make(rng, hours)
    if drop:
        gone = set(rng.choice(len(first), drop, replace=False).tolist())
        first = [p for k, p in enumerate(first) if k not in gone]
    second = make(rng, hours)
    if design == "paper":
        second = [second[k] for k in (3, 4, 5, 0, 1, 2)]
    second = second[-exam:] if design != "paper" else second[:exam]
    for role, programmes in (("train", first), ("exam", second)):
        for name, programme, soak, lead in programmes:
            runs.append(chamber.expose(unit, name, programme, soak, lead, rng))
            roles.append(role)
    gaps = rng.uniform(0.7, 6.0, len(runs)) * rng.choice([1, 1, 1, 6], len(runs))
    days = np.cumsum(gaps).tolist()
    recorded = [mean_of(r.block_c, ROW_S) + rng.normal(0, _SENSOR_C, r.block_c.size // ROW_S) for r in runs]
    channel = [_supply(r.block_c.size, rng) for r in runs]
    return Campaign(runs, roles, days, recorded, channel, design)


def _supply(seconds: int, rng: np.random.Generator) -> Array:
    """A supply voltage that wanders for reasons of its own, volts."""
    knots = rng.normal(0, 0.05, seconds // 1800 + 3)
    slow = np.interp(np.arange(seconds), np.arange(knots.size) * 1800.0, knots)
    return np.asarray(5.0 + slow + rng.normal(0, 0.002, seconds))


@dataclass
class Hidden:
    """The truth about one recording. Stays in the memory of the grader."""

    names: list[str]
    k: list[float]
    amplitude: list[float]
    parameters: list[dict[str, float]]
    noise: Noise
    stress: str = ""
    declared: Noise | None = None  # what the data set says, where it differs from the truth
    rows: list[Array] = field(default_factory=list)  # deg/h at 10 s
    noise_rows: list[Array] = field(default_factory=list)


def _spline(x: Array, knots: int, degree: int = 3) -> Array:
    low, high = float(x.min()), float(x.max())
    span = max(high - low, 1e-6)
    inner = np.linspace(low - 1e-6 * span, high + 1e-6 * span, knots)
    grid = np.concatenate([[inner[0]] * degree, inner, [inner[-1]] * degree])
    return np.asarray(BSpline.design_matrix(x, grid, degree).toarray())


class Yardstick:
    """Matched-filter signal-to-noise ratio of an effect after the best static map is taken out.

    The map is a spline of T plus dT/dt times a coarser one, and its square, fitted by generalised least
    squares under the true covariance: nothing of the tool is used.
    """

    def __init__(self, campaign: Campaign) -> None:
        self.use = [k for k, role in enumerate(campaign.roles) if role == "train"]
        t = [mean_of(campaign.runs[k].block_c, BLOCK_S) for k in self.use]
        r = [np.gradient(x) * 60.0 / BLOCK_S for x in t]
        fine, coarse = _spline(np.concatenate(t), 12), _spline(np.concatenate(t), 5)
        rate = np.concatenate(r)[:, None] / np.abs(np.concatenate(r)).max()
        parts = [fine, coarse * rate, coarse * rate**2]
        left, size, _ = np.linalg.svd(np.column_stack(parts), full_matrices=False)
        self.map = left[:, size > 1e-3 * size[0]]
        self.lengths = [x.size for x in t]

    def d(self, effect: list[Array], level: Noise) -> float:
        """d of one effect given per run at one second."""
        h = np.concatenate([mean_of(effect[k], BLOCK_S) for k in self.use])
        factor = {n: np.linalg.cholesky(noise.covariance(level, n, BLOCK_S)) for n in set(self.lengths)}
        white = np.empty((h.size, self.map.shape[1] + 1))
        at = 0
        for n in self.lengths:
            part = np.column_stack([self.map[at : at + n], h[at : at + n]])
            white[at : at + n] = solve_triangular(factor[n], part, lower=True)
            at += n
        q, _ = np.linalg.qr(white[:, :-1])
        rest = white[:, -1] - q @ (q.T @ white[:, -1])
        return float(np.linalg.norm(rest))


def draw_recording(
    campaign: Campaign,
    yardstick: Yardstick,
    wanted: list[tuple[str, float]],
    level: Noise,
    rng: np.random.Generator,
    *,
    stress: str = "",
) -> Hidden:
    """Hides the wanted mechanisms (name, k = d/6) in a fresh map and fresh noise."""
    scene = Scene(campaign.runs, campaign.days, effects.draw_map(rng), {"supply_v": campaign.channel})
    pool = effects.CATALOGUE | effects.FOREIGN | effects.FOREIGN_RANDOM
    truth = Hidden([], [], [], [], level, stress)
    total = [np.zeros(r.block_c.size) for r in campaign.runs]
    contrast = 1.0
    for name, k in wanted:
        for _ in range(_TRIES):
            shape, parameters = pool[name](scene, rng)
            d = yardstick.d(shape, level)
            amplitude = 6.0 * k / max(d, 1e-12)
            if name not in _OF_MAP or amplitude <= _CONTRAST:
                break
            scene.map = effects.draw_map(rng)  # no gyro has a map so steep that this one could be seen
        if name in _OF_MAP:
            contrast = amplitude  # these scale the map itself; the sign is the map's own
        else:
            amplitude *= float(rng.choice([-1.0, 1.0]))
        total = [a + amplitude * b for a, b in zip(total, shape, strict=True)]
        truth.names.append(name)
        truth.k.append(k)
        truth.amplitude.append(amplitude)
        truth.parameters.append(parameters)
    offset = rng.uniform(-0.01, 0.01)
    for run, extra in zip(campaign.runs, total, strict=True):
        seen = run.block_c
        if stress == "sensor_lag":  # the bias knows T before the thermometer does: T = T_s + tau dT_s/dt
            seen = seen + 60.0 * np.gradient(seen)
        static = offset + contrast * scene.map(seen, np.gradient(seen) * 60.0)
        drawn = noise.draw(level, run.block_c.size, rng)
        rows = _stressed(mean_of(drawn, ROW_S), mean_of(run.block_c, ROW_S), stress, level, rng)
        truth.noise_rows.append(rows)
        truth.rows.append(rows + mean_of(static + extra, ROW_S))
    return truth


def _stressed(rows: Array, t: Array, stress: str, level: Noise, rng: np.random.Generator) -> Array:
    """Noise that the tool's model of noise does not foresee."""
    if stress == "outliers":
        sigma = level.white_dph * (100.0 / ROW_S) ** 0.5
        hit = rng.uniform(size=rows.size) < 0.005
        size = rng.uniform(6, 20, rows.size) * rng.choice([-1, 1], rows.size)
        return np.asarray(rows + hit * size * sigma)
    if stress == "variance_ramps":
        moving = np.clip(np.abs(np.gradient(t)) * 60.0 / ROW_S, 0, 1)
        return np.asarray(rows * (1.0 + 0.6 * moving))
    if stress == "variance_cold":
        return np.asarray(rows * (1.0 + 1.5 / (1.0 + np.exp((t + 10.0) / 4.0))))
    return rows


def write(
    campaign: Campaign, truth: Hidden, folder: Path, *, declare: bool, serial: str, row_decimals: int = 9
) -> None:
    """Writes what a user would have: a dataset.toml and one CSV per run. No word of the truth."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = ["schema = 1", f'serial = "{serial}"', 'earth_rate = "none"']
    if declare:
        lines += ["", "[noise]"] + [
            f"{k} = {float(v)!r}" for k, v in (truth.declared or truth.noise).declared().items()
        ]
    for k, (run, role) in enumerate(zip(campaign.runs, campaign.roles, strict=True)):
        name = f"run-{k + 1:02d}.csv"
        started = (_EPOCH + timedelta(days=campaign.days[k])).isoformat()
        lines += [
            "",
            "[[run]]",
            f'file = "{name}"',
            f'role = "{role}"',
            f"environment = {json.dumps(run.name)}",
        ]
        lines += [f"started = {started}", f"power_on_s = {-run.lead_s}"]
        n = campaign.recorded_c[k].size
        table = np.column_stack(
            [
                (np.arange(n) + 1.0) * ROW_S,
                campaign.recorded_c[k],
                truth.rows[k],
                mean_of(campaign.channel[k], ROW_S),
            ]
        )
        np.savetxt(
            folder / name,
            table,
            fmt=["%.1f", "%.5f", f"%.{row_decimals}f", "%.5f"],
            delimiter=",",
            header="time_s,temperature_c,rate_dph,supply_v",
            comments="",
        )
    (folder / "dataset.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
