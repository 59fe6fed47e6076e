"""The API of Python: what people see of it, and that it does what the commands do."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import gyrotc
import numpy as np
import pytest
from conftest import HOST, run_gyrotc
from gyrotc.common.errors import InputError
from gyrotc.model import load_model
from recordings import columns, write_csv

pd = pytest.importorskip("pandas")


def frame(seed: int) -> pd.DataFrame:
    rows = columns(720, seed=seed)
    return pd.DataFrame(
        {"t [s]": rows["time_s"], "T [K]": rows["temperature_c"] + 273.15, "gyro": (rows["rate_dph"] - 20.0) / 3600.0}
    )


def test_a_frame_gives_the_rows_that_it_holds() -> None:
    runs = {"warm": frame(1), "cold": frame(2)}
    data = gyrotc.Dataset.from_pandas(runs, rate_unit="deg/s", serial="RLG-1", exam="warm")
    assert [(run.file, run.role) for run in data.runs] == [("cold.parquet", "train"), ("warm.parquet", "exam")]
    np.testing.assert_allclose(data.runs[0].rows().rate_dph, runs["cold"]["gyro"] * 3600.0, rtol=1e-12)
    np.testing.assert_allclose(data.runs[0].rows().temperature_c, runs["cold"]["T [K]"] - 273.15, atol=1e-9)
    assert repr(data) == "Dataset(RLG-1: 2 runs, 1 of them exams, 1440 rows)"
    assert data._repr_html_().count("<tr>") == 3
    folder = data.folder
    del data
    assert not folder.exists(), "a data set of memory leaves nothing behind"


def test_names_of_runs_are_no_paths(tmp_path: Path) -> None:
    runs = {"../../evil": frame(1), "b": frame(2)}
    data = gyrotc.Dataset.from_pandas(runs, rate_unit="deg/s", folder=tmp_path / "in" / "R")
    assert len(data.runs) == 2 and [p.name for p in tmp_path.iterdir()] == ["in"]


def test_an_index_of_times_is_the_time(tmp_path: Path) -> None:
    stamped = frame(1)
    stamped.index = pd.Timestamp("2026-03-01T08:00Z") + pd.to_timedelta(stamped.pop("t [s]"), unit="s")
    data = gyrotc.Dataset.from_pandas(stamped, rate_unit="deg/s", folder=tmp_path / "RLG-1")
    assert str(data.runs[0].started) == "2026-03-01 08:00:00+00:00" and data.runs[0].n_rows == 720
    assert (tmp_path / "RLG-1" / "dataset.toml").is_file()


def test_units_and_columns_are_not_guessed() -> None:
    with pytest.raises(InputError, match="temperature"):
        gyrotc.Dataset.from_pandas(frame(1).rename(columns={"T [K]": "x"}), rate_unit="deg/s")
    with pytest.raises(InputError, match="exam"):
        gyrotc.Dataset.from_pandas({"a": frame(1)}, rate_unit="deg/s", exam="a")
    with pytest.raises(InputError, match="unit"):
        gyrotc.Dataset.from_pandas(frame(1), rate_unit="furlong")


@pytest.mark.slow
def test_build_gives_what_the_command_gives(tmp_path: Path) -> None:
    rows = columns(720)
    write_csv(tmp_path / "RLG-1" / "run-01.csv", rows | {"rate_dph": rows["rate_dph"] - 20.0})
    run_gyrotc("build", *HOST, tmp_path / "RLG-1", "--out", tmp_path / "command")
    data = gyrotc.load(tmp_path / "RLG-1")
    result = gyrotc.build(data, numerics=["f32"], targets=["host-gcc-O2"])
    assert result.model == load_model(tmp_path / "command" / "model.json")
    assert (result.folder / "report.html").is_file() and len(repr(result)) < 300
    found = result.to_xarray((5, 3))
    assert found.bias.shape == (5, 3) and found.bias.attrs["units"] == "deg/h"
    t, r = float(found.temperature[1]), float(found.slope[2])
    np.testing.assert_allclose(float(found.bias[1, 2]), result.model.map_dph(t, r))
    assert result.plot()._repr_html_().count("<svg") == 4
    folder = result.folder
    del result
    assert not folder.exists()


def test_the_names_come_on_first_use_and_a_missing_library_is_named() -> None:
    script = (
        "import sys; sys.modules['sklearn'] = None\n"
        "import gyrotc; assert 'numpy' not in sys.modules; print(sorted(gyrotc.__all__))\n"
        "try: gyrotc.RBFNetworkRegressor\n"
        "except ModuleNotFoundError as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert 'pip install "gyrotc[sklearn]"' in done.stdout
