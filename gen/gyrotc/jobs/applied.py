"""Find the correction that was subtracted while recordings were made, so that it can be added back."""

from __future__ import annotations

from pathlib import Path

from ..recordings.loading import applied_model
from ..recordings.records import Applied


def applied_in(dataset: Path) -> Applied | None:
    """Return the correction of the model that a data set names; None if it names none.

    Raises:
        InputError: The model cannot be read, or its tables cannot be made.
    """
    model = applied_model(dataset)
    if model is None:
        return None
    from ..tables.quantisation import applied_of  # most recordings are raw: they do without what makes tables

    return applied_of(model)
