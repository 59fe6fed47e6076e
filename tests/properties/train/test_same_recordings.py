"""What changes a model, and what does not: a constant in the rate, the clock, units, the order of files and of runs."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from conftest import HOST, run_gyrotc
from drawn import examples
from gyrotc.model import Model, load_model
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from recordings import Columns, state_fit
from small_gyro import HEAD, small_gyro, write_gyro

METHODS = ["auto", "constant", "cubic", "cubic_slope", "mrbf"]
Grid = NDArray[np.float64]
# The maps of two fits of the same numbers, rounded otherwise, may differ by this, deg/h: a thousandth of the noise.
ROUNDING_DPH = 1e-6


@dataclass(frozen=True)
class Calibration:
    """A model, what `training.json` says of it, and the map over the envelope."""

    model: Model
    training: dict[str, Any]

    def map_dph(self, t: Grid, slope: Grid) -> Grid:
        return np.asarray(self.model.map_dph(t, slope))


def fitted(folder: Path, out: Path, method: str = "auto") -> Calibration:
    done = run_gyrotc("fit", state_fit(folder, method=method) if method != "auto" else folder, "--out", out)
    assert done.returncode == 0, done.stderr
    return Calibration(load_model(out / "model.json"), json.loads((out / "training.json").read_text()))


def assert_same(one: Calibration, other: Calibration, shift_dph: float = 0.0) -> None:
    """Compare the maps all over the envelope, but for a shift, the envelope, coverage, noise floor and uncertainty."""
    a, b = one.model, other.model
    assert (a.method, len(a.networks), a.terms) == (b.method, len(b.networks), b.terms)
    assert a.envelope.temperature_c == pytest.approx(b.envelope.temperature_c, abs=1e-4)
    assert a.envelope.slope_c_per_min == pytest.approx(b.envelope.slope_c_per_min, abs=1e-4)
    assert a.coverage == b.coverage
    t, slope = np.meshgrid(np.linspace(*a.envelope.temperature_c, 40), np.linspace(*a.envelope.slope_c_per_min, 20))
    np.testing.assert_allclose(other.map_dph(t, slope), one.map_dph(t, slope) + shift_dph, atol=ROUNDING_DPH, rtol=0.0)
    assert b.fallback_dph == pytest.approx(a.fallback_dph + shift_dph, abs=ROUNDING_DPH)
    assert b.noise_floor_dph == pytest.approx(a.noise_floor_dph, rel=1e-3)
    assert (a.uncertainty_dph is None) == (b.uncertainty_dph is None)
    if a.uncertainty_dph and b.uncertainty_dph:
        np.testing.assert_allclose(b.uncertainty_dph.rows, a.uncertainty_dph.rows, rtol=1e-2)
    assert one.training["generalises"] == other.training["generalises"]


def shifted(runs: dict[str, Columns], column: str, by: float) -> dict[str, Columns]:
    return {name: columns | {column: columns[column] + by} for name, columns in runs.items()}


@examples(8, shrink=False)
@given(
    method=st.sampled_from(METHODS),
    seed=st.integers(0, 5),
    constant_dph=st.floats(-20.0, 20.0).filter(lambda x: abs(x) > 1e-3),
)
def test_a_constant_added_to_the_rate_moves_only_the_constant(method: str, seed: int, constant_dph: float) -> None:
    with TemporaryDirectory() as place:
        folder, runs = Path(place), small_gyro(seed=seed)
        one = fitted(write_gyro(folder / "one", runs), folder / "a", method)
        other = fitted(write_gyro(folder / "other", shifted(runs, "rate_dph", constant_dph)), folder / "b", method)
        assert_same(one, other, constant_dph)


@examples(2, shrink=False)
@given(seed=st.integers(0, 5), constant_dph=st.floats(-4.0, 4.0).filter(lambda x: abs(x) > 1e-3))
def test_a_constant_added_to_the_rate_leaves_what_is_measured_after_correction(seed: int, constant_dph: float) -> None:
    """In `evaluate.json` of a build, but for the rounding of the table: a float32 has steps of 5e-7 at 4 deg/h."""
    figures = []
    with TemporaryDirectory() as place:
        runs = small_gyro(seed=seed)
        for k, by in enumerate((0.0, constant_dph)):
            data = write_gyro(Path(place) / f"d{k}", shifted(runs, "rate_dph", by), "", "", 'role = "exam"')
            out = Path(place) / f"r{k}"
            done = run_gyrotc("build", state_fit(data, method="cubic_slope"), "--out", out, *HOST)
            assert done.returncode == 0, done.stderr
            figures.append(json.loads((out / "evaluate.json").read_text()))
    for role in ("train", "exam"):
        one, other = (evaluation[role]["after"] for evaluation in figures)
        assert other == pytest.approx(one, abs=1e-5)
        before = [evaluation[role]["before"]["mean_dph"] for evaluation in figures]
        assert before[1] - before[0] == pytest.approx(constant_dph, abs=1e-9)


@examples(6, shrink=False)
@given(seed=st.integers(0, 5), order=st.permutations(range(3)), exam=st.booleans())
def test_the_order_of_runs_and_the_names_of_files_change_nothing(seed: int, order: list[int], exam: bool) -> None:
    """With a description that lists the runs in any order, and without one, where the names order them."""
    runs = list(small_gyro(seed=seed).items())
    role = ['role = "exam"' if exam and k == 2 else "" for k in range(3)]
    with TemporaryDirectory() as place:
        folder = Path(place)
        one = fitted(write_gyro(folder / "one", dict(runs), *role), folder / "a")
        other = fitted(
            write_gyro(folder / "other", dict(runs[k] for k in order), *(role[k] for k in order)), folder / "b"
        )
        assert_same(one, other)
        if not exam:
            renamed = {f"{k}.csv": runs[place][1] for k, place in enumerate(order)}
            write_gyro(folder / "named", renamed)
            (folder / "named" / "dataset.toml").unlink()
            assert_same(one, fitted(folder / "named", folder / "c"))


@examples(6, shrink=False)
@given(
    seed=st.integers(0, 5),
    offset_s=st.integers(-(10**7), 10**7).map(lambda k: k / 4.0),
    power_on_s=st.none() | st.integers(-1000, 0).map(float),
)
def test_an_offset_of_the_clock_changes_nothing(seed: int, offset_s: float, power_on_s: float | None) -> None:
    """Where the description moves the power-on by as much, or says that it is unknown."""
    runs = small_gyro(seed=seed)
    models = []
    with TemporaryDirectory() as place:
        for k, by in enumerate((0.0, offset_s)):
            line = 'power_on_s = "unknown"' if power_on_s is None else f"power_on_s = {power_on_s + by!r}"
            folder = write_gyro(Path(place) / f"d{k}", shifted(runs, "time_s", by), *[line] * 3)
            models.append(fitted(folder, Path(place) / f"r{k}"))
    assert_same(*models)


# A unit of a column, and what gyrotc's own numbers are in it: factor and offset.
RATES = {"deg/s": 1.0 / 3600.0, "rad/s": np.pi / 180.0 / 3600.0, "mdeg/s": 1.0 / 3.6, "arcsec/s": 1.0, "deg/h": 1.0}
TEMPERATURES = {"degC": (1.0, 0.0), "K": (1.0, 273.15), "degF": (1.8, 32.0), "mK": (1000.0, 273150.0)}
TIMES = {"s": 1.0, "ms": 1000.0, "min": 1.0 / 60.0, "h": 1.0 / 3600.0, "0.01 s": 100.0}


@examples(6, shrink=False)
@given(
    seed=st.integers(0, 5),
    rate=st.sampled_from(sorted(RATES)),
    temperature=st.sampled_from(sorted(TEMPERATURES)),
    time=st.sampled_from(sorted(TIMES)),
)
def test_units_that_are_stated_change_nothing(seed: int, rate: str, temperature: str, time: str) -> None:
    """In the description, or by options of import."""
    runs = small_gyro(seed=seed)
    factor, offset = TEMPERATURES[temperature]
    other_units = {
        name: {
            "time_s": columns["time_s"] * TIMES[time],
            "temperature_c": columns["temperature_c"] * factor + offset,
            "rate_dph": columns["rate_dph"] * RATES[rate],
        }
        for name, columns in runs.items()
    }
    stated = f'[units]\nrate = "{rate}"\ntemperature = "{temperature}"\ntime = "{time}"'
    with TemporaryDirectory() as place:
        folder = Path(place)
        one = fitted(write_gyro(folder / "one", runs), folder / "a")
        described = write_gyro(folder / "described", other_units, head=f"{HEAD}\ntrust_units = true", tail=stated)
        assert_same(one, fitted(described, folder / "b"))
        options = ("--rate-unit", rate, "--temperature-unit", temperature, "--time-unit", time, "--trust-units")
        files = [described / name for name in runs]
        done = run_gyrotc("import", *files, "--out", folder / "imported", "--serial", "RLG-1", *options, "--no-exam")
        assert done.returncode == 0, done.stderr
        assert_same(one, fitted(folder / "imported", folder / "c"))
