"""What `gyrotc compare` shows, the last line of `build`, and the picture of all calibrations of a unit."""

from __future__ import annotations

import io
import re
from typing import Any

import numpy as np
import pytest
from gyrotc.cli.results import summary_lines
from gyrotc.common import Averages
from gyrotc.pages import (
    AFTER_DPH,
    BEFORE_DPH,
    ENVIRONMENTS,
    calibrations_over_time,
    comparison_picture,
    comparison_tables,
    with_published,
)
from gyrotc.results import (
    Calibration,
    Comparison,
    EvaluatedRun,
    Evaluation,
    Group,
    Method,
    ModelSizes,
    Pooled,
    RunStatistics,
)
from rich.console import Console


def result(environments: tuple[str, ...], after: float = 7e-4) -> Comparison:
    """A result of `compare` with two methods."""
    groups = tuple(
        Group(environment=name, samples=288, before_rms_dph=10.0 * after, before_std_dph=1.2 * after,
              after_rms_dph=after, after_std_dph=0.99 * after, improvement=1.2,
              improvement_about_zero=10.0)
        for name in environments
    )  # fmt: skip

    def method(id: str, centers: int, seconds: float) -> Method:
        return Method(
            id=id, groups=groups, centers=centers, train_s=seconds, exam_rms_dph=after, exam_std_dph=after,
            before_rms_dph=10.0 * after, improvement=1.2, improvement_about_zero=10.0, parameter_bytes=104,
            sum_abs_weights_dph=0.0,
            noise_floor_dph=after,
        )  # fmt: skip

    return Comparison(
        gyrotc_version="0.1.0", serial="A-1", axis=None, block_s=10.0, average_s=100.0, seed=0, judged_on="exam",
        noise_floor_dph=after, noise_floor_source="estimated",
        methods=(method("mlr", 0, 0.001), method("mrbf_paper", 7, 0.05)),
    )  # fmt: skip


def printed(shown: Comparison) -> str:
    out = io.StringIO()
    for table in comparison_tables(shown):
        Console(file=out, width=160).print(table)
    return out.getvalue()


def texts(svg: str) -> set[str]:
    return set(re.findall(r">([^<>]+)</text>", svg))


def test_the_paper_s_environments_have_the_paper_s_figures_beside_ours() -> None:
    shown = with_published(result(ENVIRONMENTS))
    for method in shown.methods:
        for group in method.groups:
            name, paper = group.environment, group.published
            assert paper is not None and paper.before_rms_dph == BEFORE_DPH[name]
            assert paper.after_rms_dph == AFTER_DPH[method.id][name]
            assert paper.improvement_about_zero == pytest.approx(BEFORE_DPH[name] / AFTER_DPH[method.id][name])
    assert shown.methods[1].published_train_s == (79.5, 82.6)
    assert "13.95" in printed(shown)
    assert "80-83" in printed(shown)
    assert {"here", "in the paper"} <= texts(comparison_picture(shown))


def test_other_environments_have_none() -> None:
    shown = with_published(result(("20 C", "warm")))
    assert shown == result(("20 C", "warm"))
    assert "in the paper" not in printed(shown)
    assert "in the paper" not in texts(comparison_picture(shown))


@pytest.mark.parametrize("environments", [("20 C",), tuple(f"run {k}" for k in range(14))])
def test_every_environment_and_method_is_in_the_picture(environments: tuple[str, ...]) -> None:
    found = texts(comparison_picture(result(environments)))
    assert {*environments, "mlr", "mrbf_paper"} <= found
    assert any("7 centers, 104 bytes" in text for text in found)


def test_long_names_of_environments_do_not_cut_those_of_methods() -> None:
    out = printed(result(tuple(f"recording-of-the-chamber.csv {k}000 ... {k + 1}000 s" for k in range(8))))
    assert "improvement" in out
    assert "mrbf_paper" in out
    assert "…" not in out


def test_no_residual_at_all_is_shown_as_zero() -> None:
    shown = result(("20 C",), after=0.0)
    assert "0.00" in printed(shown)
    assert comparison_picture(shown).startswith("<svg")


def test_the_same_result_gives_the_same_bytes() -> None:
    assert comparison_picture(result(ENVIRONMENTS)) == comparison_picture(result(ENVIRONMENTS))


RNG = np.random.default_rng(3)
BEFORE = 7e-3 + 9e-4 * RNG.normal(size=400)
AFTER = 7e-4 * RNG.normal(size=400)
CONSTANT = 7.2e-3  # mean of the training runs


def part(before: np.ndarray, after: np.ndarray) -> Pooled:
    still = np.zeros(len(before))
    return Pooled.of([Averages(still, before, after, still)], CONSTANT)


def evaluation(**changes: object) -> Evaluation:
    exam, train = part(BEFORE, AFTER), part(np.full(400, CONSTANT), AFTER)
    longer = dict.fromkeys(("rms_30min_dph", "angle_1h_arcsec", "first_10min_rms_dph"))
    runs = tuple(
        EvaluatedRun(file=f"{name}.csv", role="exam", environment=name, samples=400, before=exam.before,
                     constant=RunStatistics(**exam.constant.model_dump(), **longer),
                     after=RunStatistics(**exam.after.model_dump(), **longer))
        for name in ENVIRONMENTS
    )  # fmt: skip
    sizes = ModelSizes(method="mrbf", centers=4, table_bytes=104, rom_bytes=None, ram_bytes=None, sizes_on=None,
                       sum_abs_weights_dph=1e-3)  # fmt: skip
    fields: dict[str, object] = {
        "gyrotc_version": "0.1.0", "serial": "A-1", "axis": None, "numeric": "f32", "block_s": 10.0,
        "average_s": 100.0, "noise_floor_dph": 7e-4, "noise_floor_source": "simulated", "mismatches": None,
        "constant_dph": CONSTANT, "requirements": (), "runs": runs, "train": train, "exam": exam, "findings": (),
        "model": sizes,
    }  # fmt: skip
    return Evaluation(**{**fields, **changes})  # type: ignore[arg-type]


def rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2)))


ZERO, GAIN = rms(BEFORE) / rms(AFTER), rms(BEFORE - CONSTANT) / rms(AFTER)


def test_the_headline_is_the_gain_against_a_constant() -> None:
    assert GAIN < 0.2 * ZERO
    begins = f"improvement {GAIN:.2f} against a constant on test runs (about zero {ZERO:.1f}; paper: 9.8-10.4)"
    assert next(iter(summary_lines(evaluation()))).startswith(begins)


@pytest.mark.parametrize(
    ("changes", "on"),
    [
        ({"noise_floor_source": "estimated"}, "test runs"),
        ({"exam": None, "left_out": part(BEFORE, AFTER)}, "spans left out"),
        ({"exam": None, "train": part(BEFORE, AFTER)}, "the training runs themselves"),
    ],
)
def test_the_paper_stands_beside_its_own_campaign_alone(changes: dict[str, object], on: str) -> None:
    begins = f"improvement {GAIN:.2f} against a constant on {on} (about zero {ZERO:.1f})"
    assert next(iter(summary_lines(evaluation(**changes)))).startswith(begins)


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


def labels(svg: str | None) -> list[str]:
    assert svg is not None
    return [re.sub(r"<[^>]*>", "", text) for text in re.findall(r"<text.*?</text>", svg, re.DOTALL)]


def test_one_calibration_has_no_trend() -> None:
    assert calibrations_over_time([]) is None
    assert calibrations_over_time([calibration(0, DAYS[0])]) is None


def test_dates_stand_below_where_they_follow_one_another() -> None:
    shown = labels(calibrations_over_time([calibration(k, day) for k, day in enumerate(DAYS)]))
    assert all(shown.count(day) == 2 for day in DAYS)
    assert {"as found: the correction before", "as left: the new one"} <= set(shown)


@pytest.mark.parametrize("days", [(None,) * 4, ("2020-01-11",) * 4, ("spring", "2021", "2022", "2023"), DAYS[::-1]])
def test_without_dates_the_calibrations_are_counted(days: tuple[str | None, ...]) -> None:
    shown = labels(calibrations_over_time([calibration(k, day) for k, day in enumerate(days)]))
    assert shown.count("number of the calibration") == 2 and not set(DAYS) & set(shown)


def test_many_dates_become_days() -> None:
    many = [calibration(k, f"{2000 + k}-01-01") for k in range(20)]
    assert labels(calibrations_over_time(many)).count("days since the first calibration") == 2


def test_what_is_not_known_is_not_drawn() -> None:
    bare = dict.fromkeys(
        ("as_found_rms_dph", "as_left_rms_dph", "moved_rms_dph", "moved_mean_dph", "expanded_uncertainty_dph")
    )
    shown = labels(
        calibrations_over_time([calibration(k, day, **bare, significant=None) for k, day in enumerate(DAYS)])
    )
    assert "as found: the correction before" not in shown


def test_a_move_that_is_significant_is_filled() -> None:
    def hollow(significant: bool) -> int:
        history = [calibration(k, day, significant=significant if k else None) for k, day in enumerate(DAYS)]
        return str(calibrations_over_time(history)).count("a4 4 0 1 0 8 0")

    assert (hollow(False), hollow(True)) == (4, 1)
