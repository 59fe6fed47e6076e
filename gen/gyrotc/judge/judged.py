"""What a model is judged by: runs of an exam, else what was left out of training in turn, else training itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

__all__ = ["KINDS", "Judged", "Kind", "judged_by"]

Kind = Literal["exam", "left_out", "train"]

KINDS: dict[Kind, str] = {
    "exam": "exam runs, never seen in training",
    "left_out": "spans left out of training in turn",
    "train": "the training runs themselves",
}
"""The kinds in the order in which they count, and how a page says them."""


class Judged(NamedTuple):
    """The pooled figures that count, and of what they are."""

    kind: Kind
    pooled: dict[str, Any]


def judged_by(evaluation: Mapping[str, Any]) -> Judged | None:
    """The figures of an object `gyrotc.evaluate/1` by which its model is judged; None if nothing was scored."""
    return next((Judged(kind, evaluation[kind]) for kind in KINDS if evaluation.get(kind)), None)
