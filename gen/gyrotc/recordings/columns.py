"""Which column of a recording is what: time, temperature, rate, pulses, rates by axis, auxiliary channels."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from ..common.errors import InputError
from .problems import Problems
from .schema import Columns

__all__ = ["Layout", "arrange"]

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


def arrange(
    file: str, names: Sequence[str], columns: Columns, problems: Problems
) -> Layout | None:  # long: one rule for each kind of column
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
