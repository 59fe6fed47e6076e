"""How far a job is, from the texts of its stages: percent, and the time that is left."""

from __future__ import annotations

import re
import time
from collections.abc import Sequence

from rich.text import Text

from ..common.texts import terminal_text

__all__ = [
    "BUILD",
    "COMPARE",
    "DIAGNOSE",
    "EMIT",
    "FIT",
    "LOT",
    "PLAN",
    "VERIFY",
    "StageLine",
    "Stages",
    "time_left",
]

_SILENT_S = 2.0  # before a time left is told

Stages = Sequence[tuple[str, float]]
"""How the text of a stage begins, and its share of the time; a later text never tells less than an earlier one."""

# Shares of the time as `-v` tells it for `gyrotc simulate paper --seed 1`, two processors; a guess for other data.
FIT: Stages = (("reading", 0.5), ("training", 0.3), ("leaving out span", 0.2))
# Of a map of 512 centers; a usual one takes a tenth of a second
EMIT: Stages = (("rounding to f32", 0.2), ("rounding to q31", 0.65), ("answering the vectors", 0.15))
VERIFY: Stages = (("comparing files", 0.05), ("", 0.75), ("replaying", 0.1), ("every input", 0.1))
DIAGNOSE: Stages = (
    ("reading", 0.05), ("training", 0.02), ("leaving out span", 0.02), ("screening", 0.02),
    ("computing the signatures", 0.55), ("searching for causes", 0.07), ("comparing with the simulation", 0.06),
    ("measuring the gain", 0.08), ("drawing", 0.13),
)  # fmt: skip
BUILD: Stages = (
    ("reading", 0.04), ("training", 0.04), ("leaving out span", 0.04), ("emitting C", 0.01), ("verifying", 0.77),
    ("replaying", 0.03), ("drawing the report", 0.07),
)  # fmt: skip
PLAN: Stages = (
    ("simulating the profile", 0.1), ("computing signatures", 0.3), ("comparing causes", 0.2),
    ("trying further thermometers", 0.1), ("looking for the shortest profile", 0.2), ("trying further runs", 0.1),
)  # fmt: skip
COMPARE: Stages = (("reading", 0.05), ("", 0.95))
LOT: Stages = (("smoothness of the maps", 0.2), ("", 0.3), ("every unit left out", 0.4), ("without", 0.1))

_AXIS = re.compile(r"[xyz] \((\d+) of (\d+)\): ")  # of a job that does one axis after the other
_COUNTED = re.compile(r"(\d+) of (\d+)")
_PERCENT = re.compile(r"(\d+) ?%")


def time_left(done: float, total: float, elapsed_s: float) -> str:
    """Percent, and the time that the rest will take if it goes on like this; empty for the first two seconds."""
    if elapsed_s < _SILENT_S or done <= 0.0:
        return ""
    return f", {int(100 * done / total)} %, about {_words(elapsed_s / done * (total - done))} left"


def _words(left_s: float) -> str:
    if left_s < 120.0:
        return f"{left_s:.0f} s"
    return f"{left_s / 60.0:.0f} min" if left_s < 7200.0 else f"{left_s / 3600.0:.1f} h"


class StageLine:
    """The stage of a job that a terminal shows; its text is made anew whenever it is drawn."""

    def __init__(self, stages: Stages = ()) -> None:
        self._stages, self._begun = stages, time.monotonic()
        self._text, self._share, self._left_s, self._told = "", 0.0, 0.0, self._begun

    def say(self, text: str) -> None:
        """Another stage, or another count within one."""
        self._text, self._told = text, time.monotonic()
        self._share = max(self._share, self.share_of(text))
        if self._share:
            self._left_s = (self._told - self._begun) / self._share * (1.0 - self._share)

    def share_of(self, text: str) -> float:
        """Which part of the work lies before what a text says, 0 ... 1; 0 where it says nothing of it."""
        if axis := _AXIS.match(text):
            number, of = int(axis[1]), max(int(axis[2]), 1)
            return (number - 1 + self.share_of(text[axis.end() :])) / of
        if not self._stages:
            return _within(text)
        before = 0.0
        place = max((name for name, _ in self._stages if text.startswith(name)), key=len, default=None)
        for name, share in self._stages:
            if name == place:
                return before + share * _within(text)
            before += share
        return 0.0

    def __rich__(self) -> Text:
        return Text(terminal_text(self.line(time.monotonic())))

    def line(self, now: float) -> str:
        """The text with percent and time left, or, where that is not known, with the time since the start."""
        if now - self._begun < _SILENT_S:
            return self._text
        if not self._share:
            return f"{self._text}, {now - self._begun:.0f} s"
        left = max(self._left_s - (now - self._told), 0.0)
        return f"{self._text}, {int(100 * self._share)} %, about {_words(left)} left"


def _within(text: str) -> float:
    """The part of a stage that lies before its text: before the third of four it is a half."""
    if counted := _COUNTED.search(text):
        number, of = int(counted[1]), int(counted[2])
        return (number - 1) / of if 1 <= number <= of else 0.0
    percent = _PERCENT.search(text)
    return min(int(percent[1]), 100) / 100.0 if percent else 0.0
