"""A fault of the program itself: one line for the user, everything else into a file that can be sent."""

from __future__ import annotations

import hashlib
import os
import platform
import sys
import tempfile
import traceback
from pathlib import Path

from .. import __version__

__all__ = ["EXIT_STATUS", "crash_line"]

EXIT_STATUS = 70
"""EX_SOFTWARE of sysexits.h: an internal fault, not one of the input."""


def crash_line(error: BaseException) -> str:
    """Writes the report of an unexpected exception; the line that the user sees, with its id and its place.

    The id follows from where the program failed, so that the same fault has the same id everywhere.
    """
    frames = [
        f"{Path(f.filename).name}:{f.lineno}:{f.name}" for f in traceback.extract_tb(error.__traceback__)
    ]
    kind = type(error).__name__
    number = hashlib.sha256(" ".join([__version__, kind, *frames]).encode()).hexdigest()[:8]
    text = "\n".join(
        [
            f"gyrotc {__version__}, report {number}",
            f"Python {sys.version.split()[0]}, {platform.platform()}",
            f"arguments: {sys.argv[1:]!r}",
            "",
            *traceback.format_exception(error),
        ]
    )
    found = " ".join(f"{kind}: {error}".split())[:160]
    found = "".join(c if c.isprintable() else "?" for c in found)
    return f"internal fault {number} ({found}); {_kept(number, text)}"


def _kept(number: str, text: str) -> str:
    """Where the report is: the user's folder of state, else the one of temporary files."""
    root = os.environ.get("XDG_STATE_HOME")
    state = (Path(root) if root else Path.home() / ".local" / "state") / "gyrotc"
    for folder in (state, Path(tempfile.gettempdir())):
        try:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            handle, name = tempfile.mkstemp(prefix=f"crash-{number}-", suffix=".txt", dir=folder)
            with os.fdopen(handle, "w", encoding="utf-8", errors="backslashreplace") as file:
                file.write(text)
        except OSError:
            continue
        return f"please send {name}"
    return "its report could not be written"
