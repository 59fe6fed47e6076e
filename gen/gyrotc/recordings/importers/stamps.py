"""Dates and times of day in the forms of loggers: the form comes from a sample, then whole columns are parsed.

A form is written with the codes of `strptime`; `%f` stands for a fraction of any length, which may be missing.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from functools import cache
from typing import Any
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from ...common.arrays import IntArray
from ...common.errors import InputError, quoted

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
_TIMES = ("%H:%M:%S.%f", "%H:%M:%S,%f", "%H:%M:%S:%f", "%H:%M:%S", "%I:%M:%S.%f %p", "%I:%M:%S %p", "%H%M%S", "%H:%M")
COMPACT = "%Y%m%d%H%M%S"
"""A date and a time of day as digits alone."""
_JOINTS = (" ", "T", "  ", "_", " - ", ", ")
_MAYBE = re.compile(r"\d{1,4}[-/.: ]|\d{8}|\d{6}")
_DIGITS_ONLY = re.compile(r"(%[A-Za-z])+")


def forms_of(sample: Sequence[str]) -> list[str]:
    """List the forms that all texts of a sample have; two if day and month cannot be distinguished.

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
    """Yield the forms that a text has: a date, a time of day, or both, with or without a zone."""
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
    """Yield the forms of times of day that a text has, with or without a zone."""
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


_DAY_NS = 86_400_000_000_000  # 86,400 s


def zone_of(text: str) -> ZoneInfo | int:
    """A time zone: a name such as Europe/Berlin or UTC, or an offset as +01:00 in seconds.

    Raises:
        InputError: There is no such zone.
    """
    if found := re.fullmatch(r"([+-])(\d{2}):?(\d{2})", text.strip()):
        return (-1 if found[1] == "-" else 1) * (int(found[2]) * 3600 + int(found[3]) * 60)
    if text.strip().upper() in ("Z", "UTC", "GMT"):
        return 0
    try:
        return ZoneInfo(text.strip())
    except (ZoneInfoNotFoundError, ValueError, OSError) as error:
        raise InputError("[time] zone", quoted(text), "a name such as Europe/Berlin or UTC, or +01:00") from error


class Stamps:
    """Parses stamps of one form, chunk after chunk.

    Args:
        form: Codes of `strptime`.
        zone: Where the form has no %z: name or offset of the zone; None: not known.

    Attributes:
        known_zone: Whether the times are those of UTC.
    """

    def __init__(self, form: str, zone: str | None) -> None:
        self._form = form
        self._pattern = f"^{pattern_of(form)}$"
        re.compile(self._pattern)
        self._zone = zone_of(zone) if zone else None
        utc = form.endswith((" UTC", " GMT"))
        self.known_zone = "%z" in form or utc or self._zone is not None
        self.dated = any(code in form for code in ("%d", "%j"))
        self._midnights = 0
        self._again = 0
        self._local = np.iinfo(np.int64).min
        self._last = -1

    def parse(self, texts: Any) -> tuple[IntArray, NDArray[np.bool_]]:
        """Return nanoseconds since 1970 (since midnight without a date), and a mask of the texts understood."""
        if pa.types.is_null(texts.type):
            texts = texts.cast(pa.string())
        trimmed = pc.utf8_trim(texts, ' "')
        parts = pc.extract_regex(trimmed, self._pattern)
        good = np.asarray(pc.is_valid(parts).to_numpy(zero_copy_only=False), dtype=bool)
        get = _Parts(parts)
        day, fits = _days(get)
        seconds = get.hours() * 3600 + get.whole("M") * 60 + get.whole("S")
        ns = day * _DAY_NS + seconds * 1_000_000_000 + get.fraction()
        good &= fits & ((seconds <= 86_400) | (not self.dated))
        ns -= get.offset() * 1_000_000_000
        if not self.dated:
            ns = self._over_midnight(ns, good)
        if self._zone is not None and "%z" not in self._form:
            ns -= self._ahead(ns, good)
        return ns, good

    def _ahead(self, local: IntArray, good: NDArray[np.bool_]) -> IntArray:
        """Return by how many nanoseconds local times are ahead of UTC.

        In the hour that is repeated at the end of summer time, local time goes back once; the rows behind are of the
        second pass.
        """
        if isinstance(self._zone, int) or self._zone is None:
            return np.full(len(local), (self._zone or 0) * 1_000_000_000, dtype=np.int64)
        first, second = _offsets(local, self._zone, good)
        twice = (first != second) & good
        if twice.any():
            before = np.r_[self._local, local[:-1]]
            again = np.cumsum(twice & (local < before)) + self._again
            first = np.where(twice & (again > 0), second, first)
            self._again = int(again[-1]) if twice[-1] else 0
        else:
            self._again = 0
        if len(local):
            self._local = int(local[-1])
        return first

    def _over_midnight(self, ns: IntArray, good: NDArray[np.bool_]) -> IntArray:
        """Continue times of day after midnight."""
        chosen = ns[good]
        before = np.r_[self._last if self._last >= 0 else chosen[:1], chosen[:-1]]
        falls = np.cumsum(chosen < before - _DAY_NS // 2)
        result: IntArray = ns.copy()
        result[good] = chosen + (self._midnights + falls) * _DAY_NS
        if len(chosen):
            self._midnights += int(falls[-1])
            self._last = int(chosen[-1])
        return result


class _Parts:
    """The parts of parsed stamps as whole numbers."""

    def __init__(self, parts: Any) -> None:
        self._parts = parts
        self._names = {parts.type.field(k).name for k in range(parts.type.num_fields)}

    def text(self, name: str) -> Any:
        return pc.struct_field(self._parts, name)

    def whole(self, name: str, absent: int = 0) -> IntArray:
        if name not in self._names:
            return np.full(len(self._parts), absent, dtype=np.int64)
        text = self.text(name)
        filled = pc.if_else(pc.equal(pc.fill_null(text, ""), ""), str(absent), text)
        return np.asarray(filled.cast(pa.int64()).to_numpy(zero_copy_only=False), dtype=np.int64)

    def has(self, name: str) -> bool:
        return name in self._names

    def hours(self) -> IntArray:
        if not self.has("I"):
            return self.whole("H")
        after_noon = pc.equal(pc.utf8_lower(pc.fill_null(self.text("p"), "a")), "p")
        half: IntArray = np.asarray(after_noon.to_numpy(zero_copy_only=False)).astype(np.int64)
        return self.whole("I") % 12 + 12 * half

    def fraction(self) -> IntArray:
        """Return the nanoseconds of the fraction."""
        if not self.has("f"):
            return np.zeros(len(self._parts), dtype=np.int64)
        padded = pc.utf8_rpad(pc.fill_null(self.text("f"), ""), 9, "0")
        return np.asarray(padded.cast(pa.int64()).to_numpy(zero_copy_only=False), dtype=np.int64)

    def offset(self) -> IntArray:
        """Return the seconds east of UTC."""
        if not self.has("z"):
            return np.zeros(len(self._parts), dtype=np.int64)
        known = {text: _offset_s(text) for text in pc.unique(self.text("z")).to_pylist()}
        if len(known) == 1:
            return np.full(len(self._parts), next(iter(known.values())), dtype=np.int64)
        return np.array([known[text] for text in self.text("z").to_pylist()], dtype=np.int64)


def _offset_s(text: str | None) -> int:
    if not text or text in "Zz":
        return 0
    zone = zone_of(text)
    assert isinstance(zone, int)
    return zone


def _days(get: _Parts) -> tuple[IntArray, NDArray[np.bool_]]:
    """Return days since 1970, and a mask of the dates that exist."""
    n = len(get.whole("M"))
    if not (get.has("d") or get.has("j")):
        return np.zeros(n, dtype=np.int64), np.ones(n, dtype=bool)
    year = get.whole("Y", 1970)
    if get.has("y"):
        short = get.whole("y")
        year = np.where(short < 69, 2000 + short, 1900 + short)
    if get.has("j"):
        start = (year - 1970).astype("datetime64[Y]").astype("datetime64[D]").astype(np.int64)
        return np.asarray(start + get.whole("j", 1) - 1), np.ones(n, dtype=bool)
    month = get.whole("m", 1)
    if get.has("b"):
        names = pc.utf8_lower(get.text("b"))
        found = pc.fill_null(pc.index_in(names, MONTHS), -1)
        month = np.asarray(found.to_numpy(zero_copy_only=False), dtype=np.int64) + 1
    day = get.whole("d", 1)
    months = ((year - 1970) * 12 + month - 1).astype("datetime64[M]")
    dates = months.astype("datetime64[D]") + (day - 1).astype("timedelta64[D]")
    fits = (month >= 1) & (month <= 12) & (day >= 1) & (dates.astype("datetime64[M]") == months)
    return dates.astype(np.int64), np.asarray(fits)


def _offsets(ns: IntArray, zone: ZoneInfo, good: NDArray[np.bool_]) -> tuple[IntArray, IntArray]:
    """Return by how many nanoseconds local times are ahead of UTC at their first and second occurrence.

    The zone's rules are asked once for each quarter of an hour.
    """
    quarters = np.where(good, ns, 0) // (900 * 1_000_000_000)
    unique, index = np.unique(quarters, return_inverse=True)
    ahead = np.array([[_ahead_s(int(q) * 900, zone, fold) for fold in (0, 1)] for q in unique], dtype=np.int64)
    both = ahead.reshape(-1, 2)[index] * 1_000_000_000
    return both[:, 0], both[:, 1]


def _ahead_s(local_s: int, zone: ZoneInfo, fold: int) -> int:
    local = datetime.fromisoformat("1970-01-01") + timedelta(seconds=local_s)
    offset = local.replace(tzinfo=zone, fold=fold).utcoffset()
    return int(offset.total_seconds()) if offset is not None else 0
