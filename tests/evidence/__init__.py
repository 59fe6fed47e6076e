"""Recordings that are no evidence: copies, and faults of timing, holding and pairing; what is found of drawn ones."""
