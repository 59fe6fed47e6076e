"""The section of docs/results.md about lots, from every draw in docs/results/lot-prior-*.json."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["section", "write_page"]

_MARKS = re.compile(r"<!-- lot-prior -->\n.*?<!-- /lot-prior -->", re.DOTALL)
_WAYS = {
    "lot": "**with the lot**",
    "auto": "without: the ladder (`build`)",
    "mrbf": "without: a map (`--method mrbf`)",
    "mean curve + offset": "mean curve + offset",
    "PCA regression": "PCA regression",
    "pooled GPR": "pooled GPR (scikit-learn)",
}
_HEAD = " ".join(
    (
        "## A new unit from one run and its lot (`make lot-prior`)\n\n60 fully calibrated units teach ([lot.md](lot.md)),",
        "40 others are calibrated from one run of 2.5 h (5 C/min, 0 → 60 → −40 C) and judged on the full exam of six",
        "environments. Lots are simulated from physics ([simulation.md](simulation.md), section 6); nothing was tuned on",
        "these seeds, and every draw is kept. RMS is over the floor of the noise that was really added; the error is the",
        "map's own, RMS of (map − truth), over the same. Median / worst of the units.\n",
    )
)
_STRANGERS = " ".join(
    (
        "60 units teach a lot (family 0.93); 40 others of it and 40 strangers, gyros whose physical parameters share nothing",
        "with the lot but the scenario, are held against it by one run of 2.5 h, 1 % false alarms. Beside the test that is",
        "built stand two that cannot be: the likelihood ratio of the distribution that strangers are drawn from (known from",
        "the whole calibrations of those of all other draws) to the lot's, and the most powerful test of a map that is known",
        "beforehand. What these miss, the run does not show: the stranger's map lies within the lot's spread where the",
        "run has been.",
    )
)


def _pair(values: Sequence[float], digits: int) -> str:
    return f"{np.median(values):.{digits}f} / {np.max(values):.{digits}f}"


def _ways(units: Sequence[dict[str, Any]], name: str) -> str:
    rows = [u[name] for u in units if name in u]
    lines = ["| way | RMS ÷ floor | error |", "| --- | --- | --- |"]
    for way, text in _WAYS.items():
        if found := [row[way] for row in rows if way in row]:
            ratio, error = zip(*found, strict=True)
            lines.append(f"| {text} | {_pair(ratio, 3)} | {_pair(error, 2)} |")
    return "\n".join(lines)


def _longer(units: Sequence[dict[str, Any]]) -> str:
    told = []
    for name in ("8 h", "six runs"):
        rows = [u[name] for u in units if name in u]
        (with_lot, its), (alone, other) = (
            np.median([row[w] for row in rows], axis=0) for w in ("lot", "mrbf")
        )
        told.append(f"{name}: {with_lot:.3f} ({its:.2f}) with the lot, {alone:.3f} ({other:.2f}) without")
    return f"Longer programmes, {len(rows)} units, medians of RMS ÷ floor (error): {'; '.join(told)}."


def _case(case: dict[str, Any]) -> str:
    units = case["units"]
    short = [u["2.5 h"] for u in units]
    coverage = np.mean([row["coverage"] for row in short], axis=0)
    better = np.mean([row["lot"][0] <= row["auto"][0] for row in short])
    accused = np.mean([not row["accepted"] for row in short])
    lines = [
        f"#### {case['case'][0].upper()}{case['case'][1:]} (family {case['family']:g})",
        "",
        f"`gyrotc lot`: {case['told']}. {case['learnt_s']:.1f} s of processor time.",
        "",
        _ways(units, "2.5 h"),
        "",
        f"Better with the lot than with the ladder alone: {better:.0%} of units. The truth lies within 1 / 1.96 sigma "
        f"of the table at {coverage[0]:.1%} / {coverage[1]:.1%} of the exam. Own units refused: {accused:.1%}.",
        _longer(units),
    ]
    if refused := case["strangers_refused"]:
        told = ", ".join(f"{share:.1%} from {name}" for name, share in refused.items())
        most = case.get("best_power")
        beside = f" A test that knew each stranger's map would refuse {most:.1%} from 2.5 h." if most else ""
        lines.append(f"Strangers (another lot's units) refused: {told}.{beside}")
    if checked := case.get("recalibration"):
        lines += ["", _recalibration(checked)]
    return "\n".join(lines)


def _recalibration(checked: dict[str, Any]) -> str:
    """Of check runs of 2.5 h against earlier models of five runs."""
    p = np.array(checked["unchanged"])
    named = ", ".join(
        f"{kind} seen {np.mean(row['seen']):.0%}, named right {np.mean(row['right']):.0%}"
        for kind, row in checked["named"].items()
    )
    return (
        f"Recalibration: a check run of 2.5 h against the model of the five runs before it, {len(p)} units. Not changed: "
        f"{np.mean(p < 0.01):.1%} told to have changed at 1 %, {np.mean(p < 0.05):.1%} at 5 %. Planted changes (offset "
        f"of one sigma of 50-s means, slope of two over 100 C, a bump of three with 6 C): {named}."
    )


def _coverage(draws: dict[str, list[dict[str, Any]]]) -> str:
    """Over all draws; units of a lot share how well it is known, so lots count, not units."""
    lots = [
        np.mean([u["2.5 h"]["coverage"] for u in case["units"]], axis=0)
        for cases in draws.values()
        for case in cases
    ]
    mean, error = np.mean(lots, axis=0), np.std(lots, axis=0, ddof=1) / np.sqrt(len(lots))
    return (
        f"Over all {len(lots)} lots of all draws the truth lies within 1 / 1.96 sigma of the table at {mean[0]:.1%} ± "
        f"{error[0]:.1%} / {mean[1]:.1%} ± {error[1]:.1%} of the exam (± one standard error; 68 and 95 were to be reached). "
        "One lot scatters by more than three points, for 60 units tell its spread to 9 %, and after a run of 2.5 h an "
        "unseen unit's error has two or three degrees of freedom left.\n"
    )


def _speed(docs: Path) -> str:
    file = docs / "results" / "lot-speed.json"
    if not file.is_file():
        return ""
    lines = ["### Learning from 50 to 400 units (`python -m bench.lot_speed docs`)", ""]
    lines += [
        "| units | processor time, s | memory, MiB | clusters, directions |",
        "| --- | --- | --- | --- |",
    ]
    for row in json.loads(file.read_text("utf-8")):
        lines.append(
            f"| {row['units']} | {row['cpu_s']:.1f} | {row['memory_mib']:.0f} | {row['clusters']}, {row['directions']} |"
        )
    return "\n".join(lines) + "\n"


def _strangers(docs: Path) -> str:
    """Of each draw, and over all: a unit is a trial, draws differ in how many of them agree with the lot."""
    file = docs / "results" / "lot-strangers.json"
    if not file.is_file():
        return ""
    rows = json.loads(file.read_text("utf-8"))
    names = ("refused", "ratio_refused", "map_refused", "accused", "ratio_accused")
    lines = [
        "### What a run of 2.5 h can show of a stranger (`python -m bench.lot_strangers docs`)",
        "",
        _STRANGERS,
        "",
    ]
    lines += [
        "| seed | refused | if their distribution were known | if each one's map were known | own units accused | by the second test |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    lines += [f"| {row['seed']} | " + " | ".join(f"{row[n]:.1%}" for n in names) + " |" for row in rows]
    values = np.array([[row[n] for n in names] for row in rows])
    error = values.std(axis=0, ddof=1) / np.sqrt(len(rows))
    told = [f"{mean:.1%} ± {off:.1%}" for mean, off in zip(values.mean(axis=0), error, strict=True)]
    return "\n".join([*lines, "| mean ± one standard error | " + " | ".join(told) + " |"]) + "\n\n"


def section(draws: dict[str, list[dict[str, Any]]]) -> str:
    """The section, a part for each draw."""
    parts = [_HEAD, _coverage(draws)]
    for seed, cases in draws.items():
        parts.append(f"### Seed {seed}\n\n" + "\n\n".join(_case(case) for case in cases) + "\n")
    return "\n".join(parts)


def write_page(docs: Path) -> str:
    """Writes the section into docs/results.md; returns it."""
    files = sorted((docs / "results").glob("lot-prior-*.json"))
    text = section({file.stem.rpartition("-")[2]: json.loads(file.read_text("utf-8")) for file in files})
    text += _strangers(docs) + _speed(docs)
    page = docs / "results.md"
    old = page.read_text("utf-8")
    block = f"<!-- lot-prior -->\n{text}<!-- /lot-prior -->"
    new = _MARKS.sub(lambda _: block, old) if _MARKS.search(old) else f"{old.rstrip()}\n\n{block}\n"
    page.write_text(new, "utf-8")
    return text
