"""Training: samples in, networks out (docs/training.md)."""
