"""What `gyrotc compare` shows of its result: tables for the terminal and a picture, the paper's figures beside ours."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.box import SIMPLE_HEAD
from rich.table import Table

from ..texts import picture_text
from .plots import ACCENT, AFTER, BEFORE, COVERED, STYLE, svg
from .published import AFTER_DPH, BEFORE_DPH, ENVIRONMENTS, RUNNING_S

__all__ = ["comparison_picture", "comparison_tables", "with_published"]

_PANELS = 6  # in a row
_DEFAULT = "mrbf"


def with_published(result: dict[str, Any]) -> dict[str, Any]:
    """The result of `compare` with the paper's figures beside ours, if these are the paper's environments.

    Groups get `published` (`before_rms_dph`, `after_rms_dph`, `improvement`), methods `published_train_s` (least
    and most for one environment), wherever Table 1 of Ding et al. 2014 has a figure.
    """
    if set(ENVIRONMENTS) - set(_environments(result)):
        return result
    methods = []
    for method in result["methods"]:
        after = AFTER_DPH.get(method["id"], {})
        groups = [group | _published(group["environment"], after) for group in method["groups"]]
        seconds = RUNNING_S.get(method["id"], {}).values()
        cost = {"published_train_s": [min(seconds), max(seconds)]} if seconds else {}
        methods.append(method | cost | {"groups": groups})
    return result | {"methods": methods}


def _published(environment: str, after: dict[str, float]) -> dict[str, Any]:
    if environment not in after:
        return {}
    before = BEFORE_DPH[environment]
    return {
        "published": {
            "before_rms_dph": before,
            "after_rms_dph": after[environment],
            "improvement": before / after[environment],
        }
    }


def _environments(result: dict[str, Any]) -> list[str]:
    return [group["environment"] for group in result["methods"][0]["groups"]]


def _of_paper(method: dict[str, Any], key: str) -> list[float | None]:
    return [group.get("published", {}).get(key) for group in method["groups"]]


def _exponent(result: dict[str, Any]) -> int:
    """Power of ten in which rates are shown."""
    after = [g["after_rms_dph"] for m in result["methods"] for g in m["groups"] if g["after_rms_dph"] > 0.0]
    return math.floor(math.log10(min(after))) if after else 0


def comparison_tables(result: dict[str, Any]) -> Iterator[Table]:
    """Environment by environment, as in the paper's Table 1; then all environments together, with the costs."""
    exponent = _exponent(result)
    title = f"{result['serial']}: judged on {result['judged_on']}, rates in 1e{exponent} deg/h"
    yield _table_1(result, title, 10.0**exponent)
    yield _costs(result, 10.0**exponent)


def _table_1(result: dict[str, Any], title: str, unit: float) -> Table:
    environments, methods = _environments(result), result["methods"]
    table = Table(title=title, box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column(no_wrap=True, min_width=len("improvement"))
    table.add_column("method", no_wrap=True, min_width=len("  in the paper"))
    for name in environments:
        table.add_column(name, justify="right", overflow="fold")
    for label, key in (("RMS before", "before_rms_dph"), ("std before", "before_std_dph")):
        table.add_row(label, "", *_numbers((g[key] for g in methods[0]["groups"]), unit))
    table.add_section()
    for label, key, scale in (
        ("RMS after", "after_rms_dph", unit),
        ("std after", "after_std_dph", unit),
        ("improvement", "improvement", 1.0),
    ):
        for m in methods:
            table.add_row(label, m["id"], *_numbers((g[key] for g in m["groups"]), scale))
            paper = _of_paper(m, key)
            if any(paper):
                table.add_row("", "  in the paper", *_numbers(paper, scale), style="dim")
        table.add_section()
    return table


def _costs(result: dict[str, Any], unit: float) -> Table:
    table = Table(title="All environments", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    names = ["method", "RMS", "std", "improvement", "centers", "bytes", "training, s"]
    paper = any("published_train_s" in m for m in result["methods"])
    for name in [*names, "paper's, s"] if paper else names:
        table.add_column(name, justify="left" if name == "method" else "right", no_wrap=True)
    for m in result["methods"]:
        row = [
            m["id"], *_numbers((m["exam_rms_dph"], m["exam_std_dph"]), unit), f"{m['improvement']:.2f}",
            str(m["centers"]), str(m["table_bytes"]), f"{m['train_s']:.3f}",
        ]  # fmt: skip
        if paper:
            row.append("-".join(f"{s:.0f}" for s in m.get("published_train_s", ())))
        table.add_row(*row)
    return table


def _numbers(values: Iterable[float | None], unit: float) -> list[str]:
    return ["" if v is None else f"{v / unit:.2f}" for v in values]


def comparison_picture(result: dict[str, Any]) -> str:
    """One panel for each environment, a row for each method: RMS after, beside the noise; below, all together."""
    exponent, methods = _exponent(result), result["methods"]
    groups = len(_environments(result))
    lines, columns = -(-groups // _PANELS), min(groups, _PANELS)
    height = 0.5 + 0.21 * len(methods)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 0.4 + (lines + 1) * height), layout="constrained")
        parts: Any = figure.subfigures(2, 1, height_ratios=(lines, 1))
        above, below = parts
        axes = above.subplots(lines, columns, sharex=True, sharey=True, squeeze=False)
        for ax in axes.flat[groups:]:
            ax.set_visible(False)
        for k, ax in enumerate(axes.flat[:groups]):
            _environment(ax, methods, k, 10.0**exponent)
        _rows(axes[0][0], methods)
        above.supxlabel(f"RMS after, 1e{exponent} deg/h", fontsize=9)
        handles, labels = axes[0][0].get_legend_handles_labels()
        above.legend(handles, labels, loc="outside upper right", ncols=len(labels))
        _together(below.subplots(), methods)
        return svg(figure)


def _rows(ax: Axes, methods: Sequence[dict[str, Any]]) -> None:
    """Names of the methods, the first one uppermost."""
    ax.set_yticks(range(len(methods)), [m["id"] for m in methods])
    ax.set_ylim(len(methods) - 0.4, -0.6)


def _color(method: dict[str, Any]) -> str:
    return AFTER if method["id"] == _DEFAULT else COVERED


def _environment(ax: Axes, methods: Sequence[dict[str, Any]], k: int, unit: float) -> None:
    place = np.arange(len(methods))
    ours = np.array([m["groups"][k]["after_rms_dph"] for m in methods]) / unit
    ax.axvline(methods[0]["groups"][k]["before_std_dph"] / unit, color=ACCENT, linewidth=0.8, linestyle=":",
               label="σ before: what the mean alone leaves")  # fmt: skip
    ax.scatter(ours, place, s=22, color=[_color(m) for m in methods], zorder=3, label="here")
    paper = [_of_paper(m, "after_rms_dph")[k] for m in methods]
    if any(paper):
        values = np.array([np.nan if p is None else p / unit for p in paper])
        ax.scatter(values, place, s=22, facecolor="none", edgecolor=BEFORE, zorder=2, label="in the paper")
    ax.set_title(picture_text(methods[0]["groups"][k]["environment"]), fontsize=8.5, loc="left")


def _together(ax: Axes, methods: Sequence[dict[str, Any]]) -> None:
    """How far every method is from the best one, and what it costs."""
    rms = np.array([m["exam_rms_dph"] for m in methods])
    excess = 100.0 * (rms / rms.min() - 1.0) if rms.min() > 0.0 else np.zeros(len(rms))
    ax.barh(np.arange(len(methods)), excess, height=0.6, color=[_color(m) for m in methods])
    for k, m in enumerate(methods):
        size = f"{m['centers']} centers, " if m["centers"] else ""
        text = f"{size}{m['table_bytes']} bytes, trained in {m['train_s']:.3f} s"
        ax.annotate(text, (excess[k], k), (4, 0), textcoords="offset points", va="center", fontsize=7.5)
    _rows(ax, methods)
    ax.margins(x=0.35)
    ax.set_xlim(left=0.0)
    ax.grid(visible=False, axis="y")
    ax.set(xlabel="RMS over all environments, % above the best")
