"""Signals that end a job: they raise an exception, and wait while a result takes its place."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interrupted(BaseException):
    """A signal asked the process to end. No `Exception`: nothing but clean-up may catch it."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.number = number


class _State:
    depth = 0
    waiting: int | None = None


def interruption_in(error: BaseException) -> Interrupted | None:
    """Return the signal behind an error: some libraries make an error of their own of whatever ends their import."""
    behind: list[BaseException] = [error]
    for one in behind:  # grows by what each was made of; an error may name itself
        if isinstance(one, Interrupted):
            return one
        behind += [e for e in (one.__cause__, one.__context__) if e is not None and e not in behind]
    return None


def raise_on_signals() -> None:
    """Let SIGINT, SIGTERM and SIGHUP raise `Interrupted` in the main thread; a signal that is ignored stays so."""
    for number in _ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _on_signal)


def _on_signal(number: int, _frame: FrameType | None) -> None:
    for other in _ENDING:  # the clean-up that now begins is not interrupted again
        signal.signal(other, signal.SIG_IGN)
    if _State.depth:
        _State.waiting = number
    else:
        raise Interrupted(number)


@contextmanager
def deferred() -> Iterator[None]:
    """Let a signal wait until the outermost block has ended. Other threads are never interrupted."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _State.depth += 1
    try:
        yield
    finally:
        _State.depth -= 1
        if _State.depth == 0 and _State.waiting is not None:
            number, _State.waiting = _State.waiting, None
            raise Interrupted(number)


def die_of(number: int) -> None:
    """End the process by the signal itself, so that a shell sees 128 + number and stops its loop."""
    signal.signal(number, signal.SIG_DFL)
    os.kill(os.getpid(), number)
