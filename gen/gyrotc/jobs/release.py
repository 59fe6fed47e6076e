"""What may be said of a result, and what a laboratory signs of it: files as they were written, figures that agree."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from .. import __version__
from ..assess.consistency import check_budget, check_figures, check_limits
from ..assess.limits import worst_of
from ..common.errors import InputError
from ..model import Model, load_model
from ..pages.unit import UnitResults, unit_in
from ..results.release import NEED_REASON, RELEASED, STATED, Release, ReleasedUnit
from ..store.marker import check_intact, sha256
from ..tables.record import RECORD
from .axes import axes_in

_LONGEST = 300  # characters of a reason: a line or two of a certificate


def unit_of(folder: Path) -> UnitResults:
    """What a result of one axis says, once it is seen that it is as it was written and follows from itself.

    Raises:
        InputError: It does not; or as `unit_in`.
    """
    check_intact(folder, STATED)
    unit = unit_in(folder)
    model, evaluation = unit.model, unit.evaluation
    named = {
        "evaluate.json": evaluation, "training.json": unit.training, "verify.json": unit.verification,
        "manifest.json": unit.manifest, "limits.json": unit.limits, "budget.json": unit.budget,
    }  # fmt: skip
    for name, result in named.items():
        if result is not None and (result.serial, result.axis) != (model.serial, model.axis):
            raise InputError(str(folder / name), "is of another gyro or axis", f"serial {model.serial}")
    check_figures(evaluation, str(folder / "evaluate.json"))
    if unit.limits is not None:
        where = str(folder / "limits.json")
        check_limits(unit.limits, model, evaluation, unit.verification, where)
    if unit.budget is not None:
        where = str(folder / "budget.json")
        check_budget(unit.budget, model, unit.training, evaluation, unit.verification, unit.changes, where)
    return unit


def accepted(folder: Path, units: Sequence[UnitResults], reason: str | None) -> str | None:
    """The reason for which a unit is released whose verdict is FAIL or CONDITIONAL PASS; None where it is neither.

    Raises:
        InputError: The verdict is one of these and there is no reason, or it is neither and there is one.
    """
    verdict = worst_of(unit.decision for unit in units) or ""
    if reason is None:
        if verdict in NEED_REASON:
            why = [text for unit in units for text in (*unit.failures, unit.named(verdict)) if text]
            raise InputError(
                str(folder),
                f"its verdict is {verdict} ({'; '.join(why)[:200]})",
                "a PASS, or --accept-fail REASON",
            )
        return None
    if verdict not in NEED_REASON:
        raise InputError("--accept-fail", f"the verdict is {verdict or 'not stated'}", "no such option")
    line = " ".join(reason.split())
    if not 0 < len(line) <= _LONGEST:
        raise InputError("--accept-fail", repr(reason)[:40], f"a reason of at most {_LONGEST} characters")
    return line


def release_of(folder: Path, reason: str | None = None) -> list[tuple[Path, Release]]:
    """What is to be signed of a result, with the folder that it is of: every axis, and with several all of them.

    A folder of `emit` alone, which nothing was measured of, has no verdict.

    Raises:
        InputError: It is not as it was written, or it needs a reason to be released and there is none.
    """
    axes = axes_in(folder)
    parts = [folder / axis for axis in axes] or [folder]
    models, units = {}, {}
    for part in parts:
        check_intact(part, STATED)
        models[part] = load_model(part / "model.json")
        if (part / "evaluate.json").is_file():
            units[part] = unit_of(part)
    why = accepted(folder, list(units.values()), reason)
    released = {part: _unit(models[part], units.get(part)) for part in parts}
    return [
        (place, _release(place, [(part, released[part]) for part in parts if place in (part, folder)], why))
        for place in [*parts, *([folder] if axes else [])]
    ]


def _release(place: Path, units: Sequence[tuple[Path, ReleasedUnit]], why: str | None) -> Release:
    verdict = worst_of(unit.verdict for _, unit in units)
    listed = [part / name for part, _ in units for name in RELEASED]
    return Release(
        gyrotc_version=__version__,
        serial=load_model(units[0][0] / "model.json").serial,
        axis=units[0][1].axis if units[0][0] == place else None,
        verdict=verdict,
        accepted_fail=why if verdict in NEED_REASON else None,
        units=tuple(unit for _, unit in units),
        emission=sha256(place / "c" / RECORD),
        files={p.relative_to(place).as_posix(): sha256(p) for p in listed if p.is_file()},
    )


def _unit(model: Model, unit: UnitResults | None) -> ReleasedUnit:
    limits, budget = (unit.limits, unit.budget) if unit else (None, None)
    return ReleasedUnit(
        axis=model.axis,
        model_hash=model.hash,
        verdict=unit.decision if unit else None,
        failures=tuple(unit.failures) if unit else (),
        limits_sha256=limits.sha256 if limits else None,
        limits=limits.limits if limits else (),
        expanded_dph=budget.expanded_dph if budget else None,
        coverage_factor=budget.coverage_factor if budget else None,
        calibrated_on=budget.calibrated_on if budget else _day_of(model),
        valid_until=budget.valid_until if budget else None,
    )


def _day_of(model: Model) -> str | None:
    stated = model.meta.get("calibrated_on")
    return None if stated is None else str(stated)
