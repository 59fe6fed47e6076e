"""What may be certified of a result: files as they were written, figures that agree.

What can be computed again of the results in a folder is, and compared. This finds a decision or an uncertainty that was
edited, also where hashes were made again. It cannot find figures of recordings that were edited together with all that
follows from them: only hashes that were kept elsewhere do.

Of a unit with three axes: its one image, with the runtime once, a table for each axis, one page for all.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from .. import __version__
from ..assess.budget import AGEING, budget_of
from ..assess.limits import Limits, held_against, worst_of
from ..common.errors import CheckFailed, InputError
from ..common.texts import c_environment
from ..model import Model, load_model
from ..pages.report import axes_page
from ..pages.unit import UnitResults, unit_in
from ..results.evaluation import Changes, Evaluation, Pooled
from ..results.files import write_atomically, write_own
from ..results.folder import scratch_folder
from ..results.marker import check_intact
from ..results.release import (
    NEED_REASON,
    STATED,
    Budget,
    HeldLimits,
    JointVerification,
    Verification,
    VerifiedTarget,
)
from ..results.training import Training
from ..tables.emit import config_text, emitted_tables, runtime_texts
from ..tables.record import RECORD, joint_record_text
from ..tables.text import ARITHMETICS, example_period_us, example_samples
from ..verify.emitted import file_entries
from ..verify.toolchain import all_targets, compile_c, run_program

_EXPECTED = "what gyrotc build wrote; build it again"
_ROUNDING = 1e-9  # relative: of sums in another order, far below any digit that is reported


def _check_figures(evaluation: Evaluation, where: str) -> None:
    """Figures of all runs of a role are those of its runs together.

    Raises:
        InputError: They are not.
    """
    for role, pooled in (("train", evaluation.train), ("exam", evaluation.exam)):
        runs = [run for run in evaluation.runs if run.role == role]
        n = sum(run.samples for run in runs)
        if (pooled.samples if pooled else 0) != n:
            raise InputError(f"{where}, field {role}.samples", "is not that of the runs", _EXPECTED)
        for side in ("before", "after") if pooled and n else ():
            stated = getattr(pooled, side)
            parts = [(run.samples, getattr(run, side)) for run in runs if run.samples]
            mean = math.fsum(k * (s.mean_dph or 0.0) for k, s in parts) / n
            square = math.fsum(k * (s.rms_dph or 0.0) ** 2 for k, s in parts) / n
            largest = max(s.max_abs_dph or 0.0 for _, s in parts)
            _same(stated.mean_dph, mean, f"{where}, field {role}.{side}.mean_dph", math.sqrt(square))
            _same(stated.rms_dph, math.sqrt(square), f"{where}, field {role}.{side}.rms_dph")
            _same(stated.max_abs_dph, largest, f"{where}, field {role}.{side}.max_abs_dph")
    for role, pooled in (("train", evaluation.train), ("exam", evaluation.exam), ("left_out", evaluation.left_out)):
        if pooled is not None:
            _check_pooled(pooled, f"{where}, field {role}")


def _check_pooled(pooled: Pooled, where: str) -> None:
    for side in ("before", "after"):
        s = getattr(pooled, side)
        if None not in (s.rms_dph, s.mean_dph, s.std_dph):
            _same(s.rms_dph, math.hypot(s.mean_dph, s.std_dph), f"{where}.{side}.std_dph")
    was, remains = pooled.before.rms_dph, pooled.after.rms_dph
    _same(pooled.improvement, was / remains if was is not None and remains else None, f"{where}.improvement")


def _same(stated: float | None, found: float | None, where: str, scale: float = 0.0) -> None:
    if stated is None or found is None:
        equal = stated == found
    else:
        equal = math.isclose(stated, found, rel_tol=_ROUNDING, abs_tol=_ROUNDING * scale)
    if not equal:
        raise InputError(where, f"is {stated}, and the other figures give {found}", _EXPECTED)


def _check_limits(
    held: HeldLimits, model: Model, evaluation: Evaluation, verification: Verification | None, where: str
) -> None:
    """Every limit says what its bound and the figures give, by the decision rule.

    What targets answered is taken as it stood then: `verify` may have been called with others since.

    Raises:
        InputError: One does not.
    """
    parts: dict[str, Any] = defaultdict(dict)
    for one in held.limits:
        part, _, name = one.limit.partition(".")
        several = part == "needs" and name != "generalises"
        parts[part][name] = (*parts[part].get(name, ()), one.bound) if several else one.bound
    rule = {"decision_rule": held.decision_rule} if held.decision_rule else {}
    limits = _limits({"product": held.product, "sha256": held.sha256} | rule | parts, where)
    targets = tuple(
        VerifiedTarget(name=str(one.bound), status=status, numeric="")  # type: ignore[arg-type]
        for one in held.limits
        if one.limit == "needs.targets" and isinstance(one.measured, tuple)
        for status in one.measured
    )
    then = verification.model_copy(update={"targets": targets}) if verification else None
    again = held_against(limits, model, evaluation, then)
    found = again.model_copy(update={"gyrotc_version": held.gyrotc_version})
    _refuse_departure(held.content(), found.content(), where)


def _check_budget(
    budget: Budget,
    model: Model,
    training: Training | None,
    evaluation: Evaluation,
    verification: Verification | None,
    changes: Changes | None,
    where: str,
) -> None:
    """Its parts follow from the other results, and U from its parts.

    Instruments, interval and a drift that is stated come from the limits file, which is not in a result.

    Raises:
        InputError: They do not.
    """
    if training is None:
        raise InputError(where, "stands without training.json", _EXPECTED)
    drift = next((one for one in budget.contributions if one.id == AGEING and one.distribution == "rectangular"), None)
    stated = {"drift_dph_per_year": drift.standard_uncertainty * math.sqrt(3.0)} if drift else {}
    interval = {"interval": {"days": budget.interval_days} | stated} if budget.interval_days else {}
    limits = _limits(interval, where).model_copy(update={"instrument": budget.instruments})
    again = budget_of(model, training, evaluation, verification, limits=limits, changes=changes)
    found = again.model_copy(update={"gyrotc_version": budget.gyrotc_version})
    _refuse_departure(budget.content(), found.content(), where)


def _limits(content: dict[str, Any], where: str) -> Limits:
    try:
        return Limits.model_validate({"schema": 1} | content)
    except ValidationError as error:
        raise InputError(where, "says what no limits file can", _EXPECTED) from error


def _refuse_departure(stated: Any, found: Any, where: str) -> None:
    """Refuses two JSON values that differ by more than rounding, by the first field that does."""
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
    _check_figures(evaluation, str(folder / "evaluate.json"))
    if unit.limits is not None:
        where = str(folder / "limits.json")
        _check_limits(unit.limits, model, evaluation, unit.verification, where)
    if unit.budget is not None:
        where = str(folder / "budget.json")
        _check_budget(unit.budget, model, unit.training, evaluation, unit.verification, unit.changes, where)
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
                str(folder), f"its verdict is {verdict} ({'; '.join(why)[:200]})", "a PASS, or --accept-fail REASON"
            )
        return None
    if verdict not in NEED_REASON:
        raise InputError("--accept-fail", f"the verdict is {verdict or 'not stated'}", "no such option")
    line = " ".join(reason.split())
    if not 0 < len(line) <= _LONGEST:
        raise InputError("--accept-fail", repr(reason)[:40], f"a reason of at most {_LONGEST} characters")
    return line


AXES = ("x", "y", "z")

_HOST = "host-gcc-O2"


def join_axes(folder: Path, axes: Sequence[str], display: str | None = None) -> None:
    """Fills `folder/c` and `folder/report.html` from `folder/<axis>`.

    `display`: as of `build`. Proves that all tables link and pass their self-tests in one image.

    Raises:
        CheckFailed: The image does not link, or a table does not pass its self-test in it.
    """
    models = {axis: load_model(folder / axis / "model.json") for axis in axes}
    numerics = list(emitted_tables(folder / axes[0] / "c", models[axes[0]]))
    c = folder / "c"
    c.mkdir()
    for name, data in joint_texts(models, _sources(folder, axes), numerics[0]).items():
        write_own(c / name, data)
    _run_together(c, [m.id for m in models.values()])
    write_atomically(folder / "report.html", axes_page(folder, axes, display))


def _sources(folder: Path, axes: Sequence[str]) -> dict[str, dict[str, bytes]]:
    """Files of every axis's own `c/` by name."""
    return {
        axis: {p.name: p.read_bytes() for p in sorted((folder / axis / "c").iterdir()) if p.is_file()} for axis in axes
    }


def joint_texts(
    models: Mapping[str, Model], sources: Mapping[str, Mapping[str, bytes]], numeric: str
) -> dict[str, bytes]:
    """All files of the `c/` of a unit by name.

    Args:
        models: Models by axis.
        sources: Files of each axis's own `c/` by name.
        numeric: The arithmetic that `main.c` uses.
    """
    headers = "".join(sources[a].get(f"gtc_{m.id}.h", b"").decode("latin-1") for a, m in models.items())
    held = [n for n in ARITHMETICS if f"gtc_{n}_table_t" in headers]  # of all axes
    texts = runtime_texts(models.values(), held)
    texts["gtc_config.h"] = config_text(list(models.values()))
    for axis, model in models.items():
        own = (f"gtc_{model.id}.", f"gtc_{model.id}_", f"vectors_{model.id}.")
        texts |= {name: data for name, data in sources[axis].items() if name.startswith(own)}
    listed = list(models.values())
    main = (
        c_environment()
        .get_template("main_axes.c.j2")
        .render(models=listed, n=numeric, period_us=example_period_us(listed[0]), samples=example_samples(listed[0]))
    )
    texts["main.c"] = main.encode("ascii")
    texts[RECORD] = joint_record_text(models, texts)
    return texts


def axes_in(folder: Path) -> tuple[str, ...]:
    """Axes of a result that `--axis all` made; none where the folder has a model of its own."""
    if (folder / "model.json").is_file():
        return ()
    return tuple(axis for axis in AXES if (folder / axis / "model.json").is_file())


def verify_axes(
    folder: Path,
    results: Mapping[str, Verification],
    edited: Sequence[str] = (),
) -> JointVerification:
    """What `verify.json` of a unit holds: its axes' results, and the files that stand in `folder/c`.

    These must be those of the axes' own folders, which `results` judges.

    Raises:
        InputError: There is no emitted folder, or a model cannot be read.
    """
    models = {axis: load_model(folder / axis / "model.json") for axis in results}
    if not (folder / "c").is_dir():
        raise InputError(str(folder / "c"), "is not there", "the files of all axes, as build wrote them")
    numeric = next(iter(results.values())).errors[0].numeric
    texts = joint_texts(models, _sources(folder, tuple(results)), numeric)
    emitted = tuple(file_entries(folder / "c", texts, edited))
    wrong = sum(file.status == "fail" for file in emitted)
    return JointVerification(
        gyrotc_version=__version__,
        serial=next(iter(results.values())).serial,
        axis=None,
        passed=sum(one.passed for one in results.values()),
        failed=sum(one.failed for one in results.values()) + wrong,
        missing=sum(one.missing for one in results.values()),
        emitted=emitted,
        axes=dict(results),
    )


def _run_together(c: Path, ids: Sequence[str]) -> None:
    target = all_targets()[_HOST]
    with scratch_folder() as work:
        program = work / "main"
        compile_c(target, [c / n for n in ("main.c", "gtc.c", *(f"gtc_{i}.c" for i in ids))], program, include=c)
        done = run_program(target, program)
    if done.returncode != 0:
        raise CheckFailed(f"the image of all axes ended with status {done.returncode}")
