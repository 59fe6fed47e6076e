"""What a catalogue of calibrations answers (`gyrotc catalogue --json`)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Axis, Count, Figure, Part, Result
from .limits import Verdict

__all__ = ["CatalogueAnswer", "Catalogued", "CataloguedFile"]

Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


class CataloguedFile(Part):
    """A recording that a table was made of."""

    file: str = Field(description="as in `dataset.toml`")
    role: Literal["train", "exam"] = Field(description="of the run")
    sha256: Sha256 = Field(description="of the file")


class Catalogued(Part):
    """One calibration of one axis."""

    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null where the recordings have one axis")
    valid_from: str | None = Field(
        description="day of the calibration; null: not stated, so it is valid on no day"
    )
    valid_until: str | None = Field(description="last day; null: until the next calibration")
    tag: str = Field(description="`--tag` of the fleet; `withdrawn`: may not be carried")
    status: Literal["done", "failed"] = Field(description="as in the fleet")
    verdict: Verdict | None = Field(description="of its limits; null without limits")
    model_hash: Sha256 = Field(description="of its model")
    image_sha256: Sha256 = Field(description="of its image for a target, a payload of the catalogue")
    model_sha256: Sha256 = Field(description="of its `model.json`, a payload of the catalogue")
    after_rms_dph: Figure = Field(description="RMS after compensation, deg/h")
    expanded_dph: Figure = Field(description="U of the compensated bias, deg/h")
    folder: str = Field(description="its folder in the fleet when it was entered")
    recordings: tuple[CataloguedFile, ...] = Field(description="data that it was made of")


class CatalogueAnswer(Result):
    """Tables that a gyro may carry on a day, or what a catalogue holds."""

    schema_: Annotated[Literal["gyrotc.catalogue/1"], Field(alias="schema")] = "gyrotc.catalogue/1"
    serial: str | None = Field(description="that was asked for; null: none")
    axis: None = Field(description="each calibration has its own")
    day: str | None = Field(description="that was asked for; null: every calibration is told")
    calibrations: Count = Field(description="in the catalogue")
    found: tuple[Catalogued, ...] = Field(description="one for each axis, or the last 100 that were entered")
