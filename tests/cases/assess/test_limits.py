"""Limits and guards of a product: each can be met and missed, and is refused where it is wrong."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from conftest import HOST, Command
from gyrotc.assess import AtLeast, AtMost, guarded, held_against, load_limits
from gyrotc.common import InputError
from gyrotc.mirror import CHANNEL_LOST, CLAMPED, FALLBACK, HELD, replay
from gyrotc.model import Guard, Model, Term
from gyrotc.results import (
    EvaluatedRun,
    Evaluation,
    Finding,
    MapError,
    ModelSizes,
    Pooled,
    RunStatistics,
    Statistics,
    Verification,
    VerifiedTarget,
    WorstError,
)
from gyrotc.tables import emit_texts, quantise, quantise_all
from models import random_model
from recordings import columns, described, write_csv

_NOTHING = dict.fromkeys(("mean_dph", "std_dph", "rms_dph", "max_abs_dph"))


def run_of(role: Literal["train", "exam"], half_hour: float, angle: float | None, first: float) -> EvaluatedRun:
    after = RunStatistics(**_NOTHING, rms_30min_dph=half_hour, angle_1h_arcsec=angle, first_10min_rms_dph=first)
    return EvaluatedRun(
        file="a.csv", role=role, environment=None, samples=1, before=Statistics(**_NOTHING), constant=after,
        after=after,
    )  # fmt: skip


EVALUATION = Evaluation(
    gyrotc_version="0.1.0",
    serial="RLG-0042",
    axis=None,
    numeric="f32",
    block_s=10.0,
    average_s=100.0,
    noise_floor_dph=0.001,
    noise_floor_source="estimated",
    constant_dph=0.007,
    mismatches=0,
    requirements=(),
    rows_left_out=10,
    runs=(
        run_of("exam", 0.0002, 0.5, 0.001),
        run_of("exam", 0.0003, None, 0.002),
        run_of("train", 9.0, 9.0, 9.0),
    ),
    train=None,
    exam=Pooled(
        before=Statistics(**_NOTHING),
        constant=Statistics(rms_dph=0.011, std_dph=0.01, mean_dph=-0.004, max_abs_dph=0.04),
        after=Statistics(rms_dph=0.0011, std_dph=0.001, mean_dph=-0.0004, max_abs_dph=0.004),
        improvement=10.0,
        improvement_about_zero=12.0,
        samples=2,
    ),
    findings=(Finding(id="run_outlier", text="", evidence={}),),
    model=ModelSizes(
        method="mrbf", centers=4, table_bytes=104, rom_bytes=4000, ram_bytes=236, sizes_on="cortex-m4f",
        sum_abs_weights_dph=0.02,
    ),
)  # fmt: skip
VERIFICATION = Verification(
    gyrotc_version="0.1.0", serial="A", axis=None, model_hash="00", c_hash="00", passed=1, failed=0, missing=1,
    targets=(
        VerifiedTarget(name="host-gcc-O2", numeric="f32", status="pass"),
        VerifiedTarget(name="cortex-m4f", numeric="f32", status="missing"),
    ),
    emitted=(),
    errors=(MapError(numeric="f32", status="pass", bound_dph=1e-8, worst_dph=0.0, inputs_visited=1),),
    error_bound_dph=1e-8,
    worst_error_dph=WorstError(value=0.0, inputs_visited=1),
)  # fmt: skip
MEASURED = {
    "rms_dph": 0.0011, "std_dph": 0.001, "mean_dph": 0.0004, "max_abs_dph": 0.004, "rms_over_floor": 1.1,
    "rms_30min_dph": 0.0003, "angle_1h_arcsec": 0.5, "first_10min_rms_dph": 0.002, "error_bound_dph": 1e-8,
    "centers": 4.0, "table_bytes": 104.0, "rom_bytes": 4000.0, "ram_bytes": 236.0, "uncertainty_dph": 0.0005,
    "improvement": 10.0, "covered": 0.875, "rows_left_out": 10.0,
}  # fmt: skip


@pytest.fixture
def model(model_dict: dict[str, Any]) -> Model:
    sigma = {"cells": [2, 1], "rows": [[0.0002, 0.0005]]}
    return Model.from_dict(model_dict | {"uncertainty_dph": sigma})


def met(folder: Path, model: Model, text: str, evaluation: Any = EVALUATION) -> list[bool]:
    (folder / "product.toml").write_text("schema = 1\n" + text)
    result = held_against(load_limits(folder / "product.toml"), model, evaluation, VERIFICATION)
    assert result.met == all(check.met for check in result.limits)
    return [check.met for check in result.limits]


@pytest.mark.parametrize("name", MEASURED)
def test_each_figure_has_its_limit(name: str, tmp_path: Path, model: Model) -> None:
    value = MEASURED[name]
    table, better = ("at_most", 1.0001) if name in AtMost.model_fields else ("at_least", 0.9999)
    assert met(tmp_path, model, f"[{table}]\n{name} = {value * better!r}") == [True]
    assert met(tmp_path, model, f"[{table}]\n{name} = {value / better!r}") == [False]


def test_no_limit_is_left_out_of_the_test_above() -> None:
    assert {*AtMost.model_fields, *AtLeast.model_fields} == set(MEASURED)


def test_what_was_not_measured_does_not_keep_a_limit(tmp_path: Path, model: Model) -> None:
    sizes = EVALUATION.model.model_copy(update={"rom_bytes": None})
    unknown = EVALUATION.model_copy(update={"model": sizes, "noise_floor_dph": None})
    assert met(tmp_path, model, "[at_most]\nrms_over_floor = 1e9\nrom_bytes = 1e9", unknown) == [False, False]


def test_ranges_and_needs(tmp_path: Path, model: Model) -> None:
    assert met(tmp_path, model, "[covers]\ntemperature_c = [-40, 60]\nslope_c_per_min = [-1, 1]") == [True] * 2
    assert met(tmp_path, model, "[covers]\ntemperature_c = [-40.5, 60]") == [False]
    assert met(tmp_path, model, '[needs]\narithmetics = ["f32", "q31"]') == [True, False]
    assert met(tmp_path, model, '[needs]\ntargets = ["host-gcc-O2", "cortex-m4f"]') == [True, False], "missing"
    assert met(tmp_path, model, '[needs]\nno_findings = ["large_weights", "run_outlier", "any"]') == [
        True,
        False,
        False,
    ]


@pytest.mark.parametrize(("shown", "met"), [(True, True), (False, False), (None, False)])
def test_a_product_can_ask_for_a_correction_that_generalises(
    shown: bool | None, met: bool, tmp_path: Path, model: Model
) -> None:
    """A constant that was emitted because nothing holds, and a method that nobody judged, do not keep it."""
    (tmp_path / "product.toml").write_text("schema = 1\n[needs]\ngeneralises = true\n")
    result = held_against(
        load_limits(tmp_path / "product.toml"),
        model,
        EVALUATION.model_copy(update={"generalises": shown}),
        VERIFICATION,
    )
    (check,) = result.content()["limits"]
    known = {"limit": "needs.generalises", "measured": shown, "bound": True, "met": met}
    assert {name: check[name] for name in known} == known


def recording(folder: Path, serial: str, shift: float = 0.0) -> None:
    """Six hours of a small gyro; `shift` moves its bias."""
    described(folder, head=f'schema = 1\nserial = "{serial}"\nearth_rate = "none"')
    rows = columns(720)
    write_csv(folder / "run-01.csv", rows | {"rate_dph": rows["rate_dph"] - 20.0 + shift})


def test_limits_and_an_earlier_result_through_the_command(tmp_path: Path, gyrotc: Command) -> None:
    """A build that misses a limit ends with 1 and is written all the same; the next one says what changed."""
    recording(tmp_path / "first", "RLG-1")
    product = tmp_path / "product.toml"
    product.write_text('schema = 1\nproduct = "NAV"\n[at_most]\ntable_bytes = 20\nrms_dph = 1.0\n')
    build = ("build", *HOST, "--limits", product)
    done = gyrotc(*build, tmp_path / "first", "--out", tmp_path / "one")
    assert done.returncode == 1
    assert "limit at_most.table_bytes ≤ 20 is not met" in done.stderr and "rms_dph" not in done.stderr
    limits = json.loads((tmp_path / "one" / "limits.json").read_text())
    assert (limits["schema"], limits["met"], limits["product"]) == ("gyrotc.limits/1", False, "NAV")
    assert "not met" in (tmp_path / "one" / "report.html").read_text()

    guards = "[guards.temperature_c]\nrange = [-55.0, 85.0]\nstuck_s = 700.0\n"
    needs = "[needs]\nimage = false\nuncertainty = false\n"
    product.write_text("schema = 1\nq31_bias_frac_bits = 30\n[at_most]\ntable_bytes = 1000\n" + needs + guards)
    recording(tmp_path / "second", "RLG-1", shift=0.01)
    done = gyrotc(*build, tmp_path / "second", "--out", tmp_path / "two", "--previous", tmp_path / "one")
    assert done.returncode == 0, done.stderr
    changes = json.loads((tmp_path / "two" / "changes.json").read_text())
    assert changes["map"]["mean_dph"] == pytest.approx(0.01, rel=1e-3)
    assert changes["recordings"]["other_bytes"] == ["run-01.csv"]
    assert "c/gtc_rlg_1.c" in changes["files"]["other_bytes"]
    assert "maps 0.0100 deg/h RMS difference" in done.stdout
    assert "V(-55.0F), V(85.0F), " in (tmp_path / "two" / "c" / "gtc_rlg_1.c").read_text()
    assert json.loads((tmp_path / "two" / "model.json").read_text())["q31_bias_frac_bits"] == 30
    assert json.loads((tmp_path / "two" / "model.json").read_text())["left_out"] == [
        "uncertainty", "rezero", "image"
    ]  # fmt: skip
    assert "gtc_f32_open" not in (tmp_path / "two" / "c" / "gtc_f32.c").read_text()
    found = changes["as_found"]
    assert found["judged_on"] == "train" and found["limits"]["met"] is True
    assert found["figures"]["after"]["mean_dph"] == pytest.approx(0.01, rel=0.05), "the old map on new rows"
    assert [c["moved_rms_dph"] is None for c in changes["history"]] == [True, False]
    assert changes["map"]["significant"] is True and "as found: RMS 0.01" in done.stdout
    page = (tmp_path / "two" / "report.html").read_text()
    assert "left out of table and runtime: uncertainty, rezero, image" in page
    assert "All calibrations that are known" in page and 'aria-label="all calibrations over time' in page
    names = json.loads((tmp_path / "two" / "manifest.json").read_text())["files"]
    assert "limits.json" in names

    recording(tmp_path / "third", "RLG-2")
    done = gyrotc(*build, tmp_path / "third", "--out", tmp_path / "three", "--previous", tmp_path / "two")
    assert done.returncode == 2 and "is of gyro RLG-1" in done.stderr
    assert not (tmp_path / "three").exists()


TARGET = ("--target", "host-gcc-O2")  # without --numeric: the limits file names the arithmetics


def built_for(text: str, data: Path, gyrotc: Command) -> tuple[subprocess.CompletedProcess[str], Path]:
    """Build recordings for the product that a limits file describes; return what the command said, and the result."""
    product, out = data.parent / "product.toml", data.parent / "out"
    product.write_text(f"schema = 1\n{text}\n")
    return gyrotc("build", *TARGET, "--limits", product, data, "--out", out), out


def test_a_product_gets_the_arithmetic_and_the_parts_that_it_needs(tmp_path: Path, gyrotc: Command) -> None:
    """What it can do without is not among the files, which are 100 kB at most."""
    recording(tmp_path / "data", "RLG-1")
    needs = '[needs]\narithmetics = ["f32"]\nimage = false\nuncertainty = false'
    done, out = built_for(needs, tmp_path / "data", gyrotc)
    assert done.returncode == 0, done.stderr
    assert {path.suffix for path in (out / "c").iterdir()} == {".c", ".h", ".bin", ".hex", ".json"}
    assert {path.name for path in (out / "c").glob("*.[ch]")} == {
        "gtc.h", "gtc_f32.c", "gtc_rlg_1.h", "gtc_rlg_1.c", "main.c",
    }  # fmt: skip
    assert sum(path.stat().st_size for path in (out / "c").iterdir()) < 100_000
    assert json.loads((out / "verify.json").read_text())["options"]["numeric"] == ["f32"]


def test_an_arithmetic_that_is_needed_and_refused_misses_its_limit(tmp_path: Path, gyrotc: Command) -> None:
    """The other arithmetic is written all the same, with the reason."""
    recording(tmp_path / "data", "RLG-1")
    needs = 'q31_bias_frac_bits = 60\n[needs]\narithmetics = ["q31"]'
    done, out = built_for(needs, tmp_path / "data", gyrotc)
    assert done.returncode == 1 and "limit needs.arithmetics" in done.stderr
    assert (out / "c" / "gtc_f32.c").exists() and not (out / "c" / "gtc_q31.c").exists()
    assert list(json.loads((out / "manifest.json").read_text())["refused"]) == ["q31"]


def test_the_arithmetic_may_be_refused_for_one_axis_alone(tmp_path: Path, gyrotc: Command) -> None:
    """Its bias is beyond the range of the product's fixed point; the axes run in one image all the same."""
    rows = columns(720)
    constants = {"x": 300.0, "y": -20.0, "z": -20.001}
    rates = {f"rate_{axis}_dph": rows["rate_dph"] + constant for axis, constant in constants.items()}
    write_csv(tmp_path / "imu" / "run-01.csv", {name: rows[name] for name in ("time_s", "temperature_c")} | rates)
    needs = 'q31_bias_frac_bits = 24\n[needs]\narithmetics = ["q31"]'
    done, out = built_for(needs, tmp_path / "imu", gyrotc)
    assert done.returncode == 1 and "axis x: limit needs.arithmetics q31 is not met: f32" in done.stderr
    tables = {axis: (out / "c" / f"gtc_imu_{axis}.h").read_text() for axis in "xyz"}
    assert {axis: "gtc_q31_table_t" in text for axis, text in tables.items()} == {"x": False, "y": True, "z": True}
    main = (out / "c" / "main.c").read_text()
    assert [name for name in ("x_f32", "x_q31", "y_f32", "y_q31", "z_q31") if f"&gtc_imu_{name})" in main] == [
        "x_f32", "y_q31", "z_q31",
    ]  # fmt: skip
    assert gyrotc("verify", out, *TARGET).returncode == 0


_TERM = Term(id="auxiliary", parameters={"slope_dph_per_unit": 0.01, "reference": 28.0}, channel="supply_v")
_TRAINED = Guard(
    low=27.0, high=29.0, max_step=2.0, max_rate_per_min=0.5, agree_s=1.0, stuck_s=0.0, missing_s=300.0,
    fallback=28.0,
)  # fmt: skip
_WHOLE = """schema = 1
[guards.temperature_c]
range = [-80.0, 150.0]
step = 0.25
rate_per_min = 12.0
agree_s = 3.0
stuck_s = 600.0
missing_s = 120.0
[guards.supply_v]
range = [26.0, 30.5]
step = 0.125
rate_per_min = 6.0
agree_s = 2.0
stuck_s = 900.0
missing_s = 40.0
fallback = 27.5
"""


@pytest.fixture
def trained() -> Model:
    return random_model(4, terms=(_TERM,), guards={"supply_v": _TRAINED}, slope_blocks=4)


def product(folder: Path, text: str, model: Model) -> Model:
    path = folder / "product.toml"
    path.write_text(text)
    limits = load_limits(path)
    return guarded(model, limits.guards, limits.file, ("supply_v", "pressure_hpa"))


@pytest.mark.parametrize("numeric", ["f32", "q31"])
def test_every_field_reaches_the_words_of_the_table(numeric: str, tmp_path: Path, trained: Model) -> None:
    table = quantise(product(tmp_path, _WHOLE, trained), numeric)
    unit = 1.0 if numeric == "f32" else 2.0**-16
    rate = 1.0 if numeric == "f32" else 2.0**-40
    records = table.guards.reshape(2, 8)
    numbers = table.numbers(table.guards).reshape(2, 8)
    np.testing.assert_allclose(numbers[:, :3] * unit, [[-80.0, 150.0, 0.25], [26.0, 30.5, 0.125]])
    np.testing.assert_allclose(numbers[:, 3] * rate * 60e6, [12.0, 6.0], rtol=1e-4)
    np.testing.assert_array_equal(records[:, 4], [3_000_000, 2_000_000])
    np.testing.assert_array_equal(records[:, 5], [600_000_000, 900_000_000])
    np.testing.assert_array_equal(records[:, 6], [12, 4])  # blocks of 10 s
    assert numbers[1, 7] * unit == 27.5


def test_the_emitted_source_shows_them(tmp_path: Path, trained: Model) -> None:
    model = product(tmp_path, _WHOLE, trained)
    text = emit_texts(model, quantise_all(model, ("f32",)))[f"gtc_{model.id}.c"].decode()
    assert "V(-80.0F), V(150.0F), V(0.25F), " in text
    assert "V(26.0F), V(30.5F), V(0.125F), " in text
    assert Model.from_dict(model.to_dict()).hash == model.hash != trained.hash


def test_what_is_left_out_stays_as_training_showed_it(tmp_path: Path, trained: Model) -> None:
    assert product(tmp_path, "schema = 1\n", trained) == trained
    found = product(tmp_path, "schema = 1\n[guards.supply_v]\nstuck_s = 60.0\n", trained)
    assert found.guards["supply_v"] == _TRAINED.model_copy(update={"stuck_s": 60.0})
    assert quantise(found, "f32").guards[:8].tolist() == quantise(trained, "f32").guards[:8].tolist()
    # recorded, and not in the table
    assert product(tmp_path, "schema = 1\n[guards.pressure_hpa]\nstuck_s = 60.0\n", trained) == trained


def test_the_runtime_believes_what_the_product_file_says(tmp_path: Path, trained: Model) -> None:
    """Outside of the product's range a temperature is held, then lost; a channel is clamped, then lost."""
    model = product(tmp_path, _WHOLE, trained)
    table = quantise(model, "f32")
    middle = sum(model.envelope.temperature_c) / 2.0
    rng = np.random.default_rng(1)
    channels = np.column_stack([np.full(400, middle), np.full(400, 28.0)]) + rng.uniform(0.0, 0.01, (400, 2))
    channels[100:, 1] = 31.0 + rng.uniform(0.0, 0.01, 300)
    channels[200:300, 1] = np.nan
    channels[300:, 0] = 160.0 + rng.uniform(0.0, 0.01, 100)
    found = replay(table, table.encode_inputs(channels), missed=np.zeros(400, np.int64), samples_per_block=5)
    assert not found.status[99] & (CLAMPED | HELD)
    assert found.status[150] & CLAMPED
    assert found.status[250] & CHANNEL_LOST
    assert found.status[399] & FALLBACK


@pytest.mark.parametrize(
    ("text", "field", "expected"),
    [
        ("[guards.temperature_c]\nrange = [60.0, -40.0]\n", "guards.temperature_c.range", "lower end first"),
        ("[guards.temperature_c]\nrange = [-120.0, 150.0]\n", "guards.temperature_c.range", "-90 to 200"),
        ("[guards.temperature_c]\nrange = [0.0, 0.1]\n", "guards.temperature_c.range", "of the recordings"),
        ("[guards.temperature_c]\nstep = 0.0\n", "guards.temperature_c.step", "greater than 0"),
        ("[guards.temperature_c]\nstep = \"1 C\"\n", "guards.temperature_c.step", "a number"),
        ("[guards.temperature_c]\nstuck_samples = 100\n", "guards.temperature_c.stuck_samples", "docs/limits.md"),
        ("[guards.temperature_c]\nfallback = 1.0\n", "guards.temperature_c.fallback", "from training"),
        ("[guards.supply_v]\nstuck_s = -1.0\n", "guards.supply_v.stuck_s", "greater than or equal to 0"),
        ("[guards.supply_v]\nmissing_s = nan\n", "guards.supply_v.missing_s", "finite"),
        ("[guards.supply_v]\nfallback = 40.0\n", "guards.supply_v.fallback", "within the range"),
        ("[guards.supply_v]\nrange = [28.5, 29.0]\n", "guards.supply_v.fallback", "within the range"),
        ("[guards.supply_w]\nstep = 1.0\n", "guards.supply_w", "supply_v"),
        ('file = "x"\n', "file", "docs/limits.md"),
    ],
)  # fmt: skip
def test_a_wrong_guard_is_refused_with_file_and_field(
    text: str, field: str, expected: str, tmp_path: Path, trained: Model
) -> None:
    with pytest.raises(InputError) as refused:
        product(tmp_path, "schema = 1\n" + text, trained)
    assert f"product.toml, field {field}" in str(refused.value)
    assert expected in str(refused.value)
