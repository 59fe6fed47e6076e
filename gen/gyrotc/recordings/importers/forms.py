"""Forms of dates and times of day with the codes of `strptime`, told from a sample; `%f` may be missing."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import cache

import pyarrow as pa

from ...common.errors import InputError

__all__ = ["MONTHS", "forms_of", "pattern_of"]

_CODES = {
    "Y": r"(?P<Y>\d{4})",
    "y": r"(?P<y>\d{2})",
    "m": r"(?P<m>\d{1,2})",
    "d": r"(?P<d>\d{1,2})",
    "b": r"(?P<b>[A-Za-z]{3})",
    "j": r"(?P<j>\d{1,3})",
    "H": r"(?P<H>\d{1,2})",
    "I": r"(?P<I>\d{1,2})",
    "M": r"(?P<M>\d{2})",
    "S": r"(?P<S>\d{2})",
    "f": r"(?P<f>\d{1,9})",
    "p": r"(?P<p>[AaPp])\.?[Mm]\.?",
    "z": r"(?P<z>[Zz]|[+-]\d{2}:?\d{2})",
}
_LONGEST_H = 9999  # of a time that counts on: 75:30:00
MONTHS = pa.array(["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"])
_DATES = (
    "%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y", "%d-%b-%Y",
    "%d %b %Y", "%d.%m.%y", "%d/%m/%y", "%m/%d/%y", "%Y-%j", "%Y%m%d",
)  # fmt: skip
_TIMES = (
    "%H:%M:%S.%f",
    "%H:%M:%S,%f",
    "%H:%M:%S:%f",
    "%H:%M:%S",
    "%I:%M:%S.%f %p",
    "%I:%M:%S %p",
    "%H%M%S",
    "%H:%M",
)
_JOINTS = (" ", "T", "  ", "_", " - ", ", ")
_MAYBE = re.compile(r"\d{1,4}[-/.: ]|\d{8}|\d{6}")
_DIGITS_ONLY = re.compile(r"(%[A-Za-z])+")


def forms_of(sample: Sequence[str]) -> list[str]:
    """Forms that all texts of a sample have; two where day and month cannot be told apart.

    Forms with a fraction that none of the texts has are left out.
    """
    texts = [text.strip().strip('"') for text in sample if text.strip()]
    if not texts:
        return []
    found = [form for form in _candidates(texts[0]) if all(_fits(form, text) for text in texts)]
    with_fraction = [form for form in found if "%f" in form and any(_fraction(form, text) for text in texts)]
    plain = [form for form in found if "%f" not in form]
    return list(dict.fromkeys(plain or with_fraction))


_ZONES = ("", "%z", " %z", " UTC", " GMT")


def _candidates(text: str) -> Iterator[str]:
    """Forms that one text has: a date, a time of day, or both and perhaps a zone."""
    if not _MAYBE.match(text):
        return
    for date in _DATES:
        begins = _compiled(date).match(text)
        if begins is None:
            continue
        rest = text[begins.end() :]
        if not rest and not _DIGITS_ONLY.fullmatch(date):
            yield date
        for joint in _JOINTS:
            if rest.startswith(joint):
                yield from (f"{date}{joint}{time}" for time in _clocks(rest[len(joint) :]))
    yield from (time for time in _clocks(text) if not _DIGITS_ONLY.fullmatch(time))


def _clocks(text: str) -> Iterator[str]:
    """Forms of times of day, perhaps with a zone, that a text has."""
    for time in _TIMES:
        begins = _compiled(time).match(text)
        if begins is not None:
            yield from (time + zone for zone in _ZONES if _compiled(zone).fullmatch(text[begins.end() :]))


def _fits(form: str, text: str) -> bool:
    found = _compiled(form).fullmatch(text)
    return found is not None and _possible(found.groupdict())


@cache
def _compiled(form: str) -> re.Pattern[str]:
    return re.compile(pattern_of(form))


def _possible(parts: dict[str, str | None]) -> bool:
    longest = 23 if "d" in parts or "j" in parts or "S" not in parts else _LONGEST_H
    limits = {"m": (1, 12), "d": (1, 31), "H": (0, longest), "I": (1, 12), "M": (0, 59), "S": (0, 60)}
    if any(not low <= int(parts[k] or low) <= high for k, (low, high) in limits.items() if k in parts):
        return False
    return parts.get("b") is None or str(parts["b"]).lower() in MONTHS.to_pylist()


def _fraction(form: str, text: str) -> bool:
    found = _compiled(form).fullmatch(text)
    return bool(found and found["f"])


def pattern_of(form: str) -> str:
    """The form as a regular expression that both `re` and RE2 read."""
    parts = re.split(r"([.,:]?%[A-Za-z])", form)
    counts_on = "%S" in form and not any(code in form for code in ("%d", "%j"))
    pattern = ""
    for part in parts:
        if re.fullmatch(r"[.,:]?%[A-Za-z]", part):
            code = _CODES.get(part[-1])
            if code is None:
                raise InputError("[time] format", f"the code %{part[-1]}", f"one of %{' %'.join(_CODES)}")
            if part[-1] == "H" and counts_on:
                code = r"(?P<H>\d{1,4})"
            mark = re.escape(part[:-2])
            pattern += f"(?:{mark}{code})?" if part[-1] == "f" and mark else mark + code
        else:
            pattern += re.escape(part).replace(r"\ ", " ")
    return pattern
