"""The tool under test, in a process of its own: reads folders of recordings from stdin, writes results.

One line in: folder, tab, file for the result. One line out when it is written. It sees the recordings and
nothing else; the truth stays in the grader's process. Everything is imported before the first recording, so
that a long run goes on with the code that it began with.
"""

from __future__ import annotations

import json
import sys
import time
import traceback
from pathlib import Path
from typing import Any


def main() -> None:
    """Answers until stdin ends."""
    from gyrotc.diagnose import diagnose
    from gyrotc.recordings import load

    for line in sys.stdin:
        folder, target = line.rstrip("\n").split("\t")
        began = time.process_time()
        result: dict[str, Any]
        try:
            result = diagnose(load(Path(folder))).result.content()
        except Exception:
            result = {"verdict": "error", "text": traceback.format_exc(), "causes": [], "considered": []}
        result["seconds"] = time.process_time() - began
        Path(target).write_text(json.dumps(result), encoding="utf-8")
        print("done", flush=True)


if __name__ == "__main__":
    main()
