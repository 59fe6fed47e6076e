"""A diagnosis in lines for a terminal."""

from __future__ import annotations

from collections.abc import Iterator

from ..results.diagnosed import ConsideredCause, Diagnosed, GainOnUnseen, NamedCause, Unexplained

_RARE = 0.01  # the familywise level of the search: rarer statistics are told


def diagnosis_lines(result: Diagnosed) -> Iterator[str]:
    """The verdict in words: causes with their size and gain, rivals, what could still hide, what to do next."""
    axis = f" {result.axis}" if result.axis else ""
    yield f"{result.serial}{axis}: {result.verdict.replace('_', ' ')}. {result.text}"
    yield result.meaning
    if result.lot is not None:
        yield f"lot: {result.lot}"
    for event in result.events:
        yield f"event: {event.text}"
        if event.exclude and not result.events_accepted:
            yield f"  {event.exclude}"
    yield from result.missing
    for d in result.discrepancies:
        if d.p_value < _RARE:
            yield (
                f"  {d.statistic.replace('_', ' ')}: measured {d.measured:.4g}, "
                f"simulated {d.simulated_low:.4g} ... {d.simulated_high:.4g}"
            )
    for cause in result.causes:
        yield from _cause_lines(cause)
    if result.unexplained:
        yield f"unexplained: {unexplained_text(result.unexplained)}"
    if result.physical and result.extended is None:
        yield "no extension is shipped: none has a gain on runs it was not fitted to"
    limits = [_limit_text(c) for c in result.considered if c.detection_limit]
    if limits:
        yield "what could still hide below its detection limit:"
        yield from (f"  {text}" for text in limits)
    yield from (f"next: {step}" for step in result.next)


def unexplained_text(left: Unexplained) -> str:
    """What is known of structure that has no name."""
    parts = [f"p = {left.p_value:.2g}"]
    if left.best_partial_match:
        names = " and ".join(left.best_partial_match).replace("_", " ")
        parts.append(f"{names} would account for {left.share_explained:.0%} of the structure")
    if left.looks_like:
        parts.append(f"it looks more like {left.looks_like}")
    return "; ".join(parts)


def extension_lines(diagnosis: Diagnosed) -> Iterator[str]:
    """What the diagnosis added to the model, and what it gained."""
    yield f"diagnosis: {diagnosis.verdict.replace('_', ' ')}: {diagnosis.text}"
    extended = diagnosis.extended
    if extended is None:
        yield "nothing added: no cause was named that gains on runs it was not fitted to"
        return
    added = ", ".join(extended.terms) or "a finer map"
    without = f" (without: {diagnosis.baseline.centers})" if diagnosis.baseline else ""
    yield f"added: {added}; {extended.centers} centers{without}"
    yield from _gain_lines(extended.gain)


def _limit_text(considered: ConsideredCause) -> str:
    name = considered.id + (f" ({considered.channel})" if considered.channel is not None else "")
    limit = considered.detection_limit
    if limit is None or limit.value is None:
        return f"{name}: not visible at any {limit.parameter if limit else 'size'} in this gyro"
    return f"{name}: {limit.value:.3g} {limit.unit}"


def _cause_lines(cause: NamedCause) -> Iterator[str]:
    yield f"cause: {cause.name} ({cause.id}, family {cause.family})"
    for name, p in cause.parameters.items():
        interval = "" if p.low is None else f", 95 % {p.low:.4g} ... {p.high:.4g}"
        yield f"  {name} = {p.value:.4g}{interval}"
    if cause.equivalent:
        channels = f" ({', '.join(cause.equivalent_channels)})" if cause.equivalent_channels else ""
        yield f"  as likely on these runs: {', '.join(cause.equivalent)}{channels}"
    if cause.equivalent and cause.probabilities:
        odds = ", ".join(f"{name} {share:.0%}" for name, share in cause.probabilities.items())
        yield f"  probabilities: {odds}"
    if cause.separate_by:
        yield f"  to tell them apart: {cause.separate_by}"
    if cause.repair:
        yield f"  repair, a line of dataset.toml: {cause.repair}"
    if cause.gain:
        yield from _gain_lines(cause.gain)


def _gain_lines(gain: GainOnUnseen) -> Iterator[str]:
    """RMS and angle without and with, on runs not fitted to."""
    share, removed = gain.share_of_excess_removed, gain.rms_removed_dph
    part = (
        "" if share is None else f"; {share:.0%} of the removable error ({gain.low:.0%} ... {gain.high:.0%})"
    )
    yield (
        f"  RMS on runs not fitted to: {gain.exam_rms_before_dph:.4g} -> {gain.exam_rms_after_dph:.4g} deg/h, "
        f"95 % {removed.low:.2g} ... {removed.high:.2g} less{part}"
    )
    angle = gain.angle_1h_removed_arcsec
    if angle is not None:
        yield (
            f"  angle after one hour: {gain.angle_1h_before_arcsec:.4g} -> {gain.angle_1h_after_arcsec:.4g} "
            f"arcsec, 95 % {angle.low:.2g} ... {angle.high:.2g} less"
        )
