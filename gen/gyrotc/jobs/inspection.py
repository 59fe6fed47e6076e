"""Check recordings as `fit` would read them, also against an earlier result of the gyro."""

from __future__ import annotations

from pathlib import Path

from ..assess.changes import earlier_models
from ..common.progress import Progress, silent
from ..common.threads import with_one_thread
from ..quality.inspection import CheckResult
from ..quality.inspection import check as _check
from .applied import applied_in


@with_one_thread
def check(
    source: Path, *, axis: str | None = None, previous: Path | None = None, progress: Progress = silent
) -> CheckResult:
    """Return all errors and warnings about recordings.

    Args:
        source: Folder of recordings.
        axis: Axis of three-axis recordings; None or "all": every one.
        previous: An earlier result of this gyro, to see whether sign and axes are as they were.
        progress: Takes note of every stage.

    Raises:
        InputError: The earlier result cannot be read, or is of another gyro.
    """
    earlier = earlier_models(previous) if previous else None
    return _check(source, axis=axis, applied=applied_in(source), earlier=earlier, progress=progress)
