"""A tampered `model.json` is refused in one message wherever it is read, and nothing is written."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from conftest import EXAMPLE, Command

DAMAGE = {
    "not json": lambda text: text[: len(text) // 2],
    "nan": lambda text: text.replace('"w0": ', '"w0": NaN, "was": ', 1),
    "infinite": lambda text: text.replace('"block_s": 10.0', '"block_s": 1e999', 1),
    "text for a number": lambda text: text.replace('"block_s": 10.0', '"block_s": "10"', 1),
    "another schema": lambda text: text.replace("gyrotc.model/1", "gyrotc.model/9", 1),
    "illegal serial": lambda text: text.replace('"RLG-0042"', '"../../RLG"', 1),
    "code as serial": lambda text: text.replace('"RLG-0042"', '"x\\"; system(\\"rm\\"); \\""', 1),
    "absurd size": lambda text: text.replace('"slope_blocks": 10', '"slope_blocks": 1000000', 1),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_emit_refuses(damage: str, tmp_path: Path, gyrotc: Command) -> None:
    text = (EXAMPLE / "model.json").read_text()
    spoilt = DAMAGE[damage](text)
    assert spoilt != text
    (tmp_path / "model.json").write_text(spoilt)
    done = gyrotc("emit", tmp_path / "model.json", "--out", tmp_path / "out")
    assert done.returncode == 2
    assert str(tmp_path / "model.json") in done.stderr and "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_every_other_command_that_reads_a_model_refuses(demo: Path, tmp_path: Path, gyrotc: Command) -> None:
    result = tmp_path / "result"
    shutil.copytree(demo / "result", result)
    content = json.loads((result / "model.json").read_text())
    content["networks"][0]["weights"] = content["networks"][0]["weights"][:-1]
    (result / "model.json").write_text(json.dumps(content))
    before = {p: p.read_bytes() for p in result.rglob("*") if p.is_file()}
    data = demo / "data"
    for command in (
        ("verify", result),
        ("evaluate", result, data),
        ("report", result),
        ("fit", data, "--applied", result / "model.json", "--out", tmp_path / "o"),
        ("build", data, "--applied", result / "model.json", "--out", tmp_path / "o"),
        ("check", data, "--applied", result / "model.json"),
        ("compare", data, "--applied", result / "model.json"),
        ("diagnose", data, "--model", result / "model.json"),
    ):
        done = gyrotc(*command)
        assert done.returncode == 2, (command, done.stdout, done.stderr)
        assert "networks" in done.stderr and "Traceback" not in done.stderr
    assert not (tmp_path / "o").exists()
    assert before == {p: p.read_bytes() for p in result.rglob("*") if p.is_file()}
