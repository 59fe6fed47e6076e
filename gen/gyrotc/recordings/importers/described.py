"""What an import keeps in words: the map with every choice, `dataset.toml`, the original by size and hash."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic_core import PydanticCustomError

from ...common.errors import InputError
from ..schema import check_serial
from ..text import dataset_toml
from .mapping import Map, TimeMap
from .plan import ImportPlan
from .rows import ImportedRows
from .tables import LoggerFile

__all__ = ["description_of", "kept_map", "run_name", "serial_of", "sha256_of", "size_of"]

_BLOCK_BYTES = 2**22  # of a read: bounds memory


def kept_map(chosen: Map, file: LoggerFile, plan: ImportPlan, rows: ImportedRows) -> Map:
    """The map with every choice that was made."""
    columns: dict[str, Any] = {choice.role: choice.source for choice in (*plan.values, plan.temperature)}
    if plan.time:
        columns["time"] = tuple(choice.column.name for choice in plan.time)
    units = dict(chosen.units)
    if plan.time and plan.time[0].unit:
        units["time"] = plan.time[0].unit
    units["temperature"] = plan.temperature.unit or ""
    if plan.values[0].unit:
        units["rate"] = plan.values[0].unit
    units |= {
        choice.role: choice.unit for choice in plan.channels if choice.unit and choice.role in rows.units
    }
    time = TimeMap(format=rows.clock.form or None, zone=chosen.time.zone, rate_hz=plan.rate_hz)
    csv = {
        k: v for k, v in file.csv.items() if k in ("encoding", "delimiter", "decimal", "thousands")
    } | chosen.csv.given()
    update = {
        "columns": columns,
        "channels": {choice.role: choice.source for choice in plan.channels},
        "units": units,
        "csv": csv,
        "time": time.model_dump(),
    }
    return Map.model_validate(chosen.model_dump() | update)


def serial_of(stated: str | None, chosen: Map, file: LoggerFile, out: Path) -> str:
    in_file = next(
        (v for k, v in file.facts.items() if re.fullmatch(r"serial( ?(no|nr|number))?\.?", k)), None
    )
    told = stated or chosen.serial or (re.sub(r"[^A-Za-z0-9._-]+", "-", in_file) if in_file else None)
    serial = told or out.resolve().name
    try:
        return check_serial(serial)
    except PydanticCustomError as error:
        where = (
            "--serial" if stated else f"the serial {'in the file' if told else 'from the name of the folder'}"
        )
        raise InputError(where, repr(serial), f"{error.message()}; --serial names one") from error


def run_name(path: Path, taken: set[str]) -> str:
    """A plain name for a run, from that of its file."""
    plain = re.sub(r"[^A-Za-z0-9._-]+", "-", path.stem).strip("-.") or "run"
    name, k = plain, 2
    while name in taken:
        name, k = f"{plain}-{k}", k + 1
    taken.add(name)
    return name


def description_of(serial: str, chosen: Map, entries: Sequence[Mapping[str, Any]]) -> str:
    head: dict[str, Any] = {"schema": 1, "serial": serial}
    for key in ("description", "earth_rate", "latitude_deg", "pulse_weight_arcsec"):
        if getattr(chosen, key) not in (None, ""):
            head[key] = getattr(chosen, key)
    if any(entry["trusted"] for entry in entries):
        head["trust_units"] = True
    sources = [entry["source"] for entry in entries]
    tables: dict[str, Any] = {"source": sources[0] if len(sources) == 1 else sources}
    if chosen.meta:
        tables["meta"] = chosen.meta
    if chosen.noise:
        tables["noise"] = chosen.noise
    return dataset_toml(head, tables, [dict(_run_entry(entry)) for entry in entries])


def _run_entry(entry: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    yield "file", entry["file"]
    if entry["started"] is not None:
        yield "started", entry["started"]
    if not entry["since_power_on"]:
        yield "power_on_s", "unknown"


def sha256_of(path: Path) -> str:
    """SHA-256 of a file, or of the files of a folder one after the other in the order of their names."""
    digest = hashlib.sha256()
    for one in sorted(path.iterdir()) if path.is_dir() else [path]:
        with one.open("rb") as file:
            while block := file.read(_BLOCK_BYTES):
                digest.update(block)
    return digest.hexdigest()


def size_of(path: Path) -> int:
    return sum(one.stat().st_size for one in path.iterdir()) if path.is_dir() else path.stat().st_size
