"""Every view of a verdict says the same: terminal, pages, certificate, DCC, Python, fleet, JSON."""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from gyrotc.assess import Limits, decided, held_against
from gyrotc.cli.results import summary_lines, verdict_words
from gyrotc.fleet import Fleet, Unit, unit, write_summary
from gyrotc.jobs import Built, LaboratoryFacts, Result
from gyrotc.model import Model
from gyrotc.pages import UnitResults, certificate_page, page_environment, rows_of
from gyrotc.recordings import Dataset
from gyrotc.results import (
    Evaluation,
    FigureUncertainty,
    Finding,
    HeldLimits,
    Pooled,
    Requirement,
    ResidualTest,
    Statistics,
    Training,
    Verdict,
    next_step,
)
from test_limits import EVALUATION, VERIFICATION

_FIGURES = ("rms_dph", "std_dph", "max_abs_dph", "mean_dph", "rms_30min_dph", "centers")
_RULES = ("guard_band", "guard_band_binary", "simple_acceptance")
_NO_TRAINING = cast(Training, None)  # no verdict depends on it
_NO_FLEET = cast(Fleet, None)  # nor on the options
_VERDICTS = "CONDITIONAL PASS|PASS|NOT TESTABLE|FAIL"
_IN_DCC = {"PASS": "pass", "CONDITIONAL PASS": "conditionalPass", "NOT TESTABLE": "noPass", "FAIL": "fail"}


def pooled(rms: float) -> Pooled:
    after = Statistics(rms_dph=rms, std_dph=0.8 * rms, mean_dph=0.6 * rms, max_abs_dph=3.0 * rms)
    before = Statistics(rms_dph=0.01, std_dph=0.008, mean_dph=0.006, max_abs_dph=0.03)
    return Pooled(
        before=before, constant=before, after=after, improvement=0.01 / rms, improvement_about_zero=0.01 / rms,
        samples=100,
    )  # fmt: skip


def drawn(rng: np.random.Generator, model: Model) -> tuple[Evaluation, HeldLimits]:
    """A result with limits near its figures, some of them without an uncertainty or with few degrees of freedom."""
    parts = {name: pooled(rng.uniform(1e-4, 1e-2)) for name in ("exam", "left_out", "train")}
    kept = {"exam": ("exam", "train"), "left_out": ("left_out", "train"), "train": ("train",)}
    role = rng.choice(["exam", "left_out", "train"])
    known = {
        name: FigureUncertainty(
            standard=rng.uniform(0.0, 1e-3), freedom=rng.choice([None, 2.0, 4.0, 5.0, 20.0]), method="drawn"
        )
        for name in _FIGURES
        if rng.random() < 0.8
    }
    none: dict[str, Any] = dict.fromkeys(parts)
    update = none | {name: parts[name] for name in kept[role]}
    mismatches = int(rng.random() < 0.1)
    evaluation = EVALUATION.model_copy(update=update | {"uncertainty": known, "mismatches": mismatches})
    names = [name for name in _FIGURES if rng.random() < 0.5]
    bounds = {name: float(rng.uniform(1e-4, 1e-2)) for name in names}
    limits = Limits.model_validate(
        {"schema": 1, "at_most": bounds, "decision_rule": str(rng.choice(_RULES)), "product": "NAV"}
    )
    return evaluation, held_against(limits, model, evaluation, VERIFICATION)


def said(text: str) -> list[str]:
    """The verdicts of a text in their order."""
    return re.findall(rf"\b({_VERDICTS})\b", text)


def test_all_views_of_drawn_results_agree(model_dict: dict[str, Any]) -> None:
    seed = 20260725
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    model = Model.from_dict(model_dict)
    macros = page_environment().get_template("parts.html.j2").module
    for number in range(500):
        evaluation, held = drawn(rng, model)
        shown = UnitResults(model, evaluation, None, VERIFICATION, None, None, held, None, None)
        banner = re.findall(r"<strong>([^<]*)</strong>", macros.verdict(shown))
        table = re.findall(r'class="state"><span[^>]*>([^<]*)<', macros.limits_table(shown.held))
        certified = [row.verdict for row in rows_of(shown)]
        conformity = [row.conformity for row in rows_of(shown)]
        page = certificate_page([shown], {None: None}, LaboratoryFacts(), None, ["number"], "drawn")
        built = Built(model, _NO_TRAINING, evaluation, VERIFICATION, {}, limits=held)
        again = HeldLimits.model_validate_json(json.dumps(held.content()))
        assert again == held, number
        assert banner == [shown.verdict or "No limits given"], number
        assert re.findall(r"<strong>([^<]*)</strong>", page)[:1] == ([shown.verdict] if shown.verdict else []), number
        assert re.findall(r'class="state"><span[^>]*>([^<]*)<', page) == table, number
        assert conformity == [_IN_DCC[one.verdict] for one in shown.held], number
        assert Result(Path(), built).decision == shown.decision, number
        assert table == certified == [one.verdict for one in shown.held], number
        if evaluation.mismatches:
            assert shown.decision == "FAIL", number
            continue
        assert shown.decision == held.verdict, number
        assert said(verdict_words(shown))[:1] == ([held.verdict] if held.verdict else []), number
        failed = [one for one in held.limits if one.verdict == "FAIL"]
        assert verdict_words(shown).count(", FAIL") == len(failed), number
        where = {"left_out": "spans left out", "train": "training runs themselves"}
        judged = evaluation.judged()
        assert judged is not None
        for name in ("left_out", "train"):
            assert (where[name] in " ".join(summary_lines(evaluation))) == (judged[0] == name), number


def test_a_fleet_has_the_decision_of_the_unit(
    model_dict: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(unit, "gyro_facts", lambda runs: None)  # no verdict depends on the comparison
    seed, draws = 20260726, 60
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    model = Model.from_dict(model_dict)
    built, entries = [], []
    for number in range(draws):
        evaluation, held = drawn(rng, model)
        limits = held if rng.random() < 0.8 else None
        one = Built(model, _NO_TRAINING, evaluation, VERIFICATION, {}, limits=limits)
        task = unit.Task(Unit(Path(f"u{number}"), None), "d", _NO_FLEET, tmp_path / f"u{number}", "")
        dataset = cast(Dataset, SimpleNamespace(serial=f"S{number}", meta={}, runs=(), sketch=()))
        entry = unit.entry_of(task, "0" * 64, dataset, one, ())
        built.append(one)
        entries.append(entry)
    views = {
        entry.name: UnitResults(model, one.evaluation, None, VERIFICATION, None, None, one.limits, None, None)
        for entry, one in zip(entries, built, strict=True)
    }
    for entry in write_summary(tmp_path, entries).serials:
        assert entry.verdict == views[entry.name].decision, entry.name
    assert {entry.verdict for entry in entries if entry.status == "failed"} == {"FAIL"}


@pytest.mark.parametrize(
    ("over_floor", "finding", "left"),
    [(1.04, "run_outlier", False), (1.06, "run_outlier", True), (1.0, "does_not_generalise", True)],
)
def test_structure_that_is_left_leads_to_a_diagnosis(
    over_floor: float, finding: str, left: bool, model_dict: dict[str, Any]
) -> None:
    found = (Finding(id=finding, text="", evidence={}),)
    residual = ResidualTest(
        autocorrelation=0.0,
        autocorrelation_limit=0.03,
        lags=10,
        rms_over_floor=over_floor,
        rms_over_floor_band=(0.95, 1.05),
    )
    evaluation = EVALUATION.model_copy(update={"residual": residual, "findings": found})
    assert evaluation.structure_left == left
    assert bool(evaluation.residual_words) == left
    shown = UnitResults(Model.from_dict(model_dict), evaluation, None, VERIFICATION, None, None, None, None, None)
    page = page_environment().get_template("parts.html.j2").module.verdict(shown)
    assert ("what remains is more than noise" in page) == left
    assert ("gyrotc diagnose DATASET" in shown.next_step) == left


@pytest.mark.parametrize(
    ("verdict", "structure", "first"),
    [
        ("CONDITIONAL PASS", True, "gyrotc diagnose"),
        ("CONDITIONAL PASS", False, "Record it again"),
        ("NOT TESTABLE", True, "Record it again"),
    ],
)
def test_a_diagnosis_comes_before_new_recordings_unless_those_there_are_worthless(
    verdict: Verdict, structure: bool, first: str
) -> None:
    lacking = Requirement(id="rows", verdict=verdict, text="", next="Record it again.")
    findings = (Finding(id="does_not_generalise", text="", evidence={}),) if structure else ()
    evaluation = EVALUATION.model_copy(update={"requirements": (lacking,), "findings": findings, "residual": None})
    assert next_step(evaluation, None, False, diagnosed=False).startswith(first)
    assert next_step(evaluation, None, False, diagnosed=True) == "Record it again."


def test_a_figure_of_training_runs_has_a_conditional_pass_at_most(model_dict: dict[str, Any]) -> None:
    model = Model.from_dict(model_dict)
    known = {"rms_dph": FigureUncertainty(standard=1e-6, freedom=None, method="")}
    update = {"exam": None, "train": pooled(1e-3), "uncertainty": known}
    limits = Limits.model_validate({"schema": 1, "at_most": {"rms_dph": 1.0, "centers": 100.0}})
    held = held_against(limits, model, EVALUATION.model_copy(update=update), VERIFICATION)
    assert [one.verdict for one in held.limits] == ["CONDITIONAL PASS", "PASS"]
    assert [one.part for one in held.limits] == ["train", None]
    assert held.verdict == "CONDITIONAL PASS"
    assert len(held.capped) == 1
    assert 'role = "exam"' in held.capped[0]


@pytest.mark.parametrize(("freedom", "verdict"), [(4.9, "CONDITIONAL PASS"), (5.0, "PASS"), (None, "PASS")])
def test_few_degrees_of_freedom_make_a_pass_conditional(freedom: float | None, verdict: str) -> None:
    known = FigureUncertainty(standard=1e-3, freedom=freedom, method="")
    one = decided("at_most.rms_dph", 0.1, 1.0, 1.0, "guard_band", known, "exam")
    assert (one.verdict, bool(one.capped)) == (verdict, verdict != "PASS")
    assert decided("at_most.rms_dph", 2.0, 1.0, 1.0, "guard_band", known, "exam").verdict == "FAIL"
    assert decided("at_most.rms_dph", 0.1, 1.0, 1.0, "simple_acceptance", known, "exam").verdict == "PASS"
