"""Results as tables and lines for a terminal: what was trained, evaluated, verified."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.table import Table as RichTable

from ..pages.display import (
    bound_words,
    limit_words,
    measured_words,
    rounded,
    sci,
    with_uncertainty,
)

if TYPE_CHECKING:
    from ..pages.unit import UnitResults
    from ..results.evaluation import Changes, EvaluatedRun, Evaluation, Pooled
    from ..results.release import (
        JointVerification,
        ReadLog,
        Verification,
        VerifiedFile,
    )
    from ..results.training import Training


def evaluation_table(result: Evaluation) -> RichTable:
    title = f"{result.serial}: means over {result.average_s:g} s, deg/h"
    table = RichTable(title=title, box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in ("run", "role", "environment"):
        table.add_column(name, no_wrap=True)
    for name in ("constant", "after", "std after", "samples"):
        table.add_column(name, justify="right", no_wrap=True)
    for run in result.runs:
        table.add_row(
            run.file + (f"@{run.from_s:g}" if run.from_s is not None else ""), run.role, run.environment or "",
            *_figures(run), str(run.samples),
        )  # fmt: skip
    for role, part in (("train", result.train), ("exam", result.exam), ("left_out", result.left_out)):
        if part:
            table.add_row("all", role, "", *_figures(part), str(part.samples), style="bold")
    return table


def _figures(part: EvaluatedRun | Pooled) -> tuple[str, str, str]:
    return sci(part.constant.rms_dph), sci(part.after.rms_dph), sci(part.after.std_dph)


def training_lines(training: Training) -> Iterator[str]:
    """Yield which correction was chosen and why, which channels it uses, and what came from a lot or earlier model."""
    if training.candidates:
        yield f"correction {training.method}: {training.reason}"
    for tried in training.channels or ():
        yield f"channel {tried.name}: {tried.verdict}" + ("" if tried.verdict == "taken" else f": {tried.reason}")
    yield from prior_lines(training)


def prior_lines(training: Training) -> Iterator[str]:
    """Yield what a lot or an earlier model says of the unit, and what became of it; a line each."""
    if training.lot is not None:
        yield f"lot: {training.lot.text}"
    if training.prior is not None:
        yield f"earlier model: {training.prior.text}"


def prediction_line(training: Training) -> str:
    """Return what training predicts for unseen recordings, or the reason why there is no prediction."""
    ratio = training.predicted_rms_ratio
    floor = f"noise floor {sci(training.noise_floor_dph)} deg/h"
    if ratio is None:
        return f"{floor}; no prediction of RMS over it: {training.prediction_withheld}"
    return f"{floor}; predicted RMS over it: {ratio:.4f}"


def verify_table(result: Verification) -> RichTable:
    table = RichTable(title="Bit for bit against the reference", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in ("target", "", "status"):
        table.add_column(name, no_wrap=True)
    for name in ("vectors", "rows", "differ", "map call", "code", "stack"):
        table.add_column(name, justify="right", no_wrap=True)
    for entry in (e for e in result.targets if e.status != "missing"):  # `not_installed_lines` names those
        replayed, counted = entry.replayed, entry.map_cost
        of_rows = replayed.mismatches if replayed else 0
        differ = None if entry.mismatches is None else entry.mismatches + of_rows
        table.add_row(
            entry.name, entry.numeric, entry.status, _known(entry.vectors),
            _known(replayed.rows if replayed else None), _known(differ),
            f"{counted[1].mean:.0f} {counted[0][:5]}" if counted else "-",
            _known(entry.code_bytes), _known(entry.stack_bytes),
        )  # fmt: skip
    return table


def _known(number: int | None) -> str:
    return "-" if number is None else str(number)


def verified_line(result: Verification) -> str:
    """Return the targets with the bits of the reference, in one line."""
    agreed: dict[str, list[str]] = {}
    for entry in result.targets:
        if entry.status == "pass":
            agreed.setdefault(entry.name, []).append(entry.numeric)
    where = ", ".join(f"{name} ({', '.join(numerics)})" for name, numerics in agreed.items()) or "nowhere"
    return f"bit for bit as the reference: {where}"


# Growth of the RMS from which on a command says what rounding costs; a smaller one is in the results only.
_NOTABLE_GROWTH = 0.01


def rounding_lines(growths: Mapping[str, float | None]) -> Iterator[str]:
    """Yield a line for each arithmetic whose rounding costs more than the third digit of an RMS.

    Args:
        growths: Share by which rounding can raise an RMS at the noise floor, by arithmetic; None: no floor is known.
    """
    for numeric, growth in growths.items():
        if growth is not None and growth > _NOTABLE_GROWTH:
            yield (
                f"{numeric}: rounding can raise an RMS at the noise floor by {growth:.1%} of it; "
                "at_most.error_bound_dph of a limits file refuses what is too much"
            )


def not_installed_lines(result: Verification) -> Iterator[str]:
    """One line with the targets whose tools are not installed, where there are some."""
    names, packages = result.not_installed
    if names:
        yield f"not installed: {', '.join(names)}: apt-get install {' '.join(packages)}"


def verify_notes(result: Verification) -> Iterator[str]:
    """Yield what is not installed, and what differs, with all bits; one line each."""
    yield from not_installed_lines(result)
    for entry in result.targets:
        who = f"{entry.name} {entry.numeric}"
        replayed = entry.replayed
        found = [entry.error, replayed.error if replayed else None, *entry.first_mismatches]
        found += replayed.first_mismatches if replayed else ()
        yield from (f"{who}: {text}" for text in found if text)
    yield from file_notes(result)
    yield from _log_notes(result.log) if result.log else ()
    if result.outdated_boards:
        names = ", ".join(result.outdated_boards)
        yield f"{names}: ran another model or other code, so these results are dropped; run the board test again"
    yield from rounding_lines({error.numeric: error.rms_growth for error in result.errors})
    for error in result.errors:
        yield from (f"{error.numeric}: {text}" for text in error.first_mismatches)
        yield (
            f"{error.numeric}: worst error {sci(error.worst_dph)} deg/h of {error.inputs_visited} inputs "
            f"visited; the bound is {sci(error.bound_dph)}"
            + (" and is EXCEEDED" if error.worst_dph > error.bound_dph else "")
        )


def _log_notes(log: ReadLog) -> Iterator[str]:
    """Yield the contents of a log, to its last line."""
    found = ", ".join(f"{part.numeric} from line {part.line}" for part in log.parts)
    yield f"{log.file}: {log.lines} lines; compared: {found}; {log.outside} lines outside of the board test"
    yield from (f"{log.file}, outside: {line}" for line in log.first_outside)
    for numeric in log.absent:
        yield f"{log.file}: the board did not test {numeric}"


def file_notes(result: Verification | JointVerification) -> Iterator[str]:
    """Yield the files that differ from what gyrotc makes, with the first place; one line if none does."""
    from ..results.release import Verification

    for file in result.emitted:
        if file.verdict == "foreign":
            yield f"{file.file}: foreign; gyrotc did not write it, move it elsewhere"
        elif file.verdict == "missing":
            yield f"{file.file}: missing"
        elif file.verdict != "equal":
            yield f"{file.file}: {_difference_text(file)}"
    equal = sum(file.verdict == "equal" for file in result.emitted)
    options = result.options if isinstance(result, Verification) else None
    zero_at = options.zero_at_c if options else None
    shift = f", shifted to 0 at {zero_at:g} C" if zero_at is not None else ""
    yield f"{equal} of {len(result.emitted)} files are, byte for byte, what the model gives{shift}"


def _difference_text(file: VerifiedFile) -> str:
    kind, place = ("line", file.line) if file.word is None else ("word", file.word)
    if place is None:
        return f"{file.verdict}; it is {file.found or 'no regular file'}"
    return (
        f"{file.verdict}, {file.mismatches} {kind}s; first at {kind} {place}: there {file.found!r}, "
        f"the model gives {file.expected!r}"
    )


def built_lines(unit: UnitResults, dataset: str, folder: str) -> Iterator[str]:
    """Yield the verdict, the gain, what remains, what is known from elsewhere, sizes, proof, findings, the next step.

    Args:
        dataset, folder: The data set and the result as a shell takes them.
    """
    evaluation = unit.evaluation
    yield verdict_line(unit)
    yield from summary_lines(evaluation)
    if kept := [one for one in unit.held if one.constant_passes]:
        bounds = "; ".join(f"{limit_words(one.limit)} {bound_words(one)}" for one in kept)
        yield f"a constant keeps {bounds}, too: {'they ask' if len(kept) > 1 else 'it asks'} nothing of the map"
    if unit.training:
        yield from prior_lines(unit.training)
    yield size_line(unit)
    if unit.verification:
        yield verified_line(unit.verification)
    if unit.changes:
        yield "; ".join(line.strip() for line in change_lines(unit.changes))
    if evaluation.findings:
        yield f"findings: {', '.join(dict.fromkeys(one.id for one in evaluation.findings))}"
    places = {"DATASET": dataset, "DIR": folder}
    yield "next: " + re.sub(r"\b(DATASET|DIR)\b", lambda found: places[found[0]], unit.next_step)


def verdict_line(unit: UnitResults) -> str:
    """Return serial, axis and verdict of a unit in a line."""
    axis = f" {unit.model.axis}" if unit.model.axis else ""
    return f"{unit.model.serial}{axis}: {verdict_words(unit)}"


def verdict_words(unit: UnitResults) -> str:
    """Return the verdict with its reasons: limits that did not pass, what the recordings lack, what remains."""
    doubt = f"; {unit.doubt[0].lower()}{unit.doubt[1:]}" if unit.doubt else ""
    if not unit.verdict:
        return f"no limits given{doubt}"
    product = f" for {unit.limits.product}" if unit.limits and unit.limits.product else ""
    reasons = [*unit.failures]
    for one in unit.held:
        if one.verdict == "FAIL" or (one.verdict != "PASS" and not one.capped):
            reasons.append(f"{limit_words(one.limit)} {bound_words(one)}: {measured_words(one)}, {one.verdict}")
    return f"{unit.verdict}{product}" + "".join(f"; {why.rstrip('.')}" for why in (*reasons, *unit.capped)) + doubt


def size_line(unit: UnitResults) -> str:
    """Return the size of the table, and what a program takes that links it with the runtime, in one line."""
    sizes = unit.evaluation.model
    return f"table: {sizes.table_bytes} bytes, {sizes.centers} centers" + (
        f"; with the runtime {unit.linked}" if unit.linked else ""
    )


def summary_lines(result: Evaluation) -> Iterator[str]:
    """Yield what was gained against a constant, and what remains against the noise floor.

    The improvement about zero stands behind it, and the paper's own figure beside that for the paper's scenario.
    """
    from ..pages.comparison import ENVIRONMENTS

    found = result.judged()
    if found is None or not found[1].improvement:
        yield "no sample to judge by"
        return
    part, known = found[1], result.uncertainty or {}
    spread = {name: one.expanded for name, one in known.items()}
    simulated = result.noise_floor_source == "simulated"  # the paper's own campaign; nobody's product
    published = result.exam and simulated and {run.environment for run in result.runs} == set(ENVIRONMENTS)
    yield (
        f"improvement {with_uncertainty(part.improvement, spread.get('improvement'))} against a constant on "
        f"{_JUDGED_ON[found[0]]} (about zero {sci(part.improvement_about_zero)}{'; paper: 9.8-10.4' * bool(published)})"
    )
    floor, rms = result.noise_floor_dph, part.after.rms_dph
    if rms is not None:
        text = f"RMS {with_uncertainty(rms, spread.get('rms_dph'))} deg/h"
        text += f" = {rms / floor:.4f} x noise floor ({result.noise_floor_source})" if floor else ""
        text += f", of means over {result.average_s:g} s"
        if (robust := result.usable) is not None and robust.rms_dph is not None:
            role = "exam" if result.exam else "train"
            rows = sum(run.rows.bad for run in result.runs if run.role == role and run.rows)
            text += f"; {sci(robust.rms_dph)} without {rows} rows that say nothing of the gyro"
        yield text


_JUDGED_ON = {"exam": "test runs", "left_out": "spans left out", "train": "the training runs themselves"}


def change_lines(changes: Changes) -> Iterator[str]:
    """Yield the changes since an earlier result."""
    if changes.same_model:
        yield "against the earlier result: the same model"
    elif changes.map is None:
        yield "against the earlier result: no temperatures and rates in common"
    else:
        moved, at = changes.map, changes.map.at
        share = f" = {moved.rms_over_floor:.2g} x noise floor" if moved.rms_over_floor else ""
        if moved.expanded_uncertainty_dph is not None:
            more = "significant: more than" if moved.significant else "not significant: no more than"
            share += f", {more} U = {rounded(moved.expanded_uncertainty_dph)}"
        yield (
            f"against the earlier result: maps {sci(moved.rms_dph)} deg/h RMS difference{share}, at most "
            f"{sci(moved.max_abs_dph)} at {at.temperature_c:.1f} C, {at.slope_c_per_min:+.2f} C/min"
        )
    yield from _as_found_lines(changes)


def _as_found_lines(changes: Changes) -> Iterator[str]:
    """The earlier correction on the new recordings."""
    found = changes.as_found
    if found is None:
        if changes.as_found_missing:
            yield f"  as found: not known ({changes.as_found_missing})"
        return
    verdict = f", {found.limits.verdict}" if found.limits and found.limits.verdict else ""
    yield f"  as found: RMS {sci(found.figures.after.rms_dph)} deg/h with the earlier correction{verdict}"
