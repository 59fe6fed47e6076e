"""What to do next about a doubt, where its text does not say it."""

from __future__ import annotations

__all__ = ["advice_of"]

_ADVICE = {
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
    "rate_outliers": "Look for what disturbed the gyro at these times; paste the exclude lines, where offered, "
    "into the run's [[run]] of dataset.toml.",
    "row_periods_differ": "Nothing, if the logger was set so; else look which of the files has a wrong time unit.",
    "runs_contradict": "Compare serial, mounting, mode and software of this run with the others; leave out what is not "
    "the same gyro in the same state. gyrotc diagnose looks for turn-on offsets and ageing.",
    "same_recording_twice": "Keep one of the two.",
    "small_rates": 'Declare the unit: [units] rate = "deg/s" in dataset.toml.',
    "stuck_rate": "Look at the logger and the gyro's data line there; leave the stretch out by exclude.",
    "time_drifts": "Find out which clock is right. If the gyro's is: number the rows, gyrotc import FILE --rate-hz R.",
    "time_jumps": "Number the rows instead, gyrotc import FILE --rate-hz R, or cut the file there into two runs by "
    "to_s and from_s.",
    "time_since_epoch": "State power_on_s of the run, or subtract the time of power-on; gyrotc import does that.",
}


def advice_of(id: str) -> str:
    """What to do next; empty where the doubt's own text says it."""
    return _ADVICE.get(id, "")
