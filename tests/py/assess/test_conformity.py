"""Statements of conformity: the decision rules at their borders, and uncertainties that cover what they claim."""

from __future__ import annotations

from statistics import NormalDist
from typing import Any

import numpy as np
import pytest
from gyrotc.assess.evaluate import figure_uncertainties
from gyrotc.assess.limits import coverage_factor, decided, worst_of
from gyrotc.common.metrics import Averages, statistics, time_statistics
from gyrotc.results.evaluation import EvaluatedRun, FigureUncertainty, RunStatistics, Statistics

KNOWN = FigureUncertainty(standard=0.05, freedom=None, method="noise")
SEED = 20

CASES = [  # measured, rule, verdict, met; the limit is at most 1, U = 0.1
    (0.89, "guard_band", "PASS", True),
    (0.91, "guard_band", "CONDITIONAL PASS", True),
    (1.01, "guard_band", "FAIL", False),
    (0.89, "guard_band_binary", "PASS", True),
    (0.91, "guard_band_binary", "FAIL", False),
    (0.91, "simple_acceptance", "PASS", True),
    (1.01, "simple_acceptance", "FAIL", False),
]


@pytest.mark.parametrize(("measured", "rule", "verdict", "met"), CASES)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_decision_rules(measured: float, rule: Any, verdict: str, met: bool, sign: float) -> None:
    bound = sign  # a lower limit is an upper one of the other sign
    one = decided("at_most.rms_dph", sign * measured, bound, sign, rule, KNOWN)
    assert (one.verdict, one.met) == (verdict, met)
    assert one.expanded_uncertainty == pytest.approx(0.1)
    assert one.guard_band == (0.0 if rule == "simple_acceptance" else pytest.approx(0.1))
    assert one.acceptance_limit == pytest.approx(bound - sign * (one.guard_band or 0.0))
    if met:
        assert one.false_acceptance == pytest.approx(NormalDist().cdf((measured - 1.0) / 0.05))
    else:
        assert one.false_acceptance is None


def test_what_passes_with_a_guard_band_is_seldom_beyond_its_limit() -> None:
    one = decided("at_most.rms_dph", 0.8999, 1.0, 1.0, "guard_band", KNOWN)
    assert one.verdict == "PASS" and one.false_acceptance == pytest.approx(0.0227, abs=2e-4)


def test_an_unknown_uncertainty_cannot_pass_without_condition() -> None:
    rules: dict[Any, str] = {
        "guard_band": "CONDITIONAL PASS",
        "guard_band_binary": "FAIL",
        "simple_acceptance": "PASS",
    }
    for rule, verdict in rules.items():
        one = decided("at_most.rms_dph", 0.5, 1.0, 1.0, rule, None)
        assert (one.verdict, one.expanded_uncertainty, one.uncertainty_from) == (verdict, None, "not known")
    assert decided("at_most.centers", 4.0, 12.0, 1.0, "guard_band", "counted").verdict == "PASS"
    assert decided("at_most.rms_dph", None, 12.0, 1.0, "guard_band", KNOWN).verdict == "FAIL"


def test_the_worst_verdict_is_that_of_the_whole() -> None:
    assert worst_of(["PASS", "CONDITIONAL PASS", "PASS"]) == "CONDITIONAL PASS"
    assert worst_of(["CONDITIONAL PASS", "FAIL", "PASS"]) == "FAIL"
    assert worst_of([]) is None


def test_the_coverage_factor_is_2_for_many_and_students_t_for_few() -> None:
    assert coverage_factor(None) == 2.0
    assert coverage_factor(1e6) == pytest.approx(2.0, abs=1e-4)
    assert coverage_factor(10.0) == pytest.approx(2.28, abs=0.01)  # JCGM 100:2008, table G.2


def exam(draw: np.random.Generator, hours: int, correlation_s: float) -> list[Averages]:
    """Six runs of unit noise, of which half the variance decays over `correlation_s`."""
    runs = []
    for _ in range(6):
        n = 36 * hours
        keep = float(np.exp(-100.0 / correlation_s))
        slow = np.empty(n)
        slow[0] = draw.normal()
        for k in range(1, n):
            slow[k] = keep * slow[k - 1] + np.sqrt(1.0 - keep**2) * draw.normal()
        after = np.sqrt(0.5) * (slow + draw.normal(size=n))
        runs.append(Averages(100.0 * np.arange(n), after + 5.0, after, np.zeros(n)))
    return runs


@pytest.mark.parametrize("correlation_s", [1.0, 1200.0])
def test_stated_uncertainties_cover_the_truth(correlation_s: float) -> None:
    """95 % of exams hold the true RMS, mean and standard deviation within U, also where the noise is not white."""
    print("seed", SEED)
    draw = np.random.default_rng(SEED)
    inside = {"rms_dph": 0, "mean_dph": 0}
    exams = 300
    for _ in range(exams):
        runs = exam(draw, 8, correlation_s)
        known = uncertainties(runs)
        after = np.concatenate([a.after_dph for a in runs])
        for name, value, truth in (
            ("rms_dph", float(np.sqrt(np.mean(after**2))), 1.0),
            ("mean_dph", float(after.mean()), 0.0),
        ):
            one = known[name]
            inside[name] += abs(value - truth) <= coverage_factor(one.freedom) * one.standard
    for name, count in inside.items():
        # 4 sigma of a binomial of 95 % are 5 points
        assert 0.89 <= count / exams <= 1.0, (name, count)


def uncertainties(runs: list[Averages]) -> dict[str, FigureUncertainty]:
    return figure_uncertainties(runs, told_of(runs), 100.0, floor=(1.0, 1728))


def told_of(runs: list[Averages]) -> list[EvaluatedRun]:
    return [
        EvaluatedRun(
            file="a.csv", role="exam", environment=None, samples=a.after_dph.size,
            before=Statistics(**statistics(a.before_dph)),
            after=RunStatistics(**statistics(a.after_dph), **time_statistics(a, 100.0)),
        )
        for a in runs
    ]  # fmt: skip


def test_every_noise_figure_has_an_uncertainty_and_a_short_exam_says_less() -> None:
    draw = np.random.default_rng(3)
    known = uncertainties(exam(draw, 8, 1.0))
    assert set(known) == {
        "rms_dph", "std_dph", "mean_dph", "max_abs_dph", "rms_over_floor", "improvement", "rms_30min_dph",
        "angle_1h_arcsec", "first_10min_rms_dph",
    }  # fmt: skip
    # white noise: 1/sqrt(2n) of RMS; the floor's 3/4n beside it
    assert known["rms_dph"].standard == pytest.approx(1.0 / np.sqrt(2 * 1728), rel=0.5)
    assert known["rms_over_floor"].standard > known["rms_dph"].standard
    shorter = uncertainties(exam(draw, 1, 1.0)[:1])
    assert shorter["rms_dph"].standard > 2.0 * known["rms_dph"].standard
    one_sample = Averages(np.zeros(1), np.ones(1), np.ones(1), np.zeros(1))
    assert figure_uncertainties([one_sample], told_of([one_sample]), 100.0).keys() <= {"first_10min_rms_dph"}


def test_the_largest_of_many_scatters_as_stated() -> None:
    draw = np.random.default_rng(11)
    largest = [float(np.abs(draw.normal(size=1728)).max()) for _ in range(2000)]
    runs = [Averages(100.0 * np.arange(1728), draw.normal(size=1728), draw.normal(size=1728), np.zeros(1728))]
    assert uncertainties(runs)["max_abs_dph"].standard == pytest.approx(np.std(largest), rel=0.15)
