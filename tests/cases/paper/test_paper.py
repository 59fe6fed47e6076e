"""The paper repeated: its page is made from its record, and the record is what the experiment gives."""

from __future__ import annotations

import copy
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gyrotc.common import InputError
from gyrotc.pages import AFTER_DPH, BEFORE_DPH, ENVIRONMENTS

from bench.paper.experiment import FIGURES, METHODS, Series, checksum, draw
from bench.paper.page import departures, filled, made_with, measured, page_of, record_of, stale
from bench.records import write_record

DOCS = Path(__file__).resolve().parents[3] / "docs"
PAGE = DOCS / "paper.md"
RECORD = record_of(DOCS)


@pytest.fixture(scope="module")
def first() -> tuple[dict[str, Any], Series]:
    """Record and series of the first gyro, with both levels of noise."""
    return measured([1])


@pytest.fixture
def now(first: tuple[dict[str, Any], Series]) -> dict[str, Any]:
    return first[0]


def test_the_published_figures_are_those_of_table_1() -> None:
    """The improvements that the paper prints follow from its before and after."""
    printed = {
        "mlr": (5.17, 4.87, 5.15, 4.77, 4.80, 4.82),
        "rbf_random": (8.08, 7.60, 8.05, 7.63, 7.62, 7.61),
        "mrbf_paper": (10.43, 9.82, 10.39, 9.818, 9.832, 9.847),
    }
    for method, improvements in printed.items():
        for name, improvement in zip(ENVIRONMENTS, improvements, strict=True):
            assert BEFORE_DPH[name] / AFTER_DPH[method][name] == pytest.approx(improvement, abs=0.01)


def test_the_record_is_what_the_experiment_gives(now: dict[str, Any]) -> None:
    assert list(departures(RECORD, now)) == []


def test_page_and_figures_are_made_from_the_record() -> None:
    assert list(stale(DOCS)) == []


def test_a_figure_that_moves_is_reported_with_its_place(now: dict[str, Any]) -> None:
    """By ten times what is allowed, here and where libraries or compiler are others."""
    for made, share in ((made_with(), 1e-5), ({**made_with(), "compiler": "another"}, 0.01)):
        other = copy.deepcopy(RECORD) | {"made_with": made}
        other["gyros"]["paper"]["1"]["after"]["mlr"]["5 C/min"]["rms_dph"] *= 1.0 + share
        (line,) = departures(other, now)
        assert line.startswith("paper noise, gyro 1, after, mlr, 5 C/min, rms_dph: ")
    other = copy.deepcopy(RECORD)
    del other["gyros"]["class"]
    assert sum("None recorded" in line for line in departures(other, now)) > 100


def test_a_page_or_a_figure_of_another_record_is_reported(tmp_path: Path) -> None:
    docs = tmp_path / "docs"
    (docs / "results").mkdir(parents=True)
    for name in ("paper.md", "results/paper.json", "results/accuracy.json"):
        shutil.copy(DOCS / name, docs / name)
    assert all("figure" in line for line in stale(docs))
    shutil.copytree(DOCS / "paper", docs / "paper")
    assert list(stale(docs)) == []
    text = PAGE.read_text("utf-8")
    row = next(line for line in text.splitlines() if line.startswith("| after, modified RBFNN |"))
    (docs / "paper.md").write_text(text.replace(row, row.replace("| 0.", "| 1.")), "utf-8")
    (line,) = stale(docs)
    assert "after, modified RBFNN" in line
    shutil.copy(PAGE, docs / "paper.md")
    write_record(docs, "paper", RECORD | {"figures": "sha256:another"})
    assert len(list(stale(docs))) == len(FIGURES)


def test_the_table_prints_what_the_record_has() -> None:
    """Row by row, without the code that makes the page: RMS after of every method of the first gyro."""
    text = PAGE.read_text("utf-8")
    part = text.split("<!-- table-1 -->")[1].split("<!-- /table-1 -->")[0]
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in part.strip().splitlines()]
    rows = {row[0]: row[1:] for row in cells}
    of = RECORD["gyros"]["paper"]["1"]
    for method, label in METHODS.items():
        after = [1e3 * of["after"][method][name]["rms_dph"] for name in ENVIRONMENTS]
        assert rows[f"after, {label}"] == [f"{value:.3f}" for value in after]
    sigma = [1e3 * of["before"][name]["std_dph"] for name in ENVIRONMENTS]
    assert rows["before: σ about the mean"] == [f"{value:.3f}" for value in sigma]
    gain = [of["before"][n]["rms_dph"] / of["after"]["mrbf_paper"][n]["rms_dph"] for n in ENVIRONMENTS]
    assert rows["improvement, modified RBFNN"] == [f"{value:.1f}" for value in gain]


def test_series_and_figures_are_of_one_experiment(first: tuple[dict[str, Any], Series]) -> None:
    record, series = first
    assert {len(values) for of in series.values() for values in of.values()} == {RECORD["samples"]} == {288}
    figures = record["gyros"]["paper"]["1"]
    for name, before in series["measured"].items():
        assert np.std(before) == pytest.approx(figures["before"][name]["std_dph"], rel=1e-3)
        for method in ("mlr", "rbf_random", "mrbf_paper"):
            after = np.subtract(before, series[method][name])
            rms = np.sqrt(np.mean(after**2))
            assert rms == pytest.approx(figures["after"][method][name]["rms_dph"], rel=1e-3)


def test_a_constant_alone_improves_nearly_tenfold_at_constant_temperature() -> None:
    figures = RECORD["gyros"]["paper"]["1"]
    for name in ENVIRONMENTS[:3]:
        before, after = figures["before"][name]["rms_dph"], figures["after"]["constant"][name]["rms_dph"]
        assert before / after > 9.0


def test_one_model_over_all_comes_closest_to_the_noise() -> None:
    for figures in RECORD["gyros"]["paper"].values():
        total = {method: sum(cell["rms_dph"] ** 2 for cell in of.values()) for method, of in figures["after"].items()}
        assert min(total, key=lambda method: total[method]) == "mrbf"
        assert np.sqrt(total["mrbf"] / 6.0) < 1.02 * figures["floor_dph"]


def test_a_page_without_marks_is_refused() -> None:
    with pytest.raises(InputError, match="no marks"):
        filled("nothing", {"table-1": ""})


def test_every_table_has_cells_in_every_row() -> None:
    for part in re.findall(r"<!-- ([\w-]+) -->\n(.*?)\n<!-- /\1 -->", page_of(DOCS, RECORD), re.DOTALL):
        if part[1].startswith("|"):
            assert len({line.count("|") for line in part[1].splitlines()}) == 1, part[0]


def test_every_figure_is_drawn_and_shown(first: tuple[dict[str, Any], Series], tmp_path: Path) -> None:
    written = draw(first[1], tmp_path)
    names = sorted(path.name for path in written)
    assert names == [f"figure-{number:02d}.png" for number in FIGURES]
    assert all(checksum(first[1]).encode() in path.read_bytes() for path in written)
    assert re.findall(r"\(paper/(figure-\d+\.png)\)", PAGE.read_text("utf-8")) == names
