"""A data set after loading: numbers as written; every form that is accepted, every fault and damage that is refused."""

from __future__ import annotations

import contextlib
import hashlib
import json
import random
import weakref
from collections.abc import Callable, Sequence
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from drawn import examples
from gyrotc.common import InputError
from gyrotc.quality import check
from gyrotc.recordings import (
    EARTH_RATE_DPH,
    Applied,
    CsvFile,
    Layout,
    Problems,
    axes_of,
    earth_rate,
    known_rows,
    load,
    load_reporting,
)
from hypothesis import assume, given
from hypothesis import strategies as st
from recordings import ACCEPTED, ROWS, RUN, columns, columns_of_pulses, csv_text, described, toml, write_csv

Table = dict[str, np.ndarray]


def folder_of(tmp_path: Path, *runs: str, **parts: str) -> Path:
    described(tmp_path / "RLG-1", *runs, **parts)
    return tmp_path / "RLG-1"


# ---- reading ----


@st.composite
def tables(draw: st.DrawFn) -> Table:
    """Any table of numbers that a recording may hold, columns in any order."""
    n = draw(st.integers(10, 25))

    def values(low: float | None, high: float | None) -> np.ndarray:
        number = st.floats(low, high, allow_nan=False, allow_infinity=False)
        return np.array(draw(st.lists(number, min_size=n, max_size=n)))

    times = st.floats(-1e9, 1e9, allow_nan=False)
    time_s = np.array(sorted(draw(st.sets(times, min_size=n, max_size=n))))
    assume(np.median(np.diff(time_s)) > 1e-4)  # a shorter step is refused: no gyro is read that fast
    table = {
        "time_s": time_s,
        "temperature_c": values(-90.0, 200.0),
        "rate_dph": values(-7.5e6, 7.5e6),
        "supply_v": values(-1e100, 1e100),  # squares and sums of them stay within float64
    }
    return {name: table[name] for name in draw(st.permutations(list(table)))}


def as_csv(table: Table, number: str, line_end: str, mark: bytes, last: bool, cell: str) -> bytes:
    text = csv_text(table, number)
    head, *rows = text.splitlines()
    lines = [",".join(cell.format(c) for c in line.split(",")) for line in (head, *rows)]
    return mark + (line_end.join(lines) + (line_end if last else "")).encode()


FORMS = st.tuples(
    st.sampled_from(["{!r}", "{:.17g}", "{:+.17e}", "{:.16E}"]),
    st.sampled_from(["\n", "\r\n"]),
    st.sampled_from([b"", b"\xef\xbb\xbf"]),
    st.booleans(),
    st.sampled_from(["{}", " {} ", '"{}"', '\t"{}"']),
)


def check_same(folder: Path, table: Table) -> None:
    rows = load(folder).runs[0].rows()
    got = {"time_s": rows.time_s, "temperature_c": rows.temperature_c, "rate_dph": rows.rate_dph, **rows.channels}
    assert set(got) == set(table)
    for name, values in table.items():
        np.testing.assert_array_equal(got[name], values)


@examples(200)
@given(table=tables(), form=FORMS)
def test_csv_reads_back_equal_in_every_accepted_form(tmp_path: Path, table: Table, form: tuple) -> None:
    folder = tmp_path / "RLG-1"
    folder.mkdir(exist_ok=True)
    (folder / "a.csv").write_bytes(as_csv(table, *form))
    check_same(folder, table)


@examples(50)
@given(table=tables(), group=st.integers(1, 30), compression=st.sampled_from(["none", "snappy", "zstd"]))
def test_parquet_reads_back_equal(tmp_path: Path, table: Table, group: int, compression: str) -> None:
    folder = tmp_path / "RLG-1"
    folder.mkdir(exist_ok=True)
    pq.write_table(pa.table(table), folder / "a.parquet", row_group_size=group, compression=compression)
    check_same(folder, table)


def test_parquet_of_narrow_types(tmp_path: Path) -> None:
    folder = tmp_path / "RLG-1"
    folder.mkdir()
    table = columns()
    narrow = pa.table(
        {
            "time_s": pa.array(table["time_s"].astype(np.int32)),
            "temperature_c": pa.array(table["temperature_c"].astype(np.float32)),
            "rate_dph": pa.array(table["rate_dph"]),
        }
    )
    pq.write_table(narrow, folder / "a.parquet")
    table["temperature_c"] = table["temperature_c"].astype(np.float32).astype(np.float64)
    check_same(folder, table)


def test_hash_is_of_the_file(tmp_path: Path) -> None:
    run = load(folder_of(tmp_path)).runs[0]
    assert run.sha256 == hashlib.sha256(run.path.read_bytes()).hexdigest()


def test_unfinished_last_line_is_left_out_and_reported(tmp_path: Path) -> None:
    for torn in ("1200.0,20.0", "1200.0,20.0,", "1200.0,20.0,-", "1200.0,20.0,1e", "12"):
        write_csv(tmp_path / "RLG-1" / "a.csv")
        with (tmp_path / "RLG-1" / "a.csv").open("a") as file:
            file.write(torn)
        dataset = load(tmp_path / "RLG-1")
        assert len(dataset.runs[0].rows()) == ROWS
        assert any("unfinished" in w and repr(torn) in w for w in dataset.warnings)


def test_a_recording_that_grows_stays_as_it_was(tmp_path: Path) -> None:
    folder = folder_of(tmp_path)
    run = load(folder).runs[0]
    with run.path.open("a") as file:
        file.write("5000.0,20.0,20.0\n5010.0,20.0")
    assert len(run.rows()) == ROWS


def test_a_recording_that_was_changed_is_refused(tmp_path: Path) -> None:
    folder = folder_of(tmp_path)
    run = load(folder).runs[0]
    write_csv(run.path, columns(seed=2))
    with pytest.raises(InputError, match="was changed"):
        run.rows()


def test_a_small_file_is_read_once_and_nobody_writes_into_what_was_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[str] = []
    read = CsvFile.read

    def counted(file: CsvFile, names: Sequence[str]) -> dict[str, np.ndarray] | None:
        calls.append(file.name)
        return read(file, names)

    monkeypatch.setattr(CsvFile, "read", counted)
    run = load(folder_of(tmp_path)).runs[0]
    first, again = run.rows(), run.rows()
    assert len(calls) == 1 and np.array_equal(first.rate_dph, again.rate_dph)
    assert not again.temperature_c.flags.writeable


# ---- description ----


def test_spans_and_exclusions(tmp_path: Path) -> None:
    gap = 'exclude = [{from_s = 20.0, to_s = 40.0, reason = "door opened"}]'
    run = load(folder_of(tmp_path, f"{RUN}\nfrom_s = 10.0\nto_s = 60.0\n{gap}")).runs[0]
    time = np.arange(0.0, 100.0, 10.0)
    assert time[run.in_span(time)].tolist() == [10.0, 40.0, 50.0]
    assert run.exclude[0].reason == "door opened"
    assert len(run.rows()) == ROWS, "the front end needs the file from its first row on"


def test_touching_spans_share_no_row_and_lose_none(tmp_path: Path) -> None:
    runs = load(folder_of(tmp_path, f"{RUN}\nto_s = 55.0", f"{RUN}\nfrom_s = 55.0\nto_s = 9e9")).runs
    time = runs[0].rows().time_s
    assert (runs[0].in_span(time) ^ runs[1].in_span(time)).all()


def test_times_of_a_run(tmp_path: Path) -> None:
    stated = ["2026-03-01T08:00:00Z", "2026-03-01T09:00:00+01:00", '"2026-03-01T08:00:00Z"', "2026-03-01 08:00:00"]
    for index, text in enumerate(stated):
        run = load(folder_of(tmp_path / str(index), f"{RUN}\nstarted = {text}")).runs[0]
        assert run.started == datetime(2026, 3, 1, 8, tzinfo=timezone.utc)


def test_power_on(tmp_path: Path) -> None:
    described_runs = {"power_on_s = -3600": -3600.0, 'power_on_s = "unknown"': None, "": 0.0}
    for index, (text, power_on) in enumerate(described_runs.items()):
        assert load(folder_of(tmp_path / str(index), f"{RUN}\n{text}")).runs[0].power_on_s == power_on
    write_csv(tmp_path / "RLG-2" / "a.csv")
    assert load(tmp_path / "RLG-2").runs[0].power_on_s is None


def test_meta_is_carried_as_json(tmp_path: Path) -> None:
    tail = '[meta]\noperator = "A"\ncalibrated_on = 2026-03-01\nsteps = [1, 2.5]\n[meta.chamber]\nname = "K"'
    meta = load(folder_of(tmp_path, tail=tail)).meta
    assert json.loads(json.dumps(meta)) == {
        "operator": "A",
        "calibrated_on": "2026-03-01",
        "steps": [1, 2.5],
        "chamber": {"name": "K"},
    }


def test_without_description_all_files_are_training_runs_in_name_order(tmp_path: Path) -> None:
    for seed, name in enumerate(("b.csv", "a.csv", "C.CSV")):
        write_csv(tmp_path / "RLG_7.x" / name, columns(seed=seed))
    (tmp_path / "RLG_7.x" / "readme.txt").write_text("notes")
    dataset = load(tmp_path / "RLG_7.x")
    assert dataset.serial == "RLG_7.x"
    assert [run.file for run in dataset.runs] == ["C.CSV", "a.csv", "b.csv"]
    assert {run.role for run in dataset.runs} == {"train"}
    assert dataset.earth_rate is None


def test_only_exam_runs_where_they_will_do(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, f'{RUN}\nrole = "exam"')
    with pytest.raises(InputError, match="role train"):
        load(folder)
    assert load(folder, exam_only=True).runs[0].role == "exam"


def test_survey_tells_everything_that_is_wrong(tmp_path: Path) -> None:
    runs = ['file = "a.csv"\nrole = "test"', 'file = "b.csv"', 'file = "c.csv"\nrol = 1', 'file = "d.csv"']
    folder = tmp_path / "RLG-1"
    write_csv(folder / "a.csv")
    lines = csv_text(columns()).splitlines()
    lines[4] = "30.0,abc,20.0"
    lines[7] = "60.0,20.0"
    lines[20] = "10.0,20.0,9e9"
    (folder / "b.csv").write_text("\n".join(lines))
    write_csv(folder / "c.csv", {"time": np.arange(20.0), "temperature_c": np.arange(20.0)})
    text = toml(*runs, head='schema = 1\nserial = "A/B"\nserail = 2', tail="[noise]\narw = 1.0")
    (folder / "dataset.toml").write_text(text)
    problems = Problems(collect=True)
    dataset = load_reporting(folder, problems)
    reported = [str(problem) for problem in problems.found]
    expected = [
        "field serial: 'A/B'",
        "field serail: is not known",
        "field noise.arw: is not known",
        "run 1 (a.csv), field role: 'test'",
        "run 3 (c.csv), field rol: is not known",
        "b.csv, line 5, column temperature_c: 'abc'",
        "b.csv, line 8: 2 cells",
        "b.csv, line 21, column time_s: going back",
        "b.csv, line 21, column rate_dph: 9000000000",
        "c.csv, line 1: no column time_s",
        "c.csv, line 1: no column rate_dph",
        "d.csv: does not exist",
    ]
    for part in expected:
        assert any(part in text for text in reported), (part, reported)
    assert len(reported) == len(expected)
    assert dataset is not None
    assert [run.file for run in dataset.runs] == ["a.csv"]


# ---- rates ----


def test_pulses_become_the_mean_rate_since_the_last_row(tmp_path: Path) -> None:
    table = columns_of_pulses()
    table["time_s"] = table["time_s"] + np.where(np.arange(ROWS) > 50, 25.0, 0.0)
    write_csv(tmp_path / "RLG-1" / "a.csv", table)
    text = toml('file = "a.csv"', head='schema = 1\nserial = "A"\npulse_weight_arcsec = 0.25')
    (tmp_path / "RLG-1" / "dataset.toml").write_text(text)
    rows = load(tmp_path / "RLG-1").runs[0].rows()
    assert np.isnan(rows.rate_dph[0])
    # 1 arcsec/s is 1 deg/h
    np.testing.assert_allclose(rows.rate_dph[1:], 0.25 * table["pulses"][1:] / np.diff(table["time_s"]))
    angle = np.sum(rows.rate_dph[1:] * np.diff(rows.time_s))
    assert angle == pytest.approx(0.25 * table["pulses"][1:].sum())


@pytest.mark.parametrize("late_s", [25.0, -40.0])
def test_a_late_temperature_is_taken_back(tmp_path: Path, late_s: float) -> None:
    time = np.arange(0.0, 1000.0, 10.0)
    time = np.r_[time, time + 3000.0]  # with a gap of half an hour, across which nothing is made up

    def true_c(t: np.ndarray) -> np.ndarray:
        return 20.0 + 1e-3 * t

    table = {"time_s": time, "temperature_c": true_c(time - late_s), "rate_dph": np.sin(time)}
    write_csv(tmp_path / "RLG-1" / "a.csv", table)
    text = toml('file = "a.csv"', head=f'schema = 1\nserial = "A"\ntemperature_late_s = {late_s}')
    (tmp_path / "RLG-1" / "dataset.toml").write_text(text)
    dataset = load(tmp_path / "RLG-1")
    rows = dataset.runs[0].rows()
    np.testing.assert_allclose(rows.temperature_c, true_c(rows.time_s), atol=1e-9)
    np.testing.assert_allclose(rows.rate_dph, np.sin(rows.time_s), atol=1e-9)
    lost = 2 * np.ceil(abs(late_s) / 10.0)
    assert time.size - lost - 2 <= rows.time_s.size <= time.size - lost
    assert any("temperature_late_s" in warning for warning in dataset.warnings)


def test_axis_chooses_its_column(tmp_path: Path) -> None:
    base = columns()
    table = {"time_s": base["time_s"], "temperature_c": base["temperature_c"], "supply_v": base["time_s"]}
    for index, axis in enumerate("xyz"):
        table[f"rate_{axis}_dph"] = base["rate_dph"] + index
    write_csv(tmp_path / "IMU" / "a.csv", table)
    assert axes_of(tmp_path / "IMU") == ("x", "y", "z")
    for axis in "xyz":
        dataset = load(tmp_path / "IMU", axis=axis)
        rows = dataset.runs[0].rows()
        np.testing.assert_array_equal(rows.rate_dph, table[f"rate_{axis}_dph"])
        assert list(rows.channels) == ["supply_v"], "the other axes are no channels"
        assert dataset.axis == axis
    with pytest.raises(InputError, match=r"--axis x\|y\|z\|all"):
        load(tmp_path / "IMU")
    with pytest.raises(InputError, match="no rate of the axis w"):
        load(tmp_path / "IMU", axis="w")


def test_axis_where_there_is_one_rate_is_refused(tmp_path: Path) -> None:
    folder = folder_of(tmp_path)
    assert axes_of(folder) == ()
    with pytest.raises(InputError, match="no --axis"):
        load(folder, axis="x")


def test_earth_rate_of_known_directions() -> None:
    def rate(latitude: float, azimuth: float, elevation: float) -> float:
        sigmas = {"latitude_sigma_deg": 0.0, "axis_sigma_deg": 0.0}
        return earth_rate(latitude, azimuth, elevation, **sigmas).rate_dph

    assert rate(90.0, 12.0, 90.0) == pytest.approx(EARTH_RATE_DPH)
    assert rate(0.0, 0.0, 0.0) == pytest.approx(EARTH_RATE_DPH)
    assert rate(0.0, 180.0, 0.0) == pytest.approx(-EARTH_RATE_DPH)
    assert rate(48.0, 90.0, 0.0) == pytest.approx(0.0, abs=1e-12)
    assert rate(-30.0, 0.0, 90.0) == pytest.approx(-EARTH_RATE_DPH / 2.0)


def test_uncertainty_of_earth_rate_agrees_with_drawn_directions() -> None:
    rng = np.random.default_rng(20260301)
    latitude, azimuth, elevation, sigma = 48.0, 30.0, 20.0, 0.5
    exact = {"latitude_sigma_deg": 0.0, "axis_sigma_deg": 0.0}
    drawn = []
    for _ in range(4000):
        a, b, c = rng.normal(0.0, sigma, 3)
        drawn.append(
            earth_rate(latitude + a, azimuth + b / np.cos(np.radians(elevation)), elevation + c, **exact).rate_dph
        )
    stated = earth_rate(latitude, azimuth, elevation, latitude_sigma_deg=sigma, axis_sigma_deg=sigma)
    assert stated.sigma_dph == pytest.approx(np.std(drawn), rel=0.1), "seed 20260301"


def test_computed_earth_rate_is_taken_off(tmp_path: Path) -> None:
    run = f"{RUN}\naxis_azimuth_deg = 0.0\naxis_elevation_deg = 90.0"
    head = 'schema = 1\nserial = "A"\nearth_rate = "compute"\nlatitude_deg = 30.0'
    one = load(folder_of(tmp_path, run, head=head)).runs[0]
    assert one.earth is not None
    assert one.earth.rate_dph == pytest.approx(EARTH_RATE_DPH / 2.0)
    np.testing.assert_allclose(one.rows().rate_dph, columns()["rate_dph"] - EARTH_RATE_DPH / 2.0)


def test_computed_earth_rate_wants_an_angle_for_each_axis(tmp_path: Path) -> None:
    base = columns()
    table = {"time_s": base["time_s"], "temperature_c": base["temperature_c"], "rate_z_dph": base["rate_dph"]}
    head = 'schema = 1\nserial = "A"\nearth_rate = "compute"\nlatitude_deg = 90.0'
    for angles, fits in (("{x = 0.0, z = 0.0}", True), ("{x = 0.0}", False), ("0.0", False)):
        write_csv(tmp_path / "IMU" / "a.csv", table)
        run = f'file = "a.csv"\naxis_azimuth_deg = {angles}\naxis_elevation_deg = {{z = 90.0}}'
        (tmp_path / "IMU" / "dataset.toml").write_text(toml(run, head=head))
        if fits:
            earth = load(tmp_path / "IMU", axis="z").runs[0].earth
            assert earth is not None
            assert earth.rate_dph == pytest.approx(EARTH_RATE_DPH)
        else:
            with pytest.raises(InputError, match=r"field axis_azimuth_deg.*\{x = \.\.\., y"):
                load(tmp_path / "IMU", axis="z")


def test_the_correction_that_was_applied_is_added_back(tmp_path: Path) -> None:
    stated = "ab" * 32
    folder = folder_of(tmp_path, head=f'schema = 1\nserial = "A"\napplied_table = "{stated}"')
    applied = Applied(stated, lambda rows, period: 0.5 * rows.temperature_c + period)
    rows = load(folder, applied=applied).runs[0].rows()
    expected = columns()["rate_dph"] + 0.5 * columns()["temperature_c"] + 10.0
    np.testing.assert_allclose(rows.rate_dph, expected)
    with pytest.raises(InputError, match="the hash of that model"):
        load(folder, applied=Applied("cd" * 32, applied.correction_dph))
    with pytest.raises(InputError, match="'none', and applied_model has"):
        load(folder_of(tmp_path / "plain"), applied=applied)


def test_a_channel_that_not_every_run_has_is_left_out_and_reported(tmp_path: Path) -> None:
    folder = tmp_path / "RLG-1"
    extra = {"supply_v": np.linspace(5.0, 5.1, ROWS), "pressure_hpa": np.linspace(990.0, 991.0, ROWS)}
    write_csv(folder / "a.csv", columns() | extra)
    write_csv(folder / "b.csv", columns() | {"pressure_hpa": extra["pressure_hpa"]})
    dataset = load(folder)
    assert dataset.channels == ("pressure_hpa",)
    assert all(list(run.rows().channels) == ["pressure_hpa"] for run in dataset.runs)
    assert any("supply_v is left out: b.csv" in warning for warning in dataset.warnings)


# ---- size ----


@pytest.mark.parametrize("case", ACCEPTED)
def test_accepted(case: str, tmp_path: Path) -> None:
    folder = tmp_path / "RLG-1"
    ACCEPTED[case](folder)
    dataset = load(folder)
    for run in dataset.runs:
        assert len(run.rows()) == run.n_rows == ROWS
        assert run.in_span(run.rows().time_s).any()


TRIALS = 150


def _flip(data: bytearray, draw: random.Random) -> None:
    data[draw.randrange(len(data))] = draw.randrange(256)


def _cut(data: bytearray, draw: random.Random) -> None:
    del data[draw.randrange(len(data)) :]


def _drop(data: bytearray, draw: random.Random) -> None:
    start = draw.randrange(len(data))
    del data[start : start + draw.randrange(1, 40)]


def _double(data: bytearray, draw: random.Random) -> None:
    start = draw.randrange(len(data))
    data[start:start] = data[start : start + draw.randrange(1, 40)]


def _insert(data: bytearray, draw: random.Random) -> None:
    word = draw.choice([b",", b"\n", b'"', b"\x00", b"1e999", b"nan", b"[[", b"=", b"\xff", b"-", b"\r", b"{}"])
    at = draw.randrange(len(data))
    data[at:at] = word


DAMAGE: tuple[Callable[[bytearray, random.Random], None], ...] = (_flip, _cut, _drop, _double, _insert)


@pytest.mark.parametrize(
    ("case", "name"),
    [("no dataset.toml", "a.csv"), ("Parquet", "a.parquet"), ("several runs", "dataset.toml"), ("pulses", "a.csv")],
)
def test_damaged_files_are_read_or_refused(case: str, name: str, tmp_path: Path) -> None:
    draw = random.Random(1)
    folder = tmp_path / "RLG-1"
    ACCEPTED[case](folder)
    whole = (folder / name).read_bytes()
    refused = 0
    for _ in range(TRIALS):
        data = bytearray(whole)
        for _ in range(draw.randint(1, 3)):
            if data:
                draw.choice(DAMAGE)(data, draw)
        (folder / name).write_bytes(data)
        try:
            for run in load(folder).runs:
                run.rows()
        except InputError as problem:
            refused += 1
            assert str(problem)
            assert check(folder).problems, "check tells what fit refuses"
        else:
            assert not check(folder).problems
    assert refused > TRIALS // 10


def test_a_damaged_description_of_parquet_never_ends_the_process(tmp_path: Path) -> None:
    """Descriptions of columns that contradict each other made pyarrow abort when it was asked for one of them."""
    folder, draw = tmp_path / "RLG-1", random.Random(1)
    ACCEPTED["Parquet"](folder)
    path = folder / "a.parquet"
    whole = path.read_bytes()
    footer = len(whole) - 8 - int.from_bytes(whole[-8:-4], "little")
    for _ in range(200):
        data = bytearray(whole)
        for _ in range(draw.randint(1, 3)):
            data[draw.randrange(footer, len(data) - 8)] = draw.randrange(256)
        path.write_bytes(data)
        with contextlib.suppress(InputError):
            load(folder)


def test_rows_without_a_temperature_are_left_out_column_by_column() -> None:
    """Of a long recording all columns were held twice."""

    class Columns(dict[str, np.ndarray]):
        def __setitem__(self, name: str, values: np.ndarray) -> None:
            was = weakref.ref(self[name])
            super().__setitem__(name, values)
            assert was() is None, f"{name} is still held as it was"

    names = ("time_s", "temperature_c", "rate_dph")
    columns = Columns({name: np.arange(6.0) + k for k, name in enumerate(names)})
    dict.__getitem__(columns, "temperature_c")[[1, 4]] = np.nan
    layout = Layout("time_s", "temperature_c", "rate_dph", pulses=False, axes={}, channels=())
    found = known_rows(columns, layout, ())
    assert found is columns
    assert [list(found[name]) for name in names] == [[0, 2, 3, 5], [1, 3, 4, 6], [2, 4, 5, 7]]
