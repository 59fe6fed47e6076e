"""Simulation of a gyro in a thermal chamber, written as a data set like any recording (docs/simulation.md)."""
