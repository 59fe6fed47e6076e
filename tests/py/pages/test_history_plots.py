"""The picture of all calibrations of a unit: what its points say is what the results say."""

from __future__ import annotations

import re
from typing import Any

import pytest
from gyrotc.pages.plots import calibrations_over_time
from gyrotc.results.evaluation import Calibration

DAYS = ("2020-01-11", "2021-02-11", "2023-03-11", "2024-04-11")


def calibration(k: int, date: str | None, **more: Any) -> Calibration:
    known: dict[str, Any] = {
        "as_found_rms_dph": 9e-4 + 1e-4 * k if k else None,
        "as_left_rms_dph": 7e-4,
        "moved_rms_dph": 4e-4 if k else None,
        "moved_mean_dph": 3e-4 if k else None,
        "expanded_uncertainty_dph": 1e-4 if k else None,
        "significant": k % 2 == 0 if k else None,
    }
    return Calibration.model_validate({"date": date, "model_hash": "a" * 64} | known | more)


def texts(svg: str | None) -> list[str]:
    assert svg is not None
    return [re.sub(r"<[^>]*>", "", text) for text in re.findall(r"<text.*?</text>", svg, re.DOTALL)]


def test_one_calibration_has_no_trend() -> None:
    assert calibrations_over_time([]) is None
    assert calibrations_over_time([calibration(0, DAYS[0])]) is None


def test_dates_stand_below_where_they_follow_one_another() -> None:
    shown = texts(calibrations_over_time([calibration(k, day) for k, day in enumerate(DAYS)]))
    assert all(shown.count(day) == 2 for day in DAYS)
    assert {"as found: the correction before", "as left: the new one"} <= set(shown)


@pytest.mark.parametrize(
    "days", [(None,) * 4, ("2020-01-11",) * 4, ("spring", "2021", "2022", "2023"), DAYS[::-1]]
)
def test_without_dates_the_calibrations_are_counted(days: tuple[str | None, ...]) -> None:
    shown = texts(calibrations_over_time([calibration(k, day) for k, day in enumerate(days)]))
    assert shown.count("number of the calibration") == 2 and not set(DAYS) & set(shown)


def test_many_dates_become_days() -> None:
    many = [calibration(k, f"{2000 + k}-01-01") for k in range(20)]
    assert texts(calibrations_over_time(many)).count("days since the first calibration") == 2


def test_what_is_not_known_is_not_drawn() -> None:
    bare = dict.fromkeys(
        ("as_found_rms_dph", "as_left_rms_dph", "moved_rms_dph", "moved_mean_dph", "expanded_uncertainty_dph")
    )
    shown = texts(
        calibrations_over_time([calibration(k, day, **bare, significant=None) for k, day in enumerate(DAYS)])
    )
    assert "as found: the correction before" not in shown


def test_a_move_that_is_significant_is_filled() -> None:
    def filled(significant: bool) -> int:
        history = [calibration(k, day, significant=significant if k else None) for k, day in enumerate(DAYS)]
        return len(re.findall(r'<use [^>]*style="fill: #ffffff', str(calibrations_over_time(history))))

    assert (filled(False), filled(True)) == (4, 1)
