"""Campaigns that measure gyrotc: `make bench` lists them, `make bench ONLY=name` runs one.

Each is a module `bench.<name>` with `measure`, which gives its record, and `table`, which makes the table of
docs/results.md from it.
"""

import sys
from pathlib import Path

_TESTS = Path(__file__).resolve().parents[1] / "tests"
sys.path += [str(_TESTS / "support"), str(_TESTS)]  # recordings and builds that tests use, too
