"""Figures of the page, the certificate, the terminal and JSON, against values computed here from the recordings.

pandas reads the recordings and the traces and makes the means; numpy and allantools do the statistics. Each series of a
picture is found by its colour and the words of the legend, and compared with the data that it claims to show.
"""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import allantools
import numpy as np
import pandas as pd
import pytest
from conftest import run_gyrotc
from gyrotc.model import load_model
from numpy.typing import NDArray
from read_pictures import PanelRead, number, panels_of, pictures_of, tables_of
from scipy.spatial import cKDTree

Floats = NDArray[np.float64]

AVERAGE_S = 100.0
NOT_CORRECTED = 8
"""Status bit of rows before the first correction (docs/numerics.md): they are in the picture over time alone."""
NEAR = 0.11
"""Points of a picture: places are rounded to a tenth, and those of dots to half a point."""
REST_C_PER_MIN = 0.1
RUNS = tuple(f"run-{k:02d}.csv" for k in range(1, 13))
EXAM = RUNS[6:]


def averaged(rows: pd.DataFrame) -> pd.DataFrame:
    """Means over 100 s from the first row on."""
    cell = np.floor((rows["time_s"] - rows["time_s"].iloc[0]) / AVERAGE_S + 1e-9)
    return rows.groupby(cell).mean()


@cache
def run_of(folder: Path, file: str) -> pd.DataFrame:
    """Rows of a recording with the correction of the trace, and what remains."""
    recorded = pd.read_csv(folder / "data" / file)
    trace = pd.read_csv(folder / "result" / "trace" / file)
    assert np.array_equal(recorded["time_s"], trace["time_s"]), "a row of the trace for each of the recording"
    rows = recorded.assign(status=trace["status"], bias_dph=trace["bias_dph"])
    return rows.assign(remains_dph=rows["rate_dph"] - rows["bias_dph"])


@cache
def means_of(folder: Path, file: str, *, corrected: bool = True) -> pd.DataFrame:
    rows = run_of(folder, file)
    if corrected:
        cell = np.floor((rows["time_s"] - rows["time_s"].iloc[0]) / AVERAGE_S + 1e-9)
        judged = (rows["status"] & NOT_CORRECTED) == 0
        return rows[judged].groupby(cell[judged]).mean()
    return averaged(rows)


def pooled(folder: Path, files: tuple[str, ...], column: str) -> Floats:
    return np.concatenate([means_of(folder, file)[column].to_numpy() for file in files])


def constant_of(folder: Path) -> float:
    """Return the mean bias of the training runs, each row counting alike."""
    return float(np.mean(np.concatenate([run_of(folder, file)["rate_dph"].to_numpy() for file in RUNS[:6]])))


def statistics(x: Floats) -> dict[str, float]:
    return {
        "rms_dph": float(np.sqrt(np.mean(x**2))),
        "std_dph": float(np.std(x)),
        "mean_dph": float(np.mean(x)),
        "max_abs_dph": float(np.abs(x).max()),
    }


@pytest.fixture(scope="module")
def page(demo: Path) -> str:
    return (demo / "result" / "report.html").read_text("utf-8")


@pytest.fixture(scope="module")
def evaluation(demo: Path) -> dict[str, Any]:
    return dict(json.loads((demo / "result" / "evaluate.json").read_text()))


@pytest.fixture(scope="module")
def training(demo: Path) -> dict[str, Any]:
    return dict(json.loads((demo / "result" / "training.json").read_text()))


@pytest.fixture(scope="module")
def panels(page: str) -> list[PanelRead]:
    return [panel for picture in pictures_of(page) for panel in panels_of(picture)]


def table_with(page: str, heading: str) -> list[list[str]]:
    (found,) = (t for t in tables_of(page) if any(heading in cell for cell in t[0]))
    return found


def row_of(table: list[list[str]], *names: str) -> list[str]:
    (found,) = (row for row in table if tuple(row[: len(names)]) == names)
    return found


def digits(text: str, value: float, *, share: float = 6e-3) -> bool:
    """Whether a text of three digits (two: share 6e-2) says a value."""
    return number(text) == pytest.approx(value, rel=share)


@pytest.mark.parametrize("files", [EXAM, RUNS[:6]], ids=["exam", "train"])
def test_json_has_the_statistics_of_the_recordings(demo: Path, evaluation: dict[str, Any], files: Any) -> None:
    role = "exam" if files is EXAM else "train"
    before, after = pooled(demo, files, "rate_dph"), pooled(demo, files, "remains_dph")
    stated = evaluation[role]
    assert stated["samples"] == after.size
    assert stated["before"] == pytest.approx(statistics(before), rel=1e-6, abs=1e-9)
    assert stated["after"] == pytest.approx(statistics(after), rel=1e-4, abs=1e-8)
    zero = statistics(before)["rms_dph"] / statistics(after)["rms_dph"]
    assert stated["improvement_about_zero"] == pytest.approx(zero, rel=1e-4)
    left = before - constant_of(demo)
    assert stated["constant"] == pytest.approx(statistics(left), rel=2e-3, abs=2e-6)
    gain = statistics(left)["rms_dph"] / statistics(after)["rms_dph"]
    assert stated["improvement"] == pytest.approx(gain, rel=2e-3)
    for run in (r for r in evaluation["runs"] if r["role"] == role):
        own = means_of(demo, run["file"])
        for side, column in (("before", "rate_dph"), ("after", "remains_dph")):
            expected_of = statistics(own[column].to_numpy())
            assert {k: run[side][k] for k in expected_of} == pytest.approx(expected_of, rel=1e-4, abs=1e-8)


def test_the_page_has_the_figures_before_with_a_constant_and_after(demo: Path, page: str) -> None:
    before, after = statistics(pooled(demo, EXAM, "rate_dph")), statistics(pooled(demo, EXAM, "remains_dph"))
    table = table_with(page, "with the table ± U")
    flat = statistics(pooled(demo, EXAM, "rate_dph") - constant_of(demo))
    for name, key in (
        ("RMS", "rms_dph"),
        ("standard deviation about the mean", "std_dph"),
        ("largest magnitude", "max_abs_dph"),
    ):
        row = row_of(table, name)
        assert digits(row[1], before[key]) and digits(row[2], flat[key], share=0.01), row
        assert digits(row[3], after[key], share=0.06), row
    assert digits(row_of(table, "mean")[1], before["mean_dph"])
    ratios = row_of(table, "RMS before ÷ RMS after: improvement")
    assert digits(ratios[1], before["rms_dph"] / after["rms_dph"])
    assert digits(ratios[2], flat["rms_dph"] / after["rms_dph"])


def test_the_page_says_of_each_run_what_its_recording_gives(demo: Path, page: str, evaluation: dict[str, Any]) -> None:
    table = table_with(page, "angle in 1 h, arcsec")
    for run in evaluation["runs"]:
        own = means_of(demo, run["file"])
        after = statistics(own["remains_dph"].to_numpy())
        row = row_of(table, run["file"])
        flat = statistics(own["rate_dph"].to_numpy() - evaluation["constant_dph"])
        assert row[1] == run["role"] and int(row[3]) == len(own)
        assert digits(row[4], flat["rms_dph"]) and digits(row[5], after["rms_dph"]), row
        assert digits(row[6], after["std_dph"]) and digits(row[8], after["max_abs_dph"], share=0.06), row
        hours = own["remains_dph"].groupby(np.floor((own["time_s"] - own["time_s"].iloc[0]) / 3600.0 + 1e-9))
        angle = 3600.0 * hours.mean()[hours.count() >= 0.9 * 36]  # 1 deg/h is 1 arcsec/s
        assert digits(row[9], float(np.sqrt(np.mean(angle**2)))), row


def shown_on_the_first_screen(page: str) -> dict[str, str]:
    """Return the figures above the picture, by their labels."""
    head, _, _ = page.partition("<main>")
    found = re.findall(r'<div class="value">([^<]*)</div><div class="label">([^<]*)</div>', head)
    return {label: value for value, label in found}


def test_each_figure_of_the_first_screen_is_that_of_the_recordings(demo: Path, page: str) -> None:
    """Gain with U, RMS, noise floor of the truth, and the bytes of each file."""
    shown = shown_on_the_first_screen(page)
    left, remains = pooled(demo, EXAM, "rate_dph") - constant_of(demo), pooled(demo, EXAM, "remains_dph")
    gain = float(np.sqrt(np.mean(left**2) / np.mean(remains**2)))
    value, spread = shown["improvement against a constant"].removesuffix(" ×").split(" ± ")
    assert float(value) == pytest.approx(gain, abs=0.006)
    assert float(spread) == pytest.approx(2.0 * robust_error_of_the_gain(demo), rel=0.4)
    rms = shown["RMS of 100 s means, deg/h"]
    assert digits(rms, float(np.sqrt(np.mean(remains**2))), share=0.06)
    truth = [np.load(demo / "data" / "truth" / file.replace(".csv", ".noise.npy")) for file in EXAM]
    floor = np.concatenate([np.asarray(noise).reshape(-1, 10).mean(axis=1) for noise in truth])
    assert digits(shown["noise floor of 100 s means, deg/h"], float(np.sqrt(np.mean(floor**2))))
    for name, size in re.findall(r'class="mono">c/([^<]*)</td><td class="n">([\d ]+) bytes', page):
        assert int(size.replace(" ", "")) == (demo / "result" / "c" / name).stat().st_size, name


def robust_error_of_the_gain(folder: Path) -> float:
    """Return the standard error of the gain, a ratio of means: by the delta method, over spans of two hours."""
    rows = []
    for file in EXAM:
        means = means_of(folder, file)
        span = file + (means["time_s"] // 7200.0).astype(int).astype(str)
        left = (means["rate_dph"] - constant_of(folder)) ** 2
        rows.append(pd.DataFrame({"left": left, "remains": means["remains_dph"] ** 2, "span": span}))
    table = pd.concat(rows, ignore_index=True)
    ratio = table["left"].mean() / table["remains"].mean()
    sums = (table["left"] - ratio * table["remains"]).groupby(table["span"]).sum()
    of_ratio = np.sqrt((sums**2).sum()) / len(table) / table["remains"].mean()
    return float(of_ratio / (2.0 * np.sqrt(ratio)))


def test_slopes_of_the_bias_are_those_of_a_plane(demo: Path, page: str) -> None:
    """By least squares over means of the training runs; the target sees dT/dt with a lag, hence the tolerance."""
    means = [means_of(demo, file) for file in RUNS[:6]]
    slope = np.concatenate([np.gradient(m["temperature_c"], m["time_s"] / 60.0) for m in means])
    t, rate = (np.concatenate([m[name] for m in means]) for name in ("temperature_c", "rate_dph"))
    columns = np.column_stack([np.ones_like(t), t, slope])
    plane, *_ = np.linalg.lstsq(columns, rate, rcond=None)
    table = table_with(page, "bias before compensation, by a plane")
    assert digits(row_of(table, "slope in temperature, deg/h/C")[1], plane[1], share=0.05)
    assert digits(row_of(table, "slope in temperature rate, deg/h/(C/min)")[1], plane[2], share=0.1)


def test_candidates_stand_with_what_they_leave_and_the_chosen_one_is_marked(
    page: str, training: dict[str, Any]
) -> None:
    table = table_with(page, "loss: above the best, %")[1:]
    assert len(table) == len(training["candidates"])
    for cells, row in zip(table, training["candidates"], strict=True):
        assert digits(cells[1], row["left_out_rms_dph"], share=0.06)
        assert cells[2] == ("–" if row.get("loss") is None else f"{100.0 * row['loss']:.1f}")
        assert (cells[4] == "chosen") == row["chosen"]


def test_the_terminal_says_the_same(demo: Path) -> None:
    text = (demo / "printed.txt").read_text()
    before, after = statistics(pooled(demo, EXAM, "rate_dph")), statistics(pooled(demo, EXAM, "remains_dph"))
    gain = re.search(r"improvement ([\d.]+) ± [\d.]+ against a constant on test runs", text)
    about_zero = re.search(r"about zero ([\d.]+)", text)
    assert gain and about_zero
    assert float(about_zero[1]) == pytest.approx(before["rms_dph"] / after["rms_dph"], rel=6e-3)
    left = np.sqrt(np.mean((pooled(demo, EXAM, "rate_dph") - constant_of(demo)) ** 2))
    assert float(gain[1]) == pytest.approx(left / after["rms_dph"], abs=0.006)
    rms = re.search(r"RMS (.*? deg/h) = ([\d.]+) x noise floor", text)
    assert rms and digits(rms[1], after["rms_dph"], share=0.02)
    truth = [np.load(demo / "data" / "truth" / file.replace(".csv", ".noise.npy")) for file in EXAM]
    floor = np.concatenate([np.asarray(noise).reshape(-1, 10).mean(axis=1) for noise in truth])
    assert float(rms[2]) == pytest.approx(after["rms_dph"] / np.sqrt(np.mean(floor**2)), rel=1e-3)


def test_the_bias_over_time_shows_measured_and_compensated_means(
    demo: Path, panels: list[PanelRead], evaluation: dict[str, Any]
) -> None:
    for run in evaluation["runs"]:
        (panel,) = (p for p in panels if p.title == f"{run['environment']} ({run['role']})")
        means = means_of(demo, run["file"])
        hours = (means["time_s"] - means["time_s"].iloc[0]).to_numpy() / 3600.0
        lines = {s.colour: s for s in panel.series if s.kind == "line"}
        left = means["rate_dph"].to_numpy() - evaluation["constant_dph"]
        assert panel.pixels_off(lines["before"], hours, left) < NEAR
        assert panel.pixels_off(lines["after"], hours, means["remains_dph"].to_numpy()) < NEAR
        labels = {s.label for s in lines.values()} - {""}
        assert not labels or (lines["before"].label, lines["after"].label) == ("less a constant", "compensated")


def drawn_on(panel: PanelRead, colour: str, x: Floats, y: Floats, label: str | None = None) -> None:
    """Each dot of a colour is at a place of the data, and each of these has a dot."""
    (dots,) = (s for s in panel.series if s.kind == "dots" and s.colour == colour and label in (None, s.label))
    wanted = panel.places(x, y)
    for some, others in ((dots.pixels, wanted), (wanted, dots.pixels)):
        away, _ = cKDTree(others).query(some, p=np.inf)
        assert away.max() < 0.25 + NEAR, panel.title


def test_the_bias_over_temperature_shows_each_branch_before_and_after(demo: Path, panels: list[PanelRead]) -> None:
    means = [means_of(demo, file) for file in RUNS]
    t, before, after = (np.concatenate([m[c] for m in means]) for c in ("temperature_c", "rate_dph", "remains_dph"))
    slope = np.concatenate([np.gradient(m["temperature_c"], m["time_s"] / 60.0) for m in means])
    held, heating, cooling = np.abs(slope) <= REST_C_PER_MIN, slope > REST_C_PER_MIN, slope < -REST_C_PER_MIN
    model = load_model(demo / "result" / "model.json")
    constant = model.fallback_dph
    by_title = {panel.title.split(" of ")[0]: panel for panel in panels}
    first, below = by_title["before, less a constant"], by_title["after, on the same scale"]
    for colour, label, of in (("covered", "held", held), ("before", "heating", heating), ("after", "cooling", cooling)):
        drawn_on(first, colour, t[of], before[of] - constant, label)
        drawn_on(below, colour, t[of], after[of])
        drawn_on(by_title["what remains, over temperature"], colour, t[of], after[of], label)
        drawn_on(by_title["what remains, over dT/dt"], colour, slope[of], after[of], label)
    line = first.labelled("map at rest")
    assert first.pixels_off(line, line.x, model.map_dph(line.x, 0.0 * line.x) - constant) < 2 * NEAR
    for of in (heating, cooling):
        rate = float(np.median(slope[of]))
        line = first.labelled(f"{rate:+.2g} C/min".replace("-", "−"))
        expected = model.map_dph(line.x, np.full(line.x.size, rate)) - constant
        assert first.pixels_off(line, line.x, expected) < 2 * NEAR


def test_the_band_about_the_map_at_rest_is_u_of_the_cells_at_rest(demo: Path, panels: list[PanelRead]) -> None:
    """Twice the sigma that the table states for dT/dt = 0, where training was and where it was not."""
    model = load_model(demo / "result" / "model.json")
    content = json.loads((demo / "result" / "model.json").read_text())
    known, seen, spans = content["uncertainty_dph"], content["coverage"], content["envelope"]
    t = np.linspace(*spans["temperature_c"], 160)

    def cells_at_rest(rows: list[Any], cells: list[int]) -> list[Any]:
        (t0, t1), (r0, r1) = spans["temperature_c"], spans["slope_c_per_min"]
        row = int((0.0 - r0) / (r1 - r0) * cells[1])
        return [rows[row][min(int((x - t0) / (t1 - t0) * cells[0]), cells[0] - 1)] for x in t]

    covered = [cell == "1" for cell in cells_at_rest(seen["rows"], seen["cells"])]
    trained, untrained = (cells_at_rest(known[name], known["cells"]) for name in ("rows", "uncovered"))
    u = 2.0 * np.where(covered, trained, untrained)
    assert max(map(max, known["rows"])) > 1.1 * u.min() / 2.0, "sigma differs between the cells"
    (panel,) = (p for p in panels if p.title.startswith("before, less a constant"))
    (band,) = (s for s in panel.series if s.kind == "band")
    rest = model.map_dph(t, 0.0 * t) - model.fallback_dph
    assert panel.pixels_off(band, np.r_[t, t[::-1]], np.r_[rest - u, (rest + u)[::-1]]) < 2 * NEAR


def test_cuts_through_the_map_are_those_of_the_model(demo: Path, panels: list[PanelRead]) -> None:
    model = load_model(demo / "result" / "model.json")
    (cuts,) = (p for p in panels if p.title == "cuts through the map")
    rates = np.linspace(*model.envelope.slope_c_per_min, 3)
    assert len(cuts.series) == 3
    for rate in rates:
        line = cuts.labelled(f"{round(rate, 2) + 0.0:+.2f} C/min".replace("-", "−"))
        expected = model.map_dph(line.x, np.full(line.x.size, rate)) - model.fallback_dph
        assert cuts.pixels_off(line, line.x, expected) < 2 * NEAR


def test_the_allan_picture_shows_the_deviation_of_what_remains(demo: Path, panels: list[PanelRead]) -> None:
    (panel,) = (p for p in panels if p.x.words.startswith("averaging time"))
    line = panel.labelled("compensated training records")
    taus = 10.0 * 2.0 ** np.arange(len(line.x))
    squares, weights = np.zeros(len(taus)), np.zeros(len(taus))
    for file in RUNS[:6]:
        remains = run_of(demo, file)["remains_dph"].to_numpy()[10:]
        found, deviation, _, n = allantools.oadev(remains, rate=0.1, data_type="freq", taus=taus)
        squares[: len(found)] += n * deviation**2
        weights[: len(found)] += n
    assert line.x == pytest.approx(taus, rel=0.02)
    assert line.y[:8] == pytest.approx(np.sqrt(squares / weights)[:8], rel=0.1)
    (arw,) = (s for s in panel.series if s.label.startswith("N = "))
    assert arw.y == pytest.approx(60.0 * number(arw.label[4:]) / np.sqrt(arw.x), rel=0.03)


def test_a_certificate_says_what_the_recordings_give(demo: Path, tmp_path: Path) -> None:
    """A build with limits; each figure of the certificate, before its ±, is that of the test runs."""
    limits = tmp_path / "limits.toml"
    names = ("rms_dph", "std_dph", "max_abs_dph")
    limits.write_text("schema = 1\n[at_most]\n" + "".join(f"{name} = 1.0\n" for name in names))
    out = tmp_path / "out"
    build = ("build", demo / "data", "--out", out, "--numeric", "f32", "--target", "host-gcc-O2", "--limits", limits)
    done = run_gyrotc(*build)
    assert done.returncode == 0, done.stderr
    done = run_gyrotc("certificate", out, "--out", tmp_path / "cert", "--draft")
    assert done.returncode == 0, done.stderr
    table = table_with((tmp_path / "cert" / "certificate.html").read_text("utf-8"), "measured ± U")
    after = statistics(pooled(demo, EXAM, "remains_dph"))
    known = json.loads((out / "evaluate.json").read_text())["uncertainty"]
    shown = {name: cells for cells in table[1:] for name in names if LIMIT_WORDS[name] in cells[0]}
    assert set(shown) == set(names), table
    for name, cells in shown.items():
        assert digits(cells[1], after[name], share=0.06), cells
        spread = cells[1].split("±")[1]
        expanded = float(cells[2]) * known[name]["standard"]
        exponent = re.search(r"10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", spread)
        scale = number("1·" + exponent[0]) if exponent else 1.0
        assert float(re.findall(r"[\d.]+", spread)[0]) * scale == pytest.approx(expanded, rel=0.06), cells
        assert cells[4] == "PASS"


LIMIT_WORDS = {"rms_dph": "RMS", "std_dph": "standard deviation", "max_abs_dph": "largest"}
