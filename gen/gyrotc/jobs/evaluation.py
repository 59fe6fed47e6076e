"""Evaluate a result on other recordings, and decide its limits and its uncertainty by the new figures."""

from __future__ import annotations

from pathlib import Path

from ..assess.evaluation import evaluate
from ..assess.stated import budget_again, held_again
from ..common.progress import Progress, silent
from ..model import load_model
from ..recordings.records import Dataset
from ..results.base import UnitResult, read_optional
from ..results.evaluation import Changes, Evaluation
from ..results.files import write_atomically
from ..results.json_text import json_text
from ..results.release import Budget, HeldLimits, Verification
from ..results.training import Training

FILES: dict[type[UnitResult], str] = {
    Evaluation: "evaluate.json",
    HeldLimits: "limits.json",
    Budget: "budget.json",
}
"""Files of a result that follow from the recordings that it is judged on."""
TRACE_ROWS = 2**18
"""Rows of a run in the traces that pages are drawn from: thousands for each point of a picture."""


def evaluate_again(
    folder: Path,
    dataset: Dataset,
    into: Path,
    *,
    trace: Path | None = None,
    trace_rows: int | None = None,
    progress: Progress = silent,
) -> Evaluation:
    """Evaluate the result in `folder`, and write what follows from its figures into the folder `into`.

    The limits and the instruments are those that the result was built with. A result without them gets none.

    Raises:
        InputError: As `assess.evaluate`; or limits or budget of the result are not as gyrotc wrote them.
    """
    verification = read_optional(folder / "verify.json", Verification)
    limits = read_optional(folder / "limits.json", HeldLimits)
    budget = read_optional(folder / "budget.json", Budget)
    evaluation = evaluate(folder, dataset, trace=trace, trace_rows=trace_rows, progress=progress)
    model = load_model(folder / "model.json")
    written: list[UnitResult] = [evaluation]
    if limits is not None:
        written.append(held_again(limits, model, evaluation, verification, str(folder / "limits.json")))
    if budget is not None:
        training = read_optional(folder / "training.json", Training)
        changes = read_optional(folder / "changes.json", Changes)
        where = str(folder / "budget.json")
        written.append(budget_again(budget, model, training, evaluation, verification, changes, where))
    for result in written:
        write_atomically(into / FILES[type(result)], json_text(result.content()))
    return evaluation
