"""The tests of `make targets`: every cross compiler and emulator is required.

`--results docs` keeps what they found where all of them ran and passed.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), *(str(HERE.parent / folder) for folder in ("support", "cases/verify"))]

import targets_page  # noqa: E402
from emitted import CAUGHT  # noqa: E402
from results import Results  # noqa: E402
from self_tests import TABLES  # noqa: E402

from bench.page import keep  # noqa: E402

_FOUND = Results()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--results", type=Path, help="folder whose results/ and results.md are written")


@pytest.fixture(scope="session")
def results() -> Results:
    return _FOUND


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Only a session in which everything passed leaves results."""
    docs = session.config.getoption("--results")
    if docs is None or exitstatus != 0:
        return
    lists = dict(_FOUND.lists)
    if lists.keys() >= {"self_test", "models", "nav_loop"}:
        controls = sorted(CAUGHT, key=lambda c: (c["control"], c["name"], c["numeric"]))
        keep(docs, "targets", targets_page.quoted({**lists, "tables": TABLES, "controls": controls}))
