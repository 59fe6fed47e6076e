"""A rest of the vehicle moves the constant: by nearly all of what a power-on planted, and by next to nothing without.

The gyro of examples/nav_loop, which drew no offset in training: the uncertainty from power-on to power-on is planted.
"""

from __future__ import annotations

import ctypes
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import ROOT
from gyrotc.model import Model, load_model
from gyrotc.tables.quantise import NUMERICS, quantise
from gyrotc.train.uncertainty import rezero_dph
from libc_build import runtime
from libc_device import Device

BETWEEN_DPH = 5e-4
REST_S = 7200
EXAMPLE = ROOT / "examples" / "nav_loop"


def gyro(between: float) -> Model:
    """The example's gyro with turn-on offsets of this size."""
    content: dict[str, Any] = load_model(EXAMPLE / "filter_model.json").to_dict()
    known = content["uncertainty_dph"]
    for grid in ("rows", "uncovered"):
        known[grid] = np.hypot(np.array(known[grid]), between).tolist()
    known["rules"]["between_dph"] = between
    return Model.from_dict({**content, "rezero_dph": rezero_dph(between, 6)})


def shifts(numeric: str, between: float, offsets: np.ndarray, seed: int) -> np.ndarray:
    """What a rest of two hours at 20 C moves the constant by, for offsets of power-ons, deg/h."""
    model = gyro(between)
    device = Device(runtime(), quantise(model, numeric))
    rng = np.random.default_rng(seed)
    rules = model.uncertainty_dph.rules if model.uncertainty_dph else None
    assert rules is not None
    number = ctypes.c_float if numeric == "f32" else ctypes.c_int32
    unit = 1.0 if numeric == "f32" else 2.0**device.table.bias_frac_bits
    channels = device.table.encode_inputs(20.0 + 0.01 * rng.normal(size=(200, 1)))
    noise = float(np.hypot(rules.noise_deg_per_sqrt_h * np.sqrt(3600.0 / REST_S), 4e-5))  # of rate and map
    found = []
    for offset in offsets:
        state = device.state()
        device.init(state, 1)
        device.steps(state, channels, np.zeros(len(channels)))
        rate = offset + noise * rng.normal()
        given = number(rate if numeric == "f32" else round(rate * unit))
        assert device.function("rezero")(state, given, ctypes.c_uint32(REST_S)) >= 0
        moved = [number(), number()]
        assert device.function("bias")(state, ctypes.byref(moved[0])) >= 0
        assert device.function("unzero")(state) == 0
        assert device.function("bias")(state, ctypes.byref(moved[1])) >= 0
        found.append((moved[0].value - moved[1].value) / unit)
    return np.array(found)


@pytest.mark.parametrize("numeric", NUMERICS)
def test_nine_tenths_of_an_offset_of_three_sigma_are_removed(numeric: str) -> None:
    """Planted offsets of three times what power-ons differ by, either sign: 90 % are gone, on average over rests."""
    offsets = 3.0 * BETWEEN_DPH * np.tile([1.0, -1.0], 50)
    removed = shifts(numeric, BETWEEN_DPH, offsets, 1) / offsets
    print(f"removed: {removed.mean():.3f} on average, {removed.min():.3f} at least, of {removed.size}")
    assert removed.mean() > 0.9
    assert removed.min() > 0.7  # the noise of two hours is 6 % of the offset


@pytest.mark.parametrize("numeric", NUMERICS)
@pytest.mark.parametrize("between", [0.0, BETWEEN_DPH])
def test_it_is_harmless_without_an_offset(numeric: str, between: float) -> None:
    """RMS of means over 100 s with and without the shift: less than 1 % worse. Without offsets in training: refused."""
    model = gyro(between)
    if between == 0.0:
        assert model.rezero_dph == 0.0
        return
    moved = shifts(numeric, between, np.zeros(100), 2)
    floor = float(model.noise_floor_dph or 0.0)
    worse = float(np.sqrt(1.0 + np.mean(moved**2) / floor**2))
    print(f"worse by {100.0 * (worse - 1.0):.2f} %")
    assert worse < 1.01


def test_the_filter_that_snapshots_feed_is_better_than_any_constant_one(tmp_path: Path) -> None:
    sources = [EXAMPLE / f for f in ("filter.c", "filter_demo.c", "gtc_sim_0003.c")]
    sources += sorted((ROOT / "libc").glob("*.c"))
    program = tmp_path / "filter"
    command = ["gcc", "-std=c99", "-ffp-contract=off", "-O2", f"-I{ROOT / 'include'}", "-o", str(program)]
    subprocess.run([*command, *map(str, sources), "-lm"], check=True)
    with (EXAMPLE / "filter_sequence.txt").open("rb") as lines:
        said = subprocess.run([program], stdin=lines, capture_output=True, text=True, check=True).stdout
    found = re.search(r"best constant: ([0-9.]+)", said)
    assert found is not None, said
    assert float(found[1]) < 0.8
