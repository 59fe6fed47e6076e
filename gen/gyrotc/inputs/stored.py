"""JSON that one command wrote and another reads back: the fields that are used, and their types.

Files lie on disks and pass through hands; what is not as it was written is refused by field, not met half-way
through a page. Fields that nothing reads are let through.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from ..errors import InputError
from . import checked, read_json

__all__ = ["KINDS", "Kind", "checked_result", "read_result"]

Figure = Annotated[float, Field(ge=-1e300, le=1e300)] | None
Count = Annotated[int, Field(ge=0)]


class _Stored(BaseModel):
    model_config = ConfigDict(extra="allow", strict=True, allow_inf_nan=False)


class _Statistics(_Stored):
    rms_dph: Figure
    std_dph: Figure
    mean_dph: Figure
    max_abs_dph: Figure


class _Pooled(_Stored):
    samples: Count
    before: _Statistics
    after: _Statistics
    improvement: Figure


class _Finding(_Stored):
    id: str
    text: str


class _AllanPoint(_Stored):
    tau_s: Annotated[float, Field(gt=0.0, le=1e12)]
    deviation_dph: Annotated[float, Field(ge=0.0, le=1e12)]
    freedom: Annotated[float, Field(gt=0.0, le=1e12)]


class _Noise(_Stored):
    quantisation_arcsec: Figure
    arw_deg_per_sqrt_h: Figure
    bias_instability_dph: Figure
    rate_random_walk_dph_per_sqrt_h: Figure
    allan: list[_AllanPoint]


class _Rung(_Stored):
    id: str
    left_out_rms_dph: Figure
    standard_error_dph: Figure
    beats_constant: bool
    chosen: bool
    refused: str | None = None


class _LeftOut(_Stored):
    file: str
    from_s: float
    to_s: float
    rows: Annotated[int, Field(ge=1)]


class _Outliers(_Stored):
    rows: Annotated[int, Field(ge=0)] = 0
    share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    stretches: list[_LeftOut] = []


class _Training(_Stored):
    ladder: list[_Rung] = []
    reason: str = ""
    generalises: bool | None = None
    findings: list[_Finding] = []
    predicted_rms_ratio: Figure = None
    prediction_withheld: str | None = None
    noise_floor_dph: Figure
    left_out: _Pooled | None = None
    left_out_spans: list[_Pooled | None] = []
    outliers: _Outliers = _Outliers()
    noise: _Noise
    sensitivity: dict[str, Figure]
    curves: dict[str, Any]


class _Diagnosis(_Stored):
    verdict: str
    text: str
    causes: list[dict[str, Any]]
    considered: list[dict[str, Any]]
    extended: dict[str, Any] | None
    pictures: list[str] = []


Kind = Literal["training", "diagnose"]

KINDS: dict[Kind, tuple[type[BaseModel], str | None]] = {
    "training": (_Training, "gyrotc.fit/1"),
    "diagnose": (_Diagnosis, "gyrotc.diagnose/1"),
}
"""Fields and schema of every kind."""


def read_result(path: Path, kind: Kind, *, optional: bool = False) -> dict[str, Any]:
    """A JSON object that a command wrote; {} for an optional one that is absent.

    Raises:
        InputError: It is missing, is no JSON, has another schema, or a field that is used is wrong.
    """
    if optional and not path.exists() and not path.is_symlink():
        return {}
    return checked_result(read_json(path, f"what gyrotc wrote as {path.name}"), kind, str(path))


def checked_result(content: Any, kind: Kind, where: str) -> dict[str, Any]:
    """The object itself, looked through. Raises as `read_result`."""
    fields, schema = KINDS[kind]
    if not isinstance(content, dict):
        raise InputError(where, "is not a JSON object", f"what gyrotc wrote ({schema})")
    if content.get("schema") != schema:
        raise InputError(f"{where}, field schema", repr(content.get("schema"))[:60], repr(schema))
    checked(fields, content, where)
    return content
