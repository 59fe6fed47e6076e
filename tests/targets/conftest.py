"""The tests of `make targets`: every cross compiler and emulator is required.

`--results docs` writes what they found into the documentation; those of the self-test may run alone.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), *(str(HERE.parent / folder) for folder in ("py", "py/verify"))]

import self_test_page  # noqa: E402
import targets_page  # noqa: E402
from emitted import CAUGHT  # noqa: E402
from results import Results, machine, write  # noqa: E402
from self_tests import TABLES  # noqa: E402

_FOUND = Results()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--results", type=Path, help="folder whose results/summary.json and results.md are written")


@pytest.fixture(scope="session")
def results() -> Results:
    return _FOUND


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Only a session in which everything passed leaves results."""
    docs = session.config.getoption("--results")
    if docs is None or exitstatus != 0:
        return
    lists = dict(_FOUND.lists)
    if builds := lists.pop("self_test", None):
        reported = {"schema": "gyrotc.self-test/1", "machine": machine(), "tables": TABLES, "builds": builds}
        write(docs, "self-test", reported, self_test_page.section)
    if lists:
        result = {
            "schema": "gyrotc.targets/1",
            "machine": machine(),
            **lists,
            "controls": sorted(CAUGHT, key=lambda c: (c["control"], c["name"], c["numeric"])),
        }
        write(docs, "targets", result, targets_page.section, targets_page.quoted)
