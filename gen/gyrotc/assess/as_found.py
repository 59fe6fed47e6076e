"""State as found: the correction that a unit carried, on the recordings of its new calibration; and its history."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..common.errors import GyrotcError
from ..model import Model
from ..recordings.records import Dataset
from ..results.base import read_optional
from ..results.changes import Apart, AsFound, Calibration
from ..results.evaluation import Evaluation
from ..results.verification import Verification
from .evaluate import evaluate
from .limits import Limits, held_against

if TYPE_CHECKING:
    from .changes import Earlier

__all__ = ["as_found", "history_of"]


def as_found(
    earlier: Earlier, dataset: Dataset, limits: Limits | None, average_s: float
) -> tuple[AsFound | None, str]:
    """The earlier correction on new recordings, by the reference (the same as the compiled code, bit for bit).

    Returns:
        It, or None and the reason.
    """
    seen = {(d.file, d.sha256) for d in earlier.model.data}
    if any((run.file, run.sha256) in seen for run in dataset.runs):
        return None, "the earlier correction was made from recordings that are among these"
    try:
        found = evaluate(earlier.folder, dataset, average_s=average_s, compiled=False)
        known = earlier.evaluation  # of its training: the new recordings say nothing about it
        update = {"generalises": known.generalises, "rows_left_out": known.rows_left_out} if known else {}
        found = found.model_copy(update=update)
        verification = read_optional(earlier.folder / "verify.json", Verification)
        held = held_against(limits, earlier.model, found, verification) if limits else None
    except (GyrotcError, OSError) as error:
        return None, str(error)
    exam = found.exam is not None
    figures = found.exam or found.train
    if figures is None:
        return None, "no sample of the recordings can be judged"
    return AsFound(judged_on="exam" if exam else "train", figures=figures, limits=held), ""


def history_of(
    earlier: Earlier,
    model: Model,
    evaluation: Evaluation,
    found: AsFound | None,
    moved: Apart | None,
    date: str | None,
) -> tuple[Calibration, ...]:
    """The earlier result's calibrations, and this one."""
    known = earlier.history or (_calibration(earlier.model, earlier.evaluation, None, None, earlier.date),)
    return (*known, _calibration(model, evaluation, found, moved, date))


def _calibration(
    model: Model, evaluation: Evaluation | None, found: AsFound | None, moved: Apart | None, date: str | None
) -> Calibration:
    judged = evaluation.judged() if evaluation else None
    return Calibration(
        date=date,
        model_hash=model.hash,
        as_found_rms_dph=found.figures.after.rms_dph if found else None,
        as_left_rms_dph=judged[1].after.rms_dph if judged else None,
        moved_rms_dph=moved.rms_dph if moved else None,
        moved_mean_dph=moved.mean_dph if moved else None,
        expanded_uncertainty_dph=moved.expanded_uncertainty_dph if moved else None,
        significant=moved.significant if moved else None,
    )
