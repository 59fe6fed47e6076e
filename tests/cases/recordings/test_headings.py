"""Headings of columns and units of files: what one of the unit is in gyrotc's own, by hand."""

from __future__ import annotations

import math

import pytest
from gyrotc.recordings import conversion, meaning

RADIAN = 180.0 / math.pi
RATE, TIME, TEMPERATURE = "rate", "time", "temperature"
ENDINGS: dict[str, tuple[str, float]] = {
    "dps": (RATE, 3600.0), "degs": (RATE, 3600.0), "deg_s": (RATE, 3600.0), "deg_per_sec": (RATE, 3600.0),
    "mdps": (RATE, 3.6), "dph": (RATE, 1.0), "deg_h": (RATE, 1.0), "deg_hr": (RATE, 1.0), "deg_per_hour": (RATE, 1.0),
    "rads": (RATE, 3600.0 * RADIAN), "radps": (RATE, 3600.0 * RADIAN), "rad_per_s": (RATE, 3600.0 * RADIAN),
    "mrad_s": (RATE, 3.6 * RADIAN),
    "sec": (TIME, 1.0), "seconds": (TIME, 1.0), "ms": (TIME, 1e-3), "msec": (TIME, 1e-3), "us": (TIME, 1e-6),
    "usec": (TIME, 1e-6), "ns": (TIME, 1e-9), "nsec": (TIME, 1e-9), "min": (TIME, 60.0), "minutes": (TIME, 60.0),
    "hours": (TIME, 3600.0),
    "degc": (TEMPERATURE, 1.0), "celsius": (TEMPERATURE, 1.0), "kelvin": (TEMPERATURE, 1.0),
    "degf": (TEMPERATURE, 5.0 / 9.0), "fahrenheit": (TEMPERATURE, 5.0 / 9.0),
}  # fmt: skip
NAMES = {RATE: "gyro", TIME: "time", TEMPERATURE: "temp"}


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_ending_of_a_heading_says_its_unit(ending: str) -> None:
    kind, size = ENDINGS[ending]
    said = meaning(f"{NAMES[kind]}_{ending}", None)
    assert said.kind == kind and said.unit is not None
    assert conversion(said.unit, kind).factor == pytest.approx(size, rel=1e-12)


UNITS: dict[tuple[str, str], tuple[float, float]] = {
    (RATE, "deg/h"): (1.0, 0.0), (RATE, "°/h"): (1.0, 0.0), (RATE, "deg/s"): (3600.0, 0.0),
    (RATE, "mdeg/s"): (3.6, 0.0), (RATE, "rad/s"): (3600.0 * RADIAN, 0.0), (RATE, "urad/s"): (3.6e-3 * RADIAN, 0.0),
    (RATE, "arcsec/s"): (1.0, 0.0), (RATE, "deg/min"): (60.0, 0.0), (RATE, "deg/s / 131"): (3600.0 / 131.0, 0.0),
    (TIME, "ms"): (1e-3, 0.0), (TIME, "0.01 s"): (0.01, 0.0), (TIME, "min"): (60.0, 0.0),
    (TEMPERATURE, "K"): (1.0, -273.15), (TEMPERATURE, "degF"): (5.0 / 9.0, -32.0 * 5.0 / 9.0),
    (TEMPERATURE, "degC"): (1.0, 0.0), ("V", "mV"): (1e-3, 0.0), ("hPa", "mbar"): (1.0, 0.0),
    ("Pa", "psi"): (6894.757293168, 0.0), ("uT", "nT"): (1e-3, 0.0), ("A", "mA"): (1e-3, 0.0),
    ("Pa", "bar"): (1e5, 0.0),
}  # fmt: skip


@pytest.mark.parametrize(("kind", "text"), UNITS)
def test_a_unit_has_its_size_and_its_zero_both_ways(kind: str, text: str) -> None:
    """The value 7 of the file in gyrotc's own unit, and back."""
    size, zero = UNITS[kind, text]
    to = conversion(text, kind)
    own = to.factor * 7.0 + to.offset
    assert own == pytest.approx(7.0 * size + zero, rel=1e-9)
    assert to.back(own) == pytest.approx(7.0, rel=1e-9)
