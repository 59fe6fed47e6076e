"""Recordings that cannot carry a PASS, each made from recordings that do carry one, and constants of every size.

A unit is made of eight short runs, each after its own power-on, four of them for the exam. Its limits are far from its
figures, so that the figures alone would pass each case.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import HOST, run_gyrotc
from gyrotc.assess import LEAST_POWER_ONS, evaluate, evaluation
from gyrotc.recordings import load
from read_pictures import panels_of, pictures_of
from recordings import write_csv
from scipy.spatial import cKDTree

Rows = dict[str, np.ndarray]
PERIOD_S = 10.0
ROWS = 900
SIGMA_DPH = 0.02
LIMITS = """schema = 1
[at_most]
rms_dph = 1.0
[at_least]
improvement = 1.5
"""


def bias_dph(temperature: Any) -> Any:
    return 0.6 * ((temperature - 20.0) / 20.0) ** 2 + 0.02 * temperature


def rows_of(seed: int) -> Rows:
    """A triangle of temperature over 40 C in two and a half hours, a bias of 1 deg/h over it, and white noise."""
    rng = np.random.default_rng(seed)
    t = PERIOD_S * np.arange(ROWS)
    phase = t / t[-1]
    temperature = 40.0 * (1.0 - np.abs(2.0 * phase - 1.0)) + rng.normal(0.0, 0.005, ROWS)
    rate = bias_dph(temperature) + rng.normal(0.0, SIGMA_DPH, ROWS)
    return {"time_s": t, "temperature_c": temperature, "rate_dph": rate}


Runs = dict[str, tuple[str, Rows]]
"""Role and rows by name of the file."""


def unit(train: int = 4, exam: int = 4) -> Runs:
    roles = ["train"] * train + ["exam"] * exam
    return {f"run-{k:02d}.csv": (role, rows_of(k)) for k, role in enumerate(roles)}


def written(folder: Path, runs: Runs, *, serial: str = "RLG-1", more: str = "") -> Path:
    text = f'schema = 1\nserial = "{serial}"\nearth_rate = "none"\n{more}'
    for k, (name, (role, rows)) in enumerate(runs.items()):
        write_csv(folder / name, rows)
        start = datetime(2026, 3, 1, tzinfo=timezone.utc) + timedelta(days=k)
        text += f'[[run]]\nfile = "{name}"\nrole = "{role}"\nstarted = {start.isoformat()}\npower_on_s = 0.0\n'
    (folder / "dataset.toml").write_text(text)
    return folder


def built(folder: Path, data: Path, limits: str = LIMITS, status: int | None = None) -> dict[str, Any]:
    """Return the results of a build by name; the exit status is 0 for a PASS or CONDITIONAL PASS."""
    (folder / "limits.toml").write_text(limits)
    out = folder / f"result-{data.name}"
    done = run_gyrotc("build", data, *HOST, "--limits", folder / "limits.toml", "--out", out)
    held = json.loads((out / "limits.json").read_text())
    expected = 0 if held["verdict"] in ("PASS", "CONDITIONAL PASS") else 1
    assert done.returncode == (expected if status is None else status), done.stderr
    names = ("limits", "evaluate", "budget", "training", "model")
    return {name: json.loads((out / f"{name}.json").read_text()) for name in names} | {"out": out, "done": done}


def exam_rows(change: Callable[[Rows], Rows]) -> Callable[[Runs], Runs]:
    return lambda runs: {n: (role, change(rows) if role == "exam" else rows) for n, (role, rows) in runs.items()}


def all_rows(change: Callable[[Rows], Rows]) -> Callable[[Runs], Runs]:
    return lambda runs: {n: (role, change(rows)) for n, (role, rows) in runs.items()}


def held_at(c: float, span_c: float) -> Callable[[Rows], Rows]:
    """Return what keeps a chamber at a temperature, with a slow wave of a given span."""

    def change(rows: Rows) -> Rows:
        t = c + 0.5 * span_c * np.sin(np.linspace(0.0, 6.0 * np.pi, ROWS))
        noise = np.random.default_rng(99).normal(0.0, SIGMA_DPH, ROWS)
        return rows | {"temperature_c": t, "rate_dph": bias_dph(t) + noise}

    return change


def half(rows: Rows) -> Rows:
    return {name: values[: ROWS // 3] for name, values in rows.items()}


def constant(rows: Rows) -> Rows:
    return rows | {"rate_dph": np.full(ROWS, 0.4), "temperature_c": np.full(ROWS, 20.0)}


def goes_on(rows: Rows) -> Rows:
    """The recording goes on for seven times as long after the logger has died; what it repeats is right."""
    dead = 7 * ROWS
    time_s = rows["time_s"][-1] + PERIOD_S * np.arange(1, dead + 1)
    held_c = np.full(dead, rows["temperature_c"][-1])
    after = {"time_s": time_s, "temperature_c": held_c, "rate_dph": bias_dph(held_c)}
    return {name: np.concatenate([values, after[name]]) for name, values in rows.items()}


def repeats(rows: Rows) -> Rows:
    """A fifth of the rates are repeated; the temperatures go on."""
    rate = rows["rate_dph"].copy()
    rate[600:780] = rate[599]
    return rows | {"rate_dph": rate}


def saturated(rows: Rows) -> Rows:
    return rows | {"rate_dph": np.clip(rows["rate_dph"], 0.0, 0.9)}


def few(runs: Runs) -> Runs:
    return {name: runs[name] for name in ("run-00.csv", "run-01.csv", "run-04.csv")}


CASES = {
    "as recorded": (lambda runs: runs, "PASS", None),
    "exam at a hold of 0.6 C": (exam_rows(held_at(20.0, 0.6)), "NOT TESTABLE", "exam_covers_envelope"),
    "exam over a third of the range": (exam_rows(half), "CONDITIONAL PASS", "exam_covers_envelope"),
    "exam of a dead logger": (exam_rows(constant), "NOT TESTABLE", "rows"),
    "exam whose logger died after it": (exam_rows(goes_on), "NOT TESTABLE", "rows"),
    "exam of repeated rates": (exam_rows(repeats), "CONDITIONAL PASS", "rows"),
    "gyro beyond its range": (all_rows(saturated), "NOT TESTABLE", "rows"),
    "gyro beyond its range in the exam": (exam_rows(saturated), "NOT TESTABLE", "rows"),
    "three power-ons": (few, "CONDITIONAL PASS", "power_ons"),
}


@pytest.mark.parametrize("name", CASES)
def test_what_the_recordings_cannot_show_is_no_pass(name: str, tmp_path: Path) -> None:
    change, verdict, lacking = CASES[name]
    found = built(tmp_path, written(tmp_path / "RLG-1", change(unit())))
    requirements = {one["id"]: one for one in found["evaluate"]["requirements"]}
    assert found["limits"]["verdict"] == verdict, requirements
    if lacking is not None:
        assert requirements[lacking]["verdict"] != "PASS" and requirements[lacking]["next"]
        assert all(one["verdict"] != "PASS" for one in found["limits"]["limits"] if one["part"])
    assert f"a PASS needs {LEAST_POWER_ONS}" in (found["out"] / "report.html").read_text("utf-8")


def test_spans_of_one_file_and_files_of_one_power_on_count_once(tmp_path: Path) -> None:
    """Eight files whose clocks say that the gyro was switched on once."""
    data = written(tmp_path / "RLG-1", unit())
    text = (data / "dataset.toml").read_text()
    for k in range(8):
        text = text.replace("power_on_s = 0.0\n", f"power_on_s = {-86400.0 * k}\n", 1)
    (data / "dataset.toml").write_text(text)
    found = built(tmp_path, data)
    assert found["limits"]["verdict"] == "CONDITIONAL PASS"
    (one,) = (r for r in found["evaluate"]["requirements"] if r["id"] == "power_ons")
    assert one["text"].startswith("1 power-on was recorded")


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("plain")
    return built(folder, written(folder / "RLG-1", unit()))


def test_a_short_exam_states_no_less_than_a_long_one(plain: dict[str, Any], tmp_path: Path) -> None:
    """Each figure and U of an exam of ten means, against those of the same exam in full."""
    short = unit()
    for name, (role, rows) in short.items():
        if role == "exam":
            short[name] = (role, {k: v[: 30 if name != "run-07.csv" else 20] for k, v in rows.items()})
    some = built(tmp_path, written(tmp_path / "some", short))
    assert some["evaluate"]["exam"]["samples"] <= 12 and plain["evaluate"]["exam"]["samples"] > 300
    assert some["budget"]["expanded_dph"] > plain["budget"]["expanded_dph"]
    known = plain["evaluate"]["uncertainty"]
    for name, one in (some["evaluate"]["uncertainty"] or {}).items():
        if name in ("rms_dph", "std_dph", "mean_dph", "improvement"):
            relative = [e["exam"]["after"]["rms_dph"] for e in (some["evaluate"], plain["evaluate"])]
            assert one["standard"] / relative[0] > known[name]["standard"] / relative[1], name


def test_no_exam_states_no_less_than_an_exam(plain: dict[str, Any], tmp_path: Path) -> None:
    """A method chosen by name and no test run: nothing shows that the map holds."""
    runs = {name: of for name, of in unit().items() if of[0] == "train"}
    none = built(tmp_path, written(tmp_path / "none", runs))
    assert none["budget"]["expanded_dph"] > 0.8 * plain["budget"]["expanded_dph"]


def test_neither_order_nor_names_of_files_change_a_verdict(tmp_path: Path) -> None:
    runs = exam_rows(half)(unit())
    first = built(tmp_path, written(tmp_path / "a", runs))
    names = list(runs)
    shuffled = {f"z{k}-{name}": runs[name] for k, name in enumerate(np.random.default_rng(5).permutation(names))}
    data = written(tmp_path / "b", {new: (role, rows) for new, (role, rows) in shuffled.items()})
    second = built(tmp_path, data)
    for one, other in zip(first["limits"]["limits"], second["limits"]["limits"], strict=True):
        assert one["verdict"] == other["verdict"] and one["measured"] == pytest.approx(other["measured"], rel=0.02)
    assert first["limits"]["verdict"] == second["limits"]["verdict"]


def test_the_unit_of_the_rate_changes_no_verdict(plain: dict[str, Any], tmp_path: Path) -> None:
    """The same recordings in deg/s."""
    first = plain
    in_dps = all_rows(lambda rows: rows | {"rate_dph": rows["rate_dph"] / 3600.0})(unit())
    data = written(tmp_path / "b", in_dps)
    head, _, tail = (data / "dataset.toml").read_text().partition("[[run]]")
    (data / "dataset.toml").write_text(head + '[units]\nrate = "deg/s"\n[[run]]' + tail)
    second = built(tmp_path, data)
    assert first["limits"]["verdict"] == second["limits"]["verdict"] == "PASS"
    for one, other in zip(first["limits"]["limits"], second["limits"]["limits"], strict=True):
        assert one["measured"] == pytest.approx(other["measured"], rel=1e-3)


@pytest.mark.parametrize(("offset_dph", "scale"), [(9.7, 1.0), (-10.0, 10.0), (1e4, 100.0)])
def test_a_constant_in_the_rate_changes_nothing_but_itself(
    plain: dict[str, Any], tmp_path: Path, offset_dph: float, scale: float
) -> None:
    """Figures scale with the rate and do not see an offset, but for the proven rounding of the table.

    Beside 1e4 deg/h a rate of a hundredth would have too few digits in float32.
    """

    def moved(rows: Rows) -> Rows:
        return rows | {"rate_dph": scale * rows["rate_dph"] + offset_dph}

    limits = LIMITS.replace("rms_dph = 1.0", f"rms_dph = {scale}")
    found = built(tmp_path, written(tmp_path / "RLG-1", all_rows(moved)(unit()), serial="RLG-1"), limits)
    assert found["limits"]["verdict"] == plain["limits"]["verdict"] == "PASS"
    one, other = found["evaluate"], plain["evaluate"]
    assert one["exam"]["improvement"] == pytest.approx(other["exam"]["improvement"], rel=0.02)
    for part in ("constant", "after"):
        assert one["exam"][part]["rms_dph"] == pytest.approx(scale * other["exam"][part]["rms_dph"], rel=0.02)
    assert one["noise_floor_dph"] == pytest.approx(scale * other["noise_floor_dph"], rel=0.02)
    assert one["constant_dph"] == pytest.approx(scale * other["constant_dph"] + offset_dph, rel=1e-3)
    assert [f["id"] for f in one["findings"]] == [f["id"] for f in other["findings"]]


def test_a_constant_that_takes_the_digits_of_float32_is_named(tmp_path: Path) -> None:
    """At 1e5 deg/h a step of float32 is 0.008 deg/h, above the noise floor: no cause is to be looked for."""
    runs = all_rows(lambda rows: rows | {"rate_dph": rows["rate_dph"] + 1e5})(unit())
    found = built(tmp_path, written(tmp_path / "RLG-1", runs))
    one = found["evaluate"]["findings"][0]
    assert one["id"] == "coarse_arithmetic" and one["evidence"]["error_dph"] > found["evaluate"]["noise_floor_dph"]
    assert "next: Subtract a constant near 10000" in found["done"].stdout


def test_a_coarse_unit_of_fixed_point_is_not_blamed_on_a_constant(plain: dict[str, Any], tmp_path: Path) -> None:
    (tmp_path / "limits.toml").write_text('schema = 1\nq31_bias_frac_bits = 7\n[needs]\narithmetics = ["q31"]\n')
    data, out = plain["out"].parent / "RLG-1", tmp_path / "out"
    done = run_gyrotc("build", data, "--target", "host-gcc-O2", "--limits", tmp_path / "limits.toml", "--out", out)
    one = json.loads((out / "evaluate.json").read_text())["findings"][0]
    assert one["id"] == "coarse_arithmetic" and "2^-7 deg/h" in one["text"] and "constant" not in one["text"]
    assert "next: State a larger q31_bias_frac_bits" in done.stdout


def test_figures_of_the_judged_runs_do_not_depend_on_their_order(plain: dict[str, Any], tmp_path: Path) -> None:
    """One test run has spikes and another moves less, so that no two runs have the same figures."""
    runs = unit()
    exams = [name for name, (role, _) in runs.items() if role == "exam"]
    rate = runs[exams[0]][1]["rate_dph"].copy()
    rate[[100, 333]] += 500.0
    runs[exams[0]] = ("exam", runs[exams[0]][1] | {"rate_dph": rate})
    runs[exams[-1]] = ("exam", half(runs[exams[-1]][1]))
    dataset = load(written(tmp_path / "RLG-1", runs))
    found = [
        evaluate(plain["out"], replace(dataset, runs=order), compiled=False)
        for order in (dataset.runs, dataset.runs[::-1])
    ]
    figures = [
        (one.sigma_rms_dph, one.usable and one.usable.rms_dph, one.exam and one.exam.after.rms_dph) for one in found
    ]
    assert all(figures[0]) and figures[0] == pytest.approx(figures[1], rel=1e-9)


@pytest.mark.parametrize("own", [True, False])
def test_figures_of_left_out_runs_count_on_the_recordings_of_training_alone(
    own: bool, plain: dict[str, Any], tmp_path: Path
) -> None:
    """One run of four is another; what training has shown of unseen history is true of the model, wherever it is."""
    runs = {name: run for name, run in unit().items() if run[0] == "train"}
    first, (_, rows) = next(iter(runs.items()))
    if not own:
        runs[first] = ("train", rows | {"rate_dph": rows["rate_dph"] + 1e-3})
    found = evaluate(plain["out"], load(written(tmp_path / "RLG-1", runs)), compiled=False)
    assert len(runs) > 1 and (found.left_out is not None) == own
    assert plain["training"]["generalises"] is True and found.generalises is True


def test_steps_that_differ_are_counted_over_all_runs(plain: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """The first step of each run is taken for one that differs."""
    replay_on = evaluation.replay_on

    def first_differs(*arguments: Any) -> Iterator[Any]:
        for part in replay_on(*arguments):
            yield replace(part, wrong=np.arange(1 if part.rows.start == 0 else 0))

    monkeypatch.setattr(evaluation, "replay_on", first_differs)
    dataset = load(plain["out"].parent / "RLG-1")
    assert evaluate(plain["out"], dataset).mismatches == len(dataset.runs) > 1


def test_a_limit_that_a_constant_keeps_is_named(tmp_path: Path) -> None:
    """On a unit with a bias of 1 deg/h over temperature; an offset of 10 deg/h does not hide it."""
    offset = all_rows(lambda rows: rows | {"rate_dph": rows["rate_dph"] + 10.0})(unit())
    limits = (
        "schema = 1\n[at_most]\nrms_dph = 1.0\nstd_dph = 0.1\nmax_abs_dph = 20.0\nrms_over_floor = 1e3\n"
        "rms_30min_dph = 1.0\nangle_1h_arcsec = 1e4\nfirst_10min_rms_dph = 0.1\ncenters = 1e3\n"
        "[at_least]\nimprovement = 0.9\n"
    )
    found = built(tmp_path, written(tmp_path / "RLG-1", offset), limits)
    kept = {one["limit"].partition(".")[2]: one["constant_passes"] for one in found["limits"]["limits"]}
    assert kept == {
        "rms_dph": True, "std_dph": False, "max_abs_dph": True, "rms_over_floor": True, "rms_30min_dph": True,
        "angle_1h_arcsec": True, "first_10min_rms_dph": False, "centers": False, "improvement": True,
    }  # fmt: skip
    page = (found["out"] / "report.html").read_text("utf-8")
    assert page.count("a constant keeps it, too") == sum(kept.values())


def test_a_constant_moves_no_dot_of_the_first_picture(plain: dict[str, Any], tmp_path: Path) -> None:
    """Each dot with an offset of 10 deg/h is where one is without, and the other way round."""
    offset = all_rows(lambda rows: rows | {"rate_dph": rows["rate_dph"] + 10.0})(unit())
    found = built(tmp_path, written(tmp_path / "RLG-1", offset))
    drawn = []
    for result in (plain, found):
        (first, *_) = pictures_of((result["out"] / "report.html").read_text("utf-8"))
        drawn.append([np.concatenate([s.pixels for s in p.series if s.kind == "dots"]) for p in panels_of(first)])
    for before, after in zip(*drawn, strict=True):
        for some, others in ((before, after), (after, before)):
            away, _ = cKDTree(others).query(some, p=np.inf)
            assert away.max() < 1.0, "a point of the picture"


def reversed_bias(rows: Rows) -> Rows:
    return rows | {"rate_dph": 2.0 - rows["rate_dph"]}


def test_recordings_of_another_gyro_are_refused(plain: dict[str, Any], tmp_path: Path) -> None:
    """The table of RLG-1 is evaluated on recordings of RLG-2; nothing of the result changes."""
    out = shutil.copytree(plain["out"], tmp_path / "out")
    other = written(tmp_path / "RLG-2", unit(), serial="RLG-2")
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    done = run_gyrotc("evaluate", out, other)
    assert done.returncode == 2 and "gyro RLG-2" in done.stderr and 'serial = "RLG-1"' in done.stderr, done.stderr
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before


def test_new_figures_are_held_against_the_limits_of_the_result(plain: dict[str, Any], tmp_path: Path) -> None:
    """A PASS, evaluated on recordings with the opposite bias and then on those that it was built from."""
    out = shutil.copytree(plain["out"], tmp_path / "out")
    limits = (out / "limits.json").read_text()
    other = written(tmp_path / "other", all_rows(reversed_bias)(unit()))
    done = run_gyrotc("evaluate", out, other)
    assert done.returncode == 1 and "RLG-1: FAIL" in done.stdout, done.stdout + done.stderr
    assert run_gyrotc("report", out).returncode == 0
    assert "<strong>FAIL</strong>" in (out / "report.html").read_text("utf-8")
    again = run_gyrotc("evaluate", out, written(tmp_path / "same", unit()))
    assert again.returncode == 0 and "RLG-1: PASS" in again.stdout
    assert (out / "limits.json").read_text() == limits


def test_no_page_is_drawn_of_limits_of_other_figures(plain: dict[str, Any], tmp_path: Path) -> None:
    out = shutil.copytree(plain["out"], tmp_path / "out")
    passed = (out / "limits.json").read_bytes()
    run_gyrotc("evaluate", out, written(tmp_path / "other", all_rows(reversed_bias)(unit())))
    (out / "limits.json").write_bytes(passed)
    page = (out / "report.html").read_bytes()
    done = run_gyrotc("report", out)
    assert done.returncode == 2 and "limits.json" in done.stderr, done.stderr
    assert (out / "report.html").read_bytes() == page


def test_a_pass_of_a_table_that_does_not_fit_its_exam_says_so(plain: dict[str, Any], tmp_path: Path) -> None:
    """In the exam the bias has three times the noise more than in training: within the limits, and no noise."""
    words = "what remains is more than noise"
    wave = 3.0 * SIGMA_DPH * np.sin(np.linspace(0.0, 8.0 * np.pi, ROWS))
    shifted = exam_rows(lambda rows: rows | {"rate_dph": rows["rate_dph"] + wave})(unit())
    found = built(tmp_path, written(tmp_path / "RLG-1", shifted))
    assert found["limits"]["verdict"] == "PASS"
    for result, said in ((plain, False), (found, True)):
        head = (result["out"] / "report.html").read_text("utf-8").partition("</header>")[0]
        assert (words in result["done"].stdout, words in head) == (said, said)


def test_what_is_not_stated_of_earths_rate_is_said_once(tmp_path: Path) -> None:
    """The C code carries it, and the page has it among its findings only."""
    data = written(tmp_path / "RLG-1", unit())
    text = (data / "dataset.toml").read_text()
    (data / "dataset.toml").write_text(text.replace('earth_rate = "none"\n', ""))
    found = built(tmp_path, data)
    page = (found["out"] / "report.html").read_text("utf-8")
    assert page.count("the model may take Earth") == 1 == page.count("Earth rate not stated")
    assert "the model may take Earth's rate for bias" in found["model"]["meta"]["warnings"][0]


def test_what_no_finding_repeats_is_on_the_page_beside_earths_rate(tmp_path: Path) -> None:
    runs = unit()
    role, rows = runs["run-00.csv"]
    runs["run-00.csv"] = (role, rows | {"supply_v": np.full(ROWS, 5.0)})
    data = written(tmp_path / "RLG-1", runs)
    text = (data / "dataset.toml").read_text()
    (data / "dataset.toml").write_text(text.replace('earth_rate = "none"\n', ""))
    page = (built(tmp_path, data)["out"] / "report.html").read_text("utf-8")
    assert "channel supply_v is left out" in page and page.count("the model may take Earth") == 1
