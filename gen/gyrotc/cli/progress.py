"""Show on standard error what a job is doing, and about how long it will take."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.text import Text

from ..common.progress import Progress, silent
from ..common.texts import terminal_text
from .output import ERR, Loudness

_SILENT_S = 2.0  # before a time left is reported


def _words(left_s: float) -> str:
    if left_s < 120.0:
        return f"{left_s:.0f} s"
    return f"{left_s / 60.0:.0f} min" if left_s < 7200.0 else f"{left_s / 3600.0:.1f} h"


class StageLine:
    """The stage of a job that a terminal shows; its text is made anew whenever it is drawn."""

    def __init__(self) -> None:
        self._begun = time.monotonic()
        self._text, self._share, self._left_s, self._reported = "", 0.0, 0.0, self._begun

    def say(self, stage: str, done: float = 0.0, total: float = 0.0, /) -> None:
        """Take note of a stage; the share that is done never falls."""
        self._text, self._reported = stage, time.monotonic()
        if total > 0.0:
            self._share = max(self._share, min(done / total, 1.0))
        if self._share:
            self._left_s = (self._reported - self._begun) / self._share * (1.0 - self._share)

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


@contextmanager
def progress() -> Iterator[Progress]:
    """Show a line on stderr that says what is being done; nothing if stderr is no terminal, or with --quiet.

    From 2 s on it has percent and time left, if the job reports how much is done. With --verbose every stage is a line
    of its own with the seconds since the start, also if stderr is a file.
    """
    if Loudness.verbose:
        start, said = time.monotonic(), [""]

        def line(text: str, _done: float = 0.0, _total: float = 0.0, /) -> None:
            if text != said[0]:
                print(f"{time.monotonic() - start:8.1f} s  {terminal_text(text)}", file=sys.stderr)
            said[0] = text

        yield line
        return
    if Loudness.quiet or not ERR.is_terminal:
        yield silent
        return
    course = StageLine()
    status = ERR.status(course)

    def shown(text: str, done: float = 0.0, total: float = 0.0, /) -> None:
        course.say(text, done, total)
        status.start()  # with the first stage: a question that comes before it has the terminal for itself

    try:
        yield shown
    finally:
        status.stop()
