"""Cases that hypothesis draws: the same in every run; with HYPOTHESIS_PROFILE=explore new ones, and many more."""

from __future__ import annotations

import os

from hypothesis import HealthCheck, Phase, settings

_EXPLORES = os.environ.get("HYPOTHESIS_PROFILE") == "explore"
# How many times as many cases are drawn to explore.
_EXPLORED = 30

settings.register_profile(
    "explore" if _EXPLORES else "fixed",
    derandomize=not _EXPLORES,
    database=None,
    deadline=None,
    print_blob=True,
    suppress_health_check=list(HealthCheck),
)
settings.load_profile("explore" if _EXPLORES else "fixed")


def examples(number: int, *, shrink: bool = True) -> settings:
    """Decorate a property with the number of cases that `make test` draws.

    Properties whose cases take seconds leave a failing case as it was drawn: to shrink it would take minutes.
    """
    phases = tuple(Phase) if shrink else (Phase.explicit, Phase.reuse, Phase.generate)
    return settings(max_examples=number * (_EXPLORED if _EXPLORES else 1), phases=phases)
