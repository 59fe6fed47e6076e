"""Errors of gyrotc: what the user did or gave (exit 2), and what a check found (exit 1).

Every module may import this one; it imports none of them.
"""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["CheckFailed", "GyrotcError", "InputError", "install_command", "quoted", "short_reason", "shortened"]


class GyrotcError(Exception):
    """Base of all errors that gyrotc raises on purpose. The command line turns it into one message.

    `exit_status` is what the command ends with.
    """

    exit_status = 2


class InputError(GyrotcError):
    """Bad input: a file, a model, an argument. The message names place, what was found, what was expected.

    Args:
        where: File, option or field, e.g. ``run-01.csv, line 17, column rate_dph``.
        found: What stands there.
        expected: What should stand there; empty if `found` says it all.
        details: What is wrong one by one, where `found` is a number of things; each is printed on a line of its own.
    """

    def __init__(self, where: str, found: str, expected: str = "", details: Sequence[str] = ()) -> None:
        self.where = where
        self.found = found
        self.expected = expected
        self.details = tuple(details)
        super().__init__(where, found, expected, self.details)

    @property
    def lines(self) -> tuple[str, ...]:
        """The message, and a line for each detail."""
        tail = f"; expected {self.expected}" if self.expected else ""
        return (f"{self.where}: {self.found}{tail}", *(f"  {detail}" for detail in self.details))

    def __str__(self) -> str:
        return "\n".join(self.lines)


class CheckFailed(GyrotcError):
    """The job ran and a check failed (bits differ, a bound or limit is not met): exit status 1."""

    exit_status = 1


_MAX_REASON = 120
"""Characters of what a library says, in a message of gyrotc."""


def short_reason(error: BaseException | str) -> str:
    """Return what a library says of an error, on one line and not too long for a message."""
    return " ".join(str(error).split())[:_MAX_REASON]


_MAX_QUOTED = 60
"""Characters of a name or value that is refused, in a message of gyrotc: half a line of a terminal."""


def quoted(value: object) -> str:
    """Return a value as Python writes it, not too long for a message."""
    return shortened(repr(value))


def shortened(text: str) -> str:
    """Return the beginning of a text that is too long for a message, else the text."""
    return text if len(text) <= _MAX_QUOTED else text[: _MAX_QUOTED - 3] + "..."


def install_command(extra: str) -> str:
    """The command that installs an extra of gyrotc, as a shell takes it."""
    return f'pip install "gyrotc[{extra}]"'
