"""The figures that a blind run is held against, and its table with binomial limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.stats import beta

from .effects import FAMILY
from .grade import Row, alarmed, family_right, in_set, wrong_family

_GAINING = ("cavity_lag", "thermal_gradient", "hysteresis", "warm_up", "auxiliary")


Check = tuple[str, str, Callable[[Row], bool], Callable[[Row], bool], float, str]


def _k(row: Row) -> float:
    return float(min(row["k"])) if row["k"] else 0.0


def _one(low: float, high: float = 1e9, *, offset: bool = False) -> Callable[[Row], bool]:
    """Recordings with one hidden cause and k in a range, run offsets excepted."""
    return lambda r: r["stratum"] == "one" and low <= _k(r) < high and (r["truth"] == ["turn_on_offset"]) == offset


RANDOM = ("thermometer_drift", "telegraph", "pulses", "room_cycle")
# Written after the shapes of `diagnose/shapes.py`, by somebody who had not read them.
UNFORESEEN = ("stick_slip", "saturating_memory", "ringing", "dose")

CHECKS: list[Check] = [
    ("false alarm, clean", "≤ 2 %", lambda r: r["stratum"] == "clean", alarmed, 0.02, "max"),
    (
        "anything but consistent, clean",
        "-",
        lambda r: r["stratum"] == "clean",
        lambda r: r["verdict"] != "consistent",
        0.05,
        "max",
    ),
    (
        "physical name under stress noise",
        "≤ 3 %",
        lambda r: r["stratum"] == "stress",
        lambda r: bool(r["named"]),
        0.03,
        "max",
    ),
    (
        "sensor lag named",
        "≤ 5 %",
        lambda r: r["stratum"] == "sensor lag",
        lambda r: bool(r["named"]),
        0.05,
        "max",
    ),
    ("detected, k 1.25-1.7", "≥ 90 %", _one(1.25, 1.7), alarmed, 0.90, "min"),
    ("detected, k ≥ 1.7", "≥ 98 %", _one(1.7), alarmed, 0.98, "min"),
    ("detected, turn-on offset, k ≥ 1.7", "≥ 90 %", _one(1.7, offset=True), alarmed, 0.90, "min"),
    (
        "family right, k 1.7-2.5",
        "≥ 95 %",
        lambda r: r["stratum"] == "one" and 1.7 <= _k(r) < 2.5,
        family_right,
        0.95,
        "min",
    ),
    (
        "family right, k ≥ 2.5",
        "≥ 98 %",
        lambda r: r["stratum"] == "one" and _k(r) >= 2.5,
        family_right,
        0.98,
        "min",
    ),
    (
        "truth in the set, k 1.7-2.5",
        "≥ 90 %",
        lambda r: r["stratum"] == "one" and 1.7 <= _k(r) < 2.5,
        in_set,
        0.90,
        "min",
    ),
    (
        "truth in the set, k ≥ 2.5",
        "≥ 95 %",
        lambda r: r["stratum"] == "one" and _k(r) >= 2.5,
        in_set,
        0.95,
        "min",
    ),
    ("wrong family, any k", "≤ 5 %", lambda r: r["stratum"] == "one", wrong_family, 0.05, "max"),
    (
        "wrong name, k < 0.7",
        "≤ 5 %",
        lambda r: r["stratum"] == "one" and _k(r) < 0.7,
        wrong_family,
        0.05,
        "max",
    ),
    (
        "foreign given a physical name, k 2.5-5",
        "≤ 10 %",
        lambda r: r["stratum"] == "foreign" and 2.5 <= _k(r) < 5,
        lambda r: bool(r["named"]),
        0.10,
        "max",
    ),
    (
        "foreign given a physical name, k ≥ 5",
        "≤ 2 %",
        lambda r: r["stratum"] == "foreign" and _k(r) >= 5,
        lambda r: bool(r["named"]),
        0.02,
        "max",
    ),
    (
        "... of these, k ≥ 2.5, of a kind that is newer than the shapes",
        "≤ 10 %",
        lambda r: r["stratum"] == "foreign" and _k(r) >= 2.5 and r["truth"][0] in UNFORESEEN,
        lambda r: bool(r["named"]),
        0.10,
        "max",
    ),
    (
        "not reproducible, k ≥ 4: noise differs or unexplained",
        "≥ 80 %",
        lambda r: r["stratum"] == "foreign" and r["truth"][0] in RANDOM and _k(r) >= 4,
        lambda r: r["verdict"] in ("noise_differs", "unexplained"),
        0.80,
        "min",
    ),
    (
        "two effects, separating: both families",
        "≥ 80 %",
        lambda r: r["stratum"] == "two" and r["design"] == "separating",
        lambda r: {FAMILY[t] for t in r["truth"]} <= {FAMILY[n] for n in r["named"]},
        0.80,
        "min",
    ),
    (
        "two effects: no third",
        "≥ 95 %",
        lambda r: r["stratum"] == "two",
        lambda r: len(r["named"]) <= 2,
        0.95,
        "min",
    ),
]


def table(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Every requirement with its count, share, limits, and whether it is met."""
    out: list[dict[str, Any]] = []
    for name, goal, select, hit, bound, kind in CHECKS:
        out += proportion(name, goal, [hit(r) for r in rows if select(r)], bound, kind)
    out += _parameters_met(rows) + _sets(rows) + reliability(rows)
    return out + gains_of(rows) + _honesty(rows) + _time(rows)


def proportion(name: str, goal: str, hits: Sequence[bool], bound: float, kind: str) -> list[dict[str, Any]]:
    """A share with its limits; nothing where nothing was counted."""
    if not hits:
        return []
    count, total = int(np.sum(hits)), len(hits)
    low, high = limits(count, total)
    share = count / total
    met = share <= bound if kind == "max" else share >= bound
    entry = {"name": name, "goal": goal, "hits": count, "of": total, "share": share}
    return [{**entry, "low": low, "high": high, "met": met}]


def ended(entries: Sequence[dict[str, Any]]) -> int:
    """Exit status of a run: 1, and what is missed in print, where a published requirement is not met."""
    missed = [entry["name"] for entry in entries if entry["goal"] != "-" and not entry["met"]]
    for name in missed:
        print(f"missed: {name}")
    return 1 if missed else 0


def _value(name: str, goal: str, value: float, met: bool, of: int) -> list[dict[str, Any]]:
    return [{"name": name, "goal": goal, "value": value, "met": bool(met), "of": of}]


def _parameters_met(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Errors of parameters, and how often their intervals hold the truth, at k ≥ 2.5."""
    strong = [p for r in rows if r["stratum"] == "one" and _k(r) >= 2.5 for p in r["parameters"]]
    out: list[dict[str, Any]] = []
    for label, bound, wanted in (
        ("tau of lag and gradient", 0.25, ("cavity_lag.tau_s", "thermal_gradient.tau_s")),
        ("width", 0.25, ("hysteresis.width_c",)),
        ("tau of warm-up", 0.20, ("warm_up.tau_s",)),
        ("period", 0.02, ("path_length_periodicity.period_c",)),
        ("shift", 0.25, ("time_misalignment.shift_s",)),
        ("amplitude", 0.15, ("amplitude", "slope")),
    ):
        found = [p for p in strong if any(w in p["name"] for w in wanted)]
        close = [p["got"] * p["true"] > 0 and abs(np.log(p["got"] / p["true"])) <= bound for p in found]
        out += proportion(f"{label} within {bound:.0%}, k ≥ 2.5", "≥ 90 %", close, 0.9, "min")
    inside = [p["inside"] for p in strong]
    for entry in proportion("95 % intervals cover, k ≥ 2.5", "90-98 %", inside, 0.9, "min"):
        out.append({**entry, "met": entry["high"] >= 0.9 and entry["low"] <= 0.98})
    return out


def _sets(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Sizes of equivalence sets, and members named right where the printed separation says they can be."""
    named = [r for r in rows if r["stratum"] == "one" and r["named"]]
    sizes = [1 + max(len(e) for e in r["equivalent"]) for r in named if _k(r) >= 1.7]
    mean = float(np.mean(sizes)) if sizes else 0.0
    reported = [r["truth"][0] == r["named"][0] for r in named if r["design"] == "separating" and _reported(r)]
    return [
        *(_value("mean size of the set, k ≥ 1.7", "≤ 2", mean, mean <= 2, len(sizes)) if sizes else []),
        *proportion("member right where printed d_sep ≤ d (separating)", "≥ 90 %", reported, 0.9, "min"),
    ]


def _time(rows: Sequence[Row]) -> list[dict[str, Any]]:
    seconds = [r["seconds"] for r in rows if r["seconds"]]
    middle = float(np.median(seconds)) if seconds else 0.0
    return _value("median CPU time of a diagnosis, s", "≤ 20", middle, middle <= 20.0, len(seconds))


_BINS = ((0.1, 0.5), (0.5, 0.8), (0.8, 0.95), (0.95, 1.0 + 1e-9))  # of stated probabilities


SAID = "true of what was said with"


def reliability(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """How often what was said with a probability is true, over all recordings, clean and foreign ones among them."""
    said = [one for row in rows for one in row.get("said", [])]
    out: list[dict[str, Any]] = []
    for low, high in _BINS:
        inside = [one for one in said if low <= one["p"] < high]
        if not inside:
            continue
        mean = float(np.mean([one["p"] for one in inside]))
        name = f"{SAID} {low:.0%}-{min(high, 1.0):.0%}, on average {mean:.0%}"
        for entry in proportion(name, f"{mean:.0%}", [one["true"] for one in inside], mean, "min"):
            out.append({**entry, "met": entry["low"] <= mean <= entry["high"]})
    return out


def _reported(row: Row) -> bool:
    d = 6.0 * _k(row)
    return all(v <= d for s in row["separable"] for v in s.values())


def gains_of(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Pooled share of the oracle's gain, and extensions shipped that made the exam worse."""
    chosen = [
        r["gain"]
        for r in rows
        if r["stratum"] == "one" and _k(r) >= 1.7 and r["gain"] and family_right(r) and r["truth"][0] in _GAINING
    ]
    out = _share("held-out gain as share of the oracle's, k ≥ 1.7 (pooled)", chosen)
    for cause in FAMILY:
        hidden = [
            r["gain"] for r in rows if r["stratum"] == "one" and _k(r) >= 1.7 and r["gain"] and r["truth"] == [cause]
        ]
        out += _share(f"... of all that hide {cause}, named or not", hidden)
    return out + worse_on_the_exam([r["gain"] for r in rows if r["gain"] and r["gain"]["shipped"]])


def _share(name: str, gains: Sequence[dict[str, float]]) -> list[dict[str, Any]]:
    """What is gained of what knowing everything gains, over all of these together."""
    got = sum((g["before2"] - g["after2"]) / g["noise2"] for g in gains)
    best = sum(g["before2"] / g["noise2"] - 1.0 for g in gains)
    return _value(name, "≥ 85 %", got / best, got / best >= 0.85, len(gains)) if best > 0.0 else []


def worse_on_the_exam(shipped: Sequence[dict[str, float]]) -> list[dict[str, Any]]:
    """Shares of the extensions that were shipped and made the exam worse, at all and beyond its noise."""
    out = proportion("shipped although worse on the exam", "0", [bool(g["worse"]) for g in shipped], 0.0, "max")
    surely = [bool(g.get("surely_worse", False)) for g in shipped]
    return out + proportion("... by more than the exam's noise (95 %)", "0", surely, 0.0, "max")


def _honesty(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Amplitude at which 95 % are found, in units of the printed limit (logistic fit to log amplitude)."""
    data = [(np.log(r["limit_ratio"]), alarmed(r)) for r in rows if r["limit_ratio"]]
    if len(data) < 40:
        return []
    x, hit = np.array([d[0] for d in data]), np.array([d[1] for d in data], dtype=float)
    centres, widths = np.linspace(-1.5, 1.0, 126), np.linspace(0.03, 0.5, 48)
    best, at = -np.inf, (0.0, 0.1)
    for c in centres:
        p = np.clip(1.0 / (1.0 + np.exp(-(x[:, None] - c) / widths)), 1e-6, 1 - 1e-6)
        like = (hit[:, None] * np.log(p) + (1 - hit[:, None]) * np.log(1 - p)).sum(axis=0)
        if like.max() > best:
            best, at = float(like.max()), (float(c), float(widths[like.argmax()]))
    ratio = float(np.exp(at[0] + at[1] * np.log(19.0)))
    return _value("95 %-power amplitude over printed limit", "0.75-1.25", ratio, 0.75 <= ratio <= 1.25, len(data))


def text(rows: Sequence[Row]) -> str:
    """The table of some rows as Markdown."""
    return markdown(table(rows))


def markdown(entries: Sequence[dict[str, Any]]) -> str:
    """A table as Markdown; what is not met is in bold."""
    lines = [
        "| requirement | figure | measured | 95 % limits | records | met |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for t in entries:
        met = "yes" if t["met"] else "**no**"
        if "hits" in t:
            measured = f"{t['share']:.1%} | {t['low']:.1%}-{t['high']:.1%} | {t['hits']} of {t['of']}"
        else:
            measured = f"{t['value']:.3g} | | {t['of']}"
        lines.append(f"| {t['name']} | {t['goal']} | {measured} | {met} |")
    return "\n".join(lines)


def limits(hits: int, total: int) -> tuple[float, float]:
    """Two-sided 95 % limits of a proportion (Clopper and Pearson)."""
    low = float(beta.ppf(0.025, hits, total - hits + 1)) if hits else 0.0
    high = float(beta.ppf(0.975, hits + 1, total - hits)) if hits < total else 1.0
    return low, high
