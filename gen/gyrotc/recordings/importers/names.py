"""What the name of a column says: its unit, and whether it is time, temperature or the rate of an axis.

Every guess carries its reason in words; nothing here looks at values.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache

from ..units import Kind, UnitError, conversion, kind_of

_LONGEST = 256  # characters of a name that is searched for a unit: the search takes the square of it or more
_BRACKETS = re.compile(r"^(?P<base>.*?)\s*[\[({<]\s*(?P<unit>[^\])}>]+?)\s*[\])}>]\s*$")
_AFTER_SIGN = re.compile(r"^(?P<base>[^/,]*[^/,\s])\s*(?:/|,|\bin\b)\s*(?P<unit>\S.*)$")
_WITH_SIGN = re.compile(r"^(?P<base>.*\S)\s+(?P<unit>[^\s/]+\s*/\s*[^\s/]+)$")  # Rate deg/h: not the hours of a name
_ENDINGS: dict[str, tuple[str, Kind]] = {
    "s": ("s", "time"),
    "sec": ("s", "time"),
    "secs": ("s", "time"),
    "seconds": ("s", "time"),
    "ms": ("ms", "time"),
    "msec": ("ms", "time"),
    "millis": ("ms", "time"),
    "us": ("us", "time"),
    "usec": ("us", "time"),
    "micros": ("us", "time"),
    "ns": ("ns", "time"),
    "nsec": ("ns", "time"),
    "min": ("min", "time"),
    "minutes": ("min", "time"),
    "h": ("h", "time"),
    "hours": ("h", "time"),
    "c": ("degC", "temperature"),
    "degc": ("degC", "temperature"),
    "celsius": ("degC", "temperature"),
    "k": ("kelvin", "temperature"),
    "kelvin": ("kelvin", "temperature"),
    "f": ("degF", "temperature"),
    "degf": ("degF", "temperature"),
    "fahrenheit": ("degF", "temperature"),
    "dps": ("deg/s", "rate"),
    "mdps": ("mdps", "rate"),
    "dph": ("deg/h", "rate"),
    "rads": ("rad/s", "rate"),
    "radps": ("rad/s", "rate"),
    "rad s": ("rad/s", "rate"),
    "rad per s": ("rad/s", "rate"),
    "rad sec": ("rad/s", "rate"),
    "mrad s": ("mrad/s", "rate"),
    "degs": ("deg/s", "rate"),
    "deg s": ("deg/s", "rate"),
    "deg sec": ("deg/s", "rate"),
    "deg per s": ("deg/s", "rate"),
    "deg per sec": ("deg/s", "rate"),
    "deg h": ("deg/h", "rate"),
    "deg hr": ("deg/h", "rate"),
    "deg per h": ("deg/h", "rate"),
    "deg per hr": ("deg/h", "rate"),
    "deg per hour": ("deg/h", "rate"),
}
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
    "gyro",
    "gyr",
    "imu",
    "sensor",
    "rlg",
    "fog",
    "mems",
    "kreisel",
    "unit",
    "dut",
    "uut",
    "housing",
    "block",
}
_NO_TEMPERATURE = {
    "setpoint",
    "set",
    "soll",
    "sollwert",
    "nominal",
    "ambient",
    "chamber",
    "air",
    "room",
    "target",
    "klima",
    "time",
    "ramp",
}


@dataclass(frozen=True, slots=True)
class Meaning:
    """What a name says.

    Attributes:
        kind: Time, temperature, rate, or None.
        unit: A unit that the name gives, or None.
        why: How the name gives it.
        score: How much speaks for the kind; 0 where nothing does.
        axis: "x", "y", "z" or empty.
    """

    kind: Kind | None
    unit: str | None
    why: str
    score: int
    axis: str


def words(name: str) -> list[str]:
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
        before = split_unit(found["base"]) if kind_of(unit) is None and found["base"] else ("", None, "")
        if before[1] and kind_of(before[1]):
            return before
        if kind_of(unit) or not re.fullmatch(r"[xyzXYZ\d\s#:]+", unit):
            return found["base"], unit, "in brackets in its name"
    if (found := _WITH_SIGN.match(name)) and kind_of(found["unit"]) == "rate":
        return found["base"].rstrip(" /,"), found["unit"], "the end of its name"
    if (found := _AFTER_SIGN.match(name)) and kind_of(found["unit"]):
        return found["base"], found["unit"], "after the sign in its name"
    parts = words(name)
    for length in (3, 2, 1):
        ending = " ".join(parts[-length:])
        if ending in _ENDINGS and (len(parts) > length or len(ending) > 2):
            return (
                " ".join(parts[:-length]) or ending,
                _ENDINGS[ending][0],
                f"the ending of its name, {ending}",
            )
    if re.search(r"[a-z](US|MS|NS)$", name):
        return name[:-2], name[-2:].lower(), f"the ending of its name, {name[-2:]}"
    return name, None, ""


def meaning(name: str, unit: str | None, table: str = "") -> Meaning:
    """What a column of that name and (where the file gives one) that unit holds."""
    base, in_name, why = split_unit(name)
    kind = kind_of(unit) if unit else None
    if unit is None and in_name is not None:
        unit, kind = in_name, kind_of(in_name)
    parts = words(base)
    scores: dict[Kind, int] = dict.fromkeys([kind] if kind else [], 4)
    around = set(parts) | set(words(table))
    kinds: tuple[tuple[Kind, set[str]], ...] = (
        ("time", _TIME),
        ("temperature", _TEMPERATURE),
        ("rate", _RATE),
    )
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
    last = (words(re.sub(r"[\[\]()]", " ", base)) or [""])[-1]
    for form in (r"([xyz])", r"(?:gyro?|gyroscope|w|g|omega|rate|ω|ang(?:ular)?vel(?:ocity)?)_?([xyz])\d?"):
        if found := re.fullmatch(form, last):
            return found[1]
    tail = re.search(r"\.([xyz])$", base.lower()) or re.search(r"(?:^|[_\s.])([xyz])(?=[_\s.])", base.lower() + " ")
    return tail[1] if tail else ""
