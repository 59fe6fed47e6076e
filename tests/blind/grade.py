"""Scores of a blind run: truth and answer of every recording side by side, and what is right about it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .campaign import Campaign, Hidden, mean_of
from .effects import FAMILY

Row = dict[str, Any]

_AVERAGE = 10  # rows of 10 s in 100 s
_NO_CAUSE = {"foreign": "unnamed", "clean": "nothing"}  # true in the place of a cause, among stated probabilities


def grade(hidden: Hidden, order_stratum: str, campaign: Campaign, result: dict[str, Any], declared: bool) -> Row:
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
        "said": said(hidden.names, order_stratum, physical),
        "seconds": result.get("seconds"),
    }
    if result["verdict"] == "error":
        row["error"] = result["text"]
    row["parameters"] = _parameters(hidden, physical)
    row["separable"] = [c.get("separable_from_d", {}) for c in physical]
    row["limit_ratio"] = _limit_ratio(hidden, result)
    row["gain"] = _gain(hidden, campaign, result, physical)
    return row


def said(names: Sequence[str], stratum: str, physical: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Everything with a stated probability in the place of a named cause, and whether it is hidden.

    In the place of the right cause only one can be true; another one that is hidden beside it is true, too, and
    something unnamed where the effect is foreign, and nothing where none is hidden.
    """
    true = {*names, _NO_CAUSE.get(stratum)}
    return [
        {"id": id, "p": p, "true": id in true}
        for cause in physical
        for id, p in (cause.get("probabilities") or {}).items()
    ]


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
                    out.append({"name": f"{name}.{key}", "true": value, "got": got["value"], "inside": inside})
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
    """Squares before and after on the test runs, and of the noise that was really added.

    Where nothing that can be corrected is named nothing is gained: what was hidden counts, not what was named.
    """
    if result.get("baseline") is None:
        return None
    exam = [k for k, role in enumerate(campaign.roles) if role == "exam"]
    noise = np.concatenate([mean_of(hidden.noise_rows[k], _AVERAGE) for k in exam])
    before = result["baseline"]["exam_rms_dph"]
    gains = [c["gain"] for c in physical if c["gain"]]
    if gains:  # a mended record leaves out what it does not have: both of the same samples
        before, after = gains[0]["exam_rms_before_dph"], gains[-1]["exam_rms_after_dph"]
    else:
        after = before
    return {
        "before2": before**2,
        "after2": after**2,
        "noise2": float(np.mean(noise**2)),
        **shipped_worse(result),
    }


def shipped_worse(result: dict[str, Any]) -> dict[str, float]:
    """Whether an extension was shipped, is worse on the exam, and by more than the exam's noise (95 %)."""
    gain = result["extended"]["gain"] if result.get("extended") else None
    if gain is None:
        return {"shipped": 0.0, "worse": 0.0, "surely_worse": 0.0}
    worse = gain["exam_rms_after_dph"] > gain["exam_rms_before_dph"]
    return {
        "shipped": 1.0,
        "worse": float(worse),
        "surely_worse": float(gain["rms_removed_dph"]["high"] < 0.0),
    }


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
