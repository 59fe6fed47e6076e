"""The simulated gyro: static bias of its cavity, further thermometers, and what its laser shows.

shape(T, r) = s(T) + r/√(1 + (r/r0)²) · (a + b atan((T − T1)/w1)) + c (√(1 + (r/r1)²) − 1)
    bias = offset + scale · shape

s(T) is a cubic spline through random knots plus a rational well (losses around a working point) plus an
arctangent (alignment that goes over from one state to another). The second part is a gas flow that saturates
and whose effect depends on T; the third is even in r. None of it is a Gaussian: the map shares no family of
functions with the model that is fitted.

loss = loss_ppm + loss_ppm_per_c (T_mirror − 20) + contamination + 4 walk_ppm s²
    gain = gain_ppm (1 + gain_per_c (T_gas − gas_c)) exp(−day/depletion_day)
    intensity = level (gain/loss − 1)/(gain_ppm/loss_ppm − 1)
    fringes = (path (α (T_path − 20) + β (T_path − 20)²) + mirror_nm_per_c (T_mirror − T_path))/(λ/2)
    s = fringes less a whole number; voltage = stroke_v s
    bias += null_dph_per_ppm (loss − loss_ppm) (1 + null_growth_per_c (T_path − 20)) + stroke_dph sin(π s)

Above threshold the intensity of a gas laser goes with gain over loss less 1, and the gain with the density of what
the discharge excites (Aronowitz, "Fundamentals of the Ring Laser Gyro", RTO AGARDograph 339, 1999). The null shift
follows the losses and their change (Di Virgilio et al., "Analysis of ring laser gyroscopes including laser dynamics",
Eur. Phys. J. C 79, 573, 2019). The control of the path length moves a mirror by at most `reset_share` of half a
wavelength to either side; beyond it jumps by a whole half wavelength to the next mode, so where it stands depends on
where it came from. A moved mirror walks the beam against its aperture: 4 walk_ppm s² and the sine. The levels are
rules of thumb and parameters for this reason.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from ..causes.base import Scene
from ..common.arrays import FloatArray
from ..mirror.recursions import first_order
from .scenario import Channel, Laser, Scenario, Thermometer

if TYPE_CHECKING:
    from .scenario import NoiseLevels


T_RANGE_C = (-36.0, 71.0)  # of the cavity in a chamber at −40 ... 60 C, self-heating included
R_LIMIT_C_PER_MIN = 2.5  # half of the fastest ramp of a chamber: the cavity follows slowly


@dataclass(frozen=True, slots=True)
class BiasMap:
    """One gyro's static map; `parameters` are those of the shape."""

    parameters: dict[str, Any]
    scale_dph: float
    offset_dph: float
    _spline: CubicSpline = field(repr=False)

    def __call__(self, cavity_c: FloatArray, slope_c_per_min: FloatArray) -> FloatArray:
        """Bias in deg/h at cavity temperatures (C) and their rates of change (C/min), broadcast."""
        shape = _shape(self.parameters, self._spline, cavity_c, slope_c_per_min)
        return np.asarray(self.offset_dph + self.scale_dph * shape)

    def described(self) -> dict[str, Any]:
        """Everything that was drawn, for truth.json."""
        return {"offset_dph": self.offset_dph, "scale_dph": self.scale_dph, **self.parameters}


def _shape(p: dict[str, Any], spline: CubicSpline, cavity_c: FloatArray, slope: FloatArray) -> FloatArray:
    level = spline(cavity_c)
    level = level + p["well"] / (1.0 + ((cavity_c - p["well_c"]) / p["well_width_c"]) ** 2)
    level = level + p["turn"] * np.arctan((cavity_c - p["turn_c"]) / p["turn_width_c"])
    flow = slope / np.sqrt(1.0 + (slope / p["flow_c_per_min"]) ** 2)
    gain = p["flow"] + p["flow_turn"] * np.arctan((cavity_c - p["flow_turn_c"]) / p["flow_width_c"])
    even = p["even"] * (np.sqrt(1.0 + (slope / p["even_c_per_min"]) ** 2) - 1.0)
    return np.asarray(level + flow * gain + even)


def draw_map(rng: np.random.Generator, range_dph: tuple[float, float]) -> BiasMap:
    """One gyro: a map whose values over the operating range reach from end to end of `range_dph`, deg/h."""
    knots_c = np.linspace(*T_RANGE_C, 7)
    values = rng.normal(0.0, 0.3, len(knots_c))
    sign = rng.choice([-1.0, 1.0])
    parameters: dict[str, Any] = {
        "knots_c": knots_c.tolist(),
        "knots": values.tolist(),
        "well": -rng.uniform(0.8, 1.6),
        "well_c": rng.uniform(0.0, 35.0),
        "well_width_c": rng.uniform(25.0, 45.0),
        "turn": sign * rng.uniform(0.15, 0.4),
        "turn_c": rng.uniform(-20.0, 50.0),
        "turn_width_c": rng.uniform(10.0, 25.0),
        "flow": rng.choice([-1.0, 1.0]) * rng.uniform(0.15, 0.4),
        "flow_c_per_min": rng.uniform(2.0, 4.0),
        "flow_turn": rng.uniform(-0.2, 0.2),
        "flow_turn_c": rng.uniform(-10.0, 40.0),
        "flow_width_c": rng.uniform(15.0, 35.0),
        "even": rng.uniform(-0.3, 0.3),
        "even_c_per_min": rng.uniform(1.5, 3.0),
    }
    shape = shape_over_range(parameters)
    low, high = range_dph
    scale = (high - low) / float(np.ptp(shape))
    return made(parameters, scale, low - scale * float(shape.min()))


def made(parameters: dict[str, Any], scale_dph: float, offset_dph: float) -> BiasMap:
    """The map of given parameters of the shape."""
    return BiasMap(parameters, scale_dph, offset_dph, _spline(parameters))


def shape_over_range(parameters: dict[str, Any]) -> FloatArray:
    """The shape on a grid over the operating range, shape (T, dT/dt)."""
    grid_c, grid_slope = np.meshgrid(
        np.linspace(*T_RANGE_C, 118), np.linspace(-R_LIMIT_C_PER_MIN, R_LIMIT_C_PER_MIN, 25), indexing="ij"
    )
    return _shape(parameters, _spline(parameters), grid_c, grid_slope)


def _spline(parameters: dict[str, Any]) -> CubicSpline:
    return CubicSpline(parameters["knots_c"], parameters["knots"], bc_type="natural")


def channel_values(channel: Channel, air_c: FloatArray, dt_s: float, rng: np.random.Generator) -> FloatArray:
    """What the quantity really does: level, a part that goes with the air, a wandering part, steps."""
    points = len(air_c)
    value = channel.level + channel.per_air_c * (air_c - 20.0)
    if channel.wander_sigma:
        decay = float(np.exp(-dt_s / channel.wander_tau_s))
        start = rng.normal(0.0, channel.wander_sigma)
        pushes = rng.normal(0.0, channel.wander_sigma * np.sqrt(1.0 - decay**2), points)
        value = value + lfilter([1.0], [1.0, -decay], pushes, zi=[decay * start])[0]
    if channel.steps_per_h:
        steps = rng.random(points) < channel.steps_per_h * dt_s / 3600.0
        heights = rng.normal(0.0, channel.step_sigma, int(steps.sum()) + 1)
        value = value + heights[np.cumsum(steps)]
    return np.asarray(value)


def channel_readings(channel: Channel, true: FloatArray, rng: np.random.Generator) -> FloatArray:
    """What the recorder reads of it."""
    return np.asarray(true + rng.normal(0.0, channel.noise, len(true)))


_REFERENCE_C = 20.0  # room temperature, at which the parameters of a scenario hold


@dataclass(frozen=True, slots=True)
class LaserStates:
    """True states of the laser in one run, shape (n,) each.

    Attributes:
        loss_ppm: Losses of a round trip, 1e-6.
        gain_ppm: Gain of a round trip, the same.
        stroke: Place of the moving mirror, half wavelengths from the middle.
        path_c: Temperature of the node whose length counts, C.
    """

    loss_ppm: FloatArray
    gain_ppm: FloatArray
    stroke: FloatArray
    path_c: FloatArray


def laser_states(
    laser: Laser, mirror_c: FloatArray, gas_c: FloatArray, path_c: FloatArray, day: float, contamination_ppm: FloatArray
) -> LaserStates:
    """States of the laser from the true temperatures of its nodes, C, shape (n,).

    `contamination_ppm`: losses that come and go with no temperature, 1e-6, the same shape.
    """
    stroke = _stroke(_fringes(laser, mirror_c, path_c), laser.reset_share)
    loss = laser.loss_ppm + laser.loss_ppm_per_c * (mirror_c - _REFERENCE_C) + contamination_ppm
    gain = laser.gain_ppm * (1.0 + laser.gain_per_c * (gas_c - laser.gas_c))
    return LaserStates(
        loss_ppm=np.maximum(loss + 4.0 * laser.walk_ppm * stroke**2, 1.0),
        gain_ppm=gain * float(np.exp(-day / laser.depletion_day)),
        stroke=stroke,
        path_c=path_c,
    )


def _fringes(laser: Laser, mirror_c: FloatArray, path_c: FloatArray) -> FloatArray:
    """How much longer the path is than at 20 C, half wavelengths."""
    warmer = path_c - _REFERENCE_C
    longer = laser.expansion_ppm_per_c * warmer + laser.expansion_ppm_per_c2 * warmer**2
    path_nm = laser.path_mm * longer + laser.mirror_nm_per_c * (mirror_c - path_c)  # mm times 1e-6 is nm
    return np.asarray(path_nm / (0.5 * laser.wavelength_nm))


def _stroke(fringes: FloatArray, reset_share: float) -> FloatArray:
    """Fringes less the mode that the control holds; it takes the nearest mode at the start and where it must jump."""
    order = float(np.round(fringes[0]))
    orders = np.empty(len(fringes))
    begin = 0
    while begin < len(fringes):
        beyond = np.flatnonzero(np.abs(fringes[begin:] - order) > reset_share)
        end = begin + int(beyond[0]) if beyond.size else len(fringes)
        orders[begin:end] = order
        begin = end
        if end < len(fringes):
            order = float(np.round(fringes[end]))
    return fringes - orders


def laser_bias(laser: Laser, states: LaserStates) -> FloatArray:
    """What losses and mirror add to the bias, deg/h, shape (n,)."""
    growth = 1.0 + laser.null_growth_per_c * (states.path_c - _REFERENCE_C)
    null = laser.null_dph_per_ppm * (states.loss_ppm - laser.loss_ppm) * growth
    return np.asarray(null + laser.stroke_dph * np.sin(np.pi * states.stroke))


def laser_readings(laser: Laser, states: LaserStates, rng: np.random.Generator) -> dict[str, FloatArray]:
    """Readings of intensity and path-length voltage, V, by the names of their columns."""
    n = len(states.stroke)
    above = (states.gain_ppm / states.loss_ppm - 1.0) / (laser.gain_ppm / laser.loss_ppm - 1.0)
    intensity = laser.intensity_level_v * above + rng.normal(0.0, laser.intensity_noise_v, n)
    voltage = laser.stroke_v * states.stroke + rng.normal(0.0, laser.stroke_noise_v, n)
    return {laser.intensity: intensity, laser.path_voltage: voltage}


def thermometer_readings(
    one: Thermometer, node_c: FloatArray, air_c: FloatArray, time_s: FloatArray, day: float, rng: np.random.Generator
) -> FloatArray:
    """What a thermometer shows, C.

    Args:
        one: The thermometer.
        node_c: True temperature of its node, C, shape (n,).
        air_c: Air around the instrument, C, the same.
        time_s: s, the same.
        day: Days since the first run: a contact may have come loose.
        rng: Draws its noise.
    """
    lag_s, there_c = one.lag_s, node_c
    if one.loose_from_day is not None and day >= one.loose_from_day:
        lag_s, there_c = one.loose_lag_s, node_c + one.loose_share * (air_c - node_c)
    shown = first_order(lag_s, time_s, there_c) + one.offset_c
    return quantised_c(shown + rng.normal(0.0, one.noise_c, len(shown)), one.resolution_c)


def quantised_c(reading_c: FloatArray, resolution_c: float) -> FloatArray:
    """Readings in whole steps of a converter, C; 0: as they are."""
    if not resolution_c:
        return reading_c
    return np.asarray(resolution_c * np.round(reading_c / resolution_c))


@dataclass(frozen=True, slots=True)
class Internal:
    """One run inside the instrument, from the start of the chamber programme, shape (n,) each.

    Attributes:
        bias_dph: What differences of nodes and the laser add to the bias, deg/h.
        nodes_c: True temperatures by node, C.
        laser: States of the laser, where the scenario has one.
        states: What truth keeps; empty where the scenario has neither thermometers nor differences nor laser.
    """

    bias_dph: FloatArray
    nodes_c: Mapping[str, FloatArray]
    laser: LaserStates | None
    states: dict[str, FloatArray]


def internal_of(
    scenario: Scenario, nodes_c: Mapping[str, FloatArray], scene: Scene, rng: np.random.Generator
) -> Internal:
    """Differences and laser of a run; `rng` draws what no temperature moves."""
    bias = np.zeros(len(scene.time_s))
    for one in scenario.difference:
        x = nodes_c[one.node] - nodes_c[one.against]
        bent = x / np.sqrt(1.0 + (x / one.saturation_c) ** 2)
        bias = bias + one.dph_per_c * bent * (1.0 + one.growth_per_c * (scene.cavity_c - _REFERENCE_C))
    laser = scenario.laser
    if not (scenario.thermometer or scenario.difference or laser):
        return Internal(bias, nodes_c, None, {})
    states = {f"{name}_c": values for name, values in nodes_c.items()}
    if laser is None:
        return Internal(bias, nodes_c, None, states)
    wander = Channel(name="loss", wander_sigma=laser.contamination_ppm, wander_tau_s=laser.contamination_tau_s)
    found = laser_states(
        laser,
        nodes_c[laser.mirror_node],
        nodes_c[laser.gas_node],
        nodes_c[laser.path_node],
        scene.day,
        channel_values(wander, np.zeros(len(bias)), CELL_S, rng),
    )
    states |= {"loss_ppm": found.loss_ppm, "gain_ppm": found.gain_ppm, "stroke": found.stroke}
    return Internal(bias + laser_bias(laser, found), nodes_c, found, states)


def internal_readings(
    scenario: Scenario, internal: Internal, air_c: FloatArray, scene: Scene, seeds: np.random.SeedSequence
) -> dict[str, FloatArray]:
    """Readings of further thermometers and of the laser's signals, by column, shape (n,)."""
    of_laser, *children = seeds.spawn(1 + len(scenario.thermometer))
    readings = {
        one.name: thermometer_readings(
            one, internal.nodes_c[one.node], air_c, scene.time_s, scene.day, np.random.default_rng(child)
        )
        for one, child in zip(scenario.thermometer, children, strict=True)
    }
    if scenario.laser and internal.laser:
        readings |= laser_readings(scenario.laser, internal.laser, np.random.default_rng(of_laser))
    return readings


CELL_S = 1.0  # s: noise is drawn once a second and bridged between (docs/simulation.md)
_SPREAD = 10.0**0.5  # ratio of neighbouring correlation times in the flicker noise


@dataclass(frozen=True, slots=True)
class CellNoise:
    """Noise of one run, without quantisation.

    Attributes:
        angle_arcsec: Angle gathered in each cell, shape (cells,).
        white_arcsec: Standard deviation of its white part, shape (cells,).
    """

    angle_arcsec: FloatArray
    white_arcsec: FloatArray


def white_sigma_arcsec(levels: NoiseLevels, temperature_c: FloatArray, slope_c_per_min: FloatArray) -> FloatArray:
    """Standard deviation of the angle that the random walk gathers in a cell, arcsec, one for each cell.

    Grows by a share for each C below or above 20 C (by its sign) and for each C/min of heating or cooling.
    """
    growth = (
        1.0
        + levels.arw_growth_per_c * (temperature_c - _REFERENCE_C)
        + levels.arw_growth_per_c_per_min * np.abs(slope_c_per_min)
    )
    return np.asarray(levels.arw_deg_per_sqrt_h * 3600.0 * np.sqrt(CELL_S / 3600.0) * np.maximum(growth, 0.1))


def cell_noise(
    seeds: np.random.SeedSequence, levels: NoiseLevels, temperature_c: FloatArray, slope_c_per_min: FloatArray
) -> CellNoise:
    """Noise of a run whose gyro has these temperatures (C) and rates (C/min), one for each cell."""
    cells = len(temperature_c)
    white, flicker, walk, kicks = (np.random.default_rng(child) for child in seeds.spawn(4))
    sigma = white_sigma_arcsec(levels, temperature_c, slope_c_per_min)
    angle = sigma * white.standard_normal(cells)
    if levels.bias_instability_dph:
        angle += CELL_S * _flicker_dph(flicker, cells, levels.bias_instability_dph)
    if levels.rate_random_walk_dph_per_sqrt_h:
        step = levels.rate_random_walk_dph_per_sqrt_h * np.sqrt(CELL_S / 3600.0)
        angle += CELL_S * np.cumsum(walk.normal(0.0, step, cells))
    if levels.outliers_per_h:
        hit = kicks.random(cells) < levels.outliers_per_h * CELL_S / 3600.0
        size = kicks.uniform(0.5, 1.5, cells) * kicks.choice([-1.0, 1.0], cells)
        angle += np.where(hit, levels.outlier_arcsec * size, 0.0)
    return CellNoise(angle, sigma)


def _flicker_dph(rng: np.random.Generator, cells: int, bias_instability_dph: float) -> FloatArray:
    """Flicker noise with spectral density B²/(2π f) (two-sided), a sum of Markov processes, shape (cells,).

    Correlation times from a cell to ten times the record, evenly in their logarithm; the variance of each is
    B² ln(ratio)/π, so that the Allan deviation stands at √(2 ln 2/π) B between both ends.
    """
    count = int(np.ceil(np.log(10.0 * cells) / np.log(_SPREAD))) + 1
    sigma = bias_instability_dph * np.sqrt(np.log(_SPREAD) / np.pi)
    total = np.zeros(cells)
    for index in range(count):
        decay = float(np.exp(-(_SPREAD**-index)))
        start = rng.normal(0.0, sigma)
        steps = rng.normal(0.0, sigma * np.sqrt(1.0 - decay**2), cells)
        total += lfilter([1.0], [1.0, -decay], steps, zi=[decay * start])[0]
    return total


def bridge_arcsec(rng: np.random.Generator, parts: int, white_arcsec: FloatArray) -> FloatArray:
    """How the white angle departs, at a cell's inner edges, from growing evenly, shape (cells, parts − 1).

    A Brownian bridge: with the even growth added it is a random walk with `white_arcsec` for a whole cell.
    """
    steps = rng.standard_normal((len(white_arcsec), parts), dtype=np.float32)
    steps -= steps.mean(axis=1, keepdims=True)
    walk = np.cumsum(steps[:, :-1], axis=1, dtype=np.float64)
    return np.asarray(walk * (white_arcsec[:, None] / np.sqrt(parts)))


def quantised(angle_arcsec: FloatArray, quantum_arcsec: float, phase: FloatArray) -> FloatArray:
    """Angle as read in steps of the quantum while dither moves it; the known dither is taken off again.

    `phase`: dither at the readings, quanta, uniform over 0 ... 1. The error is uniform over one quantum and
    independent from reading to reading: IEEE's Q = quantum/√12.
    """
    return np.asarray(quantum_arcsec * (np.floor(angle_arcsec / quantum_arcsec + phase) - phase + 0.5))
