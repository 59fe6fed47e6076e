"""`[fit]` of a description: what experts change of training, taken by every command that trains."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from conftest import Command
from recordings import described


def test_options_of_a_description_reach_the_model(tmp_path: Path, gyrotc: Command) -> None:
    described(tmp_path / "RLG-1", tail="[fit]\nblock_s = 50.0\naverage_s = 200.0\nseed = 7")
    done = gyrotc("fit", tmp_path / "RLG-1", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    model = json.loads((tmp_path / "out" / "model.json").read_text())
    assert (model["block_s"], model["average_s"], model["seed"]) == (50.0, 200.0, 7)


@pytest.mark.parametrize(
    ("line", "field"),
    [
        ("blok_s = 50.0", "blok_s"),
        ("block_s = -1.0", "block_s"),
        ('centers = "many"', "centers"),
        ("average_s = 1e9", "average_s"),
    ],
)
def test_a_wrong_option_of_a_description_is_named(tmp_path: Path, gyrotc: Command, line: str, field: str) -> None:
    described(tmp_path / "RLG-1", tail=f"[fit]\n{line}")
    for command in ("fit", "build", "compare", "diagnose"):
        done = gyrotc(command, tmp_path / "RLG-1", "--out", tmp_path / "out")
        assert done.returncode == 2 and f"dataset.toml, field fit.{field}" in done.stderr, done.stderr
        assert not (tmp_path / "out").exists()
    checked = gyrotc("check", tmp_path / "RLG-1")
    assert checked.returncode == 2 and f"dataset.toml, field fit.{field}" in checked.stdout
