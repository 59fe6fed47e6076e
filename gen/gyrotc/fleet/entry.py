"""The entry of one gyro in its result (`entry.json`): written with it, and read again by the next call."""

from __future__ import annotations

from pathlib import Path

from ..common.errors import GyrotcError
from ..common.inputs_texts import checked, read_json
from ..results.fleet import FleetEntry
from ..store.files import write_atomically
from ..store.jsontext import json_text
from ..store.marker import faults

__all__ = ["ENTRY", "kept_entry", "write_entry"]

ENTRY = "entry.json"


def write_entry(folder: Path, entry: FleetEntry) -> FleetEntry:
    """Writes `entry.json` into a unit's result, whose marker will hold its hash; returns it."""
    write_atomically(folder / ENTRY, json_text(entry.content()))
    return entry


def kept_entry(folder: Path, key: str) -> FleetEntry | None:
    """The entry of a result that is whole and was made of the same things (`key`); None: it must be made again."""
    try:
        entry = checked(FleetEntry, read_json(folder / ENTRY, "the entry of a gyro"), ENTRY)
        whole = entry.model_hash is not None and not faults(folder)
        return entry if entry.key == key and entry.status == "done" and whole else None
    except (GyrotcError, OSError, ValueError, RecursionError):
        return None
