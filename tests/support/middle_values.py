"""Parameters for any cause of the catalogue, from what the catalogue says of them."""

from __future__ import annotations

from gyrotc.causes import Cause, Parameter


def middle_values(cause: Cause) -> dict[str, float]:
    """Return every parameter at its default, or inside its range where it has none or 0 switches it off."""
    return {p.name: p.default or _inside(p) for p in cause.parameters}


def _inside(parameter: Parameter) -> float:
    low, high = parameter.low, parameter.high
    return (low * high) ** 0.5 if low > 0.0 else 0.25 * low + 0.75 * high
