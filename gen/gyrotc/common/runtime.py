"""Where the C runtime lies, whose arithmetic is mirrored here and whose text is shipped."""

from __future__ import annotations

from pathlib import Path

from .errors import InputError


def runtime_folders() -> tuple[Path, Path]:
    """Folders `include` and `libc` of the runtime: in the installed package, else in the source tree.

    Raises:
        InputError: They are in neither place.
    """
    here = Path(__file__).resolve().parents[1]
    for root in (here / "runtime", here.parents[1]):
        if (root / "include" / "gtc.h").is_file():
            return root / "include", root / "libc"
    raise InputError(str(here), "the C runtime is missing", "folders include and libc")
