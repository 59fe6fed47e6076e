"""The one form of what is found in recordings and models: by check, fit, evaluate, diagnose and fleet."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import Field

from .base import Figure, Part

if TYPE_CHECKING:
    from typing_extensions import Self


class MarkedRows(Part):
    """Rows that something is reported of."""

    file: str = Field(description="as in `dataset.toml`")
    rows: tuple[int, int] | None = Field(description="first and last, counted from 1; null where not stated")
    span_s: tuple[float, float] | None = Field(description="their times on the file's clock, s")


class Estimate(Part):
    """A figure with its 95 % interval."""

    value: float = Field(description="the likeliest")
    low: Figure = Field(description="lower end; null where there is no interval")
    high: Figure = Field(description="upper end; null where there is no interval")

    @classmethod
    def of(cls, found: tuple[float, float, float], **others: Any) -> Self:
        """From the value and the ends of its interval."""
        return cls(value=found[0], low=found[1], high=found[2], **others)


class Size(Estimate):
    """How large something is."""

    unit: str = Field(description="of these figures")


class Finding(Part):
    """Something that a person should know; fields that do not apply are absent."""

    id: str = Field(description="its stable name")
    where: str = Field(default="data set", description="file with the start of the run and axes, or `data set`")
    text: str = Field(description="what was found, and what it means")
    next: str = Field(default="", description="what to do next; empty or absent where `text` says it")
    file: str | None = Field(default=None, description="of its run; null: it is about the data set or the model")
    from_s: Figure = Field(default=None, description="start of the run in its file, s; null: the whole file")
    axes: tuple[str, ...] = Field(default=(), description="axes that show it; empty: all that were read")
    time_s: Estimate | None = Field(default=None, description="when it happened, on the file's clock, s")
    size: Size | None = Field(default=None, description="how large it is")
    leave_out_s: tuple[tuple[float, float], ...] = Field(
        default=(), description="times to leave out, from and to, s; empty: nothing has to be left out"
    )
    whole_run: bool = Field(default=False, description="whether the run is to be left out as a whole")
    exclude: str | None = Field(default=None, description="line of dataset.toml that leaves these times out")
    rows: tuple[MarkedRows, ...] = Field(default=(), description="rows that it is about, the first ones")
    evidence: dict[str, Any] = Field(default={}, description="the figures that it rests on")

    def __str__(self) -> str:
        return f"{self.where}: {self.text}"
