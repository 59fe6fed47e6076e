"""Simulation: a physical gyro in a thermal chamber, written as a data set like any recording.

chamber programme → air → thermal nodes → cavity → bias → noise → rows. docs/simulation.md tells the physics.
"""

from __future__ import annotations

from .campaign import simulate
from .scenario import names, read
from .truth import Truth, read_truth

__all__ = ["Truth", "names", "read", "read_truth", "simulate"]
