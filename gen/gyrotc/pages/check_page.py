"""The page of `gyrotc check --plots`: every problem and doubt with its rows, a picture, and what to do next."""

from __future__ import annotations

from itertools import chain
from pathlib import Path

from ..quality.check import CheckResult
from ..quality.pictured import pictured
from ..store.folder import write_result
from .check_plots import picture
from .report import page_environment

__all__ = ["write_check_page"]

_MOST = 100  # pictures of one page


def write_check_page(path: Path, folder: Path, result: CheckResult) -> None:
    """Writes the page of a check of `folder`.

    Raises:
        InputError: There is a file at `path` that gyrotc did not write, or a recording changed meanwhile.
    """
    of_problems, of_doubts = pictured(folder, result)
    left = _MOST
    drawn: list[list[str]] = []
    for pictures in chain(of_problems, of_doubts):
        drawn.append([picture(one) for one in pictures[: max(left, 0)]])
        left -= len(pictures)
    problems = list(
        zip(result.problems, (result.marks.get(str(p), ()) for p in result.problems), drawn, strict=False)
    )
    doubts = list(zip(result.doubts, drawn[len(problems) :], strict=True))
    text = (
        page_environment()
        .get_template("check.html.j2")
        .render(result=result, problems=problems, doubts=doubts, folder=str(folder), more=max(-left, 0))
    )
    write_result(path, text)
