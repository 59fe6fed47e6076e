"""Units of columns as loggers and data sheets write them, as a factor and an offset; what the name of a column says.

A unit is a product of powers of the names that stand here. Its size is a fraction of whole numbers times a power of pi,
so a factor is rounded once. An angle has a dimension of its own: Hz is no rate of rotation.
A register with an offset is written as in its data sheet: `raw/340 + 36.53 degC`.

No library does this: pint evaluates powers of any size, so that `10**9**9 s` in a heading does not end, and it refuses
words that loggers write.
"""

from __future__ import annotations

import ast
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cache
from typing import Literal

import numpy as np

from ..common.arrays import FloatArray
from ..common.errors import InputError, quoted

Quantity = Literal["time", "temperature", "rate"]

NATIVE_UNITS: Mapping[str, str] = {"time": "s", "temperature": "degC", "rate": "deg/h"}
"""gyrotc's own units."""

_BASE = ("s", "deg", "K", "m", "kg", "A", "pi")

# Sizes by SI (BIPM, 9th edition, tables 2, 4 and 8); g_0 as CGPM 1901, pound and inch as agreed in 1959.
_SI = {
    "second sec": "s",
    "Hz hertz": "1/s",
    "rad radian": "180 deg/pi",
    "metre meter": "m",
    "kelvin": "K",
    "amp ampere": "A",
    "V volt": "kg m^2/s^3/A",
    "W watt": "kg m^2/s^3",
    "Pa pascal": "kg/m/s^2",
    "bar": "100000 Pa",
    "T tesla": "kg/s^2/A",
    "gauss": "T/10000",
    "ohm Ω": "V/A",
    "N newton": "kg m/s^2",
    "gram": "kg/1000",
    "g g_0": "9.80665 m/s^2",  # what loggers call g is an acceleration
    "dps": "deg/s",
    "degree": "deg",
    "arcsec arcsecond": "deg/3600",
}
_OTHER = {
    "°": "deg",
    "arcmin arcminute": "deg/60",
    "turn rev revolution": "360 deg",
    "min minute": "60 s",
    "h hr hour": "3600 s",
    "d day": "86400 s",
    "dph": "deg/h",
    "rpm": "turn/min",
    "C c °C ℃ degC celsius": "K",
    "F f °F ℉ degF fahrenheit": "5 K/9",
    "k degK": "K",
    "% percent count LSB": "1",
    "psi": "0.45359237 kg g_0/(0.0254 m)^2",
}
_FAHRENHEIT = Fraction(5, 9)  # kelvins
_ZERO = {"C": Fraction("273.15"), "F": Fraction("459.67") * _FAHRENHEIT}
"""Kelvins at zero, by the first name."""

_PREFIXES = {
    "nano": -9, "micro": -6, "milli": -3, "centi": -2, "deci": -1, "hecto": 2, "kilo": 3, "mega": 6,
    "n": -9, "u": -6, "µ": -6, "m": -3, "c": -2, "d": -1, "h": 2, "k": 3, "M": 6, "G": 9,
}  # fmt: skip
_PREFIXED = {"s", "deg", "m", "K", "A"} | {name for names in _SI for name in names.split()}
_DEFINED = {
    name: (names.split()[0], definition) for names, definition in (_SI | _OTHER).items() for name in names.split()
}

_CHANNEL_ENDINGS = {
    "c": "degC", "degc": "degC", "k": "kelvin", "v": "V", "mv": "mV", "a": "A", "ma": "mA", "w": "W", "pa": "Pa",
    "hpa": "hPa", "kpa": "kPa", "mbar": "mbar", "bar": "bar", "ut": "uT", "mt": "mT", "nt": "nT", "hz": "Hz",
    "dph": "deg/hour", "dps": "deg/s",
}  # fmt: skip
"""Endings of names of channels that say their unit, as in `case_temperature_c`."""

_MOST = 60  # characters: a data sheet's longest are a third of it
_NAME = r"°?[^\W\d_]+(?:_(?:0|[^\W\d_]+))?|[°%℃℉]"
_TOKEN = re.compile(
    rf"\s*(?:(?P<number>\d+(?:\.\d*)?(?:[eE][+-]?\d{{1,2}})?)|(?P<name>{_NAME})|(?P<sign>[*/()]))"
    r"(?P<power>(?<![*/(])(?:\s*\^\s*[+-]?|(?<=[^\W\d])-?)[1-3](?![\d.]))?"
)
_RAISED = str.maketrans("⁻¹²³", "-123")


class UnitError(ValueError):
    """A text that is no unit of the kind that is wanted; the message says why."""


@dataclass(frozen=True, slots=True)
class _Size:
    """A number of base units; of a temperature alone also the kelvins at its zero."""

    size: Fraction
    powers: Counter[str] = field(default_factory=Counter)
    named: bool = False
    zero: Fraction = Fraction(0)

    def times(self, other: _Size, power: int) -> _Size:
        powers = Counter(self.powers)
        for name, count in other.powers.items():
            powers[name] += power * count
        zero = self.zero if not other.kind else other.zero if not self.kind and power == 1 else Fraction(0)
        return _Size(self.size * other.size**power, powers, self.named or other.named, zero)

    @property
    def kind(self) -> dict[str, int]:
        return {name: power for name, power in self.powers.items() if power and name != "pi"}


@dataclass(frozen=True, slots=True)
class Conversion:
    """Conversion from the unit of a file to gyrotc's own: value · factor + offset.

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
        """True if there is anything to convert."""
        return self.factor != 1.0 or self.offset != 0.0

    def __call__(self, values: FloatArray) -> FloatArray:
        """Return values in gyrotc's own unit; the same array if that is the file's unit."""
        if not self.changes:
            return values
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is left out or refused with its row
            converted = values * self.factor
        if self.offset:
            converted += self.offset
        return converted

    def back(self, value: float) -> float:
        """A value in the unit of the file."""
        return (value - self.offset) / self.factor


@cache
def conversion(text: str, kind: str) -> Conversion:
    """Return the conversion of a unit to gyrotc's own.

    Args:
        text: A unit, a number of one: "deg/s", "°/h", "K", "0.01 s", "deg/s / 131" (131 counts make 1 deg/s), or a
            line through `raw`: "raw/340 + 36.53 degC".
        kind: "time", "temperature", "rate", or any other unit as text, as of a channel.

    Raises:
        UnitError: It is no such unit.
    """
    if _RAW.search(text):
        return _of_register(text, kind)
    given, wanted = _size(text), _size(NATIVE_UNITS.get(kind, kind))
    if not given.named:
        raise UnitError(f"{quoted(text)} is a number without a unit")
    if given.kind != wanted.kind:
        raise UnitError(f"{quoted(text)} is no unit of the kind {NATIVE_UNITS.get(kind, kind)}")
    turns = given.powers["pi"] - wanted.powers["pi"]
    try:
        factor = float(given.size / wanted.size) * math.pi ** max(turns, 0) / math.pi ** max(-turns, 0)
    except (OverflowError, ZeroDivisionError):
        factor = math.inf
    if not 0.0 < factor < math.inf:
        raise UnitError(f"{quoted(text)} is no unit: its size is {factor:g}")
    if given.zero and not _is_decimal(given.size / (_FAHRENHEIT if given.zero == _ZERO["F"] else 1)):
        raise UnitError(f"{quoted(text)} scales counts and states no offset ('raw/128 + 0 degC' does)")
    return Conversion(text, factor, float((given.zero - wanted.zero) / wanted.size))


def _is_decimal(size: Fraction) -> bool:
    """Test whether a number is a power of ten: decimal places, not the scale of a register."""
    digits = str(max(size.numerator, size.denominator))
    return min(size.numerator, size.denominator) == 1 and digits.rstrip("0") == "1"


_RAW = re.compile(r"\braw\b")
_TERM = re.compile(r"\s*(?:raw\b|\d+(?:\.\d*)?(?:[eE][+-]?\d{1,2})?|[-+*/()])")


def _of_register(text: str, kind: str) -> Conversion:
    """The conversion of a line through `raw`, such as "(raw - 521) / 340 + 35 degC".

    Raises:
        UnitError: What precedes the unit is no line, or the unit is none.
    """
    unknown = UnitError(f"{quoted(text)} is no line of raw and a unit, such as 'raw/340 + 36.53 degC'")
    if len(text) > _MOST:
        raise unknown
    end = 0
    while term := _TERM.match(text, end):
        end = term.end()
    if not (unit_text := text[end:].strip()):
        raise unknown
    unit = conversion(unit_text, kind)
    try:
        slope, level = _line(ast.parse(text[:end].strip(), mode="eval").body)
        factor, offset = float(slope) * unit.factor, float(level) * unit.factor + unit.offset
    except (SyntaxError, ArithmeticError, ValueError) as error:
        raise unknown from error
    if not 0.0 < abs(factor) < math.inf:
        raise unknown
    return Conversion(text, factor, offset)


def _line(node: ast.expr) -> tuple[Fraction, Fraction]:
    """Slope and level of an expression that is linear in `raw`.

    Raises:
        ValueError: It is not linear, or holds something else.
    """
    if isinstance(node, ast.Constant):
        return Fraction(0), Fraction(str(node.value))
    if isinstance(node, ast.Name) and node.id == "raw":
        return Fraction(1), Fraction(0)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        sign = -1 if isinstance(node.op, ast.USub) else 1
        slope, level = _line(node.operand)
        return sign * slope, sign * level
    if isinstance(node, ast.BinOp):
        (slope, level), (other_slope, other_level) = _line(node.left), _line(node.right)
        if isinstance(node.op, ast.Add | ast.Sub):
            sign = -1 if isinstance(node.op, ast.Sub) else 1
            return slope + sign * other_slope, level + sign * other_level
        if isinstance(node.op, ast.Mult) and not (slope and other_slope):
            return slope * other_level + other_slope * level, level * other_level
        if isinstance(node.op, ast.Div) and not other_slope:
            return slope / other_level, level / other_level
    raise ValueError("not linear in raw")


def quantity_of(text: str) -> Quantity | None:
    """Return the quantity of a unit: time, temperature or rate; None for anything else or no unit at all."""
    kinds: tuple[Quantity, ...] = ("rate", "temperature", "time")
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
    return _CHANNEL_ENDINGS.get(ending.lower()) if head else None


def channel_kind(name: str, declared: Mapping[str, str]) -> Quantity | None:
    """Return the quantity of an auxiliary channel, by its declared unit or by its name."""
    unit = declared.get(name) or channel_unit(name)
    return quantity_of(unit) if unit else None


@cache
def _size(text: str) -> _Size:
    """A unit as a number of base units."""
    unknown = UnitError(f"{quoted(text)} is not known as a unit")
    plain = " ".join(text.replace("º", "°").replace("μ", "µ").split())
    if len(plain) > _MOST:
        raise unknown
    while plain[:1] + plain[-1:] in ("[]", "{}"):
        plain = plain[1:-1].strip()
    plain = re.sub("[⁻¹²³]+", lambda raised: "^" + raised[0].translate(_RAISED), plain).replace("**", "^")
    plain = re.sub(r"·|(?<=[^\W\d_])\.(?=[^\W\d_°])", "*", plain)
    plain = re.sub(r"(?i)\bdeg(?:rees?)?[ _]?([cfk])\b", lambda found: "deg" + found[1].upper(), plain)
    plain = plain.removesuffix(" since boot")
    words, at = list[str](), 0
    while at < len(plain):
        found = _TOKEN.match(plain, at)
        if found is None:
            raise unknown
        power = found["power"] or ""
        words.append(found[0].removesuffix(power).strip())
        words += ["^" + power.strip(" ^")] if power else []
        at = found.end()
    words.reverse()
    try:
        size = _product(words)
    except (IndexError, ArithmeticError, UnitError) as error:
        raise unknown from error
    if words:
        raise unknown
    return size


def _product(words: list[str]) -> _Size:
    """The factors from the end of a reversed list to its beginning or a closing bracket, which are taken off it."""
    size = _Size(Fraction(1))
    sign = 1
    while True:
        size = size.times(_factor(words), sign)
        if not words or words[-1] == ")":
            return size
        sign = 1
        if words[-1] in ("*", "/", "per"):
            sign = 1 if words.pop() == "*" else -1


def _factor(words: list[str]) -> _Size:
    word = words.pop()
    if word == "(":
        size = _product(words)
        words.pop()
    elif word[0].isdigit():
        size = _Size(Fraction(word))
    else:
        size = _named(word)
    if words and words[-1].startswith("^"):
        power = int(words.pop()[1:])
        size = _Size(Fraction(1)).times(size, power)
    return size


@cache
def _named(word: str) -> _Size:
    """A unit by its name: as it stands, with a prefix, in the plural, in small letters."""
    for name in dict.fromkeys((word, word.lower())):
        for stem in (name, name[:-1] if name.endswith("s") and len(name) > 2 else ""):
            if stem in _DEFINED or stem in _BASE:
                return _defined(stem)
            for prefix, power in _PREFIXES.items():
                rest = stem.removeprefix(prefix)
                if rest != stem and rest in _PREFIXED:
                    return _Size(Fraction(10) ** power).times(_defined(rest), 1)
    raise UnitError(word)


def _defined(name: str) -> _Size:
    if name not in _DEFINED:
        return _Size(Fraction(1), Counter((name,)), named=name != "pi")
    first, definition = _DEFINED[name]
    return replace(_size(definition), named=True, zero=_ZERO.get(first, Fraction(0)))


def declared(units: Mapping[str, str], columns: Mapping[str, Sequence[str]]) -> dict[str, Conversion]:
    """Return conversions by column name.

    Args:
        units: `[units]`: "time", "temperature", "rate", and channels by their names.
        columns: Names of the columns of each of the three kinds, and under "channels" of the others.

    Raises:
        InputError: A text that is no such unit.
    """
    found = {}
    for key, text in units.items():
        names = columns.get(key, ()) if key in NATIVE_UNITS else [key] * (key in columns["channels"])
        wanted = NATIVE_UNITS.get(key)
        for name in names:
            if not (to := wanted or channel_unit(name)):
                continue  # a channel whose name says no unit is taken as it is
            try:
                found[name] = conversion(text, to)
            except UnitError as error:
                expected = f"a unit such as {_EXAMPLES.get(key, to)}"
                raise InputError(f"dataset.toml, field units.{key}", str(error), expected) from error
    return {name: one for name, one in found.items() if one.changes}


_EXAMPLES = {
    "time": "s, ms, min",
    "temperature": "degC, K, degF, raw/340 + 36.53 degC",
    "rate": "deg/h, deg/s, rad/s",
}


_LONGEST = 256  # characters of a name that is searched for a unit: the search takes the square of it or more
_BRACKETS = re.compile(r"^(?P<base>.*?)\s*[\[({<]\s*(?P<unit>[^\])}>]+?)\s*[\])}>]\s*$")
_AFTER_SIGN = re.compile(r"^(?P<base>[^/,]*[^/,\s])\s*(?:/|,|\bin\b)\s*(?P<unit>\S.*)$")
_WITH_SIGN = re.compile(r"^(?P<base>.*\S)\s+(?P<unit>[^\s/]+\s*/\s*[^\s/]+)$")  # Rate deg/h: not the hours of a name
_SAID: tuple[tuple[str, Quantity, str], ...] = (
    ("s", "time", "s, sec, secs, seconds"),
    ("ms", "time", "ms, msec, millis"),
    ("us", "time", "us, usec, micros"),
    ("ns", "time", "ns, nsec"),
    ("min", "time", "min, minutes"),
    ("h", "time", "h, hours"),
    ("degC", "temperature", "c, degc, celsius"),
    ("kelvin", "temperature", "k, kelvin"),
    ("degF", "temperature", "f, degf, fahrenheit"),
    ("deg/s", "rate", "dps, degs, deg s, deg sec, deg per s, deg per sec"),
    ("mdps", "rate", "mdps"),
    ("deg/h", "rate", "dph, deg h, deg hr, deg per h, deg per hr, deg per hour"),
    ("rad/s", "rate", "rads, radps, rad s, rad per s, rad sec"),
    ("mrad/s", "rate", "mrad s"),
)
_ENDINGS = {ending: (unit, kind) for unit, kind, endings in _SAID for ending in endings.split(", ")}
_TIME = {
    "time", "timestamp", "timestamps", "t", "zeit", "zeitstempel", "clock", "elapsed", "stamp", "date", "datetime",
    "datum", "uptime", "epoch", "utc", "millis", "micros", "sec", "seconds", "tick", "ticks", "uhrzeit", "temps", "tow",
    "ts",
}  # fmt: skip
_TEMPERATURE = {
    "temperature", "temp", "temperatur", "temps", "tmp", "therm", "thermistor", "thermometer", "ntc", "pt100", "pt1000",
    "t", "tgyro", "timu", "tcase", "theta",
}  # fmt: skip
_RATE = {
    "gyro", "gyr", "gyroscope", "rate", "omega", "angular", "angvel", "rotation", "drehrate", "gyrorate", "w", "imu",
    "gyrox", "gyroy", "gyroz", "gyrx", "gyry", "gyrz", "gx", "gy", "gz", "wx", "wy", "wz", "bias", "earthrate", "ω",
}  # fmt: skip
_NO_RATE = {
    "acc", "accel", "acceleration", "mag", "magnetic", "sample", "sampling", "frame", "baud", "temp", "temperature",
    "pressure", "count", "counter", "quality", "status", "hz", "integral", "dt", "clip", "clipping", "error",
    "covariance", "command", "setpoint", "table", "orientation",
}  # fmt: skip
_NEAR_GYRO = {
    "gyro", "gyr", "imu", "sensor", "rlg", "fog", "mems", "kreisel", "unit", "dut", "uut", "housing", "block",
}  # fmt: skip
_NO_TEMPERATURE = {
    "setpoint", "set", "soll", "sollwert", "nominal", "ambient", "chamber", "air", "room", "target", "klima", "time",
    "ramp",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Meaning:
    """Meaning of a name.

    Attributes:
        kind: Time, temperature, rate, or None.
        unit: A unit that the name gives, or None.
        why: How the name gives it.
        score: How much speaks for the kind; 0 where nothing does.
        axis: "x", "y", "z" or empty.
    """

    kind: Quantity | None
    unit: str | None
    why: str
    score: int
    axis: str


def words_of_name(name: str) -> list[str]:
    """Lower-case words of a name: `GyrX_dps` gives gyr, x, dps."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Za-z])(?<![Pp][Tt])(?=\d{3,})", " ", name)
    return [w for w in re.split(r"[^0-9a-zäöüßµω°]+", spaced.lower()) if w]


@cache
def split_unit(name: str) -> tuple[str, str | None, str]:
    """A name without its unit, the unit (None: the name gives none), and how it was given."""
    if len(name) > _LONGEST:
        return name, None, ""
    if found := _BRACKETS.match(name):
        unit = found["unit"]
        before = split_unit(found["base"]) if quantity_of(unit) is None and found["base"] else ("", None, "")
        if before[1] and quantity_of(before[1]):
            return before
        if quantity_of(unit) or not re.fullmatch(r"[xyzXYZ\d\s#:]+", unit):
            return found["base"], unit, "in brackets in its name"
    if (found := _WITH_SIGN.match(name)) and quantity_of(found["unit"]) == "rate":
        return found["base"].rstrip(" /,"), found["unit"], "the end of its name"
    if (found := _AFTER_SIGN.match(name)) and quantity_of(found["unit"]):
        return found["base"], found["unit"], "after the sign in its name"
    parts = words_of_name(name)
    for length in (3, 2, 1):
        ending = " ".join(parts[-length:])
        if ending in _ENDINGS and (len(parts) > length or len(ending) > 2):
            return (" ".join(parts[:-length]) or ending, _ENDINGS[ending][0], f"the ending of its name, {ending}")
    if re.search(r"[a-z](US|MS|NS)$", name):
        return name[:-2], name[-2:].lower(), f"the ending of its name, {name[-2:]}"
    return name, None, ""


def meaning(name: str, unit: str | None, table: str = "") -> Meaning:
    """Return the meaning of a column with that name and, if the file gives one, that unit."""
    base, in_name, why = split_unit(name)
    kind = quantity_of(unit) if unit else None
    if unit is None and in_name is not None:
        unit, kind = in_name, quantity_of(in_name)
    parts = words_of_name(base)
    scores: dict[Quantity, int] = dict.fromkeys([kind] if kind else [], 4)
    around = set(parts) | set(words_of_name(table))
    kinds: tuple[tuple[Quantity, set[str]], ...] = (("time", _TIME), ("temperature", _TEMPERATURE), ("rate", _RATE))
    for one, known in kinds:
        hits = known & set(parts)
        if kind is None and unit is not None and in_name is None and one != "time":
            continue  # a unit of something else
        scores[one] = scores.get(one, 0) + 3 * bool(hits - {"t"}) + 1 * bool(hits & {"t"})
    if kind != "rate" and _NO_RATE & around:
        scores["rate"] = 0
    if kind is not None:
        scores = {k: v for k, v in scores.items() if k == kind}
    if "rate" in scores and scores["rate"] and _NO_RATE & set(parts) & {"covariance", "setpoint", "command"}:
        scores["rate"] = 0
    if scores.get("temperature"):
        scores["temperature"] += 2 * bool(_NEAR_GYRO & around) - 2 * bool(_NO_TEMPERATURE & set(parts))
    best = max(scores, key=lambda k: scores[k], default=None)
    if best is None or scores[best] <= 0:
        return Meaning(None, unit, why, 0, axis_of(name))
    if in_name is not None and kind != best:
        try:
            conversion(in_name, best)
        except UnitError:
            unit, why = (None, "") if unit == in_name else (unit, why)
    return Meaning(best, unit, why, scores[best], axis_of(name))


def axis_of(name: str) -> str:
    """`x`, `y` or `z` at the end of a name without its unit, or alone; empty where there is none."""
    base, _, _ = split_unit(name)
    last = (words_of_name(re.sub(r"[\[\]()]", " ", base)) or [""])[-1]
    for form in (r"([xyz])", r"(?:gyro?|gyroscope|w|g|omega|rate|ω|ang(?:ular)?vel(?:ocity)?)_?([xyz])\d?"):
        if found := re.fullmatch(form, last):
            return found[1]
    tail = re.search(r"\.([xyz])$", base.lower()) or re.search(r"(?:^|[_\s.])([xyz])(?=[_\s.])", base.lower() + " ")
    return tail[1] if tail else ""
