"""A map for a file that has none: which column is what, in which unit, and why.

Names and units decide, never values. Where two columns are as likely, or a unit stands nowhere, nothing is guessed:
the refusal names the choices and the option that makes one.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from ...common.errors import InputError, quoted
from ..tables import Column, LoggerFile, LoggerTable
from ..units import NATIVE_UNITS, Meaning, UnitError, channel_unit, conversion, meaning, split_unit, words_of_name
from .clock import clock_columns, fraction_of
from .map_file import Choice, ImportPlan, Map
from .selection import NO_DEVICE, Where, device_column
from .stamps import COMPACT, forms_of, pattern_of

Ask = Callable[[str], str | None]
"""Asks a person on a terminal; None where there is none."""


OPTIONS = {"time": "--time-unit", "temperature": "--temperature-unit", "rate": "--rate-unit"}
_EXAMPLES = {
    "time": "s, ms, us, min, d",
    "temperature": "degC, K, degF, 'raw/340 + 36.53 degC'",
    "rate": "deg/h, deg/s, rad/s",
}


_Missing = tuple[str, str, str]
"""Kind and column of a unit that stands nowhere, and the option that states it."""


def _is_compact(cell: str) -> bool:
    """Test whether digits are a date and a time of day."""
    return bool(forms_of([f"{cell[:8]} {cell[8:]}"])) and len(cell) == _COMPACT_DIGITS and cell[:2] in ("19", "20")


_COMPACT_DIGITS = 14


class Units:
    """Units of the three kinds: stated, in the file, or asked for."""

    def __init__(self, file: str, stated: Mapping[str, str], ask: Ask, missing: list[_Missing]) -> None:
        self._file, self._stated, self._ask, self._missing = file, stated, ask, missing
        self._asked: dict[str, str] = {}

    def of(self, kind: str, column: Column, table: LoggerTable) -> str:
        """The unit of a column of a kind; empty (and noted as missing) where it stands nowhere."""
        if kind in self._stated:
            return self._checked(kind, self._stated[kind], OPTIONS[kind])
        _, in_name, how = split_unit(column.name)
        in_file = column.unit or meaning(column.name, None, table.name).unit
        if in_file is None and how.startswith(("in brackets", "after")):
            in_file = in_name
        if in_file is not None:
            try:
                conversion(in_file, kind)
            except UnitError:
                found = f"the file gives it in {quoted(in_file)}, which is no {kind}"
                expected = f"{OPTIONS[kind]} with one of {_EXAMPLES[kind]}, or another column by --column {kind}=..."
                raise InputError(f"{self._file}, column {column.name}", found, expected) from None
            return in_file
        if kind not in self._asked:
            answer = self._ask(f"{self._file}: unit of the {kind} in column {quoted(column.name)} ({_EXAMPLES[kind]})")
            if answer:
                self._asked[kind] = self._checked(kind, answer, "the answer")
        if kind not in self._asked:
            compact = kind == "time" and any(column.sample) and all(_is_compact(cell) for cell in column.sample if cell)
            option = f'--set time.format="{COMPACT}"' if compact else f'{OPTIONS[kind]} "..." ({_EXAMPLES[kind]})'
            self._missing.append((kind, column.name, option))
            return ""
        return self._asked[kind]

    def _checked(self, kind: str, unit: str, where: str) -> str:
        try:
            conversion(unit, kind)
        except UnitError as error:
            raise InputError(where, str(error), f"one of {_EXAMPLES[kind]}") from error
        return unit


def said(missing: Sequence[_Missing]) -> Iterator[str]:
    """Yield what is missing, once for each kind."""
    for kind, column in {kind: column for kind, column, _ in reversed(missing)}.items():
        yield f"no unit of the {kind} in column {quoted(column)}"


_HEXADECIMAL = re.compile(r"(?=.*[A-Fa-f])[0-9A-Fa-f]+h?|[0-9A-Fa-f]+h")


def increments(file: LoggerFile) -> str:
    """Return what to do with a file of angle increments; empty if it has none."""
    for table in file.tables:
        for column in table.columns:
            name, unit, _ = split_unit(column.name)
            if {"delta", "increment", "incr", "dtheta"} & set(words_of_name(name)):
                angle = column.unit or unit or "rad"
                return (
                    f'the increments as rates: --column rate="{column.name}" --rate-unit "{angle} / (0.01 s)" with the '
                    "row period in place of 0.01 s"
                )
    return ""


def in_text(file: LoggerFile, kind: str) -> str:
    """A column that by its name is of that kind, and holds no numbers: what stands there."""
    for table in file.tables:
        for column in table.columns:
            if column.kind == "text" and meaning(column.name, column.unit, table.name).kind == kind:
                shown = next((cell for cell in reversed(column.sample) if cell), "")
                if _HEXADECIMAL.fullmatch(shown):
                    return f"; or, as {column.name} holds {quoted(shown)}, 0x before each of its numbers"
                return (
                    f"; or, as {column.name} holds {quoted(shown)}, --set csv.decimal=, (or .) and "
                    "--set csv.thousands=. (or another mark), or --set csv.missing=WORD"
                )
    return ""


def listed(file: LoggerFile) -> str:
    names = [f"{t.name}/{c.name}" if t.name else c.name for t in file.tables for c in t.columns]
    return ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")


def name_it(kind: str) -> str:
    return f'--column {kind}="..." with one of them, and {OPTIONS[kind]} (gyrotc\'s own is {NATIVE_UNITS[kind]})'


def nameless(file: LoggerFile) -> str:
    """Return all that has to be stated if no column has a name; empty if one has."""
    names = [column.name for table in file.tables for column in table.columns]
    if any(not name.startswith("column ") for name in names):
        return ""
    said = (f'--column {kind}="column ..." {OPTIONS[kind]} ...' for kind in ("time", "temperature", "rate"))
    return f"a line of names above the rows, or {' '.join(said)}"


_CHANNELS = {
    "supply": "V", "voltage": "V", "vbat": "V", "vcc": "V", "vdd": "V", "pressure": "hPa", "humidity": "%",
    "current": "A", "magnetic": "uT", "mag": "uT", "temperature": "degC", "temp": "degC", "laser": "", "heater": "",
    "fan": "",
}  # fmt: skip
_MOST_CHANNELS = 12  # that are proposed: a person has to read the list


def propose(file: LoggerFile, chosen: Map, ask: Ask) -> ImportPlan:
    """Plan the reading of a file under a map; open choices are made from names.

    Args:
        chosen: What is stated already, by a map and options.
        ask: Asks for a unit that stands nowhere.

    Raises:
        InputError: A column that is not there, two that are as likely, a unit that stands nowhere.
    """
    tables = _tables(file, chosen)
    values = _values(file, tables, chosen)
    _check_weight(file, values[0], chosen)
    main = values[0][1]
    where = _where(file, main, chosen)
    time, rate_hz, why_rate = _time(file, main, chosen)
    temperature = _temperature(file, tables, main, chosen)
    missing: list[_Missing] = []
    unit = Units(file.path.name, chosen.units, ask, missing)
    picked_values = tuple(
        Choice(role, table, column, None if role == "pulses" else unit.of("rate", column, table), why)
        for role, table, column, why in values
    )
    picked_temperature = Choice(
        "temperature",
        temperature[0],
        temperature[1],
        unit.of("temperature", temperature[1], temperature[0]),
        temperature[2],
    )
    picked_time = tuple(_times(time, main, unit, chosen.time.format))
    if missing:
        options = dict.fromkeys(option for _, _, option in missing)
        raise InputError(file.path.name, "; ".join(said(missing)), " ".join(options))
    taken = {c.name for c, _ in time} | {v[2].name for v in values} | {temperature[1].name}
    picking = {where.column} if where else set()
    device = device_column(main, _stated_device(file, main, chosen), taken | picking)
    channels = tuple(_channels(file, main, chosen, taken))
    taken |= {c.column.name for c in channels}
    taken |= picking | ({device.name} if device else set())
    left = tuple(c.name for c in main.columns if c.kind == "number" and c.name not in taken)
    texts = tuple(c.name for c in main.columns if c.kind != "number" and c.name not in taken)
    return ImportPlan(
        main, picked_time, picked_temperature, picked_values, channels, rate_hz, why_rate, left, where, device, texts
    )


def _where(file: LoggerFile, main: LoggerTable, chosen: Map) -> Where | None:
    """The rows that are taken.

    Raises:
        InputError: The condition is none, or of a column that the table of the rates does not have.
    """
    if chosen.where is None:
        return None
    where = Where.of(chosen.where)
    if main.column(where.column) is None:
        names = ", ".join(column.name for column in main.columns)
        found = f"no column {quoted(where.column)} beside the rates"
        raise InputError(file.path.name, found, f"--set where=... with one of: {names}")
    return where


def _stated_device(file: LoggerFile, main: LoggerTable, chosen: Map) -> str | None:
    """Name of the column of devices that the map states, as the table of the rates has it."""
    stated = chosen.columns.device
    return stated if stated in (None, NO_DEVICE) else _find(file, str(stated), main)[1].name


def _times(time: Sequence[tuple[Column, str]], main: LoggerTable, unit: Units, form: str | None) -> Iterator[Choice]:
    """The columns of time; a counter, which is one of numbers alone and of no stated form, has a unit."""
    for column, why in time:
        counter = column.kind == "number" and len(time) == 1 and form is None
        yield Choice("time", main, column, unit.of("time", column, main) if counter else None, why)


def _tables(file: LoggerFile, chosen: Map) -> list[LoggerTable]:
    own = [table for table in file.tables if table.tolerance_s is None]
    if chosen.table is None:
        return own
    found = [table for table in own if table.name == chosen.table]
    if not found:
        names = ", ".join(table.name for table in own)
        raise InputError(file.path.name, f"no table {quoted(chosen.table)}", f"--set table=NAME with one of: {names}")
    return found


def _find(file: LoggerFile, name: str, near: LoggerTable | None = None) -> tuple[LoggerTable, Column]:
    """The column that a map names, in any table of the file.

    Raises:
        InputError: There is none.
    """
    tables = sorted(file.tables, key=lambda t: t is not near)
    for table in tables:
        for column in table.columns:
            if name in (column.name, f"{table.name}/{column.name}", split_unit(column.name)[0]):
                return table, column
    every = [f"{t.name}/{c.name}" if t.name else c.name for t in file.tables for c in t.columns]
    raise InputError(file.path.name, f"no column {quoted(name)}", f"one of: {', '.join(every[:40])}")


def _values(file: LoggerFile, tables: Sequence[LoggerTable], chosen: Map) -> list[tuple[str, LoggerTable, Column, str]]:
    """Roles, tables, columns and reasons of what is measured; all of one table."""
    stated = chosen.columns.values()
    if stated:
        found = [(role, *_find(file, name), "named by the map") for role, name in stated.items()]
        if len({id(table) for _, table, _, _ in found}) > 1:
            raise InputError(file.path.name, "rates of several tables", "rates of one table under [columns]")
        return found
    likely = [(table, *_rates(table, file.path)) for table in tables]
    likely = [one for one in likely if one[1]]
    best = max((one[2] for one in likely), default=0)
    top = [one for one in likely if one[2] == best]
    if not top:
        unseen = f"no column that gives a rate among {listed(file)}"
        if made := nameless(file):
            raise InputError(file.path.name, f"{unseen}: nothing stands above its rows", made)
        raise InputError(file.path.name, unseen, increments(file) or name_it("rate") + in_text(file, "rate"))
    if len(top) > 1:
        names = ", ".join(repr(table.name) for table, _, _ in top)
        raise InputError(file.path.name, f"rates in {names}", f"one of them, e.g. --set table={top[0][0].name!r}")
    table, columns, _ = top[0]
    return [(role, table, column, why) for role, column, why in columns]


def _check_weight(file: LoggerFile, value: tuple[str, LoggerTable, Column, str], chosen: Map) -> None:
    """Check that a weight is stated for pulses.

    Raises:
        InputError: It stands nowhere.
    """
    if value[0] == "pulses" and chosen.pulse_weight_arcsec is None:
        found = f"column {value[2].name} counts pulses, and the angle of one stands nowhere"
        raise InputError(file.path.name, found, "--set pulse_weight_arcsec=W")


def _rates(table: LoggerTable, file: Path) -> tuple[list[tuple[str, Column, str]], int]:
    """List the rate columns of a table with role and reason, and their score.

    Raises:
        InputError: Several columns could be the rate.
    """
    pulses = [c for c in table.columns if words_of_name(c.name)[:1] == ["pulses"]]
    if pulses:
        return [("pulses", pulses[0], "its name")], 5
    found = [(c, meaning(c.name, c.unit, table.name)) for c in table.columns if c.kind == "number"]
    rates = [(c, m) for c, m in found if m.kind == "rate"]
    if not rates:
        rates = [
            (c, m)
            for c, m in found
            if c.name in ("x", "y", "z") and "gyro" in words_of_name((table.name or file.stem).replace("_", " "))
        ]
    if not rates:
        return [], 0
    axes: dict[str, list[tuple[Column, Meaning]]] = {}
    for column, one in rates:
        axes.setdefault(one.axis, []).append((column, one))
    best = max(one.score for _, one in rates)
    triad = [sorted(axes.get(axis, []), key=lambda cm: -cm[1].score) for axis in "xyz"]
    if all(triad) and all(len(t) == 1 or t[0][1].score > t[1][1].score for t in triad):
        return [(f"rate_{a}", t[0][0], f"its name, axis {a}") for a, t in zip("xyz", triad, strict=True)], best + 1
    top = [(column, one) for column, one in rates if one.score == best]
    if len(top) > 1:
        raise InputError(
            f"{file.name}, table {table.name}" if table.name else file.name,
            f"{', '.join(repr(c.name) for c, _ in top)} could be the rate",
            f'--column rate="{top[0][0].name}" (or another of them)',
        )
    return [("rate", top[0][0], "its name")], best


def _temperature(
    file: LoggerFile, tables: Sequence[LoggerTable], main: LoggerTable, chosen: Map
) -> tuple[LoggerTable, Column, str]:
    if chosen.columns.temperature:
        return (*_find(file, chosen.columns.temperature, main), "named by the map")
    number = _instance(main.name)
    likely: list[tuple[int, LoggerTable, Column]] = []
    for table in file.tables:
        for column in table.columns:
            one = meaning(column.name, column.unit, table.name)
            if column.kind == "number" and one.kind == "temperature":
                near = 8 * (table is main) + 2 * (bool(number) and _instance(table.name) == number)
                likely.append((one.score + near, table, column))
    best = max((score for score, _, _ in likely), default=0)
    top = [(table, column) for score, table, column in likely if score == best]
    if not top:
        raise InputError(
            file.path.name,
            f"no column that gives a temperature among {listed(file)}",
            name_it("temperature")
            + in_text(file, "temperature")
            + "; or --join FILE --tolerance-s S with another file",
        )
    if len(top) > 1:
        names = [f"{t.name}/{c.name}" if t.name else c.name for t, c in top]
        raise InputError(
            file.path.name,
            f"{', '.join(map(repr, names))} could be the temperature of the gyro",
            f'--column temperature="{names[0]}" (or another of them)',
        )
    where = "its name" if top[0][0] is main else "its name; the last reading holds until the next"
    return (*top[0], where)


def _instance(name: str) -> str:
    return "".join(mark for mark in name if mark.isdigit())


def _time(file: LoggerFile, main: LoggerTable, chosen: Map) -> tuple[list[tuple[Column, str]], float | None, str]:
    """Find the columns of time, or the rows per second, with the reason."""
    if chosen.time.rate_hz is not None:
        return [], chosen.time.rate_hz, "rows are counted, as stated"
    if chosen.columns.time:
        return [(_find(file, name, main)[1], "named by the map") for name in chosen.columns.time], None, ""
    stamps = [c for c in main.columns if c.kind == "stamp"]
    if stamps:
        whole = _stamps(stamps)
        fraction = fraction_of(main.columns, whole[-1][0])
        return [*whole, *([(fraction, "its fraction of a second")] if fraction else [])], None, ""
    if chosen.time.format is not None and (compact := _of_form(main, chosen.time.format)):
        return [(compact, "it holds stamps of the stated form")], None, ""
    if parts := clock_columns(main.columns):
        return [(column, "parts of the time, by their names") for column in parts], None, ""
    stated = {*chosen.columns.values().values(), chosen.columns.temperature}
    free = [c for c in main.columns if c.kind == "number" and c.name not in stated]
    found = [(c, meaning(c.name, c.unit, main.name)) for c in free]
    likely = [(m.score, c) for c, m in found if m.kind == "time"]
    best = max((score for score, _ in likely), default=0)
    top = [c for score, c in likely if score == best]
    if top:
        return [(top[0], "its name" if len(top) == 1 else "its name, the first of that kind")], None, ""
    if main.rate_hz is not None:
        return [], main.rate_hz, main.why_rate
    expected = '--column time="..." , or --set time.rate_hz=R where rows come at a fixed rate and no column holds times'
    unseen = f"no column that gives a time among {listed(file)}"
    raise InputError(file.path.name, unseen, expected + in_text(file, "time"))


def _of_form(main: LoggerTable, form: str) -> Column | None:
    """The first column of whole numbers that are stamps of a form without marks."""
    pattern = re.compile(pattern_of(form))
    for column in main.columns:
        cells = [cell for cell in column.sample if cell]
        if column.kind == "number" and cells and all(pattern.fullmatch(cell) for cell in cells):
            return column
    return None


def _stamps(stamps: Sequence[Column]) -> list[tuple[Column, str]]:
    """One column of dates and times, or a date and a time of day."""
    parts = [(c, forms_of([s for s in c.sample if s])) for c in stamps]
    if not any(c.sample for c in stamps):
        return [(stamps[0], "it holds dates and times")]
    whole = [c for c, f in parts if any("%d" in form and ("%H" in form or "%I" in form) for form in f)]
    if whole:
        return [(whole[0], "it holds dates and times")]
    dates = [c for c, f in parts if any("%d" in form for form in f)]
    clocks = [c for c, f in parts if any("%M" in form for form in f)]
    if dates and clocks:
        return [(dates[0], "it holds dates"), (clocks[0], "it holds times of day")]
    return [((clocks or stamps)[0], "it holds times of day")]


def _channels(file: LoggerFile, main: LoggerTable, chosen: Map, taken: set[str]) -> Iterator[Choice]:
    if chosen.channels is not None:
        for name, source in chosen.channels.items():
            table, column = _find(file, source, main)
            if table is not main:
                raise InputError(file.path.name, f"channel {name} of another table", f"a column of {main.name!r}")
            yield Choice(name, main, column, chosen.units.get(name, column.unit), "named by the map")
        return
    count = 0
    for column in main.columns:
        parts = words_of_name(split_unit(column.name)[0])
        known = next((w for w in parts if w in _CHANNELS), None)
        if column.name in taken or column.kind != "number" or known is None or count >= _MOST_CHANNELS:
            continue
        if column.sample and not any(column.sample):
            continue
        count += 1
        unit = column.unit or split_unit(column.name)[1]
        yield Choice(_channel_name(column.name, unit, _CHANNELS[known]), main, column, unit, "its name: a channel")


def _channel_name(name: str, unit: str | None, native: str) -> str:
    """A plain name; with the ending of the unit that it is converted to, where its unit is known."""
    plain = "_".join(words_of_name(split_unit(name)[0])).encode("ascii", "ignore").decode() or "channel"
    endings = {"V": "v", "hPa": "hpa", "A": "ma", "uT": "ut", "degC": "c"}
    ending = f"_{endings[native]}" if native in endings else ""
    if not unit or not ending or plain.endswith(ending) or channel_unit(plain + ending) is None:
        return plain
    try:
        conversion(unit, str(channel_unit(f"x{ending}")))
    except UnitError:
        return plain
    return plain + ending
