"""Turn-on offset: every power-on draws another constant. An uncertainty, or re-zeroed at rest; in no map.

bias += one normal draw with standard deviation std_dph for each run
"""

from __future__ import annotations

import numpy as np

from ..common.arrays import FloatArray
from .base import Cause, CauseValues, History, Needs, Parameter, Scene, SearchRule, Telling, Wording, anywhere


def _bias(scene: Scene, values: CauseValues, rng: np.random.Generator) -> FloatArray:
    return np.full(len(scene.time_s), rng.normal(0.0, values["std_dph"]))


def _features(history: History, values: CauseValues) -> FloatArray:
    """One column for each run, 1 in its own: weights of one common variance (a random effect), not free."""
    columns = np.zeros((len(history.time_s), history.runs))
    columns[:, history.run] = 1.0
    return columns


def _amplitudes(weights: FloatArray) -> dict[str, float]:
    return {"std_dph": float(np.sqrt(np.mean(weights**2)))}


CAUSE = Cause(
    id="turn_on_offset",
    family="between_runs",
    rank=60,
    kind="random",
    equation="bias += o_run, o_run normal with standard deviation std",
    source="run-to-run bias repeatability, IEEE Std 647",
    parameters=(Parameter("std_dph", "deg/h", 1e-5, 1e-1, linear=True),),
    words=Wording(
        name="Every power-on has its own offset",
        signature="means of the runs scatter more than their noise allows",
        remedy="no map holds it: re-zero in the first minutes at rest, or state it as an uncertainty",
        experiment="three or more repeats of one hold with power cycles between them",
        telling=Telling.REPEATS,
        beside={"ageing": "the same hold on at least five dates, several power cycles on each"},
        recording="record three runs or more, each with its own power-on",
        advice="Runs that were mounted anew differ as well, by tilt and scale factor times Earth's rate (5e-5 deg/h "
        "for each arcsec at 45 degrees): repeat power-ons without touching the fixture.",
    ),
    search=SearchRule(price=1, grid=anywhere, needed_d=10.0, imitates=True),
    needs=Needs(runs=3),
    bias=_bias,
    features=_features,
    amplitudes=_amplitudes,
)
