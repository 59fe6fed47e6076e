"""The unit and form in which pages and terminals show numbers. Results and files keep deg/h; what people read changes.

numpy, pydantic and the results are imported where they are used: the command line's help does without them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, TypeVar

from ..common.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from pydantic import BaseModel

    from ..common.arrays import FloatArray

NATIVE = "deg/h"
DISPLAYS = {NATIVE: 1.0, "deg/s": 1.0 / 3600.0, "mdps": 1.0 / 3.6, "arcsec/s": 1.0}
"""Units by name, and how many of one are 1 deg/h: an hour has 3600 s, a degree 3600 arcsec, mdps is 1e-3 deg/s."""

_CURRENT: ContextVar[str] = ContextVar("display", default=NATIVE)
_RATE = re.compile(r"_dph(_per_\w+)?$")
_DIGITS, _SUPERSCRIPTS = "-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"
_TO_SUPERSCRIPTS, _FROM_SUPERSCRIPTS = (
    str.maketrans(*pair) for pair in ((_DIGITS, _SUPERSCRIPTS), (_SUPERSCRIPTS, _DIGITS))
)
_POWER = rf"·10[{_SUPERSCRIPTS}]+"
_NUMBER = rf"[+−-]?\d[\d,]*\.?\d*(?:e[+-]?\d+|{_POWER})?"
_TOGETHER = re.compile(rf"\(({_NUMBER}) ± ({_NUMBER})\)({_POWER})")
_STATED = re.compile(rf"(?<![\w.])({_NUMBER}(?: (?:\.\.\.|…|->|→|±|\+-|and|to) {_NUMBER})*) deg/h(?![/\w√²])")
_NO_RATES = ("freedom", "degrees_of_freedom", "coverage_factor", "p_value", "sigmas")  # beside a rate
_OF_LIMIT = (
    "measured", "bound", "standard_uncertainty", "expanded_uncertainty", "guard_band", "acceptance_limit",
)  # fmt: skip

T = TypeVar("T")


def check_display(name: str | None) -> None:
    """Refuses a unit that is not known; None is the default.

    Raises:
        InputError: It is none of `DISPLAYS`.
    """
    if name is not None and name not in DISPLAYS:
        raise InputError("--display", repr(name), ", ".join(DISPLAYS))


@contextmanager
def displayed(name: str) -> Iterator[None]:
    """Within it rates are shown in this unit.

    Raises:
        InputError: It is none of `DISPLAYS`.
    """
    check_display(name)
    token = _CURRENT.set(name)
    try:
        yield
    finally:
        _CURRENT.reset(token)


def rate_unit() -> str:
    """Name of the unit in which rates are shown."""
    return _CURRENT.get()


def in_unit(values_dph: ArrayLike) -> FloatArray:
    """Rates in deg/h in the unit in which they are shown; any shape."""
    import numpy as np

    return np.asarray(values_dph, dtype=np.float64) * DISPLAYS[rate_unit()]


def shown(part: T) -> T:
    """A result as people read it: its rates, known by the ends of their names, in the unit in which they are shown."""
    made: T = _shown(part, rate=False)
    return made


def with_unit(value: float | None, unit: str) -> str:
    """A figure and its unit as they are shown: of deg/h/C, deg/h is changed."""
    if value is None:
        return "never"
    factor = DISPLAYS[rate_unit()] if unit.startswith(NATIVE) else 1.0
    return f"{significant(value * factor, 3)} {unit.replace(NATIVE, rate_unit())}"


def shown_text(text: str) -> str:
    """A sentence with its rates in the unit and form in which they are shown, with as many digits as they have."""
    if NATIVE not in text:
        return text
    apart = text if rate_unit() == NATIVE else _TOGETHER.sub(r"\1\3 ± \2\3", text)
    return _STATED.sub(lambda found: re.sub(_NUMBER, _converted, found[1]) + f" {rate_unit()}", apart)


def _converted(found: re.Match[str]) -> str:
    number = found[0].replace(",", "").replace("·10", "e").replace("−", "-").translate(_FROM_SUPERSCRIPTS)
    digits = len(re.sub(r"^[+-]?[0.]*|[.]|e.*$", "", number)) or 1
    sign = "+" if number.startswith("+") else ""
    return sign + significant(float(number) * DISPLAYS[rate_unit()], digits)


def _shown(value: Any, *, rate: bool) -> Any:
    from pydantic import BaseModel

    if isinstance(value, bool) or value is None:
        return value
    if isinstance(value, float):
        return value * DISPLAYS[rate_unit()] if rate and rate_unit() != NATIVE else value
    if isinstance(value, str):
        return shown_text(value)
    if isinstance(value, tuple | list):
        made = type(value)(_shown(one, rate=rate) for one in value)
        return value if all(a is b for a, b in zip(made, value, strict=True)) else made
    if isinstance(value, Mapping):
        return {key: _shown(one, rate=rate or bool(_RATE.search(str(key)))) for key, one in value.items()}
    return _shown_object(value, rate=rate) if isinstance(value, BaseModel) else value


def _shown_object(part: BaseModel, *, rate: bool) -> BaseModel:
    from ..results.diagnosed import ComparedStatistic, ParameterLikelihood
    from ..results.findings import Size
    from ..results.fleet import FleetOutlier
    from ..results.planned import DetectionLimit
    from ..results.release import Contribution, Instrument, Limit

    rates = {name for name in type(part).model_fields if _RATE.search(name) or (rate and name not in _NO_RATES)}
    if isinstance(part, Limit) and _RATE.search(part.limit):
        rates |= set(_OF_LIMIT)
    elif isinstance(part, FleetOutlier) and _RATE.search(part.figure):
        rates |= {"value", "median"}
    elif isinstance(part, Instrument) and part.quantity == "rate":
        rates.add("expanded_uncertainty")
    elif isinstance(part, ComparedStatistic) and _RATE.search(part.statistic):
        rates |= {name for name in type(part).model_fields if name.startswith(("measured", "simulated"))}
    elif isinstance(part, ParameterLikelihood) and _RATE.search(part.parameter):
        rates |= {"values", "low", "high"}
    elif isinstance(part, Contribution):
        rates.add("standard_uncertainty" if part.unit == NATIVE else "sensitivity")
    elif isinstance(part, Size | DetectionLimit) and part.unit.startswith(NATIVE):
        rates |= {"value", "low", "high"}
    update = {name: _shown(getattr(part, name), rate=name in rates) for name in type(part).model_fields}
    if isinstance(part, Contribution | Size | DetectionLimit) and part.unit.startswith(NATIVE):
        update["unit"] = part.unit.replace(NATIVE, rate_unit())
        if isinstance(part, DetectionLimit):
            update["over"] = tuple((at, _shown(limit, rate=True)) for at, limit in part.over)
    changed = {k: v for k, v in update.items() if v is not getattr(part, k)}
    return part.model_copy(update=changed) if changed else part


_PLAIN = (-3, 5)  # powers of ten between which numbers are written without one


def power(exponent: int) -> str:
    """A power of ten: 10⁻⁴."""
    return "10" + str(exponent).translate(_TO_SUPERSCRIPTS)


def is_plain(exponent: int) -> bool:
    """Whether a number of this power of ten is written without one: 0.01 to 99999, on axes, in tables, in sentences."""
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
