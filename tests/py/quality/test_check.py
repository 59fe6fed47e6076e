"""`check` tells all problems and doubts; each doubt follows from a property of the data and from nothing else."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from gyrotc.common.errors import InputError
from gyrotc.quality.check import CheckResult, check, envelope_of
from recordings import ROWS, RUN, Columns, columns, described, toml, write_csv


def checked(folder: Path, table: Mapping[str, np.ndarray] | None = None) -> CheckResult:
    write_csv(folder / "run-01.csv", table)
    (folder / "dataset.toml").write_text(toml(RUN), "utf-8")
    return check(folder)


def ids(result: CheckResult) -> set[str]:
    return {doubt.id for doubt in result.doubts}


def long(n: int = 600) -> Columns:
    return columns(n)


def test_a_plain_recording_is_without_doubt(tmp_path: Path) -> None:
    result = checked(tmp_path / "RLG-1", long())
    assert result.problems == ()
    assert result.doubts == ()


def _jump(c: Columns) -> Columns:
    moved = c["temperature_c"] + np.where(np.arange(len(c["time_s"])) >= 300, 4.0, 0.0)
    return c | {"temperature_c": moved}


def _spike(c: Columns) -> Columns:
    rate = c["rate_dph"].copy()
    rate[50] += 1.0
    return c | {"rate_dph": rate}


def _stuck(c: Columns) -> Columns:
    rate = c["rate_dph"].copy()
    rate[50:100] = rate[50]
    return c | {"rate_dph": rate}


def _gap(c: Columns) -> Columns:
    return {name: np.delete(values, np.arange(50, 70)) for name, values in c.items()}


def _clock_set(c: Columns) -> Columns:
    return c | {"time_s": c["time_s"] + np.where(np.arange(len(c["time_s"])) >= 50, 3600.0, 0.0)}


def _slower(c: Columns) -> Columns:
    """The logger's clock loses two per cent in the second half."""
    n = len(c["time_s"])
    return c | {"time_s": np.cumsum(np.where(np.arange(n) < n // 2, 10.0, 9.8)) - 10.0}


def _whole_seconds(c: Columns) -> Columns:
    """Rows of 1.4 s stamped in whole seconds."""
    return c | {"time_s": np.floor(np.arange(len(c["time_s"])) * 1.4)}


def _few_bits(c: Columns) -> Columns:
    return c | {"rate_dph": np.round(c["rate_dph"] / 0.01 + 0.3) * 0.01}


def _holds(c: Columns) -> Columns:
    noise = np.random.default_rng(4).normal(0.0, 0.005, len(c["time_s"]))
    return c | {"temperature_c": 20.0 + np.clip(np.arange(len(c["time_s"])), 0, 60) + noise}


DOUBTS: dict[str, Callable[[Columns], Mapping[str, np.ndarray]]] = {
    "coarse_temperature": lambda c: c | {"temperature_c": np.round(c["temperature_c"])},
    "jump_in_temperature": _jump,
    "constant_channel": lambda c: c | {"supply_v": np.full(len(c["time_s"]), 5.0)},
    "no_temperature_information": lambda c: c | {"temperature_c": 20.0 + 0.01 * c["temperature_c"]},
    "mostly_holds": _holds,
    "rate_outliers": _spike,
    "stuck_rate": _stuck,
    "gaps": _gap,
    "time_jumps": _clock_set,
    "time_drifts": _slower,
    "coarse_time": _whole_seconds,
    "coarse_rate": _few_bits,
    "time_since_epoch": lambda c: c | {"time_s": c["time_s"] + 1.7e9},
    "small_rates": lambda c: c | {"rate_dph": c["rate_dph"] / 3600.0**2},
}


@pytest.mark.parametrize("doubt", DOUBTS)
def test_each_doubt_has_its_cause(doubt: str, tmp_path: Path) -> None:
    result = checked(tmp_path / "RLG-1", DOUBTS[doubt](long()))
    assert result.problems == ()
    assert ids(result) == {doubt}


def test_whole_degrees_are_called_so(tmp_path: Path) -> None:
    result = checked(tmp_path / "RLG-1", DOUBTS["coarse_temperature"](long()))
    assert "whole degrees" in result.doubts[0].text


def test_gaps_are_counted_with_their_rows(tmp_path: Path) -> None:
    result = checked(tmp_path / "RLG-1", _gap(long()))
    assert "1 gaps; 20 rows of 10 s are missing" in result.doubts[0].text


def test_earth_rate_that_is_not_stated(tmp_path: Path) -> None:
    table = long() | {"rate_dph": long()["rate_dph"] - 10.0}
    write_csv(tmp_path / "RLG-1" / "a.csv", table)
    assert ids(check(tmp_path / "RLG-1")) == {"earth_rate_not_stated"}
    described(tmp_path / "RLG-2", head='schema = 1\nserial = "A"\nearth_rate = "none"')
    write_csv(tmp_path / "RLG-2" / "run-01.csv", table)
    assert ids(check(tmp_path / "RLG-2")) == set()


def test_the_computed_earth_term_is_printed_with_its_uncertainty(tmp_path: Path) -> None:
    run = f"{RUN}\naxis_azimuth_deg = 0.0\naxis_elevation_deg = 90.0"
    described(
        tmp_path / "R", run, head='schema = 1\nserial = "A"\nearth_rate = "compute"\nlatitude_deg = 30.0'
    )
    result = check(tmp_path / "R")
    assert any("Earth's rate 7.5205 +- 0.0228 deg/h off" in line for line in result.lines())
    assert result.result().runs[0].earth_rate_dph == pytest.approx(7.5205, abs=1e-4)


def test_the_same_bytes_under_two_names(tmp_path: Path) -> None:
    write_csv(tmp_path / "RLG-1" / "a.csv", long())
    write_csv(tmp_path / "RLG-1" / "b.csv", long())
    assert "same_recording_twice" in ids(check(tmp_path / "RLG-1"))


def test_row_periods_that_differ(tmp_path: Path) -> None:
    write_csv(tmp_path / "RLG-1" / "a.csv", long())
    write_csv(tmp_path / "RLG-1" / "b.csv", long() | {"time_s": 2.0 * long()["time_s"]})
    assert "row_periods_differ" in ids(check(tmp_path / "RLG-1"))


def test_coverage_of_a_requested_envelope(tmp_path: Path) -> None:
    folder = tmp_path / "RLG-1"
    checked(folder, long())
    wide = check(folder, envelope=((-40.0, 60.0), (-5.0, 5.0)))
    assert {"envelope_not_reached", "envelope_coverage"} == ids(wide)
    texts = [d.text for d in wide.doubts]
    assert any(t.startswith("temperature covers 20.") and "-40 ... 60 C" in t for t in texts)
    assert any(t.startswith("temperature rate covers") and "-5 ... 5 C/min" in t for t in texts)
    near = check(folder, envelope=((20.5, 49.5), (-0.55, 0.55)))
    assert "envelope_not_reached" not in ids(near)


def test_an_envelope_on_the_command_line() -> None:
    assert envelope_of("-40:60,-5:5") == ((-40.0, 60.0), (-5.0, 5.0))
    for text in ("", "-40:60", "60:-40,-5:5", "a:b,c:d", "nan:1,2:3", "1:2,3:4,5:6"):
        with pytest.raises(InputError, match="T0:T1,R0:R1"):
            envelope_of(text)


def test_a_recording_that_still_grows(tmp_path: Path) -> None:
    folder = tmp_path / "RLG-1"
    checked(folder, long())
    with (folder / "run-01.csv").open("a") as file:
        file.write("6000.0,20.0")
    result = check(folder)
    assert result.problems == ()
    assert ids(result) == {"left_out"}
    assert "unfinished" in str(result.doubts[0])


def test_problems_and_doubts_come_together(tmp_path: Path) -> None:
    folder = tmp_path / "RLG-1"
    write_csv(folder / "good.csv", DOUBTS["coarse_temperature"](long()))
    write_csv(folder / "kelvin.csv", long() | {"temperature_c": long()["temperature_c"] + 273.15})
    write_csv(folder / "short.csv", columns(5))
    result = check(folder)
    assert {p.where.split(",")[0] for p in result.problems} == {"kelvin.csv", "short.csv"}
    assert "coarse_temperature" in ids(result)


def test_all_axes_tell_a_common_doubt_once(tmp_path: Path) -> None:
    base = long()
    table = {"time_s": base["time_s"], "temperature_c": np.round(base["temperature_c"])}
    table |= {f"rate_{axis}_dph": base["rate_dph"] + k for k, axis in enumerate("xyz")}
    table["rate_y_dph"] = _spike(base | {"rate_dph": table["rate_y_dph"]})["rate_dph"]
    write_csv(tmp_path / "IMU" / "a.csv", table)
    told = [str(d) for d in check(tmp_path / "IMU", axis="all").doubts]
    assert sum("whole degrees" in t for t in told) == 1
    [outlier] = [t for t in told if "those around them" in t]
    assert outlier.startswith("a.csv, axis y: 1 rows of a.csv depart from those around them, most at ")


def test_the_result_is_json(tmp_path: Path) -> None:
    result = checked(tmp_path / "RLG-1", long()).result().content()
    assert json.loads(json.dumps(result, allow_nan=False))["schema"] == "gyrotc.check/1"
    assert result["serial"] == "RLG-0042"
    assert result["runs"][0]["rows"] == 600


def test_nothing_is_written(tmp_path: Path) -> None:
    folder = tmp_path / "RLG-1"
    checked(folder)
    before = {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*")}
    check(folder)
    assert {p: p.stat().st_mtime_ns for p in tmp_path.rglob("*")} == before
    assert len(before) == 3
    assert ROWS == 120
