"""`c/release.json`: what a laboratory signs when it releases a result."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Amount, Axis, Figure, Part, Result
from .limits import Limit, Verdict

__all__ = ["RELEASED", "STATED", "Release", "ReleasedUnit"]

RELEASED = (
    "model.json", "training.json", "evaluate.json", "limits.json", "budget.json", "changes.json", "manifest.json",
    "diagnosis/diagnose.json",
)  # fmt: skip
"""Files of an axis that say something of the unit, by their paths in its folder, and are signed."""

STATED = (*RELEASED, "verify.json", "c")
"""These and what is compared anew by whoever verifies."""


class ReleasedUnit(Part):
    """One axis."""

    axis: Axis = Field(description="null where the recordings have one axis")
    model_hash: str = Field(description="hash of the model")
    verdict: Verdict | None = Field(description="of limits and checks; null: no limits were given")
    failures: tuple[str, ...] = Field(description="checks that failed beside the limits")
    limits_sha256: str | None = Field(description="of the limits file; null where none was given")
    limits: tuple[Limit, ...] = Field(description="every limit")
    expanded_dph: Amount | None = Field(description="U of the compensated bias; null: no budget, deg/h")
    coverage_factor: Figure = Field(description="k of it")
    calibrated_on: str | None = Field(description="day of the calibration; null: not stated")
    valid_until: str | None = Field(description="last day of the interval; null: none is stated")


class Release(Result):
    """What is signed (`gyrotc sign`): it binds the emitted files to what was found of the unit."""

    schema_: Annotated[Literal["gyrotc.release/1"], Field(alias="schema")] = "gyrotc.release/1"
    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null where there is one axis, and for the folder of several")
    verdict: Verdict | None = Field(description="the gravest of all axes; null: no limits were given")
    accepted_fail: str | None = Field(
        description="why it is released although the verdict is FAIL; else null"
    )
    units: tuple[ReleasedUnit, ...] = Field(description="every axis")
    emission: str = Field(description="SHA-256 of `c/emission.json`, which has that of every emitted file")
    files: dict[str, str] = Field(description="SHA-256 of the files behind this, by path in the result")
