"""Readers of logger files as an attacker would have them, once a hole in a library runs his code."""

from __future__ import annotations

import os
import signal
import socket
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


def reads_another(path: Path) -> LoggerFile:
    return a_table(path, (path.parent / "secret").read_text(encoding="ascii"))


def lists_the_folder(path: Path) -> LoggerFile:
    return a_table(path, " ".join(one.name for one in path.parent.iterdir()))


def writes_beside(path: Path) -> LoggerFile:
    (path.parent / "made").write_text("x", encoding="ascii")
    return a_table(path)


def writes_into_it(path: Path) -> LoggerFile:
    path.write_text("x", encoding="ascii")
    return a_table(path)


def removes_it(path: Path) -> LoggerFile:
    path.unlink()
    return a_table(path)


def starts_a_program(path: Path) -> LoggerFile:
    os.execv("/bin/true", ["true"])
    return a_table(path)


def calls_home(path: Path) -> LoggerFile:
    with socket.create_connection(("127.0.0.1", int(path.read_text(encoding="ascii"))), timeout=5):
        return a_table(path)


def kills_others(path: Path) -> LoggerFile:
    os.kill(int(path.read_text(encoding="ascii")), signal.SIGTERM)
    return a_table(path)


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
