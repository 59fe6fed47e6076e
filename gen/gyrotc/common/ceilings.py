"""Ceilings of inputs: what is more than that is refused before memory is taken for it.

A user moves one by `gyrotc --max NAME=VALUE` or by the environment: `GYROTC_MAX="NAME=VALUE NAME=VALUE"`. The option
writes the environment, so that the processes of a fleet see it too.
"""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Iterable
from dataclasses import dataclass

from .errors import InputError

__all__ = ["CEILINGS", "ENVIRONMENT", "Ceiling", "ceiling", "need_memory", "refuse_above", "set_ceilings"]

ENVIRONMENT = "GYROTC_MAX"


@dataclass(frozen=True, slots=True)
class Ceiling:
    """A ceiling: its default and what it is of."""

    default: float
    meaning: str


CEILINGS: dict[str, Ceiling] = {
    "memory_gib": Ceiling(4.0, "memory that the rows of one recording, or its blocks, may take, GiB"),
    "recording_mib": Ceiling(8192.0, "size of one recording, trace or noise file, MiB"),
    "rows": Ceiling(1e8, "rows of one recording"),
    "columns": Ceiling(256.0, "columns of one recording"),
    "parquet_ratio": Ceiling(250.0, "size of a Parquet file once unpacked over its size, above 64 MiB"),
    "text_mib": Ceiling(4.0, "size of a dataset.toml, manifest, scenario, limits file or model.json, MiB"),
    "result_mib": Ceiling(32.0, "size of a JSON result, truth.json, picture or board log, MiB"),
    "nesting": Ceiling(32.0, "depth of tables and lists within one another in TOML and JSON"),
    "runs": Ceiling(2000.0, "runs of one data set"),
    "units": Ceiling(100_000.0, "gyros of one fleet"),
}
"""All ceilings by name."""


def ceiling(name: str) -> float:
    """The ceiling in force.

    Raises:
        InputError: The environment names an unknown one, or no number above 0.
    """
    return _moved(os.environ.get(ENVIRONMENT, "")).get(name, CEILINGS[name].default)


def set_ceilings(texts: Iterable[str]) -> None:
    """Moves ceilings, each given as `NAME=VALUE`, for this process and those that it starts.

    Raises:
        InputError: An unknown name, or no number above 0.
    """
    joined = " ".join([os.environ.get(ENVIRONMENT, ""), *texts]).strip()
    _moved(joined)
    if joined:
        os.environ[ENVIRONMENT] = joined


@functools.lru_cache(maxsize=8)
def _moved(text: str) -> dict[str, float]:
    moved = {}
    for part in text.replace(",", " ").split():
        name, _, value = part.partition("=")
        where = f"--max or {ENVIRONMENT}, {name}"
        if name not in CEILINGS:
            raise InputError(where, "is not known", f"one of {', '.join(CEILINGS)}")
        try:
            moved[name] = float(value)
        except ValueError:
            moved[name] = math.nan
        if not 0.0 < moved[name] < math.inf:
            raise InputError(where, repr(value), "a number above 0")
    return moved


def refuse_above(name: str, value: float, where: str, unit: str) -> None:
    """Raises where `value` (in the ceiling's own measure) is above the ceiling `name`.

    Raises:
        InputError: It is.
    """
    most = ceiling(name)
    if value > most:
        raise InputError(where, f"{value:.10g} {unit}", f"at most {most:.10g} (--max {name}=...)")


def need_memory(octets: float, where: str, why: str) -> None:
    """To be called before memory is taken.

    Raises:
        InputError: More than the ceiling `memory_gib` would be needed.
    """
    refuse_above("memory_gib", octets / 2**30, where, f"GiB of memory for {why}")
