"""The laser as the gyro itself sees it: losses, gain, the mirror that holds the path length, and what they do.

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
rules of thumb, and therefore parameters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..common.arrays import FloatArray
from .grid import REFERENCE_C
from .scenario import Laser


@dataclass(frozen=True, slots=True)
class LaserStates:
    """True states of the laser in one run, shape (n,) each.

    Attributes:
        loss_ppm: Losses of a round trip, 1e-6.
        gain_ppm: Gain of a round trip, 1e-6.
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
    """Compute the states of the laser from the true temperatures of its nodes, C, shape (n,).

    `contamination_ppm` are losses that come and go with no temperature, 1e-6, shape (n,); `day` counts from the first
    run.
    """
    stroke = _stroke(_fringes(laser, mirror_c, path_c), laser.reset_share)
    loss = laser.loss_ppm + laser.loss_ppm_per_c * (mirror_c - REFERENCE_C) + contamination_ppm
    gain = laser.gain_ppm * (1.0 + laser.gain_per_c * (gas_c - laser.gas_c))
    return LaserStates(
        loss_ppm=np.maximum(loss + 4.0 * laser.walk_ppm * stroke**2, 1.0),
        gain_ppm=gain * float(np.exp(-day / laser.depletion_day)),
        stroke=stroke,
        path_c=path_c,
    )


def _fringes(laser: Laser, mirror_c: FloatArray, path_c: FloatArray) -> FloatArray:
    """Return by how much the path is longer than at 20 C, half wavelengths."""
    warmer = path_c - REFERENCE_C
    longer = laser.expansion_ppm_per_c * warmer + laser.expansion_ppm_per_c2 * warmer**2
    path_nm = laser.path_mm * longer + laser.mirror_nm_per_c * (mirror_c - path_c)  # mm times 1e-6 is nm
    return np.asarray(path_nm / (0.5 * laser.wavelength_nm))


def _stroke(fringes: FloatArray, reset_share: float) -> FloatArray:
    """Return the fringes less the mode that the control holds: the nearest at the start and wherever it must jump."""
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
    """Return what losses and mirror add to the bias, deg/h, shape (n,)."""
    growth = 1.0 + laser.null_growth_per_c * (states.path_c - REFERENCE_C)
    null = laser.null_dph_per_ppm * (states.loss_ppm - laser.loss_ppm) * growth
    return np.asarray(null + laser.stroke_dph * np.sin(np.pi * states.stroke))


def laser_readings(laser: Laser, states: LaserStates, rng: np.random.Generator) -> dict[str, FloatArray]:
    """Draw readings of intensity and path-length voltage, V, by the names of their columns."""
    n = len(states.stroke)
    above = (states.gain_ppm / states.loss_ppm - 1.0) / (laser.gain_ppm / laser.loss_ppm - 1.0)
    intensity = laser.intensity_level_v * above + rng.normal(0.0, laser.intensity_noise_v, n)
    voltage = laser.stroke_v * states.stroke + rng.normal(0.0, laser.stroke_noise_v, n)
    return {laser.intensity: intensity, laser.path_voltage: voltage}
