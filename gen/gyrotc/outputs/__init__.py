"""Where results go: the one place that writes what a user asked for.

A folder is written beside its place and put there in one step (`result_folder`), a file likewise
(`write_atomically`, `write_result`). A marker in each folder says what gyrotc wrote; nothing else is ever removed.
"""

from __future__ import annotations

from .files import check_replaceable, write_atomically
from .folder import Stage, clean, leftovers, result_folder, write_result
from .interrupts import Interrupted, deferred, die_of, raise_on_signals
from .jsontext import canonical_json, digest_of, json_text
from .lock import Lock
from .marker import KINDS, MARKER, SCHEMA, Marker, check_intact, faults, read_marker, sha256
from .opening import check_own, create, open_or_create, write_own
from .scratch import scratch_folder

__all__ = [
    "KINDS",
    "MARKER",
    "SCHEMA",
    "Interrupted",
    "Lock",
    "Marker",
    "Stage",
    "canonical_json",
    "check_intact",
    "check_own",
    "check_replaceable",
    "clean",
    "create",
    "deferred",
    "die_of",
    "digest_of",
    "faults",
    "json_text",
    "leftovers",
    "open_or_create",
    "raise_on_signals",
    "read_marker",
    "result_folder",
    "scratch_folder",
    "sha256",
    "write_atomically",
    "write_own",
    "write_result",
]
