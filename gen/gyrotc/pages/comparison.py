"""The page of `gyrotc compare`: tables, a picture, and the figures of Ding et al. 2014 beside them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup
from rich.box import SIMPLE_HEAD
from rich.table import Table

from ..results.evaluation import Comparison, Group, Method, Published
from .chart import AFTER, BEFORE, COVERED, Panel, drawing, stacked
from .display import power

ENVIRONMENTS = ("-40 C", "20 C", "60 C", "1 C/min", "3 C/min", "5 C/min")

BEFORE_DPH = dict(zip(ENVIRONMENTS, (7.218e-3, 6.796e-3, 7.194e-3, 6.804e-3, 6.804e-3, 6.806e-3), strict=True))

AFTER_DPH = {
    "mlr": dict(zip(ENVIRONMENTS, (13.953e-4, 13.953e-4, 13.954e-4, 14.276e-4, 14.180e-4, 14.122e-4), strict=True)),
    "rbf_random": dict(zip(ENVIRONMENTS, (8.93e-4, 8.944e-4, 8.93e-4, 8.916e-4, 8.928e-4, 8.944e-4), strict=True)),
    "mrbf_paper": dict(zip(ENVIRONMENTS, (6.918e-4, 6.922e-4, 6.926e-4, 6.930e-4, 6.922e-4, 6.912e-4), strict=True)),
}

NEURONS = dict(zip(("20 C", "-40 C", "60 C", *ENVIRONMENTS[3:]), (108, 112, 115, 121, 129, 135), strict=True))
"""Of the traditional network; the paper gives them for "the six-group data" in no stated order."""

RUNNING_S = {
    "rbf_random": dict(zip(ENVIRONMENTS, (140.8, 142.4, 141.3, 141.6, 140.2, 139.8), strict=True)),
    "mrbf_paper": dict(zip(ENVIRONMENTS, (79.5, 82.6, 81.7), strict=False)),
}


_PANELS = 6  # in a row
_ROW = 20.0  # height of a method
_DEFAULT = "mrbf"


def with_published(result: Comparison) -> Comparison:
    """The result of `compare` with the paper's figures beside ours, if these are the paper's environments.

    Groups get `published` (`before_rms_dph`, `after_rms_dph`, `improvement_about_zero`), methods
    `published_train_s` (least and most for one environment), wherever Table 1 of Ding et al. 2014 has a figure.
    """
    if set(ENVIRONMENTS) - set(_environments(result)):
        return result
    methods = []
    for method in result.methods:
        seconds = RUNNING_S.get(method.id, {}).values()
        known: dict[str, Any] = {"groups": tuple(_with_paper(g, AFTER_DPH.get(method.id, {})) for g in method.groups)}
        known |= {"published_train_s": (min(seconds), max(seconds))} if seconds else {}
        methods.append(method.model_copy(update=known))
    return result.model_copy(update={"methods": tuple(methods)})


def _with_paper(group: Group, after: dict[str, float]) -> Group:
    if group.environment not in after:
        return group
    before, then = BEFORE_DPH[group.environment], after[group.environment]
    published = Published(before_rms_dph=before, after_rms_dph=then, improvement_about_zero=before / then)
    return group.model_copy(update={"published": published})


def _environments(result: Comparison) -> list[str]:
    return [group.environment for group in result.methods[0].groups]


def _of_paper(method: Method, figure: Callable[[Published | Group], float | None]) -> list[float | None]:
    return [figure(group.published) if group.published else None for group in method.groups]


def _exponent(result: Comparison) -> int:
    """Power of ten in which rates are shown."""
    after = [g.after_rms_dph for m in result.methods for g in m.groups if g.after_rms_dph]
    return math.floor(math.log10(min(after))) if after else 0


def comparison_tables(result: Comparison) -> Iterator[Table]:
    """Environment by environment, as in the paper's Table 1; then all environments together, with the costs."""
    exponent = _exponent(result)
    title = f"{result.serial}: judged on {result.judged_on}, rates in {power(exponent)} deg/h"
    yield _table_1(result, title, 10.0**exponent)
    yield _costs(result, 10.0**exponent)


def _table_1(result: Comparison, title: str, unit: float) -> Table:
    environments, methods = _environments(result), result.methods
    table = Table(title=title, box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.add_column(no_wrap=True, min_width=len("improvement"))
    table.add_column("method", no_wrap=True, min_width=len("  in the paper"))
    for name in environments:
        table.add_column(name, justify="right", overflow="fold")
    first = methods[0].groups
    table.add_row("RMS before", "", *_numbers((g.before_rms_dph for g in first), unit))
    table.add_row("std before", "", *_numbers((g.before_std_dph for g in first), unit))
    table.add_section()
    _rows_after(table, "RMS after", methods, _rms, _rms, unit)
    _rows_after(table, "std after", methods, lambda g: g.after_std_dph, None, unit)
    _rows_after(table, "improvement", methods, lambda g: g.improvement, None, 1.0)
    _rows_after(table, "about zero", methods, _about_zero, _about_zero, 1.0)
    return table


def _rms(figures: Published | Group) -> float | None:
    return figures.after_rms_dph


def _about_zero(figures: Published | Group) -> float | None:
    return figures.improvement_about_zero


def _rows_after(
    table: Table,
    label: str,
    methods: Sequence[Method],
    ours: Callable[[Group], float | None],
    paper: Callable[[Published | Group], float | None] | None,
    scale: float,
) -> None:
    """A row for each method, and one for the paper's own figures where it has some."""
    for m in methods:
        table.add_row(label, m.id, *_numbers(map(ours, m.groups), scale))
        theirs = _of_paper(m, paper) if paper else []
        if any(theirs):
            table.add_row("", "  in the paper", *_numbers(theirs, scale), style="dim")
    table.add_section()


def _costs(result: Comparison, unit: float) -> Table:
    table = Table(title="All environments", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    names = ["method", "RMS", "std", "improvement", "about zero", "centers", "bytes of parameters", "training, s"]
    paper = any(m.published_train_s for m in result.methods)
    for name in [*names, "paper's, s"] if paper else names:
        table.add_column(name, justify="left" if name == "method" else "right", no_wrap=True)
    for m in result.methods:
        row = [
            m.id, *_numbers((m.exam_rms_dph, m.exam_std_dph), unit),
            *_numbers((m.improvement, m.improvement_about_zero), 1.0),
            str(m.centers), str(m.parameter_bytes), f"{m.train_s:.3f}",
        ]  # fmt: skip
        if paper:
            row.append("-".join(f"{s:.0f}" for s in m.published_train_s or ()))
        table.add_row(*row)
    return table


def _numbers(values: Iterable[float | None], unit: float) -> list[str]:
    return ["" if v is None else f"{v / unit:.2f}" for v in values]


def comparison_picture(result: Comparison) -> Markup:
    """One panel for each environment, a row for each method: RMS after, beside the noise; below, all together."""
    exponent, methods = _exponent(result), result.methods
    groups = len(_environments(result))
    columns = min(groups, _PANELS)
    panels = [_environment(methods, k, exponent) for k in range(groups)]
    height = 10.0 + _ROW * len(methods)
    above = drawing(panels, columns=columns, height=height, share_x=True, share_y=True)
    return stacked(above, drawing([_together(methods)], height=height))


def _rows_of(methods: Sequence[Method]) -> dict[str, Any]:
    """Names of the methods, the first one uppermost."""
    last = len(methods) - 1
    return {"y_ticks": [(last - k, m.id) for k, m in enumerate(methods)], "y_range": (-0.6, last + 0.6)}


def _environment(methods: Sequence[Method], k: int, exponent: int) -> Panel:
    unit = 10.0**exponent
    panel = Panel(x=f"RMS after, {power(exponent)} deg/h", title=methods[0].groups[k].environment, **_rows_of(methods))
    place = np.arange(len(methods))[::-1]
    before = (methods[0].groups[k].before_std_dph or 0.0) / unit
    panel.vertical(before, label="σ before: what the mean alone leaves", dash="2 3")
    ours = np.array([m.groups[k].after_rms_dph for m in methods], dtype=np.float64) / unit
    default = np.array([m.id == _DEFAULT for m in methods])
    panel.dots(ours[~default], place[~default], COVERED, "here", size=7.0)
    panel.dots(ours[default], place[default], AFTER, size=7.0)
    paper = [_of_paper(m, _rms)[k] for m in methods]
    if any(paper):
        values = np.array([np.nan if p is None else p / unit for p in paper])
        known = np.isfinite(values)
        panel.dots(values[known], place[known], BEFORE, "in the paper", size=7.0, hollow=True)
    return panel


def _together(methods: Sequence[Method]) -> Panel:
    """Draw the distance of every method from the best one, and its cost."""
    rms = np.array([m.exam_rms_dph for m in methods], dtype=np.float64)
    excess = 100.0 * (rms / rms.min() - 1.0) if rms.min() > 0.0 else np.zeros(len(rms))
    place = np.arange(len(methods))[::-1]
    room = 1.6 * max(float(excess.max()), 1.0)  # for the words behind the longest bar
    panel = Panel(x="RMS over all environments, % above the best", x_range=(0.0, room), **_rows_of(methods))
    default = np.array([m.id == _DEFAULT for m in methods])
    for of, color in ((~default, COVERED), (default, AFTER)):
        panel.bars(excess[of], place[of], color)
    costs = [
        (f"{m.centers} centers, " if m.centers else "") + f"{m.parameter_bytes} bytes of parameters" for m in methods
    ]
    panel.words(excess, place, [f"{c}, trained in {m.train_s:.3f} s" for c, m in zip(costs, methods, strict=True)])
    return panel
