"""Dates and times of day in the forms of loggers: the form is told from a sample, then whole columns are parsed.

A form is written with the codes of `strptime`; `%f` stands for a fraction of any length, which may be missing.
"""

from __future__ import annotations

import re
from datetime import datetime, timedelta
from typing import Any
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from ...common.arrays import IntArray
from ...common.errors import InputError
from .forms import MONTHS, pattern_of

__all__ = ["Stamps", "zone_of"]

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
        raise InputError(
            "[time] zone", repr(text), "a name such as Europe/Berlin or UTC, or +01:00"
        ) from error


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
        """Nanoseconds since 1970 (since midnight for a form without a date), and which texts were understood."""
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
        """Nanoseconds that local times are ahead of UTC. The hour that comes twice when summer time ends is told from
        the local time going back in it.
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
        """Times of day that go on after midnight."""
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
        """Nanoseconds of the fraction."""
        if not self.has("f"):
            return np.zeros(len(self._parts), dtype=np.int64)
        padded = pc.utf8_rpad(pc.fill_null(self.text("f"), ""), 9, "0")
        return np.asarray(padded.cast(pa.int64()).to_numpy(zero_copy_only=False), dtype=np.int64)

    def offset(self) -> IntArray:
        """Seconds east of UTC."""
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
    """Days since 1970, and which dates there are."""
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
    """Nanoseconds that local times are ahead of UTC, the first and the second time that they come.

    The zone's rules are asked once for each quarter of an hour.
    """
    quarters = np.where(good, ns, 0) // (900 * 1_000_000_000)
    unique, index = np.unique(quarters, return_inverse=True)
    ahead = np.array(
        [[_ahead_s(int(q) * 900, zone, fold) for fold in (0, 1)] for q in unique], dtype=np.int64
    )
    both = ahead.reshape(-1, 2)[index] * 1_000_000_000
    return both[:, 0], both[:, 1]


def _ahead_s(local_s: int, zone: ZoneInfo, fold: int) -> int:
    local = datetime.fromisoformat("1970-01-01") + timedelta(seconds=local_s)
    offset = local.replace(tzinfo=zone, fold=fold).utcoffset()
    return int(offset.total_seconds()) if offset is not None else 0
