"""What a scenario says of further thermometers, of differences between nodes, and of the laser's own signals."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

__all__ = ["Laser", "NodeDifference", "Thermometer"]

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]


class _Signal(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Thermometer(_Signal):
    """A further thermometer, recorded as a column: its place, and what its reading makes of that temperature.

    From `loose_from_day` on its contact is loose: it shows `loose_share` of the way from its node to the air, with
    the lag `loose_lag_s`.
    """

    name: Name
    node: str
    lag_s: NonNegative = 10.0
    offset_c: float = 0.0
    noise_c: NonNegative = 0.01
    resolution_c: NonNegative = 0.01
    loose_from_day: NonNegative | None = None
    loose_lag_s: NonNegative = 300.0
    loose_share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5


class NodeDifference(_Signal):
    """A part of the bias that follows the temperature difference of two nodes.

    bias += dph_per_c · x/√(1 + (x/saturation_c)²) · (1 + growth_per_c (T_cavity − 20)), x = T_node − T_against
    """

    node: str
    against: str
    dph_per_c: float
    saturation_c: Positive = 1e6
    growth_per_c: float = 0.0


class Laser(_Signal):
    """The discharge and the cavity as the gyro itself sees them: beam intensity and path-length voltage.

    Units stand in the names. Gain and losses are shares of the light of one round trip, 1e-6; `walk_ppm` is what the
    beam loses more where the moving mirror stands half a wavelength from the middle of its stroke.
    """

    intensity: Name = "intensity_v"
    path_voltage: Name = "path_length_v"
    mirror_node: str = "cavity"
    gas_node: str = "gas"
    path_node: str = "block"
    loss_ppm: Positive = 300.0
    loss_ppm_per_c: float = 0.1
    contamination_ppm: NonNegative = 6.0
    contamination_tau_s: Positive = 7200.0
    walk_ppm: NonNegative = 20.0
    gain_ppm: Positive = 900.0
    gain_per_c: float = -1e-3
    gas_c: float = 50.0
    depletion_day: Positive = 10000.0
    intensity_level_v: Positive = 2.0
    intensity_noise_v: NonNegative = 5e-4
    wavelength_nm: Positive = 632.8
    path_mm: Positive = 280.0
    expansion_ppm_per_c: float = 0.03
    expansion_ppm_per_c2: float = 1e-4
    mirror_nm_per_c: float = 0.0
    reset_share: Annotated[float, Field(ge=0.5, le=2.0)] = 0.6
    stroke_v: Positive = 60.0
    stroke_noise_v: NonNegative = 0.02
    null_dph_per_ppm: float = 1e-4
    null_growth_per_c: float = 0.0
    stroke_dph: float = 5e-4
