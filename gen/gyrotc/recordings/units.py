"""Units of columns: as loggers and data sheets write them, understood by `pint`, as a factor and an offset.

`pint` is loaded only when a unit has to be understood: a data set in gyrotc's own units does without.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any, Literal

from ..common.arrays import FloatArray
from ..common.errors import InputError

__all__ = [
    "NATIVE",
    "Conversion",
    "Kind",
    "UnitError",
    "channel_kind",
    "channel_unit",
    "conversion",
    "declared",
    "kind_of",
]

Kind = Literal["time", "temperature", "rate"]

NATIVE: Mapping[str, str] = {"time": "s", "temperature": "degC", "rate": "deg/h"}
"""gyrotc's own units."""

_SPELT = {
    "dps": "deg/s",
    "mdps": "deg/s/1000",
    "dph": "deg/hour",
    "c": "degC",
    "f": "degF",
    "k": "kelvin",
    "℃": "degC",
    "℉": "degF",
    "deg": "deg",
    "fahrenheit": "degF",
    "deg c": "degC",
    "deg f": "degF",
    "degc": "degC",
    "degf": "degF",
    "deg_c": "degC",
    "deg_f": "degF",
    "deg k": "kelvin",
    "hrs": "hour",
    "mins": "min",
    "secs": "s",
    "msecs": "ms",
    "seconds since boot": "s",
    "g": "g_0",
    "gauss": "gauss",
}
"""What loggers write and `pint` does not know, or takes for coulomb, farad and gram; in lower case."""

_ENDINGS = {
    "c": "degC",
    "degc": "degC",
    "k": "kelvin",
    "v": "V",
    "mv": "mV",
    "a": "A",
    "ma": "mA",
    "w": "W",
    "pa": "Pa",
    "hpa": "hPa",
    "kpa": "kPa",
    "mbar": "mbar",
    "bar": "bar",
    "ut": "uT",
    "mt": "mT",
    "nt": "nT",
    "hz": "Hz",
    "dph": "deg/hour",
    "dps": "deg/s",
}
"""Endings of names of channels that say their unit, as in `case_temperature_c`."""

_ALLOWED = re.compile(r"[\w\s.°*/^()+\-µ%]{1,60}")
_LARGE_POWER = re.compile(r"(\*\*|\^)(?!\s*[-+]?[1-3](?!\s*(\d|\*\*|\^|\.)))")  # pint would compute any
_ROUNDING = 1e-13  # what pint's products of binary numbers may be off, relative
# Factors of units are fractions of small numbers (1/3600, 1/60, 5/9), not of larger ones
_DENOMINATOR = 1000
_SIZE = r"[0-9]+(?:\.[0-9]*)?(?:[eE][+-]?[0-9]+)?"
_SCALED = re.compile(rf"(?:(?P<by>{_SIZE})\s*\*?\s*)?(?P<unit>[^\W\d][\w°]*)(?:\s*/\s*(?P<over>{_SIZE}))?")


class UnitError(ValueError):
    """A text that is no unit of the kind that is wanted; the message says why."""


@dataclass(frozen=True, slots=True)
class Conversion:
    """From the unit of a file to gyrotc's own: value · factor + offset.

    Attributes:
        unit: The unit as it was written.
        factor: In gyrotc's own unit for one of the file's.
        offset: In gyrotc's own unit; not 0 for temperatures only.
    """

    unit: str
    factor: float
    offset: float = 0.0

    @property
    def changes(self) -> bool:
        """Whether there is anything to convert."""
        return self.factor != 1.0 or self.offset != 0.0

    def __call__(self, values: FloatArray) -> FloatArray:
        """Values in gyrotc's own unit; the same array where that is the file's."""
        if not self.changes:
            return values
        converted = values * self.factor
        if self.offset:
            converted += self.offset
        return converted

    def back(self, value: float) -> float:
        """A value in the unit of the file."""
        return (value - self.offset) / self.factor


def conversion(text: str, kind: str) -> Conversion:
    """How values of a unit become gyrotc's own.

    Args:
        text: A unit, or a number of one: "deg/s", "°/h", "K", "0.01 s", "deg/s / 131" (131 counts make 1 deg/s).
        kind: "time", "temperature", "rate", or any other unit as text, as of a channel.

    Raises:
        UnitError: It is no such unit.
    """
    target = NATIVE.get(kind, kind)
    spelt = _spelt(text)
    for form in dict.fromkeys((spelt, spelt.lower())):
        try:
            return Conversion(text, *_affine(form, _spelt(target)))
        except UnitError:
            raise
        except Exception:  # pint and the parsers under it raise what they like
            continue
    raise UnitError(f"{text!r} is not known as a unit")


def kind_of(text: str) -> Kind | None:
    """What is measured in a unit: time, temperature or rate; None for anything else or no unit at all."""
    kinds: tuple[Kind, ...] = ("rate", "temperature", "time")
    for kind in kinds:
        try:
            conversion(text, kind)
        except UnitError:
            continue
        return kind
    return None


def channel_unit(name: str) -> str | None:
    """The unit that the name of a channel says: `case_temperature_c`, `supply_v`; None if it says none."""
    head, _, ending = name.rpartition("_")
    return _ENDINGS.get(ending.lower()) if head else None


def channel_kind(name: str, declared: Mapping[str, str]) -> Kind | None:
    """What an auxiliary channel measures, by its declared unit or by its name."""
    unit = declared.get(name) or channel_unit(name)
    return kind_of(unit) if unit else None


def _spelt(text: str) -> str:
    """A unit as `pint` wants it."""
    plain = " ".join(text.replace("º", "°").replace("μ", "µ").replace("·", "*").split())
    while plain[:1] + plain[-1:] in ("[]", "()", "{}"):
        plain = plain[1:-1].strip()
    if plain.lower() in _SPELT:
        return _SPELT[plain.lower()]
    if not _ALLOWED.fullmatch(plain) or _LARGE_POWER.search(plain):
        raise UnitError(f"{text!r} is not known as a unit")
    plain = re.sub(r"(?<=[A-Za-zµ°])\.(?=[A-Za-zµ°])", "*", plain)  # pint reads deg.s^-1 until 0.25 only
    plain = re.sub(r"\bdps\b", "deg/s", plain)
    plain = re.sub(r"\bdeg(rees?)? ?/ ?", "deg/", plain)
    plain = re.sub(r"(?<=[A-Za-z°]) s\^?-1\b", "/s", plain)
    return re.sub(r"/ ?(hr|h)\b", "/hour", plain)


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry(autoconvert_offset_to_baseunit=False)


@cache
def _affine(text: str, target: str) -> tuple[float, float]:
    """Factor and offset of a unit, exact where they are fractions of small whole numbers."""
    registry = _registry()
    wanted = registry.parse_units(target)
    found = _SCALED.fullmatch(text)
    if target == NATIVE["temperature"] and found and bool(found["by"]) != bool(found["over"]):
        factor, offset = _affine(found["unit"], target)  # pint does not multiply a unit with an offset
        size = float(found["by"]) if found["by"] else 1.0 / float(found["over"])
        return _snapped(factor * size), offset
    given = registry.parse_expression(text)
    if isinstance(given, int | float):
        raise UnitError(f"{text!r} is a number without a unit")
    if given.dimensionality != wanted.dimensionality or _is_hertz(given, wanted):
        raise UnitError(f"{text!r} is no unit of the kind {target}")
    size = float(given.magnitude)
    if not 0.0 < size < 1e300:
        raise UnitError(f"{text!r} is no unit: its size is {size:g}")
    unit = given.units
    zero = float(registry.Quantity(0.0, unit).to(wanted).magnitude)
    one = float(registry.Quantity(1.0, unit).to(wanted).magnitude)
    ten = float(registry.Quantity(1000.0, unit).to(wanted).magnitude)
    if zero == 0.0:
        return _snapped(one * size), 0.0
    return _snapped((ten - zero) / 1000.0 * size), _snapped(zero)


def _is_angle(quantity: Any) -> bool:
    return any(name in str(quantity.units) for name in ("degree", "radian", "turn", "arc", "revolution"))


def _is_hertz(given: Any, wanted: Any) -> bool:
    """For `pint` an angle has no dimension; a rate of rotation has one here, so 1/s and Hz are none."""
    return "hour" in str(wanted) and "degree" in str(wanted) and not _is_angle(given)


def _snapped(value: float) -> float:
    """The fraction of small whole numbers that a value misses by rounding only, else the value."""
    near = float(Fraction(value).limit_denominator(_DENOMINATOR))
    if near == 0.0 and value != 0.0:
        return 1.0 / _snapped(1.0 / value)
    return near if abs(value - near) <= _ROUNDING * abs(value) else value


def declared(units: Mapping[str, str], columns: Mapping[str, Sequence[str]]) -> dict[str, Conversion]:
    """Conversions by column name.

    Args:
        units: `[units]`: "time", "temperature", "rate", and channels by their names.
        columns: Names of the columns of each of the three kinds, and under "channels" of the others.

    Raises:
        InputError: A text that is no such unit.
    """
    found = {}
    for key, text in units.items():
        names = columns.get(key, ()) if key in NATIVE else [key] * (key in columns["channels"])
        for name in names:
            wanted = NATIVE.get(key) or channel_unit(name) or text
            try:
                found[name] = conversion(text, wanted)
            except UnitError as error:
                expected = f"a unit as pint knows it, such as {_EXAMPLES.get(key, wanted)}"
                raise InputError(f"dataset.toml, field units.{key}", str(error), expected) from error
    return {name: one for name, one in found.items() if one.changes}


_EXAMPLES = {"time": "s, ms, min", "temperature": "degC, K, degF", "rate": "deg/h, deg/s, rad/s"}
