"""What a description and its recordings must fulfil together: roles, spans, axis, the model subtracted."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..common.errors import InputError
from .problems import Problems
from .reading import Recording
from .records import Applied, Exclusion, inside
from .schema import FILE, Description, RunEntry

__all__ = ["check_description", "check_spans", "common_channels", "in_entry", "of_axis", "place_of"]


def place_of(description: Description, index: int) -> str:
    """Where a run stands, for messages."""
    return f"{FILE}, run {index + 1} ({description.run[index].file})"


def in_entry(entry: RunEntry, time_s: FloatArray) -> NDArray[np.bool_]:
    """Which times belong to a run."""
    gaps = tuple(Exclusion(gap.from_s, gap.to_s, gap.reason) for gap in entry.exclude)
    return inside(time_s, entry.from_s, entry.to_s, gaps)


def check_description(
    description: Description, applied: Applied | None, exam_only: bool, problems: Problems
) -> None:
    """Checks that there is a training run, that Earth's rate can be computed, that the model given was subtracted."""
    if not exam_only and all(entry.role != "train" for entry in description.run):
        expected = "at least one training run"
        problems.add(InputError(f"{FILE}, field role", "no run has the role train", expected))
    if description.earth_rate == "compute" and description.latitude_deg is None:
        expected = 'a latitude, as earth_rate = "compute"'
        problems.add(InputError(f"{FILE}, field latitude_deg", "is missing", expected))
    stated = description.applied_table
    if stated != "none" and applied is None:
        found = f"the model {stated[:12]}... was subtracted while recording"
        problems.add(InputError(f"{FILE}, field applied_table", found, "that model by --applied FILE"))
    if applied is not None and applied.hash != stated:
        found = f"{stated!r}, and the model given is {applied.hash}"
        problems.add(InputError(f"{FILE}, field applied_table", found, "the hash of the model given"))


def check_spans(description: Description, problems: Problems) -> None:
    """Checks that spans and exclusions have a length, and that no row of a file belongs to two runs."""
    for index, entry in enumerate(description.run):
        stretches = [("from_s", entry.from_s, entry.to_s)]
        stretches += [(f"exclude.{k}.from_s", gap.from_s, gap.to_s) for k, gap in enumerate(entry.exclude)]
        for field, start, end in stretches:
            if start is not None and end is not None and start >= end:
                where = f"{place_of(description, index)}, field {field}"
                problems.add(InputError(where, f"{start:.10g} s", f"less than to_s, {end:.10g} s"))
    for (i, one), (j, other) in combinations(enumerate(description.run), 2):
        if one.file == other.file and _overlap(one, other):
            found = f"the span overlaps that of run {i + 1}"
            expected = "every row of a file in one run at most"
            problems.add(InputError(place_of(description, j), found, expected))


def _overlap(one: RunEntry, other: RunEntry) -> bool:
    def before(a: RunEntry, b: RunEntry) -> bool:
        return a.to_s is not None and b.from_s is not None and a.to_s <= b.from_s

    return not before(one, other) and not before(other, one)


def of_axis(
    recordings: Mapping[str, Recording], axis: str | None, problems: Problems
) -> dict[str, Recording]:
    """The recordings that have the axis that was asked for."""
    kept = {}
    for name, recording in recordings.items():
        axes = recording.layout.axes
        choices = f"--axis {'|'.join([*axes, 'all'])}"
        if axis is None and axes:
            problems.add(InputError(name, f"rates of the axes {', '.join(axes)}", choices))
        elif axis is not None and axis not in axes:
            expected = choices if axes else "no --axis: the recording has one rate"
            problems.add(InputError(name, f"no rate of the axis {axis}", expected))
        else:
            kept[name] = recording
    return kept


def common_channels(recordings: Mapping[str, Recording]) -> tuple[tuple[str, ...], list[str]]:
    """Auxiliary channels that every file has, and a warning for each of the others."""
    every = list(recordings.values())
    seen = dict.fromkeys(name for r in every for name in r.layout.channels)
    common = tuple(name for name in seen if all(name in r.layout.channels for r in every))
    warnings = []
    for name in seen:
        if name not in common:
            without = ", ".join(r.file.name for r in every if name not in r.layout.channels)
            warnings.append(f"channel {name} is left out: {without} has no such column")
    return common, warnings
