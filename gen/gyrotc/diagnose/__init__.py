"""Diagnosis: what the simulation gets wrong, the named cause, the extended model, the measured gain.

`diagnose` is the whole job; docs/diagnosis.md tells the method. The causes' physics stand in `terms`; here are
statistics and words.
"""

from .result import Diagnosis, diagnose

__all__ = ["Diagnosis", "diagnose"]
