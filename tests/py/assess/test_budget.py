"""The uncertainty budget: sums by hand, what is stated, what is not known, and a U that holds."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
from conftest import ROOT
from gyrotc.assess.budget import budget_of, combined
from gyrotc.assess.limits import Limits, instruments_in, last_day, load_limits
from gyrotc.common.errors import InputError
from gyrotc.jobs.build import build_into
from gyrotc.model import load_model
from gyrotc.pages.report import write_report
from gyrotc.pages.words import rounded
from gyrotc.recordings.load import load
from gyrotc.results.base import read_optional, read_result
from gyrotc.results.evaluation import Changes, Evaluation
from gyrotc.results.release import Budget
from gyrotc.results.training import Training
from gyrotc.results.verification import Verification
from gyrotc.simulate.campaign import simulate
from gyrotc.train.fitting import FitOptions

sys.path.insert(0, str(ROOT))
from bench.budget import UNITS, coverage_of, units_of

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
    data, folder = tmp_path_factory.mktemp("data"), tmp_path_factory.mktemp("built")
    simulate("paper", seed=5, out=data / "paper", format="parquet")
    build_into(folder, load(data / "paper"), FitOptions(), compiled=False)
    write_report(folder)
    return folder


def of(built: Path, limits: Limits | None = None, **meta: Any) -> Budget:
    model = load_model(built / "model.json")
    return budget_of(
        model.model_copy(update={"meta": {**model.meta, **meta}}),
        read_result(built / "training.json", Training),
        read_result(built / "evaluate.json", Evaluation),
        read_optional(built / "verify.json", Verification),
        limits=limits,
        changes=read_optional(built / "changes.json", Changes),
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


def test_noise_fit_and_power_on_are_what_the_table_states(built: Path) -> None:
    parts = {one.id: one.contribution_dph for one in of(built).contributions}
    stated = read_result(built / "evaluate.json", Evaluation).sigma_rms_dph
    assert stated is not None
    assert sum(parts[id] ** 2 for id in ("noise", "fit", "turn_on")) == pytest.approx(stated**2)


def test_an_instrument_that_is_not_well_stated_is_refused() -> None:
    for wrong, told in (
        ({"name": "T", "uncertainty": 1.0}, "meta.instrument.0, field uncertainty"),
        ({"certificate": "1"}, "meta.instrument.0, field name"),
        ("T", "meta.instrument.0"),
        ({"name": "T", "expanded_uncertainty": -1.0}, "expanded_uncertainty"),
    ):
        with pytest.raises(InputError, match=told):
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


@pytest.mark.slow
def test_the_stated_uncertainty_holds_on_a_slice_of_the_simulated_units() -> None:
    """`make uncertainty` looks at all 200, and keeps what it found; of six units the share scatters by 3 %."""
    every = units_of(UNITS)
    assert len(every) == UNITS and len(set(every)) == UNITS
    shares = [coverage_of(*every[k]).share for k in range(0, UNITS, UNITS // 6)][:6]
    assert 0.85 < sum(shares) / len(shares) <= 1.0, shares
