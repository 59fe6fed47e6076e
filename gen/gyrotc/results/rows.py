"""Counts of rows: those that were used, and those that were left out, by the reason."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from .base import Count, Part

STATED = (
    "excluded", "no rate", "no temperature", "no reading of a channel", "no temperature temperature_late_s later",
)  # fmt: skip
"""Reasons that the recording or its description states; any other reason was found by looking at the rows."""


class RowsCount(Part):
    """Count of rows that were read: those kept and those left out."""

    read: Count = Field(description="rows between the start and the end of the run")
    kept: Count = Field(description="rows that may be used")
    left_out: dict[str, Count] = Field(
        description="rows that are not used, by the reason; `kept` and these add up to `read`"
    )

    @property
    def bad(self) -> int:
        """Number of rows that are left out because of what they show."""
        return sum(rows for reason, rows in self.left_out.items() if reason not in STATED)

    def words(self) -> str:
        """Return the count of rows in words."""
        reasons = ", ".join(f"{rows} {reason}" for reason, rows in self.left_out.items())
        return f"{self.read} rows read, {self.kept} kept" + (f", left out: {reasons}" if reasons else "")


class LeftOutRows(Part):
    """A stretch of rows that were left out."""

    file: str = Field(description="name of the file in `dataset.toml`")
    from_s: float = Field(description="time of the first row, s")
    to_s: float = Field(description="time half a row after the last one, s")
    rows: Annotated[int, Field(ge=1)] = Field(description="number of rows")
    reason: str = Field(description="reason why the rows were left out")


class RowsUsed(RowsCount):
    """Rows of several runs."""

    stretches: tuple[LeftOutRows, ...] = Field(
        description="stretches that are left out because of what they show, the first 200"
    )
