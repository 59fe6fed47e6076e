"""The tests of `make prove`: Frama-C, Gappa, Z3 and some minutes. What needs a tool that is not there is skipped.

`--results docs` writes what they found into the documentation.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), *(str(HERE.parent / folder) for folder in ("py", "py/target"))]

from prove_page import section  # noqa: E402
from results import Results, machine, write  # noqa: E402

_FOUND = Results()
_SKIPPED: set[str] = set()  # tools that are not here


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--results", type=Path, help="folder whose results/summary.json and results.md are written")


@pytest.fixture(scope="session")
def results() -> Results:
    return _FOUND


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "tool(name): skipped where this program is not installed")


def pytest_runtest_setup(item: pytest.Item) -> None:
    for mark in item.iter_markers("tool"):
        if shutil.which(mark.args[0]) is None:
            _SKIPPED.add(mark.args[0])
            pytest.skip(f"{mark.args[0]} is not installed")


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Only a session in which everything passed, and nothing was skipped, leaves results."""
    docs = session.config.getoption("--results")
    if docs is not None and exitstatus == 0 and not _SKIPPED:
        write(docs, "prove", {"schema": "gyrotc.prove/1", "machine": machine(), **_FOUND.lists}, section)
