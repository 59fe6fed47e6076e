"""Recordings as they are (`check`, `import`) and as they were simulated (`truth.json`)."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from .base import Axis, Count, Figure, Finding, MarkedRows, Numbered, Part, Result, Share
from .rows import RowsCount


class Problem(Part):
    """What `fit` refuses."""

    where: str = Field(description="file, line and column")
    found: str = Field(description="what stands there")
    expected: str = Field(description="what should stand there; empty where `found` says it all")
    rows: tuple[MarkedRows, ...] = Field(description="rows that it is about")


class CheckedRun(Part):
    """Facts about a run."""

    axis: str | None = Field(description="axis that was read")
    file: str = Field(description="as in `dataset.toml`")
    from_s: Figure = Field(description="start of the span, s; null for the whole file")
    role: str = Field(description="`train` or `exam`")
    environment: str | None = Field(description="free text of the data set")
    rows: RowsCount = Field(description="rows of the run, kept and left out")
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
    """Problems and warnings of recordings."""

    schema_: Annotated[Literal["gyrotc.check/1"], Field(alias="schema")] = "gyrotc.check/1"
    serial: str | None = Field(description="null where it could not be read")
    axis: str | None = Field(description="as asked for: `x`, `y`, `z`, `all`, or null")
    problems: tuple[Problem, ...] = Field(description="what `fit` refuses")
    warnings: tuple[Finding, ...] = Field(description="what it takes, and a person should look at")
    not_testable: tuple[Finding, ...] = Field(
        default=(), description="what these recordings cannot tell, by the `id` of the finding that stays open"
    )
    runs: tuple[CheckedRun, ...] = Field(description="every run that could be read")


class OriginalFile(Part):
    """The logger's file that a run was made of, as `[source]` of `dataset.toml` names it."""

    file: str = Field(description="its name")
    sha256: str = Field(description="of its contents")
    bytes: Count = Field(description="its size, bytes")
    imported_by: str = Field(description="gyrotc with its version")
    map: str = Field(description="file of the map that read it")
    run: str = Field(description="file of the run")


class ImportedFile(Part):
    """A run that was written."""

    file: str = Field(description="as in `dataset.toml`")
    read: Count = Field(description="rows of the file: those in `rows` and those in `left_out`")
    above: Count = Field(description="lines of text above the first row: names, units, and what else is written there")
    rows: Count = Field(description="rows that were taken")
    left_out: dict[str, Count] = Field(description="rows that were not, by the reason")
    trusted: tuple[str, ...] = Field(
        description="what values look like that contradicts their unit, but was taken (`trust_units`)"
    )
    source: OriginalFile = Field(description="the original")


class ImportedFiles(Result):
    """What was made of a logger's files."""

    schema_: Annotated[Literal["gyrotc.import/1"], Field(alias="schema")] = "gyrotc.import/1"
    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null: an import is of all axes")
    map: dict[str, Any] = Field(description="the map that was kept; its keys: docs/import.md")
    runs: tuple[ImportedFile, ...] = Field(description="every run, in the order of the files")
    findings: tuple[Finding, ...] = Field(default=(), description="what a person should look at, as `check` writes it")


class TrueRun(Part):
    """What was simulated in one run."""

    file: str = Field(description="as in `dataset.toml`")
    noise: str = Field(description="file of its noise, mean of every step, deg/h, by its path in the folder")
    noise_step_s: Annotated[float, Field(ge=1e-6, le=1e6)] = Field(description="length of a step, s")
    bias_dph: tuple[float, float] = Field(description="lowest and highest true bias, deg/h")
    states: dict[str, str] | None = Field(
        default=None,
        description="of a gyro with further thermometers, differences of nodes or a laser: files of its true states by "
        "name (temperatures of the nodes, C; losses and gain, 1e-6; stroke, half wavelengths), mean of every step",
    )


class TrueLot(Part):
    """Where a gyro of a simulated lot stands in it."""

    units: int = Field(description="gyros in the lot")
    family: Share = Field(description="correlation of each parameter between two units of one cluster")
    clusters: int = Field(description="groups with a center of their own")
    cluster: int = Field(description="number of the group, from 0; of a foreign unit that of none: -1")
    unrelated: bool = Field(description="whether it shares nothing with the lot but the scenario")
    scores: dict[str, float] = Field(description="every parameter that was drawn, in standard deviations")


class SimulatedTruth(Numbered):
    """What a simulated data set really is; only `evaluate` and tests open it."""

    schema_: Annotated[Literal["gyrotc.truth/1"], Field(alias="schema")] = "gyrotc.truth/1"
    scenario: str = Field(description="name or file of the scenario")
    seed: int = Field(description="of everything that was drawn")
    noise: dict[str, Any] = Field(description="levels of the noise, as in the scenario")
    map: dict[str, Any] = Field(description="the bias of the gyro over temperature and its rate, as it was drawn")
    causes: tuple[dict[str, Any], ...] = Field(description="`id`, `channel` and parameters of each cause")
    plan: dict[str, Any] = Field(
        description="gyro, chamber, sensor and what is recorded of the scenario: thermometers, laser, channels"
    )
    runs: tuple[TrueRun, ...] = Field(description="every run")
    lot: TrueLot | None = Field(default=None, description="of a gyro of a lot")
