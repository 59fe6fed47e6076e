"""Show on standard error what a job is doing, and about how long it will take."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from rich.text import Text

from ..common.texts import terminal_text
from .output import ERR, Loudness

_SILENT_S = 2.0  # before a time left is reported

Stages = Sequence[tuple[str, float]]
"""How the text of a stage begins, and its share of the time; a later text never tells less than an earlier one."""

# Shares of the time as `-v` tells it for `gyrotc simulate paper --seed 1`, two processors; a guess for other data.
FIT: Stages = (("judging rows", 0.4), ("reading", 0.1), ("training", 0.4), ("leaving out span", 0.1))
# Of a map of 512 centers; a usual one takes a tenth of a second
EMIT: Stages = (("rounding to f32", 0.2), ("rounding to q31", 0.65), ("answering the vectors", 0.15))
VERIFY: Stages = (("comparing files", 0.05), ("", 0.75), ("replaying", 0.1), ("every input", 0.1))
DIAGNOSE: Stages = (
    ("judging rows", 0.03), ("reading", 0.02), ("training", 0.02), ("leaving out span", 0.02),
    ("screening", 0.02),
    ("computing the signatures", 0.55), ("searching for causes", 0.07), ("comparing with the simulation", 0.06),
    ("measuring the gain", 0.08), ("drawing", 0.13),
)  # fmt: skip
BUILD: Stages = (
    ("judging rows", 0.09), ("reading", 0.02), ("training", 0.07), ("leaving out span", 0.02),
    ("emitting C", 0.03), ("verifying", 0.6),
    ("replaying", 0.09), ("drawing the report", 0.08),
)  # fmt: skip
COMPARE: Stages = (("reading", 0.05), ("", 0.95))
LOT: Stages = (("smoothness of the maps", 0.2), ("", 0.3), ("every unit left out", 0.4), ("without", 0.1))

_AXIS = re.compile(r"[xyz] \((\d+) of (\d+)\): ")  # of a job that does one axis after the other
_COUNTED = re.compile(r"(\d+) of (\d+)")
_FINISHED = re.compile(r"(\d+) of (\d+) gyros done")
_PERCENT = re.compile(r"(\d+) ?%")


def _words(left_s: float) -> str:
    if left_s < 120.0:
        return f"{left_s:.0f} s"
    return f"{left_s / 60.0:.0f} min" if left_s < 7200.0 else f"{left_s / 3600.0:.1f} h"


class StageLine:
    """The stage of a job that a terminal shows; its text is made anew whenever it is drawn."""

    def __init__(self, stages: Stages = ()) -> None:
        self._stages, self._begun = stages, time.monotonic()
        self._text, self._share, self._left_s, self._reported = "", 0.0, 0.0, self._begun

    def say(self, text: str) -> None:
        """Another stage, or another count within one."""
        self._text, self._reported = text, time.monotonic()
        self._share = max(self._share, self.share_of(text))
        if self._share:
            self._left_s = (self._reported - self._begun) / self._share * (1.0 - self._share)

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
        left = max(self._left_s - (now - self._reported), 0.0)
        return f"{self._text}, {int(100 * self._share)} %, about {_words(left)} left"


def _within(text: str) -> float:
    """The part of a stage that lies before its text: before the third of four it is a half, after it more."""
    if finished := _FINISHED.search(text):
        return int(finished[1]) / max(int(finished[2]), 1)
    if counted := _COUNTED.search(text):
        number, of = int(counted[1]), int(counted[2])
        return (number - 1) / of if 1 <= number <= of else 0.0
    percent = _PERCENT.search(text)
    return min(int(percent[1]), 100) / 100.0 if percent else 0.0


@contextmanager
def progress(stages: Stages = ()) -> Iterator[Callable[[str], None]]:
    """A line on stderr that says what is being done; nothing when stderr is no terminal, or with --quiet.

    From 2 s on with percent and time left, as far as `stages` or counts ("3 of 12") in the texts tell them. With
    --verbose every stage is a line of its own with the seconds since the start, also where stderr is a file.
    """
    if Loudness.verbose:
        start, said = time.monotonic(), [""]

        def line(text: str) -> None:
            if text != said[0]:
                print(f"{time.monotonic() - start:8.1f} s  {terminal_text(text)}", file=sys.stderr)
            said[0] = text

        yield line
        return
    if Loudness.quiet or not ERR.is_terminal:
        yield lambda _: None
        return
    course = StageLine(stages)
    status = ERR.status(course)

    def shown(text: str) -> None:
        course.say(text)
        status.start()  # with the first stage: a question that comes before it has the terminal for itself

    try:
        yield shown
    finally:
        status.stop()
