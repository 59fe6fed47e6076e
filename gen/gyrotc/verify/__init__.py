"""Proof that emitted C is what the model gives and computes on every target what the reference computes."""
