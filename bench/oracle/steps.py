"""Commands of gyrotc run one after the other in a folder, and what each of them leaves."""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .normalise import content_of

Outcome = dict[str, Any]

# Of an internal fault: its number is a hash of places in the source, its file has a name drawn at random.
_OF_FAULTS = re.compile(r"(?<=internal fault )\w+|(?<=please send )\S+")


class Steps:
    """The steps of a set of recordings, in a folder of their own, which is the working directory meanwhile.

    Commands run in this process by the command's entry point, so that a start-up of a second is paid once; nothing
    else of gyrotc is imported. Paths are relative, so that no message names the temporary folder.

    Attributes:
        folder: Where everything lies.
        measured: The folder of measured recordings.
        outcomes: Of each step, by its name: exit status and printed lines as "printed", and files that changed by name.
    """

    def __init__(self, folder: Path, measured: Path) -> None:
        self.folder = folder
        self.measured = measured
        self.outcomes: dict[str, Outcome] = {}
        self._seen: dict[str, str] = {}

    def run(self, *arguments: object, name: str = "") -> None:
        """A command line; the step is called like the command if no name is given."""
        words = [str(word) for word in arguments]
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with _inside(self.folder):
                status = _gyrotc(words)
        self._note(name or words[0], status=status, out=_lines(out), err=_lines(err))

    def write(self, what: Callable[[Path], object], *, name: str = "recordings") -> None:
        """Files that no command makes; they are compared as well, so that a changed input is reported as such."""
        what(self.folder)
        self._note(name)

    def _note(self, name: str, **reported: Any) -> None:
        if name in self.outcomes:
            raise ValueError(f"two steps are called {name}")
        before, self._seen = self._seen, {}
        changed: dict[str, Any] = {}
        for path in sorted(p for p in self.folder.rglob("*") if p.is_file()):
            where = path.relative_to(self.folder).as_posix()
            self._seen[where] = hashlib.sha256(path.read_bytes()).hexdigest()
            if before.get(where) != self._seen[where]:
                changed[where] = content_of(path)
        changed |= dict.fromkeys(before.keys() - self._seen.keys(), "removed")
        self.outcomes[name] = ({"printed": reported} if reported else {}) | changed


@contextlib.contextmanager
def _inside(folder: Path) -> Any:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def _gyrotc(words: list[str]) -> int:
    from gyrotc.cli import main

    return main.run(words)


def _lines(stream: io.StringIO) -> list[str]:
    return [_OF_FAULTS.sub("...", line).rstrip() for line in stream.getvalue().splitlines()]
