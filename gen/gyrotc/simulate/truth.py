"""The truth of a simulated data set: `truth.json` and the noise that was really added.

Only `evaluate` and tests open them; nothing that fits or diagnoses may.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..common.errors import InputError, quoted
from ..common.inputs import read_input
from ..results.base import read_optional
from ..results.recordings import SimulatedTruth

TRUTH_FILE = "truth.json"

# What numpy.save writes of one dimension (NEP 1); matched, not evaluated.
_HEAD = re.compile(
    rb"\x93NUMPY\x01\x00..\{'descr': '<f(?P<size>[48])', 'fortran_order': False, "
    rb"'shape': \((?P<count>[0-9]{1,12}),\), \} *\n",
    re.DOTALL,
)


def simulated_floor(folder: Path, files: Sequence[str], average_s: float) -> float | None:
    """Return the RMS of the noise that was really added to `files`, pooled over means of `average_s`, deg/h.

    It is None for measured recordings, and if there are no files.

    Raises:
        InputError: the truth beside the data set cannot be read.
    """
    truth = read_truth(folder)
    if truth is None or not files:
        return None
    noise = np.concatenate([truth.mean_noise_dph(file, average_s) for file in files])
    return float(np.sqrt(np.mean(noise**2)))


def read_truth(folder: Path) -> Truth | None:
    """Return the truth of a simulated data set, None for measured recordings.

    Raises:
        InputError: `truth.json` is there and is not what `simulate` writes.
    """
    content = read_optional(folder / TRUTH_FILE, SimulatedTruth)
    return Truth(folder, content) if content else None


@dataclass(frozen=True, slots=True)
class Truth:
    """The truth of one data set.

    Attributes:
        folder: The data set.
        content: Content of `truth.json`.
    """

    folder: Path
    content: SimulatedTruth

    def noise_dph(self, file: str) -> tuple[float, NDArray[np.float64]]:
        """Return the noise that was really added to one run.

        Returns:
            Step in s (step k begins at k · step_s on the file's clock), and the mean noise of every step,
            deg/h.

        Raises:
            InputError: no such run, or its noise is missing.
        """
        runs = {run.file: run for run in self.content.runs}
        if file not in runs:
            raise InputError(str(self.folder / TRUTH_FILE), f"no run {file}", ", ".join(sorted(runs)))
        name = Path(runs[file].noise)
        if name.is_absolute() or ".." in name.parts:
            where = f"{self.folder / TRUTH_FILE}, run {file}, field noise"
            raise InputError(where, quoted(str(name)), "a file in the folder of the data set")
        return runs[file].noise_step_s, _array(self.folder / name)

    def mean_noise_dph(self, file: str, average_s: float) -> NDArray[np.float64]:
        """Return means over `average_s` (rounded to whole steps, at least one) of the noise of one run, deg/h.

        Raises:
            InputError: no such run, or its noise is missing or shorter than one mean.
        """
        step_s, noise = self.noise_dph(file)
        count = max(1, round(average_s / step_s))
        if len(noise) < count:
            where = f"{self.folder / TRUTH_FILE}, run {file}"
            raise InputError(where, f"noise of {len(noise) * step_s:g} s", f"{average_s:g} s at least")
        return np.asarray(noise[: len(noise) - len(noise) % count].reshape(-1, count).mean(axis=1))


def _array(path: Path) -> NDArray[np.float64]:
    """Return the finite numbers of an .npy file of one dimension.

    Raises:
        InputError: It holds anything else; also where its head promises more than the file holds.
    """
    expected = "the noise of a simulated run"
    data = read_input(path, "recording_mib", expected)
    head = _HEAD.match(data)
    if head is None or int(head["count"]) * int(head["size"]) != len(data) - head.end():
        raise InputError(str(path), "is no whole array of numbers", expected)
    values = np.frombuffer(data[head.end() :], dtype=f"<f{int(head['size'])}").astype(np.float64)
    if not np.isfinite(values).all():
        raise InputError(str(path), "a number that is not finite", expected)
    return values
