"""Find what may have become of a unit since its earlier calibration.

A laboratory tries the simple answers first: the earlier map as it is, moved by an offset, moved by an offset and a
slope over T and dT/dt, or changed in its whole shape. Each is a normal distribution of the map about the earlier one,
with the earlier map's own covariance, so that their evidences are comparable (MacKay 1992): the more an answer could
explain, the better it has to explain the run. How large the change is nobody knows: its size is equally likely in every
decade, and the evidence is the mean over sizes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...common.arrays import FloatArray
from ...results.evaluation import At, MapDifference
from ...results.training import ChangeKind
from .run_residual import RunResidual
from .unit_means import UnitMeans
from .use import MapPosterior, MapPrior

COVERAGE_FACTOR = 2.0
"""k of U, about 95 % (JCGM 100:2008, G.1)."""

_SIZES = np.logspace(0.0, 5.0, 21)  # of a change, over 1 sigma of the earlier map: five decades, four to each
_GRID = (61, 25)  # points of T and of dT/dt over the envelope, as for the distance of two maps
# A new shape of size 1 is the sum of two processes (`basis.PARAMETERS`): one of short scale over T, with a constant and
# with what couples T and dT/dt, and one of long scale. Line, curve and slope would go on where the run has not been.
_NONE = 1e-6
_NEW_SHAPE = (
    (1.0, _NONE, _NONE, _NONE, 0.3, 0.15, 0.3, 0.8, 0.8),
    (_NONE, _NONE, _NONE, _NONE, 1.0, 0.7, _NONE, 0.8, 0.8),
)
_RIDGE = 1e-9  # of a line written in the functions: their sines nearly repeat one another inside the envelope
# Strong evidence (Kass and Raftery 1995), which more than an offset needs: where the run has not been, an offset is the
# same, and any other change a guess
_STRONG = np.log(20.0)


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """An answer to what became of the unit.

    Attributes:
        kind: Which.
        log_odds: Natural logarithm of its evidence over that of the unchanged map; of more than an offset less that of
            strong evidence.
        prior: What it makes of the earlier map before the run.
        moved: How far the map then moves over the earlier one's envelope. Its U is twice the RMS move that the noise
            of the run and the uncertainty of the earlier map give although the unit has not changed.
        allowed_dph: The same with the ageing that is stated.
    """

    kind: ChangeKind
    log_odds: float
    prior: MapPrior
    moved: MapDifference
    allowed_dph: float

    @property
    def consistent(self) -> bool:
        """True if the map moves by more than U where it has changed, and by no more than allowed elsewhere."""
        if self.kind == "unchanged":
            return self.moved.rms_dph <= self.allowed_dph
        return bool(self.moved.significant)


def updated(prior: MapPrior, run: UnitMeans) -> MapPosterior:
    """Update the map of one cluster with a run."""
    before = prior.alone()
    covariance, residual = before.covariance, RunResidual(before, run)
    gain = residual.gain(covariance)
    rest = np.eye(len(covariance)) - gain @ residual.values
    after = rest @ covariance @ rest.T + gain @ residual.noise @ gain.T  # Joseph's form: positive in spite of rounding
    return replace(before, mean=before.mean + gain @ residual.left, covariance=after)


def revised(prior: MapPrior, run: UnitMeans, unaged: FloatArray) -> list[Hypothesis]:
    """Return all answers, the one to be taken first: the best supported of those that are consistent, then the others.

    Args:
        prior: The earlier map with its ageing.
        run: Means of the check run.
        unaged: Covariance of the earlier map without it, shape (n, n).
    """
    return sorted(_tried(prior, run, unaged), key=lambda one: (not one.consistent, -one.log_odds))


def _tried(prior: MapPrior, run: UnitMeans, unaged: FloatArray) -> Iterator[Hypothesis]:
    before = prior.alone()
    covariance, residual = before.covariance, RunResidual(before, run)
    where = prior.unit_dph * prior.basis.values(*_inputs(prior))
    sizes = _SIZES * before.rms_sigma_dph() / prior.unit_dph
    same = residual.scatter(covariance)
    for kind, root in _changes(prior, run, where):
        values = residual.log_odds(same, root, sizes)
        best = covariance + float(sizes[int(np.argmax(values))]) ** 2 * (root @ root.T)
        mean = float(np.logaddexp.reduce(values) - np.log(len(values)))
        gain = where @ residual.gain(best)
        yield Hypothesis(
            kind,
            mean - (_STRONG if kind in ("slope", "full") else 0.0),
            replace(prior, covariances=best[None]),
            _moved(prior, gain @ residual.left, _expanded(gain, residual.scatter(unaged))),
            _expanded(gain, same),
        )


def _changes(prior: MapPrior, run: UnitMeans, where: FloatArray) -> Iterator[tuple[ChangeKind, FloatArray]]:
    """Yield each kind of change with the root of its covariance for size 1, shape (n, m).

    Beyond what the run has seen no slope goes on.
    """
    n = len(prior.means[0])
    offset = np.eye(n)[:, :1]
    ends = (run.temperature_c, prior.temperature_c), (run.slope_c_per_min, prior.slope_c_per_min)
    gram, lines = where.T @ where, []
    for place, (seen, (low, high)) in zip(_places(), ends, strict=True):
        a, b = (2.0 * (float(x) - low) / max(high - low, 1e-9) - 1.0 for x in (seen.min(), seen.max()))
        line = where.T @ np.clip(place, a, b)  # in the functions' own unit
        lines.append(prior.unit_dph * np.linalg.solve(gram + _RIDGE * np.trace(gram) * np.eye(len(gram)), line))
    shape = np.sum([prior.basis.variance(np.log(process)) for process in _NEW_SHAPE], axis=0)
    yield "unchanged", np.zeros((n, 1))
    yield "offset", offset
    yield "slope", np.column_stack([offset, *lines])
    yield "full", np.diag(np.sqrt(shape))


def _places() -> tuple[FloatArray, FloatArray]:
    """T and dT/dt over an envelope, each from -1 to 1."""
    t, r = np.meshgrid(*(np.linspace(-1.0, 1.0, n) for n in _GRID))
    return t.ravel(), r.ravel()


def _inputs(prior: MapPrior) -> tuple[FloatArray, FloatArray]:
    """Return the places of a grid over the envelope in C and C/min."""
    spans = prior.temperature_c, prior.slope_c_per_min
    t, r = (0.5 * (a + b) + 0.5 * (b - a) * x for (a, b), x in zip(spans, _places(), strict=True))
    return t, r


def _expanded(gain: FloatArray, scatter: FloatArray) -> float:
    """Return twice the RMS by which the map of an unchanged unit moves, deg/h."""
    return COVERAGE_FACTOR * float(np.sqrt(np.mean(np.sum((gain @ scatter) * gain, axis=1))))


def _moved(prior: MapPrior, moved: FloatArray, expanded_dph: float) -> MapDifference:
    rms_dph, worst = float(np.sqrt(np.mean(moved**2))), int(np.argmax(np.abs(moved)))
    t, r = (float(x[worst]) for x in _inputs(prior))
    return MapDifference(
        rms_dph=rms_dph,
        mean_dph=float(np.mean(moved)),
        max_abs_dph=float(np.abs(moved[worst])),
        at=At(temperature_c=t, slope_c_per_min=r),
        rms_over_floor=None,
        expanded_uncertainty_dph=expanded_dph,
        significant=rms_dph > expanded_dph,
    )
