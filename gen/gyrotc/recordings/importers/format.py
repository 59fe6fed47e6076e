"""Know the format of a logger's file by its first bytes: each module of `formats` has one."""

from __future__ import annotations

import functools
import importlib
import pkgutil
from dataclasses import dataclass
from pathlib import Path

from ..child import Opener
from . import formats


@dataclass(frozen=True, slots=True)
class Format:
    """A format of files that are no text.

    Attributes:
        open: Opens a file of it. Its name is that of a function of its module: a child process calls it.
        begins: How its files begin.
        endings: Endings of names that it has. Of two formats that begin alike the one with the ending of the file is
            chosen, else the one without endings.
        nameable: A file with such an ending is of this format however it begins.
        in_child: A damaged file can crash the library, stop it or fill the memory: it runs in a child process.
    """

    open: Opener
    begins: tuple[bytes, ...]
    endings: tuple[str, ...] = ()
    nameable: bool = False
    in_child: bool = True


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
