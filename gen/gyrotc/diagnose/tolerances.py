"""Shares below which a column or a direction says nothing beside others; `statistics.TOLERANCE` is for rounding."""

from __future__ import annotations

INDEPENDENT = 1e-4
"""Share of a column's energy that must be its own beside other columns: 1 % of its norm.

No formula of the catalogue describes a gyro better than to 1 %, so the weight of a column with less of its own would
be made of what the others describe wrongly.
"""

MAIN = 0.05
"""Norm of a direction over that of the strongest one, among many columns of equal norm, from which on it counts.

Where effects are 20 times above the noise, which is as clear as recordings show them, weaker directions are noise.
"""
