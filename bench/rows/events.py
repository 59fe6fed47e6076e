"""Events planted in one of four runs: found, named and placed.

Every set is a gyro of its own in a chamber of its own (`tests.blind.chamber`): four runs, a smooth bias over
temperature and its rate, white and flicker noise, one of three thermometers and of three row lengths, and one event, or
none. A seed makes the same sets again.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from gyrotc.quality import check, found_events
from gyrotc.recordings import load
from gyrotc.results import Finding

from tests.blind.chamber import Array, draw_unit, expose, steps
from tests.blind.noise import Noise, draw

from ..campaigns import say

FLOOR_DPH = 7e-4  # of 100-s means
RUNS, HOURS, STILL_C_PER_MIN = 4, 8.0, 0.1
ROWS_S, RESOLUTIONS_C = (1, 10, 60), (0.001, 0.0625, 0.1)
NEAR_S = 900.0  # of an event that is reported, from the planted one
WARNINGS = ("sign_reversed", "axes_exchanged", "runs_contradict", "thermometer_changed", "rate_outliers")


@dataclass
class Recording:
    """One run at 1 s: temperatures, true, read and of the air, rate, rows that are kept, where it is stuck."""

    true_c: Array
    read_c: Array
    air_c: Array
    rate_dph: Array
    kept: Array
    stuck: slice | None = None


@dataclass(frozen=True)
class Planted:
    """Planted event: the run, when (s; None: in all of it), and under which names it is right."""

    run: int
    at_s: float | None
    names: tuple[str, ...]


Plant = Callable[[Recording, float, np.random.Generator], None]


def step(floors: float) -> Plant:
    def plant(run: Recording, at: float, rng: np.random.Generator) -> None:
        run.rate_dph[int(at) :] += floors * FLOOR_DPH * rng.choice([-1.0, 1.0])

    return plant


def recovering(floors: float) -> Plant:
    def plant(run: Recording, at: float, rng: np.random.Generator) -> None:
        end = int(at + rng.uniform(600.0, 2400.0))
        run.rate_dph[int(at) : end] += floors * FLOOR_DPH * rng.choice([-1.0, 1.0])

    return plant


def transition(floors: float) -> Plant:
    """`at` is its middle."""

    def plant(run: Recording, at: float, rng: np.random.Generator) -> None:
        t, length = np.arange(run.rate_dph.size), rng.uniform(180.0, 600.0)
        share = np.clip((t - at) / length + 0.5, 0.0, 1.0)
        run.rate_dph += floors * FLOOR_DPH * rng.choice([-1.0, 1.0]) * share

    return plant


def drift(floors_per_h: float) -> Plant:
    def plant(run: Recording, at: float, rng: np.random.Generator) -> None:
        t = np.arange(run.rate_dph.size)
        slope = floors_per_h * FLOOR_DPH / 3600.0 * rng.choice([-1.0, 1.0])
        run.rate_dph += slope * np.maximum(t - at, 0.0)

    return plant


def gain_within(factor: float) -> Plant:
    def plant(run: Recording, at: float, rng: np.random.Generator) -> None:
        run.rate_dph[int(at) :] *= factor

    return plant


def gain_throughout(*factors: float) -> Plant:
    def plant(run: Recording, at: float, rng: np.random.Generator) -> None:
        run.rate_dph *= rng.choice(factors)

    return plant


def warmer(by_c: float) -> Plant:
    def plant(run: Recording, at: float, rng: np.random.Generator) -> None:
        run.read_c[int(at) :] += by_c

    return plant


def lost_contact(run: Recording, at: float, rng: np.random.Generator) -> None:
    """From a time on it reads the air about it, to some share, after a minute or two."""
    since = np.maximum(np.arange(run.read_c.size) - at, 0.0)
    share = rng.uniform(0.5, 0.9) * -np.expm1(-since / rng.uniform(20.0, 60.0))
    run.read_c += share * (run.air_c - run.true_c)


def stuck(run: Recording, at: float, rng: np.random.Generator) -> None:
    run.stuck = slice(int(at), int(at + rng.uniform(1200.0, 3600.0)))


def burst(run: Recording, at: float, rng: np.random.Generator) -> None:
    end = int(at + rng.uniform(60.0, 300.0))
    run.rate_dph[int(at) : end] += 150.0 * FLOOR_DPH * rng.standard_normal(end - int(at))


def dropout(run: Recording, at: float, rng: np.random.Generator) -> None:
    run.kept[int(at) : int(at + rng.uniform(900.0, 1800.0))] = False


SIZES = (6.0, 8.0, 12.0, 16.0, 30.0)
KINDS: dict[str, tuple[Plant | None, str, tuple[str, ...]]] = {
    "clean": (None, "any", ()),  # every limit of false events is held against it
    **{f"step, hold {s:g}": (step(s), "hold", ("step",)) for s in SIZES},
    **{f"step, ramp {s:g}": (step(s), "ramp", ("step",)) for s in SIZES},
    "step and recovery 12": (recovering(12.0), "any", ("step_and_recover",)),
    "transition 16": (transition(16.0), "any", ("transition",)),
    "drift 12 an hour": (drift(12.0), "hold", ("ramp",)),
    "drift 40 an hour": (drift(40.0), "hold", ("ramp",)),
    "gain within 1.5": (gain_within(1.5), "any", ("gain_changed",)),
    "gain within 2.5": (gain_within(2.5), "any", ("gain_changed",)),
    "gain of a run 1.5": (gain_throughout(1.5), "run", ("gain_changed",)),
    "sign of a run": (gain_throughout(-1.0), "run", ("sign_reversed",)),
    "other unit": (
        gain_throughout(1e-3, 1.0 / 57.29578, 57.29578, 1e3, 3600.0),
        "run",
        ("gain_changed", "unit_changed", "unit"),
    ),
    "thermometer +1.5 C": (warmer(1.5), "any", ("jump_in_temperature",)),
    "lost contact": (lost_contact, "any", ("jump_in_temperature", "stuck_temperature", "thermometer_changed")),
    "stuck": (stuck, "ramp", ("stuck_temperature",)),
    "burst": (burst, "any", ("rate_outliers",)),
    "dropout": (dropout, "any", ("dropout", "restart")),
}


def draw_temperatures(rng: np.random.Generator) -> list[tuple[Array, Array]]:
    """A chamber and the runs in it: temperature of the block, and of the air about it."""
    unit = draw_unit(rng)
    runs = []
    for k in range(RUNS):
        legs = [
            (float(rng.uniform(0.7, 4.0)), float(rng.uniform(*((30, 60) if j % 2 else (-40, 0)))), 60.0 * m)
            for j, m in enumerate(rng.uniform(25.0, 150.0, 8))
        ]
        start = float(rng.uniform(-10.0, 30.0))
        programme = steps(start, legs[k % 2 :], round(3600.0 * HOURS))
        one = expose(unit, str(k), programme, start, 1800, rng)
        runs.append((one.block_c, programme - one.load))
    return runs


def draw_set(kind: str, resolution: float, rng: np.random.Generator) -> tuple[list[Recording], Planted]:
    """Four runs at 1 s with an event in one."""
    temperatures = draw_temperatures(rng)
    level = Noise(FLOOR_DPH, flicker_dph=FLOOR_DPH * rng.uniform(0.0, 0.25))
    bias = draw_bias(rng)
    runs = []
    for block, air in temperatures:
        rate = bias(block) + draw(level, block.size, rng)
        runs.append(Recording(block, block.copy(), air, rate, np.ones(block.size, dtype=bool)))
    plant, where, names = KINDS[kind]
    number = int(rng.integers(RUNS))
    at = None if where == "run" else draw_place(runs[number].true_c, where, rng)
    if plant is not None:
        plant(runs[number], at or 0.0, rng)
    dither = rng.choice([0.0, 0.2, 0.5, 1.0]) * resolution if resolution > 0.01 else 2.0 * resolution
    for run in runs:
        noise = dither * rng.standard_normal(run.read_c.size)
        run.read_c = resolution * np.round((run.read_c + noise) / resolution)
        if run.stuck is not None:
            run.read_c[run.stuck] = run.read_c[run.stuck.start]
    return runs, Planted(number, at, names)


def draw_bias(rng: np.random.Generator) -> Callable[[Array], Array]:
    """Offset, a curve over temperature that swings by 10 to 40 floors, and a share of dT/dt."""
    swing, tilt, middle = (rng.uniform(10.0, 40.0) * FLOOR_DPH, rng.uniform(-1.0, 1.0), rng.uniform(-20.0, 40.0))
    width, bend = rng.uniform(12.0, 40.0), rng.uniform(-1.0, 1.0)
    offset, share = rng.uniform(-0.05, 0.05), rng.uniform(-3.0, 3.0) * FLOOR_DPH

    def bias(t: Array) -> Array:
        u = t / 50.0
        curve = tilt * u + bend * u**2 + np.tanh((t - middle) / width)
        return np.asarray(offset + 0.5 * swing * curve + share * np.gradient(t) * 60.0)

    return bias


def draw_place(temperature: Array, where: str, rng: np.random.Generator) -> float:
    """A time well within the run, in a hold or on a ramp."""
    times = np.arange(4200, temperature.size - 4200)
    slope = np.abs(np.gradient(temperature))[times] * 60.0
    there = {"hold": slope < STILL_C_PER_MIN, "ramp": slope > 5.0 * STILL_C_PER_MIN, "any": slope >= 0.0}[where]
    return float(rng.choice(times[there])) if there.any() else float(rng.choice(times))


def write(runs: list[Recording], row_s: int, averaged: bool, folder: Path) -> None:
    """A folder as a user would have it: rates as means over the rows, temperatures as means or as read at the end."""
    lines = ["schema = 1", 'serial = "E"', 'earth_rate = "none"']
    for k, run in enumerate(runs):
        n = run.rate_dph.size // row_s * row_s
        kept = run.kept[:n].reshape(-1, row_s).all(axis=1)
        read = run.read_c[:n].reshape(-1, row_s)
        columns = {
            "time_s": (np.arange(n // row_s) + 1.0) * row_s,
            "temperature_c": np.round(read.mean(axis=1), 4) if averaged else read[:, -1],
            "rate_dph": np.round(run.rate_dph[:n].reshape(-1, row_s).mean(axis=1), 9),
        }
        pq.write_table(pa.table({name: v[kept] for name, v in columns.items()}), folder / f"{k}.parquet")
        lines += ["", "[[run]]", f'file = "{k}.parquet"']
    (folder / "dataset.toml").write_text("\n".join(lines) + "\n", "utf-8")


@dataclass(frozen=True)
class Score:
    """Of one set: what was reported at the event: any, the right name, true limits; what else."""

    found: bool
    named: bool
    holds: bool
    other: tuple[str, ...]


def intervals(event: Finding) -> list[tuple[float, float]]:
    """Limits of an event's time; spikes have one for all."""
    return [] if event.time_s is None else [(event.time_s.low or 0.0, event.time_s.high or 0.0)]


def judge(folder: Path, planted: Planted, warnings: bool) -> Score:
    """What gyrotc tells of a folder, beside what was planted."""
    near, other = [], []
    for event in found_events(load(folder)):
        here = event.file == f"{planted.run}.parquet" and bool(planted.names)
        if here and planted.at_s is not None and not event.whole_run:
            here = any(low - NEAR_S <= planted.at_s <= high + NEAR_S for low, high in intervals(event))
        (near if here else other).append((event.id, intervals(event)))
    ids = [id for id, _ in near]
    if warnings:
        result = check(folder)
        ids += ["unit" for p in result.problems if f"{planted.run}.parquet" in p.where]
        ids += [d.id for d in result.warnings if d.id in WARNINGS and f"{planted.run}.parquet" in d.where]
    right = [time for id, time in near if id in planted.names]
    at = planted.at_s
    holds = at is not None and any(low <= at <= high for of_event in right for low, high in of_event)
    return Score(bool(ids), any(id in planted.names for id in ids), holds, tuple(id for id, _ in other))


def scores(kind: str, seed: int, each: int) -> Iterator[Score]:
    """One score for each set; row lengths and thermometers go round."""
    number = list(KINDS).index(kind)
    for k in range(each):
        rng = np.random.default_rng([seed, number, k])
        row_s, resolution = ROWS_S[k % 3], RESOLUTIONS_C[k // 3 % 3]
        runs, planted = draw_set(kind, resolution, rng)
        with tempfile.TemporaryDirectory(prefix="events-") as name:
            write(runs, row_s, bool(rng.integers(2)), Path(name))
            yield judge(Path(name), planted, warnings=planted.at_s is None or kind == "lost contact")


def row(job: tuple[str, int, int]) -> dict[str, Any]:
    """A row of the table, for a kind, a seed and so many sets; `by_row` counts what is named in rows of 1, 10, 60 s."""
    of = list(scores(*job))
    return {
        "name": job[0],
        "sets": len(of),
        "found": sum(s.found for s in of),
        "named": sum(s.named for s in of),
        "by_row": [sum(s.named for s in of[k::3]) for k in range(3)],
        "holds": sum(s.holds for s in of),
        "false": sum(bool(s.other) for s in of),
        "other": sorted({id for s in of for id in s.other}),
    }


def events(seed: int, each: int, workers: int) -> list[dict[str, Any]]:
    """Return the row of every kind of event, of so many sets each."""
    rows = []
    with ProcessPoolExecutor(workers) as pool:
        for of_kind in pool.map(row, [(kind, seed, each) for kind in KINDS]):
            say(str(of_kind))
            rows.append(of_kind)
    return rows
