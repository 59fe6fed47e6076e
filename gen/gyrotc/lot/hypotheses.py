"""What may have become of a unit since its earlier calibration, and which of it the check run speaks for.

A laboratory tries the simple answers first: the earlier map as it is, moved by an offset, moved by an offset and a
slope over T and dT/dt, or changed in its whole shape. Each is a normal distribution of the map about the earlier one,
with the earlier map's own covariance, so that their evidences are comparable (MacKay 1992): the more an answer could
explain, the better it has to explain the run. How large the change is nobody knows: its size is equally likely in
every decade, and the evidence is the mean over sizes.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..common.arrays import FloatArray
from ..results.evaluation import At, MapDifference
from ..results.training import ChangeKind
from ..train.means import UnitMeans
from .basis import PRIOR_LOG
from .prior import MapPosterior, MapPrior

_SIZES = np.logspace(0.0, 5.0, 21)  # of a change, over 1 sigma of the earlier map: five decades, four to each
_GRID = (61, 25)  # points of T and of dT/dt over the envelope, as for the distance of two maps
_RIDGE = 1e-9  # of a line written in the functions: their sines nearly repeat one another inside the envelope
_STRONG = np.log(
    20.0
)  # evidence that is strong (Kass and Raftery 1995), which more than an offset needs: where the run
# has not been, an offset is the same, and any other change a guess
_COVERAGE = 2.0  # k of U, about 95 % (JCGM 100:2008, G.1)


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
        """Whether the map moves by more than U where it has changed, and by no more than is allowed where not."""
        if self.kind == "unchanged":
            return self.moved.rms_dph <= self.allowed_dph
        return bool(self.moved.significant)


class _Seen:
    """Means of a run against a map that has not seen them, in deg/h.

    Everything is solved among the means, whose noise keeps the equations regular however wide a map's covariance is.
    """

    def __init__(self, prior: MapPrior, run: UnitMeans) -> None:
        inputs = run.temperature_c, run.slope_c_per_min
        self.values = prior.unit_dph * prior.basis.values(*inputs)
        self.noise = np.diag(run.sigma_dph**2 / run.count)
        self.left = run.bias_dph - prior.center_dph - self.values @ prior.means[0]

    def scatter(self, covariance: FloatArray) -> FloatArray:
        """Covariance of what is left under one of the coefficients."""
        return np.asarray(self.values @ covariance @ self.values.T + self.noise)

    def log_odds(self, scatter: FloatArray, root: FloatArray, sizes: FloatArray) -> FloatArray:
        """Log evidence of what is left for changes of some sizes, over that of none.

        Args:
            scatter: Covariance of what is left where nothing has changed.
            root: Of the covariance of the coefficients' change of size 1, shape (n, m).
            sizes: Of the change, in the coefficients' unit.
        """
        white = np.linalg.solve(np.linalg.cholesky(scatter), np.column_stack([self.values @ root, self.left]))
        q, size, _ = np.linalg.svd(white[:, :-1], full_matrices=False)
        more = np.outer(sizes**2, size**2)
        return np.asarray(
            0.5 * np.sum((q.T @ white[:, -1]) ** 2 * more / (1.0 + more) - np.log1p(more), axis=1)
        )

    def gain(self, covariance: FloatArray) -> FloatArray:
        """What the coefficients move by for what is left, shape (coefficients, means)."""
        return np.asarray(np.linalg.solve(self.scatter(covariance), self.values @ covariance).T)


def updated(prior: MapPrior, run: UnitMeans) -> MapPosterior:
    """What a map of one cluster and a run say together."""
    seen, covariance = _Seen(prior, run), prior.covariances[0]
    gain = seen.gain(covariance)
    rest = np.eye(len(covariance)) - gain @ seen.values
    after = (
        rest @ covariance @ rest.T + gain @ seen.noise @ gain.T
    )  # Joseph's form: positive in spite of rounding
    return MapPosterior(prior, prior.means[0] + gain @ seen.left, after, 0, 1.0)


def revised(prior: MapPrior, run: UnitMeans, unaged: FloatArray) -> list[Hypothesis]:
    """All answers, the one to be taken first: the best supported of those that are consistent, then the others.

    Args:
        prior: The earlier map with its ageing.
        run: Means of the check run.
        unaged: Covariance of the earlier map without it, shape (n, n).
    """
    return sorted(_tried(prior, run, unaged), key=lambda one: (not one.consistent, -one.log_odds))


def _tried(prior: MapPrior, run: UnitMeans, unaged: FloatArray) -> Iterator[Hypothesis]:
    covariance, seen = prior.covariances[0], _Seen(prior, run)
    where = prior.unit_dph * prior.basis.values(*_inputs(prior))
    sizes = _SIZES * prior.alone().rms_sigma_dph() / prior.unit_dph
    same = seen.scatter(covariance)
    for kind, root in _changes(prior, run, where):
        values = seen.log_odds(same, root, sizes)
        best = covariance + float(sizes[int(np.argmax(values))]) ** 2 * (root @ root.T)
        mean = float(np.logaddexp.reduce(values) - np.log(len(values)))
        gain = where @ seen.gain(best)
        yield Hypothesis(
            kind,
            mean - (_STRONG if kind in ("slope", "full") else 0.0),
            replace(prior, covariances=best[None]),
            _moved(prior, gain @ seen.left, _expanded(gain, seen.scatter(unaged))),
            _expanded(gain, same),
        )


def _changes(prior: MapPrior, run: UnitMeans, where: FloatArray) -> Iterator[tuple[ChangeKind, FloatArray]]:
    """Root of the covariance of a change of size 1, shape (n, m); beyond what the run has seen no slope goes on."""
    n = len(prior.means[0])
    offset = np.eye(n)[:, :1]
    ends = (run.temperature_c, prior.temperature_c), (run.slope_c_per_min, prior.slope_c_per_min)
    lines = [
        prior.unit_dph * _written(where, np.clip(place, *_relative(seen, span)))
        for place, (seen, span) in zip(_places(), ends, strict=True)
    ]
    process = PRIOR_LOG.copy()
    process[0] = 0.0
    yield "unchanged", np.zeros((n, 1))
    yield "offset", offset
    yield "slope", np.column_stack([offset, *lines])
    yield "full", np.diag(np.sqrt(prior.basis.variance(process)))


def _places() -> tuple[FloatArray, FloatArray]:
    """T and dT/dt over an envelope, each from -1 to 1."""
    t, r = np.meshgrid(*(np.linspace(-1.0, 1.0, n) for n in _GRID))
    return t.ravel(), r.ravel()


def _relative(seen: FloatArray, span: tuple[float, float]) -> tuple[float, float]:
    """Where inputs end within a span that goes from -1 to 1."""
    low, high = span
    ends = (2.0 * (float(x) - low) / max(high - low, 1e-9) - 1.0 for x in (seen.min(), seen.max()))
    a, b = ends
    return a, b


def _inputs(prior: MapPrior) -> tuple[FloatArray, FloatArray]:
    """The same in C and C/min."""
    spans = prior.temperature_c, prior.slope_c_per_min
    t, r = (0.5 * (a + b) + 0.5 * (b - a) * x for (a, b), x in zip(spans, _places(), strict=True))
    return t, r


def _written(where: FloatArray, line: FloatArray) -> FloatArray:
    """Coefficients of the functions that give a line over the envelope, in the functions' own unit."""
    gram = where.T @ where
    return np.asarray(np.linalg.solve(gram + _RIDGE * np.trace(gram) * np.eye(len(gram)), where.T @ line))


def _expanded(gain: FloatArray, scatter: FloatArray) -> float:
    """Twice the RMS by which the map of an unchanged unit moves, deg/h."""
    return _COVERAGE * float(np.sqrt(np.mean(np.sum((gain @ scatter) * gain, axis=1))))


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
