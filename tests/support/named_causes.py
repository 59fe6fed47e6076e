"""What a diagnosis names in a folder of recordings, without what it ships or draws."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from gyrotc.diagnose import analyse, declared_noise, holds, records_of
from gyrotc.recordings import joined_runs, load


def named_causes(folder: Path, block_s: float, average_s: float) -> list[str]:
    """Return the causes that the training runs of a recording name."""
    dataset = load(folder)
    runs = replace(dataset, runs=joined_runs(dataset.runs))
    records = records_of(runs, "train", block_s=block_s, average_s=average_s)
    found = analyse(records, declared_noise(runs)).attribution
    return [c.candidate.id for c in found.causes] if holds(found) else []
