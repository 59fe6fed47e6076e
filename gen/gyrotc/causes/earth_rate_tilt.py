"""Earth rate through thermal twist of the fixture: an east axis turns out of east with temperature.

An east axis that is twisted by psi about the vertical and tilted by theta towards north sees
Omega (cos(lat) psi + sin(lat) theta): 5e-5 deg/h for each arcsec at 45 degrees. On one axis it cannot be determined
from the static map, which holds it; it is a simulation of the bench, with nothing to fit.
"""

from __future__ import annotations

import math

import numpy as np

from ..common.arrays import FloatArray
from ..mirror.recursions import first_order
from ..recordings.plausibility import EARTH_RATE_DPH
from .base import Cause, CauseValues, Parameter, Scene, Telling, Wording
from .power_on_temperature import ROOM_C


def _bias(scene: Scene, values: CauseValues, rng: np.random.Generator) -> FloatArray:
    fixture_c = first_order(values["tau_s"], scene.time_s, scene.node_c)
    latitude = math.radians(values["latitude_deg"])
    arcsec_per_c = math.cos(latitude) * values["twist_arcsec_per_c"] + math.sin(latitude) * values["tilt_arcsec_per_c"]
    angle = math.radians(arcsec_per_c / 3600.0) * (fixture_c - ROOM_C)
    return np.asarray(EARTH_RATE_DPH * angle)


CAUSE = Cause(
    id="earth_rate_tilt",
    family="bench",
    rank=120,
    kind="static",
    equation="bias += Omega (cos(lat) twist + sin(lat) tilt) (T_fixture - 20 C)",
    source="Earth rate 15.041 deg/h seen by a misaligned east axis",
    parameters=(
        Parameter("latitude_deg", "deg", -90.0, 90.0, default=45.0),
        Parameter("tau_s", "s", 10.0, 4000.0, default=0.0),
        Parameter("twist_arcsec_per_c", "arcsec/C", 1e-3, 10.0, linear=True, signed=True, default=0.0),
        Parameter("tilt_arcsec_per_c", "arcsec/C", 1e-3, 10.0, linear=True, signed=True, default=0.0),
    ),
    words=Wording(
        name="The fixture turns the axis through Earth rate",
        signature="none on one axis: the static map holds it",
        remedy="a stiffer fixture, or Earth rate computed from its measured angles",
        experiment="the same profile with the gyro rotated by 180 degrees on its fixture",
        telling=Telling.STATIC,
    ),
    bias=_bias,
)
