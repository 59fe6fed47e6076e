"""Simulation: a physical gyro in a thermal chamber, written as a data set like any recording.

chamber programme → air → thermal nodes → cavity → bias → noise → rows. docs/simulation.md tells the physics.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .truth import Truth, read_truth

if TYPE_CHECKING:
    from .campaign import simulate
    from .scenario import names, read

__all__ = ["Truth", "names", "read", "read_truth", "simulate"]


def __getattr__(name: str) -> Any:
    """What simulates is imported when it is asked for: who only reads the truth needs no solvers."""
    if name in ("names", "read"):
        from . import scenario

        return getattr(scenario, name)
    if name == "simulate":
        from .campaign import simulate

        return simulate
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
