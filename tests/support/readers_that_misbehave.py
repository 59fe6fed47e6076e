"""Readers of logger files that do what a library does with a damaged file."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from gyrotc.recordings import ArrayTable, Column, LoggerFile, part_of


def a_table(path: Path, text: str = "") -> LoggerFile:
    """What every reader gives back that goes through."""
    values = np.arange(10.0)
    table = ArrayTable("", (Column("x"),), rows=10, parts={"x": part_of(values)})
    return LoggerFile(path, "made up", (table,), {"read": text})


def reads_the_file(path: Path) -> LoggerFile:
    return a_table(path, path.read_text(encoding="ascii"))


def takes_all_memory(path: Path) -> LoggerFile:
    np.ones(2**27)
    return a_table(path)


def never_ends(path: Path) -> LoggerFile:
    while True:
        pass


def crashes(path: Path) -> LoggerFile:
    os.abort()


def raises(path: Path) -> LoggerFile:
    raise ZeroDivisionError("in a library")


def declares_too_much(path: Path) -> LoggerFile:
    table = ArrayTable("", (Column("x"),), rows=10**15, parts={"x": part_of(np.arange(10.0))})
    return LoggerFile(path, "made up", (table,))


def has_many_columns(path: Path) -> LoggerFile:
    columns = tuple(Column(f"x{k}") for k in range(1000))
    return LoggerFile(path, "made up", (ArrayTable("", columns, rows=10),))
