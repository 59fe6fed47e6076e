"""Twelve recordings of both blind worlds that never change: each hidden cause is named, and no other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from gyrotc.diagnose.blocks import records_of
from gyrotc.diagnose.noise import declared_noise
from gyrotc.diagnose.pipeline import analyse
from gyrotc.diagnose.summary import holds
from gyrotc.recordings.load import load
from gyrotc.recordings.records import joined_runs

from tests.blind.fixed import recordings

BLOCK_S = 150.0  # half as many blocks as by default: a quarter of the time


def test_each_hidden_cause_is_named_and_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    answers = {}
    for folder, hidden in recordings(tmp_path):
        dataset = load(folder)
        runs = replace(dataset, runs=joined_runs(dataset.runs))
        records = records_of(runs, "train", block_s=BLOCK_S, average_s=BLOCK_S)
        found = analyse(records, declared_noise(runs)).attribution
        answers[folder.name, hidden] = [c.candidate.id for c in found.causes] if holds(found) else []
    assert len(answers) == 12
    assert {key: named for key, named in answers.items() if named != [key[1]]} == {}
