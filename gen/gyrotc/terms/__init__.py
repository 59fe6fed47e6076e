"""The catalogue of causes: every module of this package that has a `TERM` is one.

To add a cause, write its module (see `base.Term`); nothing else lists it.
"""

from __future__ import annotations

import pkgutil
from importlib import import_module

from .base import Features, History, Needs, Parameter, Scene, Term

__all__ = [
    "CATALOGUE",
    "Features",
    "History",
    "Needs",
    "Parameter",
    "Scene",
    "Term",
    "register",
    "separate_by",
]


CATALOGUE: dict[str, Term] = {}
"""Every cause by its id, in the order in which results list them."""


def register(term: Term) -> None:
    """Puts a cause into the catalogue, by its rank.

    Raises:
        ValueError: There is a cause of this id or rank.
    """
    for other in CATALOGUE.values():
        if term.id == other.id or term.rank == other.rank:
            raise ValueError(f"{term.id}, rank {term.rank}: {other.id} has rank {other.rank}")
    ranked = sorted([*CATALOGUE.values(), term], key=lambda t: t.rank)
    CATALOGUE.clear()
    CATALOGUE.update({t.id: t for t in ranked})


for _module in pkgutil.iter_modules(__path__):
    _term = getattr(import_module(f"{__name__}.{_module.name}"), "TERM", None)
    if _term is not None:
        register(_term)


def separate_by(one: str, other: str) -> str:
    """The experiment that tells two causes apart: one for this pair, else that of the more telling cause."""
    a, b = CATALOGUE[one].words, CATALOGUE[other].words
    pair = a.beside.get(other) or b.beside.get(one)
    return pair or max((a, b), key=lambda words: words.telling).experiment
