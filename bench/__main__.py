"""`python -m bench docs`: all measurements into docs/results/bench.json, and its section of docs/results.md."""

from __future__ import annotations

import json
import platform
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

from .accuracy import accuracy
from .invariance import invariance
from .page import filled
from .speed import speed

_PACKAGES = ("gyrotc", "numpy", "scipy", "scikit-learn", "fastcan", "sysidentpy", "minisom")


def _machine() -> str:
    """Processor, system and Python."""
    info = Path("/proc/cpuinfo")
    names = (
        [
            line.split(":", 1)[1].strip()
            for line in info.read_text().splitlines()
            if line.startswith("model name")
        ]
        if info.exists()
        else []
    )
    return f"{names[0] if names else platform.processor()}, {platform.system()}, Python {platform.python_version()}"


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def main(docs: Path) -> None:
    result: dict[str, Any] = {
        "schema": "gyrotc.bench/1",
        "machine": _machine(),
        "versions": {name: version(name) for name in _PACKAGES},
        "speed": speed(_say),
        "accuracy": accuracy(_say),
        "invariance": invariance(_say),
    }
    (docs / "results").mkdir(exist_ok=True)
    (docs / "results" / "bench.json").write_text(
        json.dumps(result, indent=1, ensure_ascii=False) + "\n", "utf-8"
    )
    page = docs / "results.md"
    page.write_text(filled(page.read_text("utf-8") if page.exists() else None, result), "utf-8")
    print(page)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
