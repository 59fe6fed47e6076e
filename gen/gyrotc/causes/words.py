"""What reports say of a cause, and the experiment that tells two causes apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum

__all__ = ["Telling", "Wording"]


class Telling(IntEnum):
    """How much the experiment of a cause tells: that of the more telling one of a pair is proposed."""

    LITTLE = 0
    STATIC = 1
    CHANNEL = 2
    REPEATS = 3
    COLD_START = 4
    DIRECTION = 5


@dataclass(frozen=True, slots=True)
class Wording:
    """The words of a cause in reports.

    Attributes:
        name: One clause.
        short: At most eight letters, for the head of a column.
        signature: How it shows in the residuals.
        remedy: What to do about it.
        experiment: What tells it from other causes.
        telling: How much that tells.
        beside: The experiment that tells it from one certain cause, by id of that cause.
        recording: What to record so that it can be tested; empty where any recording will do.
        advice: What to do when it is found, besides the remedy; a sentence, or empty.
    """

    name: str
    short: str
    signature: str
    remedy: str
    experiment: str
    telling: Telling = Telling.LITTLE
    beside: Mapping[str, str] = field(default_factory=dict)
    recording: str = ""
    advice: str = ""
