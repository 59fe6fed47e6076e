"""Know a column that names the gyro of each row: by its name, and by how few values it has."""

from __future__ import annotations

from .units import words_of_name

# Words of which the name of such a column consists, beside those of `_NUMBERS`.
_DEVICES = {
    "serial", "sn", "device", "sensor", "unit", "node", "imu", "gyro", "dut", "uut", "addr", "address", "gerät",
}  # fmt: skip
_NUMBERS = {"id", "no", "nr", "number", "name", "nummer"}
# A column of more values counts, or says something else of the rows.
MAX_DEVICES = 16


def names_device(column: str) -> bool:
    """Test whether the name of a column is that of a serial, or of a number of a device."""
    words = set(words_of_name(column))
    return words == {"id"} or (bool(words & _DEVICES) and words <= _DEVICES | _NUMBERS)
