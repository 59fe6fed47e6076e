"""The tests of `make prove`: Frama-C, Gappa, Z3 and some minutes. What needs a tool that is not there is skipped.

`--results docs` keeps what they found. What a test found goes with its report, so that tests
may run in several processes (`-n 2`).
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), *(str(HERE.parent / folder) for folder in ("support", "cases/mirror", "properties/mirror"))]

from results import Results  # noqa: E402

from bench.page import keep  # noqa: E402

_FOUND: list[tuple[str, Any]] = []  # of a test: name of a list, its place, a record
_SKIPPED: set[str] = set()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--results", type=Path, help="folder whose results/ and results.md are written")


class _OfATest(Results):
    """What one test finds; its place among all tests is that of its rows in the tables."""

    def __init__(self, item: pytest.Item) -> None:
        super().__init__()
        self.place, self.item = item.session.items.index(item), item

    def add(self, name: str, record: dict[str, Any]) -> None:
        plain = json.loads(json.dumps(record))  # numbers of numpy do not pass between processes
        self.item.user_properties.append((name, (self.place, plain)))


@pytest.fixture
def results(request: pytest.FixtureRequest) -> Results:
    return _OfATest(request.node)


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "tool(name): skipped where this program is not installed")


def pytest_runtest_setup(item: pytest.Item) -> None:
    for mark in item.iter_markers("tool"):
        if shutil.which(mark.args[0]) is None:
            pytest.skip(f"{mark.args[0]} is not installed")


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.skipped:
        _SKIPPED.add(report.nodeid)
    elif report.when == "call":
        _FOUND.extend(report.user_properties)


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Only a session in which everything passed, and nothing was skipped, leaves results."""
    docs = session.config.getoption("--results")
    if docs is None or exitstatus != 0 or _SKIPPED or hasattr(session.config, "workerinput"):
        return
    found = Results()
    for name, (_, record) in sorted(_FOUND, key=lambda one: one[1][0]):
        found.add(name, record)
    keep(docs, "prove", dict(found.lists))
