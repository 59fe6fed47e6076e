"""What is right about an answer, and the table of a run with limits by recording (Clopper and Pearson)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ..grade import Row, alarmed, family_right, in_set, said, shipped_worse, wrong_family
from ..table import proportion, reliability, worse_on_the_exam
from .record import Recording, reported


def graded(recording: Recording, result: dict[str, Any]) -> Row:
    """Truth and answer side by side."""
    physical = [c for c in result["causes"] if c["family"] != "noise"]
    truth = recording.truth
    names = [truth.name] if truth.name else ["foreign"] if truth.stratum == "foreign" else []
    row: Row = {
        **reported(truth),
        "truth": names,
        "verdict": result["verdict"],
        "named": [c["id"] for c in physical],
        "noise": [c["id"] for c in result["causes"] if c["family"] == "noise"],
        "equivalent": [c["equivalent"] for c in physical],
        "said": said(names, truth.stratum, physical),
        "events": [e["id"] for e in result.get("events", [])],
        **shipped_worse(result),
        "seconds": result.get("seconds"),
    }
    if result["verdict"] == "error":
        row["error"] = result["text"]
    return row


Chosen = Callable[[Row], bool]


def _of(stratum: str, low: float = 0.0, **fields: Any) -> Chosen:
    return lambda r: (
        r["stratum"] == stratum and r["k"] >= low and all(r[name] == value for name, value in fields.items())
    )


def _named(row: Row) -> bool:
    return bool(row["named"])


def _sure(row: Row) -> bool:
    return bool(row["named"]) and row["verdict"] == "explained"


def _level_reported(row: Row) -> bool:
    return bool(row["noise"])


def _event_reported(row: Row) -> bool:
    return bool(row.get("events"))


_CHECKS: list[tuple[str, str, Chosen, Callable[[Row], bool], float, str]] = [
    ("a cause named, clean", "≤ 2 %", _of("clean"), _named, 0.02, "max"),
    ("... noise declared wrong", "≤ 2 %", _of("clean", declared="wrong"), _named, 0.02, "max"),
    ("... noise declared right", "≤ 2 %", _of("clean", declared="right"), _named, 0.02, "max"),
    ("... not declared", "≤ 2 %", _of("clean", declared="none"), _named, 0.02, "max"),
    ("a cause or structure claimed, clean", "≤ 2 %", _of("clean"), alarmed, 0.02, "max"),
    ("an event reported, clean", "≤ 2 %", _of("clean"), _event_reported, 0.02, "max"),
    ("an event reported, a catalogue effect hidden", "≤ 2 %", _of("one"), _event_reported, 0.02, "max"),
    ("wrong declaration reported, clean", "-", _of("clean", declared="wrong"), _level_reported, 0.0, "min"),
    ("right declaration doubted, clean", "-", _of("clean", declared="right"), _level_reported, 1.0, "max"),
    ("foreign given a name", "≤ 10 %", _of("foreign"), _named, 0.10, "max"),
    ("... without saying that another does as well", "≤ 10 %", _of("foreign"), _sure, 0.10, "max"),
    ("foreign given a name, k ≥ 2.5", "≤ 10 %", _of("foreign", 2.5), _named, 0.10, "max"),
    ("foreign noticed, k ≥ 2.5", "-", _of("foreign", 2.5), alarmed, 0.0, "min"),
    ("detected, k ≥ 2.5", "≥ 95 %", _of("one", 2.5), alarmed, 0.95, "min"),
    ("family right, k ≥ 2.5", "≥ 95 %", _of("one", 2.5), family_right, 0.95, "min"),
    ("family right, all k", "-", _of("one"), family_right, 0.0, "min"),
    ("... parameter within the search", "-", _of("one", beyond=False), family_right, 0.0, "min"),
    ("... parameter beyond the search", "-", _of("one", beyond=True), family_right, 0.0, "min"),
    ("truth named or equivalent, k ≥ 2.5", "≥ 95 %", _of("one", 2.5), in_set, 0.95, "min"),
    ("a wrong family named", "≤ 5 %", _of("one"), wrong_family, 0.05, "max"),
    ("broke down", "0", lambda r: True, lambda r: r["verdict"] == "error", 0.0, "max"),
]


def table(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Every figure with its count, share and limits."""
    out: list[dict[str, Any]] = []
    for name, goal, select, hit, bound, kind in _CHECKS:
        out += proportion(name, goal, [hit(r) for r in rows if select(r)], bound, kind)
    return out + worse_on_the_exam([row for row in rows if row.get("shipped")]) + reliability(rows)
