"""Rates in the unit that people ask for: every figure of a result and every sentence; one form of numbers."""

from __future__ import annotations

import re

import numpy as np
import pytest
from gyrotc.cli.main import application
from gyrotc.common.errors import InputError
from gyrotc.pages.display import (
    DISPLAYS,
    displayed,
    in_unit,
    rate_unit,
    sci,
    shown,
    shown_text,
    significant,
    with_uncertainty,
    words,
)
from gyrotc.pages.marks import AxisScale, scale_of
from gyrotc.results.base import Size
from gyrotc.results.diagnosed import ComparedStatistic, ParameterLikelihood
from gyrotc.results.recordings import DetectionLimit
from gyrotc.results.release import Contribution, Instrument, Limit
from gyrotc.results.training import AllanPoint, NoiseTerms
from typer.main import get_command
from typer.testing import CliRunner


@pytest.mark.parametrize("name, factor", [("deg/h", 1.0), ("deg/s", 1 / 3600), ("mdps", 1 / 3.6), ("arcsec/s", 1.0)])
def test_figures_change_by_the_factor_of_the_unit_and_other_numbers_stay(name: str, factor: float) -> None:
    noise = NoiseTerms(
        quantisation_arcsec=1.0, arw_deg_per_sqrt_h=2.0, bias_instability_dph=3.0, rate_random_walk_dph_per_sqrt_h=4.0,
        allan=(AllanPoint(tau_s=10.0, deviation_dph=5.0, freedom=6.0),),
    )  # fmt: skip
    limit = Limit(
        limit="at_most.rms_dph", measured=1.0, bound=2.0, met=True, expanded_uncertainty=0.5, coverage_factor=2.0,
        degrees_of_freedom=9.0, uncertainty_from="0.5 deg/h of noise",
    )  # fmt: skip
    bytes_ = Limit(limit="at_most.table_bytes", measured=100.0, bound=200.0, met=True)
    with displayed(name):
        one = shown(noise)
        assert one.bias_instability_dph == pytest.approx(3.0 * factor)
        assert one.rate_random_walk_dph_per_sqrt_h == pytest.approx(4.0 * factor)
        assert one.allan[0].deviation_dph == pytest.approx(5.0 * factor)
        assert (one.quantisation_arcsec, one.arw_deg_per_sqrt_h) == (1.0, 2.0)
        assert (one.allan[0].tau_s, one.allan[0].freedom) == (10.0, 6.0)
        held = shown(limit)
        assert (held.measured, held.bound) == (pytest.approx(factor), pytest.approx(2.0 * factor))
        assert held.expanded_uncertainty == pytest.approx(0.5 * factor)
        assert (held.coverage_factor, held.degrees_of_freedom) == (2.0, 9.0)
        assert shown(bytes_) == bytes_
        assert words("before_rms_dph").endswith(f", {name}") and rate_unit() == name
        assert in_unit([3.6, 7.2]) == pytest.approx(np.array([3.6, 7.2]) * factor)
    assert rate_unit() == "deg/h" and shown(limit) == limit


def test_an_uncertainty_in_another_unit_keeps_it_and_its_sensitivity_changes() -> None:
    part = {
        "id": "thermometer", "text": "t", "type": "B", "distribution": "normal", "standard_uncertainty": 0.1,
        "sensitivity": 3.6, "contribution_dph": 0.36, "freedom": None, "source": "s",
    }  # fmt: skip
    with displayed("mdps"):
        kelvin = shown(Contribution(unit="C", **part))
        rate = shown(Contribution(unit="deg/h", **part | {"sensitivity": 1.0}))
        assert (kelvin.standard_uncertainty, kelvin.unit) == (0.1, "C")
        assert (kelvin.sensitivity, kelvin.contribution_dph) == (pytest.approx(1.0), pytest.approx(0.1))
        assert (rate.unit, rate.sensitivity) == ("mdps", 1.0) and rate.standard_uncertainty == pytest.approx(0.1 / 3.6)
        table = Instrument(name="n", quantity="rate", expanded_uncertainty=3.6)
        assert shown(table).expanded_uncertainty == pytest.approx(1.0)


@pytest.mark.parametrize(
    "text, wanted",
    [
        ("a step of 3.6 deg/h", "a step of 1.0 mdps"),
        ("0.36 ... 7.2 deg/h", "0.10 ... 2.0 mdps"),
        ("+36 deg/h more", "+10 mdps more"),
        ("7.20e-04 deg/h", "2.00·10⁻⁴ mdps"),
        ("7.20·10⁻⁴ deg/h, not more", "2.00·10⁻⁴ mdps, not more"),
        ("(7.20 ± 0.36)·10⁻⁴ deg/h", "2.00·10⁻⁴ ± 1.0·10⁻⁵ mdps"),
        ("−3.6 ± 0.36 deg/h", "−1.0 ± 0.10 mdps"),
        ("3.6 deg/h/C stays", "3.6 deg/h/C stays"),
        ("no rate at all, 5 C", "no rate at all, 5 C"),
    ],
)
def test_sentences_keep_their_digits(text: str, wanted: str) -> None:
    with displayed("mdps"):
        assert shown_text(text) == wanted
    assert shown_text(text) == text.replace("7.20e-04", "7.20·10⁻⁴")


def test_limits_events_and_statistics_carry_their_unit_with_them() -> None:
    limit = DetectionLimit(value=3.6, unit="deg/h/C", parameter="tau_s", over=((600.0, 7.2), (900.0, None)))
    event = Size(value=3.6, low=1.8, high=7.2, unit="deg/h")
    warm = Size(value=1.0, low=0.5, high=2.0, unit="C")
    rms, share = (
        ComparedStatistic(
            statistic=name, measured=3.6, simulated_mean=1.8, simulated_low=0.0, simulated_high=3.6, p_value=0.5
        )
        for name in ("rms_dph", "autocorrelation")
    )
    of_size, of_time = (
        ParameterLikelihood(cause="a", parameter=name, values=(3.6, 7.2), gain=(-1.0, 0.0), low=None, high=7.2)
        for name in ("amplitude_dph", "tau_s")
    )
    with displayed("mdps"):
        found = shown(limit)
        assert (found.value, found.unit, found.over) == (1.0, "mdps/C", ((600.0, 2.0), (900.0, None)))
        assert (shown(event).high, shown(event).unit, shown(warm)) == (2.0, "mdps", warm)
        assert (shown(rms).measured, shown(rms).simulated_mean, shown(rms).p_value) == (1.0, 0.5, 0.5)
        assert shown(of_size).values == (1.0, 2.0) and shown(of_size).gain == (-1.0, 0.0)
        assert shown(share) == share and shown(of_time) == of_time


def test_a_unit_that_is_not_known_is_refused_with_those_that_are() -> None:
    with pytest.raises(InputError, match=re.escape(", ".join(DISPLAYS))), displayed("furlong"):
        pass


@pytest.mark.parametrize(
    "value, text",
    [
        (2764.0, "2764"), (1303.0, "1303"), (220.0, "220"), (0.0123456, "0.0123"), (7e-4, "7.00·10⁻⁴"), (-2.5, "−2.50"),
        (0.0, "0"), (None, "–"), (123456.0, "1.23·10⁵"), (0.5, "0.500"),
    ],
)  # fmt: skip
def test_numbers_have_one_form(value: float | None, text: str) -> None:
    assert sci(value) == text


def test_digits_go_with_the_uncertainty() -> None:
    assert with_uncertainty(0.0512345, 0.00412) == "0.0512 ± 0.0042"
    assert with_uncertainty(-7.212e-4, 2.41e-5) == "(−7.21 ± 0.25)·10⁻⁴"
    assert significant(659687.17, 3) == "6.60·10⁵"


def test_ticks_are_round_and_lie_on_the_axis() -> None:
    rng = np.random.default_rng(3)
    for _ in range(300):
        low = float(rng.normal() * 10.0 ** rng.integers(-6, 6))
        high = low + float(10.0 ** rng.uniform(-6, 6))
        scale = scale_of(np.array([low, high]), (None, None), False, 0.04)
        ticks = scale.ticks(6)
        assert 2 <= len(ticks) <= 8, (low, high, ticks)
        places = scale.place(np.array([at for at, _ in ticks]))
        assert np.all((places >= -1e-6) & (places <= 1 + 1e-6))
        texts = [text for _, text in ticks]
        assert len(set(texts)) == len(texts), (low, high, texts)
        log = scale_of(np.array([abs(low), abs(low) + high - low]), (None, None), True, 0.04)
        assert all(log.low * 0.999 <= at <= log.high * 1.001 for at, _ in log.ticks(6))
    assert AxisScale(0.0, 1.0).ticks(5)[0] == (0.0, "0.0")


def test_every_command_that_states_rates_takes_the_unit_and_refuses_another() -> None:
    commands = get_command(application()).commands  # type: ignore[attr-defined]
    takes = {name for name, one in commands.items() if any(p.name == "display" for p in one.params)}
    assert takes >= {
        "fit", "evaluate", "check", "build", "diagnose", "compare", "plan", "fleet", "lot", "report",
    }  # fmt: skip
    for name in sorted(takes):
        done = CliRunner().invoke(application(), [name, "--display", "knots", *["nowhere"] * 3])
        assert isinstance(done.exception, InputError) and "knots" in str(done.exception), name
    assert rate_unit() == "deg/h"
