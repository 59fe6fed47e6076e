"""`--prior DIR`: from an earlier calibration to the prior of a unit's recalibration; what a unit learned in service."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Literal

import numpy as np

from .. import __version__
from ..assess.budget import DAYS_A_YEAR, yearly_drifts
from ..assess.changes import Earlier, load_earlier, started_on
from ..assess.limits import Limits
from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..common.inputs import MOST_CENTERS, checked, read_input
from ..lot.service import learning_in, words_in
from ..mirror.learning import E_ID, KNOTS, OK, Learner, full
from ..model import Model, Network, load_model
from ..recordings.records import Dataset
from ..results.base import Finding, Size, read_result
from ..results.evaluation import InService, LearnedKnot, ServedStops
from ..results.fleet import Lot
from ..results.training import MapMeans, Training
from ..train.fitting import FitOptions
from ..train.prior.earlier import EarlierPrior, posterior_of_result, widened
from ..train.prior.learn import FALSE_ALARM
from ..train.prior.use import MapPosterior, prior_of
from ..train.result import means_of


def prior_from(
    folder: Path, dataset: Dataset, *, ageing_dph: float | None = None, limits: Limits | None = None
) -> EarlierPrior:
    """What an earlier result says of a unit today.

    Args:
        folder: What `gyrotc build` wrote of the same gyro.
        dataset: The recordings of the check run.
        ageing_dph: How far the bias may have moved since, 1 sigma; None: by the limits file's drift of the type or by
            the unit's earlier calibrations, and the dates; else 0.
        limits: Limits of the product.

    Raises:
        InputError: It is of another gyro, cannot be read, or is made from the same recordings.
    """
    earlier = load_earlier(folder, dataset.serial, dataset.axis, "--prior")
    seen = {d.sha256 for d in earlier.model.data}
    for run in dataset.runs:
        if run.role == "train" and run.sha256 in seen:
            raise InputError(run.file, f"the model in {folder} was made from it", "recordings of its own")
    where = earlier.folder / "training.json"
    posterior = posterior_of_result(read_result(where, Training), earlier.model, where)
    aged, stated = _ageing(earlier, dataset, ageing_dph, limits)
    return widened(posterior, aged, stated, earlier.model.hash, earlier.date)


def refuse_together(options: FitOptions, prior: Path | None, ageing_dph: float | None) -> None:
    """Refuses options that say different things.

    Raises:
        InputError: They do.
    """
    if prior is not None and options.prior is not None:
        found = "with --prior: what the lot knew of the unit is in its earlier model already"
        raise InputError("--lot", found, "one of the two")
    if prior is None and ageing_dph is not None:
        raise InputError("--ageing", "without --prior", "an earlier model that may have aged")


def with_prior(
    options: FitOptions, dataset: Dataset, folder: Path | None, ageing_dph: float | None, limits: Limits | None = None
) -> FitOptions:
    """Options of a fit with what an earlier result says; as they are where none is named.

    Raises:
        InputError: As `refuse_together` and `prior_from`.
    """
    refuse_together(options, folder, ageing_dph)
    if folder is None:
        return options
    return replace(options, prior=prior_from(folder, dataset, ageing_dph=ageing_dph, limits=limits))


def unit_in(folder: Path, lot: Lot | None = None) -> tuple[Model, MapPosterior, MapMeans]:
    """A unit's model, what is known of its map, and the means of its own runs.

    Args:
        folder: Its result.
        lot: What units of its type share, for one that was calibrated without; else its result says all.

    Raises:
        InputError: The result does not say enough, or the unit does not fit the lot.
    """
    if not (folder / "model.json").is_file():
        raise InputError(f"--unit {folder}", "has no model.json", "a folder that gyrotc build or fit wrote")
    model, where = load_model(folder / "model.json"), folder / "training.json"
    training = read_result(where, Training)
    means = means_of(training.means, where)
    assert training.means is not None
    if lot is None or training.known is not None:
        return model, posterior_of_result(training, model, where), training.means
    if lot.axis != model.axis:
        raise InputError("--lot", f"of axis {lot.axis}", f"a lot of axis {model.axis}, as the unit")
    known = prior_of(lot).with_runs(means)
    if known.p_value < FALSE_ALARM:
        raise InputError("--lot", f"the unit does not fit it (p = {known.p_value:.2g})", "its own lot, or none")
    return model, known, training.means


def _ageing(earlier: Earlier, dataset: Dataset, stated: float | None, limits: Limits | None) -> tuple[float, str]:
    """How far the bias may have moved, 1 sigma, deg/h, and where that comes from."""
    if stated is not None:
        if not (math.isfinite(stated) and stated >= 0.0):
            raise InputError("--ageing", f"{stated:g}", "deg/h, 0 or more")
        return stated, "as stated"
    try:
        then, now = (date.fromisoformat(str(day)[:10]) for day in (earlier.date, started_on(dataset)))
    except ValueError:
        return 0.0, "none: one of the calibrations has no date, and no --ageing is stated"
    years = max((now - then).days, 0) / DAYS_A_YEAR
    drift = limits.interval.drift_dph_per_year if limits and limits.interval else None
    if drift is not None:
        return drift * years / math.sqrt(3.0), "the type's largest drift, by the limits file"
    drifts = yearly_drifts(earlier.history)
    if not drifts:
        return 0.0, "none: neither --ageing, nor a drift of the type, nor earlier calibrations"
    drift = math.sqrt(math.fsum(d**2 for d in drifts) / len(drifts))
    return drift * years, f"by {len(drifts) + 1} earlier calibrations"


Moved = Literal["nothing", "offset", "slope", "shape"]
_DAY_S = 86400.0  # by definition
_AT_AUTHORITY = 0.99  # of it: a knot that far was held there
_STRAIGHT = 1e-6  # of a change: rounding leaves less of one that is straight
_MOST_STOPS = 100_000  # one each hour in eleven years
_LATE_POWER_ONS = 10  # of them the stops are asked, ten at least: a gate of 4 sigma refuses none of them by chance
_COVERAGE = 2.0  # sigmas that a drift must exceed its limit by


def stops_in(path: Path) -> ServedStops:
    """Stops in service: CSV with the columns that `gyrotc simulate service` writes.

    Raises:
        InputError: A column is missing, or a value is none.
    """
    text = read_input(path, "text_mib", "stops in service").decode("utf-8", "replace")
    rows = list(csv.DictReader(text.splitlines()))
    if not rows or len(rows) > _MOST_STOPS:
        raise InputError(str(path), f"{len(rows)} stops", f"1 ... {_MOST_STOPS}")
    columns = {}
    for name in ServedStops.model_fields:
        kind = int if name in ("power_on", "status") else float
        try:
            columns[name] = tuple(kind(row[name]) for row in rows)
        except (KeyError, TypeError, ValueError) as error:
            found = "is missing" if name not in rows[0] else "has a value that is no number"
            raise InputError(
                f"{path}, column {name}", found, f"the columns {', '.join(ServedStops.model_fields)}"
            ) from error
    return checked(ServedStops, columns, str(path))


def learned_in_service(
    unit: Path, words: Path, limits: Limits | None = None, stops: Path | None = None
) -> tuple[InService, Model | None]:
    """What a unit learned, beside the chamber's table, and the model that has it in its map.

    Args:
        unit: The result whose table was in service.
        words: What `gtc_learn_save` kept of it, as hexadecimal text.
        limits: Limits of the product, for the drift of its type.
        stops: Where they were learned, for the page.

    Raises:
        InputError: The words are damaged, of another table, or the result has no learning.
    """
    model, learning, prior = learning_in(unit)
    learner = Learner(prior)
    if (status := learner.restore(words_in(words))) != OK:
        found = "of another table" if status == E_ID else "damaged or cut off"
        raise InputError(str(words), f"is {found}", f"words of a unit with the table in {unit}")
    knots_c = np.linspace(*model.envelope.temperature_c, KNOTS)
    shift, age_s = learner.x[:KNOTS, 0].astype(np.float64), float(learner.service_s)
    sigma, unlearned = (
        np.sqrt(np.maximum(np.diag(full(p)), 0.0))
        for p in (learner.p[: len(prior.map_var), 0], prior.map_var + age_s * prior.ageing_var)
    )
    sigma = np.minimum(sigma, unlearned)
    moved, change = _simplest(knots_c, shift, sigma)
    years = age_s / _DAY_S / DAYS_A_YEAR
    drift = limits.interval.drift_dph_per_year if limits and limits.interval else None
    limit = None if drift is None else drift * years
    served = stops_in(stops) if stops else None
    findings = (*_findings(knots_c, shift, sigma, learning.authority_dph, limit), *_of_stops(served))
    new = None if findings or moved == "nothing" else _with_shift(model, knots_c, change, sigma)
    table = model.map_dph(knots_c, 0.0)
    rows = zip(knots_c.tolist(), table.tolist(), shift.tolist(), sigma.tolist(), unlearned.tolist(), strict=True)
    result = InService(
        gyrotc_version=__version__,
        serial=model.serial,
        axis=model.axis,
        model_hash=model.hash,
        power_ons=learner.power_ons,
        days=age_s / _DAY_S,
        authority_dph=learning.authority_dph,
        drift_limit_dph=limit,
        knots=tuple(
            LearnedKnot(temperature_c=t, table_dph=b, shift_dph=y, sigma_dph=s, unlearned_dph=u)
            for t, b, y, s, u in rows
        ),
        moved=moved,
        new_model_hash=new.hash if new else None,
        findings=findings,
    )
    return (result.model_copy(update={"stops": served}) if served else result), new


def _findings(
    knots_c: FloatArray, shift: FloatArray, sigma: FloatArray, authority: float, limit: float | None
) -> Iterator[Finding]:
    at = int(np.argmax(np.abs(shift) - _COVERAGE * sigma))
    low, high = abs(shift[at]) - _COVERAGE * sigma[at], abs(shift[at]) + _COVERAGE * sigma[at]
    if limit is not None and low > limit:
        yield Finding(
            id="drift_beyond_limit",
            text=f"at {knots_c[at]:.0f} C the bias moved by {abs(shift[at]):.2g} deg/h, more than the {limit:.2g} "
            "deg/h that the type drifts in this time",
            next="calibrate it again in the chamber",
            size=Size(value=abs(float(shift[at])), low=float(low), high=float(high), unit="deg/h"),
        )
    if np.max(np.abs(shift)) >= _AT_AUTHORITY * authority:
        yield Finding(
            id="at_authority",
            text=f"what was learned reaches the authority of {authority:.2g} deg/h: the bias may be further off",
            next="calibrate it again in the chamber",
        )


def _of_stops(stops: ServedStops | None) -> Iterator[Finding]:
    """Whether the unit still learns."""
    if stops is None:
        return
    late = [s for p, s in zip(stops.power_on, stops.status, strict=True) if p > max(stops.power_on) - _LATE_POWER_ONS]
    refused = sum(status < 0 for status in late)
    if len(late) >= _LATE_POWER_ONS and refused > len(late) / 2:
        yield Finding(
            id="stops_refused",
            text=f"{refused} of the last {len(late)} stops were refused: the bias is not where this unit has learned "
            "it to be, as after mounting anew, and sigma does not say so",
            next="start its learning anew (gtc_learn_start), or calibrate it again in the chamber",
        )


def _simplest(knots_c: FloatArray, shift: FloatArray, sigma: FloatArray) -> tuple[Moved, FloatArray]:
    """The simplest change within 1 sigma of the shift at every knot, and its values there."""
    steps: tuple[tuple[Moved, int], ...] = (("nothing", -1), ("offset", 0), ("slope", 1))
    for name, degree in steps:
        fitted = np.zeros(KNOTS)
        if degree >= 0:
            fitted = np.polynomial.Polynomial.fit(knots_c, shift, degree, w=1.0 / sigma)(knots_c)
        if np.all(np.abs(shift - fitted) <= sigma):
            return name, fitted
    return "shape", shift


def _with_shift(model: Model, knots_c: FloatArray, change: FloatArray, sigma: FloatArray) -> Model:
    """The model with a change at the knots in its map, and its uncertainty no less than that of the change.

    A straight part goes into the plane; what is left becomes a Gaussian of T at each knot, as wide as they are apart.
    """
    line = np.polynomial.Polynomial.fit(knots_c, change, 1).convert().coef
    slope = float(line[1]) if len(line) > 1 else 0.0
    rest, step = change - line[0] - slope * knots_c, float(knots_c[1] - knots_c[0])
    center, half = model.scale.temperature_c
    bent = bool(np.max(np.abs(rest)) > _STRAIGHT * np.max(np.abs(change)))
    weights = np.linalg.solve(np.exp(-(((knots_c[:, None] - knots_c) / step) ** 2)), rest) if bent else np.zeros(0)
    if model.n_centers + len(weights) * len(model.networks) > MOST_CENTERS:
        raise InputError("the learned shape", f"{len(weights)} more centers", f"{MOST_CENTERS} at most in a table")

    def changed(one: Network) -> Network:
        added = knots_c[: len(weights)].tolist()
        return one.model_copy(
            update={
                "w0": one.w0 + float(line[0]) + slope * center,
                "linear": (one.linear[0] + slope * half, one.linear[1]),
                "centers": (*one.centers, *((t, 0.0) for t in added)),
                "widths": (*one.widths, *((step / half, None) for _ in added)),
                "weights": (*one.weights, *weights.tolist()),
            }
        )

    known = model.uncertainty_dph
    if known is not None:
        low, high = model.envelope.temperature_c
        cells = low + (high - low) * (np.arange(known.cells[0]) + 0.5) / known.cells[0]
        least = np.interp(cells, knots_c, sigma)
        rows = tuple(tuple(float(max(s, m)) for s, m in zip(row, least, strict=True)) for row in known.rows)
        known = known.model_copy(update={"rows": rows})
    return model.model_copy(
        update={
            "networks": tuple(changed(one) for one in model.networks),
            "fallback_dph": model.fallback_dph + float(np.mean(change)),
            "uncertainty_dph": known,
            "meta": {**model.meta, "learned_in_service_onto": model.hash},
        }
    )
