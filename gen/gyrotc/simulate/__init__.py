"""Simulation of a gyro in a thermal chamber, written as a data set like any recording (docs/simulation.md)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
