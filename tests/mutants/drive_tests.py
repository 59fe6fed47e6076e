"""Tests on the gyrotc that PYTHONPATH names, up to the first that fails. Prints which one does.

    python drive_tests.py TEST...

One line of JSON at the end: `seen_by` (`test` or null), `reported`: the test and the last line of what it says.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
# An editable installation finds its own gyrotc before PYTHONPATH is looked at.
sys.meta_path = [finder for finder in sys.meta_path if "gyrotc" not in type(finder).__module__]

import gyrotc  # noqa: E402
import pytest  # noqa: E402

FOLDER = Path(__file__).resolve().parents[1] / "py"


class _First:
    """Which test failed first, or did not even begin."""

    def __init__(self) -> None:
        self.reported = ""

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed and not self.reported:
            self.reported = f"{report.nodeid.rpartition('/')[2]}"

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed and not self.reported:
            self.reported = f"{report.nodeid.rpartition('/')[2]} cannot be collected"


if __name__ == "__main__":
    if Path(gyrotc.__file__).parents[1] != Path.cwd():
        raise ImportError(f"{gyrotc.__file__} is not the changed package")
    first = _First()
    tests = [str(FOLDER / test) for test in sys.argv[1:]]
    status = pytest.main(["-q", "-x", "-p", "no:cacheprovider", "--rootdir", str(FOLDER.parents[1]), *tests], [first])
    if status not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED) and not first.reported:
        raise RuntimeError(f"pytest ended with {status}")
    print(json.dumps({"seen_by": "test" if first.reported else None, "reported": first.reported}))
