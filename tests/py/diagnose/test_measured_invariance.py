"""What a measured chamber cycle gives must not hang on how it is handed over: blocks, cuts, constants.

The last branch is the exam; what the states and a map of T leave there is compared. Skipped, and told, where the
recording is absent.
"""

from __future__ import annotations

import os
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT
from gyrotc.diagnose.blocks import records_of
from gyrotc.diagnose.extension import Refitting
from gyrotc.diagnose.refit import Effect
from gyrotc.diagnose.single_cycle import cycle_of
from gyrotc.recordings.load import load
from gyrotc.recordings.records import Dataset, joined_runs
from gyrotc.train.fitting import FitOptions
from recordings import write_csv

pytestmark = pytest.mark.slow

SOURCE = (
    Path(os.environ.get("GYROTC_REAL_DATA", ROOT / ".." / "shared" / "data" / "real"))
    / "mpu6000-chamber-cycle"
    / "data.csv"
)
CUT_S = 3130.0
AVERAGE_S = 100.0
Table = dict[str, np.ndarray]


def recording(axis: str) -> Table:
    if not SOURCE.is_file():
        pytest.skip("1 of 1 measured recordings is absent: see GYROTC_REAL_DATA")
    names = SOURCE.read_text("utf-8").split("\n", 1)[0].split(",")
    table = dict(zip(names, np.loadtxt(SOURCE, delimiter=",", skiprows=1).T, strict=True))
    return {name: table[name] for name in ("time_s", "temperature_c")} | {
        "rate_dph": table[f"rate_{axis}_dph"]
    }


def handed_over(folder: Path, table: Table, cuts: list[float], later_s: float = 0.0) -> Dataset:
    """Training spans that touch at the cuts, named last first, and the exam after them."""
    write_csv(folder / "a.csv", table)
    edges = [None, *(cut + later_s for cut in [*cuts, CUT_S])]
    spans = []
    for low, high in pairwise(edges):
        start = "" if low is None else f"from_s = {low}\n"
        spans.append(f'[[run]]\nfile = "a.csv"\npower_on_s = "unknown"\n{start}to_s = {high}\n')
    exam = f'[[run]]\nfile = "a.csv"\npower_on_s = "unknown"\nfrom_s = {CUT_S + later_s}\nrole = "exam"\n'
    (folder / "dataset.toml").write_text(f'schema = 1\nserial = "R1"\n{"".join(spans[::-1])}{exam}', "utf-8")
    dataset = load(folder)
    return replace(dataset, runs=joined_runs(dataset.runs))  # as every job does it


def left(dataset: Dataset, block_s: float = 10.0) -> float:
    """RMS on the exam of states and a map of T, both from the training part, deg/h."""
    records = records_of(dataset, "train", block_s=block_s, average_s=AVERAGE_S)
    options = FitOptions(method="mrbf", block_s=block_s, average_s=AVERAGE_S)
    refitting = Refitting(dataset, records, options, single_cycle=True)
    [runs] = refitting.on_exam([[Effect.of(state) for state in cycle_of(records).states]])
    return float(np.sqrt(np.mean(np.concatenate([run.after_dph for run in runs]) ** 2)))


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_the_length_of_a_block_hardly_matters(tmp_path: Path, axis: str) -> None:
    """From 1 s to 20 s, within 5 % of the middle: what is in force is what is fitted."""
    dataset = handed_over(tmp_path, recording(axis), [])
    found = [left(dataset, block_s) for block_s in (1.0, 5.0, 20.0)]
    np.testing.assert_allclose(found, np.median(found), rtol=0.05)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_cuts_and_constants_do_not_matter(tmp_path: Path, axis: str) -> None:
    """Where touching spans are cut, and in which order they are named: within 2 %; constants: within rounding."""
    table = recording(axis)
    whole = left(handed_over(tmp_path / "whole", table, []))
    assert left(handed_over(tmp_path / "cut", table, [1800.0])) == pytest.approx(whole, rel=0.02)
    assert left(handed_over(tmp_path / "cuts", table, [700.0, 2001.0])) == pytest.approx(whole, rel=0.02)
    moved = table | {"rate_dph": table["rate_dph"] + 5e3}
    assert left(handed_over(tmp_path / "moved", moved, [])) == pytest.approx(whole, rel=1e-3)
    later = table | {"time_s": table["time_s"] + 4096.0}
    assert left(handed_over(tmp_path / "later", later, [], 4096.0)) == pytest.approx(whole, rel=1e-3)
