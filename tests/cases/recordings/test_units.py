"""Units of files that are read as they are: declared in dataset.toml, held against what the values look like."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import Command
from gyrotc.common import InputError
from gyrotc.quality import check
from gyrotc.recordings import EARTH_RATE_DPH, UnitError, channel_unit, conversion, earth_rate, load, quantity_of
from gyrotc.train import FitOptions, fit_dataset
from recordings import Columns, columns, state, toml, write_csv

HEAD = 'schema = 1\nserial = "RLG-1"\nearth_rate = "removed"\n'


def made(folder: Path, table: Columns, units: str = "", head: str = HEAD, run: str = 'file = "a.csv"') -> Path:
    write_csv(folder / "a.csv", table)
    tail = f"[units]\n{units}" if units else ""
    (folder / "dataset.toml").write_text(toml(run, head=head, tail=tail), "utf-8")
    return folder


def dps(c: Columns) -> Columns:
    return c | {"rate_dph": c["rate_dph"] / 3600.0}


def minutes(c: Columns) -> Columns:
    return c | {"time_s": c["time_s"] / 60.0}


def kelvin(c: Columns) -> Columns:
    return c | {"temperature_c": c["temperature_c"] + 273.15}


def fahrenheit(c: Columns) -> Columns:
    return c | {"temperature_c": 1.8 * (c["temperature_c"] + 10.0) + 32.0}


@pytest.mark.parametrize(
    ("text", "kind", "factor", "offset"),
    [
        ("deg/s", "rate", 3600.0, 0.0),
        ("°/s", "rate", 3600.0, 0.0),
        ("dps", "rate", 3600.0, 0.0),
        ("deg.s^-1", "rate", 3600.0, 0.0),
        ("mdps", "rate", 3.6, 0.0),
        ("mdeg/s", "rate", 3.6, 0.0),
        ("°·h⁻¹", "rate", 1.0, 0.0),
        ("rad s-1", "rate", 648000.0 / np.pi, 0.0),
        ("(deg)/(h)", "rate", 1.0, 0.0),
        ("rev/min", "rate", 21600.0, 0.0),
        ("deg/s/LSB", "rate", 3600.0, 0.0),
        ("rad / (0.01 s)", "rate", 64800000.0 / np.pi, 0.0),
        ("rad/s", "rate", 648000.0 / np.pi, 0.0),
        ("deg/s / 131", "rate", 3600.0 / 131.0, 0.0),
        ("arcsec/s", "rate", 1.0, 0.0),
        ("K", "temperature", 1.0, -273.15),
        ("degF", "temperature", 5.0 / 9.0, -160.0 / 9.0),
        ("C", "temperature", 1.0, 0.0),
        ("0.01 K", "temperature", 0.01, -273.15),
        ("degC/10", "temperature", 0.1, 0.0),
        ("Deg C", "temperature", 1.0, 0.0),
        ("MS", "time", 0.001, 0.0),
        ("kPa", "mbar", 10.0, 0.0),
        ("psi", "Pa", 6894.757293168361, 0.0),
        ("min", "time", 60.0, 0.0),
        ("us", "time", 1e-6, 0.0),
        ("0.01 s", "time", 0.01, 0.0),
        ("mV", "V", 1e-3, 0.0),
    ],
)
def test_units_are_exact(text: str, kind: str, factor: float, offset: float) -> None:
    one = conversion(text, kind)
    assert one.factor == pytest.approx(factor, rel=3e-16)
    assert one.offset == pytest.approx(offset, rel=3e-16)


@pytest.mark.parametrize(
    ("text", "kind"),
    [("Hz", "rate"), ("V", "rate"), ("furlong", "rate"), ("5", "rate"), ("s", "temperature"), ("", "time"),
     ("10**9**9 s", "time"), ("__import__('os')", "time"), ("(" * 50, "time"), ("0 s", "time"), ("m", "temperature"),
     ("MPA", "Pa"), ("s/0", "time"), ("deg/h)", "rate"), ("1e99*1e99*1e99*1e99 s", "time"), ("deg//h", "rate")],
)  # fmt: skip
def test_what_is_no_unit_is_refused(text: str, kind: str) -> None:
    with pytest.raises(UnitError):
        conversion(text, kind)


def test_kinds_and_names_of_channels() -> None:
    assert [quantity_of(u) for u in ("deg/s", "K", "ms", "V", "Hz", "C")] == [
        "rate",
        "temperature",
        "time",
        None,
        None,
        "temperature",
    ]
    assert channel_unit("case_temperature_c") == "degC" and channel_unit("supply_v") == "V"
    assert channel_unit("supply") is None and channel_unit("v") is None


def test_the_bounds_in_other_units_are_those_of_the_table() -> None:
    from gyrotc.recordings import plausibility

    for unit, factor in plausibility.RATE_UNITS_DPH.items():
        assert conversion(unit, "rate").factor == pytest.approx(factor, rel=1e-15)
    for unit, factor in plausibility.TIME_UNITS_S.items():
        assert conversion(unit, "time").factor == factor


@pytest.mark.parametrize(
    ("change", "units"),
    [
        (dps, 'rate = "deg/s"'),
        (minutes, 'time = "min"'),
        (kelvin, 'temperature = "K"'),
        (fahrenheit, 'temperature = "degF"'),
    ],
)
def test_a_declared_unit_is_converted_on_reading(
    change: Callable[[Columns], Columns], units: str, tmp_path: Path
) -> None:
    table = columns(600)
    folder = made(tmp_path / "R", change(table), units)
    run = load(folder).runs[0]
    rows = run.rows()
    shift = 10.0 if change is fahrenheit else 0.0
    np.testing.assert_allclose(rows.time_s, table["time_s"], rtol=1e-14)
    np.testing.assert_allclose(rows.temperature_c, table["temperature_c"] + shift, atol=1e-12)
    np.testing.assert_allclose(rows.rate_dph, table["rate_dph"], rtol=1e-14)
    assert run.sha256 == hashlib.sha256((folder / "a.csv").read_bytes()).hexdigest(), "of the file as it was"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (dps, ("below that of any gyro", '[units] rate = "deg/s"')),
        (minutes, ("faster than a chamber", '[units] time = "min"')),
        (fahrenheit, ("fahrenheit", '[units] temperature = "degF"')),
    ],
)
def test_values_that_contradict_their_unit_are_refused_unless_trusted(
    change: Callable[[Columns], Columns], words: tuple[str, ...], tmp_path: Path
) -> None:
    table = columns(600)
    table["temperature_c"] = 1.6 * table["temperature_c"]
    folder = made(tmp_path / "R", change(table))
    with pytest.raises(InputError) as refused:
        load(folder)
    assert all(word in str(refused.value) for word in words), refused.value
    assert "trust_units = true" in str(refused.value)
    dataset = load(state(folder, "trust_units = true"))
    assert any(words[0] in text for text in dataset.trusted)
    reported = check(folder)
    assert not reported.problems and any("units are trusted" in str(warning) for warning in reported.warnings)


def test_kelvin_is_refused_with_its_unit(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r'293\.\d+ .*kelvin\? \[units\] temperature = "K"'):
        load(made(tmp_path / "R", kelvin(columns(600))))


def test_what_is_trusted_stands_in_training_json(tmp_path: Path) -> None:
    folder = made(tmp_path / "R", dps(columns(600)), head=HEAD + "trust_units = true\n")
    training = fit_dataset(load(folder), FitOptions(centers=0)).training.content()
    assert training["units"]["declared"] == {}
    assert "white noise" in training["units"]["trusted"][0]
    assert json.dumps(training)


@pytest.mark.parametrize(("factor", "refused"), [(1.0, False), (1.0 / 3600.0, True), (np.pi / 648000.0, True)])
def test_earths_rate_along_the_axis_tells_the_unit(factor: float, refused: bool, tmp_path: Path) -> None:
    """A noisy gyro: its noise could be that of a good one in deg/h, its mean could not be Earth's rate in deg/h."""
    earth = earth_rate(48.0, 0.0, 0.0, latitude_sigma_deg=0.01, axis_sigma_deg=0.1).rate_dph
    rng = np.random.default_rng(2)
    table = columns(600)
    table["rate_dph"] = factor * (earth + 0.3 + rng.normal(0.0, 2.0, 600))
    head = 'schema = 1\nserial = "A"\nearth_rate = "compute"\nlatitude_deg = 48.0\n'
    folder = made(
        tmp_path / "R", table, head=head, run='file = "a.csv"\naxis_azimuth_deg = 0.0\naxis_elevation_deg = 0.0'
    )
    if refused:
        with pytest.raises(InputError, match=r"Earth's rate along the axis|below that of any gyro"):
            load(folder)
    else:
        load(folder)


def test_three_axes_see_earths_rate_whole(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    direction = np.array([0.6, -0.64, 0.48])
    base = columns(600)
    table = {k: base[k] for k in ("time_s", "temperature_c")}
    for k, axis in enumerate("xyz"):
        table[f"rate_{axis}_dph"] = (EARTH_RATE_DPH * direction[k] + rng.normal(0.0, 2.0, 600)) / 3600.0
    with pytest.raises(InputError, match="three axes make"):
        load(made(tmp_path / "R", table, head='schema = 1\nserial = "A"\n'), axis="x")
    load(made(tmp_path / "S", table), axis="x")


def test_units_of_channels(tmp_path: Path) -> None:
    table = columns(600) | {
        "supply_v": np.full(600, 5000.0) + np.arange(600) % 3,
        "case_c": 300.0 + np.arange(600) / 600,
    }
    rows = load(made(tmp_path / "R", table, 'supply_v = "mV"\ncase_c = "K"')).runs[0].rows()
    assert rows.channels["supply_v"][0] == 5.0
    assert rows.channels["case_c"][0] == pytest.approx(26.85)


@pytest.mark.parametrize(
    ("units", "words"),
    [
        ('rate = "furlong/s"', ("field units.rate", "deg/h, deg/s, rad/s")),
        ('rate = "K"', ("field units.rate", "no unit of the kind")),
        ('suply_v = "mV"', ("field units.suply_v", "no such column")),
    ],
)
def test_a_wrong_declaration_is_reported_by_its_field(units: str, words: tuple[str, ...], tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        load(made(tmp_path / "R", columns(600), units))
    assert all(word in str(refused.value) for word in words), refused.value


def test_a_unit_with_pulses_is_refused(tmp_path: Path) -> None:
    from recordings import columns_of_pulses

    head = HEAD + "pulse_weight_arcsec = 1.0\n"
    with pytest.raises(InputError, match="count pulses"):
        load(made(tmp_path / "R", columns_of_pulses(), 'rate = "deg/s"', head=head))


def test_a_noisy_gyro_a_fast_board_and_wild_readings_are_not_suspected(tmp_path: Path) -> None:
    """Biases of thousands of deg/h, steps of a start, single wild temperatures: all of them are taken."""
    rng = np.random.default_rng(4)
    table = columns(600)
    table["rate_dph"] = -13000.0 + rng.normal(0.0, 50.0, 600)
    table["temperature_c"][:2] += [-20.0, -10.0]
    table["temperature_c"][300] = 180.0
    assert load(made(tmp_path / "R", table)).trusted == ()


@pytest.mark.parametrize(
    ("factor", "declared", "words"),
    [
        (1e6, "", ("above that of any gyro", '[units] rate = "..."')),  # a scale that was left out
        (10.0, 'rate = "rad/s"', ("above that of any gyro", "in deg/h it is", '[units] rate = "deg/h"')),
    ],
)
def test_noise_above_that_of_any_gyro_is_refused_unless_trusted(
    factor: float, declared: str, words: tuple[str, ...], tmp_path: Path
) -> None:
    """Laser gyros of 1e-4 and of 1e-3 deg/sqrt(h): no gyro has a million or 206,265 times that at rest."""
    table = columns(600)
    table["rate_dph"] = 7.6e-3 + np.random.default_rng(5).normal(0.0, 2e-3, 600)
    table["rate_dph"] *= factor
    folder = made(tmp_path / "R", table, declared)
    with pytest.raises(InputError) as refused:
        load(folder)
    assert all(word in str(refused.value) for word in (*words, "trust_units = true")), refused.value
    assert load(state(folder, "trust_units = true")).trusted


def test_noise_far_above_the_declared_one_is_refused_where_another_unit_makes_it_that(tmp_path: Path) -> None:
    """A gyro of 0.01 deg/sqrt(h) whose deg/h stand as deg/s: 36 deg/sqrt(h) is less than some gyro might have."""
    table = columns(600)
    period = float(table["time_s"][1] - table["time_s"][0])
    table["rate_dph"] = 20.0 + np.random.default_rng(7).normal(0.0, 0.01 * np.sqrt(3600.0 / period), 600)
    folder = made(tmp_path / "R", table, 'rate = "deg/s"')
    assert load(folder).trusted == ()
    with (folder / "dataset.toml").open("a") as file:
        file.write("\n[noise]\narw_deg_per_sqrt_h = 0.01\n")
    with pytest.raises(InputError, match=r"above that of a gyro of 0\.01 .* in deg/h it is 0\.0"):
        load(folder)
    remedy = (folder / "dataset.toml").read_text().replace('rate = "deg/s"', 'rate = "deg/h"')
    (folder / "dataset.toml").write_text(remedy)
    assert load(folder).trusted == ()


def test_gyros_of_every_class_are_taken_in_the_unit_that_is_declared(tmp_path: Path) -> None:
    """From a hemispherical resonator to the noisiest of vibrating gyros, some of them with a wild row."""
    rng = np.random.default_rng(6)
    for k, walk in enumerate((1e-4, 3e-3, 0.1, 0.6, 6.0)):
        table = columns(600)
        period = float(table["time_s"][1] - table["time_s"][0])
        table["rate_dph"] = 1e3 * walk + rng.normal(0.0, walk * np.sqrt(3600.0 / period), 600)
        table["rate_dph"][300] = 1e6
        assert load(made(tmp_path / f"R{k}", table)).trusted == ()


def test_the_command_refuses_and_takes_the_users_word(tmp_path: Path, gyrotc: Command) -> None:
    folder = made(tmp_path / "R", dps(columns(600)))
    with (folder / "dataset.toml").open("a") as file:
        file.write("[fit]\ncenters = 0\n")
    refused = gyrotc("fit", folder, "--out", tmp_path / "out")
    assert refused.returncode == 2 and '[units] rate = "deg/s"' in refused.stderr
    assert not (tmp_path / "out").exists()
    taken = gyrotc("fit", state(folder, "trust_units = true"), "--out", tmp_path / "out")
    assert taken.returncode == 0, taken.stderr
    training = json.loads((tmp_path / "out" / "training.json").read_text())
    assert "white noise" in training["units"]["trusted"][0]
