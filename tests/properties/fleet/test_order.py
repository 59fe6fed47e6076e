"""A fleet says the same of its gyros in whatever order they come and on however many processes they are done."""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from conftest import run_gyrotc
from drawn import examples
from hypothesis import given
from hypothesis import strategies as st
from small_gyro import HEAD, small_gyro, write_gyro

GYROS = 3


def _done(data: Path, order: list[int], jobs: int) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Do a fleet, and return its entries by name, and the bytes of models and tables by path."""
    units = "".join(f'[[unit]]\ndataset = "RLG-{k}"\n' for k in order)
    manifest = data / "fleet.toml"
    manifest.write_text(f'schema = 1\nnumeric = ["f32"]\n[options]\nmethod = "cubic"\n{units}')
    with TemporaryDirectory() as place:
        out = Path(place) / "out"
        done = run_gyrotc("fleet", manifest, "--out", out, "--jobs", str(jobs))
        assert done.returncode == 0, done.stderr
        summary = json.loads((out / "fleet.json").read_text())
        files = [*out.rglob("model.json"), *out.rglob("gtc_rlg_*.c")]
        contents = {path.relative_to(out).as_posix(): path.read_bytes() for path in files}
    return {unit["name"]: unit for unit in summary["serials"]}, contents


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    for k in range(GYROS):
        write_gyro(folder / f"RLG-{k}", small_gyro(1, seed=k, rows=240), head=HEAD.replace("RLG-1", f"RLG-{k}"))
    return folder


@pytest.fixture(scope="module")
def in_order(data: Path) -> tuple[dict[str, Any], dict[str, bytes]]:
    return _done(data, list(range(GYROS)), 1)


@examples(2, shrink=False)
@given(order=st.permutations(range(GYROS)), jobs=st.integers(1, 3))
def test_neither_the_order_of_gyros_nor_the_number_of_processes_matters(
    order: list[int], jobs: int, data: Path, in_order: tuple[dict[str, Any], dict[str, bytes]]
) -> None:
    entries, files = _done(data, order, jobs)
    assert list(entries) == [f"RLG-{k}" for k in order]
    assert entries == in_order[0]
    assert len(files) == 2 * GYROS and files == in_order[1]
