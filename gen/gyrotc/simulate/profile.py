"""Chamber programmes: holds, ramps, steps, staircases, triangles, nested loops and repeats.

A profile's steps become the corners of a piecewise linear programme (time in s, temperature in C).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag

from ..common.errors import InputError
from ..common.inputs import PLAUSIBLE_C

ChamberCelsius = Annotated[float, Field(ge=PLAUSIBLE_C[0], le=PLAUSIBLE_C[1])]
# A smaller or larger value has no meaning in any field, and its ratio to another can be no number.
AboveZero = Annotated[float, Field(ge=1e-9, le=1e9)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Hold(_Strict):
    """Stay at the present temperature."""

    hold_min: AboveZero


class Ramp(_Strict):
    """Go to a temperature at a constant rate."""

    ramp_to_c: ChamberCelsius
    c_per_min: AboveZero


class FastChange(_Strict):
    """Go to another temperature as fast as the chamber can."""

    step_to_c: ChamberCelsius


class Staircase(_Strict):
    """From the present temperature to another in equal treads: ramp, hold, ramp, hold, ..."""

    staircase_to_c: ChamberCelsius
    tread_c: AboveZero
    hold_min: AboveZero
    c_per_min: AboveZero


class Triangle(_Strict):
    """To the first temperature, then to and fro between both."""

    triangle_c: tuple[ChamberCelsius, ChamberCelsius]
    c_per_min: AboveZero
    cycles: Annotated[int, Field(ge=1, le=1000)] = 1


class Nested(_Strict):
    """Loops of given half ranges around a temperature: up, down, up, ... and back to it at the end."""

    nested_c: ChamberCelsius
    half_ranges_c: Annotated[list[AboveZero], Field(min_length=1)]
    c_per_min: AboveZero


class Repeat(_Strict):
    """Steps done several times; without `times`, until the record ends."""

    repeat: Annotated[list[Step], Field(min_length=1)]
    times: Annotated[int, Field(ge=1, le=1000)] | None = None


_KINDS = {
    "hold_min": Hold,
    "ramp_to_c": Ramp,
    "step_to_c": FastChange,
    "staircase_to_c": Staircase,
    "triangle_c": Triangle,
    "nested_c": Nested,
    "repeat": Repeat,
}


def _kind(step: Any) -> str | None:
    if isinstance(step, BaseModel):
        return next(key for key, kind in _KINDS.items() if isinstance(step, kind))
    order = [key for key in _KINDS if key != "hold_min"] + ["hold_min"]  # a staircase holds, too
    return next((key for key in order if key in step), None) if isinstance(step, dict) else None


Step = Annotated[
    Annotated[Hold, Tag("hold_min")]
    | Annotated[Ramp, Tag("ramp_to_c")]
    | Annotated[FastChange, Tag("step_to_c")]
    | Annotated[Staircase, Tag("staircase_to_c")]
    | Annotated[Triangle, Tag("triangle_c")]
    | Annotated[Nested, Tag("nested_c")]
    | Annotated[Repeat, Tag("repeat")],
    Discriminator(
        _kind, custom_error_type="step", custom_error_message="a step has one of the keys " + ", ".join(_KINDS)
    ),
]
Repeat.model_rebuild()

_MOST_CORNERS = 10**6  # a corner a second for eleven days

_Leg = tuple[float, float]  # duration in s, temperature at its end in C


def _ramp(start_c: float, end_c: float, c_per_min: float) -> _Leg:
    return 60.0 * abs(end_c - start_c) / c_per_min, end_c


def _legs(step: Any, now_c: float, fastest: float) -> Iterator[_Leg]:
    """The legs of one step that starts at `now_c`; the chamber can do `fastest` C/min."""
    if isinstance(step, Hold):
        yield 60.0 * step.hold_min, now_c
    elif isinstance(step, FastChange):
        yield _ramp(now_c, step.step_to_c, fastest)
    elif isinstance(step, Repeat):
        yield from _repeat(step, now_c, fastest)
    else:
        hold_s = 60.0 * step.hold_min if isinstance(step, Staircase) else 0.0
        for target_c in _targets(step, now_c):
            yield _ramp(now_c, target_c, min(step.c_per_min, fastest))
            if hold_s:
                yield hold_s, target_c
            now_c = target_c


def _targets(step: Ramp | Staircase | Triangle | Nested, now_c: float) -> list[float]:
    """Temperatures that a step of constant rate visits, in order."""
    if isinstance(step, Ramp):
        return [step.ramp_to_c]
    if isinstance(step, Staircase):
        treads = abs(step.staircase_to_c - now_c) / step.tread_c
        if treads > _MOST_CORNERS:
            raise InputError("tread_c", f"{treads:.4g} treads", f"at most {_MOST_CORNERS} corners in a programme")
        treads = max(1, round(treads))
        return [float(c) for c in np.linspace(now_c, step.staircase_to_c, treads + 1)[1:]]
    if isinstance(step, Triangle):
        first, second = step.triangle_c
        return [first, *[second, first] * step.cycles]
    around = [step.nested_c + sign * half for half in step.half_ranges_c for sign in (1.0, -1.0)]
    return [*around, step.nested_c]


def _repeat(step: Repeat, now_c: float, fastest: float) -> Iterator[_Leg]:
    done = 0
    while step.times is None or done < step.times:
        passed_s = 0.0
        for inner in step.repeat:
            for duration_s, end_c in _legs(inner, now_c, fastest):
                passed_s += duration_s
                yield duration_s, end_c
                now_c = end_c
        done += 1
        if passed_s == 0.0:  # a ramp to where it is: would never end
            return


def corners(
    steps: Sequence[Any], start_c: float, until_s: float, fastest_c_per_min: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners of a programme that starts at `start_c` at time 0 and reaches to `until_s` at least.

    No ramp is faster than `fastest_c_per_min`; after the last step the programme stays where it is.

    Returns:
        Times (s, ascending) and temperatures (C), same length.

    Raises:
        InputError: It has more than a million corners.
    """
    times, temperatures = [0.0], [start_c]
    for step in steps:
        for duration_s, end_c in _legs(step, temperatures[-1], fastest_c_per_min):
            times.append(times[-1] + duration_s)
            temperatures.append(end_c)
            if len(times) > _MOST_CORNERS:
                where = f"programme at {times[-1]:.4g} s"
                raise InputError(where, f"more than {_MOST_CORNERS} corners", "longer or fewer steps")
            if times[-1] >= until_s:
                return np.array(times), np.array(temperatures)
    times.append(max(until_s, times[-1]))
    temperatures.append(temperatures[-1])
    return np.array(times), np.array(temperatures)


def sample_profile(
    programme: tuple[NDArray[np.float64], NDArray[np.float64]], time_s: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Programmed temperature (C) at ascending times (s)."""
    times, temperatures = programme
    return np.interp(time_s, times, temperatures)
