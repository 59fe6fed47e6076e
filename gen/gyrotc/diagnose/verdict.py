"""The verdict in one word, and why."""

from __future__ import annotations

from collections.abc import Sequence

from .attribute import Attribution
from .levels import NoiseFinding

__all__ = ["MISFIT", "SHARE", "named", "verdict_of"]

MISFIT = 0.01
SHARE = 0.8
_REMAINDER = 1e-3


def named(attribution: Attribution) -> bool:
    """Whether causes are given at all: not when most of the structure is none of them."""
    return bool(attribution.causes) and not (attribution.misfit_p < MISFIT and attribution.share < SHARE)


def verdict_of(attribution: Attribution, noise: Sequence[NoiseFinding], missing: Sequence[str]) -> str:
    """One of the verdicts of the interface.

    Args:
        attribution: What the search found.
        noise: Findings of the family `noise`.
        missing: Causes that cannot be tested; only all of them together make `not_testable`.
    """
    if attribution.detected and not named(attribution):
        return "unexplained"
    if named(attribution):
        if attribution.misfit_p < _REMAINDER:
            return "partial"
        return "ambiguous" if any(attribution.rivals) else "explained"
    if noise:
        return "noise_differs"
    return "not_testable" if missing else "consistent"
