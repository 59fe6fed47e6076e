"""Instruments of a calibration and the interval until the next one: from `[meta]` and from the limits file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date, timedelta
from typing import Any

from pydantic import ConfigDict

from ..common.errors import InputError
from ..common.inputs_texts import checked
from ..results.budget import Instrument

__all__ = ["StatedInstrument", "instruments_in", "last_day"]


class StatedInstrument(Instrument):
    """The same as a person writes it: a field that is not known is refused."""

    model_config = ConfigDict(extra="forbid")


def instruments_in(meta: Mapping[str, Any], others: Sequence[Instrument] = ()) -> tuple[Instrument, ...]:
    """Those of `[[meta.instrument]]`, and of the limits file those whose names are not among them.

    Raises:
        InputError: An entry is no table, or a field of it is wrong or not known.
    """
    entries = meta.get("instrument", ())
    if not isinstance(entries, (list, tuple)):
        raise InputError("dataset.toml, field meta.instrument", "is no list of tables", "[[meta.instrument]]")
    stated = []
    for number, entry in enumerate(entries):
        where = f"dataset.toml, field meta.instrument.{number}"
        if not isinstance(entry, Mapping):
            raise InputError(where, repr(entry)[:60], "a table: [[meta.instrument]]")
        stated.append(checked(StatedInstrument, dict(entry), where))
    names = {one.name for one in stated}
    every = (*stated, *(one for one in others if one.name not in names))
    return tuple(Instrument(**one.model_dump()) for one in every)


def last_day(calibrated_on: str | None, days: float | None) -> str | None:
    """Last day of an interval, ISO 8601; None where the date is not stated as one, or there is no interval."""
    if calibrated_on is None or days is None:
        return None
    try:
        return (date.fromisoformat(calibrated_on[:10]) + timedelta(days=days)).isoformat()
    except (ValueError, OverflowError):
        return None
