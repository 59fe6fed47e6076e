"""Results about recordings: `check`, `import`, and the truth of simulated ones."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from .base import Axis, Count, Figure, Finding, MarkedRows, Numbered, Part, Result, Share
from .rows import RowsCount


class Problem(Part):
    """A problem for which `fit` refuses the recordings."""

    where: str = Field(description="file, line and column of the problem")
    found: str = Field(description="content found there")
    expected: str = Field(description="content expected there; empty if `found` says it all")
    rows: tuple[MarkedRows, ...] = Field(description="rows that the problem is about")


class CheckedRun(Part):
    """Facts about a run."""

    axis: str | None = Field(description="axis that was read; null if there is one")
    file: str = Field(description="name of the file in `dataset.toml`")
    from_s: Figure = Field(description="start of the run in its file, s; null means the whole file")
    role: str = Field(description="role of the run: `train` or `exam`")
    environment: str | None = Field(description="environment of the run, as the data set states it; null if not stated")
    rows: RowsCount = Field(description="rows of the run, kept and left out")
    first_s: float = Field(description="time of the first row, s")
    last_s: float = Field(description="time of the last row, s")
    row_period_s: float = Field(description="median time between rows, s")
    gaps: Count = Field(description="number of places where rows are missing")
    missing_rows: Count = Field(description="number of rows that are missing in the gaps")
    temperature_c: tuple[float, float] = Field(description="lowest and highest temperature, C")
    mean_dph: Figure = Field(description="mean rate, deg/h")
    noise_dph: Figure = Field(description="noise of a row, 1 sigma, deg/h")
    hold_share: Figure = Field(description="share of the time at constant temperature")
    earth_rate_dph: Figure = Field(description="subtracted rate of the Earth, deg/h; null if none was")
    earth_rate_sigma_dph: Figure = Field(
        description="standard uncertainty of the subtracted rate, deg/h; null if none was"
    )


class Checked(Result):
    """Problems and warnings of recordings."""

    schema_: Annotated[Literal["gyrotc.check/1"], Field(alias="schema")] = "gyrotc.check/1"
    serial: str | None = Field(description="gyro serial; null if it could not be read")
    axis: str | None = Field(description="axis asked for: `x`, `y`, `z`, `all`, or null")
    problems: tuple[Problem, ...] = Field(description="problems for which `fit` refuses the recordings")
    warnings: tuple[Finding, ...] = Field(description="findings that `fit` accepts and a person should look at")
    not_testable: tuple[Finding, ...] = Field(default=(), description="findings that these recordings cannot decide")
    runs: tuple[CheckedRun, ...] = Field(description="every run that could be read")


class OriginalFile(Part):
    """The logger's file that a run was made of, as in `[source]` of `dataset.toml`."""

    file: str = Field(description="name of the logger's file")
    sha256: str = Field(description="SHA-256 of the logger's file")
    bytes: Count = Field(description="size of the logger's file, bytes")
    imported_by: str = Field(description="gyrotc with its version")
    map: str = Field(description="file of the import map that it was read by")
    run: str = Field(description="file of the run that was made of it")


class ImportedFile(Part):
    """A run that was written."""

    file: str = Field(description="name of the file in `dataset.toml`")
    read: Count = Field(description="rows of the logger's file: the sum of `rows` and `left_out`")
    above: Count = Field(description="lines of text above the first row, such as names and units")
    rows: Count = Field(description="rows that were written to the run")
    left_out: dict[str, Count] = Field(description="rows that were not written, by the reason")
    trusted: tuple[str, ...] = Field(
        description="columns whose values look like another unit, accepted by `trust_units`"
    )
    source: OriginalFile = Field(description="logger's file that the run was made of")
    joined: tuple[OriginalFile, ...] = Field(
        default=(), description="files with the temperature that were joined to it"
    )


class ImportedFiles(Result):
    """Runs that were made of a logger's files (`gyrotc import`)."""

    schema_: Annotated[Literal["gyrotc.import/1"], Field(alias="schema")] = "gyrotc.import/1"
    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null, since an import has all axes")
    map: dict[str, Any] = Field(description="import map, as written beside the runs (docs/import.md)")
    runs: tuple[ImportedFile, ...] = Field(description="all runs, in the order of the files")
    findings: tuple[Finding, ...] = Field(default=(), description="findings that `check` has on the runs")


class TrueRun(Part):
    """True values of one simulated run."""

    file: str = Field(description="name of the file in `dataset.toml`")
    noise: str = Field(description="file of the noise that was added: mean over each step, deg/h; path in the folder")
    noise_step_s: Annotated[float, Field(ge=1e-6, le=1e6)] = Field(description="length of a step of the noise, s")
    bias_dph: tuple[float, float] = Field(description="lowest and highest true bias, deg/h")
    states: dict[str, str] | None = Field(
        default=None,
        description="files of the true states by name, mean over each step of the noise: temperatures of the nodes "
        "(C), losses and gain (1e-6), stroke (half wavelengths); null without further temperature sensors, "
        "differences of nodes and laser",
    )


class TrueLot(Part):
    """Place of a gyro in its simulated lot."""

    units: int = Field(description="number of gyros in the lot")
    family: Share = Field(description="correlation of each parameter between two units of one cluster")
    clusters: int = Field(description="number of clusters")
    cluster: int = Field(description="number of the gyro's cluster, from 0; -1 for an unrelated gyro")
    unrelated: bool = Field(description="true if the gyro shares nothing with the lot but the scenario")
    scores: dict[str, float] = Field(description="standard score of each parameter that was drawn")


class SimulatedTruth(Numbered):
    """The truth of a simulated data set; only `evaluate` and tests open it."""

    schema_: Annotated[Literal["gyrotc.truth/1"], Field(alias="schema")] = "gyrotc.truth/1"
    scenario: str = Field(description="name of the scenario: that of its file, without suffix")
    seed: int = Field(description="seed from which everything was drawn")
    noise: dict[str, Any] = Field(description="levels of the noise, as in the scenario")
    map: dict[str, Any] = Field(description="the bias of the gyro over temperature and its rate, as it was drawn")
    causes: tuple[dict[str, Any], ...] = Field(description="`id`, `channel` and parameters of each cause")
    plan: dict[str, Any] = Field(
        description="tables of the scenario: gyro, chamber, sensor, thermometers, differences of nodes, laser, channels"
    )
    runs: tuple[TrueRun, ...] = Field(description="all runs")
    lot: TrueLot | None = Field(default=None, description="place in the lot; null if the gyro is of none")
