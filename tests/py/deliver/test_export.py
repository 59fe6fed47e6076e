"""Parameters of autopilots: the firmware's own arithmetic, bit for bit, and what a cubic loses."""

from __future__ import annotations

import csv
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT
from gyrotc.common.errors import CheckFailed, InputError
from gyrotc.deliver.autopilots import Autopilot, Cubic, best_cubic
from gyrotc.deliver.export import Exporting, export
from gyrotc.deliver.grid import csv_text, grid_of
from gyrotc.model import Model, load_model

# The operations of the firmware, written down from its documentation of the parameters.
FIRMWARE = """
#include <stdio.h>
#include <string.h>
static float px4(const float *p, float t)   /* x0 x1 x2 x3 tref tmin tmax */
{
    float d, d2, d3;
    if (t > p[6]) { d = p[6] - p[4]; } else if (t < p[5]) { d = p[5] - p[4]; } else { d = t - p[4]; }
    d2 = d * d;
    d3 = d2 * d;
    return p[0] + p[1] * d + p[2] * d2 + p[3] * d3;
}
static float ardupilot(const float *p, float t)   /* offset c0 c1 c2 caltemp tmin tmax */
{
    float mid = (p[6] + p[5]) * 0.5f, d, e, v = 0.0f, u;
    t = t < p[5] ? p[5] : t > p[6] ? p[6] : t;
    if (mid <= 0.0f) { return p[0]; }
    d = t - mid;
    e = p[4] - mid;
    u = (p[1] + (p[2] + p[3] * d) * d) * d * 1.0e-6f;
    v -= u;
    v += (p[1] + (p[2] + p[3] * e) * e) * e * 1.0e-6f;
    return p[0] - v;
}
int main(int argc, char **argv)
{
    float p[7], t;
    (void)argc;
    if (fread(p, sizeof p[0], 7, stdin) != 7) { return 1; }
    while (fread(&t, sizeof t, 1, stdin) == 1) {
        float y = strcmp(argv[1], "px4") == 0 ? px4(p, t) : ardupilot(p, t);
        fwrite(&y, sizeof y, 1, stdout);
    }
    return 0;
}
"""
TEMPERATURES = np.random.default_rng(5).uniform(-60.0, 90.0, 20000).astype(np.float32)


@pytest.fixture(scope="module")
def model() -> Model:
    return load_model(ROOT / "tests" / "c" / "model.json")


@pytest.fixture(scope="module")
def firmware(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    folder = tmp_path_factory.mktemp("firmware")
    (folder / "firmware.c").write_text(FIRMWARE)
    command = [
        "gcc",
        "-std=c99",
        "-O2",
        "-ffp-contract=off",
        "-o",
        folder / "firmware",
        folder / "firmware.c",
    ]
    subprocess.run(command, check=True)
    return folder / "firmware"


def read(path: Path) -> dict[str, np.float32]:
    """Names and values of a parameter file, as a ground station reads them."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    cells = [line.split("\t")[2:4] if "\t" in line else line.split(",") for line in lines]
    return {name: np.float32(value) for name, value in cells}


NAMES: dict[Autopilot, list[str]] = {
    "px4": [*(f"TC_G0_X{k}_1" for k in range(4)), "TC_G0_TREF", "TC_G0_TMIN", "TC_G0_TMAX"],
    "ardupilot": [
        "INS_GYROFFS_Y", *(f"INS_TCAL1_GYR{k}_Y" for k in (1, 2, 3)), "INS_GYR1_CALTEMP", "INS_TCAL1_TMIN",
        "INS_TCAL1_TMAX",
    ],
}  # fmt: skip


@pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])
def test_the_file_gives_the_firmwares_bits(
    autopilot: Autopilot, model: Model, firmware: Path, tmp_path: Path
) -> None:
    model.save(tmp_path / "model.json")
    export(tmp_path, autopilot, tmp_path / "gyro.params", Exporting(axis_as="z"))
    told = export(
        tmp_path, autopilot, tmp_path / "gyro.params", Exporting(axis_as="y")
    )  # an earlier export is replaced
    values = read(tmp_path / "gyro.params")
    words = np.array([values[name] for name in NAMES[autopilot]], dtype=np.float32)
    stream = words.tobytes() + TEMPERATURES.tobytes()
    done = subprocess.run([firmware, autopilot], input=stream, capture_output=True, check=True)
    answers = np.frombuffer(done.stdout, dtype=np.float32)
    assert np.array_equal(answers, best_cubic(model, autopilot).offset(TEMPERATURES))
    assert told[0] in (tmp_path / "gyro.params").read_text()
    assert all(values[name.replace("_1", "_0").replace("_Y", "_X")] == 0 for name in NAMES[autopilot][1:4])


def lost(cubic: Cubic, model: Model) -> float:
    t = np.linspace(*model.envelope.temperature_c, 200)
    offset = cubic.offset(t).astype(np.float64) * 3600.0 * 180.0 / np.pi
    return float(np.sqrt(np.mean((offset - model.map_dph(t, np.zeros_like(t))) ** 2)))


@pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])
def test_no_other_cubic_is_closer_and_the_loss_is_told(autopilot: Autopilot, model: Model) -> None:
    found = best_cubic(model, autopilot)
    assert lost(found, model) <= 2.0 * found.rms_dph + 1e-9
    assert found.rms_dph < found.flat_dph
    for order in range(4):
        worse = list(found.x)
        worse[order] = np.float32(worse[order] * 1.2)
        other = Cubic(
            autopilot, found.reference_c, found.lowest_c, found.highest_c, tuple(worse), 0.0, 0.0, 0.0
        )
        assert lost(other, model) >= 0.9 * lost(found, model)


def test_what_ardupilot_would_not_correct_is_refused(model: Model) -> None:
    cold = model.envelope.model_copy(update={"temperature_c": (-40.0, 20.0)})
    with pytest.raises(CheckFailed, match="not above 0 C"):
        best_cubic(model.model_copy(update={"envelope": cold}), "ardupilot")


def test_the_table_is_the_map(model: Model, tmp_path: Path) -> None:
    rows = list(csv.DictReader(csv_text([grid_of(model)]).splitlines()))
    assert len(rows) == 61 * 25
    for row in rows[:: 61 * 5]:
        bias = model.map_dph(float(row["temperature_c"]), float(row["slope_c_per_min"]))
        assert float(row["bias_dph"]) == float(bias)
    model.save(tmp_path / "model.json")
    for _ in range(2):
        export(tmp_path, "csv", tmp_path / "map.csv")
    (tmp_path / "notes.csv").write_text("mine")
    with pytest.raises(InputError, match="not written by gyrotc"):
        export(tmp_path, "csv", tmp_path / "notes.csv")
    with pytest.raises(InputError, match="--axis-as"):
        export(tmp_path, "px4", tmp_path / "a", Exporting(axis_as="w"))
