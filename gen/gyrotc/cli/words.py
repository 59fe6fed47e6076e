"""Words that options take: a shell completes them, and a wrong one is answered with the list of the right ones.

They repeat literal types of modules that are too slow to import for `--help`; a test compares both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum


class RunFormat(str, Enum):
    """Format of the files of a data set."""

    csv = "csv"
    parquet = "parquet"


class ExportFormat(str, Enum):
    """What `gyrotc export` writes."""

    px4 = "px4"
    ardupilot = "ardupilot"
    csv = "csv"
    json = "json"
    a2l = "a2l"
    cdf = "cdf"
    fmu = "fmu"


class NoiseLevel(str, Enum):
    """Noise of a simulated gyro whose scenario states none."""

    paper = "paper"
    class_ = "class"


class GyroAxis(str, Enum):
    """Axis of a gyro."""

    x = "x"
    y = "y"
    z = "z"


class Shell(str, Enum):
    """Shells that `gyrotc completion` has a script for."""

    bash = "bash"
    zsh = "zsh"
    fish = "fish"


def completing(words: Sequence[str]) -> Callable[[str], list[str]]:
    """The completion of an option whose values the job itself checks: a list of words, or an axis of the data."""

    def begun(incomplete: str) -> list[str]:
        return [word for word in words if word.startswith(incomplete)]

    return begun
