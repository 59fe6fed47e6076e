"""A run with its sign reversed and a channel that is a copy are told, with what to do; good ones are not accused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gyrotc.quality.check import check
from recordings import Columns, columns, write_csv


def run(seed: int, sign: float = 1.0) -> Columns:
    table = columns(600, seed=seed)
    curve = 0.05 * np.sin(table["temperature_c"] / 10.0)
    noise = np.random.default_rng(seed + 100).normal(0.0, 0.002, 600)
    return table | {"rate_dph": sign * curve + noise}


@pytest.mark.parametrize("reversed_run", [None, 0, 2])
def test_the_run_with_its_sign_reversed_is_named(reversed_run: int | None, tmp_path: Path) -> None:
    for k in range(4):
        write_csv(tmp_path / "R" / f"{k}.csv", run(k, -1.0 if k == reversed_run else 1.0))
    told = [d for d in check(tmp_path / "R").doubts if d.id == "sign_reversed"]
    assert [d.where for d in told] == ([] if reversed_run is None else [f"{reversed_run}.csv"])
    assert all("Look at mounting and wiring" in d.text for d in told)


def test_runs_of_noise_alone_are_not_accused(tmp_path: Path) -> None:
    for k in range(4):
        write_csv(tmp_path / "R" / f"{k}.csv", columns(600, seed=k))
    assert "sign_reversed" not in {d.id for d in check(tmp_path / "R").doubts}


def test_a_channel_that_is_a_copy_is_told(tmp_path: Path) -> None:
    table = run(1)
    own = table["temperature_c"] + 1.0
    write_csv(
        tmp_path / "R" / "a.csv", table | {"case_temperature_c": table["temperature_c"], "inner_c": own}
    )
    told = [d.text for d in check(tmp_path / "R").doubts if d.id == "channel_copy"]
    assert len(told) == 1
    assert told[0].startswith("channel case_temperature_c of a.csv is a copy of the temperature, row by row")


def test_a_stuck_thermometer_is_told_and_the_line_mends_it(tmp_path: Path) -> None:
    table = run(1)
    table["temperature_c"][200:280] = table["temperature_c"][200]
    write_csv(tmp_path / "R" / "a.csv", table)
    [doubt] = [d for d in check(tmp_path / "R").doubts if d.id == "stuck_temperature"]
    assert "from 2000 to 2790 s (80 rows)" in doubt.text
    assert 'exclude = [{from_s = 2000.0, to_s = 2800.0, reason = "thermometer stuck"}]' in doubt.text


@pytest.mark.parametrize("step", [0.25, 1.0])
def test_a_coarse_thermometer_that_holds_is_not_stuck(step: float, tmp_path: Path) -> None:
    table = run(1)
    held = np.where(np.arange(600) < 300, table["temperature_c"], table["temperature_c"][300])
    write_csv(tmp_path / "R" / "a.csv", table | {"temperature_c": np.round(held / step) * step})
    assert "stuck_temperature" not in {d.id for d in check(tmp_path / "R").doubts}
