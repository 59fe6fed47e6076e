"""Pictures that hand-made results give: each series is found by its legend and is that of the result."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gyrotc.fleet import write_summary
from gyrotc.pages import (
    AFTER_DPH,
    BEFORE_DPH,
    ENVIRONMENTS,
    calibrations_over_time,
    prior_and_posterior,
    with_published,
)
from gyrotc.results import Calibration, Comparison, FleetEntry, Group, Method
from read_pictures import panels_of, pictures_of

NEAR = 0.15
"""Points of a picture: places are rounded to a tenth."""


def calibrations() -> list[Calibration]:
    """Four of them; the second one moved the map by more than its uncertainty."""
    rows: list[tuple[Any, ...]] = [
        ("2024-03-01", None, 7.0e-4, None, None, None),
        ("2025-02-11", 9.0e-4, 6.5e-4, 4e-4, 1e-4, True),
        ("2025-09-30", 8.1e-4, 7.4e-4, -1e-4, 3e-4, False),
        ("2026-03-07", 9.9e-4, 6.1e-4, 2e-4, 4e-4, False),
    ]
    names = ("date", "as_found_rms_dph", "as_left_rms_dph", "moved_mean_dph", "expanded_uncertainty_dph", "significant")
    return [
        Calibration(model_hash=str(k), moved_rms_dph=None, **dict(zip(names, row, strict=True)))
        for k, row in enumerate(rows)
    ]


def test_calibrations_are_drawn_as_found_and_as_left_and_moves_are_summed() -> None:
    history = calibrations()
    left, right = (panels_of(picture)[0] for picture in pictures_of(str(calibrations_over_time(history))))
    days = np.array([np.datetime64(str(one.date)) for one in history])
    at = (days - days[0]).astype(float)
    places = at / at[-1]
    for label, values, k in (
        ("as found: the correction before", [one.as_found_rms_dph for one in history[1:]], 1),
        ("as left: the new one", [one.as_left_rms_dph for one in history], 0),
    ):
        line = left.labelled(label)
        assert line.pixels[:, 1] == pytest.approx(left.places(np.zeros(4 - k), np.array(values))[:, 1], abs=NEAR)
        whole = left.labelled("as left: the new one").pixels[[0, -1], 0]
        assert line.pixels[:, 0] == pytest.approx(whole[0] + places[k:] * np.ptp(whole), abs=NEAR)
    total = np.array([0.0, 4e-4, 3e-4, 5e-4])
    line = right.labelled("since the first calibration")
    assert line.pixels[:, 1] == pytest.approx(right.places(np.zeros(4), total)[:, 1], abs=NEAR)
    moved = right.labelled("moved by more than U", "dots")
    assert moved.pixels[:, 0] == pytest.approx(line.pixels[1:2, 0], abs=0.3)
    (bars,) = (s for s in right.series if s.kind == "errors")
    for k, (mean, spread) in enumerate(((4e-4, 1e-4), (3e-4, 3e-4), (5e-4, 4e-4))):
        drawn = right.places(np.zeros(2), np.array([mean - spread, mean + spread]))[:, 1]
        assert bars.pixels[2 * k : 2 * k + 2, 1] == pytest.approx(drawn, abs=NEAR)


def test_prior_and_posterior_have_each_their_own_line_and_band(model_dict: dict[str, Any]) -> None:
    t = np.linspace(-20.0, 60.0, 9)
    curve = SimpleNamespace(
        temperature_c=t, prior_dph=7e-3 + 1e-5 * t, prior_sigma_dph=np.full(9, 4e-4), posterior_dph=7e-3 + 2e-5 * t,
        posterior_sigma_dph=np.full(9, 1e-4),
    )  # fmt: skip
    training: Any = SimpleNamespace(lot=None, prior=SimpleNamespace(curve=curve), means=None)
    (panel,) = panels_of(pictures_of(str(prior_and_posterior(training, 7e-3)))[0])
    bands = [s for s in panel.series if s.kind == "band"]
    for band, label, mean, sigma in (
        (bands[0], "the earlier model after ageing", 1e-5 * t, 4e-4),
        (bands[1], "with this unit's own runs", 2e-5 * t, 1e-4),
    ):
        line = panel.labelled(label)
        assert line.colour == band.colour
        assert panel.pixels_off(line, t, mean) < NEAR
        around = np.r_[mean - 2.0 * sigma, (mean + 2.0 * sigma)[::-1]]
        assert panel.pixels_off(band, np.r_[t, t[::-1]], around) < NEAR


def test_a_fleet_is_drawn_with_a_constant_and_with_its_maps_in_the_order_of_what_remains(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    before, after = rng.uniform(5e-3, 2e-2, 12), rng.uniform(5e-4, 2e-3, 12)
    write_summary(
        tmp_path,
        [
            FleetEntry(
                name=f"U{k}",
                axis=None,
                status="done",
                model_hash="0",
                constant_rms_dph=float(b),
                after_rms_dph=float(a),
            )
            for k, (b, a) in enumerate(zip(before, after, strict=True))
        ],
    )
    page = (tmp_path / "fleet.html").read_text("utf-8")
    (panel,) = (p for picture in pictures_of(page) for p in panels_of(picture) if p.x.words.startswith("gyros"))
    order = np.argsort(after)
    for label, values in (("constant", before[order]), ("after", after[order])):
        dots = panel.labelled(label, "dots")
        drawn = panel.places(np.arange(1.0, 13.0), values)
        assert dots.pixels[np.argsort(dots.pixels[:, 0])] == pytest.approx(drawn, abs=0.25 + NEAR)


@pytest.mark.parametrize("environment", ENVIRONMENTS)
def test_the_paper_s_improvement_is_before_over_after(environment: str) -> None:
    group = Group(
        environment=environment, samples=10, before_rms_dph=1.0, before_std_dph=1.0, after_rms_dph=0.1,
        after_std_dph=0.1, improvement=1.2, improvement_about_zero=10.0,
    )  # fmt: skip
    method = Method(
        id="mrbf_paper", groups=(group,) * 1, centers=1, train_s=1.0, exam_rms_dph=0.1, exam_std_dph=0.1,
        before_rms_dph=1.0, improvement=1.2, improvement_about_zero=10.0, parameter_bytes=1, sum_abs_weights_dph=0.0,
        noise_floor_dph=0.1,
    )  # fmt: skip
    shown = with_published(
        Comparison(
            gyrotc_version="0", serial="A", axis=None, block_s=10.0, average_s=100.0, seed=0, judged_on="exam",
            noise_floor_dph=0.1, noise_floor_source="estimated", methods=(method,),
        )
    )  # fmt: skip
    published = shown.methods[0].groups[0].published
    if published is not None:
        ratio = BEFORE_DPH[environment] / AFTER_DPH["mrbf_paper"][environment]
        assert published.improvement_about_zero == pytest.approx(ratio) and ratio > 1.0
