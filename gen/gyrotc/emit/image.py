"""A table as an image for flash: its words in the order of a little-endian target, plain and as Intel HEX."""

from __future__ import annotations

import struct

from ..reference.table import Table

__all__ = ["image_of", "intel_hex"]


def image_of(table: Table) -> bytes:
    """`gtc_<id>.bin`."""
    return struct.pack(f"<{len(table.words)}I", *table.words)


def intel_hex(data: bytes) -> str:
    """`gtc_<id>.hex`: the same bytes from address 0 on."""

    def record(kind: int, address: int, payload: bytes) -> str:
        body = bytes([len(payload), address >> 8 & 255, address & 255, kind]) + payload
        return ":" + (body + bytes([-sum(body) & 255])).hex().upper() + "\n"

    lines = []
    for start in range(0, len(data), 16):
        if start and start % 65536 == 0:
            lines.append(record(4, 0, struct.pack(">H", start >> 16)))
        lines.append(record(0, start & 0xFFFF, data[start : start + 16]))
    return "".join(lines) + record(1, 0, b"")
