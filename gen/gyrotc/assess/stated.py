"""Compute again what follows from stored results: to judge new figures, and to refuse results that contradict this.

This finds a decision or an uncertainty that was edited, also where the hashes of its file were made again. Figures of
recordings that were edited together with all that follows from them stay unseen: only hashes kept elsewhere show these.
"""

from __future__ import annotations

import math
from collections import defaultdict
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..common.errors import InputError
from ..model import Model
from ..results.evaluation import Changes, Evaluation, Pooled, ratio_of
from ..results.release import Budget, HeldLimits, Verification, VerifiedTarget
from ..results.training import Training
from .budget import AGEING, budget_of
from .limits import Limits, held_against

_EXPECTED = "what gyrotc build wrote; build it again"
_ROUNDING = 1e-9  # relative: of sums in another order, far below any digit that is reported


def check_stated(
    folder: Path,
    model: Model,
    evaluation: Evaluation,
    *,
    training: Training | None,
    verification: Verification | None,
    changes: Changes | None,
    limits: HeldLimits | None,
    budget: Budget | None,
) -> None:
    """Refuse results of one axis that do not follow from one another.

    Args:
        folder: Where they were read; messages name its files.

    Raises:
        InputError: A figure, a decision or an uncertainty is not what the other results give.
    """
    where = str(folder / "evaluate.json")
    _same(evaluation.constant_dph, model.fallback_dph, f"{where}, field constant_dph")
    _check_figures(evaluation, where)
    if limits is not None:
        where = str(folder / "limits.json")
        _check_same(limits, held_again(limits, model, evaluation, verification, where), where)
    if budget is not None:
        where = str(folder / "budget.json")
        again = budget_again(budget, model, training, evaluation, verification, changes, where)
        _check_same(budget, again, where)


def _check_figures(evaluation: Evaluation, where: str) -> None:
    """Check that the figures of a role are those of its runs together.

    Raises:
        InputError: They are not.
    """
    for role, pooled in (("train", evaluation.train), ("exam", evaluation.exam)):
        runs = [run for run in evaluation.runs if run.role == role]
        n = sum(run.samples for run in runs)
        if (pooled.samples if pooled else 0) != n:
            raise InputError(f"{where}, field {role}.samples", "is not that of the runs", _EXPECTED)
        for side in ("before", "constant", "after") if pooled and n else ():
            stated = getattr(pooled, side)
            parts = [(run.samples, getattr(run, side)) for run in runs if run.samples]
            mean = math.fsum(k * (s.mean_dph or 0.0) for k, s in parts) / n
            square = math.fsum(k * (s.rms_dph or 0.0) ** 2 for k, s in parts) / n
            largest = max(s.max_abs_dph or 0.0 for _, s in parts)
            _same(stated.mean_dph, mean, f"{where}, field {role}.{side}.mean_dph", math.sqrt(square))
            _same(stated.rms_dph, math.sqrt(square), f"{where}, field {role}.{side}.rms_dph")
            _same(stated.max_abs_dph, largest, f"{where}, field {role}.{side}.max_abs_dph")
        if pooled and n:
            expected = (pooled.before.mean_dph or 0.0) - evaluation.constant_dph
            scale = abs(evaluation.constant_dph)
            _same(pooled.constant.mean_dph, expected, f"{where}, field {role}.constant.mean_dph", scale)
    for role, pooled in (("train", evaluation.train), ("exam", evaluation.exam), ("left_out", evaluation.left_out)):
        if pooled is not None:
            _check_pooled(pooled, f"{where}, field {role}")


def _check_pooled(pooled: Pooled, where: str) -> None:
    for side in ("before", "constant", "after"):
        s = getattr(pooled, side)
        if None not in (s.rms_dph, s.mean_dph, s.std_dph):
            _same(s.rms_dph, math.hypot(s.mean_dph, s.std_dph), f"{where}.{side}.std_dph")
    left = pooled.after.rms_dph
    _same(pooled.improvement, ratio_of(pooled.constant.rms_dph, left), f"{where}.improvement")
    _same(pooled.improvement_about_zero, ratio_of(pooled.before.rms_dph, left), f"{where}.improvement_about_zero")


def _same(stated: float | None, found: float | None, where: str, scale: float = 0.0) -> None:
    if stated is None or found is None:
        equal = stated == found
    else:
        equal = math.isclose(stated, found, rel_tol=_ROUNDING, abs_tol=_ROUNDING * scale)
    if not equal:
        raise InputError(where, f"is {stated}, and the other figures give {found}", _EXPECTED)


def _check_same(stated: HeldLimits | Budget, again: HeldLimits | Budget, where: str) -> None:
    """Check that a result says what is computed again from the other results, whatever version of gyrotc wrote it.

    Raises:
        InputError: It does not.
    """
    found = again.model_copy(update={"gyrotc_version": stated.gyrotc_version})
    _refuse_departure(stated.content(), found.content(), where)


def held_again(
    held: HeldLimits, model: Model, evaluation: Evaluation, verification: Verification | None, where: str
) -> HeldLimits:
    """Decide the same limits by other figures.

    What targets answered is taken as it stood then: `verify` may have been called with others since.

    Args:
        where: The file that holds the limits; messages name it.

    Raises:
        InputError: They are no limits that a limits file can state.
    """
    parts: dict[str, Any] = defaultdict(dict)
    for one in held.limits:
        part, _, name = one.limit.partition(".")
        several = part == "needs" and name != "generalises"
        parts[part][name] = (*parts[part].get(name, ()), one.bound) if several else one.bound
    rule = {"decision_rule": held.decision_rule}
    limits = _limits({"product": held.product, "sha256": held.sha256} | rule | parts, where)
    targets = tuple(
        VerifiedTarget(name=str(one.bound), status=status, numeric="")  # type: ignore[arg-type]
        for one in held.limits
        if one.limit == "needs.targets" and isinstance(one.measured, tuple)
        for status in one.measured
    )
    then = verification.model_copy(update={"targets": targets}) if verification else None
    return held_against(limits, model, evaluation, then)


def budget_again(
    budget: Budget,
    model: Model,
    training: Training | None,
    evaluation: Evaluation,
    verification: Verification | None,
    changes: Changes | None,
    where: str,
) -> Budget:
    """Compute a budget by other figures.

    Instruments, interval and a drift that is stated come from the limits file, which is not in a result; the earlier
    budget has them.

    Args:
        where: The file that holds the budget; messages name it.

    Raises:
        InputError: There is no training, or what the budget states can come from no limits file.
    """
    if training is None:
        raise InputError(where, "stands without training.json", _EXPECTED)
    drift = next((one for one in budget.contributions if one.id == AGEING and one.distribution == "rectangular"), None)
    stated = {"drift_dph_per_year": drift.standard_uncertainty * math.sqrt(3.0)} if drift else {}
    interval = {"interval": {"days": budget.interval_days} | stated} if budget.interval_days else {}
    limits = _limits(interval, where).model_copy(update={"instrument": budget.instruments})
    return budget_of(model, training, evaluation, verification, limits=limits, changes=changes)


def _limits(content: dict[str, Any], where: str) -> Limits:
    try:
        return Limits.model_validate({"schema": 1} | content)
    except ValidationError as error:
        raise InputError(where, "says what no limits file can", _EXPECTED) from error


def _refuse_departure(stated: Any, found: Any, where: str) -> None:
    """Refuse two JSON values that differ by more than rounding; the message names the first field that does."""
    if isinstance(stated, dict) and isinstance(found, dict) and stated.keys() == found.keys():
        for name in stated:
            _refuse_departure(stated[name], found[name], f"{where}.{name}")
    elif isinstance(stated, list) and isinstance(found, list) and len(stated) == len(found):
        for number, (one, other) in enumerate(zip(stated, found, strict=True)):
            _refuse_departure(one, other, f"{where}.{number}")
    elif isinstance(stated, float) and isinstance(found, float):
        _same(stated, found, where)
    elif stated != found or type(stated) is not type(found):
        raise InputError(where, f"is {str(stated)[:60]}, and the other results give {str(found)[:60]}", _EXPECTED)
