"""Drawn calibrations of a gyro, clean or with a fault in one run."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

Floats = NDArray[np.float64]
FAULTS = ("late", "held", "paired", "reversed", "copied")


@dataclass
class Recorded:
    """One run: times s, temperatures C, rates deg/h."""

    time_s: Floats
    temperature_c: Floats
    rate_dph: Floats


@dataclass(frozen=True)
class Gyro:
    """A gyro's bias over temperature, deg/h: a curve, and a lag of its temperature behind the thermometer's."""

    curve: Floats
    lag_s: float
    noise_dph: float

    def bias(self, temperature_c: Floats) -> Floats:
        """Of its own temperature, C."""
        return np.asarray(np.polynomial.chebyshev.chebval((temperature_c - 10.0) / 50.0, self.curve))


def drawn_gyro(rng: np.random.Generator) -> Gyro:
    """A bias that swings by 20 to 60 times the noise of a row over the range of a chamber."""
    noise = float(10.0 ** rng.uniform(-3.0, 0.0))
    curve = rng.normal(0.0, [1.0, 1.0, 0.5, 0.3])
    swing = noise * float(10.0 ** rng.uniform(1.3, 1.8))
    return Gyro(curve * swing / np.ptp(np.polynomial.chebyshev.chebval(np.linspace(-1, 1, 50), curve)), 0.0, noise)


def drawn_run(gyro: Gyro, rng: np.random.Generator, rows: int, period_s: float) -> Recorded:
    """Ramps of 0.8 to 3 C/min to both ends of the range, then to drawn temperatures, with holds."""
    time = period_s * np.arange(rows)
    temperature, at = np.empty(rows), 0
    now = float(rng.uniform(-35.0, 55.0))
    goals = [-40.0, 60.0] if rng.random() < 0.5 else [60.0, -40.0]
    while at < rows:
        goal = goals.pop() if goals else float(rng.uniform(-38.0, 58.0))
        n = max(2, round(abs(goal - now) / rng.uniform(0.8, 3.0) * 60.0 / period_s))
        hold = int(rng.uniform(0.0, 1200.0) / period_s)
        part = np.r_[np.linspace(now, goal, n), np.full(hold, goal)][: rows - at]
        temperature[at : at + len(part)] = part
        at, now = at + len(part), goal
    kernel = np.exp(-np.arange(0.0, 600.0, period_s) / 90.0)  # a housing follows the air within minutes
    kernel /= kernel.sum()
    padded = np.r_[np.full(len(kernel) - 1, temperature[0]), temperature]
    temperature = np.convolve(padded, kernel, "valid")
    rate = gyro.bias(temperature) + rng.normal(0.0, gyro.noise_dph, rows)
    return Recorded(time, np.round(temperature + rng.normal(0.0, 0.005, rows), 3), rate)


def drawn_set(rng: np.random.Generator) -> list[Recorded]:
    """Four training runs and an exam of a drawn gyro."""
    gyro = drawn_gyro(rng)
    period = float(rng.choice([5.0, 10.0, 20.0]))
    runs = [drawn_run(gyro, rng, int(rng.uniform(5.0, 10.0) * 3600.0 / period), period) for _ in range(5)]
    return runs


def faulty(runs: list[Recorded], way: str, rng: np.random.Generator) -> list[Recorded]:
    """The set with a fault in one training run."""
    found = [Recorded(r.time_s, r.temperature_c.copy(), r.rate_dph.copy()) for r in runs]
    k = int(rng.integers(4))
    one = found[k]
    period = one.time_s[1] - one.time_s[0]
    if way == "late":
        late = round(rng.uniform(60.0, 300.0) / period)
        one.temperature_c = np.r_[np.full(late, one.temperature_c[0]), one.temperature_c[:-late]]
    elif way == "held":
        each = int(rng.integers(3, 30))
        one.rate_dph = one.rate_dph[np.arange(len(one.rate_dph)) // each * each]
    elif way == "paired":
        other = found[(k + 1) % 4].temperature_c
        n = min(len(other), len(one.time_s))
        found[k] = Recorded(one.time_s[:n], other[:n], one.rate_dph[:n])
    elif way == "reversed":
        one.rate_dph = one.rate_dph[::-1].copy()
    else:
        found[k] = found[(k + 1) % 4]
    return found


def written(folder: Path, runs: list[Recorded]) -> Path:
    """A data set of runs, of which the last is the exam."""
    folder.mkdir()
    text = 'schema = 1\nserial = "RLG-0042"\nearth_rate = "removed"\n'
    for k, run in enumerate(runs):
        role = "exam" if run is runs[-1] else "train"
        columns = {"time_s": run.time_s, "temperature_c": run.temperature_c, "rate_dph": run.rate_dph}
        pq.write_table(pa.table(columns), folder / f"run-{k + 1}.parquet")
        text += f'[[run]]\nfile = "run-{k + 1}.parquet"\nrole = "{role}"\n'
    (folder / "dataset.toml").write_text(text, "utf-8")
    return folder
