"""The result of `gyrotc check --json`: what is wrong with recordings, what is doubtful, and facts about every run."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Count, Figure, Part, Result

__all__ = ["Checked", "CheckedRun", "Doubted", "MarkedRows", "Problem"]


class MarkedRows(Part):
    """Rows that something is told of."""

    file: str = Field(description="as in `dataset.toml`")
    rows: tuple[int, int] | None = Field(description="first and last, counted from 1; null where not told")
    span_s: tuple[float, float] | None = Field(description="their times on the file's clock, s")


class Problem(Part):
    """What `fit` refuses."""

    where: str = Field(description="file, line and column")
    found: str = Field(description="what stands there")
    expected: str = Field(description="what should stand there; empty where `found` says it all")
    rows: tuple[MarkedRows, ...] = Field(description="rows that it is about")


class Doubted(Part):
    """What a person should look at."""

    id: str = Field(description="stable name of the doubt")
    where: str = Field(description="file, or `data set`")
    text: str = Field(description="what is doubtful")
    next: str = Field(description="what to do next; empty where `text` says it")
    rows: tuple[MarkedRows, ...] = Field(description="rows that it is about, the first ones")


class CheckedRun(Part):
    """Facts about a run."""

    axis: str | None = Field(description="axis that was read")
    file: str = Field(description="as in `dataset.toml`")
    from_s: Figure = Field(description="start of the span, s; null for the whole file")
    role: str = Field(description="`train` or `exam`")
    environment: str | None = Field(description="free text of the data set")
    rows: Count = Field(description="rows in the span")
    first_s: float = Field(description="time of the first row, s")
    last_s: float = Field(description="time of the last row, s")
    row_period_s: float = Field(description="median, s")
    gaps: Count = Field(description="places where rows are missing")
    missing_rows: Count = Field(description="rows that are missing there")
    temperature_c: tuple[float, float] = Field(description="lowest and highest, C")
    mean_dph: Figure = Field(description="mean rate, deg/h")
    noise_dph: Figure = Field(description="noise of a row, deg/h")
    hold_share: Figure = Field(description="share of the time at which the temperature is held")
    earth_rate_dph: Figure = Field(description="rate of the Earth that was taken off, deg/h")
    earth_rate_sigma_dph: Figure = Field(description="its uncertainty, deg/h")


class Checked(Result):
    """Problems and doubts of recordings."""

    schema_: Annotated[Literal["gyrotc.check/1"], Field(alias="schema")] = "gyrotc.check/1"
    serial: str | None = Field(description="null where it could not be read")
    axis: str | None = Field(description="as asked for: `x`, `y`, `z`, `all`, or null")
    problems: tuple[Problem, ...] = Field(description="what `fit` refuses")
    doubts: tuple[Doubted, ...] = Field(description="what it takes, and a person should look at")
    runs: tuple[CheckedRun, ...] = Field(description="every run that could be read")
