"""The tests of `make prove`: Frama-C, Gappa and some minutes are required."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "py"))
