"""The entry of one gyro: what the summary says of it, and what its result was made of (`entry.json`)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from ...errors import GyrotcError
from ...inputs import read_json
from ...outputs import faults, json_text, write_atomically

__all__ = ["ENTRY", "INTERNAL", "Entry", "kept_entry", "write_entry"]

ENTRY = "entry.json"
INTERNAL = ("key", "kept", "sketch", "facts")  # of no use in a summary
Entry = dict[str, Any]
_Hash = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
_Sketch = Annotated[str, Field(pattern="^([0-9a-f]{16})*$")]  # hashes of rows (`dataset.shared`)
_Count = Annotated[int, Field(ge=0)]


class _Stored(BaseModel):
    """Fields of `entry.json`; figures in deg/h, None where nothing was measured."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    name: str
    dataset: str
    axis: Literal["x", "y", "z"] | None
    status: Literal["done", "failed"]
    reason: str | None = None
    serial: str
    judged_on: Literal["exam", "left_out", "train"] | None
    before_rms_dph: float | None
    after_rms_dph: float | None
    after_mean_dph: float | None
    rms_over_floor: float | None
    noise_floor_dph: float | None
    bias_dph: float
    centers: _Count
    table_bytes: _Count
    sum_abs_weights_dph: float
    error_bound_dph: float | None
    findings: list[str]
    model_hash: str
    verdict: Literal["PASS", "CONDITIONAL PASS", "FAIL"] | None
    limits_met: _Count | None
    limits_held: _Count | None
    expanded_uncertainty_dph: float | None
    date: str | None
    rows_left_out: _Count | None
    facts: dict[str, Any]
    sketch: _Sketch
    key: _Hash


def write_entry(folder: Path, entry: Entry) -> Entry:
    """Writes `entry.json` into a unit's result, whose marker will hold its hash; returns it."""
    write_atomically(folder / ENTRY, json_text(entry))
    return entry


def kept_entry(folder: Path, key: str) -> Entry | None:
    """The entry of a result that is whole and was made of the same things (`key`); None: it must be made again."""
    try:
        entry: Entry = read_json(folder / ENTRY, "the entry of a gyro")
        stored = _Stored.model_validate(entry)
        if stored.key != key or stored.status != "done" or faults(folder):
            return None
        return entry
    except (GyrotcError, OSError, ValueError, RecursionError):
        return None
