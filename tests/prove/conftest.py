"""The tests of `make prove`: Frama-C, Gappa, Z3 and some minutes are required.

`--results docs` writes what they found into the documentation.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "py")]

from prove_page import section  # noqa: E402
from results import Results, machine, write  # noqa: E402

_FOUND = Results()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--results", type=Path, help="folder whose results/prove.json and results.md are written"
    )


@pytest.fixture(scope="session")
def results() -> Results:
    return _FOUND


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Only a session in which everything passed leaves results."""
    docs = session.config.getoption("--results")
    if docs is not None and exitstatus == 0:
        write(docs, "prove", {"schema": "gyrotc.prove/1", "machine": machine(), **_FOUND.lists}, section)
