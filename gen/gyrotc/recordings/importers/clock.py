"""Times of a table in seconds: stamps, counters that may wrap, parts in columns, or rows at a fixed rate."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime, timedelta, timezone
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from ...common.arrays import FloatArray
from ...common.errors import InputError, quoted
from ..description import not_yet
from ..tables import Chunk, Column, LoggerTable
from ..units import Conversion, conversion, words_of_name
from .map_file import TimeMap
from .stamps import Stamps, forms_of

_CODES = {
    "year": "%Y", "month": "%m", "day": "%d", "hour": "%H", "hours": "%H", "hr": "%H", "minute": "%M", "minutes": "%M",
    "min": "%M", "second": "%S", "seconds": "%S", "sec": "%S",
}  # fmt: skip
# Digits of that part of a second.
_FRACTIONS = {"ms": 3, "msec": 3, "millis": 3, "millisecond": 3, "milliseconds": 3, "us": 6, "microseconds": 6}
_ORDER = ("%Y", "%m", "%d", "%H", "%M", "%S", "%f")
_TIME_OF_DAY = {"%H", "%M", "%S"}


def _code(column: Column) -> str | None:
    """Return the part of a time that a column of numbers is named after; None if its name says more."""
    name = words_of_name(column.name)
    if column.kind != "number" or len(name) != 1:
        return None
    return "%f" if name[0] in _FRACTIONS else _CODES.get(name[0])


def clock_columns(columns: Sequence[Column]) -> list[Column]:
    """List the columns of numbers that make a time of day, with or without a date; none if a part is missing."""
    found = {code: column for column in reversed(columns) if (code := _code(column)) is not None}
    dated = {"%Y", "%m", "%d"} & set(found)
    if not set(found) >= _TIME_OF_DAY or len(dated) not in (0, 3):
        return []
    return [found[code] for code in _ORDER if code in found]


def fraction_of(columns: Sequence[Column], stamp: Column) -> Column | None:
    """The column of milliseconds that follows a stamp without a fraction."""
    at = columns.index(stamp) + 1
    if at < len(columns) and _code(columns[at]) == "%f" and not any("." in cell for cell in stamp.sample):
        return columns[at]
    return None


def form_of_parts(columns: Sequence[Column]) -> str:
    """The form of such columns, joined by blanks; empty where a name says no part."""
    codes = [_code(column) for column in columns]
    return " ".join(code for code in codes if code) if all(codes) else ""


def text_of(column: Column, values: Any) -> Any:
    """A column as text: as it is, or its whole numbers with the digits that its part has."""
    if isinstance(values, pa.Array | pa.ChunkedArray):
        return pc.utf8_trim(values, ' "')
    name = words_of_name(column.name)
    width = _FRACTIONS.get(name[0], 2) if len(name) == 1 else 2
    whole = np.asarray(values, dtype=np.float64)
    texts = [f"{v:0{width}.0f}" if np.isfinite(v) and v == np.floor(v) else None for v in whole.tolist()]
    return pa.array(texts, pa.string())


def _digits(values: Any, form: str) -> pa.Array:
    """Whole numbers as the digits of a form without marks, such as %Y%m%d%H%M%S."""
    width = sum(_WIDTHS.get(code, 2) for code in re.findall("%([A-Za-z])", form))
    numbers = np.asarray(values)
    whole = np.isfinite(numbers) & (numbers == np.floor(numbers)) & (numbers >= 0) & (numbers < _MAX_EXACT)
    given = [f"{int(v):0{width}d}" if good else None for v, good in zip(numbers.tolist(), whole.tolist(), strict=True)]
    return pa.array(given, pa.string())


_WIDTHS = {"Y": 4, "j": 3, "f": 0}
_MAX_EXACT = 2**63
_EPOCH_S = 1e8  # a counter beyond three years counts from an epoch, not from power-on: it starts at its first row
_NAT = np.iinfo(np.int64).min
_WRAPS = (2**16, 2**24, 2**32)  # counters of 16, 24 and 32 bits
_PERIODS_S = (86_400.0, 604_800.0)  # seconds of the day, time of the GPS week
_NEAR_STEPS = 20.0  # usual steps that may be lost while a counter passes its end
_ZONE = re.compile(r"\b(?:GMT|UTC) ?([+-]\d{2}:?\d{2})")


class Clock:
    """Gives the time of every row, s.

    Stamps and counters of an epoch count from the first row; other counters are taken as they are.

    Args:
        file: Name for messages.
        table: The table.
        columns: Columns of time: none where rows are counted, one, or a date and a time of day.
        unit: Unit of a counter.
        rate_hz: Rows per second where rows are counted.
        stated: `[time]` of the map.

    Attributes:
        form: Form of the stamps; empty for other clocks.
        origin: What counts as 0: nanoseconds since 1970 for stamps, else a value of the counter.
    """

    def __init__(
        self,
        file: str,
        table: LoggerTable,
        columns: Sequence[Column],
        unit: str | None,
        rate_hz: float | None,
        stated: TimeMap,
    ) -> None:
        self.form = ""
        self.origin: int | float | None = None
        self._file, self._table, self._columns, self._rate_hz = file, table, columns, rate_hz
        self._unit: Conversion | None = conversion(unit, "time") if unit else None
        self._stamps: Stamps | None = None
        self._last: float | None = None
        self._wrap: int | None = None
        self._added = 0
        self._rows = 0
        self._start_s = 0.0
        compact = stated.format is not None and len(columns) == 1 and columns[0].kind == "number"
        if columns and (compact or ((columns[0].kind != "number" or len(columns) > 1) and columns[0].sample)):
            self.form = stated.format or _form(file, columns)
            in_name = _ZONE.search(columns[0].name)
            self._stamps = Stamps(self.form, stated.zone or (in_name[1] if in_name else None))
        elif columns and columns[0].kind == "number" and self._unit is None:
            raise InputError(file, "a counter without a unit", "--time-unit")
        self._known_zone = bool(columns) and (
            self._stamps.known_zone if self._stamps else columns[0].kind == "stamp" and columns[0].unit == "UTC"
        )

    @property
    def names(self) -> list[str]:
        """Names of the columns that it reads."""
        return [column.name for column in self._columns]

    @property
    def started(self) -> datetime | None:
        """Time of 0 where it is known and not in the future, in UTC."""
        return None if self.runs_ahead else self._zero

    @property
    def runs_ahead(self) -> bool:
        """True if the stamps lie in the future: the clock of the logger was wrong."""
        return self._zero is not None and not_yet(self._zero)

    @property
    def _zero(self) -> datetime | None:
        if self._table.started is not None and not (self._columns and self._columns[0].kind == "stamp"):
            return self._table.started if self.origin in (None, 0) else None
        if self._known_zone and self.origin is not None and (self._stamps is None or self._stamps.dated):
            return datetime(1970, 1, 1, tzinfo=timezone.utc) + timedelta(microseconds=int(self.origin) // 1000)
        return None

    @property
    def needs_zone(self) -> bool:
        """True if stamps with a date lack a zone."""
        dated = self._stamps is not None and self._stamps.dated
        return bool(self._columns) and not self._known_zone and dated

    @property
    def zero_ns(self) -> int | None:
        """Nanoseconds since 1970 at time 0; None if the clock counts from something else."""
        if not self._columns:
            return _nanoseconds(self._table.started) if self._table.started is not None else None
        stamps = self._stamps is not None or self._columns[0].kind == "stamp"
        return int(self.origin) if stamps and self.origin is not None else None

    def follow(self, other: Clock) -> None:
        """Count from the same zero as another clock that has begun.

        Raises:
            InputError: Nothing says how one clock is ahead of the other.
        """
        stamps = bool(self._columns) and (self._stamps is not None or self._columns[0].kind == "stamp")
        if stamps and other.zero_ns is not None and self._known_zone == other.known_zone:
            self.origin = other.zero_ns
        elif not self._columns and self.zero_ns is not None and other.zero_ns is not None and other.known_zone:
            self._start_s = (self.zero_ns - other.zero_ns) / 1e9
        elif self.zero_ns is None and not stamps and other.zero_ns is None and bool(self._columns) == other.counts:
            self.origin = other.origin
        else:
            found = f"has {self.words}, and the rates have {other.words}: nothing says how far one clock is ahead"
            expected = "times of one kind in both: stamps of known zones (--set time.zone=...), or one counter"
            raise InputError(self._file, found, expected)

    @property
    def known_zone(self) -> bool:
        """True if the times are those of UTC."""
        return self._known_zone or (not self._columns and self._table.started is not None)

    @property
    def counts(self) -> bool:
        """True if a column counts the time."""
        return bool(self._columns)

    @property
    def words(self) -> str:
        """Kind of the times, in words."""
        if not self._columns:
            return "rows at a fixed rate" + (" from a stated start" if self._table.started else "")
        zone = "a known zone" if self._known_zone else "no zone"
        stamps = self._stamps is not None or self._columns[0].kind == "stamp"
        return f"stamps of {zone}" if stamps else "a counter of time"

    def __call__(self, chunk: Chunk) -> FloatArray:
        """Return the times of the rows of a chunk, s; NaN if a row has none.

        Raises:
            InputError: A text that is no stamp of the form, with its place.
        """
        if not self._columns:
            assert self._rate_hz is not None
            self._rows += len(chunk)
            return self._start_s + np.arange(self._rows - len(chunk), self._rows) / self._rate_hz
        values = chunk.columns[self._columns[0].name]
        if self._stamps is not None:
            return self._since(*self._parsed(chunk))
        if self._columns[0].kind == "stamp":
            ns = np.asarray(values).astype("datetime64[ns]").astype(np.int64)
            return self._since(ns, ns != _NAT)
        return self._counted(np.asarray(values))

    def _parsed(self, chunk: Chunk) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        assert self._stamps is not None
        texts = chunk.columns[self._columns[0].name]
        if len(self._columns) == 1 and not isinstance(texts, pa.Array | pa.ChunkedArray):
            texts = _digits(texts, self.form)
        if len(self._columns) > 1:
            parts = [text_of(column, chunk.columns[column.name]) for column in self._columns]
            texts = pc.binary_join_element_wise(*parts, " ")
        ns, good = self._stamps.parse(texts)
        held = np.asarray(pc.not_equal(pc.fill_null(texts, ""), "").to_numpy(zero_copy_only=False), dtype=bool)
        if np.any(held & ~good):
            row = int(np.argmax(held & ~good))
            where = f"{self._file}, {self._table.place(chunk.row(row))}, column {self._columns[0].name}"
            hint = f"a stamp of the form {self.form}; --set time.format=... names another"
            raise InputError(where, quoted(texts[row].as_py()), hint)
        return ns, good

    def _since(self, ns: NDArray[np.int64], good: NDArray[np.bool_]) -> FloatArray:
        if self.origin is None and good.any():
            self.origin = int(ns[np.argmax(good)])
        result = (ns - int(self.origin or 0)) / 1e9
        result[~good] = np.nan
        return result

    def _counted(self, raw: NDArray[Any]) -> FloatArray:
        assert self._unit is not None
        raw = self._unwrapped(raw)
        factor = self._unit.factor
        finite = np.isfinite(raw)
        if self.origin is None and finite.any():
            first = raw[np.argmax(finite)].item()
            self.origin = first if abs(first * factor) > _EPOCH_S else 0
        origin = self.origin or 0
        since: FloatArray = (raw - raw.dtype.type(origin)).astype(np.float64)
        whole = round(1.0 / factor) if factor < 1.0 else 0
        return since / whole if whole and abs(whole * factor - 1.0) < 1e-12 else since * factor

    def _unwrapped(self, raw: NDArray[Any]) -> NDArray[Any]:
        """A counter that starts again at 2^16, 2^24 or 2^32, or with the day or the week, goes on."""
        if len(raw) == 0:
            return raw
        if raw.dtype.kind in "ui":
            raw = raw.astype(np.int64)
        step = np.diff(raw.astype(np.float64), prepend=np.nan if self._last is None else self._last)
        self._last = float(raw[-1])
        raw = raw + self._added
        near = _NEAR_STEPS * float(np.median(step[step > 0.0])) if np.any(step > 0.0) else 0.0
        begins = 0
        if self._wrap is None:
            wraps = (*_WRAPS, *(round(s / self._unit.factor) for s in _PERIODS_S if self._unit))
            found = [(at, wrap) for wrap in wraps for at in np.flatnonzero(_passes(step, wrap, near))[:1].tolist()]
            if not found:
                return raw
            begins, self._wrap = min(found)
        # A late sample falls back over the end of the counter, and the sample behind it passes that end again.
        turns = _passes(step, self._wrap, near).astype(np.int64) - _passes(-step, self._wrap, near)
        turns[:begins] = 0
        total = np.cumsum(turns) * self._wrap
        self._added += int(total[-1])
        return raw + total


def _passes(step: FloatArray, wrap: int, near: float) -> NDArray[np.bool_]:
    """Test which differences pass the end of a counter of that size."""
    return (np.abs(step + wrap) <= near) & (step < -0.5 * wrap)


def _nanoseconds(moment: datetime) -> int:
    since = moment - datetime(1970, 1, 1, tzinfo=timezone.utc)
    return (since.days * 86_400 + since.seconds) * 1_000_000_000 + since.microseconds * 1000


def _form(file: str, columns: Sequence[Column]) -> str:
    """The form of the stamps of a sample.

    Raises:
        InputError: There is none, or day and month could be either.
    """
    if columns[0].kind == "number":
        form = form_of_parts(columns)
        if not form:
            raise InputError(file, f"parts of a time in {', '.join(c.name for c in columns)}", "--set time.format=...")
        return form
    if columns[-1].kind == "number":
        return f"{_form(file, columns[:-1])} %f"
    pairs = list(zip(*(c.sample for c in columns), strict=True))
    texts = [" ".join(part.strip() for part in pair) for pair in pairs if all(pair)]
    forms = forms_of(texts)
    where = f"{file}, column {' and '.join(c.name for c in columns)}"
    if not forms:
        expected = '--set time.format="%Y-%m-%d %H:%M:%S.%f" or another form'
        raise InputError(where, f"{quoted(texts[0] if texts else '')} is in no known form of a date and time", expected)
    if forms == ["%H:%M"]:
        found = f"{quoted(texts[0])}: hours and minutes, or minutes and seconds"
        raise InputError(where, found, '--set time.format="%H:%M" or --set time.format="%M:%S"')
    if len(forms) > 1:
        choices = " or ".join(f'--set time.format="{form}"' for form in forms[:3])
        raise InputError(where, f"{quoted(texts[0])}: day and month cannot be distinguished", choices)
    return forms[0]
