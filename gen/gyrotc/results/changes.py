"""`changes.json`: what is different from an earlier result of the same gyro."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Amount, Axis, Figure, Part, Result
from .evaluation import Pooled
from .limits import HeldLimits

__all__ = [
    "Apart", "AsFound", "At", "Calibration", "Changes", "Envelopes", "FigureChange", "FileChanges", "NameChanges",
    "RangeChange", "TextChange",
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
    expanded_uncertainty_dph: Amount | None = Field(
        default=None,
        description="U (k = 2) of `rms_dph`: twice the RMS that the uncertainties of both maps give "
        "(`uncertainty_dph` of the models; without it those of the means of what remains) although the gyro has not "
        "changed; null where that is not known",
    )
    significant: bool | None = Field(
        default=None, description="whether `rms_dph` is more than that; null where it is not known"
    )


class AsFound(Part):
    """The earlier correction on the new recordings: how the unit was when it came back."""

    judged_on: Literal["exam", "train"] = Field(
        description="runs of the new data set that it was judged on; it has seen none of them"
    )
    figures: Pooled = Field(description="of these runs, `after` with the earlier correction")
    limits: HeldLimits | None = Field(description="the same limits; null where there were none")


class Calibration(Part):
    """One of the calibrations of a unit, the earliest first."""

    date: str | None = Field(description="`calibrated_on` of `[meta]`, else the start of the last recording")
    model_hash: str = Field(description="of its model")
    as_found_rms_dph: Figure = Field(description="of the correction before it on its recordings, deg/h")
    as_left_rms_dph: Figure = Field(description="of its own, deg/h")
    moved_rms_dph: Figure = Field(description="how far the map moved since the one before, deg/h")
    moved_mean_dph: Figure = Field(description="its mean over the common envelope, deg/h")
    expanded_uncertainty_dph: Figure = Field(description="U (k = 2) of `moved_rms_dph`")
    significant: bool | None = Field(description="whether it moved by more than that")


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
    as_found: AsFound | None = Field(
        default=None, description="null where `as_found_missing` says why, or of an older gyrotc"
    )
    as_found_missing: str = Field(default="", description="why there is no state as found")
    history: tuple[Calibration, ...] = Field(
        default=(),
        description="all calibrations that are known by their chain of `--previous`, this one last",
    )

    @property
    def named(self) -> tuple[tuple[str, NameChanges], ...]:
        """What came, went or has other bytes, by what it is."""
        return ("recordings", self.recordings), ("findings", self.findings), ("files", self.files)
