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
from collections.abc import Generator
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
_TESTS: dict[str, dict[str, Any]] = {}
_SHARED: Lines = defaultdict(set)


def pytest_configure() -> None:
    """Begin to follow."""
    threading.settrace(_REACH.on_call)
    sys.settrace(_REACH.on_call)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, object, object]:
    """Gather what fixtures execute."""
    lines = _REACH.begin()
    begun = time.monotonic()
    try:
        return (yield)
    finally:
        _TESTS[item.nodeid] = {"seconds": time.monotonic() - begun, "lines": {}}
        for name, numbers in lines.items():
            _SHARED[name] |= numbers


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Gather what a test executes."""
    lines = _REACH.begin()
    begun = time.monotonic()
    try:
        return (yield)
    finally:
        _TESTS[item.nodeid]["seconds"] += time.monotonic() - begun
        _TESTS[item.nodeid]["lines"] = {name: sorted(numbers) for name, numbers in lines.items()}


def pytest_sessionfinish() -> None:
    """Write the file."""
    sys.settrace(None)
    shared = {name: sorted(numbers) for name, numbers in _SHARED.items()}
    Path(os.environ[OUTPUT]).write_text(json.dumps({"tests": _TESTS, "fixtures": shared}), "utf-8")
