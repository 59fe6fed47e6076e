"""Other forms of a correction: parameters of autopilots, tables of the map, a unit of co-simulation."""

from .job import Exporting, Format, export

__all__ = ["Exporting", "Format", "export"]
