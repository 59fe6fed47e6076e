"""Fit the model of a gyro: `model.json` and `training.json` in a folder."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

from ..common.progress import Progress, silent
from ..common.threads import with_one_thread
from ..recordings.loading import load
from ..results.files import write_atomically
from ..results.folder import result_folder
from ..results.json_text import json_text
from ..train.fitting import FitOptions, Fitted, fit_dataset
from .applied import applied_in


@with_one_thread
def fit(
    source: Path,
    out: Path | None = None,
    options: FitOptions | None = None,
    *,
    axis: str | None = None,
    progress: Progress = silent,
) -> Fitted:
    """Return the model of recordings, with what was decided on the way.

    Args:
        source: Folder of recordings.
        out: Folder of the result, which is replaced as a whole; None: no files.
        options: Options of training; None: all at their defaults.
        axis: Axis of three-axis recordings.
        progress: Takes note of every stage.

    Raises:
        InputError: Bad recordings or arguments, or a file in `out` that gyrotc did not write; `out` is untouched.
    """
    with result_folder(out, "fit", inputs=[source]) if out else nullcontext() as stage:
        dataset = load(source, axis=axis, applied=applied_in(source))
        if stage:
            stage.of(dataset.serial, dataset.axis)
        options = (options or FitOptions()).with_stated(dataset.fit)
        fitted = fit_dataset(dataset, options, progress=progress)
        if stage:
            fitted.model.save(stage.folder / "model.json")
            write_atomically(stage.folder / "training.json", json_text(fitted.training.content()))
    return fitted
