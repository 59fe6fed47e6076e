"""Further thermometers, differences of nodes and the laser's own signals in simulated recordings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gyrotc.common.errors import InputError
from gyrotc.recordings.load import load
from gyrotc.simulate.campaign import campaign, simulate
from gyrotc.simulate.gyro import laser_bias, laser_readings, laser_states, thermometer_readings
from gyrotc.simulate.scenario import Laser, Scenario, Thermometer, read
from gyrotc.simulate.truth import read_truth
from numpy.typing import NDArray

Array = NDArray[np.float64]
_N = 4000


def planned(**changes: object) -> Scenario:
    """The first two runs of the packaged scenario, with changes."""
    _, plan = read("signals")
    one = plan.set[0].model_copy(update={"profiles": ["cold start -40 C"]})
    return plan.model_copy(update={"set": [one], **changes})


def test_thermometers_show_their_own_nodes_with_their_own_faults() -> None:
    """Offset, lag and steps are told from the true temperature of the node alone."""
    made = next(campaign(planned(), 3))
    for name, node, lag_s, offset_c, step_c in (
        ("mirror_c", "mirror", 15.0, 0.3, 0.02),
        ("case_c", "case", 40.0, -0.4, 0.0625),
    ):
        reading, true = made.channels[name], made.states[f"{node}_c"]
        assert np.allclose(np.round(reading / step_c) * step_c, reading, atol=1e-9)
        # An independent lag: explicit Euler at a hundredth of the time constant's step.
        z, shown = true[0], []
        for value in true.tolist():
            z += (value - z) / lag_s
            shown.append(z)
        assert np.abs(reading - np.array(shown) - offset_c)[200:].max() < 0.1 + step_c


def test_a_loose_thermometer_follows_the_air_from_its_day_on() -> None:
    one = Thermometer(name="case_c", node="case", loose_from_day=10.0, noise_c=0.0, resolution_c=0.0)
    time_s = np.arange(float(_N))
    node, air = np.full(_N, 30.0), np.full(_N, 10.0)
    before = thermometer_readings(one, node, air, time_s, 9.9, np.random.default_rng(0))
    after = thermometer_readings(one, node, air, time_s, 10.0, np.random.default_rng(0))
    assert before == pytest.approx(30.0)
    assert after[-1] == pytest.approx(20.0)


def test_the_mirror_jumps_by_half_a_wavelength_and_not_on_the_same_way_back() -> None:
    """The perimeter's expansion is the sum of stroke and whole half wavelengths; which one hangs on the way."""
    laser = Laser(expansion_ppm_per_c=0.05, expansion_ppm_per_c2=0.0)
    way = np.concatenate([np.linspace(20.0, 60.0, _N), np.linspace(60.0, 20.0, _N)])
    stroke = laser_states(laser, way, way + 30.0, way, 0.0, np.zeros(2 * _N)).stroke
    fringes = 280e6 * 0.05e-6 * (way - 20.0) / (0.5 * 632.8)
    orders = fringes - stroke
    assert np.allclose(orders, np.round(orders), atol=1e-9)
    assert np.abs(stroke).max() <= laser.reset_share
    up, down = stroke[:_N], stroke[_N:][::-1]
    assert np.abs(up - down).max() == pytest.approx(1.0, abs=1e-9)
    assert (np.abs(up - down) < 0.5).mean() > 0.5


def test_intensity_falls_with_losses_with_a_hotter_gas_and_with_the_years() -> None:
    laser = Laser(intensity_noise_v=0.0, stroke_noise_v=0.0)
    flat = np.full(4, 20.0)
    plain = laser_states(laser, flat, flat + 30.0, flat, 0.0, np.zeros(4))

    def intensity(changed: object) -> float:
        return float(laser_readings(laser, changed, np.random.default_rng(0))["intensity_v"][0])  # type: ignore[arg-type]

    assert intensity(plain) == pytest.approx(laser.intensity_level_v)
    assert intensity(replace(plain, loss_ppm=plain.loss_ppm + 10.0)) < laser.intensity_level_v
    hotter = laser_states(laser, flat, flat + 60.0, flat, 0.0, np.zeros(4))
    later = laser_states(laser, flat, flat + 30.0, flat, 365.0, np.zeros(4))
    assert max(intensity(hotter), intensity(later)) < laser.intensity_level_v
    assert laser_bias(laser, plain) == pytest.approx(0.0, abs=1e-12)


def test_the_bias_is_the_map_with_what_differences_and_laser_add() -> None:
    whole, bare = (
        next(campaign(planned(**changes), 3)) for changes in ({}, {"difference": [], "laser": None})
    )
    added = (whole.bias_dph - bare.bias_dph)[:-1]
    s = whole.states
    x = s["mirror_c"] - s["block_c"]
    cavity = whole.cavity_c[:-1]
    expected = 5e-4 * x / np.sqrt(1.0 + (x / 8.0) ** 2) * (1.0 + 0.004 * (cavity - 20.0))
    expected += -1e-4 * (s["case_c"] - s["block_c"])
    expected += 1e-4 * (s["loss_ppm"] - 300.0) + 5e-4 * np.sin(np.pi * s["stroke"])
    assert added == pytest.approx(expected, abs=1e-12)
    assert bare.reading_c == pytest.approx(whole.reading_c)  # nothing else is drawn anew


def test_further_thermometers_change_nothing_else_of_a_recording() -> None:
    _, plan = read("paper-20C")
    more = plan.model_copy(update={"thermometer": [Thermometer(name="case_c", node="case")]})
    a, b = next(campaign(plan, 5)), next(campaign(more, 5))
    assert np.array_equal(a.angle_arcsec, b.angle_arcsec)
    assert np.array_equal(a.reading_c, b.reading_c)
    assert not a.states
    assert set(b.channels) == {"case_c"}


def test_recordings_have_the_columns_and_truth_has_the_states(tmp_path: Path) -> None:
    scenario = tmp_path / "short.toml"
    scenario.write_text(
        'extends = "signals"\n[profile."cold start 20 C"]\nrecord_min = 20\n[[set]]\n'
        'started = 2026-01-01T00:00:00Z\nprofiles = ["cold start 20 C"]\n',
        "utf-8",
    )
    simulate(scenario, seed=1, out=tmp_path / "made")
    dataset = load(tmp_path / "made")
    assert dataset.channels == ("mirror_c", "case_c", "electronics_c", "intensity_v", "path_length_v")
    truth = read_truth(tmp_path / "made")
    assert truth is not None
    named = truth.content.runs[0].states
    assert named is not None
    loss = np.load(tmp_path / "made" / named["loss_ppm"])
    assert loss.shape == (120,)
    assert set(truth.content.plan) >= {"thermometer", "laser", "difference"}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[[thermometer]]\nname = "a_c"\nnode = "lid"\n', "node of thermometer a_c 'lid' is no node"),
        ('[[thermometer]]\nname = "temperature_c"\nnode = "case"\n', "names of channels"),
        ('[laser]\nintensity = "path_length_v"\n', "repeat"),
        ("[laser]\nreset_share = 0.3\n", "reset_share"),
        ('[[difference]]\nnode = "case"\nagainst = "lid"\ndph_per_c = 1.0\n', "node of a difference 'lid'"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "odd.toml"
    path.write_text('extends = "separating"\n' + text, "utf-8")
    with pytest.raises(InputError, match=said) as refused:
        read(path)
    assert "odd.toml" in str(refused.value)
