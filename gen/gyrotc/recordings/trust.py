"""Values against their units, over a whole data set: refused with the likely unit, or taken on the user's word."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from ..common.errors import InputError
from .plausible import Suspicion, earth_suspicion, suspicions
from .problems import Problems
from .reading import Recording
from .records import Run
from .schema import FILE, Description
from .units import NATIVE

__all__ = ["check_channel_units", "judge", "suspected", "suspected_of_earth"]

Doubted = tuple[str, Suspicion]
"""Name of a file and what contradicts its units."""


def check_channel_units(
    description: Description, recordings: Mapping[str, Recording], problems: Problems
) -> None:
    """Checks that every unit is that of a column: a typing error must not pass."""
    channels = {name for r in recordings.values() for name in r.layout.channels}
    for name in description.units:
        if name not in NATIVE and name not in channels:
            expected = (
                f"rate, time, temperature or a channel ({', '.join(sorted(channels)) or 'there is none'})"
            )
            problems.add(InputError(f"{FILE}, field units.{name}", "no such column", expected))


def suspected(description: Description, recordings: Mapping[str, Recording]) -> Iterator[Doubted]:
    """What contradicts the units of each file."""
    noise = description.noise.arw_deg_per_sqrt_h if description.noise else None
    for name, recording in recordings.items():
        found = suspicions(
            recording.evidence,
            recording.layout,
            recording.units,
            earth_stated=description.earth_rate is not None,
            noise=noise,
        )
        yield from ((name, one) for one in found)


def suspected_of_earth(
    axis: str | None, runs: Sequence[Run], recordings: Mapping[str, Recording]
) -> Iterator[Doubted]:
    """Runs whose mean is Earth's component along the axis in another unit, where that is computed."""
    for run in runs:
        recording = recordings[run.file]
        layout = recording.layout
        if run.earth is None or layout.pulses:
            continue
        column = layout.value_of(axis)
        index = 2 + (list(layout.axes.values()).index(column) if layout.axes else 0)
        cells = recording.evidence.cells
        mine = cells[run.in_span(cells[:, 0]), index]
        unit = recording.units.get(column)
        one = earth_suspicion(column, float(mine.mean()), run.earth.rate_dph, unit) if len(mine) else None
        if one is not None:
            yield run.file, one


def judge(doubted: Sequence[Doubted], trust: bool, problems: Problems) -> list[tuple[str, str]]:
    """Refuses what contradicts its unit; where the user's word is taken, the file and what it was taken against."""
    trusted: list[tuple[str, str]] = []
    seen = set()
    for name, one in doubted:
        if (name, one.kind) in seen:
            continue
        seen.add((name, one.kind))
        where = f"{name}, column {one.column}"
        if trust:
            trusted.append((where, one.found))
        else:
            expected = (
                f'[units] {one.kind} = "{one.likely}" in {FILE}, or --trust-units if it is right as it is'
            )
            problems.add(InputError(where, one.found, expected))
    return trusted
