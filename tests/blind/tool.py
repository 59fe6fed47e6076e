"""The tool under test, in a process of its own: reads folders of recordings from stdin, writes results.

One line in: folder, tab, file for the result. One line out when it is written. It sees the recordings and
nothing else; truth stays in the grader's process.
"""

from __future__ import annotations

import json
import sys
import time
import traceback
from pathlib import Path


def main() -> None:
    from gyrotc.dataset import load
    from gyrotc.diagnose import diagnose

    for line in sys.stdin:
        folder, target = line.rstrip("\n").split("\t")
        began = time.perf_counter()
        try:
            result = diagnose(load(Path(folder))).result
        except Exception:
            result = {"verdict": "error", "text": traceback.format_exc(), "causes": [], "considered": []}
        result["seconds"] = time.perf_counter() - began
        Path(target).write_text(json.dumps(result), encoding="utf-8")
        print("done", flush=True)


if __name__ == "__main__":
    main()
