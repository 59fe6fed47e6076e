"""The catalogue of causes: every module of this package that has a `CAUSE` is one.

To add a cause, write its module (see `base.Cause`); nothing else lists it.
"""

from __future__ import annotations

import pkgutil
from importlib import import_module

from .base import (
    ADVICE_MORE_RATES,
    Cause,
    CauseValues,
    History,
    Needs,
    Parameter,
    Reach,
    Scene,
    SearchRule,
    Tabled,
    Wording,
    geometric,
    lagged,
    memory_gain,
    weights_of,
)

__all__ = [
    "ADVICE_MORE_RATES",
    "CATALOGUE",
    "Cause",
    "CauseValues",
    "History",
    "Needs",
    "Parameter",
    "Reach",
    "Scene",
    "SearchRule",
    "Tabled",
    "Wording",
    "geometric",
    "lagged",
    "memory_gain",
    "register",
    "separate_by",
    "weights_of",
]

CATALOGUE: dict[str, Cause] = {}
"""Every cause by its id, in the order in which results list them."""


def register(cause: Cause) -> None:
    """Put a cause into the catalogue, by its rank.

    Raises:
        ValueError: There is a cause of this id or rank.
    """
    for other in CATALOGUE.values():
        if cause.id == other.id or cause.rank == other.rank:
            raise ValueError(f"{cause.id}, rank {cause.rank}: {other.id} has rank {other.rank}")
    ranked = sorted([*CATALOGUE.values(), cause], key=lambda c: c.rank)
    CATALOGUE.clear()
    CATALOGUE.update({c.id: c for c in ranked})


for _module in pkgutil.iter_modules(__path__):
    _cause = getattr(import_module(f"{__name__}.{_module.name}"), "CAUSE", None)
    if _cause is not None:
        register(_cause)


def separate_by(one: str, other: str) -> str:
    """The experiment that distinguishes two causes: one for this pair, else that of the more telling cause."""
    a, b = CATALOGUE[one].words, CATALOGUE[other].words
    pair = a.beside.get(other) or b.beside.get(one)
    return pair or max((a, b), key=lambda words: words.telling).experiment
