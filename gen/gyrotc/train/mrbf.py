"""The default method: the evidence model, compressed into few anisotropic Gaussians, and a finer map over T.

The evidence process has 40 functions of T; what is narrower than a fifteenth of the range it follows badly, and at the
price of noise everywhere. So bumps are looked for one after the other, beside splines that stand for any smooth map
(of T every 12 C, and with dT/dt and its square every 30 C): the place and the width that explain most, then all
places, widths and heights again by least squares with the linear part projected out (Golub and Pereyra 1973). The
number is that of the smallest BIC, each bump at the price of three parameters. Once more they are looked for beside
steps, each of Gaussians that grow wider in octaves: a step far above the noise would else take many bumps. Steps are
taken where BIC is smaller by the price of one shape more. A map of the rest stands beside them.

1. Means over 50 s are gathered into bins; a Hilbert-space Gaussian process is fitted by maximum evidence.
2. A Kohonen network on the bins proposes places; orthogonal least squares picks among them; variable
   projection moves all centers and widths. The target is the mean of the process, not the samples.
3. The number of centers is the smallest whose departure d from the process' mean is at most 1/10 of the
   process' own expected squared error v. Predicted RMS over noise floor: √(1 + v + d).
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..common.arrays import FloatArray
from ..common.metrics import MAD_TO_SIGMA
from .data import Bins, Scaling, TrainingData, scaling_of
from .evidence import Process, fit_process, not_white
from .result import Outcome, network
from .simple import FLAT, without_rate

_WIDTHS_C = (1.0, 1.4, 2.0)  # tried; one wider bump in the place of two narrow ones would stay there
_LIMITS_C = (0.6, 3.5)  # refined; blocks of 10 s at 5 C/min are 0.8 C long, wider ones the process follows
_STEP_WIDTHS_C, _STEP_LIMITS_C = (1.0, 1.5, 2.2, 3.2), (0.6, 5.0)  # the same of steps: of 10 to 90 % in 2.2 widths
_OCTAVES, _STEP_GAUSSIAN = 4, 1.1  # a step is left 16 times as wide to the map; narrowest Gaussian, in widths of a step
_BEYOND_C = 5.0  # a bump's middle may lie so far outside the samples
_MOST = 24  # as many as a map of the evidence process has
_SPLINE_C = (12.0, 30.0)  # between knots: of T, and of what depends on dT/dt
_CELL_C, _CELL_C_PER_MIN = (0.25, 0.5)  # of bins: a quarter of the narrowest bump; splines are smooth over dT/dt
_SLOW_S = 600.0  # noise of gyros is slower than this in part: more samples of one place say no more
_OUTLIER = 4.5  # robust standard deviations, as in the evidence process
_PARAMETERS = 3  # of a bump or a step: place, width, height
_OWN = 0.02  # share of a bump's energy that must be its own beside splines and other bumps
_LEAST, _WORSE = 6, 2.0  # bumps that are tried, and prices above the best criterion at which the search ends
MEAN_S = 100.0  # independent means for BIC
_ROUNDS = 12  # of refinement: the next bump moves all of them again


@dataclass(frozen=True, slots=True)
class Bumps:
    """Gaussians of T alone: height · exp(−((T − center)/width)²), T kept to the range of the samples.

    Attributes:
        centers_c, widths_c, heights_dph: One entry for each.
        range_c: Lowest and highest temperature of the samples.
    """

    centers_c: tuple[float, ...]
    widths_c: tuple[float, ...]
    heights_dph: tuple[float, ...]
    range_c: tuple[float, float]

    def __call__(self, temperature_c: FloatArray) -> FloatArray:
        """Their sum at temperatures, deg/h, same shape."""
        total = np.zeros(np.shape(temperature_c))
        t = np.clip(temperature_c, *self.range_c)
        for center, width, height in zip(self.centers_c, self.widths_c, self.heights_dph, strict=True):
            total = total + height * np.exp(-(((t - center) / width) ** 2))
        return total

    def beside(self, network: Mapping[str, Any], half_range_c: float) -> dict[str, Any]:
        """A network of `model.json` with the bumps added, ordered by temperature; widths are in half ranges."""
        widths = [width / half_range_c for width in self.widths_c]
        own = zip(self.centers_c, widths, self.heights_dph, strict=True)
        shapes = list(zip(network["centers"], network["widths"], network["weights"], strict=True))
        shapes += [([center, 0.0], [width, FLAT], height) for center, width, height in own]
        shapes.sort(key=lambda shape: (shape[0][0], shape[0][1]))
        centers, widths, weights = ([shape[k] for shape in shapes] for k in range(3))
        return {**network, "centers": centers, "widths": widths, "weights": weights}


def find_bumps(data: TrainingData, scaling: Scaling) -> Bumps:
    """Bumps in cleaned samples; none where BIC asks for none.

    Raises:
        TrainingFailed: The evidence process, which says what the noise is, cannot be solved.
    """
    beside = beside_smooth(data, scaling)
    if beside is None:
        return Bumps((), (), (), scaling.temperature_c)
    price = beside.price(_PARAMETERS)
    (of_bumps, bumps), (with_steps, both) = (_Search(beside, steps=steps).found(price) for steps in (False, True))
    return both if with_steps + price < of_bumps else bumps


def beside_smooth(data: TrainingData, scaling: Scaling) -> BesideSmooth | None:
    """Cleaned samples without outliers beside any smooth map; None where nothing is left of them.

    Raises:
        TrainingFailed: The evidence process, which says what the noise is, cannot be solved.
    """
    process = fit_process(data, scaling)
    t, r = scaling.normalise(data.temperature_c, data.slope_c_per_min)
    weight = data.weight / np.median(data.weight)
    residual = (data.bias_dph - process.mean_dph(t, r)) * np.sqrt(weight)
    sigma = MAD_TO_SIGMA * float(np.median(np.abs(residual)))
    near = np.abs(residual) <= _OUTLIER * sigma
    if sigma <= 0.0 or not near.any():
        return None
    return BesideSmooth(data.select(near), weight[near], sigma, scaling, float(data.duration_s.sum()))


class BesideSmooth:
    """Bins of samples, weighted to unit noise, with the splines projected out.

    Attributes:
        t: Temperature of each bin, C, shape (n,).
        root: Square root of its weight, 1/(deg/h), the same shape.
        range: Lowest and highest temperature of the samples.
        y: Weighted bias beside the splines, the same shape.
    """

    def __init__(self, data: TrainingData, weight: FloatArray, sigma: float, scaling: Scaling, seconds: float) -> None:
        cell = np.floor(data.temperature_c / _CELL_C).astype(np.int64) * 1_000_003
        cell += np.floor(data.slope_c_per_min / _CELL_C_PER_MIN + 0.5).astype(np.int64)
        _, index = np.unique(cell, return_inverse=True)
        count = np.bincount(index, weight)
        self.t, r, y = (
            np.bincount(index, weight * x) / count for x in (data.temperature_c, data.slope_c_per_min, data.bias_dph)
        )
        slow = _SLOW_S / float(np.median(data.duration_s))
        self.root = 1.0 / (sigma * np.sqrt(1.0 / count + 1.0 / slow))
        self.range = scaling.temperature_c
        self._seconds = seconds
        r = r / scaling.half_range_c_per_min
        self._smooth = smooth_basis(self.t, r, self.range, self.root)
        self.y = self.rest(((y - y.mean()) * self.root)[:, None])[:, 0]  # see `smooth_basis`

    def rest(self, columns: FloatArray) -> FloatArray:
        """What the splines do not hold of weighted columns, shape (n, k)."""
        return np.asarray(columns - self._smooth @ (self._smooth.T @ columns))

    def price(self, parameters: int) -> float:
        """Energy that so many parameters must explain by BIC."""
        return parameters * float(np.log(max(self._seconds / MEAN_S, 2.0)))


class _Search:
    """Shapes one after the other. Those of one array x: centers, logarithms of widths, 1 for a step; shape (3 n,)."""

    def __init__(self, beside: BesideSmooth, *, steps: bool) -> None:
        self.t, self.root, self.range, self.y = beside.t, beside.root, beside.range, beside.y
        self._rest = beside.rest
        kinds = ((0, _WIDTHS_C), (1, _STEP_WIDTHS_C if steps else ()))
        tried = [(c, np.log(w), kind) for kind, ws in kinds for w in ws for c in np.arange(*self.range, 0.5 * w)]
        self.tried = np.array(tried).reshape(-1, 3).T
        raw = self._raw(self.tried)
        self.energy = np.einsum("ij,ij->j", raw, raw)
        self.candidates = self._rest(raw)

    def found(self, price: float) -> tuple[float, Bumps]:
        """The smallest criterion and its Gaussians."""
        x, best, at = np.zeros(0), float(self.y @ self.y), np.zeros(0)
        while (number := x.size // 3 + 1) <= _MOST:
            x, square = self._apart(*self._refined(self._with_next(x)))
            count = x.size // 3
            if len(_gaussians(x)[0]) > _MOST:
                break
            if square + price * count < best:
                best, at = square + price * count, x
            elif number > _LEAST and square + price * number > best + _WORSE * price:
                break
            if count < number:
                break
        while x.size > 3:  # what was taken first may be needless beside what came later
            x, square = self._apart(*self._refined(self._without_least(x)))
            if square + price * (x.size // 3) < best and len(_gaussians(x)[0]) <= _MOST:
                best, at = square + price * (x.size // 3), x
        centers, widths, shares, index = _gaussians(at)
        heights = self._solved(at)[0][index] * shares
        return best, Bumps(tuple(centers.tolist()), tuple(widths.tolist()), tuple(heights.tolist()), self.range)

    def _with_next(self, x: FloatArray) -> FloatArray:
        """The shape that explains most of what these leave, added to them."""
        held = np.linalg.qr(self._columns(x))[0]
        own = self.candidates - held @ (held.T @ self.candidates)
        power = np.einsum("ij,ij->j", own, own)
        able = power > _OWN * self.energy
        gain: FloatArray = np.where(able, (own.T @ self._solved(x)[1]) ** 2 / np.where(able, power, 1.0), 0.0)
        return np.column_stack([x.reshape(3, -1), self.tried[:, int(gain.argmax())]]).reshape(-1)

    def _without_least(self, x: FloatArray) -> FloatArray:
        """These shapes without the one whose loss, with the heights of the others fitted anew, is least."""
        columns = self._columns(x)
        q, r = np.linalg.qr(columns)
        inverse = np.linalg.pinv(r)
        heights = inverse @ (q.T @ self.y)
        loss = heights**2 / np.einsum("ij,ij->i", inverse, inverse)
        return np.delete(x.reshape(3, -1), int(loss.argmin()), axis=1).reshape(-1)

    def _apart(self, x: FloatArray, square: float) -> tuple[FloatArray, float]:
        """Refined shapes without those moved onto others: the heights of two in one place grow without end."""
        while x.size > 3:
            raw = self._raw(x)
            columns, energy = self._rest(raw), np.einsum("ij,ij->j", raw, raw)
            own = np.array([_beside(columns, k) for k in range(columns.shape[1])])
            if (own > _OWN * energy).all():
                break
            x, square = self._refined(np.delete(x.reshape(3, -1), int((own / energy).argmin()), axis=1).reshape(-1))
        return x, square

    def _refined(self, x: FloatArray) -> tuple[FloatArray, float]:
        """Places and widths by least squares, and the sum of squares that is left."""
        from scipy.optimize import least_squares

        places, kinds = np.split(x, [2 * (x.size // 3)])
        ends = np.log(np.where(kinds[:, None] > 0, _STEP_LIMITS_C, _LIMITS_C)).T
        around = self.range[0] - _BEYOND_C, self.range[1] + _BEYOND_C
        low, high = (np.r_[np.full(kinds.size, e), of] for e, of in zip(around, ends, strict=True))
        start = np.clip(places, low + 1e-6, high - 1e-6)
        solved = least_squares(
            lambda moved: np.asarray(self._solved(np.r_[moved, kinds])[1]),
            start,
            bounds=(low, high),
            max_nfev=_ROUNDS,
        )
        return np.r_[solved.x, kinds], 2.0 * float(solved.cost)

    def _solved(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Heights, and what is left of the data."""
        columns = self._columns(x)
        heights = np.linalg.lstsq(columns, self.y, rcond=1e-9)[0] if x.size else np.zeros(0)
        return np.asarray(heights, dtype=np.float64), np.asarray(self.y - columns @ heights)

    def _columns(self, x: FloatArray) -> FloatArray:
        return self._rest(self._raw(x))

    def _raw(self, x: FloatArray) -> FloatArray:
        centers, widths, shares, index = _gaussians(x)
        single = np.exp(-(((self.t[:, None] - centers) / widths) ** 2)) * (shares * self.root[:, None])
        return np.asarray(np.add.reduceat(single, np.unique(index, return_index=True)[1], axis=1) if x.size else single)


@cache
def _step() -> FloatArray:
    """Gaussians whose sum is tanh(x) − tanh(x/16) to 0.006: places, widths and heights, shape (3, 10)."""
    widths = _STEP_GAUSSIAN * 2.0 ** np.arange(_OCTAVES + 1)
    x = np.linspace(0.0, 80.0, 1601)
    far = 1.0 / np.sqrt(1.0 + x)  # every octave counts alike
    pairs = [np.exp(-((x / w - 0.5) ** 2)) - np.exp(-((x / w + 0.5) ** 2)) for w in widths]
    wanted = np.tanh(x) - np.tanh(x / 2.0**_OCTAVES)
    heights = np.linalg.lstsq(np.stack(pairs, axis=1) * far[:, None], wanted * far, rcond=None)[0]
    return np.stack([np.r_[0.5 * widths, -0.5 * widths], np.r_[widths, widths], np.r_[heights, -heights]])


def _gaussians(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.int64]]:
    """Centers, widths and heights of the Gaussians of shapes of height 1, and the shape to which each belongs."""
    centers, log_widths, kinds = x.reshape(3, -1)
    parts = [_step() if kind > 0 else np.array([[0.0], [1.0], [1.0]]) for kind in kinds]
    index = np.repeat(np.arange(kinds.size), [part.shape[1] for part in parts])
    places, widths, heights = np.hstack([np.zeros((3, 0)), *parts])
    scale = np.exp(log_widths)[index]
    return centers[index] + scale * places, scale * widths, heights, index


def _beside(columns: FloatArray, k: int) -> float:
    """Energy of a column that is its own beside the others."""
    q = np.linalg.qr(np.delete(columns, k, axis=1))[0]
    return float(np.square(columns[:, k] - q @ (q.T @ columns[:, k])).sum())


def smooth_basis(t: FloatArray, rate: FloatArray, span: tuple[float, float], root: FloatArray) -> FloatArray:
    """Orthonormal columns of any smooth map, shape (n, k).

    Weak directions are left out: of a constant far above the noise a part would stay, so it is taken off before.

    Args:
        t: Temperatures, C, shape (n,).
        rate: dT/dt in half ranges, the same shape.
        span: Lowest and highest temperature, C.
        root: Square roots of weights, the same shape.
    """
    fine, coarse = (_splines(t, span, step) for step in _SPLINE_C)
    columns = np.column_stack([fine, coarse * rate[:, None], coarse * rate[:, None] ** 2])
    left, size, _ = np.linalg.svd(columns * root[:, None], full_matrices=False)
    return np.asarray(left[:, size > 1e-3 * size[0]])


def _splines(t: FloatArray, span: tuple[float, float], step_c: float) -> FloatArray:
    """Cubic B-splines over a range with a knot about every `step_c`."""
    from scipy.interpolate import BSpline  # with what it imports: not for diagnoses without a finer map

    inner = np.linspace(span[0] - 1e-6, span[1] + 1e-6, max(3, 1 + round((span[1] - span[0]) / step_c)))
    knots = np.r_[[inner[0]] * 3, inner, [inner[-1]] * 3]
    return np.asarray(BSpline.design_matrix(np.clip(t, *span), knots, 3).toarray())


MAX_CENTERS = 24  # bounds the time of a fit, and its table at 504 bytes
_DEPARTURE = 0.1  # of the expected squared error: docs/training.md, section 1, step 5
_SETTLED = 0.02  # of a misfit that is small enough: refining stops there, because no choice depends on less
_RIDGE = 0.01  # of the noise variance: it bounds the weights (docs/training.md, section 1)
_KOHONEN_NODES = 40  # candidates: docs/training.md, section 1, step 3
_GAP_GRID = (17, 9)  # points of T and of dT/dt over the envelope
_GAP_WEIGHT = 0.02  # of all samples together: the network follows the process between the ramps, too (step 4)


def fit_mrbf(
    data: TrainingData,
    scaling: Scaling,
    *,
    seed: int,
    centers: int | None,
    average_s: float,
    process: Process | None = None,
) -> Outcome:
    """Trains on cleaned samples whose temperature spans at least 2 C.

    Args:
        data: Cleaned samples.
        scaling: Normalisation of the inputs.
        seed: Draws the start of the Kohonen network.
        centers: Number of centers asked for; None: chosen from the data.
        average_s: Averaging of RMS figures, s.
        process: The evidence process of these samples, where it is known already.

    Raises:
        TrainingFailed: The equations cannot be solved.
    """
    began = time.process_time()
    process = process or fit_process(data, scaling)
    evidence_s = time.process_time() - began
    sizes, chosen, departures = _compress(process, scaling, seed, centers)
    model = process.model
    expected = model.freedom / process.bins.samples * average_s / process.seconds
    per_noise = average_s / (process.seconds * model.sigma**2)
    curves = {
        "sizes": [
            {"centers": m, "departure": float(d * per_noise), "misfit": float(n.misfit)}
            for m, (n, d) in enumerate(zip(sizes, departures, strict=True))
        ],
        "chosen": chosen,
        "expected_error": float(expected),
        **_facts(process),
        "samples": len(data),
        "seconds": {"evidence": evidence_s, "compression": time.process_time() - began - evidence_s},
    }
    kept = process.kept
    residual = (process.y - model.mean(process.t, process.r))[kept]
    withheld = not_white(residual, process.run[kept], process.weight[kept])
    predicted = float(np.sqrt(1.0 + expected + departures[chosen] * per_noise))
    return Outcome(
        networks=(_physical(sizes[chosen], process, scaling),),
        curves=curves,
        predicted_rms_ratio=None if withheld else predicted,
        withheld=withheld,
        process=process,
    )


def fit_mrbf_t(data: TrainingData, scaling: Scaling, *, seed: int, centers: int | None, average_s: float) -> Outcome:
    """A map of T alone, valid over the rates of the samples; arguments and errors as `fit_mrbf`."""
    still = replace(data, slope_c_per_min=np.zeros(len(data)))
    outcome = fit_mrbf(still, scaling_of(still), seed=seed, centers=centers, average_s=average_s)
    flat = [without_rate(one) for one in outcome.networks]
    return replace(outcome, networks=flat, process=None)


def _facts(process: Process) -> dict[str, Any]:
    """What was trained on, and how the maximum of the evidence was found."""
    model = process.model
    return {
        "evidence": {
            "log_parameters": [float(p) for p in model.log_parameters],
            "value": float(model.value),
            "evaluations": int(model.evaluations),
            "freedom": float(model.freedom),
        },
        "means": len(process.y),
        "bins": len(process.bins.t),
        "trimmed": int(np.sum(~process.kept)),
    }


def _compress(
    process: Process, scaling: Scaling, seed: int, centers: int | None
) -> tuple[list[_core.Network], int, list[float]]:
    """Networks by size, the index of the chosen one, mean squared departures (standardised) on the bins."""
    model, bins = process.model, process.bins
    grid_t, grid_r = _envelope_grid(scaling)
    t, r = np.r_[bins.t, grid_t], np.r_[bins.r, grid_r]
    total = float(bins.count.sum())
    weight = np.r_[bins.count, np.full(len(grid_t), _GAP_WEIGHT * total / len(grid_t))]
    noise = model.sigma**2
    solver = _core.VariableProjection(t, r, weight, model.mean(t, r), _RIDGE * noise)
    nodes = _core.kohonen(np.stack([bins.t, bins.r], axis=1), _KOHONEN_NODES, seed=seed).nodes
    enough = _DEPARTURE * model.freedom * noise
    limit, stop = (MAX_CENTERS, enough) if centers is None else (centers, 0.0)
    sizes = solver.path(nodes, limit, stop, _SETTLED * enough, 0.01 * enough)
    target = model.mean(bins.t, bins.r)
    columns: dict[bytes, FloatArray] = {}  # networks that only grew have most of their Gaussians in common
    departures = [float(np.average((target - _evaluated(n, bins, columns)) ** 2, weights=bins.count)) for n in sizes]
    if centers is not None:
        return sizes, len(sizes) - 1, departures
    good = [m for m, d in enumerate(departures) if d * total <= enough]
    return sizes, good[0] if good else len(sizes) - 1, departures


def _envelope_grid(scaling: Scaling) -> tuple[FloatArray, FloatArray]:
    """Points over the whole envelope: between the samples, too, the network shall follow the process."""
    t, r = np.meshgrid(
        np.linspace(*scaling.temperature_c, _GAP_GRID[0]), np.linspace(*scaling.slope_c_per_min, _GAP_GRID[1])
    )
    return scaling.normalise(t.ravel(), r.ravel())


def _evaluated(network: _core.Network, bins: Bins, columns: dict[bytes, FloatArray]) -> FloatArray:
    """A standardised network at bins; `columns` keeps its Gaussians by their shape."""
    w, t, r = network.weights, bins.t, bins.r
    value = w[0] + w[1] * t + w[2] * r
    for shape, weight in zip(network.shapes.T, w[3:], strict=True):
        key = shape.tobytes()
        if key not in columns:
            c, d, s, q = shape
            columns[key] = np.exp(-(((t - c) / np.exp(s)) ** 2) - ((r - d) / np.exp(q)) ** 2)
        value = value + weight * columns[key]
    return np.asarray(value)


def _physical(found: _core.Network, process: Process, scaling: Scaling) -> dict[str, Any]:
    """The network in deg/h, C and C/min, centers ordered by temperature."""
    order = np.lexsort((found.shapes[1], found.shapes[0]))
    w = found.weights * process.spread
    c, d, s, q = found.shapes[:, order]
    centers = np.stack([c * scaling.half_range_c + scaling.center_c, d * scaling.half_range_c_per_min], axis=1)
    return network(w[0] + process.center, w[1:3], centers, np.exp(np.stack([s, q], axis=1)), w[3:][order])
