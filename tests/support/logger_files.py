"""Files as loggers write them, each with what it holds: made here by hand or by the libraries that write the format."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta, timezone
from math import radians
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
ROWS = 240
START = datetime(2026, 3, 1, 8, 0, 0, tzinfo=timezone.utc)


@dataclass(frozen=True)
class Truth:
    """What a logger saw: time s, temperature C, rate deg/h (three axes in the columns)."""

    time_s: Floats
    temperature_c: Floats
    rate_dph: Floats

    @property
    def rate_dps(self) -> Floats:
        return self.rate_dph / 3600.0


def truth(rows: int = ROWS, period_s: float = 10.0, seed: int = 5) -> Truth:
    """A ramp up and down seen by a gyro of a few deg/h."""
    rng = np.random.default_rng(seed)
    time = period_s * np.arange(rows)
    temperature = 20.0 + 30.0 * (1.0 - np.abs(2.0 * np.arange(rows) / rows - 1.0))
    temperature += rng.normal(0.0, 0.01, rows)
    rate = np.array([40.0, -25.0, 60.0]) + 0.05 * temperature[:, None] + rng.normal(0.0, 0.5, (rows, 3))
    return Truth(time, temperature, rate)


@dataclass(frozen=True)
class Case:
    """One file.

    Attributes:
        id: For the table.
        file: Its name.
        write: Writes it.
        options: What the command needs besides file and --out.
        axes: Whether it holds three axes.
        tolerance: Of rates, deg/h, from the digits that the logger writes.
        starts_at: First time in the data set, s.
        time_tolerance: Of times, s.
        temperature_tolerance: Of temperatures, C.
        started: Whether the start is known, in UTC.
    """

    id: str
    file: str
    write: Callable[[Path, Truth], None]
    options: Sequence[str] = ()
    axes: bool = False
    tolerance: float = 1e-6
    starts_at: float = 0.0
    time_tolerance: float = 1e-6
    temperature_tolerance: float = 1e-6
    started: bool = False
    rows: int = ROWS
    environment: dict[str, str] = field(default_factory=dict)


def text(
    encoding: str = "utf-8", end: str = "\n"
) -> Callable[[Callable[[Truth], list[str]]], Callable[[Path, Truth], None]]:
    """Writes lines in an encoding."""

    def outer(lines: Callable[[Truth], list[str]]) -> Callable[[Path, Truth], None]:
        def write(path: Path, t: Truth) -> None:
            path.write_bytes((end.join(lines(t)) + end).encode(encoding))

        return write

    return outer


def lines_of(t: Truth, form: Callable[[int, float, float, list[float]], str]) -> list[str]:
    every = zip(t.time_s.tolist(), t.temperature_c.tolist(), t.rate_dph.tolist(), strict=True)
    return [form(k, *row) for k, row in enumerate(every)]


def german_number(value: float, digits: int = 9) -> str:
    return f"{value:.{digits}f}".replace(".", ",")


def instant_at(seconds: float) -> datetime:
    return START + timedelta(seconds=float(seconds))


@text()
def plain(t: Truth) -> list[str]:
    return ["time_s,temperature_c,rate_dph", *lines_of(t, lambda k, s, c, r: f"{s!r},{c!r},{r[0]!r}")]


@text("cp1252", "\r\n")
def german(t: Truth) -> list[str]:
    return [
        "Zeit [s];Temperatur [°C];Drehrate [°/s]",
        *lines_of(t, lambda k, s, c, r: f"{german_number(s)};{german_number(c)};{german_number(r[0] / 3600, 12)}"),
    ]


@text("utf-8-sig", "\r\n")
def german_stamps(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        return f"{instant_at(s):%d.%m.%Y %H:%M:%S},000;{german_number(c)};{german_number(r[0])}"

    return ["Messung Klimaschrank 3", "Prüfer;A. Berg", "", "Datum;Temperatur/°C;Rate/°/h", *lines_of(t, row)]


@text()
def iso_stamps(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        return f"{instant_at(s):%Y-%m-%dT%H:%M:%S}.000Z,{c + 273.15!r},{r[0] / 3600!r}"

    return ["# logger 4711", "# firmware 2.1", "timestamp,T_gyro (K),gyro (deg/s)", *lines_of(t, row)]


@text()
def local_stamps(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        return f"{instant_at(s) + timedelta(hours=1):%Y-%m-%d %H:%M:%S},{c!r},{r[0]!r}"

    return ["Date Time,Temperature (degC),Rate (deg/h)", *lines_of(t, row)]


@text()
def american(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        return f"{instant_at(s):%m/%d/%Y},{instant_at(s):%I:%M:%S %p},{c * 1.8 + 32!r},{r[0]!r}"

    return ["Date,Time,Temp (degF),Rate (deg/hr)", *lines_of(t, row)]


@text()
def units_row(t: Truth) -> list[str]:
    return [
        "Time\tTemperature\tRate",
        "ms\t°C\t°/s",
        *lines_of(t, lambda k, s, c, r: f"{s * 1e3:.0f}\t{c!r}\t{r[0] / 3600!r}"),
    ]


@text("utf-16")
def sixteen(t: Truth) -> list[str]:
    return [
        "t [min]\tTemp [K]\tRate [rad/s]",
        *lines_of(t, lambda k, s, c, r: f"{s / 60!r}\t{c + 273.15!r}\t{radians(r[0] / 3600)!r}"),
    ]


@text()
def savetxt(t: Truth) -> list[str]:
    return ["# time_s temp_c gyro_dps", *lines_of(t, lambda k, s, c, r: f"{s:.18e} {c:.18e} {r[0] / 3600:.18e}")]


@text()
def aligned(t: Truth) -> list[str]:
    return [
        "  time_s     temp_C      rate_dph",
        *lines_of(t, lambda k, s, c, r: f"{s:10.1f} {c:14.9f} {r[0]:14.9f}"),
    ]


@text()
def micros(t: Truth) -> list[str]:
    """A 32-bit counter of microseconds that starts again."""
    begun = 2**32 - 600_000_000

    def row(k: int, s: float, c: float, r: list[float]) -> str:
        return f"{(begun + round(s * 1e6)) % 2**32},{c!r},{r[0] / 3600!r},{r[1] / 3600!r},{r[2] / 3600!r}"

    return ["micros,imu_temp_degC,gx_dps,gy_dps,gz_dps", *lines_of(t, row)]


@text()
def arduino(t: Truth) -> list[str]:
    """No header, no times, raw counts: everything is stated."""
    return lines_of(t, lambda k, s, c, r: f"{c!r},{r[0] / 3600 * 131!r}")


@text()
def fixed_rate(t: Truth) -> list[str]:
    return [
        "Serial: RLG-77",
        "Sample rate: 0.1 Hz",
        "Temperature [degC];Rate [deg/h]",
        *lines_of(t, lambda k, s, c, r: f"{c!r};{r[0]!r}"),
    ]


@text()
def grouped(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        return f"{s!r},{c!r},0.1,0.2,9.8,{r[0] / 3600!r},{r[1] / 3600!r},{r[2] / 3600!r}"

    return [
        ",,Accel,,,Gyro,,",
        "Time,Temp,X,Y,Z,X,Y,Z",
        "[s],[degC],[m/s^2],[m/s^2],[m/s^2],[deg/s],[deg/s],[deg/s]",
        *lines_of(t, row),
    ]


@text()
def trailing(t: Truth) -> list[str]:
    return ["time_ms,temp_degC,rate_dph,", *lines_of(t, lambda k, s, c, r: f"{s * 1e3:.0f},{c!r},{r[0]!r},")]


@text()
def quoted(t: Truth) -> list[str]:
    return [
        '"Time (s)","Temperature (°C)","Rate (°/h)","Status"',
        *lines_of(t, lambda k, s, c, r: f'"{s!r}","{c!r}","{r[0]!r}","OK"'),
    ]


@text()
def missing(t: Truth) -> list[str]:
    """Readings that were lost, a header in the middle, an unfinished last line."""
    lines = lines_of(t, lambda k, s, c, r: f"{s!r},{c!r},{'' if k % 50 == 7 else 'NaN' if k % 50 == 9 else repr(r[0])}")
    head = "time_s,temp_c,rate_dph"
    return [head, *lines[:100], head, *lines[100:]]


@text("utf-8", "\r")
def old_mac(t: Truth) -> list[str]:
    return ["time_s;temperature_c;rate_dph", *lines_of(t, lambda k, s, c, r: f"{s!r};{c!r};{r[0]!r}")]


@text()
def epoch(t: Truth) -> list[str]:
    return [
        "timestamp_ns|temperature_c|rate_dph",
        *lines_of(t, lambda k, s, c, r: f"{1772352000_000000000 + round(s * 1e9)}|{c!r}|{r[0]!r}"),
    ]


@text()
def days(t: Truth) -> list[str]:
    return [
        "excel time,temp K,rate",
        *lines_of(t, lambda k, s, c, r: f"{46082.0 + s / 86400:.12f},{c + 273.15!r},{r[0]!r}"),
    ]


@text()
def midnight(t: Truth) -> list[str]:
    def row(k: int, s: float, c: float, r: list[float]) -> str:
        return f"{START + timedelta(hours=15.7, seconds=float(s)):%H:%M:%S};{c!r};{r[0]!r}"

    return ["Uhrzeit;Temp (C);Rate (deg/h)", *lines_of(t, row)]


@text()
def julian(t: Truth) -> list[str]:
    return [
        "stamp,T [degC],rate [deg/h]",
        *lines_of(t, lambda k, s, c, r: f"{instant_at(s):%Y-%j %H:%M:%S},{c!r},{r[0]!r}"),
    ]


@text()
def two_lines(t: Truth) -> list[str]:
    return [
        "%% rate table log",
        "% operator: B",
        "Elapsed Time;Housing Temp;Angular Rate;Supply",
        "(sec);(K);(arcsec/s);(mV)",
        *lines_of(t, lambda k, s, c, r: f"{s!r};{c + 273.15!r};{r[0]!r};{5000 + k}"),
    ]


CSV_CASES = [
    Case("gyrotc's own names", "own.csv", plain),
    Case("German, semicolons, decimal commas, cp1252", "messung.csv", german),
    Case(
        "date-time dd.mm.yyyy, preamble, BOM",
        "klima.csv",
        german_stamps,
        ("--set", "time.zone=UTC"),
        started=True,
    ),
    Case("ISO 8601 with Z, comments, kelvin, deg/s", "iso.csv", iso_stamps, started=True, tolerance=1e-6),
    Case("local stamps with a zone", "local.csv", local_stamps, ("--set", "time.zone=Europe/Berlin"), started=True),
    Case(
        "date and time in two columns, AM/PM, fahrenheit",
        "us.csv",
        american,
        ("--set", "time.format=%m/%d/%Y %I:%M:%S %p"),
        tolerance=1e-6,
    ),
    Case("tabs, a row of units, ms", "tabs.txt", units_row),
    Case("UTF-16, minutes, kelvin, rad/s", "export.txt", sixteen),
    Case("numpy.savetxt, header in a comment", "np.txt", savetxt),
    Case("aligned by spaces", "aligned.dat", aligned, tolerance=1e-8, temperature_tolerance=1e-8),
    Case(
        "32-bit microseconds that wrap, three axes",
        "imu.csv",
        micros,
        axes=True,
        starts_at=(2**32 - 600_000_000) / 1e6,
    ),
    Case(
        "no header, no times, raw counts",
        "raw.csv",
        arduino,
        (
            "--column",
            "temperature=column 1",
            "--column",
            "rate=column 2",
            "--set",
            "time.rate_hz=0.1",
            "--rate-unit",
            "deg/s/131",
            "--temperature-unit",
            "degC",
        ),
    ),
    Case("fixed rate stated above the rows", "fixed.csv", fixed_rate),
    Case("two header lines and a row of units", "grouped.csv", grouped, axes=True),
    Case("delimiter at the end of lines", "trailing.csv", trailing),
    Case("quoted cells, a column of text", "quoted.csv", quoted),
    Case("lost readings, a repeated header", "lost.csv", missing, rows=ROWS - 10),
    Case("line ends of an old Mac", "mac.csv", old_mac),
    Case("nanoseconds of an epoch", "epoch.csv", epoch),
    Case(
        "days of a spreadsheet",
        "days.csv",
        days,
        ("--time-unit", "day", "--temperature-unit", "K", "--rate-unit", "deg/h"),
        time_tolerance=1e-3,
        starts_at=46082 * 86400.0 * 0,
    ),
    Case("times of day over midnight", "night.csv", midnight),
    Case("day of the year", "julian.csv", julian, ("--set", "time.format=%Y-%j %H:%M:%S")),
    Case("units in a second line of brackets", "table.csv", two_lines),
]
