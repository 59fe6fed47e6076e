"""The verdict in one word, and why."""

from __future__ import annotations

from collections.abc import Sequence

from ..results.diagnosed import DiagnosisVerdict
from .attribution import Attribution
from .candidates import shape_parameter
from .declared_noise import NoiseFinding

__all__ = ["holds", "looks_like", "verdict_of"]

_MISFITS = ((0.05, 0.5), (0.01, 0.8))
"""p-value of what is left (`Misfit.worst`), and share of the structure below which the causes then explain too little.

However clear the remainder: where four fifths are a cause and no other shape does better, it is that cause in another
form than the catalogue's (relays in place of a play), and the remainder is told beside it.
"""

_REMAINDER = 1e-3  # p-value of what is left below which "explained" would claim too much
_SEEN = 0.05  # p-value over the whole search that at least one of the causes has itself
_LEAD = -2.0  # lead of a shape that no cause has, from which the causes do not hold their own


def holds(attribution: Attribution) -> bool:
    """Whether causes are given at all.

    Not where most of the structure is none of them, where it has another shape or a parameter that no gyro has, and
    not where the search sees none of them: something else was detected then, in the place of which they came.
    """
    left = attribution.left
    little = any(left.worst < p and left.share < share for p, share in _MISFITS)
    plausible = bool(attribution.causes) and all(cause.plausible for cause in attribution.causes)
    seen = min(attribution.p_values, default=1.0) <= _SEEN
    return plausible and seen and not little and attribution.other.lead < _LEAD


def verdict_of(attribution: Attribution, noise: Sequence[NoiseFinding]) -> DiagnosisVerdict:
    """One of the verdicts of the interface; `not_testable` is given before any search.

    Args:
        attribution: What the search found.
        noise: Findings of the family `noise`.
    """
    if attribution.detected and not holds(attribution):
        return "unexplained"
    if holds(attribution):
        if attribution.left.p_value < _REMAINDER:
            return "partial"
        return "ambiguous" if any(attribution.rivals) else "explained"
    return "noise_differs" if noise else "consistent"


def looks_like(attribution: Attribution) -> str | None:
    """What structure without a name resembles: another shape, or a cause with a parameter that no gyro has."""
    if attribution.other.lead > 0.0:
        return attribution.other.name
    for cause in attribution.causes:
        parameter = shape_parameter(cause.candidate.id)
        if parameter is not None and not cause.plausible:
            value = f"{parameter.name} = {cause.parameters[parameter.name].value:.2g} {parameter.unit}"
            known = f"{parameter.low:g} to {parameter.high:g} {parameter.unit} are known"
            return f"{cause.candidate.id.replace('_', ' ')} with {value}, where {known}"
    return None
