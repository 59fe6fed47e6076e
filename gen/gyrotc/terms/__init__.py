"""The catalogue of causes: one module each, listed here.

To add one, write its module (see `base.Term`), put it into `CATALOGUE`, and give `diagnose` its words.
"""

from __future__ import annotations

from . import (
    ageing,
    auxiliary,
    cavity_lag,
    earth_rate_tilt,
    hysteresis,
    map_too_coarse,
    path_length_periodicity,
    sensor_lag,
    thermal_gradient,
    time_misalignment,
    turn_on_offset,
    warm_up,
)
from .base import Features, History, Needs, Parameter, Recursion, Scene, Term

__all__ = ["CATALOGUE", "Features", "History", "Needs", "Parameter", "Recursion", "Scene", "Term"]

CATALOGUE: dict[str, Term] = {
    module.TERM.id: module.TERM
    for module in (
        cavity_lag,
        thermal_gradient,
        time_misalignment,
        hysteresis,
        warm_up,
        turn_on_offset,
        ageing,
        map_too_coarse,
        path_length_periodicity,
        auxiliary,
        sensor_lag,
        earth_rate_tilt,
    )
}
"""Every cause by its id, in the order in which results list them."""
