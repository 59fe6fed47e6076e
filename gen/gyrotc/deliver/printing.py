"""A page on paper: Chromium prints it where it is installed."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from ..store.opening import write_own
from ..store.scratch import scratch_folder

__all__ = ["print_to_pdf"]

_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_LONGEST_S = 120.0  # a page takes two seconds; a browser that hangs must not hold the job


def print_to_pdf(page: Path, pdf: Path) -> bool:
    """Prints a page of our own; False where no browser is there or it does not do it."""
    found = next(filter(None, map(shutil.which, _BROWSERS)), None)
    if found is None:
        return False
    with scratch_folder() as work:
        command = [
            found, "--headless", "--disable-gpu", "--disable-extensions", "--no-first-run",
            *(["--no-sandbox"] if os.geteuid() == 0 else []),  # which it refuses to have as root
            f"--user-data-dir={work / 'browser'}", "--no-pdf-header-footer", f"--print-to-pdf={work / 'page.pdf'}",
            page.resolve().as_uri(),
        ]  # fmt: skip
        try:
            subprocess.run(command, check=True, timeout=_LONGEST_S, capture_output=True)
            write_own(pdf, (work / "page.pdf").read_bytes())
        except (OSError, subprocess.SubprocessError):
            return False
    return True
