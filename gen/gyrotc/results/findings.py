"""The one form of what is found in recordings and models: by check, fit, evaluate, diagnose and fleet."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import Field

from .base import Figure, Part

if TYPE_CHECKING:
    from typing_extensions import Self


ADVICE = {
    "coarse_rate": "Record the rate with more digits, in a finer range of the converter, or as pulses.",
    "coarse_temperature": "Record more digits of the thermometer, or one with a finer resolution.",
    "coarse_time": "Number the rows instead of trusting the stamps: gyrotc import FILE --rate-hz R, or record finer "
    "stamps.",
    "constant_channel": "Look whether the sensor was connected; take the column out if it says nothing.",
    "counter_wrapped": "Add the range of the counter behind each such place, or store the counts with their sign.",
    "earth_rate_not_stated": 'Say in dataset.toml what was done about it: earth_rate = "removed", "none" or "compute".',
    "envelope_coverage": "Plan runs for the cells that are empty: gyrotc plan.",
    "envelope_not_reached": "Record a run that goes there, or state the envelope that the product needs.",
    "gaps": "Look at the logger (buffer, disk, cable) at these times. Blocks with fewer than half of their rows are "
    "left out by themselves.",
    "jump_in_temperature": "Look for a loose contact or a change of the thermometer there; leave the stretch out by "
    "exclude, or cut the run by from_s and to_s.",
    "left_out": "Nothing, if it is meant so.",
    "mostly_holds": "Record ramps at several rates, up and down.",
    "no_temperature_information": "Record runs in a chamber, over the temperatures that the product will see.",
    "rate_outliers": "Look for what disturbed the gyro at these times; paste the exclude line into the run's [[run]] "
    "of dataset.toml to leave them out of every figure, too.",
    "row_periods_differ": "Nothing, if the logger was set so; else look which of the files has a wrong time unit.",
    "runs_contradict": "Compare serial, mounting, mode and software of this run with the others; leave out what is not "
    "the same gyro in the same state. gyrotc diagnose looks for turn-on offsets and ageing.",
    "same_recording_twice": "Keep one of the two.",
    "small_rates": 'Declare the unit: [units] rate = "deg/s" in dataset.toml.',
    "rate_held": "Record at the gyro's own rhythm, or keep every row of it once.",
    "shared_axes": "Look at the wiring of the channels and at the columns of the logger.",
    "stuck_rate": "Look at the logger and the gyro's data line there; leave the stretch out by exclude.",
    "stuck_temperature": "Look at the thermometer's wiring; paste the exclude line.",
    "temperature_late": "Pair the files of this run anew and convert them again, or leave the run out.",
    "units_trusted": "Nothing, if the values are right as they are; else declare their unit.",
    "time_drifts": "Find out which clock is right. If the gyro's is: number the rows, gyrotc import FILE --rate-hz R.",
    "time_jumps": "Number the rows instead, gyrotc import FILE --rate-hz R, or cut the file there into two runs by "
    "to_s and from_s.",
    "time_since_epoch": "State power_on_s of the run, or subtract the time of power-on; gyrotc import does that.",
}
"""What to do next, by the id of a finding."""


class MarkedRows(Part):
    """Rows that something is reported of."""

    file: str = Field(description="as in `dataset.toml`")
    rows: tuple[int, int] | None = Field(description="first and last, counted from 1; null where not stated")
    span_s: tuple[float, float] | None = Field(description="their times on the file's clock, s")


class Estimate(Part):
    """A figure with its 95 % interval."""

    value: float = Field(description="the likeliest")
    low: Figure = Field(description="lower end; null where there is no interval")
    high: Figure = Field(description="upper end; null where there is no interval")

    @classmethod
    def of(cls, found: tuple[float, float, float], **others: Any) -> Self:
        """From the value and the ends of its interval."""
        return cls(value=found[0], low=found[1], high=found[2], **others)


class Size(Estimate):
    """How large something is."""

    unit: str = Field(description="of these figures")


class Finding(Part):
    """Something that a person should know; fields that do not apply are absent."""

    id: str = Field(description="its stable name")
    where: str = Field(default="data set", description="file with the start of the run and axes, or `data set`")
    text: str = Field(description="what was found, and what it means")
    next: str = Field(default="", description="what to do next; empty or absent where `text` says it")
    file: str | None = Field(default=None, description="of its run; null: it is about the data set or the model")
    from_s: Figure = Field(default=None, description="start of the run in its file, s; null: the whole file")
    axes: tuple[str, ...] = Field(default=(), description="axes that show it; empty: all that were read")
    time_s: Estimate | None = Field(default=None, description="when it happened, on the file's clock, s")
    size: Size | None = Field(default=None, description="how large it is")
    leave_out_s: tuple[tuple[float, float], ...] = Field(
        default=(), description="times to leave out, from and to, s; empty: nothing has to be left out"
    )
    whole_run: bool = Field(default=False, description="whether the run is to be left out as a whole")
    exclude: str | None = Field(default=None, description="line of dataset.toml that leaves these times out")
    rows: tuple[MarkedRows, ...] = Field(default=(), description="rows that it is about, the first ones")
    evidence: dict[str, Any] = Field(default={}, description="the figures that it rests on")

    def __str__(self) -> str:
        return f"{self.where}: {self.text}"
