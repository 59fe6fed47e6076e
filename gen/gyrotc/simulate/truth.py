"""What a simulated data set really is: `truth.json` and the noise that was really added.

Only `evaluate` and tests open it; nothing that fits or diagnoses may.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError

__all__ = ["SCHEMA", "Truth", "read_truth"]

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
            The step in s (step k covers from k · step_s to (k + 1) · step_s on the file's clock) and the mean noise
            of every step, deg/h.

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

    def mean_noise_dph(
        self, file: str, from_s: NDArray[np.float64], to_s: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Mean noise really added between each pair of times on the file's clock, deg/h; steps are divided evenly."""
        step_s, noise = self.noise_dph(file)
        angle = np.concatenate(([0.0], np.cumsum(noise * step_s)))
        edge_s = step_s * np.arange(len(angle))
        gathered = np.interp(to_s, edge_s, angle) - np.interp(from_s, edge_s, angle)
        return np.asarray(gathered / (to_s - from_s))


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
