"""Rate-independent hysteresis: a play operator, as mounts, glue joints and mirror contacts show.

    z = max(T − w, min(T + w, z)),    bias += (a + b (T − reference)) (z − T)

Diagnosis looks for a loop of one strength, b = 0; a table's may go with T.

Source: the play of Krasnosel'skii and Pokrovskii, Systems with Hysteresis, Springer 1989.
"""

from __future__ import annotations

import numpy as np

from ..common.arrays import FloatArray
from ..common.inputs import PLAUSIBLE_C
from ..mirror.kinds import TableKind
from ..mirror.recursions import play
from .base import (
    Cause,
    CauseValues,
    History,
    Parameter,
    Scene,
    SearchRule,
    SingleCycle,
    Tabled,
    Telling,
    Wording,
    geometric,
    weights_of,
)


def strength(values: CauseValues, temperature_c: FloatArray) -> FloatArray:
    """Return the strength of the loop at temperatures, deg/h/C."""
    growth, away = values.get("amplitude_dph_per_c_per_c", 0.0), temperature_c - values.get("reference_c", 0.0)
    return np.asarray(values["amplitude_dph_per_c"] + growth * away)


def _bias(scene: Scene, values: CauseValues, rng: np.random.Generator) -> FloatArray:
    z = play(values["width_c"], scene.cavity_c)
    return np.asarray(strength(values, scene.cavity_c) * (z - scene.cavity_c))


def _features(history: History, values: CauseValues) -> FloatArray:
    return (play(values["width_c"], history.temperature_c) - history.temperature_c)[:, None]


_WIDTH = Parameter("width_c", "C", 0.5, 40.0)
_BOTH_SIDES = "the same hold temperature reached from both sides, at two rates, and nested shrinking loops"


def _record(values: CauseValues, block_s: float) -> list[float]:
    growth = values.get("amplitude_dph_per_c_per_c", 0.0)
    return [values["width_c"], values["amplitude_dph_per_c"], growth, values.get("reference_c", 0.0)]


def _over_temperature(values: CauseValues, strength: float, growth: float, reference_c: float) -> CauseValues:
    linear = {"amplitude_dph_per_c": strength, "amplitude_dph_per_c_per_c": growth}
    return {"width_c": values["width_c"], "reference_c": reference_c, **linear}


CAUSE = Cause(
    id="hysteresis",
    family="hysteresis",
    rank=40,
    kind="add",
    equation="z = max(T - w, min(T + w, z)); bias += (amplitude + growth (T - reference_c)) (z - T)",
    source="play operator of Prandtl and Ishlinskii (Visintin 1994; Brokate and Sprekels 1996)",
    parameters=(
        _WIDTH,
        Parameter("reference_c", "C", *PLAUSIBLE_C, signed=True),
        Parameter("amplitude_dph_per_c", "deg/h/C", 1e-6, 1e-3, linear=True, signed=True),
        Parameter("amplitude_dph_per_c_per_c", "deg/h/C/C", 1e-9, 1e-3, linear=True, signed=True),
    ),
    words=Wording(
        name="The bias remembers the direction of the last temperature change",
        signature="loops over T whose width does not depend on the rate; "
        "holds differ by the side they were reached from",
        remedy="one play operator, saved over power cycles",
        experiment=_BOTH_SIDES,
        telling=Telling.DIRECTION,
        beside={"turn_on_offset": _BOTH_SIDES + ", all within one power-on"},
        advice="In the gyro, look at parts that temperature stresses: mounts, adhesives, mirrors. In use, a working "
        "temperature that is always reached from one side avoids it.",
    ),
    search=SearchRule(
        price=2,
        grid=geometric(_WIDTH, 20),
        over=_WIDTH.name,
        imitates=True,
        loops=True,
        cycle=SingleCycle(points=24, usual=False),
    ),
    table=Tabled(TableKind.PLAY, _record, optional=("reference_c", "amplitude_dph_per_c_per_c")),
    bias=_bias,
    features=_features,
    amplitudes=weights_of("amplitude_dph_per_c"),
    over_temperature=_over_temperature,
)
