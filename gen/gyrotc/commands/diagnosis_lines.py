"""A diagnosis in lines for a terminal."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any


def diagnosis_lines(result: dict[str, Any]) -> Iterator[str]:
    """The verdict in words: causes with their size and gain, rivals, what could still hide, what to do next."""
    axis = f" {result['axis']}" if result["axis"] else ""
    yield f"{result['serial']}{axis}: {result['verdict'].replace('_', ' ')}. {result['text']}"
    yield result["meaning"]
    yield from result.get("missing", ())
    for d in result["discrepancies"]:
        if d["p_value"] is not None and d["p_value"] < 0.01:
            yield (
                f"  {d['statistic'].replace('_', ' ')}: measured {d['measured']:.4g}, "
                f"simulated {d['simulated_low']:.4g} ... {d['simulated_high']:.4g}"
            )
    for cause in result["causes"]:
        yield from _cause_lines(cause)
    left = result.get("unexplained")
    if left:
        yield f"unexplained: {unexplained_text(left)}"
    if any(c["family"] != "noise" for c in result["causes"]) and result["extended"] is None:
        yield "no extension is shipped: none has a gain on runs it was not fitted to"
    limits = [c for c in result["considered"] if c.get("detection_limit")]
    if limits:
        yield "what could still hide below its detection limit:"
        yield from (f"  {_limit_text(c)}" for c in limits)
    yield from (f"next: {step}" for step in result["next"])


def unexplained_text(left: dict[str, Any]) -> str:
    """What is known of structure that has no name."""
    parts = [f"p = {left['p_value']:.2g}"]
    if left["best_partial_match"]:
        names = " and ".join(left["best_partial_match"]).replace("_", " ")
        parts.append(f"{names} would account for {left['share_explained']:.0%} of the structure")
    if left["looks_like"]:
        parts.append(f"it looks more like {left['looks_like']}")
    return "; ".join(parts)


def extension_lines(diagnosis: dict[str, Any]) -> Iterator[str]:
    """What the diagnosis added to the model, and what it gained."""
    yield f"diagnosis: {diagnosis['verdict'].replace('_', ' ')}: {diagnosis['text']}"
    extended = diagnosis["extended"]
    if extended is None:
        yield "nothing added: no cause was named that gains on runs it was not fitted to"
        return
    added = ", ".join(extended["terms"]) or "a finer map"
    yield f"added: {added}; {extended['centers']} centers (without: {diagnosis['baseline']['centers']})"
    yield from _gain_lines(extended["gain"])


def _limit_text(considered: dict[str, Any]) -> str:
    name = considered["id"] + (f" ({considered['channel']})" if "channel" in considered else "")
    limit = considered["detection_limit"]
    if limit["value"] is None:
        return f"{name}: not visible at any {limit['parameter']} in this gyro"
    return f"{name}: {limit['value']:.3g} {limit['unit']}"


def _cause_lines(cause: dict[str, Any]) -> Iterator[str]:
    yield f"cause: {cause['name']} ({cause['id']}, family {cause['family']})"
    for name, p in cause["parameters"].items():
        interval = "" if p.get("low") is None else f", 95 % {p['low']:.4g} ... {p['high']:.4g}"
        yield f"  {name} = {p['value']:.4g}{interval}"
    if cause["equivalent"]:
        channels = f" ({', '.join(cause['equivalent_channels'])})" if "equivalent_channels" in cause else ""
        yield f"  as likely on these runs: {', '.join(cause['equivalent'])}{channels}"
    if cause.get("separate_by"):
        yield f"  to tell them apart: {cause['separate_by']}"
    if cause.get("gain"):
        yield from _gain_lines(cause["gain"])


def _gain_lines(gain: dict[str, Any]) -> Iterator[str]:
    """RMS and angle without and with, on runs not fitted to."""
    share, removed = gain["share_of_excess_removed"], gain["rms_removed_dph"]
    part = (
        ""
        if share is None
        else f"; {share:.0%} of the removable error ({gain['low']:.0%} ... {gain['high']:.0%})"
    )
    yield (
        f"  RMS on runs not fitted to: {gain['exam_rms_before_dph']:.4g} -> {gain['exam_rms_after_dph']:.4g} deg/h, "
        f"95 % {removed['low']:.2g} ... {removed['high']:.2g} less{part}"
    )
    angle = gain["angle_1h_removed_arcsec"]
    if angle is not None:
        yield (
            f"  angle after one hour: {gain['angle_1h_before_arcsec']:.4g} -> {gain['angle_1h_after_arcsec']:.4g} "
            f"arcsec, 95 % {angle['low']:.2g} ... {angle['high']:.2g} less"
        )
