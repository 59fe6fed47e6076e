"""Axes, signs and times that are not what they are said to be: told with rows, picture and what to do; no other run is.

Each case is made from good runs by one change, and the same good runs raise no doubt.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import Command
from gyrotc.assess.changes import earlier_models
from gyrotc.quality.check import CheckResult, Doubt, check
from gyrotc.quality.findings import __file__ as doubts_file
from gyrotc.quality.findings import advice_of
from gyrotc.recordings.plausibility import earth_rate
from gyrotc.results.fleet import Facts, FleetEntry
from numpy.typing import NDArray
from recordings import Columns, columns, toml, write_csv

Floats = NDArray[np.float64]
AXES = ("x", "y", "z")
ORIENTED = {"sign_reversed", "axes_exchanged"}
ANGLES = {"x": (0.0, 0.0), "y": (90.0, 0.0), "z": (0.0, 90.0)}
EARTH = {
    axis: earth_rate(48.0, *angles, latitude_sigma_deg=0.0, axis_sigma_deg=0.0).rate_dph
    for axis, angles in ANGLES.items()
}
COMPUTED = 'schema = 1\nserial = "RLG-0042"\nearth_rate = "compute"\nlatitude_deg = 48.0'
GEOMETRY = (
    "axis_azimuth_deg = {x = 0.0, y = 90.0, z = 0.0}\naxis_elevation_deg = {x = 0.0, y = 0.0, z = 90.0}"
)


def three(seed: int, *, bias: tuple[float, float, float] = (2.0, -1.0, 0.5), earth: bool = False) -> Columns:
    """A run of three axes: a bias with a slope in temperature, turn-on offsets, Earth's rate if asked for."""
    g, table = np.random.default_rng(seed), columns(600, seed=seed)
    del table["rate_dph"]
    for k, axis in enumerate(AXES):
        level = bias[k] + g.normal(0.0, 0.01) + (EARTH[axis] if earth else 0.0)
        curve = level + (0.01, -0.02, 0.015)[k] * (table["temperature_c"] - 30.0)
        table[f"rate_{axis}_dph"] = curve + g.normal(0.0, 0.02, 600)
    return table


def turned(table: Columns, columns_of: str) -> Columns:
    """A run whose columns x, y, z hold what `columns_of` says, as "y x -z"."""
    rates = {a: table[f"rate_{a}_dph"] for a in AXES}
    held = [(-1.0 if one[0] == "-" else 1.0) * rates[one[-1]] for one in columns_of.split()]
    return table | {f"rate_{a}_dph": values for a, values in zip(AXES, held, strict=True)}


def oriented(result: CheckResult) -> list[Doubt]:
    return [d for d in result.doubts if d.id in ORIENTED]


@pytest.mark.parametrize(
    ("held", "id", "words"),
    [
        ("x y z", "", ""),
        ("y x z", "axes_exchanged", "axis x stands in the column of y; axis y stands in the column of x"),
        ("y -x z", "axes_exchanged", "axis x stands with the other sign in the column of y"),
        ("x y -z", "sign_reversed", "axis z stands with the other sign in the column of z"),
    ],
)
def test_against_the_other_runs(held: str, id: str, words: str, tmp_path: Path) -> None:
    for k in range(4):
        table = three(k)
        write_csv(tmp_path / "R" / f"{k}.csv", turned(table, held) if k == 2 else table)
    told = oriented(check(tmp_path / "R", axis="all"))
    assert [d.id for d in told] == ([id] if id else [])
    for doubt in told:
        assert doubt.where == "2.csv"
        assert words in doubt.text
        assert "mounting and wiring" in doubt.advice + doubt.text


@pytest.mark.parametrize(
    ("held", "id"), [("x y z", ""), ("y x z", "axes_exchanged"), ("-x y z", "sign_reversed")]
)
def test_against_earths_rate(held: str, id: str, tmp_path: Path) -> None:
    """One run is enough where the geometry is stated: a good gyro shows Earth's rate itself."""
    small = (0.02, -0.01, 0.03)
    folder = tmp_path / "R"
    write_csv(folder / "a.csv", turned(three(1, bias=small, earth=True), held))
    (folder / "dataset.toml").write_text(toml(f'file = "a.csv"\n{GEOMETRY}', head=COMPUTED), "utf-8")
    told = oriented(check(folder, axis="all"))
    assert [d.id for d in told] == ([id] if id else [])
    assert all("against Earth's rate" in d.text for d in told)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_one_axis_against_earths_rate(sign: float, tmp_path: Path) -> None:
    folder = tmp_path / "R"
    table = columns(600)
    rate = EARTH["z"] + 0.01 * np.random.default_rng(1).normal(size=600)
    write_csv(folder / "a.csv", table | {"rate_dph": sign * rate})
    run = 'file = "a.csv"\naxis_azimuth_deg = 0.0\naxis_elevation_deg = 90.0'
    (folder / "dataset.toml").write_text(toml(run, head=COMPUTED), "utf-8")
    assert [d.id for d in oriented(check(folder))] == ([] if sign > 0.0 else ["sign_reversed"])


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Models of three axes, as an earlier `build --axis all` left them."""
    from gyrotc.recordings.load import load
    from gyrotc.train.fitting import FitOptions, fit_dataset

    folder = tmp_path_factory.mktemp("earlier") / "RLG-0042"
    for k in range(2):
        write_csv(folder / f"{k}.csv", three(10 + k))
    out = folder.parent / "out"
    for axis in AXES:
        (out / axis).mkdir(parents=True)
        fit_dataset(load(folder, axis=axis), FitOptions()).model.save(out / axis / "model.json")
    return out


@pytest.mark.parametrize(
    ("held", "id"), [("x y z", ""), ("y x z", "axes_exchanged"), ("x -y z", "sign_reversed")]
)
def test_against_an_earlier_calibration(held: str, id: str, calibrated: Path, tmp_path: Path) -> None:
    write_csv(tmp_path / "RLG-0042" / "a.csv", turned(three(5), held))
    earlier = earlier_models(calibrated)
    assert set(earlier) == set(AXES)
    told = oriented(check(tmp_path / "RLG-0042", axis="all", earlier=earlier))
    assert [d.id for d in told] == ([id] if id else [])
    assert all("against the earlier calibration" in d.text for d in told)


CHANGES: dict[str, Callable[[Columns], Columns]] = {
    "time_jumps": lambda c: c | {"time_s": c["time_s"] + np.where(np.arange(600) >= 50, 3600.0, 0.0)},
    "gaps": lambda c: {name: np.delete(values, np.arange(50, 70)) for name, values in c.items()},
    "time_drifts": lambda c: c | {"time_s": np.cumsum(np.where(np.arange(600) < 300, 10.0, 9.8)) - 10.0},
}


@pytest.mark.parametrize("id", CHANGES)
def test_time_stamps_are_told_with_their_rows(id: str, tmp_path: Path) -> None:
    write_csv(tmp_path / "R" / "a.csv", CHANGES[id](columns(600)))
    [doubt] = [d for d in check(tmp_path / "R").doubts if d.id == id]
    [mark, *_] = doubt.marks
    assert mark.rows == ((50, 51) if id != "time_drifts" else mark.rows)
    if id == "time_jumps":
        assert "jumps by 3600 s between rows 50 and 51" in doubt.text
        assert "1 h: a clock that was set" in doubt.text
    if id == "time_drifts":
        assert mark.rows is not None
        assert mark.rows[0] > 290 or mark.rows[1] < 310


def test_what_is_excluded_is_no_gap(tmp_path: Path) -> None:
    """Before: a line that `check` offered to paste was a gap in the next `check`."""
    folder = tmp_path / "R"
    write_csv(folder / "a.csv", columns(600))
    run = 'file = "a.csv"\nexclude = [{from_s = 500.0, to_s = 700.0, reason = "door opened"}]'
    (folder / "dataset.toml").write_text(toml(run), "utf-8")
    result = check(folder)
    assert result.doubts == ()
    assert result.facts[0][1].gaps == 0


@pytest.mark.parametrize("scatter", [0.02, 0.2])
def test_stamps_of_a_computer_that_tremble_are_in_order(scatter: float, tmp_path: Path) -> None:
    g = np.random.default_rng(3)
    table = columns(2000)
    table["time_s"] = np.arange(2000) * 10.0 + g.uniform(-scatter, scatter, 2000) * 10.0
    write_csv(tmp_path / "R" / "a.csv", table)
    assert not {d.id for d in check(tmp_path / "R").doubts} & {
        "time_jumps", "time_drifts", "coarse_time", "gaps",
    }  # fmt: skip


def test_every_doubt_says_what_to_do_next() -> None:
    """By `advice`, or, with the line to paste or the place to look, in its own text."""
    told_in_text = {"shared_rows", "sign_reversed", "axes_exchanged", "stuck_temperature", "channel_copy"}
    told_in_text |= {"thermometer_changed"}
    judge = Path(doubts_file).parent
    texts = "".join(
        (judge / f"{name}.py").read_text("utf-8")
        for name in ("findings", "recorded", "thermometers", "timing", "orientation")
    )
    ids = set(re.findall(r'(?:Doubt\(|"id": )"(\w+)"', texts)) | {"axes_exchanged", "jump_in_temperature"}
    assert len(ids) > 20
    assert {id for id in ids if not advice_of(id)} <= told_in_text


def test_the_page_has_a_picture_for_each_finding(tmp_path: Path) -> None:
    folder, page = tmp_path / "R", tmp_path / "check.html"
    for k in range(4):
        table = columns(600, seed=k) if k != 1 else CHANGES["time_jumps"](columns(600, seed=k))
        if k == 3:
            table["rate_dph"] = -table["rate_dph"]
        write_csv(folder / f"{k}.csv", table)
    write_csv(folder / "b.csv", columns(600, seed=9))
    lines = (folder / "b.csv").read_text().splitlines()
    lines[7] = lines[6]
    (folder / "b.csv").write_text("\n".join(lines))
    from gyrotc.pages.check import write_check_page

    result = check(folder)
    assert len(result.problems) == 1
    assert {d.id for d in result.doubts} == {
        "time_jumps",
        "sign_reversed",
        "runs_contradict",
        "earth_rate_not_stated",
    }
    write_check_page(page, folder, result)
    text = page.read_text("utf-8")
    assert text.count("<svg") == 1 + len(result.doubts)
    assert text.count("<b>Next:</b>") >= 2
    assert "b.csv: row 7" in text
    write_check_page(page, folder, result)  # its own page is replaced ...
    page.write_text("mine")
    with pytest.raises(Exception, match="was not written by gyrotc"):  # ... and nobody else's
        write_check_page(page, folder, result)


def test_rows_and_what_to_do_next_stand_in_the_json(tmp_path: Path) -> None:
    write_csv(tmp_path / "R" / "a.csv", CHANGES["gaps"](columns(600)))
    [doubt] = json.loads(json.dumps(check(tmp_path / "R").result().content()))["doubts"]
    assert doubt["rows"] == [{"file": "a.csv", "rows": [50, 51], "span_s": [490.0, 700.0]}]
    assert "Look at the logger" in doubt["next"]


def _entry(name: str, curve: list[float | None]) -> FleetEntry:
    facts = Facts(curve=tuple(curve), runs=(), series=None)
    return FleetEntry(name=name, axis=None, status="done", facts=facts)


@pytest.mark.parametrize("reversed_unit", [None, 3])
def test_a_gyro_with_the_lots_curve_turned_over_is_named(reversed_unit: int | None) -> None:
    from gyrotc.fleet.outliers import turned

    g = np.random.default_rng(1)
    t = np.arange(-60.0, 126.0, 5.0)
    entries = []
    for k in range(10):
        curve = (
            g.normal(0.0, 5.0) + (1.0 + 0.3 * g.normal()) * 0.02 * (t - 20.0) + g.normal(0.0, 0.05, len(t))
        )
        curve = -curve if k == reversed_unit else curve
        inside = (t >= -40.0) & (t <= 60.0)
        held = [float(c) if i else None for c, i in zip(curve, inside, strict=True)]
        entries.append(_entry(f"u{k}", held))
    assert turned(entries) == ([] if reversed_unit is None else ["u3"])


def test_a_lot_of_gyros_that_have_nothing_in_common_accuses_nobody() -> None:
    from gyrotc.fleet.outliers import turned

    g = np.random.default_rng(2)
    for _ in range(200):
        entries = [_entry(f"u{k}", g.normal(0.0, 1.0, 38).cumsum().tolist()) for k in range(12)]
        assert turned(entries) == []


@pytest.mark.parametrize("lost", [0.06, 0.2])
def test_rows_that_are_really_missing_are_gaps_and_no_coarse_stamps(lost: float, tmp_path: Path) -> None:
    table = columns(3000)
    kept = np.random.default_rng(4).random(3000) > lost
    write_csv(tmp_path / "R" / "a.csv", {name: values[kept] for name, values in table.items()})
    assert {d.id for d in check(tmp_path / "R").doubts} == {"gaps"}


def test_the_command_draws_and_holds_against_an_earlier_result(
    calibrated: Path, tmp_path: Path, gyrotc: Command
) -> None:
    write_csv(tmp_path / "RLG-0042" / "a.csv", turned(three(5), "x -y z"))
    page = tmp_path / "check.html"
    command = ("check", tmp_path / "RLG-0042", "--axis", "all", "--previous", calibrated, "--plots", page)
    done = gyrotc(*command)
    assert done.returncode == 0, done.stderr
    assert "axis y stands with the other sign in the column of y" in done.stdout
    assert page.read_text("utf-8").count("<svg") >= 1
    page.write_text("mine")
    assert gyrotc(*command).returncode == 2
    assert page.read_text("utf-8") == "mine"
    (tmp_path / "RLG-0042").rename(tmp_path / "RLG-7")
    refused = gyrotc("check", tmp_path / "RLG-7", "--axis", "all", "--previous", calibrated)
    assert refused.returncode == 2
    assert "--previous: is of gyro RLG-0042" in refused.stderr
    nothing = gyrotc("check", tmp_path / "RLG-7", "--axis", "all", "--previous", tmp_path)
    assert nothing.returncode == 2
    assert "has no model.json" in nothing.stderr
