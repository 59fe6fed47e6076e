"""Whole jobs for one unit: build, compare, diagnose, recalibrate, release."""
