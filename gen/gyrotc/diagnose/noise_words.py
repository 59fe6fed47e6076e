"""The words of causes of the family `noise`; those of the other causes stand in the catalogue (`terms`)."""

from __future__ import annotations

__all__ = ["NOISE_WORDS"]

NOISE_WORDS: dict[str, str] = {
    "noise_level": "The noise has another level than declared",
    "noise_colour": "The noise has another colour than declared",
    "noise_variance": "The noise varies with temperature, ramp rate or time since power-on",
    "outliers": "Single rows are outliers",
    "temperature_quantisation": "The temperature is recorded in coarse steps",
}
