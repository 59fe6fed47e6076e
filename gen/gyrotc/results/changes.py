"""`changes.json`: what is different from an earlier result of the same gyro."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Axis, Figure, Part, Result

__all__ = [
    "Apart", "At", "Changes", "Envelopes", "FigureChange", "FileChanges", "NameChanges", "RangeChange", "TextChange",
]  # fmt: skip


class FigureChange(Part):
    """A figure of both results."""

    before: int | Figure = Field(description="of the earlier result")
    after: int | Figure = Field(description="of this one")


class TextChange(Part):
    """A text of both results."""

    before: str | None = Field(description="of the earlier result")
    after: str | None = Field(description="of this one")


class RangeChange(Part):
    """A range of both results, lowest and highest."""

    before: tuple[float, float] = Field(description="of the earlier result")
    after: tuple[float, float] = Field(description="of this one")


class Envelopes(Part):
    """Calibrated ranges."""

    temperature_c: RangeChange = Field(description="C")
    slope_c_per_min: RangeChange = Field(description="C/min")

    @classmethod
    def of(cls, **ranges: tuple[tuple[float, float], tuple[float, float]]) -> Envelopes:
        """From pairs of an earlier and a later range."""
        return cls(**{name: RangeChange(before=a, after=b) for name, (a, b) in ranges.items()})


class NameChanges(Part):
    """Names that came and went."""

    new: tuple[str, ...] = Field(description="only in this result")
    gone: tuple[str, ...] = Field(description="only in the earlier one")


class FileChanges(NameChanges):
    """Files that came, went, or have other bytes."""

    other_bytes: tuple[str, ...] = Field(description="in both, with another SHA-256")


class At(Part):
    """A place on the map."""

    temperature_c: float = Field(description="C")
    slope_c_per_min: float = Field(description="C/min")


class Apart(Part):
    """How far the maps lie apart where both were calibrated."""

    rms_dph: float = Field(description="deg/h")
    mean_dph: float = Field(description="deg/h")
    max_abs_dph: float = Field(description="deg/h")
    at: At = Field(description="where they are farthest apart")
    rms_over_floor: Figure = Field(description="`rms_dph` over the noise floor; null where that is not known")


class Changes(Result):
    """What is different from an earlier result (`gyrotc build --previous`)."""

    schema_: Annotated[Literal["gyrotc.changes/1"], Field(alias="schema")] = "gyrotc.changes/1"
    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null where the recordings have one axis")
    same_model: bool = Field(description="whether the models have one hash")
    model_hash: TextChange = Field(description="hashes of the models")
    recordings: FileChanges = Field(description="recordings that the models were fitted to")
    map: Apart | None = Field(description="null where the envelopes have nothing in common")
    envelope: Envelopes = Field(description="calibrated ranges")
    figures: dict[str, FigureChange | str] = Field(
        description="figures of both results; `judged_on` says on what those of recordings were measured, which are "
        "there where both results were judged on the same kind"
    )
    findings: NameChanges = Field(description="ids of findings")
    versions: dict[str, TextChange] = Field(description="programs whose version is another")
    files: FileChanges = Field(description="emitted files")
