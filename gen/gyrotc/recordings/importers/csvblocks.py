"""Blocks of whole lines of a CSV file, in UTF-8 with LF, whatever it is written in."""

from __future__ import annotations

import codecs
from collections.abc import Iterator
from pathlib import Path

from ...common.errors import InputError
from .csvdialect import Dialect

__all__ = ["blocks_of", "lines_of"]

_BLOCK_BYTES = 2**23  # of a read: bounds memory; its whole lines are parsed at once
_LONGEST_LINE = 2**20  # bytes: a row has at most some hundred columns of 25 characters


def blocks_of(
    path: Path, dialect: Dialect, size: int
) -> Iterator[tuple[bytes, int, float]]:  # long: one state of the reader
    """Blocks of whole lines of rows in UTF-8 with LF, the number of their first line, and the share read.

    Raises:
        InputError: Bytes that the encoding does not know, or a line without end.
    """
    decoder = codecs.getincrementaldecoder(dialect.encoding)("strict")
    plain = dialect.encoding in ("utf-8", "utf-8-sig", "ascii")
    rest, number, left = b"", 1, size
    with path.open("rb") as file:
        while left:
            block = file.read(min(_BLOCK_BYTES, left))
            if not block:
                break
            left -= len(block)
            try:
                text = block if plain else decoder.decode(block, final=not left).encode()
            except UnicodeDecodeError as error:
                found = f"bytes that are no {dialect.encoding}"
                place = f"{path.name}, after line {number + rest.count(10)}"
                raise InputError(place, found, "another --csv encoding=...") from error
            block = _with_lf(rest + text, last=not left)
            end = len(block) if not left else block.rfind(b"\n") + 1
            if end == 0 and len(block) > _LONGEST_LINE:
                raise InputError(
                    f"{path.name}, line {number}", f"{len(block)} bytes and no end", "lines of cells"
                )
            lines, rest = block[:end], block[end:]
            count = lines.count(b"\n")
            if number < dialect.data_line:
                skipped = min(dialect.data_line - number, count)
                lines = lines.split(b"\n", skipped)[skipped] if skipped else lines
                number += skipped
                count -= skipped
            if number >= dialect.data_line and lines:
                yield lines.removeprefix(codecs.BOM_UTF8), number, 1.0 - left / size
            number += count


def _with_lf(block: bytes, *, last: bool) -> bytes:
    """Line ends of any kind as LF; a carriage return that ends the block waits for the next one."""
    if b"\r" not in block:
        return block
    if block.endswith(b"\r") and not last:
        return block[:-1].replace(b"\r\n", b"\n").replace(b"\r", b"\n") + b"\r"
    return block.replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def lines_of(lines: bytes, number: int) -> Iterator[tuple[int, str]]:
    yield from enumerate(lines.decode("utf-8", "replace").split("\n"), start=number)
