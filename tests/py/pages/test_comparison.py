"""What `gyrotc compare` shows: the paper's figures where they belong, every method and environment in the picture."""

from __future__ import annotations

import io
import re

import pytest
from gyrotc.pages.comparison import (
    AFTER_DPH,
    BEFORE_DPH,
    ENVIRONMENTS,
    comparison_picture,
    comparison_tables,
    with_published,
)
from gyrotc.results.evaluation import Comparison, Group, Method
from rich.console import Console


def result(environments: tuple[str, ...], after: float = 7e-4) -> Comparison:
    """A result of `compare` with two methods."""
    groups = tuple(
        Group(environment=name, samples=288, before_rms_dph=10.0 * after, before_std_dph=1.2 * after,
              after_rms_dph=after, after_std_dph=0.99 * after, improvement=10.0)
        for name in environments
    )  # fmt: skip

    def method(id: str, centers: int, seconds: float) -> Method:
        return Method(
            id=id, groups=groups, centers=centers, train_s=seconds, exam_rms_dph=after, exam_std_dph=after,
            before_rms_dph=10.0 * after, improvement=10.0, table_bytes=104, sum_abs_weights_dph=0.0,
            noise_floor_dph=after,
        )  # fmt: skip

    return Comparison(
        gyrotc_version="0.1.0", serial="A-1", axis=None, block_s=10.0, average_s=100.0, seed=0, judged_on="exam",
        noise_floor_dph=after, noise_floor_source="estimated",
        methods=(method("mlr", 0, 0.001), method("mrbf_paper", 7, 0.05)),
    )  # fmt: skip


def printed(shown: Comparison) -> str:
    out = io.StringIO()
    for table in comparison_tables(shown):
        Console(file=out, width=160).print(table)
    return out.getvalue()


def texts(svg: str) -> set[str]:
    return set(re.findall(r">([^<>]+)</text>", svg))


def test_the_paper_s_environments_have_the_paper_s_figures_beside_ours() -> None:
    shown = with_published(result(ENVIRONMENTS))
    for method in shown.methods:
        for group in method.groups:
            name, paper = group.environment, group.published
            assert paper is not None and paper.before_rms_dph == BEFORE_DPH[name]
            assert paper.after_rms_dph == AFTER_DPH[method.id][name]
            assert paper.improvement == pytest.approx(BEFORE_DPH[name] / AFTER_DPH[method.id][name])
    assert shown.methods[1].published_train_s == (79.5, 82.6)
    assert "13.95" in printed(shown)
    assert "80-83" in printed(shown)
    assert {"here", "in the paper"} <= texts(comparison_picture(shown))


def test_other_environments_have_none() -> None:
    shown = with_published(result(("20 C", "warm")))
    assert shown == result(("20 C", "warm"))
    assert "in the paper" not in printed(shown)
    assert "in the paper" not in texts(comparison_picture(shown))


@pytest.mark.parametrize("environments", [("20 C",), tuple(f"run {k}" for k in range(14))])
def test_every_environment_and_method_is_in_the_picture(environments: tuple[str, ...]) -> None:
    found = texts(comparison_picture(result(environments)))
    assert {*environments, "mlr", "mrbf_paper"} <= found
    assert any("7 centers, 104 bytes" in text for text in found)


def test_long_names_of_environments_do_not_cut_those_of_methods() -> None:
    out = printed(result(tuple(f"recording-of-the-chamber.csv {k}000 ... {k + 1}000 s" for k in range(8))))
    assert "improvement" in out
    assert "mrbf_paper" in out
    assert "…" not in out


def test_no_residual_at_all_is_shown_as_zero() -> None:
    shown = result(("20 C",), after=0.0)
    assert "0.00" in printed(shown)
    assert comparison_picture(shown).startswith("<svg")


def test_the_same_result_gives_the_same_bytes() -> None:
    assert comparison_picture(result(ENVIRONMENTS)) == comparison_picture(result(ENVIRONMENTS))
