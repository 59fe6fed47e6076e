"""Training samples: what comes in, what is refused, how they are averaged and gathered for the solvers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..common.metrics import cell_length_s, median

# Floors of the scale, so that a constant input is not divided by 0.
MIN_HALF_RANGE_C = 1.0
MIN_HALF_RANGE_C_PER_MIN = 0.05  # rates of a chamber at rest must not be blown up to a whole range
_MOST_PLACES = 2**16  # of a table by cell: more, of inputs far beyond the range, are sorted instead
_BINS_PER_HALF_RANGE = 50  # 1 C x 0.1 C/min over the paper's envelope


@dataclass(frozen=True, slots=True)
class TrainingData:
    """Samples of one axis, all arrays of shape (n,).

    Attributes:
        temperature_c: Temperature in force during the sample, C.
        slope_c_per_min: Temperature rate in force, C/min.
        bias_dph: Mean measured bias over the sample, deg/h.
        weight: Relative weight, > 0 (for example the number of rows behind it).
        run: Index of the run that it belongs to.
        time_s: Start of the sample on the run's clock, s.
        duration_s: Length of the sample, s.
    """

    temperature_c: FloatArray
    slope_c_per_min: FloatArray
    bias_dph: FloatArray
    weight: FloatArray
    run: NDArray[np.int64]
    time_s: FloatArray
    duration_s: FloatArray

    def __len__(self) -> int:
        return len(self.bias_dph)

    def select(self, mask: NDArray[np.bool_] | NDArray[np.intp]) -> TrainingData:
        """The samples of a mask or of indices."""
        return TrainingData(**{name: getattr(self, name)[mask] for name in self.__slots__})


@dataclass(frozen=True, slots=True)
class Scaling:
    """Normalisation of the inputs and the range that they had in training."""

    center_c: float
    half_range_c: float
    half_range_c_per_min: float
    temperature_c: tuple[float, float]
    slope_c_per_min: tuple[float, float]

    def normalise(self, temperature_c: FloatArray, slope_c_per_min: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(z_T, z_r) of inputs in C and C/min, not clamped."""
        return (temperature_c - self.center_c) / self.half_range_c, slope_c_per_min / self.half_range_c_per_min


@dataclass(frozen=True, slots=True)
class Bins:
    """Samples gathered into cells of the normalised input plane; arrays of shape (bins,)."""

    t: FloatArray
    r: FloatArray
    count: FloatArray
    mean: FloatArray
    within: float
    samples: float


def joined(parts: Sequence[TrainingData]) -> TrainingData:
    """Samples of several parts as one, in their order."""
    names = TrainingData.__slots__
    return TrainingData(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def cleaned_samples(data: TrainingData) -> TrainingData:
    """Checks, sorts by run and time, drops exact duplicates; slopes and temperatures keep their values.

    Raises:
        InputError: Lengths differ, nothing is there, a value is not finite, a weight or duration is not
            positive.
    """
    columns = _checked(data)
    order = _clean_order(columns)
    if order is not None:
        columns = {name: column[order] for name, column in columns.items()}
    run = columns.pop("run").astype(np.int64)
    return TrainingData(run=run, **columns)


def cleaned_beside(data: TrainingData, values: FloatArray) -> FloatArray:
    """Return values that samples have, shape (n,), for those that `cleaned_samples` returns, in their order."""
    order = _clean_order(_checked(data))
    return values if order is None else values[order]


def _clean_order(columns: Mapping[str, FloatArray]) -> NDArray[np.intp] | None:
    """Return which samples are kept, in order of run and time; None: all of them as they are."""
    run, time = np.diff(columns["run"]), np.diff(columns["time_s"])
    if np.all((run > 0) | ((run == 0) & (time > 0))):
        return None
    keys = ("run", "time_s", "temperature_c", "slope_c_per_min", "bias_dph")  # the first counts most
    order = np.lexsort([columns[name] for name in reversed(keys)])
    same = np.all([np.diff(columns[name][order]) == 0 for name in keys], axis=0)
    return np.asarray(order[np.r_[True, ~same]])


def _checked(data: TrainingData) -> dict[str, FloatArray]:
    """Columns by name, after the checks of `cleaned_samples`."""
    columns = {name: np.asarray(getattr(data, name), dtype=np.float64) for name in data.__slots__}
    if len({c.shape for c in columns.values()}) != 1 or columns["run"].ndim != 1:
        raise InputError("training data", "arrays differ in length", "one value of each kind for every sample")
    if len(columns["run"]) == 0:
        raise InputError("training data", "no samples", "at least one valid sample of a training run")
    for name, column in columns.items():
        wrong = ~np.isfinite(column)
        if wrong.any():
            where = f"training data, {name}, sample {int(np.argmax(wrong))}"
            raise InputError(where, repr(float(column[np.argmax(wrong)])), "a finite number")
    for name in ("weight", "duration_s"):
        if columns[name].min() <= 0.0:
            raise InputError(f"training data, {name}", repr(float(columns[name].min())), "a number above 0")
    return columns


def scaling_of(data: TrainingData) -> Scaling:
    """Centre and half range of the samples, with the floors of 1 C and 0.05 C/min."""
    t0, t1 = float(data.temperature_c.min()), float(data.temperature_c.max())
    r0, r1 = float(data.slope_c_per_min.min()), float(data.slope_c_per_min.max())
    return Scaling(
        center_c=0.5 * (t0 + t1),
        half_range_c=max(0.5 * (t1 - t0), MIN_HALF_RANGE_C),
        half_range_c_per_min=max(-r0, r1, MIN_HALF_RANGE_C_PER_MIN),
        temperature_c=(t0, t1),
        slope_c_per_min=(r0, r1),
    )


def average_samples(data: TrainingData, length_s: float) -> TrainingData:
    """Weighted means over `length_s` within each run, in cells of the run's clock; longer samples stay as they are.

    Args:
        data: Samples as `cleaned_samples` returns them.
        length_s: Length of a mean, s.

    Returns:
        One sample for each cell that holds any: means of inputs and bias, summed weight and duration.
    """
    cells = mean_cells(data, length_s)
    if cells.edges is None:
        return data
    return TrainingData(
        temperature_c=cells.mean(data.temperature_c),
        slope_c_per_min=cells.mean(data.slope_c_per_min),
        bias_dph=cells.mean(data.bias_dph),
        weight=cells.weight,
        run=data.run[cells.edges],
        time_s=data.time_s[cells.edges],
        duration_s=np.add.reduceat(data.duration_s, cells.edges),
    )


@dataclass(frozen=True, slots=True)
class MeanCells:
    """Samples of each mean: those from an edge to the next; None: each sample is its own.

    Attributes:
        edges: First sample of each mean.
        of: Weights of the samples.
        weight: Weights of the means.
    """

    edges: NDArray[np.intp] | None
    of: FloatArray
    weight: FloatArray

    def mean(self, x: FloatArray) -> FloatArray:
        """Weighted means of what samples have, shape (means,)."""
        if self.edges is None:
            return x
        return np.asarray(np.add.reduceat(x * self.of, self.edges) / self.weight)


def mean_cells(data: TrainingData, length_s: float) -> MeanCells:
    """Cells of `average_samples`: a sample belongs to that which holds its middle, whatever its clock's jitter."""
    usual_s = median(data.duration_s)
    if cell_length_s(length_s, usual_s) == usual_s:
        return MeanCells(None, data.weight, data.weight)
    next_run = data.run[1:] != data.run[:-1]
    starts = np.concatenate([[0], next_run.nonzero()[0] + 1])
    origin = np.repeat(data.time_s[starts], np.diff(starts, append=len(data)))
    cell = np.floor((data.time_s + 0.5 * data.duration_s - origin) / length_s)
    edges = np.concatenate([[0], (next_run | (cell[1:] != cell[:-1])).nonzero()[0] + 1])
    return MeanCells(edges, data.weight, np.add.reduceat(data.weight, edges))


def weighted_mean(values: FloatArray, weight: FloatArray) -> float:
    """Return what `np.average` gives, without its checks; the weights add up to more than 0."""
    return float((values * weight).sum() / weight.sum())


def bin_of(t: FloatArray, r: FloatArray) -> NDArray[np.int64]:
    """Cells of 1/50 of each half range that hold samples, numbered in order of T, then of dT/dt: that of each."""
    cell_t = np.floor(t * _BINS_PER_HALF_RANGE + 0.5).astype(np.int64)
    cell_r = np.floor(r * _BINS_PER_HALF_RANGE + 0.5).astype(np.int64)
    first_t, first_r = int(cell_t.min()), int(cell_r.min())
    width = int(cell_r.max()) - first_r + 1
    places = (int(cell_t.max()) - first_t + 1) * width
    place = (cell_t - first_t) * width + (cell_r - first_r)
    if places > _MOST_PLACES:
        return np.asarray(np.unique(place, return_inverse=True)[1], dtype=np.int64)
    there = np.zeros(places, dtype=bool)
    there[place] = True
    return np.asarray((np.cumsum(there) - 1)[place])


def gather(t: FloatArray, r: FloatArray, y: FloatArray, weight: FloatArray) -> Bins:
    """Gather samples at normalised inputs into cells of 1/50 of each half range.

    `weight` is in units of one sample: the noise variance of a sample of weight w is σ²/w.
    """
    index = bin_of(t, r)
    count = np.asarray(np.bincount(index, weight), dtype=np.float64)
    mean = np.bincount(index, weight * y) / count
    return Bins(
        t=np.bincount(index, weight * t) / count,
        r=np.bincount(index, weight * r) / count,
        count=count,
        mean=mean,
        within=float(np.dot(weight, (y - mean[index]) ** 2)),
        samples=float(len(y)),
    )
