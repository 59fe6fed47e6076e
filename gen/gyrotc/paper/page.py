"""Tables of docs/paper.md, written between marks: `<!-- name -->` and `<!-- /name -->`."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..pages.published import AFTER_DPH, BEFORE_DPH, ENVIRONMENTS, RUNNING_S
from .experiment import METHODS, Cell, Experiment

__all__ = ["filled", "gyros_table", "scatter_table", "table_1", "times_table"]

_Row = Sequence[str]
_MEASURED = {
    "mlr": "paper: mlr, with BIC",
    "rbf_random": "paper: rbf_random",
    "mrbf_paper": "paper: mrbf_paper",
    "mrbf": "gyrotc mrbf (default)",
}
"""Names in docs/results/bench.json."""


def filled(text: str, parts: Mapping[str, str]) -> str:
    """The page with each part between its marks replaced.

    Raises:
        InputError: a mark is missing.
    """
    for name, part in parts.items():
        pattern = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.DOTALL)
        if not pattern.search(text):
            raise InputError("docs/paper.md", f"no marks for {name}", f"<!-- {name} --> ... <!-- /{name} -->")
        text = pattern.sub(lambda found, part=part: f"{found[1]}{part}\n{found[2]}", text)  # type: ignore[misc]
    return text


def _markdown(head: _Row, rows: Sequence[_Row]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def table_1(result: Experiment, *, published: bool) -> str:
    """Table 1: before, after and improvement in each environment; with the paper's own figures or without."""
    rows = [
        _row(result, "before: mean", lambda cell: float(cell.before.mean()), 1e3),
        _row(result, "before: RMS about zero", lambda cell: _rms(cell.before), 1e3),
    ]
    if published:
        rows.append(['*paper\'s "σ" before*', *(f"*{1e3 * BEFORE_DPH[name]:.3f}*" for name in ENVIRONMENTS)])
    rows.append(_row(result, "before: σ about the mean", lambda cell: float(cell.before.std()), 1e3))
    for method, label in METHODS.items():
        cells = result.cells[method]
        rows.append([f"after, {label}", *(f"{1e3 * _rms(cells[name].after):.3f}" for name in ENVIRONMENTS)])
        if published and method in AFTER_DPH:
            rows.append(["*paper*", *(f"*{1e3 * AFTER_DPH[method][name]:.3f}*" for name in ENVIRONMENTS)])
    for method, label in METHODS.items():
        rows.append([f"improvement, {label}", *(_improvement(result.cells[method][n]) for n in ENVIRONMENTS)])
        if published and method in AFTER_DPH:
            ratios = (BEFORE_DPH[name] / AFTER_DPH[method][name] for name in ENVIRONMENTS)
            rows.append(["*paper*", *(f"*{ratio:.1f}*" for ratio in ratios)])
    for method, label in METHODS.items():
        rows.append(
            [f"improvement of σ, {label}", *(_of_sigma(result.cells[method][n]) for n in ENVIRONMENTS)]
        )
    for method in ("rbf_random", "mrbf_paper", "mrbf"):
        counts = (str(result.cells[method][name].centers) for name in ENVIRONMENTS)
        rows.append([f"centers, {METHODS[method]}", *counts])
    return _markdown(["1e-3 deg/h", *ENVIRONMENTS], rows)


def _row(result: Experiment, label: str, value: Callable[[Cell], float], factor: float) -> _Row:
    return [label, *(f"{factor * value(result.cells['mlr'][name]):.3f}" for name in ENVIRONMENTS)]


def _improvement(cell: Cell) -> str:
    return f"{_rms(cell.before) / _rms(cell.after):.1f}"


def _of_sigma(cell: Cell) -> str:
    return f"{float(cell.before.std() / cell.after.std()):.2f}"


def gyros_table(results: Mapping[str, Sequence[Experiment]]) -> str:
    """Exam RMS ÷ noise floor over several gyros, median and worst, for each level of noise."""
    head = ["RMS after ÷ noise floor", *(f"{noise} noise: median, worst" for noise in results)]
    rows = []
    for method, label in METHODS.items():
        row = [label]
        for gyros in results.values():
            ratios = [gyro.exam_ratio(method) for gyro in gyros]
            row.append(f"{np.median(ratios):.3f}, {max(ratios):.3f}")
        rows.append(row)
    floors = [f"{1e3 * float(np.median([g.floor_dph for g in gyros])):.3f}" for gyros in results.values()]
    rows.append(["noise floor, 1e-3 deg/h", *floors])
    return _markdown(head, rows)


def scatter_table(result: Experiment) -> str:
    """How much σ after compensation differs between the environments: ours, the paper's, and by chance."""
    samples = len(next(iter(result.cells["mlr"].values())).before)
    chance = f"{100.0 / np.sqrt(2.0 * samples):.1f} %"
    rows = []
    for method in AFTER_DPH:
        ours = [float(result.cells[method][name].after.std()) for name in ENVIRONMENTS]
        rows.append([METHODS[method], _scatter(list(AFTER_DPH[method].values())), _scatter(ours), chance])
    return _markdown(
        ["spread of σ over the environments", "paper", "here", f"chance, {samples} samples"], rows
    )


def _scatter(values: Sequence[float]) -> str:
    return f"{100.0 * float(np.std(values, ddof=1) / np.mean(values)):.1f} %"


def times_table(measured: Sequence[Mapping[str, Any]]) -> str:
    """Running times of the training: the paper's, and what `make bench` measured for all six environments.

    Args:
        measured: Whole methods on one gyro of scenario `paper`, as in docs/results/bench.json.
    """
    seconds = {row["name"]: f"{row['seconds']:.3f}" for row in measured if "seconds" in row}
    rows = []
    for method, name in _MEASURED.items():
        each = RUNNING_S.get(method)
        paper = f"{min(each.values()):.1f} ... {max(each.values()):.1f} for one environment" if each else "-"
        rows.append([METHODS[method], paper, seconds.get(name, "-")])
    return _markdown(["running time, s", "paper", "here, one model over all six"], rows)
