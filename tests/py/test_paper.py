"""The paper repeated: its page has a place for all that is made, and the experiment shows what it says."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from gyrotc.errors import InputError
from gyrotc.pages.published import AFTER_DPH, BEFORE_DPH, ENVIRONMENTS
from gyrotc.paper.experiment import METHODS, Experiment, experiment
from gyrotc.paper.figures import FIGURES, draw
from gyrotc.paper.page import filled, gyros_table, scatter_table, table_1, times_table

PAGE = Path(__file__).resolve().parents[2] / "docs" / "paper.md"


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    return experiment(1, "paper", tmp_path_factory.mktemp("paper") / "data")


def test_the_published_figures_are_those_of_table_1() -> None:
    """The improvements that the paper prints follow from its before and after."""
    printed = {
        "mlr": (5.17, 4.87, 5.15, 4.77, 4.80, 4.82),
        "mrbf_paper": (10.43, 9.82, 10.39, 9.818, 9.832, 9.847),
    }
    for method, improvements in printed.items():
        for name, improvement in zip(ENVIRONMENTS, improvements, strict=True):
            assert BEFORE_DPH[name] / AFTER_DPH[method][name] == pytest.approx(improvement, abs=0.01)


def test_a_constant_alone_improves_nearly_tenfold_at_constant_temperature(result: Experiment) -> None:
    for name in ENVIRONMENTS[:3]:
        cell = result.cells["constant"][name]
        before, after = (float(np.sqrt(np.mean(values**2))) for values in (cell.before, cell.after))
        assert before / after > 9.0


def test_one_model_over_all_comes_closest_to_the_noise(result: Experiment) -> None:
    ratios = {method: result.exam_ratio(method) for method in METHODS}
    assert min(ratios, key=lambda method: ratios[method]) == "mrbf"
    assert ratios["mrbf"] < 1.02 < ratios["rbf_random"]


def test_each_table_has_its_place_in_the_page(result: Experiment) -> None:
    parts = {
        "table-1": table_1(result, published=True),
        "table-1-class": table_1(result, published=False),
        "gyros": gyros_table({"paper": [result]}),
        "scatter": scatter_table(result),
        "times": times_table([{"name": "gyrotc mrbf (default)", "seconds": 0.0417}]),
    }
    page = filled(PAGE.read_text("utf-8"), parts)
    assert all(part in page for part in parts.values())
    assert filled(page, parts) == page
    assert "0.042" in parts["times"]
    for part in parts.values():
        assert len({line.count("|") for line in part.splitlines()}) == 1
    with pytest.raises(InputError, match="no marks"):
        filled("nothing", {"table-1": ""})


def test_every_figure_is_drawn_and_shown(result: Experiment, tmp_path: Path) -> None:
    written = draw(result, tmp_path)
    assert [path.name for path in written] == [f"figure-{number:02d}.svg" for number in FIGURES]
    (again,) = draw(result, tmp_path / "again", [11])
    assert again.read_bytes() == written[-1].read_bytes()
    shown = re.findall(r"\(paper/(figure-\d+\.svg)\)", PAGE.read_text("utf-8"))
    assert shown == [path.name for path in written]
    assert all((PAGE.with_suffix("") / name).exists() for name in shown)
