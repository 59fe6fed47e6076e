"""Measure the runtime when something fails: true bias less correction, in units of its sigma, and its status.

Each fault begins half an hour into a test run of simulated gyros with a supply voltage among their inputs; the
compiled runtime gets a sample a second, and so did the recordings.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gyrotc.mirror import Table
from gyrotc.model import Model
from gyrotc.recordings import load
from gyrotc.results import Numeric
from gyrotc.simulate import read, simulate, simulate_campaign, with_noise
from gyrotc.tables import quantise
from gyrotc.train import FitOptions, fit_dataset
from libc_build import runtime
from numpy.typing import NDArray

from .campaigns import Settings, say
from .page import Count, Figure, ResultsTable, figures_table
from .records import Record

Floats = NDArray[np.float64]

SAMPLE, SAMPLE_AT, MISSED, REZERO, POWER_CYCLE, INIT = range(6)  # calls of tests/support/libc_shim.c
FIRST_SEED = 300_000  # of gyros that nothing was tuned on
_GYROS = 60
_PERIOD_S = 1.0
_BLOCK = 10  # samples
_FROM, HEALTHY_S = 3600, 1800  # of the exam: the first ramps; then the fault begins
_LENGTH_S = 3 * 3600
PART = slice(_FROM, _FROM + _LENGTH_S)
_EVERY = 10  # samples from one that is looked at to the next
_WRONG = 2.0  # of the largest error of the same run without a fault: a correction beyond it is wrong by the fault
PLAN = """
extends = "supply-voltage"
[[cause]]
id = "auxiliary"
channel = "supply_v"
slope_dph_per_unit = 0.01
reference = 28.0
[[cause]]
id = "turn_on_offset"
std_dph = 3e-4
[[set]]
role = "train"
started = 2026-03-02T08:00:00Z
profiles = ["cold start -40 C", "cold start 20 C", "slow staircase", "nested loops", "fast full range"]
[[set]]
role = "exam"
started = 2026-03-16T08:00:00Z
profiles = ["fast full range"]
"""


@dataclass(frozen=True, slots=True)
class Unit:
    """A gyro's table and one test run, a row a second: readings (temperature, supply), true bias and rate, deg/h."""

    model: Model
    table: Table
    between_dph: float
    readings: Floats
    truth_dph: Floats
    rate_dph: Floats


def unit(seed: int, numeric: Numeric = "f32") -> Unit:
    """The gyro that a seed draws, with its table in an arithmetic."""
    with tempfile.TemporaryDirectory() as place:
        plan = Path(place) / "plan.toml"
        plan.write_text(PLAN, "utf-8")
        simulate(plan, seed=seed, out=Path(place) / "data", format="parquet", row_s=_PERIOD_S)
        model = fit_dataset(load(Path(place) / "data"), FitOptions(channels=True)).model
        record = list(simulate_campaign(with_noise(read(plan)[1], "paper"), seed))[-1]
    assert model.uncertainty_dph is not None
    names = [term.channel for term in model.terms if term.channel]
    return Unit(
        model=model,
        table=quantise(model, numeric),
        between_dph=model.uncertainty_dph.rules.between_dph,
        readings=np.column_stack([record.reading_c, *(record.channels[name] for name in names)])[PART],
        truth_dph=np.diff(record.true_arcsec)[PART],
        rate_dph=np.diff(record.angle_arcsec)[PART],
    )


@dataclass(slots=True)
class Calls:
    """Calls of the runtime; `row`: of the test run at which each is made."""

    kind: NDArray[np.int64]
    number: NDArray[np.int64]
    values: Floats
    row: NDArray[np.int64]
    offset_dph: Floats  # of the true bias beside that of the simulation

    @staticmethod
    def of(readings: Floats) -> Calls:
        n = len(readings)
        none = np.zeros(n, dtype=np.int64)
        return Calls(none.copy(), none.copy(), readings.copy(), np.arange(n), np.zeros(n))

    def with_call(self, at: int, kind: int, number: int, value: float = 0.0) -> None:
        """Puts a call before that of row `at`."""
        k = int(np.searchsorted(self.row, at))
        values = np.zeros((1, self.values.shape[1]))
        values[0, 0] = value
        self.kind = np.insert(self.kind, k, kind)
        self.number = np.insert(self.number, k, number)
        self.values = np.concatenate([self.values[:k], values, self.values[k:]])
        self.row = np.insert(self.row, k, at)
        self.offset_dph = np.insert(self.offset_dph, k, self.offset_dph[min(k, len(self.offset_dph) - 1)])


Fault = Callable[[Unit, np.random.Generator, int], Calls]


def _reading(change: Callable[[Floats, np.random.Generator], Any]) -> Fault:
    """A fault of what is read, from the row on at which it begins."""

    def made(unit: Unit, rng: np.random.Generator, start: int) -> Calls:
        readings = unit.readings.copy()
        change(readings[start:], rng)
        return Calls.of(readings)

    return made


def _set(column: int, *values: float) -> Fault:
    def change(rows: Floats, rng: np.random.Generator) -> None:
        rows[:, column] = rng.choice(values)

    return _reading(change)


def _stuck(column: int) -> Fault:
    def change(rows: Floats, rng: np.random.Generator) -> None:
        rows[:, column] = rows[0, column]

    return _reading(change)


def _coarse(column: int, step: float) -> Fault:
    def change(rows: Floats, rng: np.random.Generator) -> None:
        rows[:, column] = np.round(rows[:, column] / step) * step

    return _reading(change)


def _lossy(column: int) -> Fault:
    """Six readings of ten do not arrive."""

    def change(rows: Floats, rng: np.random.Generator) -> None:
        rows[rng.random(len(rows)) < 0.6, column] = np.nan

    return _reading(change)


def _swapped(rows: Floats, rng: np.random.Generator) -> None:
    rows[:] = rows[:, ::-1].copy()


def _clock(change: Callable[[Floats], Floats]) -> Fault:
    """Samples with times, s since the fault began, that are changed from there on."""

    def made(unit: Unit, rng: np.random.Generator, start: int) -> Calls:
        calls = Calls.of(unit.readings)
        time = np.arange(len(calls.row), dtype=np.float64)
        time[start:] = start + change(time[start:] - start)
        calls.kind[:] = SAMPLE_AT
        calls.number = np.round(time * 1e6).astype(np.int64) % 2**32
        return calls

    return made


def _rest(wrong_dph: float, times: int = 1, seconds: int = 600) -> Fault:
    """Rests of ten minutes from the beginning on, whose mean is wrong by so much."""

    def made(unit: Unit, rng: np.random.Generator, start: int) -> Calls:
        calls = Calls.of(unit.readings)
        for k in range(times):
            at = start + k * seconds
            mean = float(unit.rate_dph[at : at + seconds].mean())
            calls.with_call(at + seconds, REZERO, seconds, mean + wrong_dph)
        return calls

    return made


def _power_cycles(cycles: int, kept: bool) -> Fault:
    """A re-zero, then as many power-ons, each with a bias of its own, with the state kept or begun anew."""

    def made(unit: Unit, rng: np.random.Generator, start: int) -> Calls:
        calls = Calls.of(unit.readings)
        last = len(unit.readings) - 600
        at = np.linspace(start + 1200, last, cycles).astype(int)
        offsets = unit.between_dph * rng.standard_normal(cycles)
        offset = np.zeros(len(unit.readings))
        for k, row in enumerate(at.tolist()):
            offset[row:] = offsets[k]
        calls.offset_dph = offset
        for k, row in enumerate(at.tolist()):
            calls.with_call(row, POWER_CYCLE if kept else INIT, 60)
            rest = min(600, (at[k + 1] - row if k + 1 < cycles else 600) - 1)
            if rest >= 60:
                mean = float((unit.rate_dph + offset)[row : row + rest].mean())
                calls.with_call(row + rest, REZERO, rest, mean)
        return calls

    return made


def _late_blocks(unit: Unit, rng: np.random.Generator, start: int) -> Calls:
    """One block in five arrives as missed samples."""
    calls = Calls.of(unit.readings)
    late = (calls.row >= start) & (calls.row // _BLOCK % 5 == 0)
    calls.kind[late], calls.number[late] = MISSED, 1
    return calls


CLASSES: dict[str, Fault] = {
    "none": _reading(lambda rows, rng: None),
    "channel: beyond its range": _set(1, 40.0, 5.0, 0.1),
    "channel: lost": _set(1, np.nan),
    "channel: stuck": _stuck(1),
    "channel: coarse, 0.05 V": _coarse(1, 0.05),
    "channel: six of ten lost": _lossy(1),
    "channel and thermometer swapped": _reading(_swapped),
    "thermometer: beyond its range": _set(0, 150.0, -90.0),
    "thermometer: lost": _set(0, np.nan),
    "thermometer: stuck": _stuck(0),
    "thermometer: coarse, 1/16 C": _coarse(0, 1.0 / 16.0),
    "thermometer: six of ten lost": _lossy(0),
    "clock: stopped": _clock(lambda t: 0.0 * t),
    "clock: back by 100 s": _clock(lambda t: t - 100.0),
    "clock: forward by an hour": _clock(lambda t: t + 3600.0),
    "clock: 0.1 % fast": _clock(lambda t: 1.001 * t),
    "re-zero: right": _rest(0.0),
    "re-zero: right, 15 times": _rest(0.0, times=15),
    "re-zero: wrong by 0.01 deg/h": _rest(0.01),
    "re-zero: wrong by 7.5 deg/h": _rest(7.5),
    "re-zero: wrong by 1000 deg/h": _rest(1000.0),
    "power: 1 cycle, state kept": _power_cycles(1, True),
    "power: 10 cycles, state kept": _power_cycles(10, True),
    "power: 10 cycles, begun anew": _power_cycles(10, False),
    "power: 50 cycles, state kept": _power_cycles(50, True),
    "one block in five late": _late_blocks,
}


@dataclass(frozen=True, slots=True)
class Outcome:
    """Error over sigma of every tenth second after the fault began; seconds from the first wrong one to a status.

    `silent_s`: 0 where no correction is wrong or the status is there at once; infinite where it never comes.
    """

    ratio: Floats
    silent_s: float


def outcome(unit: Unit, fault: Fault, seed: int, usual_dph: float) -> Outcome:
    """Drives the compiled runtime through a fault; `usual_dph`: largest error without one."""
    calls = fault(unit, np.random.default_rng(seed), HEALTHY_S)
    error, sigma, status = driven(unit, calls)
    after = np.flatnonzero((calls.row >= HEALTHY_S) & (calls.kind <= MISSED))
    wrong = after[np.abs(error[after]) > _WRONG * usual_dph]
    silent = 0.0
    if wrong.size:
        said = after[(after >= wrong[0]) & (status[after] != 0)]
        silent = float(calls.row[said[0]] - calls.row[wrong[0]]) if said.size else np.inf
    return Outcome((error[after] / sigma[after])[::_EVERY], silent)


def driven(unit: Unit, calls: Calls) -> tuple[Floats, Floats, NDArray[np.int32]]:
    """Error and sigma of every call, deg/h, and its status with that of the correction."""
    table = unit.table
    values = table.encode_inputs(calls.values)
    if table.numeric == "q31":  # a mean rate is in units of the bias
        rates = np.rint(calls.values[calls.kind == REZERO, 0] * 2.0**table.bias_frac_bits)
        words = np.clip(rates, -(2.0**31) + 1.0, 2.0**31 - 1.0).astype(np.int64)
        values[calls.kind == REZERO, 0] = (words & 0xFFFFFFFF).astype(np.uint32)
    status, bits = runtime().calls(table, calls.kind, calls.number, values, _BLOCK)
    assert np.all(status[:, 1] >= 0)
    truth = unit.truth_dph[np.minimum(calls.row, len(unit.truth_dph) - 1)] + calls.offset_dph
    error = truth - table.decode_bias(bits[:, 0])
    return error, table.decode_bias(bits[:, 1]), np.maximum(status[:, 0], 0) | status[:, 1]


def outcomes(seed: int, numeric: Numeric = "f32") -> list[Outcome]:
    """One of every class; none for a gyro whose supply was not taken as an input."""
    own = unit(seed, numeric)
    if own.readings.shape[1] < 2:
        return []
    healthy, _, _ = driven(own, Calls.of(own.readings))
    usual = float(np.abs(healthy[HEALTHY_S:]).max())
    return [outcome(own, fault, seed, usual) for fault in CLASSES.values()]


def measure(settings: Settings) -> Record:
    """Return figures of every class over simulated gyros, of which those count whose supply is an input."""
    first = FIRST_SEED if settings.seed is None else settings.seed
    seeds = range(first, first + (2 if settings.quick else _GYROS))
    found = []
    with ProcessPoolExecutor(settings.workers) as pool:
        for seed, own in zip(seeds, pool.map(outcomes, seeds), strict=True):
            say(f"faults of gyro {seed}")
            found += [own] if own else []
    return {"gyros": len(found), "classes": list(_figures(found))}


def _figures(found: list[list[Outcome]]) -> Iterator[dict[str, Any]]:
    for k, name in enumerate(CLASSES):
        own = [each[k] for each in found]
        ratio = np.abs(np.concatenate([o.ratio for o in own]))
        rms = [float(np.sqrt(np.mean(o.ratio**2))) for o in own]
        late = [o.silent_s for o in own]
        yield {
            "name": name,
            "rms": float(np.sqrt(np.mean(ratio**2))),
            "p95": float(np.quantile(ratio, 0.95)),
            "worst": float(ratio.max()),
            "worst_gyro": max(rms),
            "silent": sum(1 for s in late if s > 0.0),
            "longest_silent_s": max((s for s in late if np.isfinite(s)), default=0.0),
            "never": sum(1 for s in late if not np.isfinite(s)),
        }


_TEXT = """
Error of the correction divided by the sigma that the runtime states, from the start of a fault on, for {gyros}
simulated gyros with a supply voltage as an input: two and a half hours with ramps of 3 and 5 C/min, the compiled
runtime in float32, one sample a second. Faults are of sensors, clock, re-zero, power and schedule.
"""


def table(record: Record) -> ResultsTable:
    """Return error over sigma and delay of the status, without a fault and of the worst one."""
    (sound,) = (row for row in record["classes"] if row["name"] == "none")
    faults = [row for row in record["classes"] if row is not sound]
    by_rms, by_error = (max(faults, key=lambda row, key=key: row[key]) for key in ("rms", "worst"))
    silent = Count(sum(row["silent"] for row in faults), len(faults) * record["gyros"])
    return figures_table(
        _TEXT.format(**record),
        [
            ("RMS of error/sigma without a fault", Figure(sound["rms"], ".2f", at_most=1.5)),
            (f"the same, worst of {len(faults)} faults ({_name(by_rms)})", Figure(by_rms["rms"], ".2f", at_most=1.5)),
            ("largest error/sigma without a fault", Figure(sound["worst"], ".1f")),
            (f"the same, worst fault ({_name(by_error)})", Figure(by_error["worst"], ".1f")),
            ("gyros and faults with more than twice the largest error without a fault while the status is 0", silent),
            (
                "longest time with such an error until the status changes, s",
                Figure(max(row["longest_silent_s"] for row in faults), ".0f"),
            ),
        ],
    )


def _name(row: dict[str, Any]) -> str:
    return str(row["name"]).replace("thermometer", "temperature sensor").replace("begun anew", "started again")
