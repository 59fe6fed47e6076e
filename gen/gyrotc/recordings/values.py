"""Columns of a recording, and what their numbers must fulfil: finite, in order, within what a gyro can show."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..common.errors import InputError
from .description import Columns, Problems

PULSES = "pulses"
AXES = {"rate_x_dph": "x", "rate_y_dph": "y", "rate_z_dph": "z"}
_LONGEST_NAME = 64  # characters: fits a line of a page and of a terminal


@dataclass(frozen=True, slots=True)
class Layout:
    """Columns of one file by what they mean.

    Attributes:
        time: Name of the column of time, s.
        temperature: Name of the column of temperature, C.
        value: Name of the column of the rate (deg/h) or of pulses; empty where there are several axes.
        pulses: Whether `value` holds pulses.
        axes: Columns of rates by axis, deg/h; empty where there is one rate.
        channels: All other columns.
    """

    time: str
    temperature: str
    value: str
    pulses: bool
    axes: dict[str, str]
    channels: tuple[str, ...]

    def value_of(self, axis: str | None) -> str:
        """Name of the column that holds the rate or the pulses of an axis."""
        return self.value if axis is None else self.axes[axis]


def arrange(file: str, names: Sequence[str], columns: Columns, problems: Problems) -> Layout | None:
    """Finds the meaning of the columns of a file; None (and problems) if they do not make a recording."""
    before = len(problems)
    _check_names(file, names, problems)
    for kind, name in (("time", columns.time), ("temperature", columns.temperature)):
        if name not in names:
            found = f"no column {name} among {_list(names)}"
            problems.add(
                InputError(
                    f"{file}, line 1",
                    found,
                    f"the {kind} in {name}, or [columns] {kind} = ... (`gyrotc import` finds it)",
                )
            )
    axes = {axis: name for name, axis in AXES.items() if name in names and name != columns.rate}
    given = [columns.rate] * (columns.rate in names) + [PULSES] * (PULSES in names)
    given += [", ".join(axes.values())] * bool(axes)
    if len(given) > 1:
        problems.add(InputError(f"{file}, line 1", f"both {' and '.join(given)}", "one of them"))
    elif not given:
        found = f"no column {columns.rate} among {_list(names)}"
        expected = f"{columns.rate}, pulses, or rate_x_dph, rate_y_dph, rate_z_dph (`gyrotc import` finds it)"
        problems.add(InputError(f"{file}, line 1", found, expected))
    if len(problems) > before:
        return None
    used = {columns.time, columns.temperature, given[0], *axes.values()}
    return Layout(
        time=columns.time,
        temperature=columns.temperature,
        value="" if axes else given[0],
        pulses=given[0] == PULSES,
        axes=axes,
        channels=tuple(name for name in names if name not in used),
    )


def _check_names(file: str, names: Sequence[str], problems: Problems) -> None:
    for name, count in Counter(names).items():
        where = f"{file}, line 1, column {name or names.index(name) + 1}"
        if not name:
            problems.add(InputError(where, "has no name", "a name for every column"))
        elif count > 1:
            problems.add(InputError(where, f"is there {count} times", "every column once"))
        elif len(name) > _LONGEST_NAME or not name.isprintable():
            problems.add(InputError(where, "is no usable name", f"1 to {_LONGEST_NAME} printable characters"))


def _list(names: Sequence[str]) -> str:
    shown = ", ".join(names[:8])
    return shown if len(names) <= 8 else f"{shown} and {len(names) - 8} more"


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
    return "degF" if (high - 32.0) / 1.8 <= _TEMPERATURE_C[1] and (low - 32.0) / 1.8 >= _TEMPERATURE_C[0] else None


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
