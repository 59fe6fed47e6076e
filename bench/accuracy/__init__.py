"""Accuracy, size and speed of training on simulated gyros, beside other libraries.

The default method is trained on set 1 of the paper's six environments and judged on set 2; selection of centers, whole
methods, the Kohonen network and variable projection run beside scikit-learn, fastcan, SysIdentPy and MiniSom, each in a
process of its own with one thread.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import version
from typing import Any

from ..campaigns import Settings
from ..page import Figure, ResultsTable, figures_table
from ..records import Record
from .gyros import accuracy, invariance
from .speed import speed

_PACKAGES = ("gyrotc", "numpy", "scipy", "scikit-learn", "fastcan", "sysidentpy", "minisom")
_TEXT = """
RMS is divided by the RMS of the simulated noise, so that 1 is a perfect correction. Ten gyros of each scenario are
trained on six runs and judged on six others. CPU seconds are those of one process with one thread.
"""


def measure(settings: Settings) -> Record:
    """Train and judge every method on every gyro, and time it."""
    gyros = 1 if settings.quick else 10
    record: Record = {"versions": {name: version(name) for name in _PACKAGES}, "accuracy": accuracy(gyros)}
    record["invariance"] = invariance(1 if settings.quick else 5)
    return record if settings.quick else record | {"speed": speed()}


def table(record: Record) -> ResultsTable:
    """Return accuracy, size and times of the default method with their aims."""
    return figures_table(_TEXT, [*_accuracy(record), *(_speed(record["speed"]) if "speed" in record else ())])


def _accuracy(record: Record) -> Iterator[tuple[str, Figure]]:
    found = record["accuracy"]
    smooth, *ripple = found["default"]
    changes = [abs(v) for one in found["more_centers"] for v in one["largest"].values()]
    *ours, _ = record["invariance"]["rows"]
    same = min(change["same"] for row in ours for change in row["changes"].values())
    yield "RMS ÷ noise, smooth maps, median", Figure(smooth["ratio"]["median"], ".4f", at_most=1.006)
    yield "RMS ÷ noise, smooth maps, worst", Figure(smooth["ratio"]["worst"], ".4f", at_most=1.015)
    yield "RMS ÷ noise, maps with ripple, worst", Figure(max(x["ratio"]["worst"] for x in ripple), ".4f", at_most=1.02)
    left_out = max(x["median"] for x in found["left_out"])
    yield "RMS ÷ noise at a ramp rate that training has not seen, median", Figure(left_out, ".4f", at_most=1.03)
    yield "largest change of RMS ÷ noise with up to 60 centers", Figure(max(changes), ".4f", at_most=0.005)
    predicted = max(abs(x["found_minus_predicted"] or 0.0) for x in found["default"])
    yield "RMS ÷ noise, measured less predicted, median", Figure(predicted, ".4f", at_most=0.002)
    yield "largest table of a smooth map in float32, bytes", Figure(smooth["bytes"]["worst"], ".0f", at_most=144)
    yield "largest table with ripple, bytes", Figure(max(x["bytes"]["worst"] for x in ripple), ".0f", at_most=264)
    gyros = record["invariance"]["gyros"]
    yield (
        f"gyros of {gyros} with the same centers in rad/s, shuffled, or with every sample twice",
        Figure(same, "d", at_least=gyros),
    )
    median_s = smooth["seconds"]["median"]
    yield "CPU seconds of training, smooth maps, median", Figure(median_s, ".3f", at_most=0.06)
    ripple_s = max(x["seconds"]["median"] for x in ripple)
    yield "CPU seconds of training, maps with ripple, median", Figure(ripple_s, ".3f", at_most=0.25)


def _speed(speed: dict[str, Any]) -> Iterator[tuple[str, Figure]]:
    raw = speed["raw"]
    yield (
        "CPU seconds from six recordings of 2.88 million rows to verified C",
        Figure(raw["seconds"], ".1f", at_most=10),
    )
    yield "peak memory of this, GiB", Figure(raw["peak_gib"], ".2f", at_most=0.5)
