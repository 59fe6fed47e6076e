"""Spreadsheets (`.xlsx`) by openpyxl: their sheets become CSV files in a scratch folder, and are read as one is."""

from __future__ import annotations

import csv
import tempfile
from dataclasses import replace
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

from ....common.errors import InputError, short_reason
from ...tables import LoggerFile, LoggerTable, optional_library
from ..cells import split_line
from ..csv_table import open_csv
from ..format import Format
from ..layout import SeveralLayouts, can_be_row
from ..map_file import CsvMap

# How the name of the first file in a spreadsheet begins.
_FIRST_NAMES = (b"[Content_Types].xml", b"_rels/", b"docProps/", b"xl/")
# Where the name of the first file begins in a ZIP archive (APPNOTE.TXT, 4.3.7), and how much of it is read.
_NAME_AT, _MAX_NAME = 30, 64
_MOST_SHEETS = 20  # of a workbook that is a recording


def open_spreadsheet(path: Path) -> LoggerFile:
    """A workbook: each sheet with a header and rows is a table; formulas count by the value that was saved.

    Raises:
        InputError: openpyxl is not installed, the file is damaged, or no sheet holds rows of numbers.
    """
    _refuse_archive(path)
    openpyxl = optional_library(path, "openpyxl", "excel", "a spreadsheet")
    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    except Exception as error:  # whatever a damaged file makes of the parser
        raise InputError(
            path.name, f"cannot be read as a spreadsheet ({short_reason(error)})", "a whole .xlsx file"
        ) from error
    folder = Path(tempfile.mkdtemp())
    tables: list[LoggerTable] = []
    refused: list[InputError] = []
    notes: list[str] = []
    sheets = book.worksheets
    if len(sheets) > _MOST_SHEETS:
        raise InputError(path.name, f"{len(sheets)} sheets", f"at most {_MOST_SHEETS}: those with the recording")
    for k, sheet in enumerate(sheets):
        place = folder / str(k) / path.name
        place.parent.mkdir()
        with place.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerows([_cell(value) for value in row] for row in sheet.iter_rows(values_only=True))
        try:
            tables += _tables(place, sheet.title if len(sheets) > 1 else "")
        except SeveralLayouts as error:
            where = f"{path.name}, sheet {sheet.title}{error.where.removeprefix(path.name)}"
            raise SeveralLayouts(where, error.found, error.expected) from error
        except InputError as error:
            refused.append(InputError(f"{path.name}, sheet {sheet.title}", error.found, error.expected))
            if any(can_be_row(split_line(line, ","), ".") for line in place.read_text("utf-8").splitlines()):
                notes.append(f"the rows of sheet {sheet.title} are not read: {error.found}")
    if not tables:
        raise refused[0] if refused else InputError(path.name, "no sheets", "a sheet with a header and rows")
    return LoggerFile(path, "spreadsheet", tuple(replace(table, notes=tuple(notes)) for table in tables))


def _refuse_archive(path: Path) -> None:
    """Refuse a ZIP archive of other files, by the name of its first file.

    Raises:
        InputError: It is one.
    """
    with path.open("rb") as file:
        head = file.read(_NAME_AT + _MAX_NAME)
    length = int.from_bytes(head[26:28], "little")
    if not head[_NAME_AT : _NAME_AT + length].startswith(_FIRST_NAMES):
        raise InputError(path.name, "is a ZIP archive", "its files, unpacked")


def _tables(place: Path, name: str) -> list[LoggerTable]:
    given = CsvMap(encoding="utf-8", delimiter=",", decimal=".")
    return [replace(table, name=name) for table in open_csv(place, given).tables]


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, datetime):
        return value.isoformat(sep=" ")
    if isinstance(value, date | time):
        return value.isoformat()
    return repr(value) if isinstance(value, float) else " ".join(str(value).split())


FORMAT = Format(open_spreadsheet, (b"PK\x03\x04",))
