"""The forms and words in which pages and terminals show what results have as numbers and keys.

numpy, pydantic and the results are imported where they are used: the command line's help does without them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from ..results.release import Limit


_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PLAIN = (-3, 5)  # powers of ten between which numbers are written without one


def power(exponent: int) -> str:
    """A power of ten: 10⁻⁴."""
    return "10" + str(exponent).translate(_SUPERSCRIPTS)


def is_plain(exponent: int) -> bool:
    """Test whether a number of this power of ten is written without one (0.01 to 99999), wherever it stands."""
    return _PLAIN[0] < exponent < _PLAIN[1]


def significant(value: float, digits: int) -> str:
    """A number with so many significant digits, those before the point whole: 1303, 2764.2, 0.0215, 7.00·10⁻⁴."""
    if value == 0.0:
        return "0"
    exponent = math.floor(math.log10(abs(value)))
    if is_plain(exponent):
        return f"{value:.{max(digits - 1 - exponent, 0)}f}".replace("-", "−")
    mantissa, _, exact = f"{value:.{digits - 1}e}".partition("e")
    return f"{mantissa}·{power(int(exact))}".replace("-", "−")


CONSTANT_PASSES = "a constant keeps it, too, so it asks nothing of the map"
"""What is said of a limit that a constant for a correction passes."""

COVERAGE = 2.0
"""k of about 95 % of a normal distribution (JCGM 100:2008, G.1)."""

_UNITS = (
    ("_dph_per_c_per_min", "deg/h/(C/min)"),
    ("_dph_per_sqrt_h", "deg/h/√h"),
    ("_deg_per_sqrt_h", "deg/√h"),
    ("_c_per_min", "C/min"),
    ("_dph_per_day", "deg/h a day"),
    ("_dph_per_unit", "deg/h a unit"),
    ("_dph_per_c", "deg/h/C"),
    ("_dph", "deg/h"),
    ("_arcsec", "arcsec"),
    ("_bytes", "bytes"),
    ("_rad", "rad"),
    ("_s", "s"),
    ("_c", "C"),
)
"""Ends of keys, the longer first."""

_STEMS = {
    "tau": "time constant",
    "width": "width",
    "rms": "RMS",
    "std": "standard deviation about the mean",
    "mean": "mean",
    "max_abs": "largest magnitude",
    "rms_30min": "RMS of 30-minute means, worst run",
    "angle_1h": "angle after one hour, worst run",
    "first_10min_rms": "RMS of the first 10 minutes, worst run",
    "rms_over_floor": "RMS ÷ noise floor",
    "noise_floor": "noise floor",
    "uncertainty": "uncertainty of the map (1 σ), largest",
    "error_bound": "error of the emitted arithmetic, proven bound",
    "table": "table",
    "rom": "code and constants",
    "ram": "memory",
    "rows_left_out": "rows of training left out for what they show",
    "centers": "centers",
    "improvement": "improvement: RMS that a constant leaves ÷ RMS after",
    "improvement_about_zero": "RMS before ÷ after, mean included",
    "covered": "share of the envelope with training data",
    "constant_rms": "RMS that a constant leaves",
    "after_rms": "RMS after",
    "after_mean": "mean after",
    "bias": "mean bias",
    "sum_abs_weights": "sum of the map's weights",
}

_LIMITS = {
    "covers.temperature_c": "calibrated temperatures, C",
    "covers.slope_c_per_min": "calibrated temperature rates, C/min",
    "needs.arithmetics": "arithmetic emitted",
    "needs.targets": "bit for bit on the target",
    "needs.generalises": "holds on thermal history that it has not seen",
    "needs.no_findings": "findings that must not be there",
}

_CANDIDATES = {
    "constant": "a constant",
    "linear": "a plane in T and dT/dt",
    "cubic": "a cubic in T",
    "cubic_slope": "a cubic in T and dT/dt",
    "mrbf_t": "the network over T",
    "mrbf": "the network over T and dT/dt",
}


def words(key: str) -> str:
    """A key such as `constant_rms_dph` as words with its unit: "RMS that a constant leaves, deg/h"."""
    for end, unit in _UNITS:
        stem = key.removesuffix(end)
        if stem != key and stem:
            return f"{_STEMS.get(stem, stem.replace('_', ' '))}, {unit}"
    return _STEMS.get(key, key.replace("_", " "))


def limit_words(limit: str) -> str:
    """Return the words for the figure of a limit."""
    return _LIMITS.get(limit) or words(limit.partition(".")[2])


def words_of_candidate(id: str) -> str:
    """A correction of model selection."""
    return _CANDIDATES.get(id, id.replace("_", " "))


def sci(value: float | None, digits: int = 2) -> str:
    """A number with one more significant digit than that: 0.0123, 1303, 7.00·10⁻⁴; an en dash where there is none."""
    return "–" if value is None else significant(value, digits + 1)


class Digits(NamedTuple):
    """A figure and its expanded uncertainty as they are printed: both times a power of ten, to the same digit."""

    value: str
    spread: str
    exponent: int

    @property
    def page(self) -> str:
        """(7.21 ± 0.25)·10⁻⁴."""
        text = f"{self.value} ± {self.spread}".replace("-", "−")
        return text if self.exponent == 0 else f"({text})·{power(self.exponent)}"

    def decimal(self, mantissa: str) -> str:
        """The value or the spread as machines read it: 7.21e-4."""
        return mantissa if self.exponent == 0 else f"{mantissa}e{self.exponent}"


def digits_of(value: float, expanded: float) -> Digits:
    """A figure to the digit that its expanded uncertainty, to two digits and rounded up, says something of."""
    exponent = math.floor(math.log10(max(abs(value), expanded)))
    if is_plain(exponent):
        exponent = 0
    scaled, spread = value / 10.0**exponent, expanded / 10.0**exponent
    digits = max(0, 1 - math.floor(math.log10(spread)))
    spread = math.ceil(round(spread * 10.0**digits, 6)) / 10.0**digits
    return Digits(f"{scaled:.{digits}f}", f"{spread:.{digits}f}", exponent)


def with_uncertainty(value: float | None, expanded: float | None) -> str:
    """A figure and its expanded uncertainty to the same digit, two of the uncertainty: (7.21 ± 0.25)·10⁻⁴."""
    if value is None or not expanded or not math.isfinite(expanded):
        return sci(value)
    return digits_of(value, expanded).page


def rounded(expanded: float) -> str:
    """An expanded uncertainty to two digits, rounded up (JCGM 100:2008, 7.2.6)."""
    if not expanded:
        return "0"
    found = digits_of(0.0, expanded)
    return found.spread if found.exponent == 0 else f"{found.spread}·{power(found.exponent)}"


def plain(value: Any) -> str:
    """A figure of any kind."""
    if isinstance(value, (list, tuple)):
        numbers = [v for v in value if isinstance(v, float)]
        if value and len(numbers) == len(value):
            return " … ".join(f"{v:.4g}".replace("-", "−") for v in value)
        return ", ".join(plain(v).replace("_", " ") for v in value) or "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return sci(value, 3) if value != round(value) or abs(value) >= 1e6 else f"{value:g}".replace("-", "−")
    return "–" if value is None else str(value)


def measured_words(limit: Limit) -> str:
    """Return the measured figure of a limit, rounded to its uncertainty."""
    if isinstance(limit.measured, float) and limit.expanded_uncertainty:
        return with_uncertainty(limit.measured, limit.expanded_uncertainty)
    if limit.measured is None:
        return "not measured" if not limit.limit.startswith("needs.generalises") else "not known"
    return plain(limit.measured)


def bound_words(limit: Limit) -> str:
    """A bound with its sense, as it was given."""
    sign = {"at_most": "≤ ", "at_least": "≥ "}.get(limit.limit.partition(".")[0], "")
    if isinstance(limit.bound, float):
        mantissa, _, exponent = f"{limit.bound:.6g}".partition("e")
        if 0.0 < abs(limit.bound) < 0.01:
            mantissa, _, exponent = f"{limit.bound:.5e}".partition("e")
            mantissa = mantissa.rstrip("0").rstrip(".")
        return sign + mantissa + (f"·{power(int(exponent))}" if exponent else "")
    return sign + plain(limit.bound).replace("_", " ")


def failure_words(limit: Limit) -> str:
    """Return the reason why a limit is not met, with its key in the limits file."""
    name = f"limit {limit.limit} {bound_words(limit)}"
    if limit.verdict == "NOT TESTABLE":
        return f"{name} is not testable: {'; '.join(limit.capped)}"
    return f"{name} is not met: {measured_words(limit)}"
