"""`evaluate.json`: recordings replayed through the compiled code, and what remains."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..common.metrics import Averages, statistics
from .base import Amount, Arithmetic, Axis, Count, Figure, Part, Result

__all__ = [
    "EvaluatedRun", "Evaluation", "FigureUncertainty", "FoundIn", "ModelSizes", "Pooled", "RunStatistics", "Statistics",
]  # fmt: skip


class Statistics(Part):
    """Figures of means over `average_s`; null where there is no sample."""

    mean_dph: Figure = Field(description="deg/h")
    std_dph: Figure = Field(description="about the mean, ddof 0, deg/h")
    rms_dph: Figure = Field(description="deg/h")
    max_abs_dph: Figure = Field(description="largest magnitude, deg/h")


class RunStatistics(Statistics):
    """The same of one run, and what the residual does over longer times; null where the run is too short."""

    rms_30min_dph: Figure = Field(description="RMS of means over 30 minutes, deg/h")
    angle_1h_arcsec: Figure = Field(description="RMS of the angle that one hour adds up to, arcsec")
    first_10min_rms_dph: Figure = Field(description="RMS of the first 10 minutes, deg/h")


class Pooled(Part):
    """Several runs, every sample with the same weight."""

    before: Statistics = Field(description="before compensation")
    after: Statistics = Field(description="after compensation")
    improvement: Figure = Field(description="RMS before over RMS after")
    samples: Count = Field(description="means over `average_s`")

    @classmethod
    def of(cls, runs: Sequence[Averages]) -> Pooled:
        """Figures over all samples of several runs."""
        before = np.concatenate([r.before_dph for r in runs]) if runs else np.zeros(0)
        after = np.concatenate([r.after_dph for r in runs]) if runs else np.zeros(0)
        was, remains = Statistics(**statistics(before)), Statistics(**statistics(after))
        ratio = was.rms_dph / remains.rms_dph if was.rms_dph is not None and remains.rms_dph else None
        return cls(before=was, after=remains, improvement=ratio, samples=int(after.size))


class EvaluatedRun(Part):
    """One run before and after compensation."""

    file: str = Field(description="as in `dataset.toml`")
    role: Literal["train", "exam"] = Field(description="of the run")
    environment: str | None = Field(description="free text of the data set")
    from_s: Figure = Field(default=None, description="start of the span, s; only of spans")
    to_s: Figure = Field(default=None, description="end of the span, s; only of spans")
    samples: Count = Field(description="means over `average_s`")
    before: Statistics = Field(description="before compensation")
    after: RunStatistics = Field(description="after compensation")


class FigureUncertainty(Part):
    """How well a figure is known from recordings of this length."""

    standard: Amount = Field(description="1 sigma, in the unit of the figure")
    freedom: Figure = Field(description="degrees of freedom; null: many")
    method: str = Field(description="what it rests on")


class FoundIn(Part):
    """Something that a person should know, with the figures behind it."""

    id: str = Field(description="its stable name")
    text: str = Field(description="what was found, and what to do")
    evidence: dict[str, Any] = Field(description="the figures that it rests on")


class ModelSizes(Part):
    """What was evaluated, and its sizes on a target."""

    method: str = Field(description="training method")
    centers: Count = Field(description="of all networks")
    table_bytes: Count = Field(description="section 3")
    rom_bytes: Count | None = Field(description="everything linked; null where nothing was compiled")
    ram_bytes: Count | None = Field(description="the caller's state; null where nothing was compiled")
    sizes_on: str | None = Field(description="target of these sizes")
    sum_abs_weights_dph: float = Field(description="largest sum of absolute weights of a network, deg/h")


class Evaluation(Result):
    """What the compiled code makes of recordings (`gyrotc evaluate`)."""

    schema_: Annotated[Literal["gyrotc.evaluate/1"], Field(alias="schema")] = "gyrotc.evaluate/1"
    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null where the recordings have one axis")
    numeric: Arithmetic = Field(description="arithmetic that was run")
    block_s: float = Field(description="length of a block, s")
    average_s: Annotated[float, Field(gt=0.0, le=1e9)] = Field(description="averaging of all RMS figures, s")
    noise_floor_dph: Amount | None = Field(description="of means over `average_s`, deg/h")
    noise_floor_source: str | None = Field(description="`simulated`, or `estimated`")
    mismatches: Count | None = Field(description="steps that differ from the reference; null: not compared")
    runs: tuple[EvaluatedRun, ...] = Field(description="every run")
    train: Pooled | None = Field(description="all training runs; null where there are none")
    exam: Pooled | None = Field(description="all exam runs; null where there are none")
    findings: tuple[FoundIn, ...] = Field(description="what a person should know, the gravest first")
    model: ModelSizes = Field(description="what was evaluated")
    left_out: Pooled | None = Field(
        default=None, description="without exam runs: spans left out of training in turn"
    )

    generalises: bool | None = Field(
        default=None,
        description="whether the correction held on history that it had not seen; null: not known",
    )
    rows_left_out: Count | None = Field(
        default=None, description="rows of training runs that were outliers; null: not known"
    )
    sigma_rms_dph: Amount | None = Field(
        default=None,
        description="RMS of the 1 sigma that the table states, over the rows that the model is judged by and where the "
        "correction is neither held nor clamped, deg/h; null where the table states none",
    )
    uncertainty: dict[str, FigureUncertainty] | None = Field(
        default=None,
        description="of the figures that the model is judged by, by the names of limits; without those that the "
        "recordings are too short for",
    )

    def judged(self) -> tuple[Literal["exam", "left_out", "train"], Pooled] | None:
        """What the model is judged by: exam runs, else spans left out, else the training runs themselves."""
        if self.exam:
            return "exam", self.exam
        if self.left_out:
            return "left_out", self.left_out
        return ("train", self.train) if self.train else None
