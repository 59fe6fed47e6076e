"""Diagnosis: what the simulation gets wrong, the named cause, the extended model, the measured gain."""
