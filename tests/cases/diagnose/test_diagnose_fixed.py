"""Recordings of both blind worlds that never change: hidden causes are named, and no others."""

from __future__ import annotations

from pathlib import Path

from named_causes import named_causes

from tests.blind.fixed import recordings

BLOCK_S = 250.0  # longer than by default: fewer blocks take less time


def test_each_hidden_cause_is_named_and_no_other(tmp_path: Path) -> None:
    answers = {}
    for folder, hidden in recordings(tmp_path):
        answers[folder.name, hidden] = named_causes(folder, BLOCK_S, BLOCK_S)
    assert len(answers) == 12
    assert {key: named for key, named in answers.items() if named != [key[1]]} == {}
