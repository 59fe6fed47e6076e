"""The words of each cause: its name, what it looks like, what would tell it from others."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["NOISE_WORDS", "SEPARATE", "WORDS", "Words", "separate_by"]


@dataclass(frozen=True, slots=True)
class Words:
    """For reports.

    Attributes:
        name: One clause.
        signature: How it shows in the residuals.
        remedy: What to do about it.
    """

    name: str
    signature: str
    remedy: str


WORDS: dict[str, Words] = {
    "cavity_lag": Words(
        "The cavity lags the temperature sensor",
        "residual loops over T that widen with the ramp rate and close in holds with the time constant",
        "one first-order state: the map sees the cavity's temperature",
    ),
    "thermal_gradient": Words(
        "The bias follows a temperature difference inside the gyro",
        "residual follows the ramp with the same size at every temperature and fades in holds",
        "one first-order state and a linear term",
    ),
    "time_misalignment": Words(
        "Temperature and rate are not recorded at the same time",
        "residual follows the second derivative of T at the corners of ramps",
        "mend the clocks or the filter of the recording; no term on the target",
    ),
    "hysteresis": Words(
        "The bias remembers the direction of the last temperature change",
        "loops over T whose width does not depend on the rate; holds differ by the side they were reached from",
        "one play operator, saved over power cycles",
    ),
    "warm_up": Words(
        "The bias settles after power-on whatever the temperature is",
        "residuals of all runs agree over the time since power-on",
        "one exponential of the time since power-on",
    ),
    "turn_on_offset": Words(
        "Every power-on has its own offset",
        "means of the runs scatter more than their noise allows",
        "no map holds it: re-zero in the first minutes at rest, or state it as an uncertainty",
    ),
    "ageing": Words(
        "The bias drifts from run to run with the date",
        "means of the runs follow the calendar",
        "calibrate again in time; a table must not extrapolate it",
    ),
    "map_too_coarse": Words(
        "The static map is too coarse",
        "residual repeats over T, heating and cooling alike, finer than the map",
        "more centers",
    ),
    "path_length_periodicity": Words(
        "The bias is periodic in temperature",
        "residual waves over T with one period and the same phase heating and cooling",
        "a sine and a cosine of T",
    ),
    "auxiliary": Words(
        "The bias follows a recorded channel",
        "residual is proportional to the channel, and not to the channel shifted in time",
        "a linear term in the channel, or a better supply or shield",
    ),
}

NOISE_WORDS: dict[str, str] = {
    "noise_level": "The noise has another level than declared",
    "noise_colour": "The noise has another colour than declared",
    "noise_variance": "The noise varies with temperature, ramp rate or time since power-on",
    "outliers": "Single rows are outliers",
    "temperature_quantisation": "The temperature is recorded in coarse steps",
}

_RATES = "ramps at two more rates with holds of an hour after each; a second thermometer at the cavity"
_BOTH_SIDES = "the same hold temperature reached from both sides, at two rates, and nested shrinking loops"

SEPARATE: dict[frozenset[str], str] = {
    frozenset({"cavity_lag", "thermal_gradient"}): _RATES,
    frozenset({"cavity_lag", "time_misalignment"}): (
        "steps or 5 C/min corners recorded with 10-s rows; a synchronisation pulse in both recordings"
    ),
    frozenset({"thermal_gradient", "time_misalignment"}): (
        "steps or 5 C/min corners recorded with 10-s rows; a synchronisation pulse in both recordings"
    ),
    frozenset({"hysteresis", "turn_on_offset"}): _BOTH_SIDES + ", all within one power-on",
    frozenset(
        {"turn_on_offset", "ageing"}
    ): "the same hold on at least five dates, several power cycles on each",
    frozenset({"warm_up", "thermal_gradient"}): (
        "a cold start at a constant chamber temperature, at two temperatures; a hot restart"
    ),
    frozenset({"warm_up", "cavity_lag"}): (
        "a cold start at a constant chamber temperature, at two temperatures; a hot restart"
    ),
    frozenset({"path_length_periodicity", "map_too_coarse"}): "one slow ramp over the full range (0.5 C/min)",
}


def separate_by(one: str, other: str) -> str:
    """The experiment that tells two causes apart."""
    pair = frozenset({one, other})
    if pair in SEPARATE:
        return SEPARATE[pair]
    if "hysteresis" in pair:
        return _BOTH_SIDES
    if "warm_up" in pair:
        return "cold starts at two constant chamber temperatures, and a hot restart"
    if "turn_on_offset" in pair or "ageing" in pair:
        return "three or more repeats of one hold with power cycles between them"
    if "auxiliary" in pair:
        return "vary the channel by hand at a constant temperature"
    if pair & {"map_too_coarse", "path_length_periodicity"}:
        return "one slow ramp over the full range in both directions"
    return _RATES
