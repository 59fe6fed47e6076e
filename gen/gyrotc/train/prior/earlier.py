"""A unit's earlier model as the prior of its recalibration.

The earlier result holds the posterior of its map: mean and covariance of the coefficients of the model of training
(`known` of `training.json`). Since then the bias may have moved: the constant by the stated ageing, line and curve over
temperature by half of it. What else became of it the check run says (`hypotheses`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...common.arrays import FloatArray
from ...common.errors import InputError
from ...results.fleet import KnownMap
from ...results.training import ChangeKind, EarlierUse, Training, TriedChange
from ..data import Scaling
from ..gaussian import FEW, GaussianMap, sum_of
from ..process import Asked, Process
from .basis import CONSTANT, PRIOR_LOG, PriorBasis
from .departures import Departures
from .given import Given, UnitSamples
from .hypotheses import Hypothesis, revised, updated
from .learn import LEAST_RATIO
from .run_residual import within
from .unit_means import UnitMeans
from .use import (
    MapPosterior,
    MapPrior,
    curve_of,
    known_map,
    network_of_posterior,
    processed,
    seen_alone,
    triangle,
)

_CELLS = (32, 12)  # of T and dT/dt: where an earlier calibration was, as fine as the coverage of its table
_SHAPE = 0.5  # of the constant's ageing, line and curve: less makes a finding of every slow change of shape
_MEANS: dict[ChangeKind, str] = {
    "unchanged": "is confirmed",
    "offset": "has moved by an offset",
    "slope": "has moved by an offset and a slope",
    "full": "no longer holds: its shape has changed",
}
_LEAST = 1e-6  # of the unit of coefficients: a process has sizes above 0


@dataclass(frozen=True, slots=True)
class EarlierPrior(MapPrior):
    """Prior from a unit's earlier model after ageing.

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

    def with_samples(self, samples: UnitSamples, *, seed: int, average_s: float) -> Given:
        """Find the change since the earlier model, and fit it together with a check run.

        Args:
            samples: Of the check run.
            seed: Of the Kohonen network.
            average_s: Averaging of RMS figures, s.
        """
        alone, unit = seen_alone(samples)
        run = within(self, unit)
        found = revised(self, run, self.unaged)
        posterior = updated(found[0].prior, unit)  # what lies beyond the earlier envelope counts, too
        map_of_both = network_of_posterior(samples, alone, unit, posterior, seed=seed, average_s=average_s)
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


def posterior_of_process(process: Process, scaling: Scaling) -> MapPosterior:
    """Return what the smooth map of a unit's recordings says of it.

    Args:
        process: The map, of the samples alone.
        scaling: Their scaling.
    """
    model = process.model
    assert isinstance(model, GaussianMap)
    every = PriorBasis.of(model.basis, scaling)
    rest = np.append(CONSTANT, model.p[: model.structure.map_parameters])
    told = np.diagonal(sum_of(model.power_ons).products) / model.sigma**2
    counts = every.variance(rest) * told > LEAST_RATIO
    counts[:FEW] = True
    root = model.factor[counts]
    prior = MapPrior(
        basis=every.only(counts),
        center_dph=process.center,
        unit_dph=process.spread,
        temperature_c=scaling.temperature_c,
        slope_c_per_min=scaling.slope_c_per_min,
        means=model.coefficients[counts][None],
        covariances=(root @ root.T)[None],
        share=np.ones(1),
        rest=rest,
        asked=_asked(process, scaling, model),
        freedom=np.inf,
        own=model.scatter,
    )
    return prior.alone()


def _asked(process: Process, scaling: Scaling, model: GaussianMap) -> Asked:
    """Return where the recordings were, by cells of the envelope."""
    bins = process.bins
    number = [np.floor(0.5 * (x + 1.0) * n).astype(np.int64) for x, n in zip((bins.t, bins.r), _CELLS, strict=True)]
    _, cell = np.unique(np.column_stack(number), axis=0, return_inverse=True)
    share = np.bincount(cell.ravel(), bins.count)
    t, r = (np.bincount(cell.ravel(), bins.count * x) / share for x in (bins.t, bins.r))
    places = scaling.center_c + scaling.half_range_c * t, scaling.half_range_c_per_min * r
    known = model.structure.own > 0
    between = process.spread * float(np.sqrt(model.scatter[0])) if known else None
    return Asked(*places, share / share.sum(), between, len(model.power_ons) - 1 if known else None)


def posterior_of_result(training: Training, where: Path) -> MapPosterior:
    """Return what is known of a unit's map by its result, `training` being read from `where`.

    Raises:
        InputError: It does not say enough.
    """
    if training.known is None:
        raise InputError(
            f"{where}, field known",
            "is missing (an extended model, or an earlier gyrotc)",
            "a result of `gyrotc build` without added terms: give that command again",
        )
    return posterior_of_known(training.known, str(where))


def widened(
    posterior: MapPosterior, ageing_dph: float, ageing_from: str, model_hash: str, date: str | None
) -> EarlierPrior:
    """Return an earlier posterior as the prior of today: ageing is added."""
    old, unaged = posterior.prior, posterior.covariance
    moved = PRIOR_LOG.copy()
    sizes = np.array([1.0, _SHAPE, _SHAPE, _LEAST, _LEAST, _LEAST]) * ageing_dph / old.unit_dph
    moved[[0, 1, 2, 3, 4, 6]] = np.log(np.maximum(sizes, _LEAST))
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
        own=old.own,
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
    basis = PriorBasis.read(known.functions)
    lower = triangle(known.root, len(basis.kept), f"{where}, known, root")
    asked = [np.array(x) for x in (known.asked_temperature_c, known.asked_slope_c_per_min, known.asked_share)]
    if len({len(x) for x in asked}) != 1 or not (asked[2].size and asked[2].min() >= 0.0 < asked[2].sum()):
        raise InputError(f"{where}, known, asked_share", "lists that do not go together", "a share for each place")
    if len(known.mean) != len(basis.kept):
        raise InputError(f"{where}, known, mean", f"{len(known.mean)} numbers", f"{len(basis.kept)}, one a function")
    own = np.array(known.own, dtype=np.float64)
    if len(own) > min(len(basis.kept), FEW):
        raise InputError(f"{where}, known, own", f"{len(own)} numbers", f"{FEW} at most, one a coefficient")
    between = known.unit_dph * float(own[0]) if len(own) else None
    prior = MapPrior(
        basis=basis,
        center_dph=known.center_dph,
        unit_dph=known.unit_dph,
        temperature_c=known.temperature_c,
        slope_c_per_min=known.slope_c_per_min,
        means=np.array(known.mean)[None],
        covariances=(lower @ lower.T)[None],
        share=np.ones(1),
        rest=processed(known.rest),
        asked=Asked(asked[0], asked[1], asked[2], between, known.own_freedom),
        freedom=np.inf,
        own=own**2,
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
