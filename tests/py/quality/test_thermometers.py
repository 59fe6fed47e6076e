"""A further thermometer that comes loose is named with its run; thermometers as they should be are not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gyrotc.quality.thermometers import thermometer_findings
from gyrotc.recordings.load import load
from gyrotc.recordings.records import Dataset
from gyrotc.simulate.campaign import simulate

RUNS = """
extends = "signals"
[profile."up and down"]
start_c = 10.0
record_min = 240
steps = [{hold_min = 80}, {ramp_to_c = 40.0, c_per_min = 2.0}, {hold_min = 20}, {ramp_to_c = 0.0, c_per_min = 2.0},
  {hold_min = 30}, {ramp_to_c = 20.0, c_per_min = 2.0}, {hold_min = 30}]
[profile."down and up"]
start_c = 30.0
record_min = 240
steps = [{hold_min = 70}, {ramp_to_c = 0.0, c_per_min = 3.0}, {hold_min = 20}, {ramp_to_c = 40.0, c_per_min = 1.0},
  {hold_min = 30}, {ramp_to_c = 20.0, c_per_min = 2.0}, {hold_min = 30}]
[[set]]
started = 2026-01-01T00:00:00Z
profiles = ["up and down", "down and up", "up and down", "down and up"]
"""
LOOSE = """[[thermometer]]
name = "mirror_c"
node = "mirror"
loose_from_day = 2.5
[[thermometer]]
name = "case_c"
node = "case"
"""


def made(folder: Path, text: str) -> Dataset:
    (folder / "runs.toml").write_text(text, "utf-8")
    simulate(folder / "runs.toml", seed=9, out=folder / "data")
    return load(folder / "data")


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return made(tmp_path_factory.mktemp("sound"), RUNS)


def test_thermometers_at_their_places_are_not_accused(sound: Dataset) -> None:
    assert list(thermometer_findings(sound)) == []


def test_a_thermometer_that_lost_contact_is_named_with_its_run(tmp_path: Path) -> None:
    dataset = made(tmp_path, RUNS + LOOSE)
    found = list(thermometer_findings(dataset))
    assert [(f["evidence"]["channel"], f["evidence"]["file"]) for f in found] == [("mirror_c", "run-04.csv")]
    assert "shows" in found[0]["text"]
    assert "less" in found[0]["text"]


def test_one_that_answers_later_is_named_and_by_how_much(sound: Dataset) -> None:
    """The third run's mirror, delayed by ten minutes in the file itself."""

    def late(k: int) -> object:
        run = sound.runs[k]
        rows = run.rows()
        shifted = np.concatenate([np.full(60, rows.channels["mirror_c"][0]), rows.channels["mirror_c"][:-60]])
        changed = replace(rows, channels={**rows.channels, "mirror_c": shifted})
        return replace(run, reader=lambda: changed)

    runs = tuple(late(k) if k == 2 else run for k, run in enumerate(sound.runs))
    (found,) = thermometer_findings(replace(sound, runs=runs))  # type: ignore[arg-type]
    assert found["evidence"]["file"] == "run-03.csv"
    assert "s later" in found["text"]


def test_two_runs_say_nothing(sound: Dataset) -> None:
    assert list(thermometer_findings(replace(sound, runs=sound.runs[:2]))) == []
