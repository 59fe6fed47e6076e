"""What the numbers of a recording must fulfil: finite, time going on, within what a gyro can show."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from .columns import Layout

__all__ = ["MIN_ROWS", "Fault", "faults", "likely_temperature", "rate_faults"]

MIN_ROWS = 10  # a file of fewer rows is a mistake, not a recording
_TEMPERATURE_C = (-90.0, 200.0)  # the target holds samples outside: docs/numerics.md, section 1
_RATE_DPH = (-7.5e6, 7.5e6)  # a little above 2000 deg/s, the widest usual range; no table holds more
_TIME_S = (-1e10, 1e10)  # three hundred years: seconds of any epoch, not milliseconds or nanoseconds
# Comparisons with it let NaN and infinities be found without an array of their own
_LARGEST = float(np.finfo(np.float64).max)
_KELVIN = (183.15, 473.15)  # the plausible range, had it been given in kelvin


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of a column: first row that has it, how many rows have it, what was found and expected."""

    row: int
    column: str
    rows: int
    found: str
    expected: str


def faults(columns: Mapping[str, FloatArray], layout: Layout) -> Iterator[Fault]:
    """Faults of the numbers of one file, at most one for each column and kind."""
    good_time = True
    for name, values in columns.items():
        if _lie_within(values, (-_LARGEST, _LARGEST)):
            continue
        good_time = good_time and name != layout.time
        wrong = ~np.isfinite(values) if name == layout.time else np.isinf(values)
        if wrong.any():
            yield _fault(name, wrong, values, "a finite number")
    time = columns[layout.time]
    if good_time:
        yield from _order(layout.time, time)
    yield from _within(layout.time, time, _TIME_S, "s")
    yield from _temperature(layout.temperature, columns[layout.temperature])
    if layout.pulses:
        pulses = columns[layout.value]
        wrong = np.isfinite(pulses) & (pulses != np.round(pulses))
        if wrong.any():
            yield _fault(layout.value, wrong, pulses, "whole counts since the last row")
    else:
        for name in layout.axes.values() or (layout.value,):
            yield from rate_faults(name, columns[name])


def rate_faults(name: str, rate: FloatArray) -> Iterator[Fault]:
    """Rates that no gyro has, deg/h; NaN passes."""
    yield from _within(name, rate, _RATE_DPH, "deg/h")


def _order(name: str, time: FloatArray) -> Iterator[Fault]:
    if np.all(time[1:] > time[:-1]):
        return
    step = np.diff(time)
    for wrong, what in ((step == 0.0, "repeated"), (step < 0.0, "going back")):
        if wrong.any():
            first = int(np.argmax(wrong)) + 1
            found = f"{what}: {time[first]:.10g} s after {time[first - 1]:.10g} s"
            yield Fault(first, name, int(wrong.sum()), found, "times that strictly increase")


def _temperature(name: str, values: FloatArray) -> Iterator[Fault]:
    for fault in _within(name, values, _TEMPERATURE_C, "C"):
        likely = likely_temperature(values)
        word = {"K": "kelvin", "degF": "fahrenheit"}.get(likely or "", "")
        hint = f'; {word}? [units] temperature = "{likely}" in dataset.toml' if likely else ""
        yield Fault(fault.row, fault.column, fault.rows, fault.found, fault.expected + hint)


def likely_temperature(values: FloatArray) -> str | None:
    """The unit in which temperatures beyond the plausible would all be plausible: "K", "degF" or None."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
    if high <= _TEMPERATURE_C[1]:
        return None
    if _KELVIN[0] <= low and high <= _KELVIN[1]:
        return "K"
    return (
        "degF"
        if (high - 32.0) / 1.8 <= _TEMPERATURE_C[1] and (low - 32.0) / 1.8 >= _TEMPERATURE_C[0]
        else None
    )


def _within(name: str, values: FloatArray, limits: tuple[float, float], unit: str) -> Iterator[Fault]:
    if _lie_within(values, limits):
        return
    wrong = np.isfinite(values) & ((values < limits[0]) | (values > limits[1]))
    if wrong.any():
        yield _fault(name, wrong, values, f"{limits[0]:g} ... {limits[1]:g} {unit}")


def _lie_within(values: FloatArray, limits: tuple[float, float]) -> bool:
    """Whether all values do; without arrays as long as the recording. NaN does not."""
    return len(values) == 0 or bool(limits[0] <= values.min() and values.max() <= limits[1])


def _fault(name: str, wrong: NDArray[np.bool_], values: FloatArray, expected: str) -> Fault:
    first = int(np.argmax(wrong))
    return Fault(first, name, int(wrong.sum()), f"{values[first]:.10g}", expected)
