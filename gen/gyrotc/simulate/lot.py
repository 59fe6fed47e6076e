"""Simulate a lot: gyros of one type, whose physical parameters are drawn about those of the lot.

Every parameter has a standard score; that of a unit is √F · (score of its cluster) + √(1 − F) · (a score of its own).
F, the strength of the family, is therefore the correlation of each parameter between two units: at 0 they share nothing
but their scenario, at 1 they are one gyro. Within a unit, parameters with a common cause are correlated too.
docs/simulation.md gives the meaning of the scores and the sources of their spreads.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..common.arrays import FloatArray
from ..common.errors import InputError
from ..common.progress import Progress, Stages, silent
from ..results.folder import result_folder
from ..results.recordings import TrueLot
from .bias_map import KNOTS, R_LIMIT_C_PER_MIN, T_RANGE_C, BiasMap, map_of, shape_over_range
from .campaign import NoiseName, with_noise
from .data_set import RowForm, SimulatedGyro, write_gyro
from .scenario import Gyro, Scenario, read

SharedScores = dict[str, float]

_EXPANSION = ("expansion", "expansion_slope", "expansion_curvature")
_MOUNT = tuple(f"mount_{k}" for k in range(KNOTS))
_OTHERS = (
    "loss", "loss_c", "loss_width", "alignment", "alignment_c", "alignment_width",
    "flow", "flow_saturation", "flow_turn", "flow_turn_c", "flow_width", "even", "even_saturation",
    "level", "contact_case", "contact_cavity", "to_air", "power", "thermometer_offset", "thermometer_lag",
)  # fmt: skip
SCORES = (*_EXPANSION, *_MOUNT, *_OTHERS)
"""Names of the scores, in the order in which they are drawn."""

# Expansion moves the mirrors and the piezo that holds the length; the discharge's asymmetry drives every effect of the
# flow; joints are made by one process; what heats more is mounted in more air. Between two independent scores: 0.
_CORRELATED = {
    ("expansion", "alignment"): -0.5,
    ("expansion", "loss_c"): 0.5,
    ("flow", "flow_turn"): 0.6,
    ("flow", "even"): 0.4,
    ("contact_case", "contact_cavity"): 0.5,
    ("to_air", "power"): 0.3,
}
_MOST_UNITS = 10_000  # more folders than this are a mistake
_MID_SHARE = 0.3  # standard deviation of a unit's mean bias over the range of its bias


@dataclass(frozen=True, slots=True)
class LotOrder:
    """Size and kinship of a lot.

    Attributes:
        units: Number of gyros, foreign units among them.
        family: Correlation of each parameter between two units of a cluster, 0 ... 1.
        clusters: Groups with a center of their own; units go to them at random.
        unrelated: Units that share nothing with the others but the scenario.

    Raises:
        InputError: A number is out of its range.
    """

    units: int
    family: float = 0.9
    clusters: int = 1
    unrelated: int = 0

    def __post_init__(self) -> None:
        if not 1 <= self.units <= _MOST_UNITS:
            raise InputError("--units", str(self.units), f"1 ... {_MOST_UNITS}")
        if not 0.0 <= self.family <= 1.0:
            raise InputError("family", f"{self.family:g}", "0 (nothing shared) ... 1 (all the same)")
        if not 1 <= self.clusters <= self.units:
            raise InputError("clusters", str(self.clusters), "1 ... the number of units")
        if not 0 <= self.unrelated < self.units:
            raise InputError("unrelated", str(self.unrelated), "0 or more, and fewer than units")


def simulate_lot(
    order: LotOrder,
    *,
    seed: int,
    out: Path,
    scenario: str | Path = "paper",
    form: RowForm | None = None,
    noise: NoiseName = "paper",
    progress: Progress = silent,
) -> list[str]:
    """Simulate a lot: a data set in `out/<serial>` for each unit, with its truth beside it.

    Seed, order and scenario fix every byte. A unit keeps its parameters where the lot is made larger.

    Args:
        order: Size and kinship of the lot.
        seed: Number from which the lot, its units and their noise are drawn, 0 or more.
        out: Folder to make; simulated data sets there are replaced one by one.
        scenario: Programmes, chamber and instrument about which units are drawn.
        form: Form of the rows; None: rates of 10 s, CSV.
        noise: Levels of what the scenario does not give.
        progress: Called with what is done.

    Returns:
        The serials.

    Raises:
        InputError: The scenario, the seed, the thermal network or the folder is not valid.
    """
    name, plan = read(scenario)
    rows = form or RowForm.of(10.0, None, False, "csv")
    units = draw_lot(with_noise(plan, noise), order, seed, name)
    of_units = Stages(progress, {unit.serial: 1.0 for unit in units})
    for unit in units:
        with result_folder(Path(out) / unit.serial, "simulate") as stage:
            stage.of(unit.serial)
            write_gyro(stage.folder, unit, rows, of_units.within(unit.serial))
    return [unit.serial for unit in units]


def draw_lot(plan: Scenario, order: LotOrder, seed: int, name: str = "") -> list[SimulatedGyro]:
    """Draw the gyros of a lot, each with its instrument in the plan.

    Raises:
        InputError: The seed is negative, or the scenario's thermal network lacks a node in which units differ.
    """
    if seed < 0:
        raise InputError("seed", str(seed), "0 or more")
    _check_nodes(plan.gyro)
    of_lot, of_units, of_places = np.random.SeedSequence(seed).spawn(3)
    mix = _mixing()
    centers = np.random.default_rng(of_lot).standard_normal((order.clusters, len(SCORES))) @ mix.T
    places = np.random.default_rng(of_places)
    strange = set(places.permutation(order.units)[: order.unrelated].tolist())
    cluster = places.integers(order.clusters, size=order.units)
    units = []
    for k, child in enumerate(of_units.spawn(order.units)):
        own, of_noise = child.spawn(2)
        rng = np.random.default_rng(own)
        drawn, foreign = (mix @ rng.standard_normal(len(SCORES)) for _ in range(2))
        center = foreign if k in strange else centers[cluster[k]]
        score = np.sqrt(order.family) * center + np.sqrt(1.0 - order.family) * drawn
        group = -1 if k in strange else int(cluster[k])
        truth = TrueLot(
            units=order.units,
            family=order.family,
            clusters=order.clusters,
            cluster=group,
            unrelated=group < 0,
            scores={key: float(value) for key, value in zip(SCORES, score, strict=True)},
        )
        bias_map = _map(plan.gyro, truth.scores, center, order.family)
        made_plan, serial = _instrument(plan, truth.scores), f"LOT-{seed:04d}-{k + 1:03d}"
        units.append(SimulatedGyro(made_plan, serial, bias_map, seed, of_noise, name, truth))
    return units


def _mixing() -> FloatArray:
    """Return the Cholesky factor of the correlation of scores within a unit, shape (scores, scores)."""
    matrix = np.eye(len(SCORES))
    for (one, other), value in _CORRELATED.items():
        i, j = SCORES.index(one), SCORES.index(other)
        matrix[i, j] = matrix[j, i] = value
    return np.asarray(np.linalg.cholesky(matrix))


def _map(gyro: Gyro, scores: SharedScores, center: FloatArray, family: float) -> BiasMap:
    """Return the static map of a unit.

    The shape is scaled to the range of the bias. The range of the shape is that of the lot's if `family` is 1, the
    unit's own if it is 0, and in between a geometric mean of both.
    """
    parameters = _shape_of(scores)
    low, high = gyro.bias_dph
    shape = shape_over_range(parameters)
    of_lot = shape_over_range(_shape_of(dict(zip(SCORES, center.tolist(), strict=True))))
    extent = family * np.log(np.ptp(of_lot)) + (1.0 - family) * np.log(np.ptp(shape))
    scale = (high - low) / float(np.exp(extent))
    mean = 0.5 * (low + high) + _MID_SHARE * (high - low) * scores["level"]
    return map_of(parameters, scale, mean - scale * float(shape.mean()))


def _shape_of(s: SharedScores) -> dict[str, object]:
    """Return parameters of the shape (`bias_map.py`); their moments are those of the gyros that `draw_map` draws."""
    knots_c = np.linspace(*T_RANGE_C, KNOTS)
    x = np.linspace(-1.0, 1.0, KNOTS)
    expansion = 0.4 * s["expansion"] * x + 0.35 * s["expansion_slope"] * (x**2 - 1.0 / 3.0)
    expansion = expansion + 0.3 * s["expansion_curvature"] * (x**3 - 0.6 * x)
    knots = expansion + 0.12 * np.array([s[name] for name in _MOUNT])
    return {
        "knots_c": knots_c.tolist(),
        "knots": knots.tolist(),
        "well": -float(np.clip(1.2 + 0.23 * s["loss"], 0.4, 2.0)),
        "well_c": 17.5 + 10.0 * s["loss_c"],
        "well_width_c": 35.0 * _factor(0.17, s["loss_width"]),
        "turn": 0.285 * s["alignment"],
        "turn_c": 15.0 + 20.0 * s["alignment_c"],
        "turn_width_c": 17.5 * _factor(0.27, s["alignment_width"]),
        "flow": 0.285 * s["flow"],
        "flow_c_per_min": 3.0 * _factor(0.2, s["flow_saturation"]),
        "flow_turn": 0.115 * s["flow_turn"],
        "flow_turn_c": 15.0 + 14.0 * s["flow_turn_c"],
        "flow_width_c": 25.0 * _factor(0.24, s["flow_width"]),
        "even": 0.173 * s["even"],
        "even_c_per_min": 0.88 * R_LIMIT_C_PER_MIN * _factor(0.2, s["even_saturation"]),
    }


def _instrument(plan: Scenario, s: SharedScores) -> Scenario:
    """Return the plan with the thermal paths and the thermometer of a unit."""
    node = dict(plan.gyro.node)
    case, block = node["case"], node["block"]
    joints = {name: g * _factor(0.15, s["contact_case"]) for name, g in case.to.items()}
    node["case"] = case.model_copy(
        update={
            "to_air_w_per_k": case.to_air_w_per_k * _factor(0.1, s["to_air"]),
            "power_w": case.power_w * _factor(0.05, s["power"]),
            "to": joints,
        }
    )
    held = {name: g * _factor(0.15, s["contact_cavity"]) for name, g in block.to.items()}
    node["block"] = block.model_copy(update={"to": held})
    sensor = plan.sensor.model_copy(
        update={
            "offset_c": float(np.clip(0.15 * s["thermometer_offset"], -10.0, 10.0)),
            "lag_s": plan.sensor.lag_s * _factor(0.2, s["thermometer_lag"]),
        }
    )
    gyro = plan.gyro.model_copy(update={"node": node})
    return plan.model_copy(update={"gyro": gyro, "sensor": sensor})


def _factor(spread: float, score: float) -> float:
    """Return a log-normal quantity over its median; `spread` is the standard deviation of its logarithm."""
    return float(np.exp(spread * score))


def _check_nodes(gyro: Gyro) -> None:
    """Raise `InputError` if the thermal network lacks a node in which units differ."""
    if missing := {"case", "block"} - set(gyro.node):
        raise InputError(
            "scenario, gyro.node", f"no {' and no '.join(sorted(missing))}", "both nodes: units of a lot differ in them"
        )
