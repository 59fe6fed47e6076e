"""Earth's rate along the sensitive axis of a gyro at rest."""

from __future__ import annotations

from math import cos, hypot, radians, sin

from .records import EarthRate

__all__ = ["EARTH_RATE_DPH", "earth_rate", "earth_rate_warning"]

EARTH_RATE_DPH = 15.04106717866910  # 7.2921150e-5 rad/s (WGS 84), deg/h

_LARGEST_DPH = 15.05  # of a component of Earth's rate, rounded up


def earth_rate_warning(stated: str | None, mean_dph: float) -> str:
    """What to say of a mean rate that could be Earth's where nothing is stated; empty where all is well."""
    if stated is not None or abs(mean_dph) > _LARGEST_DPH:
        return ""
    return (
        f"The mean rate is {mean_dph:.4g} deg/h, Earth's rate is up to 15.04 deg/h, and the data set does not "
        "state earth_rate: the model may take Earth's rate for bias."
    )


def earth_rate(
    latitude_deg: float,
    azimuth_deg: float,
    elevation_deg: float,
    *,
    latitude_sigma_deg: float,
    axis_sigma_deg: float,
) -> EarthRate:
    """Component of Earth's rate along an axis: Ω (cos φ cos A cos E + sin φ sin E), and its uncertainty.

    Args:
        latitude_deg: φ, deg, north positive.
        azimuth_deg: A, of the axis, deg, clockwise from true north.
        elevation_deg: E, of the axis, deg, up from the horizontal.
        latitude_sigma_deg: Standard uncertainty of φ, deg.
        axis_sigma_deg: Standard uncertainty of the axis in each of the two directions across it, deg.

    Returns:
        Rate and standard uncertainty by first-order propagation, deg/h.
    """
    phi, a, e = radians(latitude_deg), radians(azimuth_deg), radians(elevation_deg)
    along = cos(phi) * cos(a) * cos(e) + sin(phi) * sin(e)
    by_latitude = -sin(phi) * cos(a) * cos(e) + cos(phi) * sin(e)
    by_azimuth = -cos(phi) * sin(
        a
    )  # turning the axis sideways by an angle turns its azimuth by that over cos E
    by_elevation = -cos(phi) * cos(a) * sin(e) + sin(phi) * cos(e)
    sigma = hypot(
        by_latitude * radians(latitude_sigma_deg), hypot(by_azimuth, by_elevation) * radians(axis_sigma_deg)
    )
    return EarthRate(EARTH_RATE_DPH * along, EARTH_RATE_DPH * sigma)
