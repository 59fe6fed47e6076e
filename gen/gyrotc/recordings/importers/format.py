"""Describe the formats of loggers that are no text."""

from __future__ import annotations

from dataclasses import dataclass

from ..child import Opener


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
