"""Whole jobs over the stages of the house: build, fleet, compare, diagnose into a folder."""
