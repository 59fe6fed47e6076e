"""What a simulated data set really is: `truth.json` and the noise that was really added.

Only `evaluate` and tests open it; nothing that fits or diagnoses may.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

__all__ = ["FILE", "SCHEMA", "Truth", "read_truth", "simulated_floor"]

SCHEMA = "gyrotc.truth/1"
FILE = "truth.json"


@dataclass(frozen=True, slots=True)
class Truth:
    """The truth of one data set.

    Attributes:
        folder: The data set.
        content: `truth.json`.
    """

    folder: Path
    content: dict[str, Any]

    def noise_dph(self, file: str) -> tuple[float, NDArray[np.float64]]:
        """Noise really added to one run.

        Returns:
            Step in s (step k begins at k · step_s on the file's clock), and the mean noise of every step,
            deg/h.

        Raises:
            InputError: no such run, or its noise is missing.
        """
        runs = {run["file"]: run for run in self.content["runs"]}
        if file not in runs:
            raise InputError(str(self.folder / FILE), f"no run {file}", ", ".join(sorted(runs)))
        path = self.folder / runs[file]["noise"]
        try:
            return float(runs[file]["noise_step_s"]), np.load(path).astype(np.float64)
        except (OSError, ValueError) as error:
            raise InputError(str(path), "cannot be read", "the noise of a simulated run") from error

    def mean_noise_dph(self, file: str, average_s: float) -> NDArray[np.float64]:
        """Means over `average_s` (rounded to whole steps, at least one) of the noise of one run, deg/h."""
        step_s, noise = self.noise_dph(file)
        count = max(1, round(average_s / step_s))
        return np.asarray(noise[: len(noise) - len(noise) % count].reshape(-1, count).mean(axis=1))


def simulated_floor(folder: Path, files: Sequence[str], average_s: float) -> float | None:
    """RMS of the noise that was really added to `files`, pooled over means of `average_s`, deg/h.

    None for recordings, and where there are no files.

    Raises:
        InputError: the truth beside the data set cannot be read.
    """
    truth = read_truth(folder)
    if truth is None or not files:
        return None
    noise = np.concatenate([truth.mean_noise_dph(file, average_s) for file in files])
    return float(np.sqrt(np.mean(noise**2)))


def read_truth(folder: Path) -> Truth | None:
    """The truth of a simulated data set, None for recordings.

    Raises:
        InputError: `truth.json` is there and is not what `simulate` writes.
    """
    path = folder / FILE
    if not path.exists():
        return None
    try:
        content = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(str(path), "cannot be read", "JSON") from error
    if not isinstance(content, dict) or content.get("schema") != SCHEMA:
        raise InputError(str(path), "not the truth of a simulated data set", f'"schema": "{SCHEMA}"')
    return Truth(folder, content)
