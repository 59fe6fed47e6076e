"""A plugin of pytest that writes which lines of gyrotc each test of a file executes, and for how long it runs.

A line that a fixture executes counts for every test of the file, since those behind the first one share what it made.
Lines of modules and classes outside of functions, and those of other processes, are not seen.
"""

from __future__ import annotations

import inspect
import json
import os
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest

#: Environment variable with the name of the file that is written.
OUTPUT = "GYROTC_REACH"
_PACKAGE = Path(__file__).resolve().parents[2] / "gen" / "gyrotc"

Lines = dict[str, set[int]]  # by module, below the package


class Reach:
    """Lines that were executed since `begin`."""

    def __init__(self) -> None:
        self.lines: Lines = defaultdict(set)
        self._left: dict[CodeType, set[int]] = {}
        self._names: dict[CodeType, str] = {}

    def begin(self) -> Lines:
        """Forget what was executed; return where the lines go from now on."""
        self.lines, self._left = defaultdict(set), {}
        return self.lines

    def on_call(self, frame: FrameType, event: str, argument: object) -> Any:
        """Follow a function of the package until all of its lines were seen."""
        code = frame.f_code
        name = self._names.get(code)
        if name is None:
            path = Path(code.co_filename)
            inside = code.co_flags & inspect.CO_OPTIMIZED and _PACKAGE in path.parents
            name = self._names[code] = path.relative_to(_PACKAGE).as_posix() if inside else ""
        if not name:
            return None
        lines = self.lines[name]
        lines.add(code.co_firstlineno)
        if code not in self._left:
            numbers = {line for *_, line in code.co_lines() if line is not None}
            self._left[code] = numbers - {code.co_firstlineno}
        left = self._left[code]

        def on_line(frame: FrameType, event: str, argument: object) -> Any:
            lines.add(frame.f_lineno)
            left.discard(frame.f_lineno)
            frame.f_trace_lines = bool(left)
            return on_line

        return on_line if left else None


_REACH = Reach()
_SECONDS: dict[str, float] = defaultdict(float)  # by test
_LINES: dict[str, Lines] = defaultdict(lambda: defaultdict(set))  # by test
_LINES_OF_FIXTURES: Lines = defaultdict(set)


def pytest_configure() -> None:
    """Begin to follow."""
    threading.settrace(_REACH.on_call)
    sys.settrace(_REACH.on_call)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, object, object]:
    """Follow the fixtures of a test."""
    with _followed(item, _LINES_OF_FIXTURES):
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Follow a test."""
    with _followed(item, _LINES[item.nodeid]):
        return (yield)


@contextmanager
def _followed(item: pytest.Item, lines: Lines) -> Iterator[None]:
    """Add to `lines` what is executed within the block, and to the seconds of the test what it takes."""
    executed = _REACH.begin()
    begun = time.monotonic()
    try:
        yield
    finally:
        _SECONDS[item.nodeid] += time.monotonic() - begun
        for name, numbers in executed.items():
            lines[name] |= numbers


def pytest_sessionfinish() -> None:
    """Write the file."""
    sys.settrace(None)
    tests = {test: {"seconds": seconds, "lines": _sorted(_LINES[test])} for test, seconds in _SECONDS.items()}
    Path(os.environ[OUTPUT]).write_text(json.dumps({"tests": tests, "fixtures": _sorted(_LINES_OF_FIXTURES)}), "utf-8")


def _sorted(lines: Lines) -> dict[str, list[int]]:
    return {name: sorted(numbers) for name, numbers in lines.items()}
