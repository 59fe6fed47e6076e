"""`limits.json`: limits of a product, each with what was measured."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Axis, Part, Result

__all__ = ["HeldLimits", "Limit", "Value"]

Value = bool | int | float | str | tuple[float, ...] | tuple[str, ...] | None
"""A bound, or what was measured of it; null: not measured."""


class Limit(Part):
    """One limit."""

    limit: str = Field(description="name in the limits file, such as `at_most.rms_dph`")
    measured: Value = Field(description="figure, range, or what was found; null where it was not measured")
    bound: Value = Field(description="as in the limits file")
    met: bool = Field(description="a limit whose figure was not measured is not met")

    def failure(self) -> str:
        """What is told of a limit that is not met."""
        bound, measured = (list(v) if isinstance(v, tuple) else v for v in (self.bound, self.measured))
        return f"{self.limit} = {bound} is not met: {measured}"


class HeldLimits(Result):
    """Limits of a product, held against what was measured (`gyrotc build --limits`)."""

    schema_: Annotated[Literal["gyrotc.limits/1"], Field(alias="schema")] = "gyrotc.limits/1"
    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null where the recordings have one axis")
    product: str = Field(description="name of the product, empty where the limits file gives none")
    sha256: str = Field(description="of the limits file")
    met: bool = Field(description="whether all are met")
    limits: tuple[Limit, ...] = Field(description="every limit of the file")
