"""JSON as gyrotc writes it: ASCII, readable, and never a NaN or an infinity, which JSON does not have."""

from __future__ import annotations

import hashlib
import json
from typing import Any

__all__ = ["canonical_json", "digest_of", "json_text"]


def json_text(content: Any) -> str:
    """The text of a JSON file: one blank for each level, keys in the order given, a line end at the end.

    Raises:
        ValueError: A number is not finite.
    """
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def canonical_json(content: Any) -> bytes:
    """What a hash is taken of: sorted keys, no blanks, ASCII.

    Raises:
        ValueError: A number is not finite.
    """
    return json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False).encode("ascii")


def digest_of(content: Any) -> str:
    """SHA-256 of the canonical form, hexadecimal. Raises as that."""
    return hashlib.sha256(canonical_json(content)).hexdigest()
