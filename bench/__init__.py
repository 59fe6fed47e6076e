"""gyrotc beside its peers: `make bench` runs this package in an environment of its own and rewrites docs/results.md."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "py"))
