"""A unit's earlier model as the prior of its recalibration.

The earlier means give the map's posterior in the lot's functions (or it stands in `training.json`, where a lot or a
still earlier model had a share in it). Since then the bias may have moved: the constant by the stated ageing, what
depends on temperature smoothly by half of it. What else became of it the check run says (`hypotheses`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...common.arrays import FloatArray
from ...common.errors import InputError
from ...model import Model
from ...results.fleet import KnownMap
from ...results.training import ChangeKind, EarlierUse, Training, TriedChange
from ..data import Scaling, TrainingData
from ..process import Asked
from .basis import CONSTANT, PRIOR_LOG, LotBasis, fitted_parameters
from .departures import Departures, Hypothesis, revised, updated, within
from .given import Given
from .learn import Envelope, sums_of, that_count
from .unit_means import UnitMeans, means_of
from .use import (
    MapPosterior,
    MapPrior,
    check_positive,
    curve_of,
    known_map,
    network_of_posterior,
    processed,
    seen_alone,
    triangle,
)

_ROUNDS = 20  # of the search for a unit's parameters, as of a lot's
_SHAPE = 0.5  # of the constant's ageing, what depends on T: less makes a finding of every slow change of shape
_MEANS: dict[ChangeKind, str] = {
    "unchanged": "is confirmed",
    "offset": "has moved by an offset",
    "slope": "has moved by an offset and a slope",
    "full": "no longer holds: its shape has changed",
}
_LEAST = 1e-6  # of the unit of coefficients: a process has sizes above 0


@dataclass(frozen=True, slots=True)
class EarlierPrior(MapPrior):
    """What a unit's earlier model says of it after ageing.

    Attributes:
        model_hash, date: Of the earlier model.
        ageing_dph, ageing_from: How far the bias may have moved, 1 sigma, deg/h, and where that comes from.
        unaged: Covariance of the coefficients without ageing, shape (n, n).
    """

    model_hash: str
    date: str | None
    ageing_dph: float
    ageing_from: str
    unaged: FloatArray

    @property
    def key(self) -> str:
        return f"{self.model_hash} {self.ageing_dph!r}"

    def check_axis(self, axis: str | None) -> None:
        """Nothing to refuse: it was read for this axis."""

    def with_samples(self, samples: TrainingData, own: Scaling, serial: str, *, seed: int, average_s: float) -> Given:
        """Finds what became of the earlier model, and fits it with a check run.

        Args:
            samples: Cleaned samples of the check run.
            own: Their scaling.
            serial: The unit's.
            seed: Of the Kohonen network.
            average_s: Averaging of RMS figures, s.
        """
        alone, unit = seen_alone(samples, own)
        run = within(self, unit)
        found = revised(self, run, self.unaged)
        posterior = updated(found[0].prior, unit)  # what lies beyond the earlier envelope counts, too
        map_of_both = network_of_posterior(samples, own, alone, unit, posterior, seed=seed, average_s=average_s)
        use = _use(self, posterior, found, run, None if isinstance(map_of_both, str) else map_of_both[1])
        if isinstance(map_of_both, str):
            text = f"The earlier model is not used: a map with it is refused: {map_of_both}."
            finding = {"id": "map_refused", "text": text, "evidence": {"method": "prior"}}
            return Given(None, [finding], prior=use)
        findings = []
        if use.chosen == "full":
            text = (
                "The earlier model no longer holds: its shape has changed, most by "
                f"{use.change.text if use.change else ''}. Where the check run has not been the map is uncertain by as "
                "much as it has changed elsewhere. Record the whole programme again, or look for what happened to the "
                "unit."
            )
            odds = {one.kind: one.log10_odds for one in use.tried}
            evidence = {"log10_odds": odds, "moved_rms_dph": use.moved.rms_dph, "model": use.model_hash}
            findings = [{"id": "prior_does_not_hold", "text": text, "evidence": evidence}]
        because = f"the earlier model {_MEANS[use.chosen]}"
        return Given(map_of_both, findings, because, prior=use, known=known_map(posterior))


def stated_sigma_dph(rows: FloatArray, envelope: Envelope, between_dph: float, means: UnitMeans) -> float:
    """1 sigma of a map as its table states it, RMS over the means of its calibration, deg/h.

    Args:
        rows: 1 sigma in cells of the envelope, a row for each of dT/dt, T ascending, with the scatter of power-ons.
        envelope: Ranges of T (C) and dT/dt (C/min).
        between_dph: Standard deviation of the constant from power-on to power-on, deg/h, which is taken off.
        means: Of its calibration.
    """
    inputs = (means.temperature_c, means.slope_c_per_min)
    i, j = (
        np.clip(((x - low) / max(high - low, 1e-9) * n).astype(int), 0, n - 1)
        for x, (low, high), n in zip(inputs, envelope, rows.shape[::-1], strict=True)
    )
    variance = float(np.average(rows[j, i] ** 2, weights=means.count)) - between_dph**2
    return float(np.sqrt(max(variance, 0.0)))


def posterior_of_means(
    means: UnitMeans, envelope: Envelope, between_dph: float, stated_dph: float = 0.0
) -> MapPosterior:
    """What recordings of a unit say of its map, the smoothness of which they tell themselves.

    Args:
        means: Of its calibration.
        envelope: Ranges of T (C) and dT/dt (C/min).
        between_dph: Standard deviation of its constant from power-on to power-on, deg/h.
        stated_dph: 1 sigma of the map as its table states it (`stated_sigma_dph`), which runs left out have calibrated:
            a posterior that claims less is widened to it.
    """
    center = float(np.average(means.bias_dph, weights=means.count))
    unit = float(np.sqrt(np.average((means.bias_dph - center) ** 2, weights=means.count))) or 1.0
    basis = LotBasis.over(*envelope)
    sums = sums_of([means], basis, center, unit)
    rest = PRIOR_LOG.copy()
    rest[0] = CONSTANT
    for number in range(_ROUNDS + 1):
        covariance = np.linalg.inv(np.diag(1.0 / basis.variance(rest)) + sums.precision[0])
        mean = covariance @ sums.moment[0]
        if number == 0:
            used = that_count(sums, basis.variance(rest))
            basis, sums = basis.only(used), sums.only(used)
        elif number < _ROUNDS:
            rest = fitted_parameters(basis, mean**2 + np.diag(covariance), 1.0, rest, free=False)
    asked = Asked(means.temperature_c, means.slope_c_per_min, means.count / means.count.sum(), between_dph)
    prior = MapPrior(basis, center, unit, *envelope, mean[None], covariance[None], np.ones(1), rest, asked, np.inf)
    known = prior.alone()
    wider = max(1.0, (stated_dph / known.rms_sigma_dph()) ** 2)
    return replace(known, covariance=wider * covariance)


def posterior_of_result(training: Training, model: Model, where: Path) -> MapPosterior:
    """What is known of a unit's map by its result, `training` being read from `where`.

    Raises:
        InputError: It does not say enough.
    """
    if training.known is not None:
        return posterior_of_known(training.known, str(where))
    means = means_of(training.means, where)
    envelope = model.envelope.temperature_c, model.envelope.slope_c_per_min
    between, table = model.between_dph, model.uncertainty_dph
    stated = stated_sigma_dph(np.array(table.rows), envelope, between, means) if table else 0.0
    return posterior_of_means(means, envelope, between, stated)


def widened(
    posterior: MapPosterior, ageing_dph: float, ageing_from: str, model_hash: str, date: str | None
) -> EarlierPrior:
    """An earlier posterior as the prior of today: ageing is added, and the constant of another power-on."""
    old = posterior.prior
    moved = PRIOR_LOG.copy()
    sizes = np.array([1.0, _LEAST, _SHAPE, _LEAST]) * ageing_dph / old.unit_dph
    moved[[0, 1, 3, 5]] = np.log(np.maximum(sizes, _LEAST))
    unaged = posterior.covariance.copy()
    unaged[0, 0] += (old.asked.between_dph / old.unit_dph) ** 2
    covariance = unaged + np.diag(old.basis.variance(moved) if ageing_dph else 0.0 * posterior.mean)
    return EarlierPrior(
        basis=old.basis,
        center_dph=old.center_dph,
        unit_dph=old.unit_dph,
        temperature_c=old.temperature_c,
        slope_c_per_min=old.slope_c_per_min,
        means=posterior.mean[None],
        covariances=covariance[None],
        share=np.ones(1),
        rest=old.rest,
        asked=old.asked,
        freedom=np.inf,
        model_hash=model_hash,
        date=date,
        ageing_dph=ageing_dph,
        ageing_from=ageing_from,
        unaged=unaged,
    )


def posterior_of_known(known: KnownMap, where: str) -> MapPosterior:
    """The posterior that `training.json` holds.

    Raises:
        InputError: The file contradicts itself.
    """
    basis = LotBasis.read(known.functions)
    lower = triangle(known.covariance, len(basis.kept), f"{where}, known")
    covariance = lower + np.tril(lower, -1).T
    asked = [np.array(x) for x in (known.asked_temperature_c, known.asked_slope_c_per_min, known.asked_share)]
    if len({len(x) for x in asked}) != 1 or not (asked[2].size and asked[2].min() >= 0.0 < asked[2].sum()):
        raise InputError(f"{where}, known, asked_share", "lists that do not go together", "a share for each place")
    if len(known.mean) != len(basis.kept):
        raise InputError(f"{where}, known, mean", f"{len(known.mean)} numbers", f"{len(basis.kept)}, one a function")
    check_positive(covariance, f"{where}, known")
    prior = MapPrior(
        basis=basis,
        center_dph=known.center_dph,
        unit_dph=known.unit_dph,
        temperature_c=known.temperature_c,
        slope_c_per_min=known.slope_c_per_min,
        means=np.array(known.mean)[None],
        covariances=covariance[None],
        share=np.ones(1),
        rest=processed(known.rest),
        asked=Asked(asked[0], asked[1], asked[2], known.between_dph),
        freedom=np.inf,
    )
    return prior.alone()


def _use(
    prior: EarlierPrior, posterior: MapPosterior, found: Sequence[Hypothesis], run: UnitMeans, scaling: Scaling | None
) -> EarlierUse:
    """`scaling`: of the map that was made with the earlier model; None: there is none."""
    alone, chosen = prior.alone(), found[0]
    departures = Departures(alone, run)
    before, after = alone.rms_sigma_dph(), posterior.rms_sigma_dph()
    use = EarlierUse(
        model_hash=prior.model_hash,
        date=prior.date,
        ageing_dph=prior.ageing_dph,
        ageing_from=prior.ageing_from,
        chosen=chosen.kind,
        tried=tuple(
            TriedChange(
                kind=one.kind,
                log10_odds=one.log_odds / math.log(10.0),
                moved_rms_dph=one.moved.rms_dph,
                expanded_uncertainty_dph=one.moved.expanded_uncertainty_dph or 0.0,
            )
            for one in found
        ),
        moved=chosen.moved,
        accepted=scaling is not None,
        change=departures.change(chosen.kind),
        cells=tuple(departures.cells()),
        own_share=1.0 - (after / before) ** 2 if scaling is not None and before > 0.0 else None,
        prior_sigma_dph=before,
        sigma_dph=after,
        curve=curve_of(alone, posterior, scaling) if scaling is not None else None,
        text="",
    )
    return use.model_copy(update={"text": _text(use)})


def _text(use: EarlierUse) -> str:
    of = f"the model {use.model_hash[:16]}" + (f" of {use.date}" if use.date else "")
    aged = f"ageing of {use.ageing_dph:.2g} deg/h (1 sigma; {use.ageing_from})"
    text = f"{of} {_MEANS[use.chosen]}"
    if use.change is None:
        inside = sum(cell.within for cell in use.cells)
        text += f" within its sigma and {aged}: {inside} of {len(use.cells)} parts of the run within limits"
    else:
        text += f", beyond {aged}: {use.change.text}; odds against an unchanged map 10^{use.tried[0].log10_odds:.1f}"
    if not use.accepted:
        return text
    return f"{text}; {use.prior_sigma_dph:.2g} deg/h (1 sigma over the envelope) became {use.sigma_dph:.2g}"
