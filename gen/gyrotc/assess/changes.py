"""Changes of a build since an earlier one of the same gyro, with the state of the unit as found.

A gyro that is calibrated again should give nearly the same map. Where it does not, the difference over the
envelope is the drift of the gyro, of its temperature sensor or of the procedure, and belongs into the report.
"""

from __future__ import annotations

from collections.abc import Iterator, Set
from pathlib import Path

import numpy as np

from .. import __version__
from ..common.errors import GyrotcError, InputError
from ..model import Model, load_model
from ..recordings.loading import calibration_day
from ..recordings.records import Dataset
from ..results.base import read_optional
from ..results.evaluation import (
    AsFound,
    At,
    Calibration,
    Changes,
    Envelopes,
    Evaluation,
    FigureChange,
    FileChanges,
    MapDifference,
    NameChanges,
    TextChange,
)
from ..results.release import Verification
from ..results.training import Manifest, Training
from .evaluation import evaluate, name_of
from .limits import Limits, held_against


def as_found(earlier: Earlier, dataset: Dataset, limits: Limits | None, average_s: float) -> tuple[AsFound | None, str]:
    """The earlier correction on new recordings, by the reference (the same as the compiled code, bit for bit).

    Returns:
        It, or None and the reason.
    """
    seen = {(d.file, d.sha256) for d in earlier.model.data}
    if any((run.file, run.sha256) in seen for run in dataset.runs):
        return None, "the earlier correction was made from recordings that are among these"
    try:
        found = evaluate(earlier.folder, dataset, average_s=average_s, compiled=False)
        verification = read_optional(earlier.folder / "verify.json", Verification)
        held = held_against(limits, earlier.model, found, verification) if limits else None
    except (GyrotcError, OSError) as error:
        return None, str(error)
    exam = found.exam is not None
    figures = found.exam or found.train
    if figures is None:
        return None, "no sample of the recordings can be judged"
    return AsFound(judged_on="exam" if exam else "train", figures=figures, limits=held), ""


def calibration_history(
    earlier: Earlier,
    model: Model,
    evaluation: Evaluation,
    found: AsFound | None,
    moved: MapDifference | None,
    date: str | None,
) -> tuple[Calibration, ...]:
    """The earlier result's calibrations, and this one."""
    known = earlier.history or (_calibration(earlier.model, earlier.evaluation, None, None, earlier.date),)
    return (*known, _calibration(model, evaluation, found, moved, date))


def _calibration(
    model: Model, evaluation: Evaluation | None, found: AsFound | None, moved: MapDifference | None, date: str | None
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


_GRID = (61, 25)  # points of T and of dT/dt over the common envelope


class Earlier:
    """An earlier result: its model and the results beside it (None where a file is not there)."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.model = load_model(folder / "model.json")
        self.evaluation = read_optional(folder / "evaluate.json", Evaluation)
        self.manifest = read_optional(folder / "manifest.json", Manifest)
        changes = read_optional(folder / "changes.json", Changes)
        self.history = changes.history if changes else ()
        self.date = self.model.calibrated_on


def load_earlier(folder: Path, serial: str, axis: str | None, option: str = "--previous") -> Earlier:
    """Read an earlier result folder of a gyro, or of one of its axes if it has several.

    Args:
        folder: The result.
        serial, axis: Of the gyro.
        option: By which it was named.

    Raises:
        InputError: There is none, it is of another gyro or axis, or a file of it cannot be read.
    """
    if axis is not None and not (folder / "model.json").is_file() and (folder / axis).is_dir():
        folder = folder / axis
    if not (folder / "model.json").is_file():
        raise InputError(f"{option} {folder}", "has no model.json", "a folder that gyrotc build wrote")
    earlier = Earlier(folder)
    old = earlier.model
    if (old.serial, old.axis) != (serial, axis):
        raise InputError(f"{option} {folder}", f"is of {name_of(old.serial, old.axis)}", name_of(serial, axis))
    return earlier


def earlier_models(folder: Path) -> dict[str, Model]:
    """Return the models of an earlier result by axis; "" if it has one rate.

    Raises:
        InputError: There is none, or one cannot be read.
    """
    places = [folder, *(folder / axis for axis in ("x", "y", "z"))]
    models = [load_model(place / "model.json") for place in places if (place / "model.json").is_file()]
    if not models:
        raise InputError(f"--previous {folder}", "has no model.json", "a folder that gyrotc build wrote")
    return {model.axis or "": model for model in models}


def changes_since(
    earlier: Earlier,
    model: Model,
    evaluation: Evaluation,
    manifest: Manifest,
    *,
    training: Training | None = None,
    dataset: Dataset | None = None,
    limits: Limits | None = None,
) -> Changes:
    """Compare a result with an earlier one.

    Args:
        training: Of the new result: where it was made with the earlier model, it says how far the map has moved.
        dataset: The new recordings, to say how the unit was found.
        limits: Limits of the product, which hold for the state as found as well.
    """
    old = earlier.model
    moved = _moved(old, model, training) or _map(old, model, _of_means(earlier.evaluation, evaluation))
    found, missing = (None, "not asked for")
    if dataset is not None:
        found, missing = as_found(earlier, dataset, limits, evaluation.average_s)
    before, after = _ids(earlier.evaluation), _ids(evaluation)
    return Changes(
        gyrotc_version=__version__,
        serial=model.serial,
        axis=model.axis,
        same_model=old.hash == model.hash,
        model_hash=TextChange(before=old.hash, after=model.hash),
        recordings=_changed_hashes(*({d.file: d.sha256 for d in m.data} for m in (old, model))),
        map=moved,
        envelope=Envelopes.of(
            temperature_c=(old.envelope.temperature_c, model.envelope.temperature_c),
            slope_c_per_min=(old.envelope.slope_c_per_min, model.envelope.slope_c_per_min),
        ),
        figures=dict(_figures(earlier, model, evaluation)),
        findings=NameChanges(new=_only(after, before), gone=_only(before, after)),
        versions=dict(_versions(earlier.manifest, manifest)),
        files=_changed_hashes(*(_emitted(m) for m in (earlier.manifest, manifest))),
        as_found=found,
        as_found_missing=missing,
        history=calibration_history(
            earlier, model, evaluation, found, moved, model.calibrated_on or started_on(dataset)
        ),
    )


def started_on(dataset: Dataset | None) -> str | None:
    """Return the day of the last recording; None if the recordings carry no dates."""
    return calibration_day({}, (run.started for run in dataset.runs)) if dataset else None


def _only(names: Set[str], others: Set[str]) -> tuple[str, ...]:
    return tuple(sorted(names - others))


def _changed_hashes(before: dict[str, str], after: dict[str, str]) -> FileChanges:
    """Compare hashes of files by name: new, gone, and with other bytes."""
    other = sorted(name for name in before.keys() & after.keys() if before[name] != after[name])
    return FileChanges(
        new=_only(after.keys(), before.keys()), gone=_only(before.keys(), after.keys()), other_bytes=tuple(other)
    )


def _of_means(*evaluations: Evaluation | None) -> float | None:
    """Standard uncertainty of the difference of the means of what remains; None where one is not known."""
    variance = 0.0
    for evaluation in evaluations:
        known = (evaluation.uncertainty or {}).get("mean_dph") if evaluation else None
        if known is None:
            return None
        variance += known.standard**2
    return float(np.sqrt(variance))


def _moved(old: Model, new: Model, training: Training | None) -> MapDifference | None:
    """The move that a recalibration has found; the uncertainties of its two maps are not independent."""
    use = training.prior if training else None
    if use is None or not use.accepted or use.model_hash != old.hash:
        return None
    floor = new.noise_floor_dph
    return use.moved.model_copy(update={"rms_over_floor": use.moved.rms_dph / floor if floor else None})


def _map(old: Model, new: Model, of_means: float | None) -> MapDifference | None:
    """Compare two maps over their common envelope, deg/h; None if they have none.

    Args:
        of_means: What two means differ by although nothing moved; it stands in where a map states no uncertainty.
    """
    limits = []
    for name in ("temperature_c", "slope_c_per_min"):
        (a, b), (c, d) = getattr(old.envelope, name), getattr(new.envelope, name)
        limits.append((max(a, c), min(b, d)))
    if any(low > high for low, high in limits):
        return None
    t, slope = np.meshgrid(*(np.linspace(*span, n) for span, n in zip(limits, _GRID, strict=True)))
    difference = new.map_dph(t, slope) - old.map_dph(t, slope)
    worst = np.unravel_index(int(np.argmax(np.abs(difference))), difference.shape)
    floor = new.noise_floor_dph
    rms = float(np.sqrt(np.mean(difference**2)))
    before, after = (model.sigma_dph(t, slope) for model in (old, new))
    # RMS that the uncertainties of both maps give although nothing has moved
    expected = of_means if before is None or after is None else float(np.sqrt(np.mean(before**2 + after**2)))
    return MapDifference(
        rms_dph=rms,
        mean_dph=float(np.mean(difference)),
        max_abs_dph=float(np.abs(difference[worst])),
        at=At(temperature_c=float(t[worst]), slope_c_per_min=float(slope[worst])),
        rms_over_floor=rms / floor if floor else None,
        expanded_uncertainty_dph=None if expected is None else 2.0 * expected,
        # Errors of a map hang together over its envelope, at most all of them: then the ratio is one normal number.
        significant=None if expected is None else rms > 2.0 * expected,
    )


def _figures(earlier: Earlier, model: Model, evaluation: Evaluation) -> Iterator[tuple[str, FigureChange | str]]:
    """Yield figures before and after; those of recordings only if both were judged on the same kind."""
    yield "centers", FigureChange(before=earlier.model.n_centers, after=model.n_centers)
    yield "noise_floor_dph", FigureChange(before=earlier.model.noise_floor_dph, after=model.noise_floor_dph)
    old = earlier.evaluation.judged() if earlier.evaluation else None
    new = evaluation.judged()
    if old is None or new is None or old[0] != new[0]:
        return
    yield "judged_on", new[0]
    for name in ("rms_dph", "std_dph", "max_abs_dph"):
        yield name, FigureChange(before=getattr(old[1].after, name), after=getattr(new[1].after, name))


def _ids(evaluation: Evaluation | None) -> set[str]:
    return {finding.id for finding in evaluation.findings} if evaluation else set()


def _versions(old: Manifest | None, new: Manifest) -> Iterator[tuple[str, TextChange]]:
    """Yield programs whose version differs."""
    before = old.versions | {"gyrotc": old.gyrotc_version} if old else {}
    after = new.versions | {"gyrotc": new.gyrotc_version}
    for name in sorted(before.keys() | after.keys()):
        if before.get(name) != after.get(name):
            yield name, TextChange(before=before.get(name), after=after.get(name))


def _emitted(manifest: Manifest | None) -> dict[str, str]:
    return {k: v for k, v in manifest.files.items() if k.startswith("c/")} if manifest else {}
