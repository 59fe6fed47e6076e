"""Limits of a product and statements of conformity (ILAC-G8:09/2019); guards that a product states.

`guard_band` (4.2.3, non-binary): pass up to the acceptance limit AL = limit - w, conditional pass between AL and the
limit, fail beyond. `guard_band_binary` (4.2.2): pass up to AL, fail beyond. `simple_acceptance` (4.2.1): pass up to
the limit, w = 0. The guard band is w = U: of what passes at most 2.3 % is beyond its limit.

Where `evaluate` and `verify` say what is, this says whether it is enough. A figure that was not measured does not
keep a limit. What the recordings lack (`requirements`) bounds the verdict, whatever the figures are; and of each limit
it is said whether a constant for a correction would keep it, too.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import date, timedelta
from pathlib import Path
from statistics import NormalDist
from typing import Annotated, Any, Literal, get_args

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from .. import __version__
from ..common.errors import InputError, quoted
from ..common.inputs import checked, parse_toml, read_input, refused
from ..common.statistics import coverage_factor
from ..model import Celsius, CelsiusPerMin, Model, RuntimePart
from ..results.base import Numeric
from ..results.decision import worst_of
from ..results.evaluation import Evaluation, FigureUncertainty, RunStatistics, Statistics
from ..results.release import (
    DecisionRule,
    HeldLimits,
    Instrument,
    JudgedOn,
    Limit,
    Value,
    Verdict,
    Verification,
)
from ..verify.toolchain import all_targets
from .product_guards import ProductGuard
from .requirements import LEAST_FREEDOM

_NORMAL = NormalDist()
_ON_TRAINING = (
    'judged on the training runs themselves, which a fit follows too well: record a test run and give it role = "exam"'
)


def decided(
    name: str,
    measured: float | None,
    bound: float,
    sign: float,
    rule: DecisionRule,
    known: FigureUncertainty | str | None,
    part: JudgedOn | None = None,
    *,
    constant: float | None = None,
    allowed: Sequence[tuple[Verdict, str]] = (),
) -> Limit:
    """Compare an amount and its uncertainty with a limit, by a decision rule.

    Args:
        name: Name of the limit, as in the limits file.
        measured: What was measured, None if it was not.
        bound: The limit.
        sign: 1 for an upper limit, -1 for a lower one.
        rule: The decision rule.
        known: The figure's uncertainty; a text: why it has none; None: it is not known, so that a guard band cannot
            be kept.
        part: What the figure was measured on; None: not on recordings. Of training runs, and with fewer than 5
            degrees of freedom where the uncertainty counts, a pass is a conditional one, by any rule.
        constant: What a constant for a correction would give; None: the figure is not one of a correction.
        allowed: Verdicts that the recordings allow at most, with the reasons.
    """
    one = _by_rule(name, measured, bound, sign, rule, known)
    few = one.degrees_of_freedom is not None and one.degrees_of_freedom < LEAST_FREEDOM
    reasons: list[tuple[Verdict, str]] = list(allowed) if part is not None else []
    if part == "train" and measured is not None:
        reasons.append(("CONDITIONAL PASS", _ON_TRAINING))
    if few and rule != "simple_acceptance":
        why = f"its uncertainty has fewer than {LEAST_FREEDOM:g} degrees of freedom: record longer or more runs"
        reasons.append(("CONDITIONAL PASS", why))
    verdict = worst_of((one.verdict, *(most for most, _ in reasons))) or one.verdict
    return one.model_copy(
        update={
            "part": part,
            "capped": tuple(why for _, why in reasons),
            "verdict": verdict,
            "met": verdict in ("PASS", "CONDITIONAL PASS"),
            "constant": constant,
            "constant_passes": constant is not None and sign * (bound - constant) >= 0.0,
        }
    )


def _by_rule(
    name: str,
    measured: float | None,
    bound: float,
    sign: float,
    rule: DecisionRule,
    known: FigureUncertainty | str | None,
) -> Limit:
    """The decision by the rule alone."""
    if isinstance(known, str):
        return _bare(name, measured, bound, sign, known)
    if measured is None or known is None:
        one = _bare(name, measured, bound, sign, "not measured" if measured is None else "not known")
        if one.met and rule != "simple_acceptance":
            met = rule == "guard_band"
            return one.model_copy(update={"met": met, "verdict": "CONDITIONAL PASS" if met else "FAIL"})
        return one
    k = coverage_factor(known.freedom)
    expanded = k * known.standard
    band = 0.0 if rule == "simple_acceptance" else expanded
    room = sign * (bound - measured)
    near: Verdict = "CONDITIONAL PASS" if rule == "guard_band" else "FAIL"
    verdict: Verdict = "FAIL" if room < 0.0 else "PASS" if room >= band else near
    beyond = _NORMAL.cdf(sign * (measured - bound) / known.standard) if known.standard else 0.0
    return Limit(
        limit=name,
        measured=measured,
        bound=bound,
        met=verdict != "FAIL",
        verdict=verdict,
        standard_uncertainty=known.standard,
        degrees_of_freedom=known.freedom,
        coverage_factor=k,
        expanded_uncertainty=expanded,
        guard_band=band,
        acceptance_limit=bound - sign * band,
        false_acceptance=beyond if verdict != "FAIL" else None,
        uncertainty_from=known.method,
    )


def _bare(name: str, measured: float | None, bound: float, sign: float, why: str) -> Limit:
    met = measured is not None and sign * (bound - measured) >= 0.0
    return Limit(
        limit=name, measured=measured, bound=bound, met=met, verdict="PASS" if met else "FAIL", uncertainty_from=why
    )


class StatedInstrument(Instrument):
    """An instrument as a person writes it: an unknown field is refused."""

    model_config = ConfigDict(extra="forbid")


def instruments_in(meta: Mapping[str, Any], others: Sequence[Instrument] = ()) -> tuple[Instrument, ...]:
    """Return the instruments of `[[meta.instrument]]`, and those of the limits file with other names.

    Raises:
        InputError: An entry is no table, or a field of it is wrong or not known.
    """
    entries = meta.get("instrument", ())
    if not isinstance(entries, (list, tuple)):
        raise InputError("dataset.toml, field meta.instrument", "is no list of tables", "[[meta.instrument]]")
    stated = []
    for number, entry in enumerate(entries):
        where = f"dataset.toml, field meta.instrument.{number}"
        if not isinstance(entry, Mapping):
            raise InputError(where, quoted(entry), "a table: [[meta.instrument]]")
        stated.append(checked(StatedInstrument, dict(entry), where))
    names = {one.name for one in stated}
    every = (*stated, *(one for one in others if one.name not in names))
    return tuple(Instrument(**one.model_dump()) for one in every)


def last_day(calibrated_on: str | None, days: float | None) -> str | None:
    """Last day of an interval, ISO 8601; None where the date is not stated as one, or there is no interval."""
    if calibrated_on is None or days is None:
        return None
    try:
        return (date.fromisoformat(calibrated_on[:10]) + timedelta(days=days)).isoformat()
    except (ValueError, OverflowError):
        return None


FindingName = Literal[
    "any", "coarse_arithmetic",
    "no_temperature_information", "fails_on_unseen_span", "jump_in_temperature", "earth_rate_not_stated",
    "large_weights", "sparse_coverage", "run_outlier", "counter_wrapped", "rate_outliers", "runs_contradict",
    "does_not_generalise", "map_refused", "map_beyond_data",
    "not_of_its_lot", "prior_does_not_hold",
    "shared_rows", "shared_axes", "rate_held", "temperature_late", "residual_above_noise", "residual_below_noise",
    "sign_reversed", "axes_exchanged", "gain_changed", "unit_changed", "thermometer_changed", "stuck_temperature",
    "temperature_outliers", "stuck_rate", "end_stop", "noise_changes",
]  # fmt: skip
UpperBound = Annotated[float, Field(ge=0.0, le=1e12)] | None


def _ordered(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[0] > pair[1]:
        raise ValueError("the lower end comes first")
    return pair


def _as_tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


Temperatures = Annotated[tuple[Celsius, Celsius], BeforeValidator(_as_tuple), AfterValidator(_ordered)]
Slopes = Annotated[tuple[CelsiusPerMin, CelsiusPerMin], BeforeValidator(_as_tuple), AfterValidator(_ordered)]


class _Part(BaseModel):
    # Strict: `true` is no number and "1" none either.
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class AtMost(_Part):
    """Upper limits. RMS and the like of compensated means, on test runs, else on spans left out, else in training."""

    rms_dph: UpperBound = None
    std_dph: UpperBound = None
    mean_dph: UpperBound = None  # of its absolute value
    max_abs_dph: UpperBound = None
    rms_over_floor: UpperBound = None
    rms_30min_dph: UpperBound = None  # of the worst run
    angle_1h_arcsec: UpperBound = None  # of the worst run
    first_10min_rms_dph: UpperBound = None  # of the worst run
    uncertainty_dph: UpperBound = None  # largest 1 sigma over the envelope
    error_bound_dph: UpperBound = None
    centers: UpperBound = None
    table_bytes: UpperBound = None
    rom_bytes: UpperBound = None
    ram_bytes: UpperBound = None
    rows_left_out: UpperBound = None  # rows of training that were left out for what they show


class AtLeast(_Part):
    """Lower limits."""

    improvement: UpperBound = None
    covered: Annotated[float, Field(ge=0.0, le=1.0)] | None = None  # share of the envelope with training data


class Covers(_Part):
    """Ranges that the envelope of the model must contain."""

    temperature_c: Temperatures | None = None
    slope_c_per_min: Slopes | None = None


class Required(_Part):
    """Properties that a unit must have, and that it must not."""

    arithmetics: Annotated[tuple[Numeric, ...], BeforeValidator(_as_tuple)] = ()
    targets: Annotated[tuple[str, ...], BeforeValidator(_as_tuple)] = ()  # bit for bit, in all their arithmetics
    no_findings: Annotated[tuple[FindingName, ...], BeforeValidator(_as_tuple)] = ()  # ids, or "any"
    generalises: bool = False  # the correction was shown to hold on thermal history that it has not seen
    # Parts of tables and runtime; what is false is left out.
    uncertainty: bool = True
    rezero: bool = True
    coverage: bool = True
    known_answers: bool = True
    image: bool = True
    saved_state: bool = True
    time: bool = True

    @property
    def left_out(self) -> tuple[RuntimePart, ...]:
        """Parts that the product does not need. A re-zero weighs uncertainties, so it goes with them."""
        parts: tuple[RuntimePart, ...] = get_args(RuntimePart)
        return tuple(p for p in parts if not getattr(self, p) or (p == "rezero" and not self.uncertainty))


class Recalibration(_Part):
    """Interval of the calibration, and the drift of the bias of the type in that time."""

    days: Annotated[float, Field(gt=0.0, le=36525.0)]
    drift_dph_per_year: UpperBound = None  # the most that units of the type do


class Limits(_Part):
    """The content of a limits file."""

    schema_: Annotated[Literal[1], Field(alias="schema")]
    product: str = ""
    decision_rule: DecisionRule = "guard_band"
    at_most: AtMost = AtMost()
    at_least: AtLeast = AtLeast()
    covers: Covers = Covers()
    needs: Required = Required()
    interval: Recalibration | None = None
    instrument: Annotated[tuple[StatedInstrument, ...], BeforeValidator(_as_tuple)] = ()
    # Unit of fixed point for all tables of the product: 2^-this deg/h
    q31_bias_frac_bits: Annotated[int, Field(ge=0, le=60)] | None = None
    guards: dict[str, ProductGuard] = {}  # by channel: what the runtime accepts of it
    sha256: str = ""  # of the file ...
    file: str = ""  # ... and its name


def load_limits(path: Path) -> Limits:
    """Read and check a limits file.

    Raises:
        InputError: It cannot be read, is no TOML, or a field is wrong or not known.
    """
    data = read_input(path, "text_mib", "a limits file")
    content = parse_toml(data, str(path), "a limits file")
    own = {"sha256": hashlib.sha256(data).hexdigest(), "file": str(path)}
    for name in own:
        if name in content:
            raise InputError(f"{path}, field {name}", "is not known", "a field named in docs/limits.md")
    try:
        limits = Limits.model_validate(content | own)
    except ValidationError as error:
        raise refused(error, lambda field: f"{path}, field {field}", Limits, "docs/limits.md") from error
    known = all_targets()
    for name in limits.needs.targets:
        if name not in known:
            raise InputError(f"{path}, field needs.targets", quoted(name), ", ".join(known))
    return limits


def held_against(limits: Limits, model: Model, evaluation: Evaluation, verification: Verification | None) -> HeldLimits:
    """Every limit with what was measured, and whether all are met."""
    covers = limits.covers.model_dump(exclude_none=True)
    has = {name: getattr(model.envelope, name) for name in covers}
    allowed = [(one.verdict, f"{one.text}. {one.next}") for one in evaluation.requirements if not one.met]
    checks = (
        *_amounts(limits, _measured(model, evaluation, verification), evaluation, allowed),
        *(
            _limit(f"covers.{name}", a, (low, high), a[0] <= low and high <= a[1], "range of the recordings")
            for (name, (low, high)), a in zip(covers.items(), has.values(), strict=True)
        ),
        *_needs(limits.needs, evaluation, verification),
    )
    reasons = (*(why for _, why in allowed), *(why for one in checks for why in one.capped))
    verdict = worst_of((*(check.verdict for check in checks), *(most for most, _ in allowed))) if checks else None
    return HeldLimits(
        gyrotc_version=__version__,
        serial=model.serial,
        axis=model.axis,
        product=limits.product,
        sha256=limits.sha256,
        met=verdict in ("PASS", "CONDITIONAL PASS"),
        limits=checks,
        verdict=verdict,
        capped=tuple(dict.fromkeys(reasons)) if checks else (),
        decision_rule=limits.decision_rule,
    )


def _measured(model: Model, evaluation: Evaluation, verification: Verification | None) -> dict[str, Any]:
    """Return the figures by the names of limits; None: not measured."""
    found = evaluation.judged()
    judged = found[1] if found else None
    cells = "".join(model.coverage.rows) if model.coverage else ""
    sigma = model.uncertainty_dph
    return _of_correction(evaluation, "after") | {
        "uncertainty_dph": max(max(row) for row in sigma.rows) if sigma else None,
        "error_bound_dph": verification.error_bound_dph if verification else None,
        "centers": evaluation.model.centers,
        "table_bytes": evaluation.model.table_bytes,
        "rom_bytes": evaluation.model.rom_bytes,
        "ram_bytes": evaluation.model.ram_bytes,
        "rows_left_out": evaluation.rows_left_out,
        "improvement": judged.improvement if judged else None,
        "covered": cells.count("1") / len(cells) if cells else None,
    }


def _of_constant(evaluation: Evaluation) -> dict[str, Any]:
    """Return the figures that a constant for a correction would have, by the names of limits."""
    return _of_correction(evaluation, "constant") | {"improvement": 1.0}


def _of_correction(evaluation: Evaluation, name: Literal["after", "constant"]) -> dict[str, Any]:
    """Return figures of what a correction leaves of the recordings, by the names of limits; None: not measured."""
    found = evaluation.judged()
    role = "exam" if evaluation.exam else "train"
    runs: list[RunStatistics] = [getattr(run, name) for run in evaluation.runs if run.role == role]
    pooled: Statistics | None = getattr(found[1], name) if found else None
    floor, rms = evaluation.noise_floor_dph, pooled.rms_dph if pooled else None

    def worst(values: Iterable[float | None]) -> float | None:
        return max((value for value in values if value is not None), default=None)

    return {
        "rms_dph": rms,
        "std_dph": pooled.std_dph if pooled else None,
        "max_abs_dph": pooled.max_abs_dph if pooled else None,
        "mean_dph": abs(pooled.mean_dph) if pooled and pooled.mean_dph is not None else None,
        "rms_over_floor": rms / floor if floor and rms is not None else None,
        "rms_30min_dph": worst(run.rms_30min_dph for run in runs),
        "angle_1h_arcsec": worst(run.angle_1h_arcsec for run in runs),
        "first_10min_rms_dph": worst(run.first_10min_rms_dph for run in runs),
    }


_NOT_RANDOM = {
    "uncertainty_dph": "is itself a standard uncertainty",
    "error_bound_dph": "proven for every input",
    **dict.fromkeys(("covered", "centers", "table_bytes", "rom_bytes", "ram_bytes", "rows_left_out"), "counted"),
}
"""Figures that no noise of a recording moves."""

_OF_RUNS = ("rms_30min_dph", "angle_1h_arcsec", "first_10min_rms_dph")
"""Figures of whole runs, which spans left out do not have."""


def _limit(name: str, measured: Value, bound: Value, met: bool, why: str) -> Limit:
    """A limit of something that is so or not."""
    verdict: Verdict = "PASS" if met else "FAIL"
    return Limit(limit=name, measured=measured, bound=bound, met=met, verdict=verdict, uncertainty_from=why)


def _amounts(
    limits: Limits, measured: dict[str, Any], evaluation: Evaluation, allowed: Sequence[tuple[Verdict, str]]
) -> Iterator[Limit]:
    known, judged, constant = evaluation.uncertainty or {}, evaluation.judged(), _of_constant(evaluation)
    role: JudgedOn | None = judged[0] if judged else None

    def measured_on(name: str) -> JudgedOn | None:
        if name in _NOT_RANDOM:
            return None
        return "train" if name in _OF_RUNS and role == "left_out" else role

    for part, sign in (("at_most", 1.0), ("at_least", -1.0)):
        for name, bound in getattr(limits, part).model_dump(exclude_none=True).items():
            yield decided(
                f"{part}.{name}",
                measured[name],
                bound,
                sign,
                limits.decision_rule,
                _NOT_RANDOM.get(name) or known.get(name),
                measured_on(name),
                constant=constant.get(name),
                allowed=allowed,
            )


def _needs(needs: Required, evaluation: Evaluation, verification: Verification | None) -> Iterator[Limit]:
    entries = verification.targets if verification else ()
    bounds = [error.numeric for error in verification.errors] if verification else []
    for numeric in needs.arithmetics:
        yield _limit("needs.arithmetics", tuple(sorted(bounds)), numeric, numeric in bounds, "compared")
    for target in needs.targets:
        status = tuple(sorted({entry.status for entry in entries if entry.name == target}))
        yield _limit("needs.targets", status, target, status == ("pass",), "compared")
    if needs.generalises:
        yield _limit("needs.generalises", evaluation.generalises, True, evaluation.generalises is True, "yes or no")
    found = tuple(finding.id for finding in evaluation.findings)
    for name in needs.no_findings:
        there = found if name == "any" else tuple(f for f in found if f == name)
        yield _limit("needs.no_findings", there, name, not there, "yes or no")
