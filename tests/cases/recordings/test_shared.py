"""Rows that two recordings share are found by content; quantised, constant and patterned rates accuse nobody."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from gyrotc.common import InputError
from gyrotc.fleet import copies
from gyrotc.quality import check
from gyrotc.recordings import fingerprints_of, load, windows_in_common
from gyrotc.results import FleetEntry
from numpy.typing import NDArray
from recordings import Columns, columns, toml, write_csv

Floats = NDArray[np.float64]
TRAIN, EXAM = 'file = "a.csv"', 'file = "b.csv"\nrole = "exam"'


def two_runs(folder: Path, *, role: str = "exam", extra: str = "") -> tuple[Columns, Columns]:
    """Two runs of 6000 rows; rows 1001 to 3000 of the first are rows 3501 to 5500 of the second."""
    a, b = columns(6000, seed=3), columns(6000, seed=4)
    for name in ("temperature_c", "rate_dph"):
        b[name][3500:5500] = a[name][1000:3000]
    write_csv(folder / "a.csv", a)
    write_csv(folder / "b.csv", b)
    second = f'file = "b.csv"\nrole = "{role}"' + (f"\n{extra}" if extra else "")
    (folder / "dataset.toml").write_text(toml(TRAIN, second), "utf-8")
    return a, b


def test_an_exam_on_training_data_is_refused_with_the_rows_and_the_line_that_mends_it(tmp_path: Path) -> None:
    """Before: 0 problems, 0 warnings."""
    two_runs(tmp_path / "R")
    [problem] = check(tmp_path / "R").problems
    assert problem.where == "b.csv, rows 3501 to 5500"
    assert "also rows 1001 to 3000 of a.csv, which is trained on" in problem.found
    with pytest.raises(InputError, match="rows 3501 to 5500"):
        load(tmp_path / "R")
    line = 'exclude = [{from_s = 35000.0, to_s = 55000.0, reason = "also in a.csv"}]'
    assert line in problem.expected
    two_runs(tmp_path / "R", extra=line)
    assert check(tmp_path / "R").problems == ()
    load(tmp_path / "R")


def test_rows_of_two_training_runs_are_reported(tmp_path: Path) -> None:
    two_runs(tmp_path / "R", role="train")
    result = check(tmp_path / "R")
    assert result.problems == ()
    [warning] = [d for d in result.warnings if d.id == "shared_rows"]
    assert (
        "Rows 3501 to 5500 of b.csv are also rows 1001 to 3000 of a.csv: these 2000 rows would count twice"
        in warning.text
    )


def test_a_stretch_that_a_logger_wrote_twice_is_reported(tmp_path: Path) -> None:
    table = columns(9000)
    for name in ("temperature_c", "rate_dph"):
        table[name][5000:8000] = table[name][1000:4000]
    write_csv(tmp_path / "R" / "a.csv", table)
    [warning] = [d for d in check(tmp_path / "R").warnings if d.id == "shared_rows"]
    assert "Rows 5001 to 8000 of a.csv are also rows 1001 to 4000 of the same file" in warning.text


def alike(rate: Callable[[np.random.Generator], Floats], n: int = 60_000) -> int:
    """Windows in common of two recordings of one profile, whose temperatures are the same to the last bit."""
    t = np.arange(n) * 1.0
    temperature = np.round(20.0 + 30.0 * np.sin(t / 9000.0), 1)
    one, two = (fingerprints_of(t, temperature, [rate(np.random.default_rng(k))]) for k in (1, 2))
    return sum(map(len, windows_in_common([one, two]).values()))


INNOCENT: dict[str, Callable[[np.random.Generator, int], Floats]] = {
    "constant": lambda g, n: np.zeros(n),
    "toggles": lambda g, n: np.arange(n) % 2.0,
    "pattern": lambda g, n: np.round(np.sin(np.arange(n) * (2.0 * np.pi / 50.0)), 2),
    "two levels": lambda g, n: np.round(0.49 + g.normal(0.0, 0.3, n)),
    "one level in a hundred rows": lambda g, n: np.round(g.normal(0.0, 0.19, n)),
    "coarse": lambda g, n: np.round(g.normal(0.0, 1.0, n)),
    "slow walk": lambda g, n: np.round(np.cumsum(g.normal(0.0, 0.02, n))),
    "held for 50 rows": lambda g, n: np.repeat(np.round(g.normal(0.0, 1.0, n // 50)), 50),
    "counted pulses of a constant rate": lambda g, n: np.diff(np.floor(g.uniform() + 10.3 * np.arange(n + 1))),
    "counted pulses and noise": lambda g, n: np.diff(np.floor(np.cumsum(np.r_[g.uniform(), g.normal(10.3, 0.02, n)]))),
    "fine": lambda g, n: g.normal(0.0, 1.0, n),
}


@pytest.mark.parametrize("name", INNOCENT)
def test_quantised_and_constant_rates_accuse_nobody(name: str) -> None:
    assert alike(lambda g: INNOCENT[name](g, 60_000)) == 0


def test_runs_that_the_chamber_disturbs_alike_are_no_copies(tmp_path: Path) -> None:
    """Both rates follow the programme far beyond their own noise; a training run and an exam of it are accepted."""
    for name, seed in (("a.csv", 3), ("b.csv", 4)):
        table = columns(6000, seed=seed)
        programme = np.random.default_rng(5).normal(0.0, 1.0, 6000)
        table["rate_dph"] = np.round(table["rate_dph"] + programme, 6)
        write_csv(tmp_path / "R" / name, table)
    (tmp_path / "R" / "dataset.toml").write_text(toml(TRAIN, EXAM), "utf-8")
    assert load(tmp_path / "R").shared == ()


@pytest.mark.parametrize("rows", [150, 400])
def test_a_short_recording_that_is_copied_whole_is_found(rows: int) -> None:
    rate, t = np.random.default_rng(8).normal(size=rows), np.arange(rows) * 1.0
    prints = [fingerprints_of(t + late, np.full(rows, 20.0), [rate]) for late in (0.0, 7.0)]
    assert list(windows_in_common(prints)) == [(1, 0)]


def test_an_axis_that_is_a_copy_of_another_is_reported(tmp_path: Path) -> None:
    """Two axes that nothing is connected to, and axes that are only alike, are no copies."""
    table, noise = columns(600), np.random.default_rng(9)
    rate = table.pop("rate_dph")
    for axis, values in (("x", rate), ("y", rate), ("z", rate + noise.normal(0.0, 1e-4, 600))):
        table[f"rate_{axis}_dph"] = values
    write_csv(tmp_path / "R" / "a.csv", table)
    [finding] = [one for one in check(tmp_path / "R", axis="x").warnings if one.id == "shared_axes"]
    assert finding.text.startswith("Axes x and y of a.csv hold the same values")
    table["rate_x_dph"] = table["rate_y_dph"] = np.zeros(600)
    write_csv(tmp_path / "S" / "a.csv", table)
    assert "shared_axes" not in {one.id for one in check(tmp_path / "S", axis="z").warnings}


@pytest.mark.parametrize("step", [0.0, 0.1, 1.0, 2.0])
def test_a_shared_stretch_is_found_also_where_the_rate_is_coarse(step: float) -> None:
    g, n = np.random.default_rng(5), 40_000
    t = np.arange(n) * 1.0
    first, second = g.normal(0.0, 1.0, n), g.normal(0.0, 1.0, n)
    second[7000:10_000] = first[1000:4000]
    coarse = [np.round(r / step) if step else r for r in (first, second)]
    one, two = (fingerprints_of(t, np.full(n, 20.0), [r]) for r in coarse)
    found = windows_in_common([two, one])
    assert list(found) == [(1, 0)]
    assert {b - a for a, b, _ in found[1, 0]} == {6000}


def test_every_pair_of_runs_and_a_run_with_itself_is_looked_at() -> None:
    g, n = np.random.default_rng(6), 3000
    t, own = np.arange(n) * 1.0, [g.normal(size=n) for _ in range(4)]
    own[3][:1000] = own[1][2000:]  # runs 1 and 3
    own[2][1500:] = own[2][:1500]  # run 2 with itself
    found = windows_in_common([fingerprints_of(t, np.full(n, 20.0), [r]) for r in own])
    assert {pair: {b - a for a, b, _ in windows} for pair, windows in found.items()} == {
        (2, 2): {-1500},
        (3, 1): {2000},
    }
    assert windows_in_common([]) == {}


def test_long_recordings_keep_fewer_windows_and_still_show_a_copy() -> None:
    g, n = np.random.default_rng(7), 2**21 + 1000
    one, two = g.normal(size=n), g.normal(size=20_000)
    two[4000:8000] = one[-5000:-1000]
    prints = [fingerprints_of(np.arange(len(r)) * 1.0, np.full(len(r), 20.0), [r]) for r in (one, two)]
    assert len(prints[0].hash) < 2**17.2
    assert {b - a for a, b, _ in windows_in_common(prints)[1, 0]} == {n - 9000}


def test_a_copy_under_another_serial_is_named() -> None:
    words = [f"{k:016x}" for k in range(300)]
    own = {"A": words[:100], "B": words[100:200], "C": words[200:280] + words[:20]}
    entries = [
        FleetEntry(name=name, axis=None, status="done", serial=name, sketch="".join(mine)) for name, mine in own.items()
    ]
    [found] = copies(entries)
    assert (found.name, found.other, found.share) == ("A", "C", 0.2)
    assert copies([e.model_copy(update={"serial": "A"}) for e in entries]) == []  # axes of one gyro


def test_values_beyond_float32_are_no_trouble() -> None:
    """A damaged cell may hold 1e276: it is refused by its range, not here."""
    time = np.arange(2048.0)
    wild = np.full(2048, 1e276)
    fingerprints_of(time, wild, [wild])


def test_a_run_that_has_hardly_a_row_of_its_own_is_left_out_and_said(tmp_path: Path) -> None:
    """Nine of its rows are in no other run, which are no recording."""
    first, second = columns(3000, seed=3), columns(3000, seed=3)
    for name in ("temperature_c", "rate_dph"):
        second[name][2991:] += 0.5
    write_csv(tmp_path / "R" / "a.csv", first)
    write_csv(tmp_path / "R" / "b.csv", second)
    (tmp_path / "R" / "dataset.toml").write_text(toml(TRAIN, 'file = "b.csv"'), "utf-8")
    dataset = load(tmp_path / "R")
    assert [run.file for run in dataset.runs] == ["a.csv"]
    assert [text for text in dataset.warnings if text.startswith("b.csv: left out")]


def test_a_copy_counts_once(tmp_path: Path) -> None:
    for name, seed, late in (("a.csv", 3, 0.0), ("b.csv", 4, 0.0), ("c.csv", 3, 20.0)):
        table = columns(3000, seed=seed)
        table["time_s"] += late
        write_csv(tmp_path / "R" / name, table)
    (tmp_path / "R" / "dataset.toml").write_text(toml(TRAIN, 'file = "b.csv"', 'file = "c.csv"'), "utf-8")
    dataset = load(tmp_path / "R")
    assert [run.file for run in dataset.runs] == ["a.csv", "b.csv"]
    assert [(one.file, one.other_file) for one in dataset.shared] == [("c.csv", "a.csv")]
