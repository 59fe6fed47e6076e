"""Gain of an extension: shares, intervals, angle; what is shipped."""

from __future__ import annotations

import numpy as np
import pytest
from gyrotc.common.metrics import Averages
from gyrotc.diagnose.gain import floor_of, gain_of

HOURS, AVERAGE_S = 24, 100.0


def residual(values: np.ndarray) -> Averages:
    time = AVERAGE_S * (np.arange(values.size) + 0.5)
    return Averages(time_s=time, before_dph=values, after_dph=values, temperature_c=np.zeros(values.size))


def noise(seed: int, scale: float = 1.0) -> np.ndarray:
    return scale * np.random.default_rng(seed).standard_normal(36 * HOURS)


def test_the_share_is_of_what_can_be_removed() -> None:
    wave = np.sin(np.arange(36 * HOURS) / 40.0)
    before, after = residual(noise(1) + wave), residual(noise(1) + 0.5 * wave)
    gain = gain_of([before], [after], floor_of([residual(noise(1))]), AVERAGE_S)
    assert gain.share == pytest.approx(0.75, abs=0.08), "half of the amplitude, three quarters of the power"
    assert gain.low is not None and gain.high is not None and gain.low < 0.75 < gain.high
    assert gain.positive
    assert gain.rms_removed[0] < gain.rms_before - gain.rms_after < gain.rms_removed[1]
    assert gain.angle_removed is not None and gain.angle_removed[0] > 0.0


def test_a_loss_is_not_positive() -> None:
    wave = np.sin(np.arange(36 * HOURS) / 40.0)
    gain = gain_of([residual(noise(2))], [residual(noise(2) + 0.3 * wave)], 1.0, AVERAGE_S)
    assert not gain.positive and gain.rms_removed[0] < 0.0


def test_without_excess_there_is_no_share() -> None:
    gain = gain_of([residual(noise(3))], [residual(noise(3))], 1.1, AVERAGE_S)
    assert gain.share is None and gain.low is None


def test_slow_changes_and_outliers_are_not_floor() -> None:
    slow = 5.0 * np.sin(np.arange(36 * HOURS) / 300.0)
    spikes = np.zeros(36 * HOURS)
    spikes[::100] = 30.0
    assert floor_of([residual(noise(4) + slow)]) == pytest.approx(1.0, rel=0.08)
    assert floor_of([residual(noise(4) + spikes)]) == pytest.approx(1.0, rel=0.08)


def test_a_short_exam_has_an_interval() -> None:
    before, after = residual(noise(5)[:12] + 5.0), residual(noise(5)[:12])
    gain = gain_of([before], [after], 1.0, AVERAGE_S)
    assert gain.rms_removed[0] < gain.rms_removed[1], "twelfths where there is no half-hour"
    assert gain.angle_removed is None, "no run lasts an hour"


def test_no_gain_is_seldom_taken_for_one() -> None:
    """The lower limit is that of 95 %: of 200 pairs of equally large noise 2.5 % are to seem a gain, and chance."""
    found = [
        gain_of([residual(noise(100 + k))], [residual(noise(1000 + k))], 1.0, AVERAGE_S).positive
        for k in range(200)
    ]
    assert 0 < sum(found) <= 15, sum(found)
