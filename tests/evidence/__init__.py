"""Recordings that are no evidence: faults of timing, holding and pairing; what is found of drawn ones."""
