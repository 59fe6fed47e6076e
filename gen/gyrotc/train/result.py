"""What training gives: networks in the shape of `model.json`, what is known about them, which are refused;
the means that the runs say of a map, which a lot is learnt from and held against.

Or known before: what training takes of a unit from units of its type, or from its earlier model (`Prior`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..common.arrays import FloatArray, parts_of
from ..common.errors import InputError
from ..common.metrics import median_of_parts
from ..quality.findings import longest_stretch
from ..recordings.records import Run
from ..results.fleet import KnownMap, LotUse
from ..results.training import EarlierUse, MapMeans
from .data import Scaling, TrainingData, average, gather
from .evidence import MEAN_S, Process, difference_sigma

Network = Mapping[str, Any]

_CENTER_GRID = 2.0**20  # so that tables hold centers without further rounding (docs/numerics.md)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a method hands to `fit`.

    Attributes:
        networks: The networks as `model.json` has them (docs/FORMAT.md): w0, linear, centers, widths, weights, region.
        curves: For `training.json`.
        predicted_rms_ratio: Predicted RMS over noise floor, None if withheld.
        withheld: Why, empty if it is not.
        process: The evidence model that the networks follow, where the method has one.
    """

    networks: Sequence[Network]
    curves: Mapping[str, Any]
    predicted_rms_ratio: float | None = None
    withheld: str = "the method predicts nothing"
    process: Process | None = None


@dataclass(frozen=True, slots=True)
class Fit:
    """A trained map.

    Attributes:
        method: Name of the method.
        outcome: What the method found; its fields are also attributes of the fit.
        scaling: Normalisation of the inputs and their range in training.
        findings: What a user should know, each with id, text and evidence.
        noise_floor_dph: Estimated noise of means over `average_s`, deg/h.
        average_s: Averaging of RMS figures, s.
        fallback_dph: Weighted mean of the training bias, deg/h.
        candidates: What was tried and chosen from, where the method was left to the data; as in `training.json`.
        reason: Why this one was chosen, in words.
        lot: What a lot did for it, where one was given.
        prior: What an earlier model did for it, where one was given.
        known: What it follows, where a lot or an earlier model was used, for `training.json`.
        process: The evidence model of its samples, where model selection has made one.
    """

    method: str
    outcome: Outcome
    scaling: Scaling
    findings: Sequence[Mapping[str, Any]]
    noise_floor_dph: float
    average_s: float
    fallback_dph: float
    candidates: Sequence[Mapping[str, Any]] = ()
    reason: str = ""
    lot: LotUse | None = None
    prior: EarlierUse | None = None
    known: KnownMap | None = None
    process: Process | None = None

    @property
    def networks(self) -> Sequence[Network]:
        return self.outcome.networks

    @property
    def curves(self) -> Mapping[str, Any]:
        return self.outcome.curves

    @property
    def predicted_rms_ratio(self) -> float | None:
        return self.outcome.predicted_rms_ratio

    @property
    def withheld(self) -> str:
        return self.outcome.withheld

    @property
    def scale(self) -> dict[str, Any]:
        """`scale` of `model.json`."""
        s = self.scaling
        return {"temperature_c": [s.center_c, s.half_range_c], "slope_c_per_min": s.half_range_c_per_min}

    @property
    def envelope(self) -> dict[str, Any]:
        """`envelope` of `model.json`: the range of the training samples."""
        return {
            "temperature_c": list(self.scaling.temperature_c),
            "slope_c_per_min": list(self.scaling.slope_c_per_min),
        }

    @property
    def n_centers(self) -> int:
        return sum(len(network["weights"]) for network in self.networks)

    @property
    def table_bytes(self) -> int:
        """Parameters of the map as 32-bit words: 24 + 20 M for one network."""
        return 12 + sum(12 + 20 * len(network["weights"]) for network in self.networks)

    @property
    def sum_abs_weights(self) -> float:
        """Largest Σ|w| of the networks, deg/h."""
        return max(float(np.abs(network["weights"]).sum()) for network in self.networks)


def network(
    w0: float, linear: ArrayLike = (0.0, 0.0), centers: ArrayLike = (), widths: ArrayLike = (), weights: ArrayLike = ()
) -> dict[str, Any]:
    """A network of plain numbers without a region."""
    return {
        "w0": float(w0),
        "linear": np.asarray(linear, dtype=np.float64).tolist(),
        "centers": np.asarray(centers, dtype=np.float64).tolist(),
        "widths": np.asarray(widths, dtype=np.float64).tolist(),
        "weights": np.asarray(weights, dtype=np.float64).tolist(),
        "region": None,
    }


def snapped(network: Network, scale: Mapping[str, Any]) -> dict[str, Any]:
    """A network with its centers on multiples of 2^-20 of a scale, so that tables hold them without further rounding.

    It moves a center by less than 5e-7 half ranges, far below what the data can tell; the model is what is stored.
    """
    (center, half), slope = scale["temperature_c"], scale["slope_c_per_min"]
    centers = [
        [center + half * _on_grid((t - center) / half), slope * _on_grid(r / slope)] for t, r in network["centers"]
    ]
    return {**network, "centers": centers}


def _on_grid(z: float) -> float:
    return round(z * _CENTER_GRID) / _CENTER_GRID


def rescaled(network: Network, old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    """The same function of temperature and its rate in another scale: linear part and widths count half ranges."""
    (c_old, h_old), (c_new, h_new) = old["temperature_c"], new["temperature_c"]
    wider = (h_new / h_old, new["slope_c_per_min"] / old["slope_c_per_min"])
    linear_t, linear_r = network["linear"]
    return {
        **network,
        "w0": network["w0"] + linear_t * (c_new - c_old) / h_old,
        "linear": [linear_t * wider[0], linear_r * wider[1]],
        "widths": [
            [None if w is None else w / k for w, k in zip(pair, wider, strict=True)] for pair in network["widths"]
        ],
    }


def predict(fit: Fit, temperature_c: ArrayLike, slope_c_per_min: ArrayLike) -> FloatArray:
    """Bias of the map in deg/h at inputs in C and C/min, clamped to the envelope; shapes broadcast."""
    s = fit.scaling
    t = np.clip(np.asarray(temperature_c, dtype=np.float64), *s.temperature_c)
    r = np.clip(np.asarray(slope_c_per_min, dtype=np.float64), *s.slope_c_per_min)
    t, r = np.broadcast_arrays(t, r)
    return networks_dph(fit.networks, s, t, r)


def networks_dph(
    networks: Sequence[Network], scaling: Scaling, temperature_c: FloatArray, slope: FloatArray
) -> FloatArray:
    """Networks at inputs that are already clamped, deg/h; over the overlap of their regions blended linearly.

    A network's share is the distance to the nearest inner edge of its region, in lengths of the region.
    """
    if len(networks) == 1:
        return _network_dph(networks[0], scaling, temperature_c, slope)
    total, shares = np.zeros(temperature_c.shape), np.zeros(temperature_c.shape)
    for one in networks:
        share = np.ones(temperature_c.shape)
        for key, x, envelope in (
            ("temperature_c", temperature_c, scaling.temperature_c),
            ("slope_c_per_min", slope, scaling.slope_c_per_min),
        ):
            low, high = one["region"][key]
            length = (high - low) or 1.0
            if low > envelope[0]:
                share = np.minimum(share, (x - low) / length)
            if high < envelope[1]:
                share = np.minimum(share, (high - x) / length)
        share = np.maximum(share, 0.0)
        total += share * _network_dph(one, scaling, temperature_c, slope)
        shares += share
    return np.asarray(total / shares)


def _network_dph(network: Network, scaling: Scaling, temperature_c: FloatArray, slope: FloatArray) -> FloatArray:
    """One network (docs/FORMAT.md, section 1), deg/h."""
    t, r = scaling.normalise(temperature_c, slope)
    bias = network["w0"] + network["linear"][0] * t + network["linear"][1] * r
    for (c_t, c_r), (d_t, d_r), weight in zip(network["centers"], network["widths"], network["weights"], strict=True):
        u = ((t - (c_t - scaling.center_c) / scaling.half_range_c) / d_t) ** 2
        u = u + ((r - c_r / scaling.half_range_c_per_min) / d_r) ** 2
        bias = bias + weight * np.exp(-u)
    return np.asarray(bias, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Given:
    """What a prior made of a unit's samples.

    Attributes:
        map: Networks and scaling over both envelopes; None: the prior was not used.
        findings: What a user should know.
        reason: Why the map was chosen.
        lot, prior: For `training.json`: what a lot did, or an earlier model.
        known: What the map follows, for `training.json`; None: the prior was not used.
    """

    map: tuple[Outcome, Scaling] | None
    findings: list[dict[str, Any]]
    reason: str = ""
    lot: LotUse | None = None
    prior: EarlierUse | None = None
    known: KnownMap | None = None


class Prior(Protocol):
    """Knowledge of a unit's map that does not come from its own samples."""

    @property
    def key(self) -> str:
        """Hash of what it was made from."""

    def check_axis(self, axis: str | None) -> None:
        """Raises InputError where it is not of this axis."""

    def with_samples(self, samples: TrainingData, own: Scaling, serial: str, *, seed: int, average_s: float) -> Given:
        """Tests whether cleaned samples agree with it, and makes a map of both if they do.

        Args:
            own: Scaling of the samples.
            serial: The unit's.
            seed: Of the Kohonen network.
            average_s: Averaging of RMS figures, s.
        """


# Points of T and of dT/dt: what passes between them is narrower than a sixteenth of the range
_GRID = (33, 17)
_SIGMAS = 4.0  # of the process at a point and of a mean's noise: nothing that a compression loses comes near
_LARGEST_DPH = 7.5e6  # that a table holds


def objection(outcome: Outcome, samples: TrainingData, scaling: Scaling, average_s: float) -> str:
    """Why the networks must not be used, in words; empty if they may.

    They must not leave their process by 4 σ anywhere on the envelope, nor lie beyond the lowest or highest mean of
    the samples by more than these differ, nor hold numbers that no table holds.
    """
    t, r = (
        x.ravel()
        for x in np.meshgrid(
            np.linspace(*scaling.temperature_c, _GRID[0]), np.linspace(*scaling.slope_c_per_min, _GRID[1])
        )
    )
    values = networks_dph(outcome.networks, scaling, t, r)
    if not np.all(np.isfinite(values)):
        return "it is not finite everywhere"
    if _largest(outcome.networks) > _LARGEST_DPH:
        return f"its weights reach {_largest(outcome.networks):.3g} deg/h, more than a table holds"
    process = outcome.process
    if process is not None:
        z = scaling.normalise(t, r)
        noise = process.noise_dph**2 * min(process.seconds / average_s, 1.0)
        sigma = np.sqrt(process.variance_dph2(*z) + noise)
        distance = np.abs(values - process.mean_dph(*z)) / sigma
        if distance.max() > _SIGMAS:
            k = int(np.argmax(distance))
            return f"it leaves the process that it stands for by {distance[k]:.3g} sigma at {_place(t[k], r[k])}"
        if process.asked is not None:  # a lot knows what lies beyond the unit's own means
            return ""
    means = average(samples, average_s).bias_dph
    low, high = float(means.min()), float(means.max())
    beyond = np.maximum(low - values, values - high)
    k = int(np.argmax(beyond))
    rounding = 1e-9 * max(abs(low), abs(high))
    if beyond[k] > high - low + rounding:
        return f"at {_place(t[k], r[k])} it says {values[k]:.4g} deg/h, where the means span {low:.4g} ... {high:.4g}"
    return ""


def _place(t: float, r: float) -> str:
    return f"{t:.4g} C, {r:+.3g} C/min"


def _largest(networks: Sequence[Mapping[str, Any]]) -> float:
    """Largest magnitude of a number of deg/h in the networks."""
    return max(float(np.abs(np.concatenate([[n["w0"]], n["linear"], n["weights"]])).max()) for n in networks)


AGREE_S = 1.0  # longer than any burst of wrong conversions; an alignment does not feel it
_MARGIN = 0.5  # of the range, at either end ...
_LEAST_MARGIN = 0.01  # ... and at least this share of the largest magnitude
_STEPS = 2.0  # times the largest change between two rows
_STUCK = 20.0  # times the longest that a reading stayed the same
# Below two minutes a chamber at rest would count as stuck; above 2000 s a flight would be over before it is reported.
_SHORTEST_STUCK_S, _LONGEST_STUCK_S = 120.0, 2000.0
# A target reads a thermometer once a second or more often; a longer row is a mean or one of many readings, which repeat
# less than those that the target sees: a coarse sensor at rest would count as stuck.
_LONGEST_READING_S = 1.5


def longest_same_s(readings: NDArray[Any], period_s: float) -> float:
    """The longest time for which readings in a row were the same, s; missing ones count as others.

    Infinite where rows are too long to be single readings: they do not show it.
    """
    if period_s > _LONGEST_READING_S:
        return float("inf")
    return longest_stretch(readings)[1] * period_s


def stuck_after_s(longest_s: float) -> float:
    """Time after which a reading that stays the same is stuck, s; 0 where sensor or rows are too coarse to tell."""
    after = max(_STUCK * longest_s, _SHORTEST_STUCK_S)
    return after if after <= _LONGEST_STUCK_S else 0.0


def channel_guard(runs: Sequence[Run], channel: str, missing_s: float) -> dict[str, float]:
    """The guard of an auxiliary channel as training runs showed it, in the fields of `model.json`."""
    low, high, step, longest = np.inf, -np.inf, 0.0, 0.0
    for run in runs:
        column, last = run.rows().channel(channel), np.zeros(0)
        longest = max(longest, longest_same_s(column, run.row_period_s))
        for part in _readings(column):
            low, high = min(low, float(part.min())), max(high, float(part.max()))
            step = max(step, float(np.max(np.abs(np.diff(np.append(last, part))), initial=0.0)))
            last = part[-1:]
        del column  # before the rows of the next run are read
    margin = max(_MARGIN * (high - low), _LEAST_MARGIN * max(abs(low), abs(high)), 1e-6)
    width = high - low + 2.0 * margin
    return {
        "low": low - margin,
        "high": high + margin,
        "max_step": max(_STEPS * step, 0.1 * width),
        "max_rate_per_min": 60.0 * width / missing_s,
        "agree_s": AGREE_S,
        "stuck_s": stuck_after_s(longest),
        "missing_s": missing_s,
        "fallback": median_of_parts(lambda: readings_of(runs, channel)),
    }


def readings_of(runs: Sequence[Run], channel: str) -> Iterator[FloatArray]:
    """What a channel showed in runs, part by part."""
    for run in runs:
        yield from _readings(run.rows().channel(channel))


def _readings(column: FloatArray) -> Iterator[FloatArray]:
    """Those that are not missing, as copies: nobody holds the rows of a run when those of the next are read."""
    for part in parts_of(len(column)):
        found = column[part][np.isfinite(column[part])]
        if found.size:
            yield found


_SPREAD_GRID = 2.0**30  # of a spread: as many digits as a file holds


@dataclass(frozen=True, slots=True)
class UnitMeans:
    """A fully calibrated unit.

    Attributes:
        temperature_c, slope_c_per_min, bias_dph: Gathered means, shape (means,).
        count: Means behind each, the same shape.
        sigma_dph: Noise of a mean of count 1, deg/h.
    """

    temperature_c: FloatArray
    slope_c_per_min: FloatArray
    bias_dph: FloatArray
    count: FloatArray
    sigma_dph: float


def unit_means(samples: TrainingData, scaling: Scaling, process: Process | None) -> tuple[UnitMeans, float]:
    """Means over 50 s of cleaned samples, gathered into cells of 1/50 of each half range; and their length, s.

    Args:
        scaling: Normalisation of the cells.
        process: What the outliers were found by and the noise is known from; None: nothing is left out, and the noise
            is that of differences. Noise that differences do not show (a drift) shows in what a process leaves.
    """
    means = average(samples, MEAN_S)
    weight = means.weight / np.median(means.weight)
    sigma = difference_sigma(means, means.bias_dph, weight)
    kept = np.ones(len(means), dtype=bool)
    if process is not None and len(process.kept) == len(means):
        kept, sigma = process.kept, max(sigma, process.noise_dph)
    t, r = scaling.normalise(means.temperature_c[kept], means.slope_c_per_min[kept])
    bias = means.bias_dph[kept]
    bins = gather(t, r, bias, weight[kept])
    sigma = sigma or max(float(np.std(bias)), abs(float(bias[0])) / _SPREAD_GRID, 1e-12)  # a record without noise
    found = UnitMeans(
        temperature_c=bins.t * scaling.half_range_c + scaling.center_c,
        slope_c_per_min=bins.r * scaling.half_range_c_per_min,
        bias_dph=bins.mean,
        count=bins.count,
        sigma_dph=sigma,
    )
    return found, float(np.median(means.duration_s))


def means_of(means: MapMeans | None, where: Path) -> UnitMeans:
    """Means of a unit as arrays.

    Args:
        where: The `training.json` that they are of.

    Raises:
        InputError: There are none, or they do not go together.
    """
    if means is None:
        raise InputError(
            str(where),
            "has no means (an extended model, or an earlier gyrotc)",
            "a unit as gyrotc fleet or build makes it: give that command again",
        )
    arrays = [np.array(x) for x in (means.temperature_c, means.slope_c_per_min, means.bias_dph, means.count)]
    if len({len(x) for x in arrays}) != 1 or len(arrays[0]) == 0 or arrays[3].min() <= 0.0:
        raise InputError(f"{where}, field means", "lists that do not go together", "one of each a mean")
    return UnitMeans(arrays[0], arrays[1], arrays[2], arrays[3], means.sigma_dph)
