"""Know the format of a logger's file by its first bytes, then by its name."""

from __future__ import annotations

import functools
import importlib
import pkgutil
from pathlib import Path

from . import formats
from .format import Format


def format_of(path: Path, head: bytes) -> Format | None:
    """The format of a file by its first bytes, then by its name; None: text.

    Args:
        head: Its first bytes.
    """
    ending = path.suffix.lower()
    alike = [one for one in known_formats() if head.startswith(one.begins)]
    named = [one for one in alike if ending in one.endings] or [one for one in alike if not one.endings]
    named += [one for one in known_formats() if one.nameable and ending in one.endings]
    return next(iter([*named, *alike]), None)


@functools.cache
def known_formats() -> tuple[Format, ...]:
    """All formats, by the names of their modules."""
    names = sorted(module.name for module in pkgutil.iter_modules(formats.__path__))
    return tuple(importlib.import_module(f"{formats.__name__}.{name}").FORMAT for name in names)
