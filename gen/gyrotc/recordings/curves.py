"""Mean rates of a run over temperature, of every axis that was recorded: what mounting and wiring are judged by."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .earth import earth_rate
from .reading import Recording
from .records import Curve, Run
from .schema import Description, RunEntry

__all__ = ["curves_of"]

_PLACE_C = 1.0  # what counts as the same temperature, as in `judge.findings`


def curves_of(
    description: Description, runs: Mapping[int, Run], recordings: Mapping[str, Recording]
) -> tuple[Curve, ...]:
    """The curve of every run, in their order.

    Args:
        runs: By their number in the description.
    """
    return tuple(
        _curve(run, recordings[run.file], description, description.run[index]) for index, run in runs.items()
    )


def _curve(run: Run, recording: Recording, description: Description, entry: RunEntry) -> Curve:
    cells = recording.evidence.cells
    cells = cells[run.in_span(cells[:, 0])]
    place = np.round(cells[:, 1] / _PLACE_C)
    places, index = np.unique(place, return_inverse=True)
    count = np.bincount(index.reshape(-1), minlength=len(places))
    sums = [np.bincount(index.reshape(-1), column, minlength=len(places)) for column in cells[:, 2:].T]
    weight = run.pulse_weight_arcsec
    scale = 1.0 if weight is None else weight / run.row_period_s
    axes = tuple(recording.layout.axes)
    return Curve(
        file=run.file,
        axes=axes,
        temperature_c=_PLACE_C * places,
        rates_dph=scale * np.column_stack([s / count for s in sums]),
        cells=count,
        earth_dph=_earth(description, entry, axes),
    )


def _earth(description: Description, entry: RunEntry, axes: tuple[str, ...]) -> tuple[float, ...] | None:
    """Earth's rate along every axis, where it is to be computed and the angles of all are stated."""
    if description.earth_rate != "compute" or description.latitude_deg is None:
        return None
    found = []
    for axis in axes or ("",):
        angles = [_angle(entry.axis_azimuth_deg, axis), _angle(entry.axis_elevation_deg, axis)]
        if angles[0] is None or angles[1] is None:
            return None
        along = earth_rate(
            description.latitude_deg, angles[0], angles[1], latitude_sigma_deg=0.0, axis_sigma_deg=0.0
        )
        found.append(along.rate_dph)
    return tuple(found)


def _angle(stated: object, axis: str) -> float | None:
    value = stated.get(axis) if isinstance(stated, Mapping) else None if axis else stated
    return float(value) if isinstance(value, int | float) else None
