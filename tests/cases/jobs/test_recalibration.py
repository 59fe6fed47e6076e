"""A unit's earlier model as a prior: a check run confirms it, or says where it no longer holds."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from conftest import HOST, run_here
from gyrotc.common import InputError
from gyrotc.model import load_model
from gyrotc.results import Evaluation, Training, Verification, read_result
from gyrotc.tables import emitted_tables
from gyrotc.train import TrainingData, cleaned_samples, fit, fit_process, predict, scaling_of
from gyrotc.train.prior import (
    FALSE_ALARM,
    Departures,
    EarlierPrior,
    Hypothesis,
    MapPosterior,
    UnitMeans,
    known_map,
    means_of_unit,
    posterior_of_known,
    posterior_of_process,
    posterior_of_result,
    revised,
    updated,
    widened,
    within,
)
from numpy.typing import NDArray
from recordings import write_csv
from scipy import stats

Floats = NDArray[np.float64]
Change = Callable[[Floats, Floats], Floats]

NOISE = 7e-4  # deg/h of a mean of 50 s
SEED = 20
STEP_S = 50.0
CALIBRATION = ((20.0, 50.0, -20.0, 20.0), (-20.0, 40.0, 0.0, 50.0), (50.0, -10.0, 30.0, -20.0))
CHECK = ((0.0, 50.0, -20.0, 10.0),)
CHANGES: dict[str, Change] = {
    "offset": lambda t, r: np.full(len(t), 6e-4),
    "slope": lambda t, r: 1.2e-3 * (t - 15.0) / 70.0,
    "rate": lambda t, r: 6e-4 * r / 2.4,
    "local": lambda t, r: 3e-3 * np.exp(-0.5 * ((t - 35.0) / 5.0) ** 2),
}


def bias(t: Floats, r: Floats) -> Floats:
    return 7e-3 + 1e-3 * np.tanh((t - 15.0) / 25.0) - 4e-4 * np.sin(t / 12.0) + 2e-4 * r


def recorded(
    rng: np.random.Generator, programmes: tuple[tuple[float, ...], ...], change: Change | None = None
) -> TrainingData:
    """Ramps at 2 C/min between corners of T, with 40 min at each; samples of 50 s."""
    parts = []
    for corners in programmes:
        steps = [np.full(48, corners[0])]
        for low, high in pairwise(corners):
            steps += [np.linspace(low, high, round(abs(high - low) / 2.0 * 60.0 / STEP_S)), np.full(48, high)]
        parts.append(np.concatenate(steps))
    t = np.concatenate(parts)
    run = np.concatenate([np.full(len(p), k, dtype=np.int64) for k, p in enumerate(parts)])
    r = np.concatenate([np.clip(np.gradient(p) * 60.0 / STEP_S, -2.4, 2.4) for p in parts])
    n = len(t)
    measured = bias(t, r) + (change(t, r) if change else 0.0) + NOISE * rng.normal(size=n)
    time_s = np.concatenate([STEP_S * np.arange(len(p)) for p in parts])
    return TrainingData(t, r, measured, np.full(n, 5.0), run, time_s, np.full(n, STEP_S))


def means(data: TrainingData) -> UnitMeans:
    samples = cleaned_samples(data)
    return means_of_unit(samples, scaling_of(samples), None)[0]


def known_of(data: TrainingData) -> MapPosterior:
    samples = cleaned_samples(data)
    scaling = scaling_of(samples)
    return posterior_of_process(fit_process(samples, scaling), scaling)


def earlier(rng: np.random.Generator, ageing_dph: float = 0.0) -> EarlierPrior:
    return widened(known_of(recorded(rng, CALIBRATION)), ageing_dph, "as stated", "a" * 64, "2026-01-01")


@cache
def one() -> EarlierPrior:
    return earlier(np.random.default_rng(1))


def checked(rng: np.random.Generator, prior: EarlierPrior, change: Change | None = None) -> Hypothesis:
    return revised(prior, within(prior, means(recorded(rng, CHECK, change))), prior.unaged)[0]


def drawn(rng: np.random.Generator, prior: EarlierPrior, run: UnitMeans) -> UnitMeans:
    """A check run of a unit that is drawn from the prior, with what a power-on has of its own."""
    values = prior.basis.values(run.temperature_c, run.slope_c_per_min)
    root = np.linalg.cholesky(prior.covariances[0])
    w = prior.means[0] + root @ rng.normal(size=len(root))
    w[: len(prior.own)] += np.sqrt(prior.own) * rng.normal(size=len(prior.own))
    noise = run.sigma_dph * rng.normal(size=len(run.count)) / np.sqrt(run.count)
    return replace(run, bias_dph=prior.center_dph + prior.unit_dph * (values @ w) + noise)


def test_units_as_the_model_says_are_unchanged_and_move_within_u() -> None:
    """Maps drawn from the earlier posterior itself: a map moves by more than U (k = 2) in one of twenty at most."""
    prior, rng = one(), np.random.default_rng(2)
    run = means(recorded(rng, CHECK))
    found, squares = [], []
    for _ in range(60):
        answers = revised(prior, drawn(rng, prior, run), prior.unaged)
        found.append(answers[0])
        [same] = [a for a in answers if a.kind == "unchanged"]
        squares.append((2.0 * same.moved.rms_dph / (same.moved.expanded_uncertainty_dph or 0.0)) ** 2)
    assert sum(h.kind != "unchanged" for h in found) <= 6
    assert 0.7 < np.mean(squares) < 1.3, "U is twice the RMS by which an unchanged unit's map moves"


def test_a_part_of_an_unchanged_unit_is_beyond_its_limit_no_more_often_than_stated() -> None:
    """Any part of a check run, over check runs that are drawn from the earlier posterior."""
    prior, rng, draws = one(), np.random.default_rng(3), 400
    run = means(recorded(rng, CHECK))
    alarms = 0
    for _ in range(draws):
        cells = list(Departures(prior.alone(), drawn(rng, prior, run)).cells())
        alarms += not all(cell.within for cell in cells)
    assert len(cells) > 5
    assert alarms <= stats.binom.isf(1e-4, draws, FALSE_ALARM) < 5.0 * FALSE_ALARM * draws


def test_an_answer_never_contradicts_the_significance_of_the_move() -> None:
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    prior = one()
    for size in (0.0, 0.1, 0.2, 0.4, 1.0):
        for change in CHANGES.values():
            found = checked(rng, prior, lambda t, r, c=change, s=size: s * c(t, r))
            assert (found.kind != "unchanged") == found.moved.significant


@pytest.mark.parametrize(
    ("change", "answer"), [("offset", "offset"), ("slope", "slope"), ("rate", "slope"), ("local", "full")]
)
def test_a_planted_change_is_answered_and_named_with_its_region(change: str, answer: str) -> None:
    print("seed", SEED)
    run = within(one(), means(recorded(np.random.default_rng(SEED), CHECK, CHANGES[change])))
    found = revised(one(), run, one().unaged)[0]
    assert found.kind == answer and found.moved.significant
    departures = Departures(one().alone(), run)
    named, cells = departures.change(found.kind), list(departures.cells())
    assert named is not None and named.kind == change, named
    assert abs(named.size_dph) > 2.0 * named.standard_uncertainty_dph
    assert any(not cell.within for cell in cells) or change in ("rate", "slope")
    if change == "local":
        assert named.temperature_c[0] < 35.0 < named.temperature_c[1]
        assert named.temperature_c[1] - named.temperature_c[0] <= 40.0
        outside = [cell for cell in cells if not cell.within]
        assert all(cell.temperature_c[0] < 50.0 and cell.temperature_c[1] > 20.0 for cell in outside)
    if change == "offset":
        assert abs(named.size_dph - 6e-4) < 5.0 * named.standard_uncertainty_dph


@pytest.mark.parametrize("change", ["none", *CHANGES, "large"])
def test_what_is_left_is_no_more_than_an_offset_or_nothing_leaves(change: str) -> None:
    """Over the whole envelope, with the noise of a mean; 2 % is noise."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    planted = {**CHANGES, "none": lambda t, r: 0.0 * t, "large": lambda t, r: 0.05 + 0.0 * t}[change]
    t, r = (x.ravel() for x in np.meshgrid(np.linspace(-19.0, 49.0, 30), np.linspace(-2.0, 2.0, 9)))
    truth = bias(t, r) + planted(t, r)
    for _ in range(3):
        prior = earlier(rng)
        run = within(prior, means(recorded(rng, CHECK, planted)))
        left = run.bias_dph - prior.alone().mean_dph(run.temperature_c, run.slope_c_per_min)
        as_found = prior.alone().mean_dph(t, r)
        moved = as_found + np.average(left, weights=run.count)
        chosen = updated(revised(prior, run, prior.unaged)[0].prior, run).mean_dph(t, r)
        of = [np.hypot(NOISE, np.sqrt(np.mean((m - truth) ** 2))) for m in (as_found, moved, chosen)]
        assert of[2] <= 1.02 * min(of[:2])


def test_ageing_that_is_stated_is_no_finding() -> None:
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    known = known_of(recorded(rng, CALIBRATION))
    aged = widened(known, 6e-4, "as stated", "a" * 64, None)
    moved = checked(rng, aged, CHANGES["offset"])
    assert moved.kind == "unchanged" and moved.moved.significant, "it has moved, as was to be expected"
    assert checked(rng, aged, CHANGES["local"]).kind == "full"
    assert aged.alone().rms_sigma_dph() == pytest.approx(6e-4, rel=0.4)


def test_a_confirmed_model_and_its_check_run_are_one_table() -> None:
    t, r = (x.ravel() for x in np.meshgrid(np.linspace(-19, 49, 30), np.linspace(-2.0, 2.0, 9)))
    squares = []
    for seed in range(30, 38):
        rng = np.random.default_rng(seed)
        prior, data = earlier(rng, 1e-4), recorded(rng, CHECK)
        both, alone = fit(data, method="auto", prior=prior), fit(data, method="mrbf")
        assert both.prior is not None and both.prior.chosen == "unchanged" and both.prior.accepted
        assert both.prior.sigma_dph < 0.9 * both.prior.prior_sigma_dph, "the run adds to what the model knew"
        share = 1.0 - (both.prior.sigma_dph / both.prior.prior_sigma_dph) ** 2
        assert both.prior.own_share == pytest.approx(share), "of the variance that the run took off"
        errors = [float(np.mean((predict(f, t, r) - bias(t, r)) ** 2)) for f in (both, alone)]
        squares.append((*errors, both.prior.sigma_dph**2))
    of_both, of_alone, stated = np.sqrt(np.mean(squares, axis=0))
    assert of_both < 0.8 * of_alone, "what is known of the map before takes from its error"
    assert 0.7 * stated < of_both < 1.1 * stated
    changed = fit(recorded(rng, CHECK, CHANGES["local"]), method="auto", prior=prior)
    assert changed.prior is not None and changed.prior.chosen == "full" and changed.prior.accepted
    assert "prior_does_not_hold" in [f["id"] for f in changed.findings]
    truth = bias(t, r) + CHANGES["local"](t, r)
    assert np.sqrt(np.mean((predict(changed, t, r) - truth) ** 2)) < 5e-4


def test_power_ons_with_offsets_are_in_the_sigma_of_a_confirmed_model() -> None:
    """An offset of the check run's power-on is not taken for a change, nor for the constant of the gyro."""
    t, r = (x.ravel() for x in np.meshgrid(np.linspace(-19, 49, 30), np.linspace(-2.0, 2.0, 9)))
    squares = []
    for seed in range(100, 112):
        rng = np.random.default_rng(seed)
        calibration, check = (with_offsets(rng, recorded(rng, runs), 3e-4) for runs in (CALIBRATION, CHECK))
        prior = widened(known_of(calibration), 0.0, "none", "a" * 64, None)
        both, alone = fit(check, method="auto", prior=prior), fit(check, method="mrbf")
        assert both.prior is not None and both.prior.chosen == "unchanged"
        errors = [float(np.mean((predict(f, t, r) - bias(t, r)) ** 2)) for f in (both, alone)]
        squares.append((*errors, both.prior.sigma_dph**2))
    of_both, of_alone, stated = np.sqrt(np.mean(squares, axis=0))
    assert of_both < 0.7 * of_alone
    assert 0.7 * stated < of_both < 1.3 * stated


def with_offsets(rng: np.random.Generator, data: TrainingData, sigma_dph: float) -> TrainingData:
    """Samples with a power-on before each run."""
    offsets = sigma_dph * rng.normal(size=int(data.run.max()) + 1)
    return replace(data, bias_dph=data.bias_dph + offsets[data.run])


def test_a_result_that_does_not_hold_its_map_is_no_prior(world: Path) -> None:
    """As of an extended model, or of an earlier gyrotc."""
    where = world / "old" / "training.json"
    training = read_result(where, Training)
    assert posterior_of_result(training, where).mean.size > 5
    with pytest.raises(InputError, match=r"training\.json, field known: is missing"):
        posterior_of_result(training.model_copy(update={"known": None}), where)


def test_what_is_known_of_a_map_is_read_back() -> None:
    known = known_of(recorded(np.random.default_rng(8), CALIBRATION))
    stored = known_map(known)
    again = posterior_of_known(stored, "training.json")
    t = np.linspace(-20.0, 50.0, 20)
    assert again.mean_dph(t, 0.0 * t) == pytest.approx(known.mean_dph(t, 0.0 * t), abs=1e-9)
    assert again.variance_dph2(t, 0.0 * t) == pytest.approx(known.variance_dph2(t, 0.0 * t), rel=1e-3)
    for field in ("mean", "asked_share"):
        with pytest.raises(InputError, match=rf"training\.json, known, {field}"):
            posterior_of_known(stored.model_copy(update={field: getattr(stored, field)[1:]}), "training.json")


def dataset(folder: Path, seed: int, day: str, *, check: bool, change: Change | None = None) -> Path:
    data = recorded(np.random.default_rng(seed), CHECK if check else CALIBRATION, change)
    text = 'schema = 1\nserial = "RLG-0007"\nearth_rate = "removed"\n'
    for k in range(int(data.run.max()) + 1):
        mine = data.select(data.run == k)
        columns = {"time_s": mine.time_s, "temperature_c": mine.temperature_c, "rate_dph": mine.bias_dph}
        write_csv(folder / f"run-{k}.csv", columns)
        text += f'[[run]]\nfile = "run-{k}.csv"\nstarted = {day}T00:00:00Z\nenvironment = "e{k}"\n'
    (folder / "dataset.toml").write_text(text + "[fit]\nblock_s = 50.0\n", "utf-8")
    return folder


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("recalibration")
    run_here("fit", dataset(place / "first", 11, "2025-01-01", check=False), "--out", place / "old")
    dataset(place / "check", 12, "2026-01-01", check=True)
    reported = run_here("build", place / "check", "--prior", place / "old", *HOST, "--out", place / "new")
    assert "earlier model: the model " in reported and "is confirmed" in reported
    return place


def test_the_commands_say_what_became_of_the_earlier_model(world: Path, tmp_path: Path) -> None:
    training = Training.model_validate_json((world / "new" / "training.json").read_text())
    assert training.prior is not None and training.prior.date == "2025-01-01"
    assert "is confirmed" in json.loads((world / "new" / "model.json").read_text())["meta"]["prior"]
    bumped = dataset(tmp_path / "bumped", 13, "2026-06-01", check=True, change=CHANGES["local"])
    build = ("build", bumped, "--prior", world / "new", *HOST)
    reported = run_here(*build, "--out", tmp_path / "bad")
    assert "no longer holds" in reported and "findings: prior_does_not_hold" in reported
    limits = tmp_path / "product.toml"
    limits.write_text("schema = 1\n[interval]\ndays = 365\ndrift_dph_per_year = 0.02\n", "utf-8")
    reported = run_here(*build, "--limits", limits, "--out", tmp_path / "aged")
    ageing_dph = 0.02 / np.sqrt(3.0) * 151.0 / 365.25  # a rectangle; the checks were on 1 January and 1 June
    assert f"ageing of {ageing_dph:.2g} deg/h (1 sigma; the type's largest drift, by the limits file)" in reported


def sigma_dph(result: Path) -> float:
    """Mean 1 sigma of the cells of a result's map about the constant of a power-on, deg/h."""
    known = load_model(result / "model.json").uncertainty_dph
    assert known is not None and known.rules is not None
    return float(np.mean(np.sqrt(np.square(known.rows) - known.rules.between_dph**2)))


def proven(result: Path) -> None:
    """The table of a result is emitted, and its C answers as the reference: to vectors and to the recordings."""
    model, verified = load_model(result / "model.json"), read_result(result / "verify.json", Verification)
    assert verified.failed == 0 and verified.passed > 0 and verified.model_hash == model.hash
    assert read_result(result / "evaluate.json", Evaluation).mismatches == 0
    assert emitted_tables(result / "c", model)["f32"].sigma.size > 0


def test_a_build_from_a_check_run_says_what_came_from_the_earlier_model(world: Path, tmp_path: Path) -> None:
    out = tmp_path / "built"
    run_here("build", world / "check", "--prior", world / "old", *HOST, "--out", out)
    proven(out)
    prior = read_result(out / "training.json", Training).prior
    assert prior is not None and prior.accepted
    page = (out / "report.html").read_text()
    assert "<h2>The earlier model</h2>" in page and prior.text in page and "is confirmed" in prior.text
    assert "the earlier model after ageing" in page and "envelope), with this unit" not in page
    assert page.count("<td>within</td>") == len(prior.cells) and "<td>outside</td>" not in page
    [header] = (out / "c").glob("gtc_rlg*.h")
    assert "prior:" in header.read_text() and load_model(world / "old" / "model.json").hash[:12] in page
    run_here("fit", world / "check", "--out", tmp_path / "alone")
    assert prior.sigma_dph < 0.9 * prior.prior_sigma_dph, "the run adds to what the earlier model knew"
    assert sigma_dph(out) < 0.8 * sigma_dph(world / "old"), "the run takes from what the earlier model leaves open"
    assert sigma_dph(out) < 0.8 * sigma_dph(tmp_path / "alone"), "and the earlier model from what the run leaves open"
    earlier = json.loads((out / "changes.json").read_text())
    assert earlier, "the earlier model is also what the result is compared with"


def test_a_build_of_a_unit_that_has_moved_says_where(world: Path, tmp_path: Path) -> None:
    out = tmp_path / "built"
    bumped = dataset(tmp_path / "bumped", 15, "2026-06-01", check=True, change=CHANGES["local"])
    run_here("build", bumped, "--prior", world / "old", *HOST, "--out", out)
    proven(out)
    prior = read_result(out / "training.json", Training).prior
    assert prior is not None and prior.chosen == "full" and prior.accepted and prior.change is not None
    low, high = prior.change.temperature_c
    assert prior.change.kind == "local" and low < 35.0 < high and high - low <= 40.0
    page = (out / "report.html").read_text()
    assert "no longer holds" in page and f"in the middle of {low:.0f} ... {high:.0f} C" in page
    assert "changed in its shape" in page and "<td>outside</td>" in page
    changes = json.loads((out / "changes.json").read_text())
    assert changes["map"]["rms_dph"] == prior.moved.rms_dph and changes["map"]["significant"] is True
    assert "significant" in page and "not significant" not in page
    model = load_model(out / "model.json")
    assert "no longer holds" in str(model.meta["prior"]) and model.hash in page


def test_what_cannot_be_a_prior_is_reported(world: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="was made from it"):
        run_here("build", world / "first", "--prior", world / "old", "--out", tmp_path / "a")
    with pytest.raises(InputError, match=r"--prior .* has no model\.json"):
        run_here("build", world / "check", "--prior", world, "--out", tmp_path / "a")
    other = dataset(tmp_path / "other", 14, "2026-01-01", check=True)
    text = (other / "dataset.toml").read_text().replace("RLG-0007", "RLG-0008")
    (other / "dataset.toml").write_text(text)
    with pytest.raises(InputError, match="RLG-0008"):
        run_here("build", other, "--prior", world / "old", "--out", tmp_path / "a")
    assert not (tmp_path / "a").exists()
