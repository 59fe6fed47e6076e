"""Decisions near their thresholds, and worst cases in every position.

Each threshold has a case on either side, in which nothing but the statistic of this decision differs; what is the worst
of several runs, axes or arithmetics is tried in the first place, in the middle and in the last. Factors of coverage are
those of scipy's t distribution; the rest is arithmetic by hand.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
import pytest
from gyrotc.assess import (
    AtMost,
    Earlier,
    Limits,
    budget_of,
    changes_since,
    decided,
    figure_uncertainties,
    findings_of,
    held_against,
)
from gyrotc.common import Averages, InputError, statistics_of, time_statistics
from gyrotc.jobs import reason_of_release
from gyrotc.model import Model
from gyrotc.quality import late_findings
from gyrotc.recordings import Dataset, load
from gyrotc.results import (
    DeclaredUnits,
    EvaluatedRun,
    Evaluation,
    FigureUncertainty,
    Finding,
    LastingError,
    Manifest,
    MapDifference,
    ModelSizes,
    Pooled,
    RunStatistics,
    Statistics,
    worst_of,
)
from recordings import columns, toml, write_csv
from scipy import stats

NEAR = 0.02
"""Share of a guard band or limit by which a case lies on its side."""
RULES = ("guard_band", "guard_band_binary", "simple_acceptance")


def k_of(freedom: float | None) -> float:
    """Of 95.45 %: as far as 2 sigma of a normal distribution, by JCGM 100:2008, G.3.4."""
    upper = stats.norm.cdf(2.0)
    return float(stats.norm.ppf(upper) if freedom is None else stats.t.ppf(upper, freedom))


def verdict_of(measured: float, rule: Any, freedom: float | None, part: Any, sign: float) -> str:
    known = FigureUncertainty(standard=0.05, freedom=freedom, method="by hand")
    return decided("at_most.rms_dph", measured, 1.0, sign, rule, known, part).verdict or ""


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("freedom", [None, 5.0, 12.0])
@pytest.mark.parametrize("rule", RULES)
def test_a_figure_is_decided_at_its_acceptance_limit_and_at_its_limit(
    rule: Any, freedom: float | None, sign: float
) -> None:
    """ILAC-G8:09/2019, 4.2: PASS up to the limit less U, FAIL beyond the limit, between them as the rule says."""
    band = 0.0 if rule == "simple_acceptance" else k_of(freedom) * 0.05
    between = {"guard_band": "CONDITIONAL PASS", "guard_band_binary": "FAIL", "simple_acceptance": "PASS"}[rule]
    for away, expected in (
        (band + NEAR * 0.05, "PASS"),
        (band - NEAR * 0.05, between if band else "FAIL"),
        (NEAR * 0.05, between),
        (-NEAR * 0.05, "FAIL"),
    ):
        assert verdict_of(1.0 - sign * away, rule, freedom, "exam", sign) == expected, away


@pytest.mark.parametrize(("freedom", "expected"), [(4.9, "CONDITIONAL PASS"), (5.0, "PASS")])
@pytest.mark.parametrize("rule", RULES)
def test_an_uncertainty_of_fewer_than_five_degrees_of_freedom_gives_no_plain_pass(
    rule: Any, freedom: float, expected: str
) -> None:
    expected = "PASS" if rule == "simple_acceptance" else expected
    assert verdict_of(0.1, rule, freedom, "exam", 1.0) == expected


@pytest.mark.parametrize(("part", "expected"), [("train", "CONDITIONAL PASS"), ("left_out", "PASS"), ("exam", "PASS")])
@pytest.mark.parametrize("rule", RULES)
def test_training_runs_alone_give_no_plain_pass(rule: Any, part: Any, expected: str) -> None:
    assert verdict_of(0.1, rule, 30.0, part, 1.0) == expected


@pytest.mark.parametrize("order", list(permutations(("PASS", "CONDITIONAL PASS", "FAIL"))))
def test_the_gravest_verdict_counts_wherever_it_is(order: Any) -> None:
    assert worst_of(order) == "FAIL"
    assert worst_of(v for v in order if v != "FAIL") == "CONDITIONAL PASS"
    assert worst_of([None, *order[:1], None]) == order[0]


@pytest.mark.parametrize("worst", range(3))
@pytest.mark.parametrize("verdict", ["FAIL", "CONDITIONAL PASS"])
def test_a_unit_is_released_only_if_each_of_its_axes_is(verdict: str, worst: int, tmp_path: Any) -> None:
    axes = [SimpleNamespace(decision="PASS", failures=[], named=lambda _: "") for _ in range(3)]
    assert reason_of_release(tmp_path, axes, None) is None  # type: ignore[arg-type]
    axes[worst].decision = verdict
    with pytest.raises(InputError, match=f"its verdict is {verdict}"):
        reason_of_release(tmp_path, axes, None)  # type: ignore[arg-type]


NOTHING = dict.fromkeys(("mean_dph", "std_dph", "rms_dph", "max_abs_dph"))
OF_RUNS = ("rms_30min_dph", "angle_1h_arcsec", "first_10min_rms_dph")


def evaluated(role: Literal["train", "exam"], **figures: float | None) -> EvaluatedRun:
    after = RunStatistics(**NOTHING, **(dict.fromkeys(OF_RUNS, 1.0) | figures))
    constant = RunStatistics(**NOTHING, **dict.fromkeys(OF_RUNS, 1.0))
    return EvaluatedRun(
        file="a.csv", role=role, environment=None, samples=9, before=Statistics(**NOTHING), constant=constant,
        after=after,
    )  # fmt: skip


def evaluation_of(runs: list[EvaluatedRun], **changes: Any) -> Evaluation:
    pooled = Pooled(
        before=Statistics(mean_dph=0.0, std_dph=0.01, rms_dph=0.01, max_abs_dph=0.03),
        constant=Statistics(mean_dph=0.0, std_dph=0.01, rms_dph=0.01, max_abs_dph=0.03),
        after=Statistics(mean_dph=0.0, std_dph=0.001, rms_dph=0.001, max_abs_dph=0.003),
        improvement=10.0,
        improvement_about_zero=10.0,
        samples=1000,
    )
    role = "exam" if any(run.role == "exam" for run in runs) else "train"
    content: dict[str, Any] = {
        "gyrotc_version": "0", "serial": "RLG-0042", "axis": None, "numeric": "f32", "block_s": 10.0,
        "average_s": 100.0, "noise_floor_dph": 0.001, "noise_floor_source": "estimated", "mismatches": 0,
        "constant_dph": 0.0, "requirements": (),
        "runs": tuple(runs), "train": None, "exam": None, "findings": (),
        "model": ModelSizes(
            method="mrbf", centers=4, table_bytes=104, rom_bytes=None, ram_bytes=None, sizes_on=None,
            sum_abs_weights_dph=0.02,
        ),
        role: pooled,
    }  # fmt: skip
    return Evaluation(**(content | changes))


@pytest.mark.parametrize("worst", range(3))
@pytest.mark.parametrize("name", OF_RUNS)
@pytest.mark.parametrize("role", ["exam", "train"])
def test_a_limit_of_the_worst_run_sees_the_worst_one_wherever_it_is(
    role: Literal["train", "exam"], name: str, worst: int, model_dict: dict[str, Any]
) -> None:
    runs = [evaluated(role, **{name: 3.0 if k == worst else 1.0}) for k in range(3)]
    others = [evaluated("train", **{name: 99.0})] if role == "exam" else []
    limits = Limits(schema=1, at_most=AtMost(**{name: 2.0}), decision_rule="simple_acceptance")
    for made in (evaluation_of([*runs, *others]), evaluation_of([*others, *runs])):
        (one,) = held_against(limits, Model.from_dict(model_dict), made, None).limits
        assert (one.measured, one.verdict) == (3.0, "FAIL")


@pytest.mark.parametrize("place", [(0, 0), (1, 2), (2, 1)])
def test_a_limit_of_sigma_sees_the_worst_cell_wherever_it_is(place: Any, model_dict: dict[str, Any]) -> None:
    rows = np.full((3, 3), 1e-4)
    rows[place] = 3e-4
    model = Model.from_dict(model_dict | {"uncertainty_dph": {"cells": [3, 3], "rows": rows.tolist()}})
    for bound, expected in ((2.9e-4, "FAIL"), (3.1e-4, "PASS")):
        limits = Limits(schema=1, at_most=AtMost(uncertainty_dph=bound))
        (one,) = held_against(limits, model, evaluation_of([evaluated("exam")]), None).limits
        assert (one.measured, one.verdict) == (3e-4, expected)


@pytest.mark.parametrize("worst", range(3))
def test_the_uncertainty_of_the_worst_run_is_that_of_the_worst_one(worst: int) -> None:
    """RMS of m normal windows: its relative standard uncertainty is 1/√(2m)."""
    rng = np.random.default_rng(worst)
    averages, runs = [], []
    for k in range(3):
        n = 72 * (k + 1)  # of 100 s: 2, 4 and 6 hours
        after = rng.normal(size=n) * (5.0 if k == worst else 1.0)
        one = Averages(100.0 * (np.arange(n) + 0.5), after, after, np.zeros(n))
        averages.append(one)
        runs.append(evaluated("exam", **time_statistics(one, 100.0)))
    found = figure_uncertainties(averages, runs, 100.0)
    windows = {"rms_30min_dph": 4 * (worst + 1), "angle_1h_arcsec": 2 * (worst + 1), "first_10min_rms_dph": 6}
    for name, count in windows.items():
        value = getattr(runs[worst].after, name)
        assert found[name].standard == pytest.approx(value / np.sqrt(2.0 * count)), name
        assert found[name].freedom == count


def changes_between(folder: Path, old: dict[str, Any], new: dict[str, Any]) -> MapDifference:
    Model.from_dict(old).save(folder / "model.json")
    model, nothing = Model.from_dict(new), DeclaredUnits(declared={}, trusted=())
    manifest = Manifest(
        gyrotc_version="0", serial=model.serial, axis=None, model_hash=model.hash, refused={}, versions={}, meta={},
        units=nothing, sources=(), files={},
    )  # fmt: skip
    found = changes_since(Earlier(folder), model, evaluation_of([evaluated("exam")]), manifest).map
    assert found is not None
    return found


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("share", "significant"), [(0.98, False), (1.02, True)])
def test_a_map_has_moved_beyond_twice_the_uncertainty_of_both_maps(
    share: float, significant: bool, sign: float, model_dict: dict[str, Any], tmp_path: Path
) -> None:
    sigma = {"cells": [2, 2], "rows": [[3e-4, 3e-4], [3e-4, 3e-4]]}
    other = {"cells": [2, 2], "rows": [[4e-4, 4e-4], [4e-4, 4e-4]]}
    (network,) = model_dict["networks"]
    moved = network | {"w0": network["w0"] + sign * share * 2.0 * 5e-4}
    found = changes_between(
        tmp_path, model_dict | {"uncertainty_dph": sigma}, model_dict | {"uncertainty_dph": other, "networks": [moved]}
    )
    assert found.rms_dph == pytest.approx(share * 1e-3)
    assert found.expanded_uncertainty_dph == pytest.approx(1e-3)
    assert found.significant is significant


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_map_has_moved_most_where_it_has_moved_most_up_or_down(
    sign: float, model_dict: dict[str, Any], tmp_path: Path
) -> None:
    (network,) = model_dict["networks"]
    weights = [network["weights"][0], network["weights"][1] + sign * 2e-3]
    moved = network | {"w0": network["w0"] - sign * 5e-4, "weights": weights}
    found = changes_between(tmp_path, model_dict, model_dict | {"networks": [moved]})
    assert found.max_abs_dph == pytest.approx(1.5e-3, rel=0.01)
    assert found.at.temperature_c == pytest.approx(30.0, abs=1.0)


FLOOR = 1e-3


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    folder = tmp_path_factory.mktemp("runs") / "RLG-1"
    write_csv(folder / "a.csv", columns(120))
    (folder / "dataset.toml").write_text(toml('file = "a.csv"', head='schema = 1\nserial = "A"\nearth_rate = "none"'))
    return load(folder)


def outlier_files(dataset: Dataset, model: dict[str, Any], means: list[float], stds: list[float]) -> list[str]:
    runs = [
        {
            "file": f"{k}.csv",
            "samples": 100,
            "after": {"mean_dph": m, "std_dph": s, "rms_dph": float(np.hypot(m, s)), "max_abs_dph": 1.0},
        }
        for k, (m, s) in enumerate(zip(means, stds, strict=True))
    ]
    result = {"noise_floor_dph": FLOOR, "runs": runs, "train": None, "exam": None}
    found = findings_of(dataset, [], [], Model.from_dict(model), result)
    return [str(f.file) for f in found if f.id == "run_outlier"]


@pytest.mark.parametrize("place", [0, 3, 6])
@pytest.mark.parametrize(
    ("spread", "threshold"),
    [
        (0.05 * FLOOR, FLOOR),  # six scatters of the others are less than the noise floor, which then decides
        (0.5 * FLOOR, 6.0 * 1.4826 * 0.5 * FLOOR),  # six scatters are more
    ],
)
def test_a_run_is_an_outlier_beyond_six_scatters_and_beyond_the_floor(
    spread: float, threshold: float, place: int, dataset: Dataset, model_dict: dict[str, Any]
) -> None:
    """Of the others four lie at ±spread and two between: median 0, median absolute deviation of all the spread."""
    for factor, expected in ((1.05, [f"{place}.csv"]), (0.95, [])):
        for sign in (1.0, -1.0):
            means = [spread, -spread, 0.0, spread, -spread, 0.0]
            means.insert(place, sign * factor * threshold)
            assert outlier_files(dataset, model_dict, means, [FLOOR] * 7) == expected


@pytest.mark.parametrize("place", [0, 2, 4])
@pytest.mark.parametrize(("usual", "threshold"), [(0.2 * FLOOR, 3.0 * FLOOR), (2.0 * FLOOR, 6.0 * FLOOR)])
def test_a_run_is_an_outlier_with_three_times_the_scatter_of_the_others_or_of_the_floor(
    usual: float, threshold: float, place: int, dataset: Dataset, model_dict: dict[str, Any]
) -> None:
    for factor, expected in ((1.05, [f"{place}.csv"]), (0.95, [])):
        stds = [usual] * 4
        stds.insert(place, factor * threshold)
        assert outlier_files(dataset, model_dict, [0.0] * 5, stds) == expected


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("place", [0, 2, 4])
def test_a_temperature_is_late_beyond_six_standard_errors_of_its_lag(place: int, sign: float, dataset: Dataset) -> None:
    """Beside four runs in time: what remains of one is so many seconds of its correction's change, and noise."""
    rng, time = np.random.default_rng(8), 100.0 * (np.arange(288) + 0.5)
    correction = 1e-3 * np.sin(2.0 * np.pi * time / 7200.0)
    change = np.gradient(correction, time)
    change -= change.mean()
    runs = []
    for k in range(5):
        noise = rng.normal(0.0, 1e-4, time.size)
        noise -= noise.mean() + change * (noise @ change) / (change @ change)
        runs.append((replace(dataset.runs[0], file=f"{k}.csv"), noise))

    def found(late_s: float) -> list[Finding]:
        left = [noise + (late_s * change if k == place else 0.0) for k, (_, noise) in enumerate(runs)]
        means = [Averages(time, correction + x, x, np.zeros(time.size)) for x in left]
        return list(late_findings([(run, a) for (run, _), a in zip(runs, means, strict=True)]))

    (clear,) = found(sign * 1000.0)
    assert clear.evidence["late_s"] == pytest.approx(sign * 1000.0, rel=1e-3)
    sigma_s = 1e-4 / np.sqrt(time.size * np.mean(change**2))
    assert clear.evidence["sigma_s"] == pytest.approx(sigma_s, rel=0.35)
    limit = sign * 6.0 * clear.evidence["sigma_s"]
    assert [one.file for one in found(1.05 * limit)] == [f"{place}.csv"]
    assert found(0.95 * limit) == []


@pytest.mark.parametrize("excess", [-20.0, -3.0, -1.0, 0.0, 1.0, 3.0, 20.0])
def test_unseen_history_counts_with_the_mean_excess_that_its_error_allows(
    excess: float, model_dict: dict[str, Any]
) -> None:
    """Square of what lasts on test runs less the table's sigma², with its standard error, cut at 0 by scipy."""
    sigma, error = 3e-4, 4e-9
    lasting = LastingError(mean_square_dph2=sigma**2 + excess * error, standard_dph2=error, freedom=20.0)
    expected = stats.truncnorm.mean(-excess, np.inf, loc=excess * error, scale=error)
    assert unseen_of(model_dict, lasting, sigma) == pytest.approx(np.sqrt(expected), rel=0.01)


def test_less_knowledge_never_states_less_unseen_history(model_dict: dict[str, Any]) -> None:
    """Of what lasts and is known less well, of the same residual over less time, and of no test run at all."""
    known = [LastingError(mean_square_dph2=1e-6, standard_dph2=s, freedom=20.0) for s in (1e-9, 1e-7, 1e-6, 1e-5)]
    stated = [unseen_of(model_dict, one, 3e-4) for one in known]
    assert stated == sorted(stated) and stated[0] > 0.0
    rng = np.random.default_rng(4)
    shorter = []
    for means in (1440, 360, 100, 30, 10):
        drawn = [LastingError.of([averages_of(1e-3 * rng.normal(size=means))]) for _ in range(60)]
        shorter.append(np.sqrt(np.mean([unseen_of(model_dict, one, 3e-4) ** 2 for one in drawn])))
    assert shorter == sorted(shorter) and shorter[-1] < 1.1e-3
    single = LastingError.of([averages_of(np.array([1e-3]))])
    assert single is None
    unseen = unseen_part(model_dict, single, 3e-4)
    assert unseen.contribution_dph == pytest.approx(0.01), "what a constant leaves"
    assert unseen.source.startswith("no error that lasts is known of test runs,")


@pytest.mark.parametrize(("lasting", "noise"), [(2e-4, 7e-4), (7e-4, 2e-4), (0.0, 7e-4)])
def test_what_lasts_is_told_from_noise(lasting: float, noise: float) -> None:
    """An error that keeps its sign for four hours beside white noise: 60 draws of eight hours, with its standard."""
    rng = np.random.default_rng(5)
    found = []
    for _ in range(60):
        error = lasting * np.sign(np.sin(2.0 * np.pi * (np.arange(288) + 0.5) / 288.0))
        one = LastingError.of([averages_of(error + noise * rng.normal(size=288))])
        assert one is not None
        found.append(one)
    squares = np.array([one.mean_square_dph2 for one in found])
    standard = np.array([one.standard_dph2 for one in found])
    assert abs(squares.mean() - lasting**2) < 4.0 * squares.std() / np.sqrt(60.0) + 0.1 * lasting**2
    assert squares.std() < 1.5 * np.sqrt(np.mean(standard**2))


def test_blocks_that_show_nothing_that_lasts_add_no_degrees_of_freedom() -> None:
    """Five runs of one mean beside one of three: the scatter of a single block is not known, that of white noise is."""
    rng = np.random.default_rng(6)
    runs = [rng.normal(size=means) for means in (1, 1, 1, 1, 1, 3)]
    one = LastingError.of([averages_of(run) for run in runs])
    assert one is not None and one.freedom == 1.0
    assert one.standard_dph2 == pytest.approx(np.mean(np.concatenate(runs) ** 2) / np.sqrt(3.0)), "of three products"


def averages_of(after_dph: Any) -> Averages:
    time_s = 100.0 * (np.arange(len(after_dph)) + 0.5)
    return Averages(time_s, after_dph, after_dph, np.zeros(len(after_dph)))


def unseen_of(model_dict: dict[str, Any], lasting: LastingError | None, sigma: float) -> float:
    """Return the contribution of unseen history, deg/h."""
    return unseen_part(model_dict, lasting, sigma).contribution_dph


def unseen_part(model_dict: dict[str, Any], lasting: LastingError | None, sigma: float) -> Any:
    """Return the row of the budget for unseen history of test runs whose error lasts so much."""
    made = evaluation_of([evaluated("exam"), evaluated("train")], sigma_rms_dph=sigma)
    assert made.exam is not None
    exam = made.exam.model_copy(update={"lasting": lasting})
    made = made.model_copy(update={"exam": exam, "train": made.exam})
    training: Any = SimpleNamespace(noise_floor_dph=FLOOR, samples=3000, block_s=10.0, average_s=100.0)
    budget = budget_of(Model.from_dict(model_dict), training, made, None)
    (unseen,) = (one for one in budget.contributions if one.id == "unseen")
    return unseen


def test_statistics_are_those_of_numpy() -> None:
    x = np.array([3.0, -5.0, 1.0])
    assert statistics_of(x) == pytest.approx(
        {"mean_dph": x.mean(), "std_dph": np.std(x), "rms_dph": np.sqrt(35.0 / 3.0), "max_abs_dph": 5.0}
    )
