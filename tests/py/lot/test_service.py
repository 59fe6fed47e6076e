"""Learning in service on the host: a simulated service, what its words say, and the table that is made of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import run_here
from gyrotc.assess.limits import Limits, Recalibration
from gyrotc.common.errors import CheckFailed, InputError
from gyrotc.jobs.recalibration import learned_in_service
from gyrotc.lot.service import (
    Moved,
    covariance_at,
    fitted_ageing,
    learning_in,
    parkings,
    spread_of_lot,
    spread_of_power_ons,
    words_text,
)  # fmt: skip
from gyrotc.mirror.learning import KNOTS, Learner, full
from gyrotc.model import Learning, Model, Uncertainty, load_model
from gyrotc.results.evaluation import InService
from gyrotc.results.fleet import LotAgeing
from gyrotc.tables.emit import MONTH_H, data_sheet_spread, emit, service_prior, walk
from gyrotc.train.data import TrainingData
from gyrotc.train.prior.earlier import posterior_of_means
from gyrotc.train.prior.unit_means import UnitMeans

GOLDEN = Path(__file__).resolve().parents[2] / "c" / "model.json"
LEARNING = Learning(
    spread=data_sheet_spread(2e-3, 1e-4, 2e-4), reference_c=20.0, authority_dph=0.03, noise_deg_per_sqrt_h=1e-4
)


@pytest.fixture(scope="module")
def unit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unit")
    known = Uncertainty(cells=(4, 1), rows=((1e-6, 1e-6, 1e-6, 1.0),))
    model = load_model(GOLDEN).model_copy(update={"learning": LEARNING, "uncertainty_dph": known})
    model.save(folder / "model.json")
    emit(model, folder)
    return folder


def kept(unit: Path, where: Path, knots: np.ndarray, less: float = 1e-4) -> Path:
    """Words of a unit that has learned this, to within `less` of what was not known."""
    _, _, prior = learning_in(unit)
    learner = Learner(prior)
    for _ in range(9):
        learner.power_on(30 * 86400.0, 20.0)
    learner.x[:KNOTS, 0] = knots
    learner.p[: len(prior.map_var)] *= np.float32(less**2)
    where.write_text(words_text(learner.save()))
    return where


def moved_by(unit: Path, model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Temperatures over the envelope, and how far the map moved there, at any rate of T."""
    before = load_model(unit / "model.json")
    t = np.linspace(*before.envelope.temperature_c, 50)
    still, ramp = (model.map_dph(t, r) - before.map_dph(t, r) for r in (0.0, 1.0))
    assert np.allclose(still, ramp, atol=1e-12)
    return t, still


def knots_of(unit: Path) -> np.ndarray:
    return np.linspace(*load_model(unit / "model.json").envelope.temperature_c, KNOTS)


def test_a_service_is_simulated_and_recalibrated_by_command(unit: Path, tmp_path: Path) -> None:
    out, again = tmp_path / "service", tmp_path / "again"
    order = ("simulate", "service", "--base", unit, "--power-ons", "12", "--seed", "4")
    said = run_here(*order, "--out", out)
    assert "12 power-ons" in said and "error over sigma" in said
    run_here(*order, "--out", again)
    run_here(*order, "--mounted", "6", "--out", tmp_path / "mounted")
    texts = [(folder / "stops.csv").read_text() for folder in (out, again, tmp_path / "mounted")]
    assert texts[0] == texts[1] != texts[2]
    assert [a[:2] for a in (line.split(",") for line in texts[0].splitlines()[1:])][-1][0] == "12"
    served = tmp_path / "served"
    said = run_here("recalibrate", unit, "--learned", out / "learned.txt", "--out", served)
    found = InService.model_validate_json((served / "service.json").read_text())
    assert found.power_ons == 12 and not found.findings and len(found.knots) == KNOTS
    assert all(0.0 < k.sigma_dph <= k.unlearned_dph for k in found.knots)
    assert min(k.sigma_dph / k.unlearned_dph for k in found.knots) < 0.7
    assert found.new_model_hash == load_model(served / "model.json").hash and "a new table" in said
    with pytest.raises(InputError, match="of another table"):  # nothing is applied twice
        learned_in_service(served, out / "learned.txt")
    with pytest.raises(InputError, match="--power-ons: 0"):
        run_here(*order[:4], "--power-ons", "0", "--out", tmp_path / "none")


def test_the_page_shows_where_and_when_it_was_learned(unit: Path, tmp_path: Path) -> None:
    """From service.json alone, again by report; stops that do not end to be refused are a finding."""
    run_here("simulate", "service", "--base", unit, "--power-ons", "40", "--seed", "4", "--out", tmp_path / "s")
    order = ("recalibrate", unit, "--learned", tmp_path / "s" / "learned.txt", "--out", tmp_path / "p")
    run_here(*order)
    bare = (tmp_path / "p" / "report.html").read_text()
    run_here(*order, "--stops", tmp_path / "s" / "stops.csv")
    page = (tmp_path / "p" / "report.html").read_text()
    assert "What was learned where" in bare and "<h2>Bias and correction" not in bare
    assert "<h2>Bias and correction" in page and "measured at a stop" in page
    run_here("report", tmp_path / "p")
    assert (tmp_path / "p" / "report.html").read_text() == page
    run_here("report", tmp_path / "p", "--display", "mdps")
    assert "learned, mdps" in (tmp_path / "p" / "report.html").read_text()
    stops, rows = tmp_path / "stops.csv", (tmp_path / "s" / "stops.csv").read_text()
    for text, why in (
        (rows.replace("shift_dph", "shift"), "column shift_dph: is missing"),
        (rows.replace("\n1,", "\nx,", 1), "column power_on: has a value that is no number"),
        (rows.splitlines()[0], "0 stops"),
    ):
        stops.write_text(text)
        with pytest.raises(InputError, match=why):
            run_here(*order, "--stops", stops)
    run_here(
        "simulate",
        "service",
        "--base",
        unit,
        "--power-ons",
        "60",
        "--mounted",
        "30",
        "--seed",
        "4",
        "--out",
        tmp_path / "m",
    )
    with pytest.raises(CheckFailed, match="stops were refused"):
        run_here(
            "recalibrate", unit, "--learned", tmp_path / "m" / "learned.txt", "--stops", tmp_path / "m" / "stops.csv"
        )


def test_an_authority_is_never_left_by_a_simulated_service(unit: Path, tmp_path: Path) -> None:
    run_here("simulate", "service", "--base", unit, "--power-ons", "6", "--mounted", "2", "--out", tmp_path / "s")
    rows = np.loadtxt(tmp_path / "s" / "stops.csv", delimiter=",", skiprows=1)
    assert np.abs(rows[:, 7]).max() <= LEARNING.authority_dph and (rows[:, 8] > 0.0).all()


@pytest.mark.parametrize("kind", ["nothing", "offset", "slope", "shape"])
def test_the_new_table_has_what_was_learned(kind: str, unit: Path, tmp_path: Path) -> None:
    knots = knots_of(unit)
    z = (knots - knots.mean()) / np.ptp(knots)
    shift = {
        "nothing": 0.0 * z, "offset": 2e-3 + 0.0 * z, "slope": 1e-3 + 4e-3 * z, "shape": 5e-3 * np.sin(9.0 * z)
    }[kind]  # fmt: skip
    words = kept(unit, tmp_path / "w.txt", shift, 1e-2)
    found, model = learned_in_service(unit, words)
    assert found.moved == kind and found.power_ons == 9
    assert [k.shift_dph for k in found.knots] == pytest.approx(shift.tolist(), rel=1e-6, abs=1e-12)
    if model is None:
        assert kind == "nothing" and found.new_model_hash is None
        return
    at_knots = model.map_dph(knots, 0.0) - load_model(unit / "model.json").map_dph(knots, 0.0)
    assert at_knots == pytest.approx(shift, abs=2e-5)
    t, moved = moved_by(unit, model)
    assert np.abs(moved - np.interp(t, knots, shift)).max() < (1e-3 if kind == "shape" else 2e-5)
    sigma = model.uncertainty_dph
    assert sigma is not None and min(sigma.rows[0]) > 1e-6 and sigma.rows[0][3] == 1.0
    emit(model, tmp_path)


def test_words_that_are_not_its_own_are_refused(unit: Path, tmp_path: Path) -> None:
    words = kept(unit, tmp_path / "w.txt", np.zeros(KNOTS))
    text = words.read_text()
    for wrong, why in (
        (text.replace(text[40], "0" if text[40] != "0" else "1", 1), "damaged"),
        (text[:-10], "47 of 47"),
        (text[:-3] + "xy\n", "47 of 48"),
    ):
        words.write_text(wrong)
        with pytest.raises(InputError, match=why):
            learned_in_service(unit, words)
    plain = load_model(unit / "model.json").model_copy(update={"learning": None})
    plain.save(tmp_path / "model.json")
    emit(plain, tmp_path)
    with pytest.raises(InputError, match="has no learning"):
        learned_in_service(tmp_path, words)


def test_drift_beyond_its_limit_is_a_finding_and_no_table(unit: Path, tmp_path: Path) -> None:
    words = kept(unit, tmp_path / "w.txt", np.full(KNOTS, 3e-3), 1e-2)
    years = 9 * 30 / 365.25
    limits = Limits(schema=1)
    for per_year, ids in ((2.5e-3 / years, ["drift_beyond_limit"]), (3.5e-3 / years, [])):
        stated = limits.model_copy(update={"interval": Recalibration(days=365.0, drift_dph_per_year=per_year)})
        found, model = learned_in_service(unit, words, stated)
        assert [f.id for f in found.findings] == ids and (model is None) == bool(ids)
        assert found.drift_limit_dph == pytest.approx(per_year * years, rel=1e-2)
    far = kept(unit, tmp_path / "far.txt", np.full(KNOTS, LEARNING.authority_dph))
    found, model = learned_in_service(unit, far)
    assert [f.id for f in found.findings] == ["at_authority"] and model is None
    with pytest.raises(CheckFailed, match="authority"):
        run_here("recalibrate", unit, "--learned", far)


def test_a_parking_is_worth_more_the_longer_it_is() -> None:
    found = parkings(LEARNING, (-40.0, 60.0))
    after = [one.after_dph for one in found]
    assert all(one.after_dph < one.before_dph for one in found) and after == sorted(after, reverse=True)
    for one in found:  # a rest tells at least what its own mean tells
        assert one.after_dph <= 1.001 * LEARNING.noise_deg_per_sqrt_h / np.sqrt(one.minutes / 60.0)


@pytest.mark.parametrize(("level", "shape"), [(2e-4, 3e-5), (2e-4, 0.0), (0.0, 0.0)])
def test_ageing_is_what_units_moved_between_two_calibrations(level: float, shape: float) -> None:
    draw, t, noise = np.random.default_rng(11), np.linspace(-40.0, 60.0, KNOTS), 5e-5
    of_month, moves = level**2 + shape**2 * walk(t - 10.0), []
    for months in draw.uniform(6.0, 24.0, 60):
        moved = draw.multivariate_normal(np.zeros(KNOTS), months * of_month) + draw.normal(0.0, noise, KNOTS)
        moves.append(Moved(t, moved, noise**2 * np.eye(KNOTS), float(months)))
    found = fitted_ageing(moves, 10.0)
    assert found[0] == pytest.approx(level, rel=0.25, abs=5e-6)  # 60 units: 1 sigma of 9 %
    assert found[1] == pytest.approx(shape, rel=0.25, abs=2e-6)


def test_the_prior_of_a_lot_is_as_wide_as_its_posterior() -> None:
    draw = np.random.default_rng(3)
    t, r = draw.uniform(-20.0, 30.0, 200), draw.uniform(-2.0, 2.0, 200)  # nothing above 30 C
    means = UnitMeans(t, r, 1e-3 * t + 0.01 * np.sin(t / 9.0) + draw.normal(0.0, 1e-3, 200), np.ones(200), 1e-3)
    known = posterior_of_means(means, ((-20.0, 60.0), (-2.0, 2.0)), 2e-4)
    ageing = LotAgeing(
        units=9, months=12.0, level_dph_per_sqrt_month=3e-4, shape_dph_per_sqrt_month_c=1e-5
    )  # fmt: skip
    spread = spread_of_lot(data_sheet_spread(1e-3, 2e-4, 0.0), known, ageing, (-20.0, 60.0), 10.0)
    learning = LEARNING.model_copy(update={"spread": spread, "reference_c": 10.0})
    prior = np.sqrt(np.diag(full(service_prior(learning, (-20.0, 60.0)).map_var)))
    left = np.sqrt(np.diag(covariance_at(known, np.linspace(-20.0, 60.0, KNOTS))))
    assert np.sum(prior**2) == pytest.approx(np.sum(left**2), rel=1e-9)
    assert left[-1] > 3.0 * left[3] and prior[-1] > 2.0 * prior[3]  # wide where nobody has been
    assert spread.ageing * np.sqrt(MONTH_H) == pytest.approx(3e-4) and spread.turn_on == 2e-4


def power_ons_of(turn_on: float, farther: float = 1.0) -> TrainingData:
    """Six runs over 40 C of one map, a constant drawn at each; the last goes so many times as far and as fast."""
    draw, n, parts = np.random.default_rng(5), 14, []
    for run in range(6):
        time_s = 900.0 * np.arange(n)
        t = 10.0 + (20.0 if run < 5 else 20.0 * farther) * np.sin(time_s / 2000.0 + run)
        bias = 0.1 * np.cos(t / 15.0) + draw.normal(0.0, turn_on) + draw.normal(0.0, 1e-3, n)
        slope = np.gradient(t, time_s / 60.0)
        parts.append((t, slope, bias, np.ones(n), np.full(n, run), time_s, np.full(n, 900.0)))
    columns = [np.concatenate(x) for x in zip(*parts, strict=True)]
    return TrainingData(*columns[:4], columns[4].astype(np.int64), *columns[5:])


@pytest.mark.parametrize("turn_on", [2e-3, 2e-2])
def test_past_power_ons_say_how_far_the_next_one_is(turn_on: float) -> None:
    """They know the map well: what is drawn at each is what the map of the others leaves."""
    means = power_ons_of(turn_on)
    start = data_sheet_spread(5e-3, 5e-3, 0.0).model_copy(update={"warm_up": 5e-3, "turn_on_slope": 1e-4})
    found = spread_of_power_ons(start, means, "mrbf", (-10.0, 30.0), 10.0, "limits.toml")
    drawn = np.std([means.bias_dph[means.run == run].mean() for run in range(6)])
    assert 0.4 < np.hypot(found.level, found.turn_on) / drawn < 2.5  # one constant a run, six runs
    assert found.ageing == 0.0
    with pytest.raises(InputError, match=r"limits\.toml: 2 training runs"):
        spread_of_power_ons(start, means.select(means.run < 2), "mrbf", (-10.0, 30.0), 10.0, "limits.toml")


def test_a_run_beyond_the_others_is_held_against_their_map_at_its_edge() -> None:
    """A smooth prior alone said biases of 1e7 deg/h there, on the recordings of a consumer's MEMS."""
    start = data_sheet_spread(5e-3, 5e-3, 0.0).model_copy(update={"warm_up": 5e-3, "turn_on_slope": 1e-4})
    found = spread_of_power_ons(start, power_ons_of(2e-3, 3.0), "mrbf", (-50.0, 70.0), 10.0, "limits.toml")
    assert np.hypot(found.level, found.turn_on) < 0.5  # the map spans 0.2
