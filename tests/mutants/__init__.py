"""Faults that are planted in the generator, and who sees them."""
