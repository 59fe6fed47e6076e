"""Spreadsheets (`.xlsx`, by openpyxl): each sheet becomes a CSV file in a folder of its own, and is read as one is."""

from __future__ import annotations

import csv
import tempfile
from dataclasses import replace
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

from ...common.errors import InputError
from ..tables import LoggerFile, LoggerTable, library
from .csv_table import open_csv

_MOST_SHEETS = 20  # of a workbook that is a recording


def open_spreadsheet(path: Path) -> LoggerFile:
    """A workbook: each sheet with a header and rows is a table; formulas count by the value that was saved.

    Raises:
        InputError: openpyxl is not installed, the file is damaged, or no sheet holds rows of numbers.
    """
    openpyxl = library(path, "openpyxl", "excel", "a spreadsheet")
    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    except Exception as error:  # whatever a damaged file makes of the parser
        what = " ".join(str(error).split())[:100]
        raise InputError(path.name, f"cannot be read as a spreadsheet ({what})", "a whole .xlsx file") from error
    folder = Path(tempfile.mkdtemp())
    tables: list[LoggerTable] = []
    refused: list[InputError] = []
    sheets = book.worksheets[:_MOST_SHEETS]
    for k, sheet in enumerate(sheets):
        place = folder / f"{k}.csv"
        with place.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerows([_cell(value) for value in row] for row in sheet.iter_rows(values_only=True))
        try:
            tables += _tables(place, sheet.title if len(sheets) > 1 else "")
        except InputError as error:
            refused.append(InputError(f"{path.name}, sheet {sheet.title}", error.found, error.expected))
    if not tables:
        raise refused[0] if refused else InputError(path.name, "no sheets", "a sheet with a header and rows")
    return LoggerFile(path, "spreadsheet", tuple(tables))


def _tables(place: Path, name: str) -> list[LoggerTable]:
    given = {"encoding": "utf-8", "delimiter": ",", "decimal": "."}
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
    return repr(value) if isinstance(value, float) else str(value)
