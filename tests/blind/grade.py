"""Scores of a blind run: one row for each recording, tables by stratum with binomial limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.stats import beta

from .campaign import Campaign, Hidden, mean_of
from .effects import FAMILY

Row = dict[str, Any]

_AVERAGE = 10  # rows of 10 s in 100 s


def grade(
    hidden: Hidden, order_stratum: str, campaign: Campaign, result: dict[str, Any], declared: bool
) -> Row:
    """Truth and answer of one recording, side by side."""
    physical = [c for c in result["causes"] if c["family"] != "noise"]
    row: Row = {
        "stratum": order_stratum,
        "design": campaign.design,
        "truth": hidden.names,
        "k": hidden.k,
        "stress": hidden.stress,
        "declared": declared,
        "verdict": result["verdict"],
        "named": [c["id"] for c in physical],
        "noise": [c["id"] for c in result["causes"] if c["family"] == "noise"],
        "equivalent": [c["equivalent"] for c in physical],
        "seconds": result.get("seconds"),
    }
    if result["verdict"] == "error":
        row["error"] = result["text"]
    row["parameters"] = _parameters(hidden, physical)
    row["separable"] = [c.get("separable_from_d", {}) for c in physical]
    row["limit_ratio"] = _limit_ratio(hidden, result)
    row["gain"] = _gain(hidden, campaign, result, physical)
    return row


def _parameters(hidden: Hidden, physical: list[dict[str, Any]]) -> list[dict[str, float]]:
    """Errors of the parameters of causes that were named right."""
    out = []
    for j, name in enumerate(hidden.names):
        for cause in physical:
            if cause["id"] != name:
                continue
            true = dict(hidden.parameters[j])
            amplitude = hidden.amplitude[j]
            if name in ("thermal_gradient", "hysteresis"):
                true["amplitude_dph_per_c"] = amplitude
            elif name == "warm_up":
                true["amplitude_dph"] = amplitude
            elif name == "path_length_periodicity":
                true["amplitude_dph"] = abs(amplitude)
            elif name == "auxiliary":
                true["slope_dph_per_unit"] = amplitude
            for key, value in true.items():
                got = cause["parameters"].get(key)
                if got is not None:
                    inside = got["low"] <= value <= got["high"]
                    out.append(
                        {"name": f"{name}.{key}", "true": value, "got": got["value"], "inside": inside}
                    )
    return out


def _limit_ratio(hidden: Hidden, result: dict[str, Any]) -> float | None:
    """True amplitude over the printed detection limit at the true parameter, for one hidden cause."""
    if len(hidden.names) != 1 or hidden.names[0] not in FAMILY:
        return None
    name = hidden.names[0]
    found = [c for c in result["considered"] if c["id"] == name and c.get("detection_limit")]
    if not found or name in ("turn_on_offset", "map_too_coarse", "cavity_lag", "time_misalignment"):
        return None
    limit = found[0]["detection_limit"]
    if limit["over"] and hidden.parameters[0]:
        at = next(iter(hidden.parameters[0].values()))
        x, y = np.array(sorted(limit["over"])).T
        value = float(np.exp(np.interp(np.log(at), np.log(x), np.log(y))))
    else:
        value = limit["value"]
    return abs(hidden.amplitude[0]) / value if value else None


def _gain(
    hidden: Hidden, campaign: Campaign, result: dict[str, Any], physical: list[dict[str, Any]]
) -> dict[str, float] | None:
    """Squares before and after on the exam runs, and of the noise that was really added."""
    if not physical or not all(c["gain"] for c in physical):
        return None
    exam = [k for k, role in enumerate(campaign.roles) if role == "exam"]
    noise = np.concatenate([mean_of(hidden.noise_rows[k], _AVERAGE) for k in exam])
    return {
        "before2": physical[0]["gain"]["exam_rms_before_dph"] ** 2,
        "after2": physical[-1]["gain"]["exam_rms_after_dph"] ** 2,
        "noise2": float(np.mean(noise**2)),
        "shipped": float(result["extended"] is not None),
    }


def limits(hits: int, total: int) -> tuple[float, float]:
    """Two-sided 95 % limits of a proportion (Clopper and Pearson)."""
    low = float(beta.ppf(0.025, hits, total - hits + 1)) if hits else 0.0
    high = float(beta.ppf(0.975, hits + 1, total - hits)) if hits < total else 1.0
    return low, high


def alarmed(row: Row) -> bool:
    """A physical name or structure claimed."""
    return bool(row["named"]) or row["verdict"] in ("unexplained", "partial")


def family_right(row: Row) -> bool:
    """All hidden families named and no other."""
    return bool(row["named"]) and {FAMILY[n] for n in row["named"]} == {FAMILY[n] for n in row["truth"]}


def in_set(row: Row) -> bool:
    """The hidden cause is named or stands among the equivalents."""
    sets = [{n, *e} for n, e in zip(row["named"], row["equivalent"], strict=True)]
    return all(any(t in s for s in sets) for t in row["truth"])


def wrong_family(row: Row) -> bool:
    """A family is named that is not hidden."""
    return bool({FAMILY[n] for n in row["named"]} - {FAMILY[t] for t in row["truth"] if t in FAMILY})


Check = tuple[str, str, Callable[[Row], bool], Callable[[Row], bool], float, str]


def _k(row: Row) -> float:
    return float(min(row["k"])) if row["k"] else 0.0


def _one(low: float, high: float = 1e9, *, offset: bool = False) -> Callable[[Row], bool]:
    """Recordings with one hidden cause and k in a range, run offsets apart."""
    return lambda r: (
        r["stratum"] == "one" and low <= _k(r) < high and (r["truth"] == ["turn_on_offset"]) == offset
    )


def _any(low: float, high: float = 1e9) -> Callable[[Row], bool]:
    return lambda r: r["stratum"] == "one" and low <= _k(r) < high and r["verdict"] != "consistent"


REPRODUCIBLE = ("relay_texture", "creep", "asymmetric_lag", "node_product", "dead_zone")
RANDOM = ("thermometer_drift", "telegraph", "pulses", "room_cycle")

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
        lambda r: r["stratum"] == "one" and 1.7 <= _k(r) < 2.5 and alarmed(r),
        family_right,
        0.95,
        "min",
    ),
    (
        "family right, k ≥ 2.5",
        "≥ 98 %",
        lambda r: r["stratum"] == "one" and _k(r) >= 2.5 and alarmed(r),
        family_right,
        0.98,
        "min",
    ),
    (
        "truth in the set, k 1.7-2.5",
        "≥ 90 %",
        lambda r: r["stratum"] == "one" and 1.7 <= _k(r) < 2.5 and alarmed(r),
        in_set,
        0.90,
        "min",
    ),
    (
        "truth in the set, k ≥ 2.5",
        "≥ 95 %",
        lambda r: r["stratum"] == "one" and _k(r) >= 2.5 and alarmed(r),
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
        chosen = [r for r in rows if select(r)]
        hits = sum(hit(r) for r in chosen)
        if chosen:
            low, high = limits(hits, len(chosen))
            share = hits / len(chosen)
            met = share <= bound if kind == "max" else share >= bound
            out.append(
                {
                    "name": name,
                    "goal": goal,
                    "hits": hits,
                    "of": len(chosen),
                    "share": share,
                    "low": low,
                    "high": high,
                    "met": met,
                    "bound": bound,
                    "kind": kind,
                }
            )
    return out + _quantiles(rows)


def _quantiles(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Parameters, intervals, sizes of sets, gain, honesty of the printed limits."""
    out: list[dict[str, Any]] = []
    strong = [r for r in rows if r["stratum"] == "one" and _k(r) >= 2.5]

    def add(name: str, goal: str, value: float, met: bool, of: int) -> None:
        out.append({"name": name, "goal": goal, "value": value, "met": met, "of": of})

    for key, bound, label in (
        ("tau_s", 0.25, "tau (lag, gradient)"),
        ("width_c", 0.25, "width"),
        ("warm_up.tau_s", 0.20, "tau (warm-up)"),
        ("period_c", 0.02, "period"),
        ("shift_s", 0.25, "shift"),
        ("amplitude", 0.15, "amplitude"),
    ):
        errors = [
            abs(np.log(abs(p["got"] / p["true"]))) if p["got"] * p["true"] > 0 else 9.9
            for r in strong
            for p in r["parameters"]
            if key in p["name"] and (key != "tau_s" or "warm_up" not in p["name"])
        ]
        if errors:
            share = float(np.mean(np.array(errors) <= bound))
            add(f"{label} within {bound:.0%}, k ≥ 2.5", "≥ 90 %", share, share >= 0.9, len(errors))
    inside = [p["inside"] for r in strong for p in r["parameters"]]
    if inside:
        share = float(np.mean(inside))
        add("95 % intervals cover", "90-98 %", share, 0.90 <= share <= 0.985, len(inside))
    sizes = [
        1 + max((len(e) for e in r["equivalent"]), default=0)
        for r in rows
        if r["stratum"] == "one" and _k(r) >= 1.7 and r["named"]
    ]
    if sizes:
        add(
            "mean size of the set, k ≥ 1.7",
            "≤ 2",
            float(np.mean(sizes)),
            float(np.mean(sizes)) <= 2,
            len(sizes),
        )
    told = [
        r for r in rows if r["stratum"] == "one" and r["design"] == "separating" and r["named"] and _told(r)
    ]
    if told:
        share = float(np.mean([r["truth"][0] == r["named"][0] for r in told]))
        add("member right where printed d_sep ≤ d (separating)", "≥ 90 %", share, share >= 0.9, len(told))
    out += _gains(rows)
    out += _honesty(rows)
    seconds = [r["seconds"] for r in rows if r["seconds"]]
    if seconds:
        add(
            "median time of a diagnosis, s (cached bank, machine shared)",
            "≤ 3",
            float(np.median(seconds)),
            float(np.median(seconds)) <= 3.0,
            len(seconds),
        )
    return out


def _told(row: Row) -> bool:
    d = 6.0 * _k(row)
    return all(v <= d for s in row["separable"] for v in s.values())


def _gains(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Pooled share of the oracle's gain, and extensions shipped that made the exam worse."""
    chosen = [
        r["gain"]
        for r in rows
        if r["stratum"] == "one"
        and _k(r) >= 1.7
        and r["gain"]
        and family_right(r)
        and r["truth"][0] in ("cavity_lag", "thermal_gradient", "hysteresis", "warm_up", "auxiliary")
    ]
    out: list[dict[str, Any]] = []
    if chosen:
        got = sum(max(g["before2"], 0) / g["noise2"] - g["after2"] / g["noise2"] for g in chosen)
        best = sum(g["before2"] / g["noise2"] - 1.0 for g in chosen)
        share = got / best
        out.append(
            {
                "name": "held-out gain as share of the oracle's, k ≥ 1.7 (pooled)",
                "goal": "≥ 85 %",
                "value": share,
                "met": share >= 0.85,
                "of": len(chosen),
            }
        )
    shipped = [r["gain"] for r in rows if r["gain"] and r["gain"]["shipped"]]
    if shipped:
        worse = float(np.mean([g["after2"] > g["before2"] for g in shipped]))
        out.append(
            {
                "name": "shipped although worse on the exam",
                "goal": "0",
                "value": worse,
                "met": worse == 0.0,
                "of": len(shipped),
            }
        )
    return out


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
    return [
        {
            "name": "95 %-power amplitude over printed limit",
            "goal": "0.75-1.25",
            "value": ratio,
            "met": 0.75 <= ratio <= 1.25,
            "of": len(data),
        }
    ]


def text(rows: Sequence[Row]) -> str:
    """The table as Markdown."""
    lines = [
        "| requirement | figure | measured | 95 % limits | records | met |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for t in table(rows):
        if "hits" in t:
            lines.append(
                f"| {t['name']} | {t['goal']} | {t['share']:.1%} | {t['low']:.1%}-{t['high']:.1%} | {t['hits']}/{t['of']} | {'yes' if t['met'] else 'no'} |"
            )
        else:
            lines.append(
                f"| {t['name']} | {t['goal']} | {t['value']:.3g} | | {t['of']} | {'yes' if t['met'] else 'no'} |"
            )
    return "\n".join(lines)
