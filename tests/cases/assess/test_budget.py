"""The uncertainty budget by hand, what is stated, and statements of conformity at their borders."""

from __future__ import annotations

from pathlib import Path
from statistics import NormalDist
from typing import Any

import numpy as np
import pytest
from gyrotc.assess import (
    Limits,
    budget_of,
    combined,
    decided,
    figure_uncertainties,
    instruments_in,
    last_day,
    load_limits,
)
from gyrotc.common import Averages, InputError, coverage_factor, statistics_of, time_statistics
from gyrotc.model import load_model
from gyrotc.pages import rounded, write_report
from gyrotc.recordings import load
from gyrotc.results import (
    Budget,
    Calibration,
    Changes,
    EvaluatedRun,
    Evaluation,
    FigureUncertainty,
    RunStatistics,
    Statistics,
    Training,
    Verification,
    read_optional,
    read_result,
    worst_of,
)
from gyrotc.simulate import simulate
from jobs import built_for_fleet

LIMITS = """schema = 1
[interval]
days = 730.5
drift_dph_per_year = 1e-4
[[instrument]]
name = "PT-7"
certificate = "K-4711"
quantity = "temperature"
expanded_uncertainty = 0.1
degrees_of_freedom = 9
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    data, folder = tmp_path_factory.mktemp("data"), tmp_path_factory.mktemp("built") / "paper"
    simulate("paper", seed=5, out=data / "paper", format="parquet")
    built_for_fleet(folder, load(data / "paper"))
    write_report(folder)
    return folder


def of(built: Path, limits: Limits | None = None, changes: Changes | None = None, **meta: Any) -> Budget:
    model = load_model(built / "model.json")
    return budget_of(
        model.model_copy(update={"meta": {**model.meta, **meta}}),
        read_result(built / "training.json", Training),
        read_result(built / "evaluate.json", Evaluation),
        read_optional(built / "verify.json", Verification),
        limits=limits,
        changes=changes,
    )


def test_the_sum_is_that_of_the_gum() -> None:
    """The example of JCGM 100:2008, G.4.1: means of 10, 5 and 15 readings, u 0.25, 0.57 and 0.82 %."""
    u, freedom = combined([(0.25, 9.0), (0.57, 4.0), (0.82, 14.0)])
    assert u == pytest.approx(1.03, abs=0.005)
    assert freedom == pytest.approx(19.0, abs=0.1)
    assert combined([(3.0, None), (4.0, None)]) == (5.0, None)
    assert combined([]) == (0.0, None)


def test_what_is_stated_is_in_and_what_is_not_is_named(built: Path, tmp_path: Path) -> None:
    bare = of(built)
    assert [text.split(":")[0] for text in bare.not_known] == ["thermometer", "reference rate", "ageing"]
    assert bare.valid_until is None
    (tmp_path / "limits.toml").write_text(LIMITS)
    base = {"name": "base", "quantity": "rate", "expanded_uncertainty": 3e-5, "coverage_factor": 3.0}
    whole = of(built, load_limits(tmp_path / "limits.toml"), instrument=[base], calibrated_on="2026-03-07")
    assert whole.not_known == ()
    parts = {one.id: one for one in whole.contributions}
    assert parts["reference"].standard_uncertainty == pytest.approx(1e-5)
    assert parts["thermometer"].certificate == "K-4711"
    assert parts["thermometer"].freedom == pytest.approx(9.0)
    assert parts["thermometer"].contribution_dph == pytest.approx(0.05 * parts["thermometer"].sensitivity)
    assert parts["ageing"].contribution_dph == pytest.approx(2.0 * 1e-4 / 3**0.5)
    assert whole.combined_dph**2 == pytest.approx(sum(p.contribution_dph**2 for p in whole.contributions))
    assert whole.expanded_dph == pytest.approx(whole.coverage_factor * whole.combined_dph)
    assert whole.expanded_dph > bare.expanded_dph
    assert whole.valid_until == "2028-03-06"


def test_what_is_computed_from_repeated_measurements_is_of_type_a_and_what_is_stated_of_type_b(
    built: Path, tmp_path: Path
) -> None:
    """JCGM 100:2008, 4.2 and 4.3."""
    (tmp_path / "limits.toml").write_text(LIMITS)
    base = {"name": "base", "quantity": "rate", "expanded_uncertainty": 3e-5, "coverage_factor": 3.0}
    parts = of(built, load_limits(tmp_path / "limits.toml"), instrument=[base]).contributions
    stated = {"thermometer", "reference", "arithmetic", "ageing"}
    assert {one.id for one in parts} >= {"noise", "fit", "thermometer", "reference", "ageing"}
    assert {one.id: one.type for one in parts} == {one.id: "B" if one.id in stated else "A" for one in parts}


def test_the_drift_of_a_year_comes_from_earlier_calibrations_with_their_dates(built: Path, tmp_path: Path) -> None:
    """Two moves in 366 and 365 days, over an interval of two years; a calibration without a date counts for nothing."""
    (tmp_path / "limits.toml").write_text("schema = 1\n[interval]\ndays = 730.5\n")
    moved = {"2024-01-01": None, "2025-01-01": 3e-4, "2026-01-01T08:00": -1e-4, None: 9e-4}
    figures = ("as_found_rms_dph", "as_left_rms_dph", "moved_rms_dph", "expanded_uncertainty_dph", "significant")
    history = tuple(
        Calibration.model_validate(
            {"date": day, "model_hash": "a" * 64, "moved_mean_dph": mean} | dict.fromkeys(figures)
        )
        for day, mean in moved.items()
    )
    limits = load_limits(tmp_path / "limits.toml")
    parts = {one.id: one for one in of(built, limits, Changes.model_construct(history=history)).contributions}
    drifts = np.array([3e-4 / 366.0, -1e-4 / 365.0]) * 365.25
    assert parts["ageing"].contribution_dph == pytest.approx(2.0 * np.sqrt(np.mean(drifts**2)))
    assert (parts["ageing"].freedom, parts["ageing"].type) == (2.0, "A")


def test_noise_fit_and_power_on_are_what_the_table_states(built: Path) -> None:
    parts = {one.id: one.contribution_dph for one in of(built).contributions}
    stated = read_result(built / "evaluate.json", Evaluation).sigma_rms_dph
    assert stated is not None
    known = load_model(built / "model.json").uncertainty_dph
    assert known is not None and known.rules is not None
    assert parts["turn_on"] == known.rules.turn_on_dph
    of_map = parts["noise"] ** 2 + parts["fit"] ** 2
    assert of_map + known.rules.between_dph**2 == pytest.approx(stated**2), "the table has one sigma by Student's t"


def test_an_instrument_that_is_not_well_stated_is_refused() -> None:
    for wrong, reported in (
        ({"name": "T", "uncertainty": 1.0}, "meta.instrument.0, field uncertainty"),
        ({"certificate": "1"}, "meta.instrument.0, field name"),
        ("T", "meta.instrument.0"),
        ({"name": "T", "expanded_uncertainty": -1.0}, "expanded_uncertainty"),
    ):
        with pytest.raises(InputError, match=reported):
            instruments_in({"instrument": [wrong]})
    with pytest.raises(InputError, match="list of tables"):
        instruments_in({"instrument": "T"})


def test_the_last_day_of_an_interval() -> None:
    assert last_day("2026-03-07T08:00:00Z", 365.0) == "2027-03-07"
    assert last_day("last spring", 365.0) is None and last_day(None, 1.0) is None


def test_an_uncertainty_is_rounded_up_to_two_digits() -> None:
    assert [rounded(v) for v in (1.311e-4, 2.0e-4, 0.0, 0.1234)] == ["1.4·10⁻⁴", "2.0·10⁻⁴", "0", "0.13"]


def test_build_writes_the_budget_and_the_page_tells_it(built: Path) -> None:
    budget = read_result(built / "budget.json", Budget)
    page = (built / "report.html").read_text("utf-8")
    assert f"0 ± {rounded(budget.expanded_dph)} deg/h" in page
    for one in budget.contributions:
        assert one.text in page
    assert "Not known, and so not in U:" in page


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
    rules: dict[Any, str] = {"guard_band": "CONDITIONAL PASS", "guard_band_binary": "FAIL", "simple_acceptance": "PASS"}
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
    return figure_uncertainties(runs, reported_of(runs), 100.0, floor=(1.0, 1728))


def reported_of(runs: list[Averages]) -> list[EvaluatedRun]:
    return [
        EvaluatedRun(
            file="a.csv", role="exam", environment=None, samples=a.after_dph.size,
            before=Statistics(**statistics_of(a.before_dph)),
            constant=RunStatistics(**statistics_of(a.before_dph), **time_statistics(a, 100.0)),
            after=RunStatistics(**statistics_of(a.after_dph), **time_statistics(a, 100.0)),
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
    assert figure_uncertainties([one_sample], reported_of([one_sample]), 100.0).keys() <= {"first_10min_rms_dph"}


def test_the_largest_of_many_scatters_as_stated() -> None:
    draw = np.random.default_rng(11)
    largest = [float(np.abs(draw.normal(size=1728)).max()) for _ in range(2000)]
    runs = [Averages(100.0 * np.arange(1728), draw.normal(size=1728), draw.normal(size=1728), np.zeros(1728))]
    assert uncertainties(runs)["max_abs_dph"].standard == pytest.approx(np.std(largest), rel=0.15)
