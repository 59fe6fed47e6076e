"""`compare.json`: training methods side by side."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from .base import Axis, Count, Figure, Part, Result

__all__ = ["Comparison", "Group", "Method", "Published"]


class Published(Part):
    """Figures of Ding et al. 2014, Table 1."""

    before_rms_dph: float = Field(description="deg/h")
    after_rms_dph: float = Field(description="deg/h")
    improvement: float = Field(description="RMS before over RMS after")


class Group(Part):
    """What one method makes of one environment."""

    environment: str = Field(description="free text of the data set")
    samples: Count = Field(description="means over `average_s`")
    before_rms_dph: Figure = Field(description="deg/h")
    before_std_dph: Figure = Field(description="about the mean, deg/h")
    after_rms_dph: Figure = Field(description="deg/h")
    after_std_dph: Figure = Field(description="about the mean, deg/h")
    improvement: Figure = Field(description="RMS before over RMS after")
    published: Published | None = Field(
        default=None, description="the paper's figures, where the recordings are of its environments"
    )


class Method(Part):
    """What one training method makes of all environments."""

    id: str = Field(description="as `--method` takes it")
    groups: tuple[Group, ...] = Field(description="environment by environment")
    exam_rms_dph: Figure = Field(description="RMS over all environments, deg/h")
    exam_std_dph: Figure = Field(description="about the mean, deg/h")
    before_rms_dph: Figure = Field(description="deg/h")
    improvement: Figure = Field(description="RMS before over RMS after")
    centers: Count = Field(description="centers of the networks")
    table_bytes: Count = Field(description="size of its table, bytes")
    sum_abs_weights_dph: float = Field(description="sum of the absolute weights, deg/h")
    noise_floor_dph: Figure = Field(description="as this method estimates it, deg/h")
    train_s: float = Field(description="processor time of training, s")
    published_train_s: tuple[float, float] | None = Field(
        default=None, description="least and most of the paper, s"
    )


class Comparison(Result):
    """Every training method on one data set (`gyrotc compare`)."""

    schema_: Annotated[Literal["gyrotc.compare/1"], Field(alias="schema")] = "gyrotc.compare/1"
    serial: str = Field(description="gyro serial")
    axis: Axis = Field(description="null where the recordings have one axis")
    block_s: float = Field(description="length of a block, s")
    average_s: float = Field(description="averaging of all RMS figures, s")
    seed: int = Field(description="of everything that is drawn")
    judged_on: Literal["exam", "left_out"] = Field(description="exam runs, or what was left out in turn")
    noise_floor_dph: Figure = Field(description="estimated, of means over `average_s`, deg/h")
    noise_floor_source: Literal["estimated"] = Field(description="where the noise floor comes from")
    methods: tuple[Method, ...] = Field(description="in the order in which they were tried")
