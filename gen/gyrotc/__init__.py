"""gyrotc: from thermal-chamber recordings of a gyro to verified C tables that compensate its bias."""

__version__ = "0.1.0"
