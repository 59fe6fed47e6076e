"""The folder of an imported data set: it appears whole or not at all."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..dataset.schema import FILE
from ..errors import InputError
from .mapping import MAP_FILE

__all__ = ["whole_folder"]


@contextmanager
def whole_folder(out: Path) -> Iterator[Path]:
    """A folder under another name that takes its place at the end; after an error `out` is as before.

    Raises:
        InputError: `out` holds something that `gyrotc import` did not make.
    """
    made = (out / FILE).is_file() and (out / MAP_FILE).is_file()
    if out.exists() and not (out.is_dir() and (made or not any(out.iterdir()))):
        raise InputError(
            str(out), "exists and is no imported data set", "a new folder, or one to import again"
        )
    out.parent.mkdir(parents=True, exist_ok=True)
    fresh = Path(tempfile.mkdtemp(prefix=f".{out.name}-", dir=out.parent))
    fresh.chmod(0o755)
    try:
        yield fresh
        if out.exists():
            shutil.rmtree(out)
        fresh.rename(out)
    except BaseException:
        shutil.rmtree(fresh, ignore_errors=True)
        raise
