"""Make the prior of a unit's recalibration from an earlier calibration (`--prior DIR`)."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import date
from pathlib import Path

from ..assess.budget import DAYS_A_YEAR, yearly_drifts
from ..assess.changes import Earlier, load_earlier, started_on
from ..assess.limits import Limits
from ..common.errors import InputError
from ..recordings.records import Dataset
from ..results.base import read_result
from ..results.training import Training
from ..train.fitting import FitOptions
from ..train.prior.earlier import EarlierPrior, posterior_of_result, widened


def prior_from(folder: Path, dataset: Dataset, limits: Limits | None) -> EarlierPrior:
    """Return what an earlier result says of a unit today.

    Args:
        folder: What `gyrotc build` wrote of the same gyro.
        dataset: The recordings of the check run.
        limits: Limits of the product; the drift of the type in them says how far the bias may have moved since, else
            the earlier calibrations of the unit do.

    Raises:
        InputError: It is of another gyro, cannot be read, or is made from the same recordings.
    """
    earlier = load_earlier(folder, dataset.serial, dataset.axis, "--prior")
    seen = {d.sha256 for d in earlier.model.data}
    for run in dataset.runs:
        if run.role == "train" and run.sha256 in seen:
            raise InputError(run.file, f"the model in {folder} was made from it", "recordings of its own")
    where = earlier.folder / "training.json"
    posterior = posterior_of_result(read_result(where, Training), where)
    ageing_dph, source = _ageing(earlier, dataset, limits)
    return widened(posterior, ageing_dph, source, earlier.model.hash, earlier.date)


def refuse_together(options: FitOptions, prior: Path | None) -> None:
    """Refuse an earlier result in addition to a lot.

    Raises:
        InputError: Both are named.
    """
    if prior is not None and options.prior is not None:
        found = "with --prior: what the lot knew of the unit is in its earlier model already"
        raise InputError("--lot", found, "one of the two")


def with_prior(options: FitOptions, dataset: Dataset, folder: Path | None, limits: Limits | None) -> FitOptions:
    """Return options of a fit with the prior of an earlier result; unchanged if none is named.

    Raises:
        InputError: As `prior_from`.
    """
    if folder is None:
        return options
    return replace(options, prior=prior_from(folder, dataset, limits))


def _ageing(earlier: Earlier, dataset: Dataset, limits: Limits | None) -> tuple[float, str]:
    """Return the standard deviation of the drift of the bias, deg/h, and the source of this figure."""
    try:
        then, now = (date.fromisoformat(str(day)[:10]) for day in (earlier.date, started_on(dataset)))
    except ValueError:
        return 0.0, "none: a calibration has no date, which is `started` of its runs"
    years = max((now - then).days, 0) / DAYS_A_YEAR
    drift = limits.interval.drift_dph_per_year if limits and limits.interval else None
    if drift is not None:
        return drift * years / math.sqrt(3.0), "the type's largest drift, by the limits file"
    drifts = yearly_drifts(earlier.history)
    if not drifts:
        return 0.0, "none: neither a drift of the type, nor earlier calibrations"
    drift = math.sqrt(math.fsum(d**2 for d in drifts) / len(drifts))
    return drift * years, f"by {len(drifts) + 1} earlier calibrations"
