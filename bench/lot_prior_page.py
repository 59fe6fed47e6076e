"""The section of docs/results.md about lots, of every draw."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from results import recorded, write

__all__ = ["quoted", "section", "write_page"]

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


def quoted(case: dict[str, Any]) -> dict[str, Any]:
    """What the page says of a lot, from what was found for each of its units."""
    units = case["units"]
    short = [u["2.5 h"] for u in units]
    longer = [name for name in ("8 h", "six runs") if any(name in u for u in units)]
    told = {name: case[name] for name in ("case", "family", "told", "learnt_s", "strangers_refused")}
    return told | {
        "best_power": case.get("best_power"),
        "ways": {way: found for way in _WAYS if (found := _spread([row[way] for row in short if way in row]))},
        "better": float(np.mean([row["lot"][0] <= row["auto"][0] for row in short])),
        "coverage": np.mean([row["coverage"] for row in short], axis=0).tolist(),
        "refused": float(np.mean([not row["accepted"] for row in short])),
        "longer": {name: _medians([u[name] for u in units if name in u]) for name in longer},
        "recalibration": _checked(case["recalibration"]) if case.get("recalibration") else None,
    }


def _spread(found: Sequence[Sequence[float]]) -> list[float]:
    """Median and worst of RMS ÷ floor and of the error."""
    return [float(f(column)) for column in zip(*found, strict=True) for f in (np.median, np.max)]


def _medians(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    return {"units": len(rows)} | {
        way: np.median([row[way] for row in rows], axis=0).tolist() for way in ("lot", "mrbf")
    }


def _checked(checked: dict[str, Any]) -> dict[str, Any]:
    """Of check runs of 2.5 h against earlier models of five runs."""
    p = np.array(checked["unchanged"])
    return {
        "units": len(p),
        "told": [float(np.mean(p < level)) for level in (0.01, 0.05)],
        "named": {
            kind: [float(np.mean(row[key])) for key in ("seen", "right")]
            for kind, row in checked["named"].items()
        },
    }


def _case(case: dict[str, Any]) -> str:
    rows = [
        f"| {_WAYS[way]} | {rms:.3f} / {worst:.3f} | {error:.2f} / {most:.2f} |"
        for way, (rms, worst, error, most) in case["ways"].items()
    ]
    longer = [
        f"{name}: {row['lot'][0]:.3f} ({row['lot'][1]:.2f}) with the lot, {row['mrbf'][0]:.3f} "
        f"({row['mrbf'][1]:.2f}) without"
        for name, row in case["longer"].items()
    ]
    units = next(iter(case["longer"].values()))["units"]
    lines = [
        f"#### {case['case'][0].upper()}{case['case'][1:]} (family {case['family']:g})",
        "",
        f"`gyrotc lot`: {case['told']}. {case['learnt_s']:.1f} s of processor time.",
        "",
        "| way | RMS ÷ floor | error |",
        "| --- | --- | --- |",
        *rows,
        "",
        f"Better with the lot than with the ladder alone: {case['better']:.0%} of units. The truth lies within 1 / 1.96 "
        f"sigma of the table at {case['coverage'][0]:.1%} / {case['coverage'][1]:.1%} of the exam. Own units refused: "
        f"{case['refused']:.1%}.",
        f"Longer programmes, {units} units, medians of RMS ÷ floor (error): {'; '.join(longer)}.",
    ]
    if refused := case["strangers_refused"]:
        told = ", ".join(f"{share:.1%} from {name}" for name, share in refused.items())
        most = case["best_power"]
        beside = f" A test that knew each stranger's map would refuse {most:.1%} from 2.5 h." if most else ""
        lines.append(f"Strangers (another lot's units) refused: {told}.{beside}")
    if case["recalibration"]:
        lines += ["", _recalibration(case["recalibration"])]
    return "\n".join(lines)


def _recalibration(checked: dict[str, Any]) -> str:
    named = ", ".join(
        f"{kind} seen {seen:.0%}, named right {right:.0%}" for kind, (seen, right) in checked["named"].items()
    )
    return (
        f"Recalibration: a check run of 2.5 h against the model of the five runs before it, {checked['units']} units. "
        f"Not changed: {checked['told'][0]:.1%} told to have changed at 1 %, {checked['told'][1]:.1%} at 5 %. Planted "
        f"changes (offset of one sigma of 50-s means, slope of two over 100 C, a bump of three with 6 C): {named}."
    )


def _coverage(draws: dict[str, list[dict[str, Any]]]) -> str:
    """Over all draws; units of a lot share how well it is known, so lots count, not units."""
    lots = [case["coverage"] for cases in draws.values() for case in cases]
    mean, error = np.mean(lots, axis=0), np.std(lots, axis=0, ddof=1) / np.sqrt(len(lots))
    return (
        f"Over all {len(lots)} lots of all draws the truth lies within 1 / 1.96 sigma of the table at {mean[0]:.1%} ± "
        f"{error[0]:.1%} / {mean[1]:.1%} ± {error[1]:.1%} of the exam (± one standard error; 68 and 95 were to be reached). "
        "One lot scatters by more than three points, for 60 units tell its spread to 9 %, and after a run of 2.5 h an "
        "unseen unit's error has two or three degrees of freedom left.\n"
    )


def _speed(rows: Sequence[dict[str, Any]]) -> str:
    lines = ["### Learning from 50 to 400 units (`python -m bench.lot_speed docs`)", ""]
    lines += [
        "| units | processor time, s | memory, MiB | clusters, directions |",
        "| --- | --- | --- | --- |",
    ]
    for row in rows:
        lines.append(
            f"| {row['units']} | {row['cpu_s']:.1f} | {row['memory_mib']:.0f} | {row['clusters']}, {row['directions']} |"
        )
    return "\n".join(lines) + "\n"


def _strangers(rows: Sequence[dict[str, Any]]) -> str:
    """Of each draw, and over all: a unit is a trial, draws differ in how many of them agree with the lot."""
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


def section(record: dict[str, Any]) -> str:
    """The section: every draw, what a run shows of a stranger, and what learning costs."""
    draws = record["draws"]
    parts = [_HEAD, _coverage(draws)]
    for seed, cases in draws.items():
        parts.append(f"### Seed {seed}\n\n" + "\n\n".join(_case(case) for case in cases) + "\n")
    strangers, speed = record.get("strangers"), record.get("speed")
    return (
        "\n".join(parts) + (_strangers(strangers) if strangers else "") + (_speed(speed) if speed else "")
    )


def write_page(docs: Path, part: dict[str, Any]) -> None:
    """Adds a draw, or replaces what is known of strangers or of speed, and makes the section anew."""
    record = recorded(docs, "lot-prior") or {"draws": {}}
    draws = dict(sorted({**record["draws"], **part.pop("draws", {})}.items()))
    write(docs, "lot-prior", record | part | {"draws": draws}, section)
